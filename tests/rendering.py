"""Which of MuJoCo's rendering back ends work on this machine, and processes that draw with the first of them."""

from __future__ import annotations

import functools
from pathlib import Path

import pytest

from jacokin.cli import doctor
from tests.programs import python


@functools.cache
def backends() -> tuple[str, ...]:
    """Values of MUJOCO_GL that draw a picture here."""
    return tuple(finding.name for finding in doctor.check_renderers() if finding.state == doctor.OK)


def run_drawing(*words: str | Path, **environment: str) -> str:
    """Run Python where MuJoCo can draw, without a failure; returns what it prints. Skips where nothing draws."""
    if not backends():
        pytest.skip("no rendering back end works here")
    return python(*words, environment={**environment, "MUJOCO_GL": backends()[0]}).stdout
