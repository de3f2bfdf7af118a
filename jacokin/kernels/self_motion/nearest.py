"""The point nearest to the seed on a curve between two of its nodes, as far as it is within the limits.

A chord is discarded where nothing on it can be nearer than the best point so far, or where it is outside the limits;
it is cut where a joint passes a limit, and halved where the cubic through its ends leaves a doubt.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.chain import tangent7
from jacokin.kernels.limits import TURN
from jacokin.kernels.self_motion.arcs import Arcs
from jacokin.kernels.self_motion.follow import Walk, chord_length, node_between, where_joint_is
from jacokin.kernels.self_motion.limit_cuts import CORNER, DOUBT, HALVINGS, SHORTEST_CHORD, SINGLE, divide, doubtful
from jacokin.kernels.self_motion.slices import POINTS, SLICES, wrapped

#: A chord is longer than its curve's way from node to node by a factor of at most 1 + ARC_EXCESS + what its turn adds.
ARC_EXCESS, ARC_TURN = 0.02, 2.0
#: Least cosine between a chord and the tangents at its ends; others are halved.
CHORD_TURN = 0.95
#: [rad] longer chords are halved.
LONGEST_CHORD = 0.6
#: [rad] where along the curve the nearest point lies: as exact as rounding allows.
STATIONARY = 1e-14
SECANTS = 40
#: Parts of a chord at a time: one for each time it is halved or cut at a limit.
PARTS = HALVINGS + 8


class Nearest(NamedTuple):
    """What is looked for, and the best that was found."""

    seed: Array  # (7,) [rad]
    weights: Array  # (7,) 1 for a joint that counts, 0 for a free axis
    limits: Array  # (2, 7) of the joints [rad], infinite where a joint is unlimited
    best: Array  # (1,) the least distance so far, inf for none [rad]
    x: Array  # (7,) the point
    stack: Array  # (16, 29) parts of a chord: its nodes, how often it was halved
    distances: Array  # (SLICES, POINTS) lower bounds of the distance [rad]; inf for no point
    done: NDArray[np.int64]  # (SLICES, POINTS, 2) 1 where the curve on that side was looked at
    bounds: Array  # (SLICES, POINTS) lower bounds of the distance on the way to the next slice [rad]


def make_nearest() -> Nearest:
    """Fresh arrays."""
    points = (SLICES, POINTS)
    return Nearest(
        np.zeros(7),
        np.ones(7),
        np.empty((2, 7)),
        np.zeros(1),
        np.zeros(7),
        np.empty((PARTS, 29)),
        np.empty(points),
        np.zeros((*points, 2), np.int64),
        np.empty(points),
    )


def apart(nearest: Nearest, x: Array, j: int) -> float:
    """From the seed to a joint's angle, in the copy that counts [rad]: within the limits, or else the nearest one."""
    if nearest.limits[0, j] > -math.inf:
        middle = 0.5 * (nearest.limits[0, j] + nearest.limits[1, j])
        return float(middle + wrapped(x[j] - middle) - nearest.seed[j])
    return wrapped(float(x[j] - nearest.seed[j]))


def least_distance(nearest: Nearest, x: Array) -> float:
    """The distance of a point from the seed on circles [rad], a lower bound of the distance that counts."""
    square = 0.0
    for j in range(7):
        d = wrapped(x[j] - nearest.seed[j])
        square += nearest.weights[j] * d * d
    return math.sqrt(square)


def offer(nearest: Nearest, x: Array) -> bool:
    """Keep a point of a curve if it is within the limits and nearer than the best one.

    False where it would be, but is outside by so little that only a closer look can tell: see `limit_cuts.SINGLE`.
    """
    square, past = 0.0, 0.0
    for j in range(7):
        d = apart(nearest, x, j)
        angle = nearest.seed[j] + d
        past = max(past, nearest.limits[0, j] - angle, angle - nearest.limits[1, j])
        if past > SINGLE:
            return True
        square += nearest.weights[j] * d * d
    distance = math.sqrt(square)
    if distance < nearest.best[0]:
        if past > CORNER:
            return False
        nearest.best[0] = distance
        for j in range(7):
            angle = nearest.seed[j] + apart(nearest, x, j)
            nearest.x[j] = min(max(angle, nearest.limits[0, j]), nearest.limits[1, j])
    return True


def descent(nearest: Nearest, x: Array, t: Array) -> float:
    """Half the slope of the squared distance along a tangent."""
    slope = 0.0
    for j in range(7):
        slope += nearest.weights[j] * t[j] * apart(nearest, x, j)
    return slope


