"""Send a saved trajectory to a real arm: velocities to Kinova's driver, or a goal to FollowJointTrajectory.

    python send_trajectory.py lift.kinova.csv --rehearse
    python send_trajectory.py lift.kinova.csv --robot j2n6s300
    python send_trajectory.py lift.json --states /joint_states --action /arm_controller/follow_joint_trajectory
    python send_trajectory.py lift.kinova.json --robot j2n6s300

It takes ROS, Python 3.8 or later, and nothing else: copy it to the machine with the driver. Velocities go to
kinova-ros (ROS 1), 100 a second and no faster. A goal goes to any controller of the action FollowJointTrajectory, by
rclpy (ROS 2) or actionlib (ROS 1), whichever is installed; with both, ``--ros`` says which. ``--action`` and
``--states`` name others than those of kinova-ros.

Nothing is sent unless the arm stands where the file begins. Velocities end, with zero, when the arm leaves the way of
the file, when it says no longer where it is, and on Ctrl-C, SIGTERM and SIGHUP, which cancel a goal too. A second
process cancels the goal where this one is killed or hangs. In the end the angles are read until the arm stands. The
exit code is 0 only where it stands within ``--tolerance`` of the last row or point, and 1 otherwise, with the reason or
the distance on stderr. ``--rehearse`` sends to an arm that does what it is told, without ROS and without waiting. Keep
a hand on the joystick.

Send velocities to kinova-ros, not goals. Its controller measures nothing: it plays the velocity of one point each
10 ms. And its driver dies of a goal that is cancelled (kinova-ros, issue 191); started again, it opens the fingers.
"""

from __future__ import annotations

import argparse
import contextlib
import csv
import importlib
import importlib.util
import json
import math
import os
import select
import signal
import socket
import subprocess
import sys
import time
import uuid
from pathlib import Path
from typing import Any, Callable, Protocol  # noqa: UP035 (Python 3.8)

PERIOD = 0.01  # [s] from velocity to velocity, the driver's
START, DRIFT = 2.0, 5.0  # [deg] from where the file begins, and from the way of the file
TOLERANCE = 0.5  # [deg] from where the file ends
BEHIND = 0.3  # [s] by which measured angles may be late
SILENCE = 0.5  # [s] without measured angles, and without a sign of life of the process whose goal it is
PATIENCE = 10.0  # [s] until the driver or the controller shows up, and until a goal ends after its last point
DEATH = 2.0  # [s] without a sign of life of a controller, which gives five a second or more
STANDING = 0.1  # [deg] that an arm at rest moves from one look to the next, BEHIND later
ZEROS = 5  # messages that end it
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
SUCCEEDED = 4  # of action_msgs/GoalStatus, ROS 2
OVER = b"over\n"  # what `Guard` is told when a goal needs it no more
NOT_OURS = "not a .kinova.csv file of jacokin"
DRIVER_DIES = (
    "the driver of kinova-ros dies of a cancelled goal (issue 191): start it again, which opens the fingers; "
    "velocities, a .kinova.csv file, end without that"
)


class StoppedError(Exception):
    """Why nothing more was sent."""


class AwayError(Exception):
    """All was sent, and the arm does not stand where the file ends."""


