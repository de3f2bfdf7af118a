"""The example that sends a saved trajectory: when it sends, how fast, and when it stops. Real ROS is in tests/ros."""

from __future__ import annotations

import functools
import itertools
import math
import subprocess
import sys
from collections import deque
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from examples import send_trajectory
from examples.send_trajectory import PERIOD, AwayError, Rehearsal, StoppedError, read_velocities, send_velocities
from jacokin import Robot
from jacokin.motion import Trajectory, move_joints


@pytest.fixture(scope="module")
def motion(robot: Robot) -> Trajectory:
    return move_joints(robot, robot.home, robot.home + np.array([0.5, 0.2, -0.3, 4.0, 0.1, -1.0]), dt=0.01)


@pytest.fixture
def rows(motion: Trajectory, tmp_path: Path) -> tuple[list[list[float]], list[list[float]]]:
    motion.save(tmp_path / "m.kinova.csv")
    return read_velocities(tmp_path / "m.kinova.csv")


class Faulty(Rehearsal):
    """An arm that is also late, slow, or silent after a while; it keeps what it was sent, and when."""

    def __init__(self, angles: list[float], *, speed: float = 1.0, silent_after: float = math.inf) -> None:
        """`speed` is the share of velocities that it does."""
        super().__init__(angles)
        self.sent: list[tuple[float, list[float]]] = []
        self._speed, self._silent_after = speed, silent_after

    def publish(self, velocities: list[float]) -> None:
        self.sent.append((self.time, velocities))
        super().publish([self._speed * velocity for velocity in velocities])

    def measured(self) -> tuple[list[float], float]:
        return self.angles, max(0.0, self.time - self._silent_after)


def test_the_arm_ends_at_the_last_row(rows: tuple[list[list[float]], list[list[float]]]) -> None:
    arm = Faulty([angle + 720.0 for angle in rows[0][0]])  # joints may stand whole turns away
    assert send_velocities(*rows, arm, arm) < 1e-6
    times = [time for time, _ in arm.sent]
    np.testing.assert_allclose(np.diff(times[: len(rows[0])]), PERIOD, atol=1e-9)
    assert [velocities for _, velocities in arm.sent][: len(rows[1])] == rows[1]


def test_what_is_late_is_not_sent_faster(rows: tuple[list[list[float]], list[list[float]]]) -> None:
    arm = Faulty(rows[0][0])
    pause, wait = itertools.chain([0.0] * 20, [0.4], itertools.repeat(0.0)), arm.sleep
    arm.sleep = lambda seconds: wait(seconds + next(pause))  # type: ignore[method-assign]
    send_velocities(*rows, arm, arm)
    times = np.array([time for time, _ in arm.sent])
    assert np.diff(times).max() > 0.3
    assert (times[12:] - times[:-12]).min() > 0.1  # one period at most is made up for


@pytest.mark.parametrize(
    ("fault", "message"),
    [({"speed": 0.5}, "from the way of the file"), ({"silent_after": 1.0}, "no angles from the driver")],
)
def test_it_stops_when_the_arm_does_not_follow(
    rows: tuple[list[list[float]], list[list[float]]], fault: dict[str, float], message: str
) -> None:
    arm = Faulty(rows[0][0], **fault)
    with pytest.raises(StoppedError, match=message):
        send_velocities(*rows, arm, arm)
    assert len(arm.sent) < len(rows[1])
    assert arm.sent[-1][1] == [0.0] * 6


@pytest.mark.parametrize(("aside", "silent"), [(3.0, math.inf), (0.0, -math.inf)])
def test_nothing_is_sent_to_an_arm_that_is_elsewhere(
    rows: tuple[list[list[float]], list[list[float]]], aside: float, silent: float
) -> None:
    arm = Faulty([angle + aside for angle in rows[0][0]], silent_after=silent)
    with pytest.raises(StoppedError, match=r"from where the file begins|does not say where"):
        send_velocities(*rows, arm, arm)
    assert not arm.sent


