"""The 2 pi copy of each joint angle: nearest to the seed, within the limits if possible, and its margin to them."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

TURN = 2.0 * math.pi


def nearest_copy(angle: float, seed: float) -> float:
    """The copy of an angle nearest to the seed [rad]."""
    return angle + TURN * math.floor((seed - angle) / TURN + 0.5)


def copy_within_limits(angle: float, seed: float, lower: float, upper: float, snap: float) -> float:
    """The copy within [lower, upper] nearest to the seed; without one, the copy that breaks a limit least.

    Past a limit by at most ``snap`` [rad] is put on the limit.
    """
    q = nearest_copy(angle, seed)
    if q < lower - snap:
        q += TURN * math.ceil((lower - snap - q) / TURN)
    elif q > upper + snap:
        q -= TURN * math.ceil((q - upper - snap) / TURN)
    if q > upper + snap:
        if abs(lower - (q - TURN)) < q - upper:
            q -= TURN
    elif q < lower - snap and abs(q + TURN - upper) < lower - q:
        q += TURN
    if lower - snap <= q < lower:
        return lower
    if upper < q <= upper + snap:
        return upper
    return q


def fit_to_limits(
    q: NDArray[np.float64], seed: NDArray[np.float64], limits: NDArray[np.float64], row: NDArray[np.float64]
) -> tuple[float, bool]:
    """Fill row[0:6] with the copies of q and row[6:12] with their distance to the nearer limit.

    Args:
        q: (6,) any copy of each angle [rad].
        seed: (6,) the seed.
        limits: (3, 6) lower limits, upper limits, and the snap distance in each joint [rad].
        row: (12,) or longer, filled; distances are negative outside and inf for unlimited joints.

    Returns:
        Distance to the seed [rad], and whether every joint is within its limits, exactly.
    """
    total, within = 0.0, True
    for j in range(6):
        lower, upper = limits[0, j], limits[1, j]
        angle = copy_within_limits(q[j], seed[j], lower, upper, limits[2, j])
        margin = min(angle - lower, upper - angle)
        row[j] = angle
        row[6 + j] = margin
        within = within and lower <= angle <= upper
        difference = angle - seed[j]
        total += difference * difference
    return math.sqrt(total), within


def circular_distance(difference: float) -> float:
    """The size of a difference of angles, whole turns apart [rad]."""
    return abs(difference - TURN * math.floor(difference / TURN + 0.5))


def same_configuration(a: NDArray[np.float64], b: NDArray[np.float64], tolerance: float) -> bool:
    """Whether two configurations agree in every joint up to full turns [rad]."""
    for j in range(6):
        difference = a[j] - b[j]
        if circular_distance(difference) > tolerance:
            return False
    return True