class Arm(Protocol):
    """Kinova's driver, as far as it is needed here."""

    def listens(self) -> bool:
        """Whether velocities that are sent now arrive."""

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

    def listens(self) -> bool:
        """See `Arm`."""
        return True

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
        start_ros1(self._rospy)
        topic = f"/{robot}_driver/in/joint_velocity"
        self._publisher = self._rospy.Publisher(topic, self._messages.JointVelocity, queue_size=1)
        self._rospy.Subscriber(f"/{robot}_driver/out/joint_angles", self._messages.JointAngles, self._take)

    def _take(self, message: Any) -> None:
        self._angles = [float(getattr(message, f"joint{j + 1}")) for j in range(self._joints)]
        self._heard = time.monotonic()

    def listens(self) -> bool:
        """See `Arm`."""
        return bool(self._publisher.get_num_connections())

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
    if not all(math.isfinite(number) for row in numbers for number in row):
        raise StoppedError(f"{path}: {NOT_OURS}: numbers are not finite")
    if any(abs(row[0] - k * PERIOD) > 1e-6 for k, row in enumerate(numbers)):
        raise StoppedError(f"{path}: {NOT_OURS}: rows are not 10 ms apart")
    if any(numbers[-1][1 + joints :]):
        raise StoppedError(f"{path}: the last row is not at rest, as where a file was cut off")
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
        AwayError: nothing says in the end where the arm stands.
    """
    wait_for(lambda: arm.measured()[1] < SILENCE, "the driver does not say where the arm is", clock)
    wait_for(arm.listens, "the driver does not listen to velocities", clock)
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
    return farthest(at_rest(lambda: arm.measured()[0], lambda: arm.measured()[1], 360.0, clock), angles[-1], 360.0)


def at_rest(look: Callable[[], list[float]], age: Callable[[], float], turn: float, clock: Clock) -> list[float]:
    """The angles of an arm once it stands, when all was sent; a turn is 360 degrees or 2 pi rad.

    Raises:
        AwayError: it goes on, or nothing says where it is.
    """
    seen: list[float] = []

    def stands() -> bool:
        nonlocal seen
        before, seen = seen, look()
        moved = farthest(before, seen, turn) if before else math.inf
        return age() < BEHIND and moved * 360.0 / turn < STANDING  # newer than the look before

    try:
        wait_for(stands, "", clock, every=BEHIND)
    except StoppedError:
        why = "the arm goes on: stop it by hand" if age() < SILENCE else "nothing says where the arm is"
        raise AwayError(f"all was sent, and {why}") from None
    return seen


def wait_for(
    happens: Callable[[], bool], otherwise: str | Callable[[], str], clock: Clock, every: float = 0.02
) -> None:
    """Wait until something happens."""
    end = clock.now() + PATIENCE
    while not happens():
        if clock.now() > end:
            raise StoppedError(f"{otherwise if isinstance(otherwise, str) else otherwise()} (waited {PATIENCE:g} s)")
        clock.sleep(every)


def check_start(angles: list[float], message: dict[str, Any], unlimited: list[str]) -> list[float]:
    """The whole turns from where a goal begins to where the arm is, of each joint [rad].

    Raises:
        StoppedError: the goal begins elsewhere, or whole turns away on a joint that may have limits.
    """
    names, first = message["joint_names"], message["points"][0]["positions"]
    away = math.degrees(farthest(angles, first, math.tau))
    if away > START:
        raise StoppedError(
            f"the arm is {away:.1f} deg from where the file begins ({START:g} allowed): move it there first"
        )
    turns = [round((angle - first[j]) / math.tau) for j, angle in enumerate(angles)]
    for j, count in enumerate(turns):
        if count and names[j] not in unlimited:
            raise StoppedError(
                f"{names[j]} stands {count:+d} whole turns from where the file begins, and a controller of positions "
                f"would turn it back: with --unlimited {names[j]} they are added, if it turns without limits"
            )
    return [math.tau * count for count in turns]


def check_points(message: dict[str, Any]) -> None:
    """Refuse points that kinova-ros would not play as they are meant: it takes one each 10 ms, whatever their times."""
    times = [seconds(point["time_from_start"]) for point in message["points"]]
    if any(abs(late - early - PERIOD) > 1e-6 for early, late in zip(times, times[1:])):  # noqa: B905, RUF007 (Python 3.8)
        raise StoppedError(
            "the controller of kinova-ros plays one point each 10 ms in an open loop, and these are not 10 ms apart: "
            "the arm would end elsewhere. Save it as .kinova.csv, or as .kinova.json; --action and --states name "
            "another controller"
        )


def is_kinova(message: dict[str, Any], robot: str, action: str, states: str) -> bool:
    """Whether a goal goes to kinova-ros: by the names that it gives its action and its topics."""
    prefix = message["joint_names"][0].partition("_joint_")[0]
    return states.endswith("_driver/out/joint_state") or action in (
        f"/{name}/follow_joint_trajectory" for name in (robot, prefix)
    )


def seconds(duration: dict[str, int]) -> float:
    """A duration of a file [s]."""
    whole, nano = duration.values()
    return whole + 1e-9 * nano


def fill(
    trajectory: Any,
    new_point: Callable[[], Any],
    message: dict[str, Any],
    turns: list[float],
    parts: tuple[str, str],
) -> None:
    """Fill a message JointTrajectory from a file; the parts of a duration have other names in ROS 1 and 2."""
    trajectory.joint_names = list(message["joint_names"])
    for row in message["points"]:
        point = new_point()
        point.positions = [position + turns[j] for j, position in enumerate(row["positions"])]
        point.velocities, point.accelerations = row["velocities"], row["accelerations"]
        for part, value in enumerate(row["time_from_start"].values()):
            setattr(point.time_from_start, parts[part], value)
        trajectory.points.append(point)


class JointStates:
    """Where joints are, from messages JointState, which may be of other joints, too, or of some."""

    def __init__(self, topic: str, names: list[str]) -> None:
        """Of these joints."""
        self._topic, self._names = topic, names
        self._heard: dict[str, tuple[float, float]] = {}  # [rad], and when [s]

    def take(self, message: Any) -> None:
        """A message came."""
        now = time.monotonic()
        self._heard.update({name: (message.position[j], now) for j, name in enumerate(message.name)})

    def age(self) -> float:
        """How old the oldest of the angles is [s]; inf before all were heard."""
        never = (0.0, -math.inf)
        return time.monotonic() - min(self._heard.get(name, never)[1] for name in self._names)

    def angles(self) -> list[float]:
        """The newest angles [rad]."""
        return [self._heard[name][0] for name in self._names]

    def lacking(self) -> str:
        """What is missing, in a line."""
        never = [name for name in self._names if name not in self._heard]
        if not self._heard or not never:
            return f"nothing on {self._topic} says where the arm is"
        return f"no {never[0]} among the measured joints {', '.join(self._heard)}: see joint_prefix= of save"


class Controller(Protocol):
    """One that takes goals of FollowJointTrajectory."""

    states: JointStates

    def wait(self, seconds: float) -> None:
        """Let messages come in."""

    def listens(self) -> bool:
        """Whether goals that are sent now arrive."""

    def send(self, message: dict[str, Any], turns: list[float]) -> str:
        """Send a goal, and these angles with each of its points [rad]; returns the identifier of the goal."""

    def ended(self) -> bool:
        """Whether the goal has ended.

        Raises:
            StoppedError: without success; says why.
        """

    def cancel(self) -> None:
        """Cancel the goal."""

    def close(self) -> None:
        """Leave ROS."""


class GoalClock:
    """Time in which messages come in."""

    now = staticmethod(time.monotonic)

    def __init__(self, controller: Controller) -> None:
        """Of a controller."""
        self.sleep = controller.wait


class Guard:
    """A process that cancels a goal once this one is killed or hangs; see `guard`."""

    def __init__(self, version: int, action: str) -> None:
        """Start it, in a session of its own: what is sent to a group of processes does not reach it."""
        words = [sys.executable, __file__, "--guard", str(version), action]
        pipe = subprocess.PIPE
        self._process = subprocess.Popen(words, bufsize=0, stdin=pipe, stdout=pipe, start_new_session=True)
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._told, self._answers = self._process.stdin, self._process.stdout

    def ready(self) -> bool:
        """Whether a goal that is sent now would be cancelled.

        Raises:
            StoppedError: it ended; it has said why.
        """
        if not select.select([self._answers], [], [], 0.0)[0]:
            return False
        if not self._answers.readline():
            raise StoppedError("the process that would cancel the goal ended")
        return True

    def tell(self, words: str = "") -> None:
        """Say the identifier of the goal, at first, and then that this process lives.

        Raises:
            StoppedError: it listens no more.
        """
        try:
            self._told.write(f"{words}\n".encode())
        except BrokenPipeError:
            raise StoppedError("the process that would cancel the goal ended") from None

    def dismiss(self) -> None:
        """The goal needs it no more: it leaves ROS.

        One that is killed stays registered at the master of ROS 1. A driver asks at the addresses of all who may
        cancel, and hangs in a talk with itself once the port of one that is gone is given to it.
        """
        with contextlib.suppress(BrokenPipeError):  # it has ended
            self._told.write(OVER)

    def close(self) -> None:
        """Wait until it has left, or end it."""
        self.dismiss()
        with self._process:
            try:
                self._process.wait(DEATH)
            except subprocess.TimeoutExpired:
                self._process.kill()


def guard(version: int, action: str) -> None:
    """Cancel a goal once nothing comes on standard input for some time, or never will; `Guard` is at its other end."""
    for each in SIGNALS:
        signal.signal(each, signal.SIG_IGN)
    told = open(0, "rb", buffering=0, closefd=False)  # noqa: SIM115 (standard input)

    def hears(seconds: float) -> bool:
        return bool(select.select([told], [], [], seconds)[0])

    canceller = (Ros1Canceller if version == 1 else Ros2Canceller)(action)
    try:
        wait_for(lambda: canceller.listens() or hears(0.0), "no controller listens to cancelled goals", WallClock())
        if not hears(0.0):
            print("ready", flush=True)
        said = told.readline()
        goal = said.decode().strip()
        while said and not said.endswith(OVER):
            said = told.read(1 << 16) if hears(SILENCE) else b""
        if goal and not said:
            canceller.cancel(goal)
            print("the process that sent the goal is gone, or hangs: the goal was cancelled", file=sys.stderr)
    finally:
        canceller.close()


class Ros1Canceller:
    """What cancels a goal of ROS 1 by its identifier."""

    def __init__(self, action: str) -> None:
        """Of an action."""
        self._rospy: Any = importlib.import_module("rospy")
        self._messages: Any = importlib.import_module("actionlib_msgs.msg")
        start_ros1(self._rospy)
        self._publisher = self._rospy.Publisher(f"{action}/cancel", self._messages.GoalID, queue_size=1)

    def listens(self) -> bool:
        """Whether it would be heard."""
        return bool(self._publisher.get_num_connections())

    def cancel(self, goal: str) -> None:
        """Cancel one."""
        self._publisher.publish(id=goal)
        time.sleep(BEHIND)  # the message leaves in another thread

    def close(self) -> None:
        """Leave ROS."""
        self._rospy.signal_shutdown("done")


class Ros2Canceller:
    """What cancels a goal of ROS 2 by its identifier."""

    def __init__(self, action: str) -> None:
        """Of an action."""
        self._rclpy: Any = importlib.import_module("rclpy")
        signals: Any = importlib.import_module("rclpy.signals")
        self._type: Any = importlib.import_module("action_msgs.srv").CancelGoal
        self._rclpy.init(signal_handler_options=signals.SignalHandlerOptions.NO)
        self._node = self._rclpy.create_node(f"send_trajectory_guard_{os.getpid()}")
        self._client = self._node.create_client(self._type, f"{action}/_action/cancel_goal")

    def listens(self) -> bool:
        """Whether it would be heard."""
        return bool(self._client.service_is_ready())

    def cancel(self, goal: str) -> None:
        """Cancel one, which may not have been accepted yet."""
        request = self._type.Request()
        request.goal_info.goal_id.uuid = list(bytes.fromhex(goal))
        end = time.monotonic() + DEATH
        while time.monotonic() < end:
            answer = self._client.call_async(request)
            self._rclpy.spin_until_future_complete(self._node, answer, timeout_sec=DEATH)
            if answer.done() and answer.result().return_code != self._type.Response.ERROR_UNKNOWN_GOAL_ID:
                return

    def close(self) -> None:
        """Leave ROS."""
        self._node.destroy_node()
        self._rclpy.shutdown()


def send_goal(message: dict[str, Any], controller: Controller, guardian: Guard, unlimited: list[str]) -> float:
    """Send a goal and wait for its end; returns how far the arm then is from the last point [deg].

    Raises:
        StoppedError: says why; a goal that had not ended was cancelled.
        AwayError: nothing says in the end where the arm stands.
    """
    states, clock = controller.states, GoalClock(controller)
    wait_for(lambda: states.age() < SILENCE, states.lacking, clock)
    wait_for(controller.listens, "no controller answers", clock)
    wait_for(guardian.ready, "the process that would cancel the goal is not ready", clock)
    turns = check_start(states.angles(), message, unlimited)
    late = clock.now() + seconds(message["points"][-1]["time_from_start"]) + PATIENCE
    try:
        guardian.tell(controller.send(message, turns))
        while not controller.ended():
            guardian.tell()
            controller.wait(0.02)
            if not controller.listens() or states.age() > DEATH:
                raise StoppedError("the controller died, or is silent; the arm may go on: stop it by hand")
            if clock.now() > late:
                raise StoppedError(f"the goal did not end within {PATIENCE:g} s after its last point: cancelled")
    except BaseException:
        controller.cancel()
        raise
    finally:
        guardian.dismiss()
    last = [position + turns[j] for j, position in enumerate(message["points"][-1]["positions"])]
    angles = at_rest(states.angles, states.age, math.tau, clock)
    return math.degrees(farthest(angles, last, math.tau))


def start_ros1(rospy: Any) -> None:
    """Become a node of ROS 1.

    Raises:
        StoppedError: no master answers, for which rospy itself would wait for ever.
    """
    rosgraph: Any = importlib.import_module("rosgraph")
    socket.setdefaulttimeout(PATIENCE)
    try:
        online = rosgraph.is_master_online()
    finally:
        socket.setdefaulttimeout(None)
    if not online:
        raise StoppedError(f"no ROS master at {rosgraph.get_master_uri()}: start roscore, or set ROS_MASTER_URI")
    rospy.init_node("send_trajectory", anonymous=True, disable_signals=True)


class Ros1Controller:
    """A controller of ROS 1, by actionlib."""

    def __init__(self, names: list[str], action: str, states: str, *, kinova: bool) -> None:
        """Of joints with these names."""
        rospy: Any = importlib.import_module("rospy")
        self._actionlib: Any = importlib.import_module("actionlib")
        self._control: Any = importlib.import_module("control_msgs.msg")
        self._trajectory: Any = importlib.import_module("trajectory_msgs.msg")
        sensors: Any = importlib.import_module("sensor_msgs.msg")
        statuses: Any = importlib.import_module("actionlib_msgs.msg")
        start_ros1(rospy)
        self._rospy, self._kinova, self._sign = rospy, kinova, -math.inf
        self.states = JointStates(states, names)
        rospy.Subscriber(states, sensors.JointState, self.states.take)
        rospy.Subscriber(f"{action}/status", statuses.GoalStatusArray, self._live)
        self._client = self._actionlib.SimpleActionClient(action, self._control.FollowJointTrajectoryAction)
        self._found = False

    def _live(self, _: Any) -> None:
        self._sign = time.monotonic()

    def wait(self, seconds: float) -> None:
        """See `Controller`."""
        time.sleep(seconds)

    def listens(self) -> bool:
        """See `Controller`."""
        self._found = self._found or self._client.wait_for_server(self._rospy.Duration(0.1))
        return self._found and time.monotonic() - self._sign < DEATH

    def send(self, message: dict[str, Any], turns: list[float]) -> str:
        """See `Controller`."""
        goal = self._control.FollowJointTrajectoryGoal()
        fill(goal.trajectory, self._trajectory.JointTrajectoryPoint, message, turns, ("secs", "nsecs"))
        self._client.send_goal(goal)
        return str(self._client.gh.comm_state_machine.action_goal.goal_id.id)

    def ended(self) -> bool:
        """See `Controller`."""
        status, state = self._actionlib.GoalStatus, self._client.get_state()
        if state in (status.PENDING, status.ACTIVE, status.PREEMPTING, status.RECALLING):
            return False
        result = self._client.get_result()
        check_result(
            state == status.SUCCEEDED, 0 if result is None else result.error_code, self._client.get_goal_status_text()
        )
        return True

    def cancel(self) -> None:
        """See `Controller`."""
        self._client.cancel_goal()
        time.sleep(BEHIND)  # the message leaves in another thread
        if self._kinova:
            print(DRIVER_DIES, file=sys.stderr)

    def close(self) -> None:
        """See `Controller`."""
        self._rospy.signal_shutdown("done")


class Undisturbed:
    """Within it interruptions wait: ROS 2 makes other errors of what is raised in its midst."""

    def __init__(self) -> None:
        """Nothing has come."""
        self._is_inside, self._came = False, ""

    def __enter__(self) -> None:
        """Begin."""
        self._is_inside = True

    def __exit__(self, *_: object) -> None:
        """End, and be interrupted by what came."""
        self._is_inside = False
        self.interrupt()

    def interrupt(self, name: str = "") -> None:
        """Be interrupted by a signal, now or at the end."""
        came, self._came = name or self._came, ""
        if came and self._is_inside:
            self._came = came
        elif came:
            raise KeyboardInterrupt(came)


UNDISTURBED = Undisturbed()


class Ros2Controller:
    """A controller of ROS 2, by rclpy."""

    def __init__(self, names: list[str], action: str, states: str) -> None:
        """Of joints with these names."""
        self._rclpy: Any = importlib.import_module("rclpy")
        actions: Any = importlib.import_module("rclpy.action")
        signals: Any = importlib.import_module("rclpy.signals")
        qos: Any = importlib.import_module("rclpy.qos")
        control: Any = importlib.import_module("control_msgs.action")
        sensors: Any = importlib.import_module("sensor_msgs.msg")
        self._trajectory: Any = importlib.import_module("trajectory_msgs.msg")
        # Signals are ours: rclpy's own handlers would take away the context that cancels the goal.
        self._rclpy.init(signal_handler_options=signals.SignalHandlerOptions.NO)
        self._node = self._rclpy.create_node("send_trajectory")
        self.states = JointStates(states, names)
        # Best effort: it hears reliable publishers, too.
        self._node.create_subscription(sensors.JointState, states, self.states.take, qos.qos_profile_sensor_data)
        self._type = control.FollowJointTrajectory
        self._uuid: Any = importlib.import_module("unique_identifier_msgs.msg").UUID
        self._client = actions.ActionClient(self._node, self._type, action)
        self._sent: Any = None
        self._result: Any = None

    def wait(self, seconds: float) -> None:
        """See `Controller`."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            with UNDISTURBED:
                self._rclpy.spin_once(self._node, timeout_sec=max(0.0, end - time.monotonic()))

    def listens(self) -> bool:
        """See `Controller`."""
        return bool(self._client.server_is_ready())

    def send(self, message: dict[str, Any], turns: list[float]) -> str:
        """See `Controller`."""
        goal = self._type.Goal()
        fill(goal.trajectory, self._trajectory.JointTrajectoryPoint, message, turns, ("sec", "nanosec"))
        identifier = uuid.uuid4()
        self._sent = self._client.send_goal_async(goal, goal_uuid=self._uuid(uuid=list(identifier.bytes)))
        return identifier.hex

    def ended(self) -> bool:
        """See `Controller`."""
        if self._result is None:
            if not self._sent.done():
                return False
            if not self._sent.result().accepted:
                raise StoppedError("the controller rejected the goal: other joints, or other limits?")
            self._result = self._sent.result().get_result_async()
        if not self._result.done():
            return False
        answer = self._result.result()
        check_result(
            answer.status == SUCCEEDED and not answer.result.error_code,
            answer.result.error_code,
            answer.result.error_string,
        )
        return True

    def cancel(self) -> None:
        """See `Controller`."""
        if self._sent is None:
            return
        end = time.monotonic() + DEATH
        while not self._sent.done() and time.monotonic() < end:  # what was not accepted yet cannot be cancelled
            self.wait(0.02)
        if self._sent.done() and self._sent.result().accepted:
            self._rclpy.spin_until_future_complete(
                self._node, self._sent.result().cancel_goal_async(), timeout_sec=DEATH
            )

    def close(self) -> None:
        """See `Controller`."""
        self._node.destroy_node()
        self._rclpy.shutdown()


