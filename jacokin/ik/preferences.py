"""`prefer=`: what makes one configuration within the limits better than another."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from enum import Enum
from typing import NamedTuple, TypeAlias

import numpy as np

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, shown
from jacokin.model import angles, checks
from jacokin.model.angles import TURN
from jacokin.model.robot import Robot, limit_margins


class Copies(Enum):
    """Which 2 pi copies of limited joints may be the best, where there are several within the limits."""

    NEAREST = "nearest to the seed"
    MIDDLE = "farthest from the limits"
    ANY = "any: each is looked at, or where there are too many those around the seed"


class Cost(NamedTuple):
    """Costs of configurations within the limits; the least is best."""

    of: Callable[[Array], Array]
    """(m,) of rows (m, dof)."""
    copies: Copies
    """Copies of a row among which is the one of the least cost."""

    def __call__(self, rows: Array) -> Array:
        """The costs (m,) of rows (m, dof)."""
        return self.of(rows)


#: What `prefer=` takes, besides a callable.
PREFERENCES = ("nearest", "margin", "manipulability")

Prefer: TypeAlias = str | Callable[[Array], float]


def cost_of(prefer: Prefer, robot: Robot, frame: str) -> Cost | None:
    """The cost that a preference stands for; None for the distance to the seed.

    Args:
        prefer: a name, or a function of q (dof,).
        robot: the arm.
        frame: whose manipulability counts.

    Raises:
        UnknownNameError: an unknown name; lists the valid ones.
        InvalidInputError: neither a name nor callable.
    """
    if callable(prefer):
        return Cost(_by_function(prefer), Copies.ANY)
    if not isinstance(prefer, str):
        raise InvalidInputError(f"prefer must be one of {', '.join(PREFERENCES)}, or callable, got {shown(prefer)}")
    if checks.choice("prefer", prefer, PREFERENCES) == "margin":
        return by_margin(robot)
    if prefer == "manipulability":
        return Cost(lambda rows: -_manipulabilities(robot, rows, frame), Copies.NEAREST)
    return None


def _manipulabilities(robot: Robot, rows: Array, frame: str) -> Array:
    """Yoshikawa's measure (m,) of rows (m, dof), by determinants: to 1e-8 where it vanishes."""
    J = robot.jacobian(rows, frame)
    transposed = J.swapaxes(1, 2)
    squares = np.linalg.det(J @ transposed if robot.dof >= J.shape[1] else transposed @ J)
    return np.asarray(np.sqrt(np.maximum(squares, 0.0)))


def with_ties(cost: Cost | None, seed: Array) -> Cost:
    """A cost for members of curves: of equal ones the nearest to the seed is the best."""
    distance = by_distance(seed)
    if cost is None:
        return distance
    # Costs that differ by less than 1e-9 of the difference of squared distances to the seed [rad^2] count as equal:
    # the nearer one is taken.
    return Cost(lambda rows: cost(rows) + 1e-9 * distance(rows), cost.copies)


def copies_to_try(copies: Copies, q: Array, seed: Array, robot: Robot) -> Iterator[Array]:
    """Configurations within the limits, one of which is the best for a cost, (k, dof) each [rad].

    Along each of them, joints with more than a turn of room keep the number of turns by which they differ from q, but
    for those of the copies nearest to the seed and farthest from the limits. Rows outside the limits are NaN.

    Args:
        copies: of the cost.
        q: (k, dof) in any copies.
        seed: (dof,) joints without limits are in the copies nearest to it.
        robot: the arm.
    """
    lower, upper = robot.lower, robot.upper
    near = angles.into_limits(angles.nearest_copy(q, seed), lower, upper)
    wide = np.isfinite(upper - lower) & (upper - lower >= TURN)
    if copies is Copies.NEAREST or not wide.any() or not len(q):
        yield near
    elif copies is Copies.MIDDLE:
        centre = seed.copy()
        centre[wide] = 0.5 * (lower[wide] + upper[wide])
        middle = angles.into_limits(angles.nearest_copy(q, centre), lower, upper)
        room = np.minimum(middle - lower, upper - middle).min(axis=1, keepdims=True)
        # The joint that is nearest to a limit decides; others take the copy nearest to the seed that has as much room.
        yield np.where(wide, angles.into_limits(angles.nearest_copy(q, seed), lower + room, upper - room), middle)
    else:
        joints = np.flatnonzero(wide).tolist()
        counts = angles.copies_counted(lower, upper, wide)
        ranges = [_turns_around(seed[j], q[:, j], (lower[j], upper[j]), int(counts[j])) for j in joints]
        for turns in itertools.product(*ranges):
            rows = near.copy()
            rows[:, joints] = q[:, joints] + TURN * np.array(turns)
            rows[((rows < lower) | (rows > upper)).any(axis=1)] = np.nan
            yield rows


def _turns_around(seed: float, q: Array, limits: tuple[float, float], count: int) -> Sequence[int]:
    """Turns that bring some angles (k,) within limits; where one has more copies than so many, those around a seed."""
    low, high = math.ceil((limits[0] - q.max()) / TURN), math.floor((limits[1] - q.min()) / TURN)
    if count > (limits[1] - limits[0]) // TURN:  # all of them
        return range(low, high + 1)
    few = count + math.ceil(float(np.ptp(q)) / TURN)
    middle = round((seed - 0.5 * (q.min() + q.max())) / TURN)
    first = min(max(middle - few // 2, low), high - few)
    return range(first, first + few + 1)


def _by_function(function: Callable[[Array], float]) -> Callable[[Array], Array]:
    """The costs by a user's function, checked."""

    def costs(rows: Array) -> Array:
        return np.array([checks.number("the cost that prefer returns", function(q.copy())) for q in rows])

    return costs


def by_distance(seed: Array) -> Cost:
    """Square of the distance to a seed (dof,) [rad^2]; rows are in the copies nearest to it."""

    def squares(rows: Array) -> Array:
        apart = rows - seed
        return np.asarray(np.einsum("ij,ij->i", apart, apart))

    return Cost(squares, Copies.NEAREST)


def least_margins(robot: Robot, rows: Array) -> Array:
    """Distance (m,) of the joint of each row (m, dof) that is nearest to a limit [rad]; inf for an arm without any."""
    return np.asarray(limit_margins(robot, rows).min(axis=1))


def by_margin(robot: Robot) -> Cost:
    """Minus the least margin [rad]; 0 for an arm without limits, whose configurations are all as good."""
    if robot.unlimited.all():
        return Cost(lambda rows: np.zeros(len(rows)), Copies.MIDDLE)
    return Cost(lambda rows: -least_margins(robot, rows), Copies.MIDDLE)
