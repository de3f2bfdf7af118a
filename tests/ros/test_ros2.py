"""The sender at ROS 2, real nodes on the loopback interface, in an environment of its own."""

from __future__ import annotations

import signal
from pathlib import Path

import numpy as np
import pytest

from jacokin.motion import Trajectory
from tests.ros.nodes import Ros, interrupt, lose

pytestmark = pytest.mark.slow
HERE = Path(__file__).parent / "ros2"
CONTROLLER = ("--action", "/arm_controller/follow_joint_trajectory", "--states", "/joint_states", "--ros", "2")


@pytest.fixture
def ros(ros2: Ros) -> Ros:
    return ros2


def where(motion: Trajectory, turns: int = 0) -> list[str]:
    """Options of an arm that stands at the first row, with joint 4 so many turns away."""
    return ["--angles", *map(repr, (np.degrees(motion.q[0]) + 360.0 * turns * np.eye(6)[3]).tolist())]


@pytest.mark.parametrize("words", [("--best-effort",), ("--gripper",)])
def test_a_goal_is_reached(ros: Ros, motion: Trajectory, file: Path, words: tuple[str, ...]) -> None:
    with ros.arm(HERE / "arm.py", *words, *where(motion)) as arm:
        status, output, errors = ros.send(file, *CONTROLLER)
        record = arm.ends()
    assert status == 0, errors
    np.testing.assert_allclose(record["angles"], np.degrees(motion.q[-1]), atol=1e-9)
    assert "ends 0.00 deg from the last point" in output


def test_whole_turns_are_added_or_refused(ros: Ros, motion: Trajectory, file: Path) -> None:
    with ros.arm(HERE / "arm.py", *where(motion, turns=-2)) as arm:
        status, _, errors = ros.send(file, *CONTROLLER)
        assert status == 1
        assert "j2n6s300_joint_4 stands -2 whole turns" in errors
        status, _, errors = ros.send(file, *CONTROLLER, "--unlimited", "j2n6s300_joint_4")
        assert status == 0, errors
        record = arm.ends()
    assert record["largest_step"] < 5.0  # [deg]
    assert record["angles"][3] == pytest.approx(np.degrees(motion.q[-1, 3]) - 720.0)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_signals_cancel(ros: Ros, motion: Trajectory, file: Path, number: signal.Signals) -> None:
    with ros.arm(HERE / "arm.py", *where(motion)) as arm:
        status, errors, seconds = interrupt(ros.sending(file, *CONTROLLER), arm, number)
        record = arm.ends()
    assert (status, record["goals"], record["cancelled"]) == (1, 1, 1), errors
    assert "told to stop" in errors
    assert seconds < 3.0


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP])
def test_a_sender_that_is_killed_or_hangs_has_its_goal_cancelled(
    ros: Ros, motion: Trajectory, file: Path, number: signal.Signals
) -> None:
    with ros.arm(HERE / "arm.py", *where(motion)) as arm:
        record, errors = lose(ros.sending(file, *CONTROLLER), arm, number)
    assert (record["goals"], record["cancelled"]) == (1, 1)
    assert "the goal was cancelled" in errors
    gone = np.abs(np.array(record["angles"]) - np.degrees(motion.q[0])).max()
    assert 0.0 < gone < 0.9 * np.abs(np.degrees(motion.q[-1] - motion.q[0])).max()


@pytest.mark.parametrize(
    ("words", "why"), [(("--die-after", "0.5"), "the controller died"), (("--reject",), "rejected the goal")]
)
def test_a_controller_that_dies_or_rejects_is_noticed(
    ros: Ros, motion: Trajectory, file: Path, words: tuple[str, ...], why: str
) -> None:
    with ros.arm(HERE / "arm.py", *words, *where(motion)):
        status, _, errors = ros.send(file, *CONTROLLER)
    assert status == 1
    assert why in errors


def test_without_anybody_there_it_ends(ros: Ros, file: Path) -> None:
    status, _, errors = ros.send(file, *CONTROLLER)
    assert status == 1
    assert "nothing on /joint_states says where the arm is" in errors
