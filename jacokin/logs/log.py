"""`Log`: what an arm did, by a recording of ROS. Read this file first.

Topics have names that drivers give them. Where none is asked for, those of kinova-ros and ros2_control are looked for.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np

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
from jacokin.logs.rows import WINDOW, StandstillRule, Standstills, TorqueRows, find_standstills, smooth_rows
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
