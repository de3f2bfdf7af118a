"""render_mode="human": a window on a display that exists in memory only."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import pytest

from tests.programs import execute, python

ROOT = Path(__file__).parents[3]
XVFB = shutil.which("xvfb-run")
PROGRAM = """
import runpy, sys
sys.path.append(sys.argv.pop(1))
runpy.run_module("tests.tasks.gym.window_program", run_name="__main__")
"""


@pytest.mark.slow
@pytest.mark.skipif(XVFB is None, reason="there is no xvfb-run (Debian: apt-get install xvfb)")
@pytest.mark.parametrize("end", ["close", "leave"])
def test_an_episode_in_a_window_is_the_same_and_ends_well(end: str) -> None:
    assert XVFB is not None
    assert execute(XVFB, "-a", sys.executable, "-P", "-c", PROGRAM, ROOT, end).stdout.strip() == "done"


def test_a_display_that_is_not_there_is_said() -> None:
    nowhere = {"DISPLAY": ":4711", "WAYLAND_DISPLAY": ""}
    done = python("-c", PROGRAM, ROOT, "close", code=1, environment=nowhere)
    assert "PhysicsError: no window can be opened on the display" in done.stderr
