"""The sender at ROS 1, real nodes on the loopback interface: kinova-ros, as its source reads, and other controllers."""

from __future__ import annotations

import dataclasses
import signal
import time
from pathlib import Path

import numpy as np
import pytest

from jacokin.motion import Trajectory
from tests.ros.nodes import Ros, finish, free_port, interrupt, lose

pytestmark = pytest.mark.slow
HERE = Path(__file__).parent / "ros1"
OTHER = ("--action", "/arm_controller/follow_joint_trajectory", "--states", "/joint_states")


@pytest.fixture
def ros(ros1: Ros) -> Ros:
    return ros1


@pytest.fixture
def files(motion: Trajectory, tmp_path: Path) -> Path:
    """A folder with the motion in each kind of file."""
    for name in ("m.json", "m.kinova.json"):
        motion.save(tmp_path / name, joint_prefix="j2n6s300_", ros=1)
    motion.save(tmp_path / "m.kinova.csv")
    return tmp_path


def where(motion: Trajectory, row: int, aside: float = 0.0, turn: tuple[int, ...] = ()) -> list[str]:
    """Options of an arm that stands at a row, so many degrees or whole turns of some joints away."""
    angles = np.degrees(motion.q[row]) + aside
    angles[list(turn)] += 360.0
    return ["--angles", *map(repr, angles.tolist())]


def test_kinova_ros_ends_where_the_file_does(ros: Ros, motion: Trajectory, files: Path) -> None:
    with ros.arm(HERE / "arm.py", "--kinova", *where(motion, 0, turn=(5,))) as arm:
        status, output, errors = ros.send(files / "m.kinova.json")
        record = arm.ends()
    assert status == 0, errors
    assert "issue 191" in errors  # said before the goal is sent
    away = np.abs(np.array(record["angles"]) - np.degrees(motion.q[-1]) - np.array([0, 0, 0, 0, 0, 360])).max()
    assert away < 0.5
    assert record["goals"] == 1
    assert float(output.partition("arm ends ")[2].split()[0]) == pytest.approx(away, abs=0.02)


def test_kinova_ros_gets_no_points_of_another_step(ros: Ros, motion: Trajectory, files: Path) -> None:
    """Played one each 10 ms, 300 points that are 5 ms apart would take the arm twice as far."""
    with ros.arm(HERE / "arm.py", "--kinova", *where(motion, 0)) as arm:
        for words in ((), ("--action", "/j2n6s300/follow_joint_trajectory", "--states", "/joint_states")):
            status, _, errors = ros.send(files / "m.json", *words)
            assert status == 1
            assert "one point each 10 ms" in errors
            assert ".kinova.json" in errors
        record = arm.ends()
    assert record["goals"] == 0


def test_whole_turns_are_added_or_refused(ros: Ros, motion: Trajectory, files: Path) -> None:
    """A controller of positions that gets them as they are jumps by a turn."""
    with ros.arm(HERE / "arm.py", *where(motion, 0, turn=(3, 5))) as arm:
        status, _, errors = ros.send(files / "m.json", *OTHER)
        assert status == 1
        assert "j2n6s300_joint_4 stands +1 whole turns" in errors
        named = ("--unlimited", "j2n6s300_joint_4", "j2n6s300_joint_6")
        status, output, errors = ros.send(files / "m.json", *OTHER, *named)
        assert status == 0, errors
        record = arm.ends()
    assert record["goals"] == 1
    assert record["largest_step"] < 2.0  # [deg] in 10 ms
    np.testing.assert_allclose(record["angles"], np.degrees(motion.q[-1]) + np.array([0, 0, 0, 360, 0, 360]), atol=1e-6)
    assert "ends 0.00 deg from the last point" in output


