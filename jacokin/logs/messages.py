"""What the messages of ROS say, as arrays in radians and metres, and which kinds of messages are read.

Units are those of the type: sensor_msgs has radians (REP 103), kinova_msgs degrees.
"""

from __future__ import annotations

import math
from array import array
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array, Sealed
from jacokin.errors import InvalidInputError
from jacokin.files import HELD
from jacokin.ik.files.targets import rotations_from_quats
from jacokin.logs.bag import CONTROLLER_STATE, Topic
from jacokin.model import checks
from jacokin.model.descriptions.bundled import NAMES
from jacokin.model.poses import QUATERNION_NORM_TOLERANCE
from jacokin.model.robot import Robot

JOINT_STATE = "sensor_msgs/msg/JointState"
JOINT_ANGLES = "kinova_msgs/msg/JointAngles"
TRAJECTORY = "trajectory_msgs/msg/JointTrajectory"
GOAL = "control_msgs/msg/FollowJointTrajectoryActionGoal"
JOINT_TYPES = (JOINT_STATE, JOINT_ANGLES)
COMMAND_TYPES = (*JOINT_TYPES, CONTROLLER_STATE, TRAJECTORY, GOAL)
POSE_TYPES = tuple(
    f"geometry_msgs/msg/{name}"
    for name in ("PoseStamped", "PoseWithCovarianceStamped", "TransformStamped", "PointStamped")
)
NANOSECOND = 1e-9  # [s]

Messages = Iterable[tuple[int, Any]]


@dataclass(frozen=True, slots=True, eq=False)
class JointRecord(Sealed):
    """What a topic says of the arm's joints. Arrays are read-only; times count from the recording's first message."""

    topic: str
    """Its name."""
    t: Array
    """(n,) when each message was received, increasing where there is no `stamp` [s]."""
    stamp: Array | None
    """(n,) when it was measured, as its header says, increasing [s]; None where a header says nothing."""
    q: Array
    """(n, dof) joint angles, without jumps by whole turns of joints without limits [rad]."""
    v: Array | None
    """(n, dof) velocities [rad/s]; None where a message has none."""
    torque: Array | None
    """(n, dof) what sensor_msgs calls effort [N m]; None where a message has none."""
    left_out: int
    """How many messages are not here: without all joints of the arm, with numbers that are not finite, or not later
    than the one before."""

    def __len__(self) -> int:
        """Number of messages."""
        return len(self.t)


@dataclass(frozen=True, slots=True, eq=False)
class PoseRecord(Sealed):
    """What a topic says of a pose. Arrays are read-only; times count from the recording's first message."""

    topic: str
    """Its name."""
    frame: str
    """In which the poses are, as the headers say."""
    t: Array
    """(n,) when each message was received, increasing where there is no `stamp` [s]."""
    stamp: Array | None
    """(n,) when it was measured, as its header says, increasing [s]; None where a header says nothing."""
    positions: Array
    """(n, 3) [m]."""
    rotations: Array | None
    """(n, 3, 3); None for points."""
    left_out: int
    """How many messages are not here: not finite, without a unit quaternion, or not later than the one before."""

    def __len__(self) -> int:
        """Number of messages."""
        return len(self.t)


class Row(NamedTuple):
    """What a message says of the joints."""

    received: int
    """[ns]."""
    stamp: int
    """[ns], 0 for none."""
    q: Array
    """(dof,) [rad]."""
    v: Array | None
    torque: Array | None


