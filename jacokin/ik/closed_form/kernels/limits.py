"""Which 2 pi copy of each joint, whether it is legal, and how far from the limits."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

TURN = 2.0 * math.pi


def nearest_copy(angle: float, reference: float) -> float:
    """The copy of an angle nearest to a reference [rad]."""
    return angle + TURN * math.floor((reference - angle) / TURN + 0.5)


def legal_copy(angle: float, reference: float, lower: float, upper: float, snap: float) -> float:
    """The copy within [lower, upper] nearest to the reference; without one, the copy that breaks a limit least.

    Past a limit by at most ``snap`` [rad] is put on the limit.
    """
    q = nearest_copy(angle, reference)
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
    q: NDArray[np.float64], reference: NDArray[np.float64], limits: NDArray[np.float64], row: NDArray[np.float64]
) -> tuple[float, bool]:
    """Fill row[0:6] with the copies of q and row[6:12] with their distance to the nearer limit.

    Args:
        q: (6,) any copy of each angle [rad].
        reference: (6,) the seed.
        limits: (3, 6) lower limits, upper limits, and the snap distance in each joint [rad].
        row: (12,) or longer, filled; distances are negative outside and inf for free joints.

    Returns:
        Distance to the reference [rad], and whether every joint is within its limits, exactly.
    """
    total, legal = 0.0, True
    for j in range(6):
        lower, upper = limits[0, j], limits[1, j]
        angle = legal_copy(q[j], reference[j], lower, upper, limits[2, j])
        margin = min(angle - lower, upper - angle)
        row[j] = angle
        row[6 + j] = margin
        legal = legal and lower <= angle <= upper
        difference = angle - reference[j]
        total += difference * difference
    return math.sqrt(total), legal


def on_circle(difference: float) -> float:
    """The size of a difference of angles, whole turns apart [rad]."""
    return abs(difference - TURN * math.floor(difference / TURN + 0.5))


def same_on_circle(a: NDArray[np.float64], b: NDArray[np.float64], tolerance: float) -> bool:
    """Whether two configurations agree in every joint up to full turns [rad]."""
    for j in range(6):
        difference = a[j] - b[j]
        if on_circle(difference) > tolerance:
            return False
    return True