def which_ros(wanted: int | None) -> int:
    """The version of ROS: the one that is wanted, that $ROS_VERSION says, or that is installed."""
    if wanted is not None:
        return wanted
    there = [version for version, name in ((1, "rospy"), (2, "rclpy")) if importlib.util.find_spec(name) is not None]
    if len(there) == 2 and os.environ.get("ROS_VERSION") in ("1", "2"):
        return int(os.environ["ROS_VERSION"])
    if len(there) != 1:
        raise StoppedError("both ROS 1 and ROS 2 are installed: say --ros 1 or 2" if there else "ROS is not installed")
    return there[0]


def check_result(succeeded: bool, code: int, text: str) -> None:
    """Refuse to call a goal reached that was not."""
    if not succeeded:
        raise StoppedError(f"the controller gave up, error {code}: {text or 'it does not say why'}")


def send(options: argparse.Namespace) -> str:
    """Send a file; returns what became of it, in a line.

    Raises:
        StoppedError: says why it was not sent to its end.
        AwayError: it was, and the arm stands farther than the tolerance from there.
    """
    path: Path = options.file
    if path.name.endswith(".kinova.csv"):
        angles, velocities = read_velocities(path)
        rehearsal = Rehearsal(angles[0])
        if options.rehearse:
            away = send_velocities(angles, velocities, rehearsal, rehearsal)
        elif options.ros == 2:
            raise StoppedError("velocities go to kinova-ros, which is of ROS 1")
        else:
            away = send_velocities(angles, velocities, KinovaDriver(options.robot, len(angles[0])), WallClock())
        sent = (
            f"{len(angles)} rows in {(len(angles) - 1) * PERIOD:.2f} s, the arm ends {away:.2f} deg from the last one"
        )
        return judged(sent, away, options.tolerance)
    if path.suffix != ".json":
        raise StoppedError(f"{path}: .kinova.csv, .kinova.json or .json, as jacokin saves them")
    message = read_goal(path)
    action = options.action or f"/{options.robot}/follow_joint_trajectory"
    states = options.states or f"/{options.robot}_driver/out/joint_state"
    names, unlimited = message["joint_names"], options.unlimited
    kinova = is_kinova(message, options.robot, action, states)
    if kinova:
        check_points(message)
        unlimited = names  # it plays velocities: turns do not matter
    if options.rehearse:
        return f"{len(message['points'])} points of {', '.join(message['joint_names'])}; without ROS no goal is sent"
    if kinova:
        print("a goal of kinova-ros: on Ctrl-C, " + DRIVER_DIES, file=sys.stderr)
    version = which_ros(options.ros)
    guardian = Guard(version, action)
    try:
        controller: Controller
        if version == 2:
            controller = Ros2Controller(names, action, states)
        else:
            controller = Ros1Controller(names, action, states, kinova=kinova)
        try:
            away = send_goal(message, controller, guardian, unlimited)
        finally:
            controller.close()
    finally:
        guardian.close()
    sent = f"the controller says that the goal was reached; the arm ends {away:.2f} deg from the last point"
    return judged(sent, away, options.tolerance)