def joint_record(topic: Topic, messages: Messages, zero: int, robot: Robot, prefix: str | None) -> JointRecord:
    """Joints of messages of one of `COMMAND_TYPES`; times count from `zero` [ns].

    Raises:
        InvalidInputError: no message has all joints of the robot, or its clock goes back.
    """
    read = _Joints(robot, prefix)
    rows = _rows(read, topic.type, messages)
    times, q, v, torque = _Times(topic), _ValueColumns(robot.dof), _ValueColumns(robot.dof), _ValueColumns(robot.dof)
    for row in rows:
        times.add(row.received, row.stamp)
        for column, values in zip((q, v, torque), row[2:], strict=True):
            column.add(values)
    count = len(times) + read.refused
    if not len(times):
        seen = "; ".join(read.others) or "no messages"
        raise InvalidInputError(f"{topic} does not have the joints of {robot.name}: {seen}")
    kept = times.later()
    angles = q.rows()[kept]
    turning = robot.unlimited
    angles[:, turning] = np.unwrap(angles[:, turning], axis=0)
    return JointRecord(
        topic=topic.name,
        t=times.received(zero)[kept],
        stamp=times.stamps(zero)[kept] if times.by_stamp else None,
        q=checks.read_only(angles),
        v=checks.read_only(v.rows()[kept]) if v.is_whole else None,
        torque=checks.read_only(torque.rows()[kept]) if torque.is_whole else None,
        left_out=count - int(kept.sum()),
    )


def has_joints(topic: Topic, messages: Messages, robot: Robot, prefix: str | None) -> bool:
    """Whether a message of one of `COMMAND_TYPES` has the joints of a robot; the first such one ends the search."""
    return next(_rows(_Joints(robot, prefix), topic.type, messages), None) is not None


def pose_record(topic: Topic, messages: Messages, zero: int) -> PoseRecord:
    """Poses of messages of one of `POSE_TYPES`; times count from `zero` [ns].

    Raises:
        InvalidInputError: no message has a pose, their frames differ, or their clock goes back.
    """
    is_point = topic.type.endswith("PointStamped")
    times, numbers, frames, count = _Times(topic), _ValueColumns(3 if is_point else 7), set[str](), 0
    for received, message in messages:
        count += 1
        stamp, frame, values = _pose(topic.type, message)
        if not _is_pose(values):
            continue
        frames.add(frame)
        if len(frames) > 1:
            raise InvalidInputError(f"{topic} has poses in several frames: {', '.join(sorted(frames))}")
        times.add(received, stamp)
        numbers.add(values)
    if not len(times):
        raise InvalidInputError(f"{topic} has no pose in {count} messages")
    kept = times.later()
    rows = numbers.rows()[kept]
    return PoseRecord(
        topic=topic.name,
        frame=frames.pop(),
        t=times.received(zero)[kept],
        stamp=times.stamps(zero)[kept] if times.by_stamp else None,
        positions=checks.read_only(rows[:, :3]),
        rotations=None if is_point else checks.read_only(rotations_from_quats(rows[:, 3:])[0]),
        left_out=count - int(kept.sum()),
    )


class _ValueColumns:
    """Rows of numbers that are added one by one, in little memory.

    Attributes:
        is_whole: whether no row was missing.
    """

    def __init__(self, width: int) -> None:
        self._width, self._numbers, self.is_whole = width, array("d"), True

    def add(self, row: Sequence[float] | Array | None) -> None:
        """Add a row; after one that is missing, none is kept."""
        if row is None:
            self.is_whole, self._numbers = False, array("d")
        elif self.is_whole:
            self._numbers.extend(row)

    def rows(self) -> Array:
        """(n, width), a copy."""
        return np.array(self._numbers).reshape(-1, self._width)


class _Times:
    """When messages were received, and when they say that they were made.

    Attributes:
        by_stamp: whether all say it.
    """

    def __init__(self, topic: Topic) -> None:
        self._topic, self._received, self._stamps, self.by_stamp = topic, array("q"), array("q"), True

    def __len__(self) -> int:
        return len(self._received)

    def add(self, received: int, stamp: int) -> None:
        """Add a message's times [ns], 0 for none."""
        self._received.append(received)
        self._stamps.append(stamp)
        self.by_stamp = self.by_stamp and stamp != 0

    def later(self) -> NDArray[np.bool_]:
        """(n,) whether a message is later than all before, by its stamp where all have one.

        Raises:
            InvalidInputError: fewer than half are: a simulation that began anew, for example.
        """
        times = np.array(self._stamps if self.by_stamp else self._received)
        kept = np.append(True, times[1:] > np.maximum.accumulate(times)[:-1])
        dropped = int((~kept).sum())
        if 2 * dropped > len(times):
            raise InvalidInputError(f"{self._topic}: {dropped} of {len(times)} messages are not later than others")
        return kept

    def received(self, zero: int) -> Array:
        """(n,) [s]."""
        return checks.read_only(NANOSECOND * (np.array(self._received) - zero))

    def stamps(self, zero: int) -> Array:
        """(n,) [s]."""
        return checks.read_only(NANOSECOND * (np.array(self._stamps) - zero))


