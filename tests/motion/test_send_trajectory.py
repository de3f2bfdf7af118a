"""The example that sends a saved trajectory: when it sends, how fast, and when it stops. ROS is stood in for."""

from __future__ import annotations

import itertools
import json
import math
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest

import jacokin
from examples import send_trajectory
from examples.send_trajectory import PERIOD, Rehearsal, StoppedError, read_velocities, send_velocities
from jacokin.motion import Trajectory, move_joints


@pytest.fixture(scope="module")
def motion() -> Trajectory:
    robot = jacokin.load_robot()
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


def test_other_files_are_refused(tmp_path: Path) -> None:
    (tmp_path / "a.kinova.csv").write_text("time_s,joint1_deg,joint1_deg_s\n0.00,1,2\n0.02,1,0\n")
    with pytest.raises(StoppedError, match="10 ms"):
        read_velocities(tmp_path / "a.kinova.csv")
    for text in (
        "x,y,z\n1,2,3\n",
        "",
        "time_s,joint1_deg,joint1_deg_s\n0.00,1,fast\n",
        "time_s,joint1_deg\n0.00,1,2\n",
    ):
        (tmp_path / "a.kinova.csv").write_text(text)
        with pytest.raises(StoppedError, match="not a .kinova.csv file"):
            read_velocities(tmp_path / "a.kinova.csv")
    for text in ("", "[]", '{"joint_names": ["joint_1"], "points": [{}]}', '{"points": []}'):
        (tmp_path / "a.json").write_text(text)
        with pytest.raises(StoppedError, match="not a .json file"):
            send_trajectory.read_goal(tmp_path / "a.json")


class Message(SimpleNamespace):
    """A message of ROS; only the fields it was made with can be set."""

    def __setattr__(self, name: str, value: object) -> None:
        if name not in self.__dict__:
            raise AttributeError(name)
        super().__setattr__(name, value)


def new_goal() -> Message:
    return Message(trajectory=Message(joint_names=[], points=[]))


def new_point(*parts: str) -> Callable[[], Message]:
    return lambda: Message(
        positions=[], velocities=[], accelerations=[], time_from_start=Message(**dict.fromkeys(parts, 0))
    )


@pytest.fixture
def stand_in(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Put a module in the place of one of ROS."""

    def put(name: str, **attributes: object) -> None:
        module = ModuleType(name)
        module.__dict__.update(attributes)
        monkeypatch.setitem(sys.modules, name, module)

    return put


def run(monkeypatch: pytest.MonkeyPatch, *words: str) -> None:
    monkeypatch.setattr(sys, "argv", ["send_trajectory.py", *words])
    send_trajectory.main()


@pytest.fixture
def goal_file(motion: Trajectory, tmp_path: Path) -> Path:
    path = tmp_path / "m.json"
    motion.save(path, joint_prefix="j2n6s300_")
    return path


def check_goal(goal: Message, file: Path, parts: tuple[str, str]) -> None:
    written = json.loads(file.read_text())
    assert goal.trajectory.joint_names == [f"j2n6s300_joint_{k}" for k in range(1, 7)]
    assert [point.positions for point in goal.trajectory.points] == [row["positions"] for row in written["points"]]
    last = goal.trajectory.points[-1].time_from_start
    seconds = [getattr(last, part) for part in parts]
    assert seconds == list(written["points"][-1]["time_from_start"].values())


def test_a_goal_of_ros_1(
    goal_file: Path, monkeypatch: pytest.MonkeyPatch, stand_in: Callable[..., None], motion: Trajectory
) -> None:
    goals: list[Message] = []
    names = [f"j2n6s300_joint_{k}" for k in (3, 1, 2, 6, 5, 4)]
    state = Message(name=names, position=motion.q[0, [2, 0, 1, 5, 4, 3]].tolist())
    client = SimpleNamespace(
        wait_for_server=lambda wait: True,
        send_goal=goals.append,
        wait_for_result=lambda: True,
        get_result=lambda: Message(error_code=0),
        get_state=lambda: 3,
        get_goal_status_text=lambda: "",
    )
    asked: list[str] = []
    stand_in("control_msgs")
    stand_in("sensor_msgs")
    stand_in("trajectory_msgs")
    stand_in(
        "rospy",
        init_node=lambda *_, **__: None,
        wait_for_message=lambda topic, kind, timeout: asked.append(topic) or state,  # type: ignore[func-returns-value]
        Duration=float,
        ROSException=TimeoutError,
    )
    stand_in(
        "actionlib",
        SimpleActionClient=lambda action, kind: asked.append(action) or client,  # type: ignore[func-returns-value]
        GoalStatus=SimpleNamespace(SUCCEEDED=3),
    )
    stand_in("control_msgs.msg", FollowJointTrajectoryAction=None, FollowJointTrajectoryGoal=new_goal)
    stand_in("sensor_msgs.msg", JointState=None)
    stand_in("trajectory_msgs.msg", JointTrajectoryPoint=new_point("secs", "nsecs"))
    run(monkeypatch, str(goal_file))
    check_goal(goals[0], goal_file, ("secs", "nsecs"))
    assert asked == ["/j2n6s300_driver/out/joint_state", "/j2n6s300/follow_joint_trajectory"]
    state.position = (motion.q[0, [2, 0, 1, 5, 4, 3]] + 0.1).tolist()
    with pytest.raises(SystemExit, match="5.7 deg from where the file begins"):
        run(monkeypatch, str(goal_file))
    assert len(goals) == 1


@pytest.mark.parametrize("error", [0, -4])
def test_a_goal_of_ros_2(
    error: int,
    goal_file: Path,
    monkeypatch: pytest.MonkeyPatch,
    stand_in: Callable[..., None],
    motion: Trajectory,
    capsys: pytest.CaptureFixture[str],
) -> None:
    goals: list[Message] = []
    state = Message(name=[f"j2n6s300_joint_{k}" for k in range(1, 7)], position=motion.q[0].tolist())
    outcome = Message(result=Message(error_code=error, error_string="path tolerance" if error else ""))
    handle = SimpleNamespace(accepted=True, get_result_async=lambda: SimpleNamespace(result=lambda: outcome))

    def send_goal_async(goal: Message) -> object:
        goals.append(goal)
        return SimpleNamespace(result=lambda: handle)

    client = SimpleNamespace(wait_for_server=lambda timeout_sec: True, send_goal_async=send_goal_async)
    waiting: list[Any] = []
    node = SimpleNamespace(
        create_subscription=lambda kind, topic, take, depth: waiting.append(take), destroy_node=lambda: None
    )
    stand_in("control_msgs")
    stand_in("sensor_msgs")
    stand_in("trajectory_msgs")
    stand_in(
        "rclpy",
        __spec__=SimpleNamespace(),
        init=lambda: None,
        shutdown=lambda: None,
        create_node=lambda name: node,
        spin_once=lambda node, timeout_sec: waiting[0](state),
        spin_until_future_complete=lambda node, future: None,
    )
    stand_in("rclpy.action", ActionClient=lambda node, kind, action: client)
    stand_in("control_msgs.action", FollowJointTrajectory=SimpleNamespace(Goal=new_goal))
    stand_in("sensor_msgs.msg", JointState=None)
    stand_in("trajectory_msgs.msg", JointTrajectoryPoint=new_point("sec", "nanosec"))
    if error:
        with pytest.raises(SystemExit, match="error -4: path tolerance"):
            run(monkeypatch, str(goal_file))
    else:
        run(monkeypatch, str(goal_file))
        assert "was reached" in capsys.readouterr().out
    check_goal(goals[0], goal_file, ("sec", "nanosec"))


def test_velocities_of_the_driver(
    rows: tuple[list[list[float]], list[list[float]]],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    stand_in: Callable[..., None],
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Messages of seven joints, in the topics of the robot that was named; and a rehearsal without ROS."""
    sent: list[tuple[float, ...]] = []
    listening: list[Any] = []
    angles = list(rows[0][0])
    arm = Rehearsal(angles)

    def tell() -> None:
        listening[0](Message(**{f"joint{k + 1}": angle for k, angle in enumerate([*arm.angles, 0.0])}))

    def publish(*velocities: float) -> None:
        sent.append(velocities)
        arm.publish(list(velocities[:6]))
        tell()

    topics: list[str] = []
    stand_in("kinova_msgs")
    stand_in("kinova_msgs.msg", JointVelocity=None, JointAngles=None)

    def listen(topic: str, kind: object, take: Callable[[Message], None]) -> None:
        topics.append(topic)
        listening.append(take)
        tell()

    stand_in(
        "rospy",
        init_node=lambda *_, **__: None,
        Publisher=lambda topic, kind, queue_size: topics.append(topic) or SimpleNamespace(publish=publish),  # type: ignore[func-returns-value]
        Subscriber=listen,
    )
    monkeypatch.setattr(send_trajectory, "WallClock", lambda: arm)
    file = str(tmp_path / "m.kinova.csv")
    run(monkeypatch, file, "--robot", "j2s6s200")
    assert topics == ["/j2s6s200_driver/in/joint_velocity", "/j2s6s200_driver/out/joint_angles"]
    assert sent[100] == (*rows[1][100], 0.0)
    assert "ends 0.00 deg" in capsys.readouterr().out
    run(monkeypatch, file, "--rehearse")
    assert "ends 0.00 deg" in capsys.readouterr().out
