"""`jacokin view` as a process: the address it prints, Ctrl-C, and what it refuses."""

from __future__ import annotations

import signal
import subprocess
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from jacokin.viewer import serve
from jacokin.viewer.viewer import Viewer
from tests.cli.run import Run, running
from tests.viewer.page import port_of


@contextmanager
def viewing(*words: str) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """A running viewer and its address."""
    with running("view", "--port", "0", *words) as process:
        assert process.stdout is not None
        yield process, process.stdout.readline()


@pytest.mark.parametrize(
    ("number", "code"), [(signal.SIGINT, 0), pytest.param(signal.SIGTERM, 143, marks=pytest.mark.slow)]
)
@pytest.mark.slow
def test_it_prints_its_address_and_ends_cleanly_without_any_browser(number: signal.Signals, code: int) -> None:
    with viewing("--target", "0.3", "-0.2", "0.5") as (process, line):
        address, rest = line.split(maxsplit=1)
        assert rest == "shows j2n6s300; Ctrl-C ends it\n"
        with urllib.request.urlopen(address, timeout=60.0) as page:
            assert page.status == 200
        process.send_signal(number)
        out, err = process.communicate(timeout=60.0)
    assert (process.returncode, out) == (code, "")
    assert err.splitlines() == (["closed"] if code == 0 else [])


@pytest.mark.slow
def test_a_port_in_use_is_one_sentence(run: Run) -> None:
    with serve(port=0) as viewer:
        port = str(port_of(viewer))
        said = run("view", "--port", port, code=2).err
    assert f"jacokin: --port {port} of 127.0.0.1 cannot be used (Address already in use); choose another" in said


def test_its_options_are_those_of_the_page(monkeypatch: pytest.MonkeyPatch, run: Run) -> None:
    """Tool, limits, free axis and its range, and meshes are taken."""

    def interrupt(_: Viewer) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(Viewer, "wait", interrupt)
    arm = "--tool 0 0 0.05 --limit joint_2=1,5 --finger-angle 0.4 --visuals"
    free = "--free-axis z --free-range -20 30 --degrees --target 0.3 -0.2 0.5 0 1 0 0"
    said = run("view", "--port", "0", *arm.split(), *free.split())
    assert said.out.startswith("http://127.0.0.1:")
    assert said.err.endswith("closed\n")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--target", "1", "2"], "--target must be 3 numbers, or 7 with a quaternion, got 2"),
        (["--target", "1", "2", "3", "0", "0", "0", "0"], "--target: quat_wxyz must have norm 1"),
        (["--tool", "nan", "0", "0"], "--tool: position must"),
        (["--target", "left"], "--target must be numbers, got 'left'"),
        (["--target", "nan", "0", "0"], "finite"),
        (["--tool", "1", "2"], "--tool must be 3 numbers, or 7 with a quaternion, got 2"),
        (["--limit", "joint_2"], "--limit must be JOINT=LOW,HIGH"),
        (["--limit", "joint_9=1,2"], "joint_9"),
        (["--limit", "joint_2=5,1"], "lower 5.0 must not be above upper 1.0"),
        (["--free-axis", "w"], "Valid: x, y, z"),
        (["--free-axis", "z", "--free-range", "2", "1"], "range must be"),
        (["--map", "nowhere"], "nowhere"),
        (["--map", "m1n6s300"], "is a map of another robot"),
        (["--trajectory", "nothing.json"], "nothing.json"),
        (["--finger-angle", "9"], "the fingers move from"),
    ],
)
def test_wrong_options_are_one_sentence(words: list[str], message: str, run: Run) -> None:
    assert message in run("view", "--port", "0", *words, code=2).err