class _Joints:
    """The joints of a robot in messages, found once for each list of names.

    Attributes:
        refused: messages without all of them.
        others: what was said of some of those.
    """

    def __init__(self, robot: Robot, prefix: str | None) -> None:
        self.robot, self._prefix = robot, prefix
        self.refused, self.others = 0, dict[str, None]()
        self._found: dict[tuple[str, ...], tuple[int, ...] | None] = {}

    def choose(self, names: Sequence[str], values: Sequence[float] | Array) -> Array | None:
        """(dof,) of values that belong to names; None, counted, where a joint is missing or a value is not finite."""
        key = tuple(names)
        if key not in self._found:
            if len(self._found) >= 1000:  # lists of names whose joints are kept
                self._found.clear()
            try:
                self._found[key] = find_joints(key, self.robot, self._prefix)
            except InvalidInputError as error:
                self._found[key] = None
                self._note(str(error))
        indices = self._found[key]
        chosen = self.beside(names, values)
        if chosen is None:
            if indices is not None:
                self._note("values that are not finite, or not one for each joint")
            self.refused += 1
        return chosen

    def all_of(self, values: Array) -> Array | None:
        """(dof,) values without names, as the arm has them; None, counted, where they are not as many or not finite."""
        if values.shape == (self.robot.dof,) and np.isfinite(values).all():
            return values
        self._note(f"{len(values)} angles without names, for {self.robot.dof} joints")
        self.refused += 1
        return None

    def _note(self, text: str) -> None:
        if len(self.others) < 3:  # of what is said of messages that have other joints
            self.others[text] = None

    def beside(self, names: Sequence[str], values: Sequence[float] | Array) -> Array | None:
        """(dof,) values by names that `choose` has met, as the arm has them; None for missing or not finite ones."""
        indices, numbers = self._found[tuple(names)], np.asarray(values, dtype=np.float64)
        if indices is None or numbers.shape != (len(names),):
            return None
        chosen = numbers[list(indices)]
        return chosen if np.isfinite(chosen).all() else None


def _rows(read: _Joints, kind: str, messages: Messages) -> Iterator[Row]:
    """The joints of messages that have all of them."""
    if kind in (TRAJECTORY, GOAL):
        yield from _of_trajectories(read, messages, kind)
        return
    for received, message in messages:
        row = _row(read, kind, received, message)
        if row is not None:
            yield row


def _row(read: _Joints, kind: str, received: int, message: Any) -> Row | None:
    """The joints of a message that is not a trajectory; None where it has not all of them."""
    if kind == JOINT_ANGLES:
        dof = read.robot.dof
        angles = np.radians([getattr(message, f"joint{joint}") for joint in range(1, min(dof, 7) + 1)])
        q = read.all_of(angles)
        return None if q is None else Row(received, 0, q, None, None)
    stamp = _stamp(message.header)
    if kind == JOINT_STATE:
        q = read.choose(message.name, message.position)
        if q is None:
            return None
        return Row(
            received, stamp, q, read.beside(message.name, message.velocity), read.beside(message.name, message.effort)
        )
    point = message.reference if hasattr(message, "reference") else message.desired
    q = read.choose(message.joint_names, point.positions)
    return None if q is None else Row(received, stamp, q, read.beside(message.joint_names, point.velocities), None)


