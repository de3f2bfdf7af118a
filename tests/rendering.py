"""Which of MuJoCo's rendering back ends work on this machine, and processes that draw with the first of them."""

from __future__ import annotations

import functools
import os
import subprocess
import sys
from pathlib import Path

import pytest

from jacokin.cli import doctor


@functools.cache
def backends() -> tuple[str, ...]:
    """Values of MUJOCO_GL that draw a picture here."""
    return tuple(finding.name for finding in doctor.check_renderers() if finding.state == doctor.OK)


def run_drawing(*words: str | Path, **environment: str) -> str:
    """Run Python where MuJoCo can draw, without a failure; returns what it prints. Skips where nothing draws."""
    if not backends():
        pytest.skip("no rendering back end works here")
    done = subprocess.run(
        [sys.executable, "-P", *words],
        env={**os.environ, **environment, "MUJOCO_GL": backends()[0]},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout
