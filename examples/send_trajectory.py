"""Send a saved trajectory to a real arm: velocities to Kinova's driver, or a goal to FollowJointTrajectory.

    python send_trajectory.py lift.kinova.csv --rehearse
    python send_trajectory.py lift.kinova.csv --robot j2n6s300
    python send_trajectory.py lift.json --robot j2n6s300

It takes ROS, Python 3.8 or later, and nothing else: copy it to the machine with the driver. Velocities go to
kinova-ros (ROS 1), 100 a second and no faster. A goal goes to any controller of the action FollowJointTrajectory, by
rclpy (ROS 2) where that is installed, else by actionlib (ROS 1); ``--action`` and ``--states`` name others than those
of kinova-ros.

Nothing is sent unless the arm stands where the file begins. Velocities end, with zero, when the arm leaves the way of
the file, when it says no longer where it is, and on Ctrl-C, which cancels a goal too. ``--rehearse`` sends to an arm
that does what it is told, without ROS and without waiting. Keep a hand on the joystick.
"""

from __future__ import annotations

import argparse
import csv
import importlib
import importlib.util
import json
import math
import sys
import time
from pathlib import Path
from typing import Any, Callable, Protocol  # noqa: UP035 (Python 3.8)

PERIOD = 0.01  # [s] from velocity to velocity, the driver's
START, DRIFT = 2.0, 5.0  # [deg] from where the file begins, and from the way of the file
BEHIND = 0.3  # [s] by which measured angles may be late
SILENCE = 0.5  # [s] without measured angles
PATIENCE = 10.0  # [s] until the driver or the controller shows up
ZEROS = 5  # messages that end it
NOT_OURS = "not a .kinova.csv file of jacokin"
NOTHING_HEARD = f"nothing on {{}} says where the arm is (waited {PATIENCE:g} s)"


class StoppedError(Exception):
    """Why nothing more was sent."""


class Arm(Protocol):
    """Kinova's driver, as far as it is needed here."""

    def publish(self, velocities: list[float]) -> None:
        """Send velocities [deg/s]."""

    def measured(self) -> tuple[list[float], float]:
        """The newest angles [deg], and how old they are [s]; inf before any came."""


class Clock(Protocol):
    """Time that passes, or seems to."""

    def now(self) -> float:
        """Seconds since some moment."""

    def sleep(self, seconds: float) -> None:
        """Let time pass."""


class WallClock:
    """The real one."""

    now = staticmethod(time.monotonic)
    sleep = staticmethod(time.sleep)


class Rehearsal:
    """An arm that stands where a file begins and does what it is told, and its clock, which nobody waits for."""

    def __init__(self, angles: list[float]) -> None:
        """Start at some angles [deg]."""
        self.angles, self.time = list(angles), 0.0

    def publish(self, velocities: list[float]) -> None:
        """See `Arm`."""
        self.angles = [angle + PERIOD * velocities[j] for j, angle in enumerate(self.angles)]

    def measured(self) -> tuple[list[float], float]:
        """See `Arm`."""
        return list(self.angles), 0.0

    def now(self) -> float:
        """See `Clock`."""
        return self.time

    def sleep(self, seconds: float) -> None:
        """See `Clock`."""
        self.time += seconds


class KinovaDriver:
    """The node of kinova-ros."""

    def __init__(self, robot: str, joints: int) -> None:
        """Publish to it and listen to it."""
        self._rospy: Any = importlib.import_module("rospy")
        self._messages: Any = importlib.import_module("kinova_msgs.msg")
        self._joints, self._angles, self._heard = joints, [0.0] * joints, -math.inf
        self._rospy.init_node("send_trajectory", anonymous=True, disable_signals=True)
        topic = f"/{robot}_driver/in/joint_velocity"
        self._publisher = self._rospy.Publisher(topic, self._messages.JointVelocity, queue_size=1)
        self._rospy.Subscriber(f"/{robot}_driver/out/joint_angles", self._messages.JointAngles, self._take)

    def _take(self, message: Any) -> None:
        self._angles = [float(getattr(message, f"joint{j + 1}")) for j in range(self._joints)]
        self._heard = time.monotonic()

    def publish(self, velocities: list[float]) -> None:
        """See `Arm`."""
        self._publisher.publish(*velocities, *[0.0] * (7 - self._joints))  # its messages always have seven

    def measured(self) -> tuple[list[float], float]:
        """See `Arm`."""
        return self._angles, time.monotonic() - self._heard


def read_velocities(path: Path) -> tuple[list[list[float]], list[list[float]]]:
    """Angles [deg] and velocities [deg/s] of a .kinova.csv file, a row each 10 ms."""
    try:
        with path.open(encoding="utf-8", newline="") as stream:
            head, *rows = csv.reader(line for line in stream if not line.startswith("#"))
        numbers = [[float(cell) for cell in row] for row in rows]
    except ValueError as error:
        raise StoppedError(f"{path}: {NOT_OURS}: {error}") from error
    joints = (len(head) - 1) // 2
    names = ["time_s", *(f"joint{j + 1}_deg" for j in range(joints)), *(f"joint{j + 1}_deg_s" for j in range(joints))]
    if head != names or not numbers or any(len(row) != len(head) for row in numbers):
        raise StoppedError(f"{path}: {NOT_OURS}")
    if any(abs(row[0] - k * PERIOD) > 1e-6 for k, row in enumerate(numbers)):
        raise StoppedError(f"{path}: {NOT_OURS}: rows are not 10 ms apart")
    return [row[1 : 1 + joints] for row in numbers], [row[1 + joints :] for row in numbers]


def read_goal(path: Path) -> dict[str, Any]:
    """The fields of a JointTrajectory that a .json file has."""
    try:
        message: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        parts = ("positions", "velocities", "accelerations", "time_from_start")
        whole = (
            message["joint_names"]
            and message["points"]
            and all(point[part] for point in message["points"] for part in parts)
        )
    except (ValueError, KeyError, TypeError):
        whole = False
    if not whole:
        raise StoppedError(f"{path}: not a .json file of a trajectory of jacokin")
    return message


def farthest(angles: list[float], others: list[float], turn: float) -> float:
    """How far the joint that is farthest is from where it should be, up to whole turns."""
    return max(abs(math.remainder(angle - others[j], turn)) for j, angle in enumerate(angles))


def send_velocities(angles: list[list[float]], velocities: list[list[float]], arm: Arm, clock: Clock) -> float:
    """Send velocities row by row; returns how far the arm ends from the last row [deg].

    Raises:
        StoppedError: says why; the arm was told to stop.
    """
    wait_for(lambda: arm.measured()[1] < SILENCE, "the driver does not say where the arm is", clock)
    away = farthest(arm.measured()[0], angles[0], 360.0)
    if away > START:
        raise StoppedError(
            f"the arm is {away:.1f} deg from where the file begins ({START:g} allowed): move it there first"
        )
    due, behind = clock.now(), round(BEHIND / PERIOD)
    try:
        for k, row in enumerate(velocities):
            # Late ones are not made up for: the driver keeps what comes faster, and goes on after the last.
            due = max(due, clock.now() - PERIOD)
            clock.sleep(max(0.0, due - clock.now()))
            now, age = arm.measured()
            if age > SILENCE:
                raise StoppedError(f"row {k}: no angles from the driver for {age:.1f} s")
            away = min(farthest(now, where, 360.0) for where in angles[max(0, k - behind) : k + 1])
            if away > DRIFT:
                raise StoppedError(f"row {k}: the arm is {away:.1f} deg from the way of the file ({DRIFT:g} allowed)")
            arm.publish(row)
            due += PERIOD
    finally:
        for _ in range(ZEROS):
            arm.publish([0.0] * len(angles[0]))
            clock.sleep(PERIOD)
    clock.sleep(BEHIND)
    return farthest(arm.measured()[0], angles[-1], 360.0)


def wait_for(happens: Callable[[], bool], otherwise: str, clock: Clock) -> None:
    """Wait until something happens."""
    end = clock.now() + PATIENCE
    while not happens():
        if clock.now() > end:
            raise StoppedError(f"{otherwise} (waited {PATIENCE:g} s)")
        clock.sleep(0.02)


def check_start(names: list[str], positions: list[float], message: dict[str, Any]) -> None:
    """Refuse a goal that begins elsewhere than the arm is [rad]."""
    lacking = [name for name in message["joint_names"] if name not in names]
    if lacking:
        raise StoppedError(f"no {lacking[0]} among the measured joints {', '.join(names)}: see joint_prefix= of save")
    now = [positions[names.index(name)] for name in message["joint_names"]]
    away = math.degrees(farthest(now, message["points"][0]["positions"], math.tau))
    if away > START:
        raise StoppedError(
            f"the arm is {away:.1f} deg from where the file begins ({START:g} allowed): move it there first"
        )


def fill(trajectory: Any, new_point: Callable[[], Any], message: dict[str, Any], parts: tuple[str, str]) -> None:
    """Fill a message JointTrajectory from a file; the parts of a duration have other names in ROS 1 and 2."""
    trajectory.joint_names = list(message["joint_names"])
    for row in message["points"]:
        point = new_point()
        point.positions, point.velocities = row["positions"], row["velocities"]
        point.accelerations = row["accelerations"]
        for part, value in enumerate(row["time_from_start"].values()):
            setattr(point.time_from_start, parts[part], value)
        trajectory.points.append(point)


def send_goal_ros1(message: dict[str, Any], action: str, states: str) -> str:
    """Send a goal by actionlib and wait for its end; returns what the controller says."""
    rospy: Any = importlib.import_module("rospy")
    actionlib: Any = importlib.import_module("actionlib")
    control: Any = importlib.import_module("control_msgs.msg")
    sensors: Any = importlib.import_module("sensor_msgs.msg")
    messages: Any = importlib.import_module("trajectory_msgs.msg")
    rospy.init_node("send_trajectory", anonymous=True, disable_signals=True)
    try:
        state = rospy.wait_for_message(states, sensors.JointState, timeout=PATIENCE)
    except rospy.ROSException as error:
        raise StoppedError(NOTHING_HEARD.format(states)) from error
    check_start(list(state.name), list(state.position), message)
    client = actionlib.SimpleActionClient(action, control.FollowJointTrajectoryAction)
    if not client.wait_for_server(rospy.Duration(PATIENCE)):
        raise StoppedError(f"no controller at {action} (waited {PATIENCE:g} s)")
    goal = control.FollowJointTrajectoryGoal()
    fill(goal.trajectory, messages.JointTrajectoryPoint, message, ("secs", "nsecs"))
    client.send_goal(goal)
    try:
        client.wait_for_result()
    except BaseException:
        client.cancel_goal()
        raise
    result, succeeded = client.get_result(), client.get_state() == actionlib.GoalStatus.SUCCEEDED
    return describe(succeeded, 0 if result is None else result.error_code, client.get_goal_status_text())


def send_goal_ros2(message: dict[str, Any], action: str, states: str) -> str:
    """Send a goal by rclpy and wait for its end; returns what the controller says."""
    rclpy: Any = importlib.import_module("rclpy")
    actions: Any = importlib.import_module("rclpy.action")
    control: Any = importlib.import_module("control_msgs.action")
    sensors: Any = importlib.import_module("sensor_msgs.msg")
    messages: Any = importlib.import_module("trajectory_msgs.msg")
    rclpy.init()
    node = rclpy.create_node("send_trajectory")
    try:
        heard: list[Any] = []
        node.create_subscription(sensors.JointState, states, heard.append, 10)
        end = time.monotonic() + PATIENCE
        while not heard and time.monotonic() < end:
            rclpy.spin_once(node, timeout_sec=0.1)
        if not heard:
            raise StoppedError(NOTHING_HEARD.format(states))
        check_start(list(heard[-1].name), list(heard[-1].position), message)
        client = actions.ActionClient(node, control.FollowJointTrajectory, action)
        if not client.wait_for_server(timeout_sec=PATIENCE):
            raise StoppedError(f"no controller at {action} (waited {PATIENCE:g} s)")
        goal = control.FollowJointTrajectory.Goal()
        fill(goal.trajectory, messages.JointTrajectoryPoint, message, ("sec", "nanosec"))
        sent = client.send_goal_async(goal)
        rclpy.spin_until_future_complete(node, sent)
        handle = sent.result()
        if not handle.accepted:
            raise StoppedError(f"{action} rejected the goal: other joints, or other limits?")
        ended = handle.get_result_async()
        try:
            rclpy.spin_until_future_complete(node, ended)
        except BaseException:
            rclpy.spin_until_future_complete(node, handle.cancel_goal_async(), timeout_sec=1.0)
            raise
        result = ended.result().result
        return describe(result.error_code == 0, result.error_code, result.error_string)
    finally:
        node.destroy_node()
        rclpy.shutdown()


def describe(succeeded: bool, code: int, text: str) -> str:
    """What became of a goal, in a line."""
    if not succeeded:
        raise StoppedError(f"the controller gave up, error {code}: {text or 'it does not say why'}")
    return "the controller says that the goal was reached"


def send(options: argparse.Namespace) -> str:
    """Send a file; returns what became of it, in a line."""
    path: Path = options.file
    if path.name.endswith(".kinova.csv"):
        angles, velocities = read_velocities(path)
        rehearsal = Rehearsal(angles[0])
        if options.rehearse:
            away = send_velocities(angles, velocities, rehearsal, rehearsal)
        else:
            away = send_velocities(angles, velocities, KinovaDriver(options.robot, len(angles[0])), WallClock())
        return (
            f"{len(angles)} rows in {(len(angles) - 1) * PERIOD:.2f} s, the arm ends {away:.2f} deg from the last one"
        )
    if path.suffix != ".json":
        raise StoppedError(f"{path}: .kinova.csv or .json, as jacokin saves them")
    message = read_goal(path)
    if options.rehearse:
        return f"{len(message['points'])} points of {', '.join(message['joint_names'])}; without ROS no goal is sent"
    action = options.action or f"/{options.robot}/follow_joint_trajectory"
    states = options.states or f"/{options.robot}_driver/out/joint_state"
    ros2 = importlib.util.find_spec("rclpy") is not None
    return (send_goal_ros2 if ros2 else send_goal_ros1)(message, action, states)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("file", type=Path, help=".kinova.csv or .json, of jacokin's Trajectory.save")
    parser.add_argument("--robot", default="j2n6s300", help="name that kinova-ros was started with")
    parser.add_argument("--action", help="of FollowJointTrajectory, by default /ROBOT/follow_joint_trajectory")
    parser.add_argument("--states", help="topic of joint states, by default /ROBOT_driver/out/joint_state")
    parser.add_argument("--rehearse", action="store_true", help="send to an arm that does what it is told, without ROS")
    try:
        print(send(parser.parse_args()))
    except KeyboardInterrupt:
        sys.exit("interrupted: the arm was told to stop")
    except (StoppedError, OSError, ImportError) as why:
        sys.exit(f"stopped: {why}")


if __name__ == "__main__":
    main()
