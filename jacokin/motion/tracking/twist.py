"""Following a twist: what is asked for, where it has led, and what the kernel of a tick makes of it.

How much of a twist a tick follows is in `jacokin.kernels.tracking.twist`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from jacokin.arrays import Array
from jacokin.ik.targets import RADIAN_IN_METRES
from jacokin.kernels.tracking.limits import TINY
from jacokin.kernels.tracking.twist import (
    GENTLENESS,
    LOWER_LIMIT,
    NEARNESS,
    SINGULARITY,
    UPPER_LIMIT,
    VELOCITY,
    largest_share,
)
from jacokin.model import checks
from jacokin.model.kinematics import REFERENCES
from jacokin.motion.tracking.joint_limits import JointLimits
from jacokin.motion.tracking.problem import free_directions
from jacokin.motion.tracking.steps import SINGULAR_POSE
from jacokin.motion.tracking.targets import IN_BASE, Kinematics
from jacokin.motion.tracking.ticks import TickSolver

TURNS_FREE = 1e-4  # weight [m/rad] of turning against moving where an arm cannot do both, instead of RADIAN_IN_METRES
ASTRAY = (1e-3, 1e-2)  # [m, rad] farther than this from where it was to be, the tool takes its line with it
NOTHING = 1e-5  # [m/s] a slower twist counts as none
FOLLOWED = 0.98  # part of a twist that counts as all of it
WORDS = {
    VELOCITY: "velocity",
    UPPER_LIMIT: "upper limit",
    LOWER_LIMIT: "lower limit",
    GENTLENESS: "acceleration",
}


class TwistLine(NamedTuple):
    """Where twists have led."""

    pose: Array
    """(4, 4) T_base_tool that was asked for, as far as the arm could follow."""
    twist: Array
    """(6,) the twist that was followed over the last tick, at the tool in base axes [m/s, rad/s]."""
    damping: float = 0.0
    """With which some of it was given away."""
    part: float = 0.0
    """Of the twist that was asked for."""


class TwistStep(NamedTuple):
    """What a tick along a twist asks of the joints."""

    line: TwistLine
    """After the tick."""
    is_followed: bool
    """Whether all of the twist is followed."""
    cause: str
    """What holds the arm back; "" for nothing."""


def in_base_axes(twist: ArrayLike, reference: str, pose: Array) -> Array:
    """A twist (6,) given in some reference as the one of the tool, at its pose (4, 4), in base axes [m/s, rad/s].

    Raises:
        InvalidInputError: the twist is malformed.
        UnknownNameError: the reference is unknown.
    """
    checks.choice("reference", reference, REFERENCES)
    given = checks.vector("twist", twist, 6, "m/s, rad/s")
    if reference == "local":
        return np.concatenate([pose[:3, :3] @ given[:3], pose[:3, :3] @ given[3:]])
    if reference == "world":
        return np.concatenate([given[:3] + np.cross(given[3:], pose[:3, 3]), given[3:]])
    return given


def moved(pose: Array, twist: Array, dt: float) -> Array:
    """A pose (4, 4) after `dt` [s] along a twist (6,) of its origin in base axes."""
    way, after = dt * twist, pose.copy()
    after[:3, :3] = pin.exp3(way[3:]).dot(pose[:3, :3])
    after[:3, 3] += way[:3]
    return after


def missing(pose: Array, tool: Array) -> Array:
    """(6,) from a tool to a pose, both (4, 4), position [m] and rotation vector [rad] in base axes."""
    off = np.empty(6)
    off[:3], off[3:] = pose[:3, 3] - tool[:3, 3], pin.log3(pose[:3, :3].dot(tool[:3, :3].T))
    return off


def is_astray(way: Array) -> bool:
    """Whether a tool that misses its line by `way` (6,) has left it: then the line goes on from the tool."""
    x, y, z, a, b, c = way.tolist()
    return math.hypot(x, y, z) > ASTRAY[0] or math.hypot(a, b, c) > ASTRAY[1]


class TwistFollower:
    """Follows twists with the tool of one arm."""

    def __init__(self, kinematics: Kinematics, limits: JointLimits, ticks: TickSolver, dt: float) -> None:
        """Take the arm, its limits, what runs its ticks, and the control step [s]."""
        self._kinematics, self._limits, self._ticks, self._dt = kinematics, limits, ticks, dt
        turn = RADIAN_IN_METRES if kinematics.robot.dof >= 6 else TURNS_FREE
        self._weights = np.array([1.0, 1.0, 1.0, turn, turn, turn])

    def ask(self, line: TwistLine, off: Array, twist: Array, q: Array, wish: Array | None) -> None:
        """Say what a tick is to follow, that was linearised and where the kinematics are.

        Args:
            line: where twists have led so far.
            off: (6,) from the tool to there [m, rad].
            twist: (6,) what is asked for, at the tool in base axes [m/s, rad/s].
            q: (dof,) where the arm is [rad].
            wish: (dof,) displacement [rad] that joints are to make as well, where it does not move the tool; or None.
        """
        aside = None if wish is None else self._aside(wish, q)
        work = self._ticks.twist
        work.weights[...], work.twist[...], work.line[...], work.off[...] = self._weights, twist, line.twist, off
        work.aside[...] = 0.0 if aside is None else aside
        work.damping[0], work.part[0] = line.damping, line.part

    def found(self, line: TwistLine) -> TwistStep:
        """What the kernel has made of it."""
        work, names = self._ticks.twist, self._kinematics.robot.joint_names
        cause, joint = work.cause.tolist()
        word = f"{names[joint]} {WORDS[cause]}" if cause in WORDS else ""
        if cause in (NEARNESS, SINGULARITY):
            word = "what is near" if cause == NEARNESS else SINGULAR_POSE
        followed = work.followed.copy()
        damping, part = float(work.damping[0]), float(work.part[0])
        after = moved(line.pose, followed - work.late / self._dt, self._dt)
        is_followed = part >= FOLLOWED and self._lag() <= 1.0 - FOLLOWED
        return TwistStep(TwistLine(after, followed, damping, part), is_followed, word)

    def _lag(self) -> float:
        """What the arm leaves of the twist that was asked for, as a part of it."""
        work = self._ticks.twist
        gone, wanted = work.inverse.jacobian.reshape(6, -1).dot(self._ticks.velocity) * self._dt, work.wanted.tolist()
        left = math.dist(gone.tolist(), wanted)
        return left / max(math.hypot(*wanted), NOTHING * self._dt)

    def _aside(self, wish: Array, q: Array) -> Array:
        """What of a wish (dof,) [rad] does not move the tool, nor lead to a limit or to what is near."""
        free = free_directions(self._kinematics.jacobian(self._kinematics.tool, IN_BASE))
        found = free.dot(free.T.dot(wish))
        part = largest_share(np.zeros_like(found), found, *self._limits.stoppable(q))
        rows, ends = self._ticks.inequalities_towards(found)
        if rows is not None and ends is not None:
            closing = rows.dot(found)
            part = min(part, float((ends / np.maximum(closing, TINY)).min()))
        return np.asarray(part * found)