def _of_trajectories(read: _Joints, messages: Messages, kind: str) -> Iterator[Row]:
    """The points of trajectories at their times; the next one takes over where it begins, and the end is held until."""
    planned: list[tuple[int, list[tuple[int, Array]]]] = []
    count = 0
    for received, message in messages:
        trajectory = message.goal.trajectory if kind == GOAL else message
        start = _stamp(trajectory.header) or received
        points = []
        for point in trajectory.points:
            q = read.choose(trajectory.joint_names, point.positions)
            if q is not None:
                points.append((start + _nanoseconds(point.time_from_start), q))
                count += 1
                if count > HELD:
                    raise InvalidInputError(f"has trajectories of more than {HELD} points")
        planned.append((start, points))
    planned.sort(key=lambda each: each[0])
    held: Array | None = None
    ends = [start for start, _ in planned[1:]]
    for (start, points), end in zip(planned, [*ends, None], strict=True):
        points.sort(key=lambda each: each[0])
        if held is not None and not (points and points[0][0] <= start):
            yield Row(start, 0, held, None, None)
        for at, q in points:
            if end is None or at <= end:
                yield Row(at, 0, q, None, None)
                held = q
        if end is not None:
            held = next((_between(*pair, end) for pair in pairwise(points) if pair[0][0] <= end < pair[1][0]), held)


def _between(before: tuple[int, Array], after: tuple[int, Array], at: int) -> Array:
    """Where a straight line between two points is at a time [ns]."""
    part = (at - before[0]) / (after[0] - before[0])
    return np.asarray((1.0 - part) * before[1] + part * after[1])


def _pose(kind: str, message: Any) -> tuple[int, str, list[float]]:
    """Stamp [ns], frame, and x, y, z [m], for poses also qw, qx, qy, qz."""
    head = _stamp(message.header), str(message.header.frame_id)
    if kind.endswith("PointStamped"):
        return *head, [message.point.x, message.point.y, message.point.z]
    if kind.endswith("TransformStamped"):
        place, turn = message.transform.translation, message.transform.rotation
    else:
        pose = message.pose.pose if kind.endswith("PoseWithCovarianceStamped") else message.pose
        place, turn = pose.position, pose.orientation
    return *head, [place.x, place.y, place.z, turn.w, turn.x, turn.y, turn.z]


def _is_pose(values: Sequence[float]) -> bool:
    """Whether x, y, z, and w, x, y, z of a quaternion if there are such, are finite, and its norm is near 1."""
    norm = math.hypot(*values[3:]) if len(values) > 3 else 1.0
    return all(map(math.isfinite, values)) and abs(norm - 1.0) <= QUATERNION_NORM_TOLERANCE


def _stamp(header: Any) -> int:
    return _nanoseconds(header.stamp)


def _nanoseconds(time: Any) -> int:
    return int(time.sec) * 1_000_000_000 + int(time.nanosec)


def find_joints(names: Sequence[str], robot: Robot, prefix: str | None = None) -> tuple[int, ...]:
    """Where the joints of a robot are in a list of names.

    The list may have others, as those of fingers or of another arm. Those of the robot are called as in its
    description, or all with one prefix, such as j2n6s300_joint_1.

    Args:
        names: as a message of ROS has them.
        robot: whose joints to find.
        prefix: before each name; None to find it.

    Returns:
        (dof,) indices, in the order of `robot.joint_names`.

    Raises:
        InvalidInputError: joints are missing, there several times, or have the prefix of another bundled robot.
    """
    own = robot.joint_names
    there = set(names)
    found = sorted({name.removesuffix(own[0]) for name in names if name.endswith(own[0])})
    wanted = found if prefix is None else [prefix]
    fitting = [each for each in wanted if all(each + name in there for name in own)]
    listed = ", ".join(names) or "none"
    if not fitting:
        before = "" if prefix is None else f" with {prefix!r} before their names"
        raise InvalidInputError(f"the joints {listed}; {robot.name} has others{before}: {', '.join(own)}")
    if len(fitting) > 1:
        raise InvalidInputError(f"the joints {listed}: several arms; the prefix must be one of {', '.join(fitting)}")
    if prefix is None and fitting[0].rstrip("_/") in set(NAMES) - {robot.name}:
        raise InvalidInputError(f"the joints {listed}; the robot is {robot.name}")
    wanted_names = [fitting[0] + name for name in own]
    if any(names.count(name) > 1 for name in wanted_names):
        raise InvalidInputError(f"the joints {listed}: one is there twice")
    return tuple(names.index(name) for name in wanted_names)