def test_ctrl_c_ends_with_zero(rows: tuple[list[list[float]], list[list[float]]]) -> None:
    arm = Faulty(rows[0][0])
    measure, left = arm.measured, iter(range(50))

    def interrupted() -> tuple[list[float], float]:
        if next(left, None) is None:
            raise KeyboardInterrupt
        return measure()

    arm.measured = interrupted  # type: ignore[method-assign]
    with pytest.raises(KeyboardInterrupt):
        send_velocities(*rows, arm, arm)
    assert arm.sent[-1][1] == [0.0] * 6


def test_interruptions_in_the_midst_of_ros_come_after_it() -> None:
    """What is raised in a callback of rclpy ends as another error, without a word of the arm."""
    held, passed = send_trajectory.Undisturbed(), list[str]()

    def spin() -> None:
        with held:
            held.interrupt("SIGTERM")
            passed.append("the end")

    with pytest.raises(KeyboardInterrupt, match="SIGINT"):
        held.interrupt("SIGINT")
    with pytest.raises(KeyboardInterrupt, match="SIGTERM"):
        spin()
    assert passed
    with held:  # once is enough
        pass


def test_an_arm_that_goes_on_is_waited_for(rows: tuple[list[list[float]], list[list[float]]]) -> None:
    """The last rows come late: how far the arm ends is read once it stands."""
    arm, late = Faulty(rows[0][0]), deque[tuple[float, list[float]]]()
    publish, wait, count = arm.publish, arm.sleep, itertools.count()

    def sleep(seconds: float) -> None:
        wait(seconds)
        while late and late[0][0] <= arm.time:
            publish(late.popleft()[1])

    lag = [0.0] * (len(rows[1]) - 30) + [0.4] * 100
    arm.publish = lambda velocities: late.append((arm.time + lag[next(count)], velocities))  # type: ignore[method-assign]
    arm.sleep = sleep  # type: ignore[method-assign]
    assert send_velocities(*rows, arm, arm) < 1e-6
    assert len(arm.sent) > len(rows[1])


def test_an_arm_of_which_nothing_is_heard_in_the_end(rows: tuple[list[list[float]], list[list[float]]]) -> None:
    arm = Faulty(rows[0][0], silent_after=PERIOD * len(rows[1]))
    with pytest.raises(AwayError, match="nothing says where the arm is"):
        send_velocities(*rows, arm, arm)
    assert arm.sent[-1][1] == [0.0] * 6


@pytest.mark.parametrize(("speed", "tolerance", "status"), [(1.0, 0.5, 0), (0.99, 0.5, 1), (0.99, 2.0, 0)])
def test_the_exit_code_says_whether_the_arm_is_there(
    motion: Trajectory,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    speed: float,
    tolerance: float,
    status: int,
) -> None:
    motion.save(tmp_path / "m.kinova.csv")
    words = [str(tmp_path / "m.kinova.csv"), "--rehearse", "--tolerance", str(tolerance)]
    monkeypatch.setattr("sys.argv", ["send_trajectory.py", *words])
    monkeypatch.setattr(send_trajectory, "Rehearsal", functools.partial(Faulty, speed=speed))
    monkeypatch.setattr("signal.signal", lambda *_: None)
    try:
        send_trajectory.main()
        code, said = 0, capsys.readouterr().out
    except SystemExit as end:
        code, said = 1, str(end)
    assert code == status
    assert "the arm ends" in said
    assert said.startswith("not there: ") == bool(status)