def judged(sent: str, away: float, tolerance: float) -> str:
    """What became of a file, where the arm stands at its end.

    Raises:
        AwayError: it does not.
    """
    if not away <= tolerance:
        raise AwayError(f"{sent} ({tolerance:g} allowed)")
    return sent


def interrupt(number: int, _: object) -> None:
    """Stop as Ctrl-C does, once: what stops the arm is not interrupted."""
    for each in SIGNALS:
        signal.signal(each, signal.SIG_IGN)
    UNDISTURBED.interrupt(signal.Signals(number).name)


def main() -> None:
    if sys.argv[1:2] == ["--guard"]:
        try:
            guard(int(sys.argv[2]), sys.argv[3])
        except StoppedError:  # the other one finds that, too, and says it
            sys.exit(1)
        return
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("file", type=Path, help=".kinova.csv, .kinova.json or .json, of jacokin's Trajectory.save")
    parser.add_argument("--robot", default="j2n6s300", help="name that kinova-ros was started with")
    parser.add_argument("--action", help="of FollowJointTrajectory, by default /ROBOT/follow_joint_trajectory")
    parser.add_argument("--states", help="topic of joint states, by default /ROBOT_driver/out/joint_state")
    parser.add_argument(
        "--unlimited",
        nargs="+",
        default=[],
        metavar="JOINT",
        help="joints that turn without limits, which may stand whole turns from where the file begins",
    )
    parser.add_argument(
        "--tolerance",
        type=float,
        default=TOLERANCE,
        metavar="DEG",
        help=f"from the end of the file, within which the exit code is 0; by default {TOLERANCE:g}",
    )
    parser.add_argument("--ros", type=int, choices=(1, 2), help="version of ROS, where both are installed")
    parser.add_argument("--rehearse", action="store_true", help="send to an arm that does what it is told, without ROS")
    options = parser.parse_args()
    for each in SIGNALS:
        if signal.getsignal(each) is not signal.SIG_IGN:  # of nohup
            signal.signal(each, interrupt)
    try:
        print(send(options))
    except KeyboardInterrupt:
        sys.exit("interrupted: the arm was told to stop")
    except (StoppedError, OSError, ImportError) as why:
        sys.exit(f"stopped: {why}")
    except AwayError as why:
        sys.exit(f"not there: {why}")


if __name__ == "__main__":
    main()
