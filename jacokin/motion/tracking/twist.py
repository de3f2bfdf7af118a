"""Following a twist: in its direction, never faster than asked, and slower where the joints cannot follow.

The tool moves along the twist with a part s of its speed, the largest from 0 to 1 with which every joint keeps its
velocity, can still stop before its limit and before what is near, and the joints' path bends no more than acceleration
limits allow. Towards a singular pose, where a joint would have to turn ever faster, s goes to zero: the arm slows down
and stops there. Where a new twist asks for another velocity, the old twist goes over into it in a straight line, as
fast as the joints may accelerate.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from jacokin.arrays import Array
from jacokin.ik.targets import RADIAN_IN_METRES
from jacokin.kernels.tracking.limits import EASY, TINY, braking_speed
from jacokin.model import checks
from jacokin.model.jacobians import REFERENCES
from jacokin.motion.tracking.joint_limits import JointLimits, largest_share
from jacokin.motion.tracking.problem import controlled_directions
from jacokin.motion.tracking.steps import SINGULAR_POSE
from jacokin.motion.tracking.targets import IN_BASE, Kinematics
from jacokin.motion.tracking.ticks import JointState, TickSolver

EXACT = 1e-12  # damping where nothing is to be given away: square of a weighted singular value [m^2/rad^2]
ASIDE = 0.01  # part of the twist that may be given away where the joints could not follow it otherwise
HALVINGS = 5  # of the range of damping in which no more is given away than needed
BENT = 0.1  # part of its way in a tick by which the joints' path may bend towards a singular pose
CREEPING = 1e-3  # a smaller part of a twist towards a singular pose is none: the arm stands
BENDING = 0.5  # part of the acceleration limits that the bend of the joints' path may use
TURNS_FREE = 1e-4  # weight [m/rad] of turning against moving where an arm cannot do both, instead of RADIAN_IN_METRES
SETTLING = 1e-5  # damping, and
SETTLED = 0.5  # part of the tick's room, with which the tool is brought back to the line
ASTRAY = (1e-3, 1e-2)  # [m, rad] farther than this from where it was to be, the tool takes its line with it
NOTHING = 1e-5  # [m/s] a slower twist counts as none
HURRY = 5e-3  # part of a twist by which the tool may be faster than asked, to make up for what a tick left undone
FOLLOWED = 0.98  # part of a twist that counts as all of it


class TwistLine(NamedTuple):
    """Where twists have led."""

    pose: pin.SE3
    """T_base_tool that was asked for, as far as the arm could follow."""
    twist: Array
    """(6,) the twist that was followed over the last tick, at the tool in base axes [m/s, rad/s]."""


class TwistStep(NamedTuple):
    """What a tick along a twist asks of the joints."""

    displacement: Array
    """(dof,) within the bounds of the tick [rad]."""
    line: TwistLine
    """After the tick."""
    part: float
    """Of the twist that can be followed."""
    cause: str
    """What holds the arm back; "" for nothing."""
    wanted: Array
    """(6,) what was asked for, weighted [m]."""
    jacobian: Array
    """(6, dof) weighted."""


def in_base_axes(twist: ArrayLike, reference: str, pose: pin.SE3) -> Array:
    """A twist (6,) given in some reference as the one of the tool, at its pose, in base axes [m/s, rad/s].

    Raises:
        InvalidInputError: the twist is malformed.
        UnknownNameError: the reference is unknown.
    """
    checks.choice("reference", reference, REFERENCES)
    given = checks.vector("twist", twist, 6, "m/s, rad/s")
    if reference == "local":
        return np.concatenate([pose.rotation @ given[:3], pose.rotation @ given[3:]])
    if reference == "world":
        return np.concatenate([given[:3] + np.cross(given[3:], pose.translation), given[3:]])
    return given


def moved(pose: pin.SE3, twist: Array, dt: float) -> pin.SE3:
    """A pose after `dt` [s] along a twist (6,) of its origin in base axes."""
    return pin.SE3(pin.exp3(dt * twist[3:]) @ pose.rotation, pose.translation + dt * twist[:3])


def missing(pose: pin.SE3, tool: pin.SE3) -> Array:
    """(6,) from a tool to a pose, position [m] and rotation vector [rad] in base axes."""
    return np.concatenate([pose.translation - tool.translation, pin.log3(pose.rotation @ tool.rotation.T)])


def is_astray(way: Array) -> bool:
    """Whether a tool that misses its line by `way` (6,) has left it: then the line goes on from the tool."""
    return _length(way[:3]) > ASTRAY[0] or _length(way[3:]) > ASTRAY[1]


class TwistFollower:
    """Follows twists with the tool of one arm."""

    def __init__(self, kinematics: Kinematics, limits: JointLimits, ticks: TickSolver, dt: float) -> None:
        """Take the arm, its limits, what linearises its ticks, and the control step [s]."""
        self._kinematics, self._limits, self._ticks, self._dt = kinematics, limits, ticks, dt
        turn = RADIAN_IN_METRES if kinematics.robot.dof >= 6 else TURNS_FREE
        self._weight = np.array([1.0, 1.0, 1.0, turn, turn, turn])

    def step(self, line: TwistLine, twist: Array, arm: JointState, wish: Array | None) -> TwistStep:
        """One tick from where the kinematics are, and the tick was linearised.

        Args:
            line: where twists have led so far.
            twist: (6,) what is asked for, at the tool in base axes [m/s, rad/s].
            arm: where it is.
            wish: (dof,) displacement [rad] that joints are to make as well, where it does not move the tool; or None.
        """
        limits, dt, v = self._limits, self._dt, arm.v
        low, high = self._ticks.bounds
        jacobian = self._kinematics.jacobian(self._kinematics.tool, IN_BASE).copy()
        tool = self._kinematics.pose(self._kinematics.tool)
        off = missing(line.pose, tool)
        solve = _Inverse(self._weight[:, None] * jacobian)
        wanted = self._weight * twist * dt
        late = _behind(self._weight * off, wanted) / self._weight
        off -= late  # to hurry more after the line would be faster than asked
        direction, pace = self._fastest(solve, wanted)
        before = solve(self._weight * line.twist * dt, EXACT)
        back = solve(self._weight * off, SETTLING)
        back *= SETTLED * min(1.0, float((limits.step / np.maximum(np.abs(back), TINY)).min()))
        change, start = pace.part * direction - before, before + back
        if wish is not None:
            start += self._aside(jacobian, wish, arm.q)
        planned = start + largest_share(start, change, low, high) * change
        # What joints cannot accelerate to would turn the tool aside: then all of them brake together.
        braking = v * dt * (1.0 - min(1.0, float((limits.change / np.maximum(np.abs(v * dt), TINY)).min())))
        share = largest_share(braking, planned - braking, low, high)
        displacement = np.minimum(np.maximum(braking + share * (planned - braking), low), high)
        followed = jacobian.dot(displacement - share * back) / dt
        return TwistStep(
            displacement,
            TwistLine(moved(line.pose, followed - late / dt, dt), followed),
            pace.part,
            pace.cause,
            wanted,
            solve.jacobian,
        )

    def _aside(self, jacobian: Array, wish: Array, q: Array) -> Array:
        """What of a wish (dof,) [rad] does not move the tool, nor lead to a limit or to what is near."""
        controlled = controlled_directions(jacobian)
        found = wish - controlled.T.dot(controlled.dot(wish))
        part = largest_share(np.zeros_like(found), found, *self._limits.stoppable(q))
        rows, ends = self._ticks.inequalities_towards(found)
        if rows is not None and ends is not None:
            closing = rows.dot(found)
            part = min(part, float((ends / np.maximum(closing, TINY)).min()))
        return np.asarray(part * found)

    def lag(self, step: TwistStep, v: Array) -> float:
        """What velocities (dof,) [rad/s] leave of the twist that was asked for, as a part of it."""
        left = _length(step.jacobian.dot(v) * self._dt - step.wanted)
        return left / max(_length(step.wanted), NOTHING * self._dt)

    def _fastest(self, solve: _Inverse, wanted: Array) -> tuple[Array, _Pace]:
        """The displacement (dof,) [rad] of a whole twist, and the largest part of it that keeps every limit.

        Where the joints cannot follow exactly, a little of the twist is given away, no more than needed.
        """
        exact = solve(wanted, EXACT)
        if not exact.any():
            return exact, _Pace(1.0, "")
        found = exact, self._pace(solve, wanted, exact, EXACT)
        if found[1].part >= 1.0:
            return found
        least, most = EXACT, solve.damping_for(wanted, ASIDE * _length(wanted))
        damping = most
        for _ in range(HALVINGS):
            direction = solve(wanted, damping)
            pace = self._pace(solve, wanted, direction, damping)
            if pace.part >= 1.0:
                found, most = (direction, pace), damping
            else:
                if pace.part > found[1].part:
                    found = direction, pace
                if damping >= most:  # even the most is not enough
                    break
                least = damping
            damping = math.sqrt(least * most)
        return found

    def _pace(self, solve: _Inverse, wanted: Array, direction: Array, damping: float) -> _Pace:
        """The largest part from 0 to 1 of a displacement (dof,) [rad] that keeps every limit, and what limits it."""
        limits = self._limits
        size = np.maximum(np.abs(direction), TINY)
        names, low, high = self._kinematics.robot.joint_names, *self._ticks.room
        speeds, free = limits.step / size, np.where(direction > 0.0, high, -low) / size
        fast, first = int(speeds.argmin()), int(free.argmin())
        # All joints brake together: none may have to brake harder than it can.
        braking = EASY * float((limits.change / size).min())
        stopping = 1.0 + 0.5 / braking  # parts, at least as many as it takes to stop after a whole one
        rows, ends = self._ticks.inequalities_towards(stopping * direction)
        end = "upper" if direction[first] > 0.0 else "lower"
        paces = [
            _Pace(float(speeds[fast]), f"{names[fast]} velocity"),
            _Pace(_stopping(float(free[first]), braking), f"{names[first]} {end} limit"),
        ]
        if rows is not None and ends is not None:
            closing = rows.dot(direction)
            coming = closing > 0.0
            if coming.any():
                paces.append(_Pace(_stopping(float((ends[coming] / closing[coming]).min()), braking), "what is near"))
        turn = self._weight[:, np.newaxis] * self._kinematics.jacobian_change(direction)
        bend = solve.bend(wanted, direction, turn, damping)
        turning = math.sqrt(BENDING * float((limits.change / np.maximum(np.abs(bend), TINY)).min()))
        if float(bend.dot(direction)) > 0.0:  # the joints get ever faster: towards a singular pose
            turning = min(turning, BENT * _length(direction) / max(_length(bend), TINY))
            turning = turning if turning > CREEPING else 0.0
        paces.append(_Pace(turning, SINGULAR_POSE))
        least = min(paces)
        return least if least.part < 1.0 else _Pace(1.0, "")


class _Pace(NamedTuple):
    """How much of a twist can be followed, and what limits it."""

    part: float
    cause: str


def _stopping(distance: float, braking: float) -> float:
    """Parts of a way in the coming tick after which it can still end in a distance, in such parts."""
    return braking_speed(max(distance, 0.0), braking, 1.0)


class _Inverse:
    """A damped inverse of a Jacobian (6, dof)."""

    def __init__(self, jacobian: Array) -> None:
        """Decompose it."""
        self.jacobian = jacobian
        self._left, self._values, self._right = np.linalg.svd(jacobian, full_matrices=False)
        self._squares = self._values**2

    def __call__(self, y: Array, damping: float) -> Array:
        """The x (dof,) that minimises |J x - y|^2 + damping |x|^2, for y (6,)."""
        return np.asarray((self._values / (self._squares + damping) * y.dot(self._left)).dot(self._right))

    def bend(self, y: Array, x: Array, turn: Array, damping: float) -> Array:
        """By how much the answer x (dof,) for y (6,) changes where the Jacobian changes by a `turn` (6, dof)."""
        left = y - self.jacobian.dot(x)
        parts = self._right.dot(left.dot(turn)) / (self._squares + damping)
        return np.asarray(self(-turn.dot(x), damping) + parts.dot(self._right))

    def damping_for(self, y: Array, residual: float) -> float:
        """The largest damping at which no more than a residual of y (6,), in its units, is left by damping alone."""
        parts = y.dot(self._left) ** 2
        least, most = math.log(EXACT), math.log(max(float(self._squares.max()), EXACT))
        for _ in range(20):
            middle = 0.5 * (least + most)
            damping = math.exp(middle)
            if float((parts * (damping / (self._squares + damping)) ** 2).sum()) <= residual * residual:
                least = middle
            else:
                most = middle
        return math.exp(least)


def _length(x: Array) -> float:
    """Of a vector."""
    return math.sqrt(x.dot(x))


def _behind(off: Array, wanted: Array) -> Array:
    """The part (6,) of what is missing to a line, weighted, along a twist that is wanted, that no tick makes up for."""
    size = max(_length(wanted), TINY)
    return np.asarray(max(float(off.dot(wanted)) / size - HURRY * size, 0.0) / size * wanted)