def test_other_files_are_refused(tmp_path: Path) -> None:
    (tmp_path / "a.kinova.csv").write_text("time_s,joint1_deg,joint1_deg_s\n0.00,1,2\n0.02,1,0\n")
    with pytest.raises(StoppedError, match="10 ms"):
        read_velocities(tmp_path / "a.kinova.csv")
    (tmp_path / "a.kinova.csv").write_text("time_s,joint1_deg,joint1_deg_s\n0.00,1,2\n0.01,1,2\n")
    with pytest.raises(StoppedError, match="the last row is not at rest"):
        read_velocities(tmp_path / "a.kinova.csv")
    for text in (
        "x,y,z\n1,2,3\n",
        "",
        "time_s,joint1_deg,joint1_deg_s\n0.00,1,fast\n",
        "time_s,joint1_deg\n0.00,1,2\n",
        "time_s,joint1_deg,joint1_deg_s\n0.00,1,nan\n0.01,1,0\n",
    ):
        (tmp_path / "a.kinova.csv").write_text(text)
        with pytest.raises(StoppedError, match="not a .kinova.csv file"):
            read_velocities(tmp_path / "a.kinova.csv")
    for text in ("", "[]", '{"joint_names": ["joint_1"], "points": [{}]}', '{"points": []}'):
        (tmp_path / "a.json").write_text(text)
        with pytest.raises(StoppedError, match="not a .json file"):
            send_trajectory.read_goal(tmp_path / "a.json")


class Point:
    """A point of a message."""

    def __init__(self) -> None:
        self.positions: list[float] = []
        self.velocities: list[float] = []
        self.accelerations: list[float] = []
        self.time_from_start = SimpleNamespace(secs=0, nsecs=0)


@pytest.fixture
def message(motion: Trajectory, tmp_path: Path) -> dict[str, Any]:
    motion.save(tmp_path / "m.kinova.json", joint_prefix="j2n6s300_")
    return send_trajectory.read_goal(tmp_path / "m.kinova.json")


def test_a_message_is_the_file(motion: Trajectory, tmp_path: Path) -> None:
    motion.save(tmp_path / "m.json", joint_prefix="j2n6s300_", ros=1)
    message = send_trajectory.read_goal(tmp_path / "m.json")
    filled = SimpleNamespace(joint_names=[], points=[])
    send_trajectory.fill(filled, Point, message, [0.0] * 6, ("secs", "nsecs"))
    assert filled.joint_names == [f"j2n6s300_joint_{k}" for k in range(1, 7)]
    np.testing.assert_array_equal([point.positions for point in filled.points], motion.q)
    np.testing.assert_array_equal([point.velocities for point in filled.points], motion.v)
    times = [point.time_from_start.secs + 1e-9 * point.time_from_start.nsecs for point in filled.points]
    np.testing.assert_allclose(times, motion.t, atol=1e-9)


@pytest.mark.parametrize("dt", [0.002, 0.005, 0.01, 0.05])
def test_a_file_for_kinova_ros_ends_where_it_should_in_an_open_loop(robot: Robot, dt: float, tmp_path: Path) -> None:
    """One point's velocity for each 10 ms, whatever the times of the points."""
    motion = move_joints(robot, robot.home, robot.home + np.array([0.5, 0.2, -0.3, 1.0, 0.1, -1.0]), dt=dt)
    motion.save(tmp_path / "m.kinova.json", joint_prefix="j2n6s300_", first_time=0.1)
    message = send_trajectory.read_goal(tmp_path / "m.kinova.json")
    send_trajectory.check_points(message)
    played = np.array([point["velocities"] for point in message["points"]])
    np.testing.assert_allclose(motion.q[0] + PERIOD * played.sum(axis=0), motion.q[-1], atol=1e-9)
    assert (np.abs(played) <= motion.velocity_limit + 1e-9).all()
    motion.save(tmp_path / "m.json")
    if dt != PERIOD:
        with pytest.raises(StoppedError, match="not 10 ms apart"):
            send_trajectory.check_points(send_trajectory.read_goal(tmp_path / "m.json"))