def offer_between(
    chain: Array, T: Array, a: Array, b: Array, f_a: float, f_b: float, nearest: Nearest, walk: Walk
) -> bool:
    """Offer the point between two nodes where the distance is stationary, its slopes at the nodes being f_a and f_b."""
    low, high = 0.0, 1.0
    length = chord_length(a, b)
    for _ in range(SECANTS):
        share = high - f_b * (high - low) / (f_b - f_a) if f_b != f_a else 0.5 * (low + high)
        if not min(low, high) < share < max(low, high):
            share = 0.5 * (low + high)
        if node_between(chain, T, a, b, share, walk) == 0.0:
            return False
        f = descent(nearest, walk.x, walk.t)
        if abs(f) <= STATIONARY or abs(high - low) * length < STATIONARY:
            break
        if f * f_b < 0.0:
            low, f_a = high, f_b
        else:
            f_a *= 0.5
        high, f_b = share, f
    return offer(nearest, walk.x)


def where_outside(nearest: Nearest, a: Array, b: Array, length: float, decided: bool) -> tuple[int, int]:
    """What the limits mean for a chord: (-1, 0) inside, (-1, 1) outside, (-1, 2) in doubt, (j, side) crosses that.

    If it is decided, a joint comes no nearer to its limit between the nodes than there, but for rounding.
    """
    crossed, side_crossed, doubt = -1, 0, False
    for j in range(7):
        if not nearest.limits[0, j] > -math.inf:
            continue
        start, end, way = nearest.seed[j] + apart(nearest, a, j), nearest.seed[j] + apart(nearest, b, j), b[j] - a[j]
        middle = 0.5 * (nearest.limits[0, j] + nearest.limits[1, j])
        if abs(end - middle) < abs(start - middle):  # the other end may be beside the next copy of the limits
            start = end - way
        for side in range(2):
            flip = -1.0 if side == 0 else 1.0
            v0 = flip * (start - nearest.limits[side, j])
            v1 = v0 + flip * way
            d0, d1 = flip * a[7 + j] * length, flip * b[7 + j] * length
            v0 = 0.0 if abs(v0) <= CORNER else v0
            v1 = 0.0 if abs(v1) <= CORNER else v1
            if not decided and length > SHORTEST_CHORD and doubtful(v0, v1, d0, d1, DOUBT * length * length):
                doubt = True
            elif (v0 > 0.0 and v1 >= 0.0) or (v0 >= 0.0 and v1 > 0.0):
                return -1, 1
            elif v0 * v1 < 0.0 and crossed < 0:
                crossed, side_crossed = j, side
    if doubt:
        return -1, 2
    return (crossed, side_crossed) if crossed >= 0 else (-1, 0)


def search_chord(chain: Array, T: Array, nearest: Nearest, walk: Walk) -> bool:
    """Look for a nearer point between the two nodes in nearest.stack[0]; False where the curve was lost.

    Points are unwrapped and tangents lead from the first node to the second.
    """
    stack = nearest.stack
    stack[0, 28] = 0.0
    for m in range(7):
        walk.t[m] = stack[0, 7 + m]
    sign = tangent7(chain, T, stack[0, 0:7], walk.t, walk.tz, walk.system)
    top = 0
    found = offer(nearest, stack[0, 0:7])
    found = offer(nearest, stack[0, 14:21]) and found
    while top >= 0:
        part = stack[top]
        a, b = part[0:14], part[14:28]
        length = chord_length(a, b)
        if length < SHORTEST_CHORD:  # in doubt to the last: a joint touches its limit where another passes its own
            found = offer(nearest, a[0:7]) and found
            found = offer(nearest, b[0:7]) and found
            top -= 1
            continue
        cos_a, cos_b = 0.0, 0.0
        for j in range(7):
            cos_a += (b[j] - a[j]) * a[7 + j] / length
            cos_b += (b[j] - a[j]) * b[7 + j] / length
        turning = 1.0 - min(cos_a, cos_b)
        way = length * (1.0 + ARC_EXCESS + ARC_TURN * turning)
        if 0.5 * (least_distance(nearest, a) + least_distance(nearest, b) - way) >= nearest.best[0]:
            top -= 1
            continue
        decided = part[28] >= HALVINGS
        if part[28] > 0.0:  # what follows may be outside by no more than rounding, and a joint touch its limit there
            found = offer(nearest, a[0:7]) and found
            found = offer(nearest, b[0:7]) and found
        j, side = where_outside(nearest, a, b, length, decided)
        if j < 0 and side == 1:
            top -= 1
            continue
        f_a, f_b = descent(nearest, a, a[7:14]), descent(nearest, b, b[7:14])
        halve = turning > 1.0 - CHORD_TURN or length > LONGEST_CHORD or passes_antipode(nearest, a, b)
        if decided:
            found = found and not halve
            halve = False
        elif j < 0:
            halve = halve or side == 2 or wavy(nearest, a, b, length, f_a, f_b)
        if halve and top + 1 < PARTS:
            if sign != 0.0 and node_between(chain, T, a, b, 0.5, walk) == sign:
                divide(stack, top, walk.x, walk.t)
                top += 1
                continue
            found = False
        elif j >= 0 and top + 1 < PARTS:
            level = nearest.limits[side, j]
            level += TURN * math.floor((0.5 * (a[j] + b[j]) - level) / TURN + 0.5)
            if (
                where_joint_is(chain, T, a, b, j, level, walk.x, walk) >= 0.0
                and tangent7(chain, T, walk.x, walk.border, walk.t, walk.system) == sign
            ):
                walk.x[j] = level
                found = offer(nearest, walk.x) and found
                divide(stack, top, walk.x, walk.t)
                top += 1
                continue
            found = False
        elif f_a < 0.0 < f_b:
            found = offer_between(chain, T, a, b, f_a, f_b, nearest, walk) and found
        top -= 1
    return found


