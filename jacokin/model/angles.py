"""Angles that are equal up to full turns: wrapping, copies, distances on the circle. All in [rad], not checked."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.limits import TURN as TURN  # as the kernels have it
from jacokin.kernels.tolerances import LIMIT_SNAP

#: Of one configuration, whole turns away within the limits, that a motion may lead through.
MOST_COPIES = 64


def wrap_to_turn(angles: Array | float) -> Array:
    """The copy of each angle in [0, 2 pi)."""
    wrapped = np.mod(angles, TURN)
    return np.asarray(np.where(wrapped >= TURN, 0.0, wrapped))  # the remainder of -1e-17 is rounded up to a full turn


def wrap_to_pi(angles: Array | float) -> Array:
    """The copy of each angle in [-pi, pi)."""
    return wrap_to_turn(np.asarray(angles) + math.pi) - math.pi


def nearest_copy(q: Array, near: Array, unlimited: NDArray[np.bool_] | bool = True) -> Array:
    """`q` with every angle in the copy nearest to another angle; angles that are not `unlimited` stay.

    Args:
        q: (..., n) angles.
        near: (..., n) the other angles.
        unlimited: (n,) which angles may take another copy.
    """
    return np.where(unlimited, q + TURN * np.rint((near - q) / TURN), q)


def circular_distance(q: Array, near: Array, unlimited: NDArray[np.bool_] | bool = True) -> Array:
    """Euclidean distance over the last axis, the short way round for angles that are `unlimited`.

    Args:
        q: (..., n) angles.
        near: (..., n) the other angles.
        unlimited: (n,) which angles are equal after full turns.

    Returns:
        (...) distances.
    """
    distance: Array = np.linalg.norm(nearest_copy(q, near, unlimited) - near, axis=-1)
    return distance


def into_limits(q: Array, lower: Array, upper: Array) -> Array:
    """The copies of the angles inside their limits, any number of turns away; without one, the nearer limit.

    Of several copies inside the limits, the one nearest to the angle itself. The result is inside the limits exactly:
    an angle past a limit by no more than LIMIT_SNAP is put on it, not a turn away.

    Args:
        q: (..., n) finite angles.
        lower: (n,) lower limits; -inf for none.
        upper: (n,) upper limits, not below the lower ones; inf for none.
    """
    fewest = np.ceil((lower - LIMIT_SNAP - q) / TURN)  # turns that reach the lower limit
    most = np.floor((upper + LIMIT_SNAP - q) / TURN)  # turns that stay below the upper limit
    between = fewest > most  # no copy inside: one below the lower limit, the next above the upper limit
    inside = np.clip(0.0, fewest, np.maximum(fewest, most))
    low = q + TURN * np.where(between, most, inside)
    high = q + TURN * np.where(between, fewest, inside)
    return np.clip(np.where(lower - low <= high - upper, low, high), lower, upper)


def copies_counted(lower: Array, upper: Array, turning: NDArray[np.bool_]) -> NDArray[np.int64]:
    """How many copies (n,) of each angle to look at: all within the limits, or fewer for `MOST_COPIES` together.

    Args:
        lower: (n,) limits; -inf for none.
        upper: (n,) inf for none.
        turning: (n,) which angles have copies to choose from.
    """
    room = np.minimum(np.where(turning, upper - lower, 0.0), MOST_COPIES * TURN)
    counts = 1 + (room / TURN).astype(np.int64)
    while math.prod(counts.tolist()) > MOST_COPIES:
        counts[np.argmax(counts)] -= 1
    return counts


def copies_within(q: Array, near: Array, lower: Array, upper: Array, counts: NDArray[np.int64]) -> Array:
    """The copies (m, n) of angles (k, n) within their limits, of each angle so many (n,), those nearest to others (n,).

    Angles of which one copy is wanted stay.
    """
    for angle in np.flatnonzero(counts > 1).tolist():
        low, high, count = lower[angle], upper[angle], int(counts[angle])
        first = into_limits(nearest_copy(q[:, angle], near[angle]), low, high)
        turns = np.arange(1, 2 * count) // 2 * np.where(np.arange(1, 2 * count) % 2, -1, 1)  # 0, 1, -1, 2, -2, ...
        copies = first[:, None] + TURN * np.where(near[angle] < first, -1, 1)[:, None] * turns
        kept = (copies >= low) & (copies <= high)
        kept &= np.cumsum(kept, axis=1) <= count
        q = np.repeat(q, kept.sum(axis=1), axis=0)
        q[:, angle] = copies[kept]
    return q
