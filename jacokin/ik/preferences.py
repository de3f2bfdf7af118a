"""`prefer=`: what makes one configuration within the limits better than another."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, shown
from jacokin.model import checks
from jacokin.model.robot import Robot

#: Costs (m,) of configurations (m, dof) within the limits; the least is best.
Cost: TypeAlias = Callable[[Array], Array]

#: What `prefer=` takes, besides a callable.
PREFERENCES = ("nearest", "margin", "manipulability")
#: Members of a family whose costs differ by less than this times the difference of their squared distances to the seed
#: [rad^2] count as equal: the nearer one is taken.
TIE = 1e-9

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
        return _by_function(prefer)
    if not isinstance(prefer, str):
        raise InvalidInputError(f"prefer must be one of {', '.join(PREFERENCES)}, or callable, got {shown(prefer)}")
    if checks.choice("prefer", prefer, PREFERENCES) == "margin":
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
    """Square of the distance to a seed (dof,) [rad^2]; rows are in the copies nearest to it."""

    def squares(rows: Array) -> Array:
        apart = rows - seed
        return np.asarray(np.einsum("ij,ij->i", apart, apart))

    return squares


def by_margin(robot: Robot) -> Cost:
    """Minus the distance of the joint that is nearest to a limit [rad]; -inf for an arm without limits."""
    lower, upper = robot.lower, robot.upper
    return lambda rows: -np.minimum(rows - lower, upper - rows).min(axis=1)
