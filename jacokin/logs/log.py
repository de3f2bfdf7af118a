"""`Log`: what an arm did, by a recording of ROS. Read this file first.

Topics have names that drivers give them. Where none is asked for, those of kinova-ros and ros2_control are looked for.
Of a recording there are rows for calibration: `find_standstills`, while an instrument looks at the arm; `smooth_rows`,
with torques.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array, Sealed
from jacokin.errors import InvalidInputError, UnknownNameError
from jacokin.files import parsing
from jacokin.logs.bag import NOT_A_LOG, Topic, open_bag
from jacokin.logs.messages import (
    COMMAND_TYPES,
    JOINT_TYPES,
    POSE_TYPES,
    JointRecord,
    PoseRecord,
    has_joints,
    joint_record,
    pose_record,
)
from jacokin.model import checks
from jacokin.model.robot import Robot, checked_robot

#: Ends of the names of topics, first those that are preferred.
JOINTS = ("/joint_states", "/out/joint_state", "/out/joint_angles")
COMMANDS = (
    "/out/joint_command",
    "/controller_state",
    "/state",
    "/follow_joint_trajectory/goal",
    "/joint_trajectory",
    "/command",
)
COMMAND = "command"  # so end topics of what was commanded, as /out/joint_command, which nothing has measured
LOOKED_AT = 1000  # messages of a topic among which the arm's joints are looked for: a gripper may publish more often
OWN_POSE = "/out/tool_pose"  # of kinova-ros: its forward kinematics of the joint angles that it reports

GAP = 0.5  # [s] without messages: what the arm did meanwhile is not known
WINDOW = 0.2  # [s]
DEGREE = 3  # of the polynomials: the least that has an acceleration with a slope
FEWEST = 7  # rows in a window
HOLE = 5.0  # times the usual step: no polynomial reaches across

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, eq=False)
class Recording(Sealed):
    """What the arm did, to be played. Arrays are read-only."""

    joint_names: tuple[str, ...]
    """Of the robot."""
    t: Array
    """(n,) times of what was measured, from 0 [s]."""
    q: Array
    """(n, dof) measured joint angles [rad]."""
    commanded_t: Array
    """(m,) times of what was commanded, on the same clock [s]; none where nothing was."""
    commanded_q: Array
    """(m, dof) commanded joint angles [rad]."""


class Log:
    """A recording of one arm. Each question reads the file anew, and only the topics that it needs.

    Attributes:
        path: of the file.
        robot: whose joints are looked for.
        topics: what the recording has, by name.
    """

    def __init__(self, path: str | Path, robot: Robot, *, prefix: str | None = None) -> None:
        """Look at a recording.

        Args:
            path: .bag of ROS 1, .mcap or .db3 of ROS 2.
            robot: whose joints to look for; those of fingers and others are left alone.
            prefix: before the names of its joints, such as "j2n6s300_"; None to find it. kinova_msgs/JointAngles has
                no names: it is taken for the arm.

        Raises:
            InvalidInputError: cannot be read, too large, damaged, not closed, or of another kind.
            MissingExtraError: rosbags is not installed.
        """
        self.path = checks.path("path", path)
        self.robot = checked_robot("robot", robot)
        self._prefix = checks.optional(checks.text, "prefix", prefix)
        with open_bag(self.path) as bag:
            self.topics: Mapping[str, Topic] = bag.topics

    def __repr__(self) -> str:
        """File and topics."""
        return f"Log({str(self.path)!r}, {self.robot.name}, {len(self.topics)} topics)"

    def joints(self, topic: str | None = None) -> JointRecord:
        """What was measured of the joints.

        Args:
            topic: of sensor_msgs/JointState or kinova_msgs/JointAngles; None for the one with the joints of the robot
                that ends in /joint_states, /out/joint_state or /out/joint_angles, in this order, else the only one that
                does not end in "command".

        Raises:
            InvalidInputError: no such topic, several, or none of its messages has the joints of the robot; lists the
                topics that are there.
        """
        if topic is not None:
            return self._joints(self._named("joints", topic, JOINT_TYPES))
        there = [each for each in self._of_types(JOINT_TYPES) if not each.name.endswith(COMMAND)]
        if not there:
            raise self._missing("joints", JOINT_TYPES)
        chosen = self._with_joints("joints", there, (*JOINTS, ""))
        return self._joints(there[0] if chosen is None else chosen)  # which says why it does not fit

    def commanded(self, topic: str | None = None) -> JointRecord | None:
        """What was commanded to the joints; None where nothing was recorded of it.

        Points of trajectories are at their own times; one trajectory takes over from the one before, whose end is held.

        Args:
            topic: of sensor_msgs/JointState, kinova_msgs/JointAngles, trajectory_msgs/JointTrajectory,
                control_msgs/JointTrajectoryControllerState (its desired or reference), or goals of
                FollowJointTrajectory in ROS 1; None for the one with the joints of the robot that ends in
                /out/joint_command, /controller_state, /state, /follow_joint_trajectory/goal, /joint_trajectory or
                /command, in this order.

        Raises:
            InvalidInputError: as `joints`.
        """
        if topic is not None:
            return self._joints(self._named("commanded", topic, COMMAND_TYPES))
        chosen = self._with_joints("commanded", self._of_types(COMMAND_TYPES), COMMANDS)
        return None if chosen is None else self._joints(chosen)

    def poses(self, topic: str | None = None) -> PoseRecord:
        """What an instrument measured of the hand.

        Args:
            topic: of PoseStamped, PoseWithCovarianceStamped, TransformStamped or PointStamped of geometry_msgs; None
                for the only one. That of kinova-ros' driver, out/tool_pose, is taken where there is no other, with a
                warning: it is computed from the joint angles, and measured by nothing.

        Raises:
            InvalidInputError: no such topic, several, or poses in several frames; lists the topics that are there.
        """
        there = self._of_types(POSE_TYPES)
        others = [each for each in there if not each.name.endswith(OWN_POSE)]
        chosen = self._only("poses", others or there) if topic is None else self._named("poses", topic, POSE_TYPES)
        if chosen is None:
            raise self._missing("poses", POSE_TYPES)
        if chosen.name.endswith(OWN_POSE):
            logger.warning(
                "%s is the driver's own forward kinematics: it says nothing about where the arm really is", chosen.name
            )
        with open_bag(self.path) as bag:
            return pose_record(chosen, bag.messages(chosen.name), bag.start)

    def standstills(
        self, rule: StandstillRule | None = None, *, joints: str | None = None, poses: str | None = None
    ) -> Standstills:
        """Where the arm stands still, and what was measured of the hand meanwhile: rows for `calibrate`.

        Args:
            rule: what counts as standing still; None for its defaults.
            joints: topic, as for `joints`.
            poses: topic, as for `poses`.

        Raises:
            InvalidInputError: as `joints` and `poses`, or the arm never stands still while its hand is measured.
        """
        rule = StandstillRule() if rule is None else checks.instance("rule", rule, StandstillRule, "a StandstillRule")
        measured, seen = self.joints(joints), self.poses(poses)
        times, pose_times = same_clock(measured, seen)
        with self._naming():
            return find_standstills(rule, measured, times, seen, pose_times)

    def torque_rows(self, *, joints: str | None = None, window: float = WINDOW) -> TorqueRows:
        """Joint angles, velocities, accelerations and torques at the same times: rows for `identify_arm`.

        Args:
            joints: topic, as for `joints`, of messages with efforts.
            window: over which cubic polynomials are fitted to angles and torques [s]; what is quicker is smoothed away.

        Raises:
            InvalidInputError: as `joints`; no efforts, or too few messages for the window.
        """
        window = checks.positive("window", window, "s")
        record = self.joints(joints)
        with self._naming():
            return smooth_rows(record, window)

    def recording(self, *, joints: str | None = None, commanded: str | None = None) -> Recording:
        """What was measured beside what was commanded, to be played.

        Args:
            joints: topic, as for `joints`.
            commanded: topic, as for `commanded`.

        Raises:
            InvalidInputError: as `joints`.
        """
        measured, asked = self.joints(joints), self.commanded(commanded)
        if asked is None:
            times, asked_t, asked_q = measured.t, np.zeros(0), np.zeros((0, self.robot.dof))
        else:
            times, asked_t = same_clock(measured, asked)
            there = np.array([np.interp(asked_t[0], times, angles) for angles in measured.q.T])
            asked_q = asked.q + _turns(there - asked.q[0], self.robot)
        return Recording(
            self.robot.joint_names,
            checks.read_only(times - times[0]),
            measured.q,
            checks.read_only(asked_t - times[0]),
            checks.read_only(asked_q),
        )

    def _named(self, what: str, topic: str, types: Sequence[str]) -> Topic:
        """The topic that is asked for.

        Raises:
            InvalidInputError: there is none, or it is of another type.
        """
        name = checks.text(what, topic)
        if name not in self.topics:
            raise UnknownNameError("topic", name, self.topics)
        if self.topics[name].type not in types:
            raise InvalidInputError(f"{self.path}: {self.topics[name]} is none of {', '.join(types)}")
        return self.topics[name]

    def _of_types(self, types: Sequence[str]) -> list[Topic]:
        return [each for each in self.topics.values() if each.type in types and each.count]

    def _only(self, what: str, topics: Sequence[Topic]) -> Topic | None:
        """The one of some topics; None for none.

        Raises:
            InvalidInputError: there are several.
        """
        if len(topics) > 1:
            listed = ", ".join(map(str, topics))
            raise InvalidInputError(f"{self.path}: several topics could be meant by {what}: {listed}; name one")
        return topics[0] if topics else None

    def _with_joints(self, what: str, topics: Sequence[Topic], endings: Sequence[str]) -> Topic | None:
        """The topic with the joints of the robot whose name ends as those that are preferred; None for none.

        Raises:
            InvalidInputError: there are several that are as good.
        """
        for ending in endings:
            there = [each for each in topics if each.name.endswith(ending)]
            with open_bag(self.path) as bag:
                fitting = [
                    each
                    for each in there
                    if has_joints(each, islice(bag.messages(each.name), LOOKED_AT), self.robot, self._prefix)
                ]
            if fitting:
                return self._only(what, fitting)
        return None

    def _missing(self, what: str, types: Sequence[str]) -> InvalidInputError:
        listed = ", ".join(map(str, self.topics.values())) or "none"
        return InvalidInputError(f"{self.path}: has no topic for {what} ({', '.join(types)}); its topics are: {listed}")

    def _joints(self, topic: Topic) -> JointRecord:
        with open_bag(self.path) as bag:
            return joint_record(topic, bag.messages(topic.name), bag.start, self.robot, self._prefix)

    def _naming(self) -> AbstractContextManager[None]:
        return parsing(self.path, NOT_A_LOG)


def same_clock(first: JointRecord, second: JointRecord | PoseRecord) -> tuple[Array, Array]:
    """Times of two records on one clock: that of their headers where both have it, else that of the recorder."""
    if first.stamp is not None and second.stamp is not None:
        return first.stamp, second.stamp
    return first.t, second.t


def _turns(difference: Array, robot: Robot) -> Array:
    """Whole turns (dof,) of joints without limits nearest to a difference [rad]."""
    turn = 2.0 * np.pi
    return np.where(robot.unlimited & ~robot.sliding, turn * np.round(difference / turn), 0.0)


@dataclass(frozen=True, slots=True)
class StandstillRule:
    """When an arm stands still: for so long, no joint is quicker than this, and none goes farther than that.

    Speeds are differences of the reported angles over 0.2 s, since not all drivers report velocities.

    Raises:
        InvalidInputError: not positive, or `settle` negative.
    """

    speed: float = 0.01
    """No joint is quicker [rad/s]."""
    duration: float = 1.0
    """For at least so long [s], besides `settle` at both ends."""
    settle: float = 0.3
    """After it has stopped, and before it goes on, nothing is used: it swings, and instruments are late [s]."""
    spread: float = 0.005
    """No joint's angles are farther apart meanwhile [rad]: slow drift is motion, too."""

    def __post_init__(self) -> None:
        """Check the numbers."""
        for name, unit in (("speed", "rad/s"), ("duration", "s"), ("spread", "rad")):
            object.__setattr__(self, name, checks.positive(name, getattr(self, name), unit))
        object.__setattr__(self, "settle", checks.non_negative("settle", self.settle, "s"))