def test_whole_turns(message: dict[str, Any]) -> None:
    first = message["points"][0]["positions"]
    turned = [first[0] + math.tau + 0.01, *first[1:5], first[5] - 2 * math.tau]
    for unlimited, lacking in (([], "joint_1 stands [+]1"), (["j2n6s300_joint_1"], "joint_6 stands -2")):
        with pytest.raises(StoppedError, match=lacking):
            send_trajectory.check_start(turned, message, unlimited)
    turns = send_trajectory.check_start(turned, message, message["joint_names"])
    np.testing.assert_allclose(turns, [math.tau, 0, 0, 0, 0, -2 * math.tau])
    with pytest.raises(StoppedError, match=r"5.7 deg from where the file begins"):
        send_trajectory.check_start([angle + 0.1 for angle in first], message, message["joint_names"])


def test_a_rehearsal_takes_no_ros(motion: Trajectory, tmp_path: Path) -> None:
    motion.save(tmp_path / "m.kinova.csv")
    words = [sys.executable, send_trajectory.__file__, str(tmp_path / "m.kinova.csv"), "--rehearse"]
    done = subprocess.run(words, capture_output=True, text=True, check=True, timeout=20.0)
    assert "ends 0.00 deg" in done.stdout


@pytest.mark.parametrize(
    ("there", "wanted", "said", "version"),
    [
        ({"rospy"}, None, "", 1),
        ({"rclpy"}, None, "1", 2),
        ({"rospy", "rclpy"}, None, "1", 1),
        ({"rospy", "rclpy"}, 2, "1", 2),
        ({"rospy", "rclpy"}, None, "", "both ROS 1 and ROS 2"),
        (set(), None, "1", "not installed"),
    ],
)
def test_which_ros(
    there: set[str], wanted: int | None, said: str, version: int | str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: name if name in there else None)
    monkeypatch.setenv("ROS_VERSION", said)
    if isinstance(version, int):
        assert send_trajectory.which_ros(wanted) == version
    else:
        with pytest.raises(StoppedError, match=version):
            send_trajectory.which_ros(wanted)


def test_what_goes_to_kinova_ros(message: dict[str, Any]) -> None:
    ours, other = "/j2n6s300/follow_joint_trajectory", "/arm_controller/follow_joint_trajectory"
    assert send_trajectory.is_kinova(message, "left", ours, "/joint_states")  # by the names of its joints
    assert send_trajectory.is_kinova(message, "left", "/left/follow_joint_trajectory", "/joint_states")
    assert send_trajectory.is_kinova(message, "left", other, "/left_driver/out/joint_state")
    assert not send_trajectory.is_kinova(message, "left", other, "/joint_states")


def test_joint_states_of_an_arm_and_a_gripper() -> None:
    states = send_trajectory.JointStates("/joint_states", ["joint_1", "joint_2"])
    assert states.age() == math.inf
    assert "nothing on /joint_states" in states.lacking()
    states.take(SimpleNamespace(name=["finger_joint"], position=[0.4]))
    assert states.age() == math.inf
    assert "no joint_1 among the measured joints finger_joint" in states.lacking()
    states.take(SimpleNamespace(name=["joint_2", "joint_1"], position=[2.0, 1.0]))
    states.take(SimpleNamespace(name=["finger_joint"], position=[0.4]))
    assert states.age() < 1.0
    assert states.angles() == [1.0, 2.0]


def test_a_rehearsal_says_what_kinova_ros_would_not_get(robot: Robot, tmp_path: Path) -> None:
    move_joints(robot, robot.home, robot.home + 0.1, dt=0.005).save(tmp_path / "m.json")
    command = [sys.executable, send_trajectory.__file__, str(tmp_path / "m.json"), "--rehearse"]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=20.0)
    assert done.returncode == 1
    assert "not 10 ms apart" in done.stderr
    other = ["--action", "/arm_controller/follow_joint_trajectory", "--states", "/joint_states"]
    subprocess.run([*command, *other], capture_output=True, check=True, timeout=20.0)
