"""Points of a curve between two neighbouring nodes: guessed by Hermite interpolation, made exact by Newton."""

from __future__ import annotations

import math

from jacokin.arrays import Array
from jacokin.ik.closed_form.curves.chain7 import bordered_newton
from jacokin.ik.closed_form.curves.follow import WORST_CLOSURE, Walk

#: [m] and [rad]; points between nodes are what users get: as exact as rounding allows.
POINT_CLOSURE = 1e-14
#: [rad] how far p may be off.
PARAMETER_ACCURACY = 1e-14
BISECTIONS = 60


def chord_length(a: Array, b: Array) -> float:
    """Distance between two nodes in joint space [rad]."""
    square = 0.0
    for j in range(7):
        square += (b[j] - a[j]) * (b[j] - a[j])
    return math.sqrt(square)


def share_of(a: Array, b: Array, x: Array) -> float:
    """The share of the chord between two nodes (14,) that a point (7,) between them lies across."""
    along, square = 0.0, 0.0
    for j in range(7):
        along += (x[j] - a[j]) * (b[j] - a[j])
        square += (b[j] - a[j]) * (b[j] - a[j])
    return along / square if square > 0.0 else 0.0


def between(chain: Array, T: Array, a: Array, b: Array, share: float, x: Array, walk: Walk) -> bool:
    """Fill x with the curve's point across the chord between two nodes (14,) at a share of it; False if not found."""
    length = chord_length(a, b)
    if length == 0.0:
        for j in range(7):
            x[j] = a[j]
        return True
    u = share
    v = 1.0 - u
    offset = 0.0
    for j in range(7):
        walk.border[j] = (b[j] - a[j]) / length
        x[j] = (
            (1.0 + 2.0 * u) * v * v * a[j]
            + u * v * v * length * a[7 + j]
            + u * u * (3.0 - 2.0 * u) * b[j]
            - u * u * v * length * b[7 + j]
        )
        offset += walk.border[j] * (a[j] + u * (b[j] - a[j]))
    return bordered_newton(chain, T, x, walk.border, offset, walk.system, 8, POINT_CLOSURE) <= WORST_CLOSURE


def where_joint_is(chain: Array, T: Array, a: Array, b: Array, j: int, value: float, x: Array, walk: Walk) -> float:
    """Fill x with the point between two nodes where joint j has a value that lies between theirs; its share, or -1."""
    low, f_low, high, f_high = 0.0, a[j] - value, 1.0, b[j] - value
    if f_low == 0.0 or f_high == 0.0:
        share = 0.0 if f_low == 0.0 else 1.0
        return share if between(chain, T, a, b, share, x, walk) else -1.0
    for _ in range(BISECTIONS):
        share = high - f_high * (high - low) / (f_high - f_low) if f_high != f_low else 0.5 * (low + high)
        if not min(low, high) <= share <= max(low, high):
            share = 0.5 * (low + high)
        if not between(chain, T, a, b, share, x, walk):
            return -1.0
        f = x[j] - value
        if abs(f) <= PARAMETER_ACCURACY or abs(high - low) < 1e-15:
            return share
        if f * f_high < 0.0:
            low, f_low = high, f_high
        else:
            f_low *= 0.5
        high, f_high = share, f
    return -1.0
