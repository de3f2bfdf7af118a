"""`prefer=`: what makes one configuration within the limits better than another; and the best one along a track."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, shown
from jacokin.model import checks
from jacokin.model.robot import Robot

#: Costs (m,) of configurations (m, dof) within the limits; the least is best.
Cost: TypeAlias = Callable[[Array], Array]

#: Local minima among the guesses that are looked at exactly.
MINIMA = 3
#: Steps of golden-section search: the last bracket is 1e-8 of the first.
STEPS = 40
GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)


#: What `prefer=` takes, besides a callable.
PREFERENCES = ("nearest", "margin", "manipulability")
#: Members of a family whose costs differ by less than this times the difference of their distances to the seed [rad]
#: count as equal: the nearer one is taken.
TIE = 1e-9

Prefer: TypeAlias = str | Callable[[Array], float]


def checked(prefer: object) -> Prefer:
    """A preference.

    Raises:
        UnknownNameError: an unknown name; lists the valid ones.
        InvalidInputError: neither a name nor callable.
    """
    if callable(prefer):
        return prefer
    if not isinstance(prefer, str):
        raise InvalidInputError(f"prefer must be one of {', '.join(PREFERENCES)}, or callable, got {shown(prefer)}")
    return checks.choice("prefer", prefer, PREFERENCES)


def cost_of(prefer: Prefer, robot: Robot, frame: str) -> Cost | None:
    """The cost that a preference stands for; None for the distance to the seed.

    Args:
        prefer: what `checked` returned.
        robot: the arm.
        frame: whose manipulability counts.
    """
    if callable(prefer):
        return _by_function(prefer)
    if prefer == "margin":
        return by_margin(robot)
    if prefer == "manipulability":
        return lambda rows: np.array([-robot.manipulability(q, frame) for q in rows])
    return None


def with_ties(cost: Cost | None, seed: Array) -> Cost:
    """A cost for members of a family: of equal ones the nearest to the seed is the best."""
    distance = by_distance(seed)
    if cost is None:
        return distance
    return lambda rows: cost(rows) + TIE * distance(rows)


def _by_function(function: Callable[[Array], float]) -> Cost:
    """The costs by a user's function, checked."""

    def costs(rows: Array) -> Array:
        return np.array([checks.number("the cost that prefer returns", function(q.copy())) for q in rows])

    return costs


def by_distance(seed: Array) -> Cost:
    """Euclidean distance to a seed (dof,) [rad]; rows are in the copies nearest to it."""
    return lambda rows: np.asarray(np.linalg.norm(rows - seed, axis=1))


def by_margin(robot: Robot) -> Cost:
    """Minus the distance of the joint that is nearest to a limit [rad]; -inf for an arm without limits."""
    lower, upper = robot.lower, robot.upper
    return lambda rows: -np.minimum(rows - lower, upper - rows).min(axis=1)


def least(cost: Cost, coordinates: Array, rows: Array, exact: Callable[[float], Array]) -> float:
    """The coordinate of the least cost along a track.

    Args:
        cost: of rows.
        coordinates: (m,) in order.
        rows: (m, dof) configurations there, roughly.
        exact: the configuration (dof,) at a coordinate.
    """
    values = cost(rows)

    def at(coordinate: float) -> float:
        return float(cost(exact(coordinate)[np.newaxis])[0])

    best, best_value = float(coordinates[0]), at(float(coordinates[0]))
    for end in _minima(values):
        low, high = float(coordinates[max(end - 1, 0)]), float(coordinates[min(end + 1, len(coordinates) - 1)])
        for coordinate in (_golden(at, low, high), float(coordinates[end])):
            value = at(coordinate)
            if value < best_value:
                best, best_value = coordinate, value
    return best


def _minima(values: Array) -> NDArray[np.int64]:
    """Indices of the local minima, best first, ends included."""
    padded = np.concatenate([[np.inf], values, [np.inf]])
    local = np.flatnonzero((values <= padded[:-2]) & (values <= padded[2:]))
    return local[np.argsort(values[local], kind="stable")][:MINIMA]


def _golden(at: Callable[[float], float], low: float, high: float) -> float:
    """The minimum between low and high by golden-section search."""
    a, b = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
    at_a, at_b = at(a), at(b)
    for _ in range(STEPS):
        if at_a <= at_b:
            high, b, at_b = b, a, at_a
            a = high - GOLDEN * (high - low)
            at_a = at(a)
        else:
            low, a, at_a = a, b, at_b
            b = low + GOLDEN * (high - low)
            at_b = at(b)
    return 0.5 * (low + high)