@dataclass(frozen=True, slots=True, eq=False)
class Standstills(Sealed):
    """Where an arm stood still, in order of time. Arrays are read-only."""

    start: Array
    """(n,) from when on messages are used [s], from the beginning of the recording; on the clock of headers, if any."""
    stop: Array
    """(n,) until when [s]."""
    q: Array
    """(n, dof) mean joint angles [rad]."""
    q_spread: Array
    """(n,) standard deviation of the joint that varies most [rad]."""
    positions: Array
    """(n, 3) median of what the instrument measured meanwhile [m]."""
    rotations: Array | None
    """(n, 3, 3) that is nearest to the medians; None for points."""
    noise: Array
    """(n,) standard deviation of the coordinate that varies most [m]."""
    counts: NDArray[np.int_]
    """(n,) measurements of the instrument in each."""
    drifting: int
    """How many more there were in which a joint went farther than `spread`."""
    unseen: int
    """How many more there were in which the instrument measured nothing."""

    def __len__(self) -> int:
        """How many there are."""
        return len(self.q)

    @property
    def poses(self) -> Array:
        """(n, 4, 4) what the instrument measured.

        Raises:
            InvalidInputError: it measured points.
        """
        if self.rotations is None:
            raise InvalidInputError("poses: the instrument measured points, whose positions are known only")
        T = np.tile(np.eye(4), (len(self), 1, 1))
        T[:, :3, :3], T[:, :3, 3] = self.rotations, self.positions
        return checks.read_only(T)


