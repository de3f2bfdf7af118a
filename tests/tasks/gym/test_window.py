"""render_mode="human": a window on a display that exists in memory only."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
XVFB = shutil.which("xvfb-run")
PROGRAM = """
import runpy, sys
sys.path.append(sys.argv.pop(1))
runpy.run_module("tests.tasks.gym.window_program", run_name="__main__")
"""


def run(*before: str, end: str, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [*before, sys.executable, "-P", "-c", PROGRAM, str(ROOT), end],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        timeout=240,
        check=False,
    )


@pytest.mark.slow
@pytest.mark.skipif(XVFB is None, reason="there is no xvfb-run (Debian: apt-get install xvfb)")
@pytest.mark.parametrize("end", ["close", "leave"])
def test_an_episode_in_a_window_is_the_same_and_ends_well(end: str) -> None:
    assert XVFB is not None
    done = run(XVFB, "-a", end=end)
    assert (done.returncode, done.stdout.strip()) == (0, "done"), done.stderr


def test_a_display_that_is_not_there_is_said() -> None:
    done = run(end="close", DISPLAY=":4711", WAYLAND_DISPLAY="")
    assert done.returncode == 1
    assert "PhysicsError: no window can be opened on the display" in done.stderr
