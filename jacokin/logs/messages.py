"""What the messages of ROS say, as arrays in radians and metres, and which kinds of messages are read.

Units are those of the type: sensor_msgs has radians (REP 103), kinova_msgs degrees.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.ik.files.targets import rotations_from_quats
from jacokin.logs.bag import CONTROLLER_STATE, Topic
from jacokin.model import checks
from jacokin.model.joint_names import find_joints
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
SHOWN = 3  # of what is said of messages that have other joints
NANOSECOND = 1e-9  # [s]

Messages = Iterable[tuple[int, Any]]


@dataclass(frozen=True, slots=True, eq=False)
class JointRecord:
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
class PoseRecord:
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
    read, kind = _Joints(robot, prefix), topic.type
    if kind in (TRAJECTORY, GOAL):
        rows = list(_of_trajectories(read, messages, kind))
    else:
        rows = [row for received, message in messages if (row := _row(read, kind, received, message)) is not None]
    count = len(rows) + read.refused
    if not rows:
        seen = "; ".join(list(read.others)[:SHOWN]) or "no messages"
        raise InvalidInputError(f"{topic} does not have the joints of {robot.name}: {seen}")
    by_stamp = all(row.stamp for row in rows)
    kept = _later(topic, [row.stamp if by_stamp else row.received for row in rows])
    chosen = [rows[index] for index in kept]
    q = np.array([row.q for row in chosen])
    turning = robot.unlimited
    q[:, turning] = np.unwrap(q[:, turning], axis=0)
    return JointRecord(
        topic=topic.name,
        t=_seconds([row.received for row in chosen], zero),
        stamp=_seconds([row.stamp for row in chosen], zero) if by_stamp else None,
        q=checks.read_only(q),
        v=_stacked([row.v for row in chosen]),
        torque=_stacked([row.torque for row in chosen]),
        left_out=count - len(chosen),
    )


def pose_record(topic: Topic, messages: Messages, zero: int) -> PoseRecord:
    """Poses of messages of one of `POSE_TYPES`; times count from `zero` [ns].

    Raises:
        InvalidInputError: no message has a pose, their frames differ, or their clock goes back.
    """
    kind = topic.type
    point = kind.endswith("PointStamped")
    rows = [(received, *_pose(kind, message)) for received, message in messages]
    numbers = np.array([row[3] for row in rows]).reshape(len(rows), -1)
    sound = np.isfinite(numbers).all(axis=1)
    rotations = None
    if not point and len(rows):
        rotations, wrong = rotations_from_quats(np.where(sound[:, None], numbers[:, 3:], 0.0))
        sound[wrong] = False
    rows, numbers = [row for row, fine in zip(rows, sound, strict=True) if fine], numbers[sound]
    if not rows:
        raise InvalidInputError(f"{topic} has no pose in {len(sound)} messages")
    frames = sorted({row[2] for row in rows})
    if len(frames) > 1:
        raise InvalidInputError(f"{topic} has poses in several frames: {', '.join(frames)}")
    by_stamp = all(row[1] for row in rows)
    kept = _later(topic, [row[1] if by_stamp else row[0] for row in rows])
    return PoseRecord(
        topic=topic.name,
        frame=frames[0],
        t=_seconds([rows[index][0] for index in kept], zero),
        stamp=_seconds([rows[index][1] for index in kept], zero) if by_stamp else None,
        positions=checks.read_only(numbers[kept, :3]),
        rotations=None if rotations is None else checks.read_only(rotations[sound][kept]),
        left_out=len(sound) - len(kept),
    )


class _Joints:
    """The joints of a robot in messages, found once for each list of names.

    Attributes:
        refused: messages without all of them.
        others: what was said of those.
    """

    def __init__(self, robot: Robot, prefix: str | None) -> None:
        self.robot, self._prefix = robot, prefix
        self.refused, self.others = 0, dict[str, None]()
        self._found: dict[tuple[str, ...], tuple[int, ...] | None] = {}

    def choose(self, names: Sequence[str], values: Sequence[float] | Array) -> Array | None:
        """(dof,) of values that belong to names; None, counted, where a joint is missing or a value is not finite."""
        key = tuple(names)
        if key not in self._found:
            try:
                self._found[key] = find_joints(key, self.robot, self._prefix)
            except InvalidInputError as error:
                self._found[key] = None
                self.others[str(error)] = None
        indices = self._found[key]
        chosen = self.beside(names, values)
        if chosen is None:
            if indices is not None:
                self.others["values that are not finite, or not one for each joint"] = None
            self.refused += 1
        return chosen

    def all_of(self, values: Array) -> Array | None:
        """(dof,) values without names, as the arm has them; None, counted, where they are not as many or not finite."""
        if values.shape == (self.robot.dof,) and np.isfinite(values).all():
            return values
        self.others[f"{len(values)} angles without names, for {self.robot.dof} joints"] = None
        self.refused += 1
        return None

    def beside(self, names: Sequence[str], values: Sequence[float] | Array) -> Array | None:
        """As `choose`, of names that were chosen from before; not counted."""
        indices, numbers = self._found[tuple(names)], np.asarray(values, dtype=np.float64)
        if indices is None or numbers.shape != (len(names),):
            return None
        chosen = numbers[list(indices)]
        return chosen if np.isfinite(chosen).all() else None


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
    for received, message in messages:
        trajectory = message.goal.trajectory if kind == GOAL else message
        start = _stamp(trajectory.header) or received
        points = []
        for point in trajectory.points:
            q = read.choose(trajectory.joint_names, point.positions)
            if q is not None:
                points.append((start + _nanoseconds(point.time_from_start), q))
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


def _stamp(header: Any) -> int:
    return _nanoseconds(header.stamp)


def _nanoseconds(time: Any) -> int:
    return int(time.sec) * 1_000_000_000 + int(time.nanosec)


def _later(topic: Topic, times: Sequence[int]) -> list[int]:
    """Those that are later than all before.

    Raises:
        InvalidInputError: fewer than half are: a simulation that began anew, for example.
    """
    latest, kept = -math.inf, []
    for index, time in enumerate(times):
        if time > latest:
            latest = time
            kept.append(index)
    if 2 * len(kept) < len(times):
        raise InvalidInputError(f"{topic}: {len(times) - len(kept)} of {len(times)} messages are not later than others")
    return kept


def _seconds(times: Sequence[int], zero: int) -> Array:
    return checks.read_only(NANOSECOND * np.array([time - zero for time in times], dtype=np.float64))


def _stacked(rows: Sequence[Array | None]) -> Array | None:
    """Rows as one array; None where one is missing."""
    there = [row for row in rows if row is not None]
    return checks.read_only(np.array(there)) if len(there) == len(rows) else None