def find_standstills(
    rule: StandstillRule, joints: JointRecord, times: Array, poses: PoseRecord, pose_times: Array
) -> Standstills:
    """Where the arm stands still.

    Args:
        rule: when it does.
        joints: what was reported.
        times: (n,) of that [s].
        poses: what was measured.
        pose_times: (m,) of that, on the same clock [s].

    Raises:
        InvalidInputError: nowhere, or only while nothing was measured.
    """
    rows, drifting, unseen = [], 0, 0
    spans = _still(rule, joints.q, times)
    for first, last in spans:
        here = slice(first, last + 1)
        q = joints.q[here]
        if np.ptp(q, axis=0).max() > rule.spread:
            drifting += 1
            continue
        seen = (pose_times >= times[first]) & (pose_times <= times[last])
        if not seen.any():
            unseen += 1
            continue
        positions = poses.positions[seen]
        rotation = np.eye(3) if poses.rotations is None else _middle(poses.rotations[seen])
        noise = positions.std(axis=0).max()
        rows.append((times[first], times[last], q, np.median(positions, axis=0), rotation, noise, int(seen.sum())))
    if not rows:
        raise InvalidInputError(_nowhere(rule, joints, times, pose_times, len(spans), drifting))
    start, stop, angles, positions, rotations, noise, counts = zip(*rows, strict=True)
    return Standstills(
        start=checks.read_only(start),
        stop=checks.read_only(stop),
        q=checks.read_only([each.mean(axis=0) for each in angles]),
        q_spread=checks.read_only([each.std(axis=0).max() for each in angles]),
        positions=checks.read_only(positions),
        rotations=None if poses.rotations is None else checks.read_only(rotations),
        noise=checks.read_only(noise),
        counts=checks.sealed(np.array(counts)),
        drifting=drifting,
        unseen=unseen,
    )