def passes_antipode(nearest: Nearest, a: Array, b: Array) -> bool:
    """Whether the copy of a joint that counts changes on a chord."""
    for j in range(7):
        way = apart(nearest, b, j) - apart(nearest, a, j)
        if nearest.weights[j] > 0.0 and abs(way - (b[j] - a[j])) > 1.0:
            return chord_length(a, b) > 1e-3
    return False


def wavy(nearest: Nearest, a: Array, b: Array, length: float, f_a: float, f_b: float) -> bool:
    """Whether the squared distance on a chord has a minimum that its slopes at both ends do not tell of."""
    if f_a < 0.0 < f_b:
        return False
    v_a, v_b = 0.0, 0.0
    for j in range(7):
        d_a, d_b = apart(nearest, a, j), apart(nearest, b, j)
        v_a += nearest.weights[j] * d_a * d_a
        v_b += nearest.weights[j] * d_b * d_b
    d_a, d_b = 2.0 * length * f_a, 2.0 * length * f_b
    c3, c2 = 2.0 * (v_a - v_b) + d_a + d_b, 3.0 * (v_b - v_a) - 2.0 * d_a - d_b
    square = c2 * c2 - 3.0 * c3 * d_a
    if square <= 0.0 or c3 == 0.0:
        return False
    u = (-c2 + math.sqrt(square)) / (3.0 * c3)  # of the minimum: the cubic bends upwards there
    return 0.0 < u < 1.0


def search_run(chain: Array, T: Array, nodes: Array, n: int, nearest: Nearest, walk: Walk) -> bool:
    """Look for the nearest point on the first n nodes, whose ends need new tangents; False where a curve was lost."""
    nearest.best[0] = math.inf
    for end in (0, n - 1):
        for m in range(7):
            walk.t[m] = nodes[end, 7 + m]
        if tangent7(chain, T, nodes[end, 0:7], walk.t, nodes[end, 7:14], walk.system) == 0.0:
            return False
    for i in range(n):
        offer(nearest, nodes[i, 0:7])
    return search_nodes(chain, T, nodes, 0, n, nearest, walk)


def search_nodes(chain: Array, T: Array, nodes: Array, first: int, end: int, nearest: Nearest, walk: Walk) -> bool:
    """Look for a nearer point on a run of nodes; False where the curve was lost."""
    found = True
    for n in range(first, end - 1):
        for m in range(14):
            nearest.stack[0, m] = nodes[n, m]
            nearest.stack[0, 14 + m] = nodes[n + 1, m]
        found = search_chord(chain, T, nearest, walk) and found
    return found


def search_arcs(chain: Array, T: Array, arcs: Arcs, nearest: Nearest, walk: Walk) -> bool:
    """Look for the nearest point on all arcs; False where a curve was lost."""
    found = True
    nearest.best[0] = math.inf
    for n in range(arcs.size[0]):
        offer(nearest, arcs.nodes[n, 0:7])
    for arc in range(arcs.size[1]):
        first, end = arcs.arcs[arc, 0], arcs.arcs[arc, 1]
        found = search_nodes(chain, T, arcs.nodes, first, end, nearest, walk) and found
    return found
