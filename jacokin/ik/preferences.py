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
#: Steps towards a minimum at most.
STEPS = 60
#: Share of a chord at which a minimum is found: rounding allows no more.
ACCURACY = 1e-9
GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)


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


def least(cost: Cost, coordinates: Array, rows: Array, exact: Callable[[float], Array]) -> float:
    """The coordinate of the least cost along a track.

    Args:
        cost: of rows.
        coordinates: (m,) in order.
        rows: (m, dof) configurations there, roughly.
        exact: the configuration (dof,) at a coordinate.
    """
    ends = [refined(cost, coordinates, end, exact) for end in minima(cost(rows))[:MINIMA]]
    return min(ends, key=lambda end: end[0])[1]


def minima(values: Array) -> NDArray[np.int64]:
    """Indices of the local minima, best first, ends included."""
    padded = np.concatenate([[np.inf], values, [np.inf]])
    local = np.flatnonzero((values <= padded[:-2]) & (values <= padded[2:]))
    return local[np.argsort(values[local], kind="stable")]


def refined(cost: Cost, coordinates: Array, index: int, exact: Callable[[float], Array]) -> tuple[float, float]:
    """The least cost between the neighbours of a guess, and its coordinate."""

    def at(coordinate: float) -> float:
        return float(cost(exact(coordinate)[np.newaxis])[0])

    low, high = coordinates[[max(index - 1, 0), min(index + 1, len(coordinates) - 1)]].tolist()
    middle = float(coordinates[index])
    known = (at(middle), middle)
    found = (
        brent(at, low, known[1], high, known[0]) if low < middle < high else brent(at, low, 0.5 * (low + high), high)
    )
    return min(known, found)


def brent(
    at: Callable[[float], float], low: float, x: float, high: float, fx: float | None = None
) -> tuple[float, float]:
    """The minimum of a function between low and high, and where it is.

    Parabolas through the three best points, golden section where they fail (Brent, 1973, chapter 5).
    """
    w = v = x
    fx = at(x) if fx is None else fx
    fw = fv = fx
    step = before = high - low
    for _ in range(STEPS):
        middle, tolerance = 0.5 * (low + high), ACCURACY * (1.0 + abs(x))
        if abs(x - middle) <= 2.0 * tolerance - 0.5 * (high - low):
            break
        r, q = (x - w) * (fx - fv), (x - v) * (fx - fw)
        p = (x - v) * q - (x - w) * r
        q = 2.0 * (q - r)
        p, q = (-p, q) if q > 0.0 else (p, -q)
        if abs(p) < abs(0.5 * q * before) and q * (low - x) < p < q * (high - x):
            before, step = step, p / q
        else:
            before = (high if x < middle else low) - x
            step = (1.0 - GOLDEN) * before
        u = x + (step if abs(step) >= tolerance else math.copysign(tolerance, step))
        fu = at(u)
        if fu <= fx:
            low, high = (x, high) if u >= x else (low, x)
            v, fv, w, fw, x, fx = w, fw, x, fx, u, fu
        else:
            low, high = (u, high) if u < x else (low, u)
            if fu <= fw or w == x:
                v, fv, w, fw = w, fw, u, fu
            elif fu <= fv or v in (x, w):
                v, fv = u, fu
    return fx, x
