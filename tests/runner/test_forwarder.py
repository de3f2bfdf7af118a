"""The forwarder at an arm of no ROS, and the link to one."""

from __future__ import annotations

import os
import re
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from jacokin.errors import InvalidInputError
from jacokin.runner import ProcessLink, forwarder
from jacokin.runner.forwarder import Forwarder


class Arm:
    """An arm that may not hear its fingers yet."""

    def __init__(self) -> None:
        self.heard, self.shares = False, list[float]()

    def listens(self) -> bool:
        return True

    def hears_fingers(self) -> bool:
        return self.heard

    def turn(self, v: Sequence[float]) -> None:
        """Nothing."""

    def move_fingers(self, share: float) -> None:
        self.shares.append(share)

    def close(self) -> None:
        """Nothing."""


def test_fingers_are_moved_once_they_listen(capsys: pytest.CaptureFixture[str]) -> None:
    """A topic forgets what is published before; that of the fingers may be connected after that of velocities."""
    arm: Any = Arm()
    forwarder = Forwarder(lambda _: None)
    forwarder.attach(arm)
    forwarder.hear('{"fingers": 0.5}')
    forwarder.watch()
    assert arm.shares == []
    forwarder.end()
    assert "nobody listens to the fingers" in capsys.readouterr().err
    arm.heard = True
    forwarder.watch()
    forwarder.watch()
    assert arm.shares == [0.5]
    forwarder.hear('{"fingers": 1.0}')
    assert arm.shares == [0.5, 1.0]
    forwarder.end()
    assert capsys.readouterr().err == ""


def test_joint_states_of_other_joints_are_told() -> None:
    said: list[dict[str, Any]] = []
    forwarder = Forwarder(said.append)
    forwarder.hear('{"joints": ["left_joint_1", "left_joint_2"]}')
    assert forwarder.lacking() == {}  # nothing was heard at all
    none: list[float] = []
    for names in (["joint_1", "joint_2"], ["finger", "joint_1"], ["left_joint_1"]):
        forwarder.take(SimpleNamespace(name=names, position=[0.0] * len(names), velocity=none, effort=none))
    assert forwarder.lacking() == {"missing": ["left_joint_2"], "heard": ["joint_1", "joint_2", "finger"]}
    assert said == []
    forwarder.take(SimpleNamespace(name=["left_joint_2"], position=[0.1], velocity=none, effort=none))
    assert forwarder.lacking() == {}
    assert said == [{"q": [0.0, 0.1], "v": None, "torques": None}]


def linked(program: str) -> ProcessLink:
    return ProcessLink([sys.executable, "-P", "-c", program], ["joint_1"])


def expect_refusal(link: ProcessLink, match: str) -> None:
    """Listen until the link says what is wrong, and close it."""
    deadline = time.monotonic() + 20.0

    def listen() -> None:
        while time.monotonic() < deadline:
            link.hear()

    with pytest.raises(InvalidInputError, match=match):
        listen()
    link.close()


def test_a_forwarder_that_ends_in_the_middle_of_a_line_has_left() -> None:
    link = linked("print('{\"q\": [1.0]}'); print('{\"q\": [1', end='')")
    expect_refusal(link, "the forwarder has left")


def test_what_a_forwarder_said_before_it_left_at_once_is_heard(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> int:
        raise BrokenPipeError

    with monkeypatch.context() as patched:
        patched.setattr(os, "write", refuse)
        link = linked('print(\'{"error": "no arm"}\')')
    expect_refusal(link, "no arm")


def test_a_python_without_ros_is_told_what_to_do() -> None:
    link = ProcessLink([sys.executable, "-I", "-S", forwarder.__file__, "--ros", "2", "--robot", "ur5"], ["joint_1"])
    expect_refusal(link, re.escape(f"{sys.executable} has no ROS 2 (No module named 'rclpy'): source its setup.bash"))


def test_a_link_that_is_closed_touches_no_other_file(tmp_path: Path) -> None:
    link = linked("input()")
    link.close()
    link.close()
    with (tmp_path / "a").open("w+b") as first, (tmp_path / "b").open("w+b") as second:  # may have its numbers
        for use in (link.hear, lambda: link.send(np.zeros(1))):
            with pytest.raises(InvalidInputError, match="the link to the arm is closed"):
                use()
        assert not first.read() + second.read()


@pytest.mark.parametrize("command", [[], "cat", [3], ["/no/such/program"], ["a\0b"]], ids=repr)
def test_a_command_that_cannot_be_started_is_refused(command: Any) -> None:
    with pytest.raises(InvalidInputError, match="command|does not start"):
        ProcessLink(command, ["joint_1"])


@pytest.mark.parametrize("share", ["NaN", "1.1", "-0.1", "6800"])
def test_fingers_go_nowhere_else_than_from_open_to_closed(share: str) -> None:
    arm: Any = Arm()
    arm.heard = True
    forwarder = Forwarder(lambda _: None)
    forwarder.attach(arm)
    with pytest.raises(ValueError, match="fingers must be from 0 to 1"):
        forwarder.hear(f'{{"fingers": {share}}}')
    assert arm.shares == []