def _still(rule: StandstillRule, q: Array, times: Array) -> list[tuple[int, int]]:
    """First and last row of each time in which the arm is slow, without what it needs to settle."""
    if len(times) < 2:
        return []
    # Over 0.2 s, two messages of kinova-ros at 10 Hz, noise of encoders averages out.
    before, after = (np.clip(times + half, times[0], times[-1]) for half in (-0.1, 0.1))
    moved = np.column_stack([np.interp(after, times, each) - np.interp(before, times, each) for each in q.T])
    slow = np.abs(moved).max(axis=1) <= rule.speed * (after - before)
    # A run ends before a row that is not slow, and where messages are missing.
    breaks = np.flatnonzero(~slow[1:] | ~slow[:-1] | (np.diff(times) > GAP))
    found = []
    for first, last in zip([0, *(breaks + 1)], [*breaks, len(times) - 1], strict=True):
        inner = np.flatnonzero(
            (times[first : last + 1] >= times[first] + rule.settle)
            & (times[first : last + 1] <= times[last] - rule.settle)
        )
        if slow[first] and len(inner) > 1:
            one, other = first + int(inner[0]), first + int(inner[-1])
            if times[last] - times[first] - 2.0 * rule.settle >= rule.duration:
                found.append((one, other))
    return found


