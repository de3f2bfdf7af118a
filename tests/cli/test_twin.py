"""`jacokin twin` without ROS: what is refused, and how. At ROS it is tested in tests/ros."""

from __future__ import annotations

import json
import signal
import sys
from collections.abc import Callable
from dataclasses import dataclass

import click
import pytest

from jacokin.cli import twin
from jacokin.twin import KinovaDriver, SimulatedArm
from tests.cli.run import Run


@pytest.mark.parametrize(("version", "package"), [("1", "rospy"), ("2", "rclpy")])
def test_without_ros_it_says_what_to_install(
    run: Run, monkeypatch: pytest.MonkeyPatch, version: str, package: str
) -> None:
    monkeypatch.setitem(sys.modules, package, None)  # as if it were not installed
    answer = run("twin", "--ros", version, code=2)
    assert f"{package} is needed" in answer.err
    assert "apt-get install" in answer.err


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (("--fast",), "--ros"),
        (("--ros", "3"), "'1', '2'"),
        (("--ros", "1", "--robot", "gen3"), "j2n6s300"),
        (("--ros", "1", "--robot", "my/panda.urdf"), "--robot: unknown robot 'my/panda.urdf'. Valid: j2n6s300"),
        (("--ros", "1", "--faults", "lag"), "lag=0.02,loss=0.01"),
        (("--ros", "1", "--faults", "delay=1"), "lag, loss, stall"),
        (("--ros", "1", "--from", "0", "0", "0", "0", "0", "0"), "outside the limits"),
        (("--ros", "1", "--from", "1", "2"), "--from must be 6 numbers, got 2"),
        (("--ros", "1", "--name", "my arm"), "--name must be letters"),
        (("--ros", "1", "--camera", "wrist"), "--task"),
        (("--ros", "2", "--task", "lift_brick", "--robot", "j2n6s200"), "--task has its robot"),
        (("--ros", "2", "--pace", "0"), "0"),
    ],
)
def test_what_is_refused(run: Run, words: tuple[str, ...], why: str) -> None:
    assert why in run("twin", *words, code=2).err


@dataclass
class Node:
    """A node of no ROS."""

    leaves: bool

    def run(self, watch: Callable[[], None], goes_on: Callable[[], bool]) -> None:
        """Nothing: it has ended."""

    def close(self) -> None:
        """Leave, if it can."""
        if not self.leaves:
            raise OSError("the master has gone")


@pytest.mark.parametrize(("word", "code"), [("ready", 128 + signal.SIGTERM), ("no word", 2)])
def test_its_record_comes_whenever_it_ends(run: Run, monkeypatch: pytest.MonkeyPatch, word: str, code: int) -> None:
    """On a signal that comes as soon as it is ready, and where something is wrong as it leaves."""
    say = click.echo

    def leave(text: str, *, err: bool = False) -> None:
        say(text, err=err)
        if word in text:
            raise SystemExit(128 + signal.SIGTERM)  # as at that signal

    monkeypatch.setattr(twin, "_node", lambda *_: (KinovaDriver(SimulatedArm()), Node(word == "ready")))
    monkeypatch.setattr(click, "echo", leave)
    assert len(json.loads(run("twin", "--ros", "1", "--json", code=code).out)["angles"]) == 6
