"""What is missing to the targets of one tick: their error to second order where the arm is, and its QP."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg.lapack import dgesv, dsyevd  # half the time of NumPy's, on six numbers

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.ik.qp_backend import Backend, Inequalities, QPFailed
from jacokin.model import angles, checks
from jacokin.model.robot import Robot
from jacokin.motion.tracking.avoidance import ClearanceGuard, Distances
from jacokin.motion.tracking.joint_limits import TINY, JointLimits
from jacokin.motion.tracking.moving import Whereabouts
from jacokin.motion.tracking.targets import FrameTask, Kinematics

TIKHONOV = 1e-10  # keeps the QP strictly convex at singular poses
DAMPING = 0.1  # [m/rad^2] relative to the error that can be removed; less lets the joints swing near singular poses
NULL_SPEED = 0.25  # part of the velocity limits that null-space motion may use; its curvature costs microns a tick
LATER_SPEED = 0.5  # the same of targets of later priorities
CLOSE = 0.01  # [m] an error below which damping vanishes with its square: so moving targets are followed to microns
LEAVING = 10.0  # damping relative to the square of what is missing to the distance, weighted: the arm leaves straight
ROUNDED = 1e-6  # of a squared error: less is not told from rounding and the damping that keeps the Hessian regular
LITTLE = 1e-4  # of an error out of reach, by which it is not worth while to move on
FAR = 1e6  # [rad] no bound for a joint without limits
NONE_APART = np.empty(0, dtype=np.intp)
RANK = 1e-3  # directions whose singular value is below this part of the largest are left to the null space


class Objective(Protocol):
    """Anything that names a joint velocity it would like."""

    def velocity(self, robot: Robot, frame: str, q: Array) -> Array:
        """Joint velocity (dof,) [rad/s] wanted at `q` (dof,) [rad]."""


class _Rated:
    """What the objectives share."""

    __slots__ = ()

    rate: float

    def __post_init__(self) -> None:
        """Check the rate; the tracker checks the configuration of a posture, as it knows the robot."""
        object.__setattr__(self, "rate", checks.positive("rate", self.rate, "1/s"))


@dataclass(frozen=True, slots=True, eq=False)
class Posture(_Rated):
    """Stay near a configuration.

    Attributes:
        q: (dof,) the configuration [rad]; unlimited joints take the short way round.
        rate: how fast the distance shrinks [1/s].
    """

    q: ArrayLike
    rate: float = 2.0

    def velocity(self, robot: Robot, frame: str, q: Array) -> Array:
        """Towards the posture."""
        away = np.asarray(self.q, dtype=np.float64) - q
        return self.rate * np.where(robot.unlimited, angles.wrap_to_pi(away), away)


@dataclass(frozen=True, slots=True)
class Manipulability(_Rated):
    """Keep away from singular poses: climb Yoshikawa's measure of the tracker's frame.

    Attributes:
        rate: joint velocity for each unit of the measure's relative gradient [rad^2/s].
    """

    rate: float = 0.2

    def velocity(self, robot: Robot, frame: str, q: Array) -> Array:
        """Gradient of log sqrt(det(J J^T)): trace(J^+ dJ/dq_k), damped where J is singular."""
        jacobian = robot.jacobian(q, frame)
        change = robot.jacobian_derivative(q, frame)
        damped = jacobian @ jacobian.T + 1e-6 * np.eye(6)  # finite at singular poses
        return np.asarray(self.rate * np.einsum("ij,ijk->k", np.linalg.solve(damped, jacobian), change))


@dataclass(frozen=True, slots=True)
class LimitDistance(_Rated):
    """Keep joints away from their limits, towards the middle of the range; unlimited joints have none.

    Attributes:
        rate: how fast the distance to the middle shrinks [1/s].
    """

    rate: float = 1.0

    def velocity(self, robot: Robot, frame: str, q: Array) -> Array:
        """Towards the middle, growing with the cube of the relative distance from it."""
        both = np.isfinite(robot.lower) & np.isfinite(robot.upper)
        half = np.where(both, 0.5 * (robot.upper - robot.lower), 1.0)
        middle = np.where(both, robot.lower + half, q)
        relative = (q - middle) / np.where(half > 0.0, half, 1.0)  # limits may coincide
        return np.asarray(-self.rate * half * relative**3)


def checked_objectives(
    robot: Robot, objectives: Sequence[Objective], posture: ArrayLike | None
) -> tuple[Objective, ...]:
    """The objectives of a tracker, the posture first; errors as in `Tracker`."""
    found: tuple[Objective, ...] = checks.listed("objectives", objectives)
    if posture is not None:
        found = (Posture(posture), *found)
    for objective in found:
        if isinstance(objective, Posture):
            robot.configuration(objective.q, "posture")
        elif not callable(getattr(objective, "velocity", None)):
            raise InvalidInputError(f"objectives must have a velocity() method, got {type(objective).__name__}")
    return found


@dataclass(frozen=True, slots=True)
class TickProblem:
    """What the arm is to minimise, to second order in a displacement x (dof,) [rad] of the joints: g x + x H x / 2.

    The Hessian is that of least squares of the linearised error and, where a part of the error cannot be removed, of
    how the Jacobian turns against that part; it is made positive definite. So the minimiser moves smoothly with the arm
    also where the target is out of reach: there least squares alone jump from one side of a singular pose to the other
    at every tick.

    Attributes:
        jacobian: (k, dof) weighted Jacobian of the tasks that come first.
        error: (k,) their weighted error.
        cost: its square.
        gradient: (dof,) of half of it and of what moves shapes apart.
        directions: (dof, dof) columns, orthonormal: the Hessian's principal directions.
        bends: (dof,) how much the Hessian bends in them, > 0.
        damping: how much of that is damping.
        inequalities: G and h of G x <= h, or (None, None).
        apart: numbers of the pairs of shapes that are too near, or about to be, and are being moved apart.
        exits: see `Distances`.
    """

    jacobian: Array
    error: Array
    cost: float
    gradient: Array
    directions: Array
    bends: Array
    damping: float
    inequalities: Inequalities
    apart: NDArray[np.intp]
    exits: Mapping[int, Array]

    @property
    def hessian(self) -> Array:
        """(dof, dof), positive definite."""
        return np.asarray((self.directions * self.bends).dot(self.directions.T))

    @property
    def root(self) -> Array:
        """(dof, dof) rows whose squares sum up to the Hessian, without damping."""
        return np.sqrt(np.maximum(self.bends - self.damping, 0.0))[:, np.newaxis] * self.directions.T

    def minimise(self, room: tuple[Array, Array], qp: Backend) -> Array:
        """The displacement (dof,) [rad] that is missing to the least error within `room`, least and largest (dof,).

        Raises:
            QPFailed: no QP solver solved it.
        """
        free, (low, high) = self._divide(-self.gradient), room
        rows, ends = self.inequalities
        if (free >= low).all() and (free <= high).all() and (rows is None or (rows.dot(free) <= ends).all()):
            return free
        low, high = np.maximum(low, -FAR), np.minimum(high, FAR)
        return qp.minimize(self.hessian, self.gradient, self.inequalities, low, high)

    def follow(self, moved: Array) -> Array:
        """The displacement (dof,) [rad] that follows a target which moves the error by `moved` (k,)."""
        return self._divide(moved.dot(self.jacobian))

    def _divide(self, slopes: Array) -> Array:
        """The x (dof,) with H x = slopes (dof,)."""
        return np.asarray(self.directions.dot(slopes.dot(self.directions) / self.bends))


def build_problem(
    kinematics: Kinematics,
    tasks: list[FrameTask],
    q: Array,
    guard: ClearanceGuard | None,
    distances: Distances | None,
    where: Whereabouts | None,
    negligible: float,
) -> TickProblem:
    """The problem at `q` (dof,) [rad], where the kinematics are, of tasks of one priority and the obstacles.

    What is left of an error is not made smaller by less than `negligible` [m] and a small part of it.
    """
    jacobian, error = linearise(kinematics, tasks)
    inequalities = [found for task in tasks if (found := task.inequalities(kinematics)) is not None]
    cost = float(error.dot(error))
    gradient, hessian = -error.dot(jacobian), jacobian.T.dot(jacobian)
    hessian += _bend(kinematics, tasks, _left(jacobian, error, gradient, hessian, damping_for(cost)))
    apart = NONE_APART
    exits: Mapping[int, Array] = {}
    if guard is not None and distances is not None and where is not None and distances.near.size:
        separation = guard.linearise(q, distances, where)
        inequalities.append(separation.inequalities)
        exits, apart = separation.exits, separation.pairs
        if apart.size:
            hessian += separation.jacobian.T @ separation.jacobian
            hessian.flat[:: len(q) + 1] += LEAVING * float(separation.error.max(initial=0.0)) ** 2
            gradient = gradient - separation.error @ separation.jacobian
    stacked: Inequalities = (None, None)
    if len(inequalities) == 1:
        stacked = inequalities[0]
    elif inequalities:
        stacked = np.vstack([G for G, _ in inequalities]), np.concatenate([h for _, h in inequalities])
    bends, directions, _ = dsyevd(hessian)
    bends = np.abs(bends) + TIKHONOV
    # Damping goes with what there is to gain: it vanishes at the least error, on target or out of reach. Where error is
    # left there, directions in which next to nothing is to be gained are left alone: the arm comes to rest.
    slopes = gradient.dot(directions)
    gains = slopes * slopes / bends
    gain = min(cost, float(gains.sum()))
    left = math.sqrt(max(cost - gain - ROUNDED * cost, 0.0))
    if left > 0.0:
        slopes *= np.maximum(1.0 - 2.0 * left * (negligible + LITTLE * left) / np.maximum(gains, TINY), 0.0)
        gradient = directions.dot(slopes)
    damping = damping_for(gain)
    return TickProblem(
        jacobian=jacobian,
        error=error,
        cost=cost,
        gradient=gradient,
        directions=directions,
        bends=bends + damping,
        damping=TIKHONOV + damping,
        inequalities=stacked,
        apart=apart,
        exits=exits,
    )


def damping_for(gain: float) -> float:
    """Of the Hessian [m^2/rad^2], where so much [m^2] of the squared error can be removed."""
    return DAMPING * gain / (math.sqrt(gain) + CLOSE)


def _left(jacobian: Array, error: Array, gradient: Array, hessian: Array, damping: float) -> Array:
    """The part (k,) of an error (k,) that damped least squares do not remove."""
    damped = hessian.copy()
    damped.flat[:: len(damped) + 1] += TIKHONOV + damping
    return np.asarray(error + jacobian.dot(dgesv(damped, gradient)[2]))


def _bend(kinematics: Kinematics, tasks: list[FrameTask], left: Array) -> Array:
    """(dof, dof) of all tasks against what is left (k,) of their errors."""
    if len(tasks) == 1:
        return tasks[0].bend(kinematics, left)
    total, start = np.zeros(()), 0
    for task in tasks:
        size = len(task.error(kinematics))
        total = total + task.bend(kinematics, left[start : start + size])
        start += size
    return total


def linearise(kinematics: Kinematics, tasks: list[FrameTask]) -> tuple[Array, Array]:
    """Weighted Jacobian (k, dof) and error (k,) of several tasks."""
    # `dot` instead of @ in all that follows: on six numbers it costs half.
    if len(tasks) == 1:
        return tasks[0].linearise(kinematics)
    parts = [task.linearise(kinematics) for task in tasks]
    return np.vstack([J for J, _ in parts]), np.concatenate([e for _, e in parts])


def by_priority(tasks: list[FrameTask]) -> list[list[FrameTask]]:
    """Tasks of the same priority together, the first ones first."""
    numbers = sorted({task.priority for task in tasks})
    return [[task for task in tasks if task.priority == number] for number in numbers]


def controlled_directions(jacobian: Array) -> Array:
    """(r, dof) orthonormal directions in which joints move what a Jacobian (k, dof) is of."""
    _, singular, right = np.linalg.svd(jacobian)
    return np.asarray(right[: singular.size][singular > RANK * max(float(singular[0]), np.finfo(float).tiny)])


class Level(NamedTuple):
    """Targets of a later priority, linearised."""

    jacobian: Array
    """(k, dof) weighted."""
    error: Array
    """(k,) weighted."""
    ends_there: bool = True
    """Whether the arm is to stop where nothing is missing; False for a wish that is for one tick."""


def refine(
    displacement: Array,
    problem: TickProblem,
    levels: Sequence[Level],
    room: tuple[Array, Array],
    limits: JointLimits,
    qp: Backend,
) -> Array:
    """Add what later priorities want to a displacement (dof,) [rad], as far as earlier ones are not moved by it.

    Each level is least squares in a basis of the null space of all levels before it, within the same limits. Of what it
    is missing the arm goes as much as it can still stop on. A level whose QP fails is left out.

    Args:
        displacement: of the first level, in this tick.
        problem: that level.
        levels: the later ones.
        room: least and largest displacement (dof,) to the limits [rad].
        limits: of the joints; later levels use a part of their velocities, and can stop where they lead.
        qp: solves.
    """
    low, high = np.maximum(room[0], -FAR), np.minimum(room[1], FAR)
    above = problem.root
    rows, ends = problem.inequalities
    for jacobian, error, ends_there in levels:
        controlled = controlled_directions(above)
        if len(controlled) == len(displacement):
            break
        basis = np.linalg.svd(controlled)[2][len(controlled) :].T
        above = np.vstack([above, jacobian])
        reduced, missing = jacobian @ basis, error - jacobian @ displacement
        hessian = reduced.T @ reduced
        hessian.flat[:: len(hessian) + 1] += TIKHONOV + damping_for(float(missing @ missing))
        G = np.vstack([basis, -basis] if rows is None else [basis, -basis, rows @ basis])
        h = [high - displacement, displacement - low]
        if rows is not None and ends is not None:
            h.append(ends - rows @ displacement)
        free = np.full(basis.shape[1], FAR)
        try:
            total = basis @ qp.minimize(hessian, -reduced.T @ missing, (G, np.concatenate(h)), -free, free)
        except QPFailed:
            continue
        extra = limits.stride(total, np.zeros_like(total)) if ends_there else total
        fast = float((np.abs(extra) / limits.step).max())
        displacement = displacement + min(1.0, LATER_SPEED / max(fast, TINY)) * extra
    return displacement


def wished(robot: Robot, frame: str, q: Array, objectives: Sequence[Objective], step_limit: Array, dt: float) -> Array:
    """The displacement (dof,) [rad] that the objectives want in a tick.

    Raises:
        InvalidInputError: an objective returns something else than a joint velocity.
    """
    displacement = np.zeros(robot.dof)
    for objective in objectives:
        name = f"{type(objective).__name__}.velocity()"
        displacement += checks.vector(name, objective.velocity(robot, frame, q), robot.dof, "rad/s") * dt
    part = float(np.max(np.abs(displacement) / step_limit))
    if part > NULL_SPEED:
        displacement *= NULL_SPEED / part
    return displacement
