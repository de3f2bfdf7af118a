"""What a tick is to do beside its first targets: later priorities and objectives, with the freedom that these leave."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike

from jacokin.arrays import Array, Sealed
from jacokin.errors import InvalidInputError
from jacokin.ik.qp_backend import Backend, QPFailed
from jacokin.kernels.tracking.limits import TINY
from jacokin.kernels.tracking.problem import TIKHONOV, damping_for
from jacokin.model import angles, checks
from jacokin.model.robot import Robot
from jacokin.motion.tracking.joint_limits import JointLimits
from jacokin.motion.tracking.ticks import FAR, TickSolver

NULL_SPEED = 0.25  # part of the velocity limits that null-space motion may use; its curvature costs microns a tick
LATER_SPEED = 0.5  # the same of targets of later priorities
RANK = 1e-3  # directions whose singular value is below this part of the largest are left to the null space
PARTLY = 4.0  # times that, and down to its inverse, they are so in part: whole ones would come and go from tick to tick


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
class Posture(_Rated, Sealed):
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


def free_directions(jacobian: Array) -> Array:
    """(dof, k) directions in which joints hardly move what a Jacobian (n, dof) is of, shorter where they do in part."""
    _, singular, right = np.linalg.svd(jacobian)
    sizes = np.zeros(len(right))
    sizes[: singular.size] = singular / (RANK * max(float(singular[0]), TINY))
    share = np.clip(0.5 - 0.5 * np.log(np.maximum(sizes, TINY)) / math.log(PARTLY), 0.0, 1.0)
    share = share * share * (3.0 - 2.0 * share)
    return np.asarray((share[:, np.newaxis] * right)[share > 0.0].T)


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
    ticks: TickSolver,
    levels: Sequence[Level],
    limits: JointLimits,
    qp: Backend,
) -> Array:
    """Add what later priorities want to a displacement (dof,) [rad], as far as earlier ones are not moved by it.

    Each level is least squares in directions that are free of all levels before it, within the same limits. Of what it
    is missing the arm goes as much as it can still stop on. A level whose QP fails is left out.

    Args:
        displacement: of the first level, in this tick.
        ticks: solved that level.
        levels: the later ones.
        limits: of the joints; later levels use a part of their velocities, and can stop where they lead.
        qp: solves.
    """
    bends, directions = np.linalg.eigh(ticks.hessian)
    # Rows whose squares sum up to the Hessian, without damping.
    above = np.sqrt(np.maximum(bends - ticks.damping, 0.0))[:, np.newaxis] * directions.T
    for jacobian, error, ends_there in levels:
        basis = free_directions(above)
        if not basis.size:
            break
        above = np.vstack([above, jacobian])
        reduced, missing = jacobian @ basis, error - jacobian @ displacement
        hessian = reduced.T @ reduced
        hessian.flat[:: len(hessian) + 1] += TIKHONOV + damping_for(float(missing @ missing))
        try:
            total = _within_limits(hessian, -reduced.T @ missing, basis, displacement, ticks, qp)
        except QPFailed:
            continue
        extra = limits.stride(total) if ends_there else total
        fast = float((np.abs(extra) / limits.step).max())
        displacement = displacement + min(1.0, LATER_SPEED / max(fast, TINY)) * extra
    return displacement


def _within_limits(
    hessian: Array, gradient: Array, basis: Array, displacement: Array, ticks: TickSolver, qp: Backend
) -> Array:
    """The least of a QP in a basis (dof, k), with a displacement within joint limits and distances, both (dof,) [rad].

    Raises:
        QPFailed: no QP solver solved it.
    """
    low, high = np.maximum(ticks.room[0], -FAR), np.minimum(ticks.room[1], FAR)
    free = np.full(basis.shape[1], FAR)
    rows, ends = ticks.inequalities
    while True:
        G, h = [basis, -basis], [high - displacement, displacement - low]
        if rows is not None and ends is not None:
            G.append(rows @ basis)
            h.append(ends - rows @ displacement)
        total = np.asarray(basis @ qp.minimize(hessian, gradient, (np.vstack(G), np.concatenate(h)), -free, free))
        known, (rows, ends) = 0 if ends is None else len(ends), ticks.inequalities_towards(displacement + total)
        if ends is None or len(ends) == known:
            return total


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