def _middle(rotations: Array) -> Array:
    """The rotation that is nearest to the medians of the entries of some (n, 3, 3)."""
    left, _, right = np.linalg.svd(np.median(rotations, axis=0))
    return np.asarray((left * [1.0, 1.0, np.linalg.det(left @ right)]) @ right)


def _nowhere(
    rule: StandstillRule, joints: JointRecord, times: Array, pose_times: Array, found: int, drifting: int
) -> str:
    if not found:
        return (
            f"{joints.topic}: the arm never stands still for {rule.duration:g} s with no joint above {rule.speed:g} "
            f"rad/s, and {rule.settle:g} s before and after; messages are up to "
            f"{np.diff(times).max(initial=0.0):.2f} s apart"
        )
    if drifting == found:
        return f"{joints.topic}: whenever the arm stands still, a joint goes farther than {rule.spread:g} rad meanwhile"
    apart = (
        f"joints from {times[0]:.1f} to {times[-1]:.1f} s, the hand from {pose_times[0]:.1f} to {pose_times[-1]:.1f} s"
    )
    return f"{joints.topic}: nothing is measured of the hand while the arm stands still ({apart})"


@dataclass(frozen=True, slots=True, eq=False)
class TorqueRows(Sealed):
    """What `identify_arm` and `identify_payload` take. Arrays are read-only."""

    t: Array
    """(n,) [s] from the beginning of the recording; on the clock of headers, if any."""
    q: Array
    """(n, dof) joint angles [rad]."""
    v: Array
    """(n, dof) velocities [rad/s], derivatives of `q`."""
    a: Array
    """(n, dof) accelerations [rad/s^2], derivatives of `v`."""
    torque: Array
    """(n, dof) torques, as the driver reports them [N m]."""
    step: float
    """Time between rows; those where messages are missing are not there [s]."""


def smooth_rows(joints: JointRecord, window: float) -> TorqueRows:
    """Fit a cubic polynomial to a window around each row (Savitzky and Golay, Analytical Chemistry 36(8), 1964).

    Angles and torques pass the same filter. Rows whose window is not whole, at the ends and beside holes, are left out.

    Args:
        joints: with torques.
        window: [s].

    Raises:
        InvalidInputError: no torques, or too few messages in a window.
    """
    from scipy.signal import savgol_filter

    if joints.torque is None:
        raise InvalidInputError(f"{joints.topic}: its messages have no effort for every joint")
    times = joints.t if joints.stamp is None else joints.stamp
    steps = np.diff(times)
    if not len(steps):
        raise InvalidInputError(f"{joints.topic}: has one message only")
    step = float(np.median(steps))
    size = 2 * round(window / step / 2.0) + 1
    if size < FEWEST:
        raise InvalidInputError(
            f"{joints.topic}: {size} messages in a window of {window:g} s, and {FEWEST} are needed: they come every "
            f"{step:.3g} s; give a longer window"
        )
    parts = np.split(np.arange(len(times)), np.flatnonzero(steps > HOLE * step) + 1)
    half, rows = size // 2, []
    for part in parts:
        at = np.arange(times[part[0]], times[part[-1]], step)
        if len(at) < size:
            continue
        q, torque = (
            np.column_stack([np.interp(at, times[part], column[part]) for column in each.T])
            for each in (joints.q, joints.torque)
        )
        whole = slice(half, len(at) - half)
        derivatives = [savgol_filter(q, size, DEGREE, deriv=order, delta=step, axis=0)[whole] for order in range(3)]
        rows.append((at[whole], *derivatives, savgol_filter(torque, size, DEGREE, axis=0)[whole]))
    if not rows:
        raise InvalidInputError(f"{joints.topic}: nowhere are there {window:g} s of messages without a hole")
    t, q, v, a, torque = (checks.read_only(np.concatenate(each)) for each in zip(*rows, strict=True))
    return TorqueRows(t, q, v, a, torque, step)
