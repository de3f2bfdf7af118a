"""`jacokin twin` without ROS: what is refused, and how. At ROS it is tested in tests/ros."""

from __future__ import annotations

import sys

import pytest

from tests.cli.run import Run


@pytest.mark.parametrize(("version", "package"), [("1", "rospy"), ("2", "rclpy")])
def test_without_ros_it_says_what_to_install(
    run: Run, monkeypatch: pytest.MonkeyPatch, version: str, package: str
) -> None:
    monkeypatch.setitem(sys.modules, package, None)  # as if it were not installed
    answer = run("twin", "--ros", version)
    assert answer.code == 2
    assert f"{package} is needed" in answer.err
    assert "apt-get install" in answer.err


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (("--fast",), "--ros"),
        (("--ros", "3"), "'1', '2'"),
        (("--ros", "1", "--robot", "gen3"), "j2n6s300"),
        (("--ros", "1", "--faults", "lag"), "lag=0.02,loss=0.01"),
        (("--ros", "1", "--faults", "delay=1"), "lag, loss, stall"),
        (("--ros", "1", "--from", "0", "0", "0", "0", "0", "0"), "outside the limits"),
        (("--ros", "1", "--from", "1", "2"), "6"),
        (("--ros", "1", "--name", "my arm"), "--name must be letters"),
        (("--ros", "1", "--camera", "wrist"), "--task"),
        (("--ros", "2", "--task", "lift_brick", "--robot", "j2n6s200"), "--task has its robot"),
        (("--ros", "2", "--pace", "0"), "0"),
    ],
)
def test_what_is_refused(run: Run, words: tuple[str, ...], why: str) -> None:
    answer = run("twin", *words)
    assert answer.code == 2
    assert why in answer.err
