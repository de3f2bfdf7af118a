"""All curves through given points, each followed until it closes.

The points are all solutions at some values of the parameter, its slices. A curve passes every point of a slice once or
not at all, and every point is passed by one curve: that is counted, so that a leap from one curve to another, or a
solution that was missed, does not go unnoticed.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.limits import TURN
from jacokin.kernels.solution_set.curve import (
    COLUMNS,
    FAILED,
    FLIPPED,
    LONGEST_STEP,
    RESOLUTION,
    Walk,
    advance,
    chord_length,
    cubic,
    cubic_root,
    point_at,
    point_where_still,
    tangent,
    wrapped,
)
from jacokin.kernels.solution_set.slices import Slices

NODES, LOOPS, MEETINGS = 12288, 128, 64
#: [rad] shorter steps are not tried: the curve is lost. From the second on, curves that meet are passed.
SHORTEST_STEP, MEETING_STEP = 1e-9, 1e-4
#: [rad] a curve passes a point of a slice at this distance from the cubic between its nodes, and from there nearer than
#: this share of the distance to any other.
PASSED, PASSED_SHARE = 0.03, 0.5
MOST_STEPS = 6000
#: [rad] where a curve turns so sharply that steps are shorter, another one comes so near that they may not be told apart.
SHARP = 1e-3
#: [-] slope of a parameter that stands still, but for rounding.
STANDING = 1e-6


class Loops(NamedTuple):
    """Curves as runs of nodes; each ends where it begins, whole turns of its angles away, unless it was lost."""

    nodes: Array  # (NODES, 14) points, unwrapped along the curve, and tangents forwards
    fold: NDArray[np.int64]  # (NODES,) 1 where the parameter turns back
    ends: NDArray[np.int64]  # (LOOPS, 3) first node, node after the last, 1 for a closed curve
    meetings: Array  # (MEETINGS, 14) points between which curves meet
    size: NDArray[np.int64]  # (4,) nodes, curves, meetings, what went wrong


def make_loops() -> Loops:
    """Fresh arrays."""
    return Loops(
        np.empty((NODES, COLUMNS)),
        np.zeros(NODES, np.int64),
        np.zeros((LOOPS, 3), np.int64),
        np.empty((MEETINGS, COLUMNS)),
        np.zeros(4, np.int64),
    )


def trace(chain: Array, T: Array, parameter: int, slices: Slices, loops: Loops, walk: Walk) -> None:
    """Follow the curves through all points of the slices that none has passed so far; fills loops."""
    for i in range(slices.size[0]):
        for k in range(slices.counts[i]):
            if slices.passed[i, k] > 0 or (math.isnan(slices.p[i]) and is_traced(loops, slices.x[i, k])):
                continue
            slices.passed[i, k] = 1
            follow(chain, T, parameter, i, k, slices, loops, walk)


def is_traced(loops: Loops, x: Array) -> bool:
    """Whether a point lies on a curve, to about 1e-5 rad."""
    for c in range(loops.size[1]):
        for n in range(loops.ends[c, 0], loops.ends[c, 1] - 1):
            a, b = loops.nodes[n], loops.nodes[n + 1]
            length = chord_length(a, b)
            along, square = 0.0, 0.0
            for j in range(7):
                d = wrapped(x[j] - a[j])
                along += d * (b[j] - a[j])
                square += d * d
            if length == 0.0 or square > 4.0 * length * length:
                continue
            u = along / (length * length)
            if -0.1 <= u <= 1.1:
                away = 0.0
                for j in range(7):
                    away = max(away, abs(wrapped(x[j] - cubic(a, b, length, u, j))))
                if away < 1e-3 * length + 10.0 * RESOLUTION:
                    return True
    return False


def add_node(loops: Loops, x: Array, t: Array, fold: int) -> bool:
    """Append a node; False where there is no room."""
    n = loops.size[0]
    if n == NODES:
        return False
    for j in range(7):
        loops.nodes[n, j] = x[j]
        loops.nodes[n, 7 + j] = t[j]
    loops.fold[n] = fold
    loops.size[0] = n + 1
    return True


def follow(chain: Array, T: Array, parameter: int, i: int, k: int, slices: Slices, loops: Loops, walk: Walk) -> None:
    """Follow the curve from point k of slice i until it comes back there."""
    x, t, y, ty = walk.x, walk.t, walk.y, walk.ty
    for j in range(7):
        x[j] = slices.x[i, k, j]
        walk.border[j] = 1.0 if j == parameter else 0.0
        walk.bend[j] = 0.0
    sign = tangent(chain, T, x, walk.border, t, walk)
    if sign == 0.0:  # the parameter stands still here: any other border
        for m in range(7):
            for j in range(7):
                walk.border[j] = 1.0 if j == m else 0.0
            sign = tangent(chain, T, x, walk.border, t, walk) if sign == 0.0 else sign
    number, first = loops.size[1], loops.size[0]
    if number == LOOPS:
        loops.size[3] += 1
        return
    if sign == 0.0:  # no curve passes here alone: a single point
        for j in range(7):
            t[j] = 0.0
        loops.size[3] += 1
        if add_node(loops, x, t, 1):
            loops.ends[number, 0], loops.ends[number, 1], loops.ends[number, 2] = first, first + 1, 1
            loops.size[1] = number + 1
        return
    sign = tangent(chain, T, x, t, ty, walk)
    loops.ends[number, 0], loops.ends[number, 2] = first, 0
    loops.size[1] = number + 1
    room = add_node(loops, x, t, 0)
    h, done = 0.25 * LONGEST_STEP, False
    way = t[parameter] if abs(t[parameter]) > STANDING else 0.0  # the last slope of the parameter that is no rounding
    for _ in range(MOST_STEPS):
        if not room or h < SHORTEST_STEP:
            break
        result = advance(chain, T, walk, h, sign, y, ty)
        if result == FAILED or (result == FLIPPED and h > MEETING_STEP):
            h *= 0.5
            continue
        if result == FLIPPED:
            note_meeting(loops, x, y)
            sign = -sign
        elif h < SHARP:
            loops.size[3] += 1
        a = loops.size[0] - 1
        room = add_node(loops, y, ty, 0)
        if not room:
            break
        if turns_twice(loops.nodes[a], loops.nodes[a + 1], parameter):
            loops.size[0] = a + 1
            h *= 0.5
            continue
        slope = ty[parameter]
        if slope * way < 0.0 and abs(slope) > STANDING:
            if t[parameter] * way <= 0.0:  # at the last node, but for rounding
                loops.fold[a] = 1
            elif not point_where_still(
                chain, T, loops.nodes[a], loops.nodes[a + 1], parameter, walk.z, walk.tz, walk
            ) or not add_node(loops, y, ty, 0):
                loops.size[0] = a + 1
                h *= 0.5
                continue
            else:
                for j in range(7):
                    loops.nodes[a + 1, j], loops.nodes[a + 1, 7 + j] = walk.z[j], walk.tz[j]
                loops.nodes[a + 1, 7 + parameter] = 0.0
                loops.fold[a + 1] = 1
        if abs(slope) > STANDING:
            way = slope
        n = a
        while n < loops.size[0] - 1 and not done:
            done = note_passed(chain, T, parameter, n, (i, k, first), slices, loops, walk)
            n += 1
        if done:
            loops.ends[number, 2] = 1
            break
        for j in range(7):
            walk.bend[j] = (ty[j] - t[j]) / h
            x[j], t[j] = y[j], ty[j]
        h = min(1.5 * h, LONGEST_STEP)
    if not done:
        loops.size[3] += 1
    loops.ends[number, 1] = loops.size[0]


def turns_twice(a: Array, b: Array, parameter: int) -> bool:
    """Whether the parameter turns back and back again between two nodes, by the cubic through both."""
    da, db = a[7 + parameter], b[7 + parameter]
    if not (da * db > 0.0 and min(abs(da), abs(db)) > STANDING):
        return False
    length = chord_length(a, b)
    mean = (b[parameter] - a[parameter]) / length
    # The derivative at both ends has one sign; its extremum in between must not have the other.
    c, m = 3.0 * (da + db - 2.0 * mean), -2.0 * (2.0 * da + db - 3.0 * mean)
    if c == 0.0:
        return False
    u = -m / (2.0 * c)
    return bool(0.0 < u < 1.0 and (da + u * (m + u * c)) * da <= 0.0)


def note_meeting(loops: Loops, x: Array, y: Array) -> None:
    """Keep two points between which curves meet."""
    n = loops.size[2]
    if n == MEETINGS:
        loops.size[3] += 1
        return
    for j in range(7):
        loops.meetings[n, j], loops.meetings[n, 7 + j] = x[j], y[j]
    loops.size[2] = n + 1


def nearest_of(slices: Slices, i: int, x: Array) -> tuple[int, float, float]:
    """Which point of slice i is nearest to a point, its distance, and that of the next one [rad]."""
    nearest, least, second = -1, math.inf, math.inf
    for k in range(slices.counts[i]):
        away = 0.0
        for j in range(7):
            away = max(away, abs(wrapped(slices.x[i, k, j] - x[j])))
        if away < least:
            nearest, least, second = k, away, least
        else:
            second = min(second, away)
    return nearest, least, second


def note_passed(
    chain: Array,
    T: Array,
    parameter: int,
    n: int,
    start: tuple[int, int, int],
    slices: Slices,
    loops: Loops,
    walk: Walk,
) -> bool:
    """Count the points of slices between nodes n and n + 1 as passed; whether one is where the curve began.

    The curve began at a point of a slice, as its first node: the three numbers of start.
    """
    a, b, (i0, k0, first) = loops.nodes[n], loops.nodes[n + 1], start
    p, q = a[parameter], b[parameter]
    if math.isnan(slices.p[i0]):
        return n > first and returns(loops, n, first)
    closes = False
    if passes(slices.p[i0], p, q) and (n > first or level(slices.p[i0], p, q) != p):
        nearest = point_passed(chain, T, parameter, a, b, i0, slices, walk)
        closes = nearest == k0
        if closes:
            q = level(slices.p[i0], p, q)  # others that are passed later were passed at first
        elif nearest >= 0:
            count_passed(i0, nearest, slices, loops)
        else:
            loops.size[3] += 1
    for i in range(slices.size[0]):
        if i == i0 or math.isnan(slices.p[i]) or not passes(slices.p[i], p, q):
            continue
        nearest = point_passed(chain, T, parameter, a, b, i, slices, walk)
        if nearest >= 0:
            count_passed(i, nearest, slices, loops)
        else:
            loops.size[3] += 1
    if closes:
        close_loop(loops, n, first)
    return closes


def level(value: float, p: float, q: float) -> float:
    """The 2 pi equivalent of a value that is nearest to the middle of p and q."""
    return value + TURN * math.floor((0.5 * (p + q) - value) / TURN + 0.5)


def passes(value: float, p: float, q: float) -> bool:
    """Whether a value of the parameter, or one whole turns away, is passed between p and q."""
    value = level(value, p, q)
    return min(p, q) < value <= max(p, q)


def point_passed(chain: Array, T: Array, parameter: int, a: Array, b: Array, i: int, slices: Slices, walk: Walk) -> int:
    """Which point of slice i a curve passes between two nodes, -1 for none."""
    value, length = level(slices.p[i], a[parameter], b[parameter]), chord_length(a, b)
    u = cubic_root(a, b, length, parameter, value, 0.0, 1.0)
    for j in range(7):
        walk.z[j] = cubic(a, b, length, u, j)
    nearest, least, second = nearest_of(slices, i, walk.z)
    if least > PASSED_SHARE * second and point_at(
        chain, T, a, b, parameter, value, u, walk.z, walk.tz, walk
    ):  # curves are near to each other
        nearest, least, second = nearest_of(slices, i, walk.z)
    return nearest if least <= min(PASSED, PASSED_SHARE * second) else -1


def count_all_passed(chain: Array, T: Array, parameter: int, i: int, slices: Slices, loops: Loops, walk: Walk) -> None:
    """Count the points of slice i that the curves so far pass."""
    for c in range(loops.size[1]):
        for n in range(loops.ends[c, 0], loops.ends[c, 1] - 1):
            a, b = loops.nodes[n], loops.nodes[n + 1]
            if passes(slices.p[i], a[parameter], b[parameter]):
                nearest = point_passed(chain, T, parameter, a, b, i, slices, walk)
                if nearest >= 0:
                    count_passed(i, nearest, slices, loops)
                else:
                    loops.size[3] += 1


def count_passed(i: int, k: int, slices: Slices, loops: Loops) -> None:
    """Count point k of slice i as passed; something went wrong if it was before."""
    slices.passed[i, k] += 1
    if slices.passed[i, k] > 1:
        loops.size[3] += 1


def returns(loops: Loops, n: int, first: int) -> bool:
    """Whether a curve that began at any point comes back there between nodes n and n + 1, which then closes it."""
    a, b, start = loops.nodes[n], loops.nodes[n + 1], loops.nodes[first]
    length = chord_length(a, b)
    along, square = 0.0, 0.0
    for j in range(7):
        d = wrapped(start[j] - a[j])
        along += d * (b[j] - a[j])
        square += d * d
    if length == 0.0 or square > 2.0 * length * length:
        return False
    u = along / (length * length)
    if not 0.0 < u <= 1.0:
        return False
    for j in range(7):
        if abs(wrapped(start[j] - cubic(a, b, length, u, j))) > 1e-3 * length + 10.0 * RESOLUTION:
            return False
    close_loop(loops, n, first)
    return True


def close_loop(loops: Loops, n: int, first: int) -> None:
    """End the curve after node n with its first one, whole turns away."""
    a, b, start = loops.nodes[n], loops.nodes[n + 1], loops.nodes[first]
    for j in range(7):
        b[j] = a[j] + wrapped(start[j] - a[j])
        b[7 + j] = start[7 + j]
    loops.fold[n + 1] = 0
    loops.size[0] = n + 2
