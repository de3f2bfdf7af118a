"""Points of pieces: where the parameter has a value, and nearest to a seed."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.limits import TURN, copy_within_limits, nearest_copy
from jacokin.kernels.solution_set.curve import (
    COLUMNS,
    MOST_HALVED,
    PARTS,
    RESOLUTION,
    SECANTS,
    STATIONARY,
    Walk,
    chord_length,
    cubic,
    cubic_root,
    cubic_slope,
    halve_chord,
    make_walk,
    narrowed,
    point_across,
    point_at,
    secant,
    still_shares,
    wrapped,
)
from jacokin.kernels.solution_set.within import DOUBT
from jacokin.kernels.tolerances import LIMIT_SNAP

#: A piece is at most so many times as long as the chord between two nodes.
LONGER = 1.1
#: Places on a chord at which the distance is looked at, by its cubic.
LOOKS = 4
#: A joint that goes on in another 2 pi equivalent on a chord.
JUMP = 3.0


class NearestWork(NamedTuple):
    """What a call reads and writes."""

    nodes: Array  # (n, 14) nodes of all pieces
    ends: NDArray[np.int64]  # (m, 6) first node and node after the last of each piece; the rest is not read
    seed: Array  # (7,) [rad]
    weights: Array  # (7,) 1 for an angle that counts, 0 for a free axis
    limits: Array  # (2, 7) of the angles that count, infinite for none [rad]
    best: Array  # (1,) the least distance [rad], inf for none
    x: Array  # (7,) the point, in the 2 pi equivalents within the limits
    parts: Array  # (PARTS, 28)
    walk: Walk


class PointWork(NamedTuple):
    """What a call reads and writes."""

    nodes: Array  # (2, 14) of the chord
    at: Array  # (1,) value of the parameter between those of the chord's nodes [rad]
    x: Array  # (7,) the point
    walk: Walk


def make_nearest_work() -> NearestWork:
    """Fresh arrays, without pieces."""
    return NearestWork(
        np.empty((0, COLUMNS)),
        np.zeros((0, 6), np.int64),
        np.zeros(7),
        np.ones(7),
        np.empty((2, 7)),
        np.zeros(1),
        np.zeros(7),
        np.empty((PARTS, 2 * COLUMNS)),
        make_walk(),
    )


def make_point_work() -> PointWork:
    """Fresh arrays."""
    return PointWork(
        np.empty((2, COLUMNS)),
        np.zeros(1),
        np.zeros(7),
        make_walk(),
    )


def find_point(work: PointWork) -> int:
    """Fill x with the point of a chord where the parameter has a value; 0 where there is none.

    Next to where curves meet, and where the parameter stands still, the chord's cubic gives the point.
    """
    parameter, a, b = work.walk.parameter[0], work.nodes[0], work.nodes[1]
    p, q, value, length = a[parameter], b[parameter], work.at[0], chord_length(a, b)
    if length == 0.0 or not min(p, q) <= value <= max(p, q):
        return 0
    u = cubic_root(a, b, length, parameter, value, 0.0, 1.0) if p != q else 0.5
    walk = work.walk
    if p == q or not point_at(a, b, parameter, value, u, walk):
        for j in range(7):
            walk.z[j] = cubic(a, b, length, u, j)
    for j in range(7):
        work.x[j] = walk.z[j]
    return 1


def find_nearest(work: NearestWork) -> int:
    """Fill best and x with the point nearest to the seed on all pieces; 0 where there is none."""
    work.best[0] = math.inf
    for n in range(work.ends.shape[0]):
        for i in range(work.ends[n, 0], work.ends[n, 1]):
            offer(work, work.nodes[i])
    for n in range(work.ends.shape[0]):
        for i in range(work.ends[n, 0], work.ends[n, 1] - 1):
            search_chord(work, i)
    return int(work.best[0] < math.inf)


def equivalent(work: NearestWork, angle: float, j: int) -> float:
    """The 2 pi equivalent of an angle that is nearest to the seed within the limits, or nearest to them."""
    return copy_within_limits(angle, work.seed[j], work.limits[0, j], work.limits[1, j], LIMIT_SNAP)


def distance(work: NearestWork, x: Array) -> float:
    """From the seed to a point, in the equivalents that count [rad]."""
    square = 0.0
    for j in range(7):
        if work.weights[j] > 0.0:
            d = equivalent(work, x[j], j) - work.seed[j]
            square += d * d
    return math.sqrt(square)


def offer(work: NearestWork, x: Array) -> None:
    """Keep a point if it is nearer than the best one."""
    found = distance(work, x)
    if found < work.best[0]:
        work.best[0] = found
        for j in range(7):
            work.x[j] = equivalent(work, x[j], j) if work.weights[j] > 0.0 else x[j]


def least_bound(work: NearestWork, x: Array) -> float:
    """The distance on circles, which bounds the one that counts from below and does not jump [rad]."""
    square = 0.0
    for j in range(7):
        if work.weights[j] > 0.0:
            d = wrapped(x[j] - work.seed[j])
            square += d * d
    return math.sqrt(square)


def search_chord(work: NearestWork, i: int) -> None:
    """Look for a nearer point between nodes i and i + 1; chords are cut where angles go on in other equivalents."""
    parts, walk, top, halved = work.parts, work.walk, 0, 0
    for m in range(COLUMNS):
        parts[0, m], parts[0, COLUMNS + m] = work.nodes[i, m], work.nodes[i + 1, m]
    while top >= 0:
        a, b = parts[top, :COLUMNS], parts[top, COLUMNS:]
        length = chord_length(a, b)
        if 0.5 * (least_bound(work, a) + least_bound(work, b) - LONGER * length) >= work.best[0] or length == 0.0:
            top -= 1
            continue
        jumps = False
        for j in range(7):
            if work.weights[j] > 0.0:
                moved = equivalent(work, b[j], j) - equivalent(work, a[j], j) - (b[j] - a[j])
                jumps = jumps or abs(moved) > JUMP or dips(work, a, b, length, j)
        if jumps and length > RESOLUTION and halved < MOST_HALVED and halve_chord(parts, top, walk):
            offer(work, walk.z)
            top += 1
            halved += 1
            continue
        if jumps:
            offer_on_limits(work, a, b, length)
        else:
            search_smooth(work, a, b, length)
        top -= 1


def offer_on_limits(work: NearestWork, a: Array, b: Array, length: float) -> None:
    """Offer the points between two nodes where angles go on in other equivalents, alone in these where several do."""
    walk = work.walk
    for j in range(7):
        if not has_several(work, j):
            continue
        for side in range(2):
            limit = nearest_copy(work.limits[side, j], 0.5 * (a[j] + b[j]))
            if (a[j] < limit) != (b[j] < limit):
                u = cubic_root(a, b, length, j, limit, 0.0, 1.0)
                if point_at(a, b, j, limit, u, walk):
                    offer(work, walk.z)


def has_several(work: NearestWork, j: int) -> bool:
    """Whether an angle has several equivalents within the limits of joint j."""
    return bool(TURN <= work.limits[1, j] - work.limits[0, j] < math.inf)


def dips(work: NearestWork, a: Array, b: Array, length: float, j: int) -> bool:
    """Whether an angle comes to a limit between two nodes and goes back, of those that have several equivalents."""
    if not has_several(work, j):
        return False
    for u in still_shares(a, b, length, j):
        extreme = cubic(a, b, length, u, j)
        for side in range(2 if u > 0.0 else 0):
            limit = nearest_copy(work.limits[side, j], extreme)
            before, after = a[j] - limit, b[j] - limit
            touches = abs(extreme - limit) < DOUBT * length * length + LIMIT_SNAP < max(abs(before), abs(after))
            if before * after > 0.0 and (touches or before * (extreme - limit) <= 0.0):
                return True
    return False


def search_smooth(work: NearestWork, a: Array, b: Array, length: float) -> None:
    """Look for a nearer point between two nodes; all angles stay in one equivalent."""
    slope_before = slope(work, a, b, length, 0.0)
    for n in range(1, LOOKS + 1):
        here = slope(work, a, b, length, n / LOOKS)
        if slope_before < 0.0 < here:
            refine(work, a, b, (n - 1) / LOOKS, n / LOOKS)
        slope_before = here


def slope(work: NearestWork, a: Array, b: Array, length: float, u: float) -> float:
    """Half the derivative of the squared distance along the cubic between two nodes."""
    found = 0.0
    for j in range(7):
        if work.weights[j] > 0.0:
            d = equivalent(work, a[j], j) - a[j] + cubic(a, b, length, u, j) - work.seed[j]
            found += d * cubic_slope(a, b, length, u, j)
    return found


def exact_slope(work: NearestWork, a: Array, b: Array, u: float) -> float:
    """Half the derivative of the squared distance at the point of the curve, which is left in walk.z; NaN for none."""
    walk, found = work.walk, 0.0
    if not point_across(a, b, u, walk):
        return math.nan
    for j in range(7):
        if work.weights[j] > 0.0:
            found += walk.tz[j] * (equivalent(work, a[j], j) - a[j] + walk.z[j] - work.seed[j])
    return found


def refine(work: NearestWork, a: Array, b: Array, low: float, high: float) -> None:
    """Offer the point of the curve where the distance is least, by the cubic between two shares of a chord."""
    f_low, f_high = exact_slope(work, a, b, low), exact_slope(work, a, b, high)
    if f_low > 0.0:  # the cubic is not the curve: it is just before
        high, f_high = low, f_low
        low = max(0.0, low - 1.0 / LOOKS)
        f_low = exact_slope(work, a, b, low)
    elif f_high < 0.0:
        low, f_low = high, f_high
        high = min(1.0, high + 1.0 / LOOKS)
        f_high = exact_slope(work, a, b, high)
    if not f_low <= 0.0 <= f_high:
        return
    for _ in range(SECANTS):
        u = secant(low, f_low, high, f_high)
        f = exact_slope(work, a, b, u)
        if math.isnan(f):
            return
        if abs(f) <= STATIONARY or abs(high - low) < STATIONARY:
            break
        low, f_low, high, f_high = narrowed(low, f_low, high, f_high, u, f)
    offer(work, work.walk.z)