def test_every_velocity_arrives(ros: Ros, motion: Trajectory, files: Path) -> None:
    """From the first: what is published before the driver listens is lost."""
    rows = np.loadtxt(files / "m.kinova.csv", delimiter=",", skiprows=1)
    with ros.arm(HERE / "arm.py", "--kinova", *where(motion, 0)) as arm:
        status, output, errors = ros.send(files / "m.kinova.csv")
        record = arm.ends()
    assert status == 0, errors
    heard = np.array(record["heard"])
    np.testing.assert_allclose(heard[: len(rows)], rows[:, 7:], atol=1e-4)  # of 32 bits
    assert (heard[len(rows) :] == 0.0).all()
    np.testing.assert_allclose(record["angles"], np.degrees(motion.q[-1]), atol=0.01)
    assert "ends 0.00 deg" in output


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_signals_stop_velocities_and_goals(ros: Ros, motion: Trajectory, files: Path, number: signal.Signals) -> None:
    with ros.arm(HERE / "arm.py", "--kinova", *where(motion, 0)) as arm:
        status, errors, seconds = interrupt(ros.sending(files / "m.kinova.csv"), arm, number)
        record = arm.ends()
    assert status == 1
    assert "told to stop" in errors
    assert 50 < len(record["heard"]) < 250
    assert record["heard"][-1] == [0.0] * 6
    assert record["waiting"] == 0
    with ros.arm(HERE / "arm.py", *where(motion, 0)) as arm:
        status, errors, seconds = interrupt(ros.sending(files / "m.json", *OTHER), arm, number)
        record = arm.ends()
    assert (record["goals"], record["cancelled"]) == (1, 1), errors
    assert status == 1
    assert "told to stop" in errors
    assert seconds < 2.0


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP])
def test_a_sender_that_is_killed_or_hangs_has_its_goal_cancelled(
    ros: Ros, motion: Trajectory, files: Path, number: signal.Signals
) -> None:
    with ros.arm(HERE / "arm.py", *where(motion, 0)) as arm:
        record, errors = lose(ros.sending(files / "m.json", *OTHER), arm, number)
    assert (record["goals"], record["cancelled"]) == (1, 1)
    assert "the goal was cancelled" in errors
    gone = np.abs(np.array(record["angles"]) - np.degrees(motion.q[0])).max()
    assert 0.0 < gone < 0.9 * np.abs(np.degrees(motion.q[-1] - motion.q[0])).max()


@pytest.mark.parametrize(
    ("aside", "number", "status"),
    [(0.0, None, 0), (5.0, None, 1), (0.0, signal.SIGINT, 1)],
    ids=["sent", "refused", "interrupted"],
)
def test_a_sender_leaves_the_master_as_it_was(
    ros: Ros, motion: Trajectory, files: Path, aside: float, number: signal.Signals | None, status: int
) -> None:
    """Of a node that stays registered the address is given to others, and a driver that asks there may hang."""
    with ros.arm(HERE / "arm.py", *where(motion, 0, aside)) as arm:
        before = ros.registered()
        sender = ros.sending(files / "m.json", *OTHER)
        ended = finish(sender)[0] if number is None else interrupt(sender, arm, number)[0]
        assert ended == status
        assert ros.registered() == before


def test_ctrl_c_on_a_goal_of_kinova_ros_says_what_it_does(ros: Ros, motion: Trajectory, files: Path) -> None:
    with ros.arm(HERE / "arm.py", "--kinova", *where(motion, 0)) as arm:
        status, errors, seconds = interrupt(ros.sending(files / "m.kinova.json"), arm, signal.SIGINT)
        record = arm.ends()
    assert (status, record["cancelled"]) == (1, 1)
    assert errors.count("dies of a cancelled goal") == 2  # before, and when it happened
    assert ".kinova.csv" in errors
    assert seconds < 2.0


def test_a_controller_that_dies_is_noticed(ros: Ros, motion: Trajectory, files: Path) -> None:
    with ros.arm(HERE / "arm.py", "--die-after", "0.5", *where(motion, 0)):
        begun = time.monotonic()
        status, _, errors = ros.send(files / "m.json", *OTHER)
    assert status == 1
    assert "the controller died" in errors
    assert time.monotonic() - begun < 10.0


def test_a_controller_that_ends_elsewhere_is_not_believed(ros: Ros, motion: Trajectory, files: Path) -> None:
    with ros.arm(HERE / "arm.py", "--short", "3.0", *where(motion, 0)):
        status, _, errors = ros.send(files / "m.json", *OTHER)
    assert status == 1
    assert "the arm ends 3.00 deg from the last point (0.5 allowed)" in errors


def test_a_goal_that_does_not_end_is_cancelled(ros: Ros, motion: Trajectory, files: Path) -> None:
    with ros.arm(HERE / "arm.py", "--hang", *where(motion, 0)) as arm:
        status, _, errors = ros.send(files / "m.json", *OTHER)
        record = arm.ends()
    assert (status, record["cancelled"]) == (1, 1)
    assert "did not end within 10 s" in errors


def test_a_gripper_has_states_of_its_own(ros: Ros, motion: Trajectory, files: Path) -> None:
    with ros.arm(HERE / "arm.py", "--gripper", *where(motion, 0)):
        status, output, errors = ros.send(files / "m.json", *OTHER)
    assert status == 0, errors
    assert "ends 0.00 deg from the last point" in output


@pytest.mark.parametrize("name", ["m.kinova.csv", "m.kinova.json"])
def test_without_a_master_it_ends(ros: Ros, files: Path, name: str) -> None:
    elsewhere = dict(ros.environment) | {"ROS_MASTER_URI": f"http://127.0.0.1:{free_port()}"}
    begun = time.monotonic()
    status, _, errors = dataclasses.replace(ros, environment=elsewhere).send(files / name)
    assert status == 1
    assert "no ROS master at http://127.0.0.1" in errors
    assert time.monotonic() - begun < 15.0
