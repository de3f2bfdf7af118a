"""Programs in a process of their own, and which of MuJoCo's rendering back ends work on this machine."""

from __future__ import annotations

import functools
import os
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

import pytest

from jacokin.cli import doctor


def execute(
    *words: str | Path,
    code: int = 0,
    cwd: Path | None = None,
    timeout: float = 600.0,
    environment: Mapping[str, str] = MappingProxyType({}),
) -> subprocess.CompletedProcess[str]:
    """What a program printed that ended with this code, with variables of the environment beside those of the tests."""
    done = subprocess.run(
        [str(word) for word in words],
        env={**os.environ, **environment},
        cwd=cwd,
        timeout=timeout,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == code, done.stdout + done.stderr
    return done


def python(*words: str | Path, **settings: Any) -> subprocess.CompletedProcess[str]:  # Any: those of `execute`
    """The same of Python, which looks for no modules in the folder that it runs in."""
    return execute(sys.executable, "-P", *words, **settings)


@functools.cache
def backends() -> tuple[str, ...]:
    """Values of MUJOCO_GL that draw a picture here."""
    return tuple(finding.name for finding in doctor.check_renderers() if finding.state == doctor.OK)


def run_drawing(*words: str | Path, **environment: str) -> str:
    """Run Python where MuJoCo can draw, without a failure; returns what it prints. Skips where nothing draws."""
    if not backends():
        pytest.skip("no rendering back end works here")
    return python(*words, environment={**environment, "MUJOCO_GL": backends()[0]}).stdout
