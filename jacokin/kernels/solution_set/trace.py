"""All curves through given points, each followed until it closes.

The points are all solutions at some values of the parameter, its slices. A curve passes every point of a slice once or
not at all, and every point is passed by one curve: that is counted, so that a leap from one curve to another, or a
solution that was missed, does not go unnoticed.
"""

from __future__ import annotations

import math
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.limits import nearest_copy
from jacokin.kernels.solution_set.curve import (
    COLUMNS,
    LEAST_COSINE,
    LONGEST_STEP,
    RESOLUTION,
    StepResult,
    Walk,
    advance,
    chord_length,
    cubic,
    cubic_root,
    go_on,
    point_across,
    point_at,
    point_where_still,
    still_shares,
    tangent,
    wrapped,
)
from jacokin.kernels.solution_set.slices import Slices

NODES, LOOPS, MEETINGS = 13184, 132, 64
#: Of these so many are for the curve that a seed leads to alone, where there is no room for all.
SPARE_NODES, SPARE_LOOPS = 896, 4
#: [rad] shorter steps are not tried: the curve is lost. From the second on, curves that meet are passed; where a curve
#: turns so sharply that steps are shorter, another one is so near that they may not be told apart.
SHORTEST_STEP, MEETING_STEP = 1e-9, 1e-4
#: [rad] a curve passes a point of a slice at this distance from the cubic between its nodes, and from there nearer than
#: this share of the distance to any other.
PASSED, PASSED_SHARE = 0.03, 0.5
MOST_STEPS = 6000
#: Steps after which a walk that comes back to where it was then, or after twice, four times as many, goes round without
#: end: it passes by where it began (Brent, 1980, on cycles).
ENDLESS = 256
#: Share of a chord by which a point on a curve may be beside the chord's ends, for rounding.
BESIDE = 0.1
#: How a curve ends: nowhere, where it leaves the window, lost on the way, or for want of room.
CurveEnd = IntEnum("CurveEnd", "LOST CLOSED LEFT FULL", start=0)


class Loops(NamedTuple):
    """Curves as runs of nodes; each ends where it begins, whole turns of its angles away, unless it was lost."""

    nodes: Array  # (NODES, 14) points, unwrapped along the curve, and tangents forwards
    fold: NDArray[np.int64]  # (NODES,) 1 where the parameter turns back
    ends: NDArray[np.int64]  # (LOOPS, 3) first node, node after the last, how it ends
    window: Array  # (2,) values of the parameter from whose middle curves are followed so far to either side [rad]
    meetings: Array  # (MEETINGS, 14) points between which curves meet
    room: NDArray[np.int64]  # (2,) for nodes and for curves, for now
    size: NDArray[np.int64]  # (4,) nodes, curves, meetings, what went wrong


def make_loops() -> Loops:
    """Fresh arrays."""
    return Loops(
        np.empty((NODES, COLUMNS)),
        np.zeros(NODES, np.int64),
        np.zeros((LOOPS, 3), np.int64),
        np.array([0.0, np.inf]),
        np.empty((MEETINGS, COLUMNS)),
        np.array([NODES, LOOPS]),
        np.zeros(4, np.int64),
    )


def trace(slices: Slices, loops: Loops, walk: Walk) -> None:
    """Follow the curves through all points of the slices that none has passed so far; fills loops."""
    for i in range(slices.size[0]):
        for k in range(slices.counts[i]):
            if slices.passed[i, k] > 0 or (math.isnan(slices.p[i]) and is_traced(loops, slices.x[i, k])):
                continue
            slices.passed[i, k], first = 1, loops.size[1]
            follow(i, k, slices, loops, walk)
            for n in range(slices.size[0] if math.isnan(slices.p[i]) else 0):
                count_all_passed(n, first, slices, loops, walk)


def is_full(loops: Loops) -> bool:
    """Whether a curve ends for want of room."""
    full = False
    for c in range(loops.size[1]):
        full = full or loops.ends[c, 2] == CurveEnd.FULL
    return full


def is_traced(loops: Loops, x: Array) -> bool:
    """Whether a point lies on a curve that is known."""
    for c in range(loops.size[1]):
        for n in range(loops.ends[c, 0], loops.ends[c, 1] - 1):
            if lies_between(x, loops.nodes[n], loops.nodes[n + 1], -BESIDE):
                return True
    return False


def is_known(loops: Loops, x: Array, walk: Walk) -> bool:
    """Whether a point lies on a curve that is known, as exactly as curves are told apart."""
    for c in range(loops.size[1]):
        for n in range(loops.ends[c, 0], loops.ends[c, 1] - 1):
            a, b = loops.nodes[n], loops.nodes[n + 1]
            if not lies_between(x, a, b, -BESIDE):
                continue
            square, along = 0.0, 0.0
            for j in range(7):
                along += wrapped(x[j] - a[j]) * (b[j] - a[j])
                square += (b[j] - a[j]) * (b[j] - a[j])
            if point_across(a, b, along / square, walk):
                away = 0.0
                for j in range(7):
                    away = max(away, abs(wrapped(x[j] - walk.z[j])))
                if away <= RESOLUTION:
                    return True
    return False


def is_near(loops: Loops, x: Array, distance: float) -> bool:
    """Whether a point is at most a distance [rad] away from a curve that is known, by the chords between its nodes."""
    for c in range(loops.size[1]):
        for n in range(loops.ends[c, 0], max(loops.ends[c, 1] - 1, loops.ends[c, 0] + 1)):
            a, b = loops.nodes[n], loops.nodes[min(n + 1, loops.ends[c, 1] - 1)]
            square, along, length = 0.0, 0.0, 0.0
            for j in range(7):
                d, e = wrapped(x[j] - a[j]), b[j] - a[j]
                square, along, length = square + d * d, along + d * e, length + e * e
            u = min(max(along / length, 0.0), 1.0) if length > 0.0 else 0.0
            if square - 2.0 * u * along + u * u * length <= distance * distance:
                return True
    return False


def lies_between(x: Array, a: Array, b: Array, low: float) -> bool:
    """Whether a point lies on the curve between two nodes, from a share of the chord on to just beyond the second one.

    By the cubic through both, to about 1e-5 rad.
    """
    length = chord_length(a, b)
    along, square = 0.0, 0.0
    for j in range(7):
        d = wrapped(x[j] - a[j])
        along += d * (b[j] - a[j])
        square += d * d
    if length == 0.0 or square > 2.0 * length * length:
        return False
    u, away = along / (length * length), 0.0
    for j in range(7):
        away = max(away, abs(wrapped(x[j] - cubic(a, b, length, u, j))))
    return low < u < 1.0 + BESIDE and away <= 1e-3 * length + 10.0 * RESOLUTION


def add_node(loops: Loops, x: Array, t: Array, fold: int) -> int:
    """Append a node; its number, or -1 where there is no room."""
    n = int(loops.size[0])
    if n >= loops.room[0]:
        return -1
    for j in range(7):
        loops.nodes[n, j] = x[j]
        loops.nodes[n, 7 + j] = t[j]
    loops.fold[n] = fold
    loops.size[0] = n + 1
    return n


def follow(i: int, k: int, slices: Slices, loops: Loops, walk: Walk) -> None:
    """Follow the curve from point k of slice i until it comes back there, or leaves the window on both sides."""
    found = begin(slices.x[i, k], walk)
    if loops.size[1] >= loops.room[1]:
        loops.size[3] += 1
        return
    if not found:  # no curve passes here alone: a single point
        loops.size[3] += 1
        first = add_node(loops, walk.x, walk.t, 1)
        if first >= 0:
            enter_run(loops, first, CurveEnd.CLOSED)
        return
    if run((i, k), slices, loops, walk) != CurveEnd.LEFT or loops.size[1] >= loops.room[1]:
        return
    begin(slices.x[i, k], walk)
    for j in range(7):
        walk.t[j] = -walk.t[j]
    run((i, k), slices, loops, walk)


def begin(start: Array, walk: Walk) -> bool:
    """Make a point the last one of a walk, the parameter rising ahead; False, and a tangent of zero, where none is."""
    parameter, found = walk.parameter[0], False
    for m in range(8):  # where the parameter stands still, any other angle tells the way ahead
        for j in range(7):
            walk.x[j] = start[j]
            walk.border[j] = 1.0 if j == (parameter if m == 0 else m - 1) else 0.0
        found = found or tangent(walk.x, walk.border, walk.t, walk) != 0.0
    for j in range(7):
        walk.bend[j], walk.more[j], walk.last[j] = 0.0, 0.0, 0.0
        walk.t[j] = walk.t[j] if found else 0.0
    walk.length[0] = 0.0
    return found


def enter_run(loops: Loops, first: int, state: CurveEnd) -> None:
    """Enter the nodes from the first one on as a curve."""
    n = loops.size[1]
    loops.ends[n, 0], loops.ends[n, 1], loops.ends[n, 2] = first, loops.size[0], state
    loops.size[1] = n + 1


def run(point: tuple[int, int], slices: Slices, loops: Loops, walk: Walk) -> CurveEnd:
    """Follow the curve ahead of a walk that begins at a point of a slice; how it ends."""
    parameter, is_near = walk.parameter[0], False
    volume = tangent(walk.x, walk.t, walk.ty, walk)
    walk.volume[1] = abs(volume)
    first = add_node(loops, walk.x, walk.t, 0)
    h, state = 0.25 * LONGEST_STEP, CurveEnd.LOST if first >= 0 else CurveEnd.FULL
    way, at_first, farthest, reference, steps = 0.0, 0.0, first, NODES, 0
    for _ in range(MOST_STEPS):
        if h < SHORTEST_STEP or state != CurveEnd.LOST:
            break
        result = advance(walk, h, volume, walk.y, walk.ty)
        last = loops.size[0] - 1
        too_long = result in (StepResult.FLIPPED, StepResult.LONG) and h > MEETING_STEP
        if result == StepResult.FAILED or too_long or not add_step(first, loops, walk):
            loops.size[0] = last + 1
            h *= 0.5
            is_near = too_long
            continue
        volume = walk.volume[0]
        if result == StepResult.FLIPPED:
            note_meeting(loops, walk.x, walk.y)
        elif h < MEETING_STEP and not is_near:
            loops.size[3] += 1
        if comes_back(last, (point[0], point[1], first), slices, loops, walk):
            state = CurveEnd.CLOSED
        for n in range(last + 1, loops.size[0]):
            way, farthest = note_turn(loops, parameter, n, way, farthest)
            at_first = way if at_first == 0.0 else at_first
        if state == CurveEnd.LOST and comes_round(last, reference, loops):
            first, state = reference, CurveEnd.CLOSED
            loops.size[3] += 1
        if state == CurveEnd.LOST:
            state = how_far(loops, walk.y[parameter])
        steps += 1
        if steps >= ENDLESS and steps & (steps - 1) == 0:
            if state == CurveEnd.LOST and is_known(loops, walk.y, walk):  # it began aside of that curve
                loops.size[0] = first
                loops.size[3] += 1
                return CurveEnd.CLOSED
            reference = int(loops.size[0]) - 1
        go_on(walk)
        h = min(1.5 * h, LONGEST_STEP)
    if state == CurveEnd.CLOSED and way * at_first < 0.0:  # it turned within the last steps, or where it began
        loops.fold[farthest if farthest < loops.size[0] - 1 else first] = 1
    loops.size[3] += state in (CurveEnd.LOST, CurveEnd.FULL)
    if first >= 0:
        enter_run(loops, first, state)
    return state


def comes_back(
    last: int,
    start: tuple[int, int, int],
    slices: Slices,
    loops: Loops,
    walk: Walk,
) -> bool:
    """Count the points of slices that a curve passes from node last on; whether it comes back to where it began."""
    back = False
    for n in range(last, loops.size[0] - 1):
        back = back or note_passed(n, start, slices, loops, walk)
    return back


def comes_round(last: int, reference: int, loops: Loops) -> bool:
    """End a curve from node last on where it comes back to an earlier one, of which it began aside; whether it does."""
    for n in range(max(last, reference + 1), loops.size[0] - 1):
        a, b, x, cosine = loops.nodes[n], loops.nodes[n + 1], loops.nodes[reference], 0.0
        for j in range(7):
            cosine += x[7 + j] * b[7 + j]
        if cosine >= LEAST_COSINE and lies_between(x, a, b, 0.0):
            close_loop(loops, n, reference)
            return True
    return False


def how_far(loops: Loops, p: float) -> CurveEnd:
    """How a curve ends at its last node, with this value of the parameter; `LOST` where it goes on."""
    if loops.size[0] + 2 > loops.room[0]:
        return CurveEnd.FULL
    return CurveEnd.LEFT if abs(wrapped(p - loops.window[0])) > loops.window[1] else CurveEnd.LOST


def note_turn(loops: Loops, parameter: int, n: int, way: float, farthest: int) -> tuple[float, int]:
    """Mark a fold where the parameter has come back from its farthest value; by less it stands still, but for rounding.

    Args:
        loops: with the curve up to node n.
        parameter: its index.
        n: the node to look at.
        way: 1 where the parameter rises, -1 where it falls, 0 where it has not moved so far.
        farthest: the node where it has come farthest on its way, or the curve's first.

    Returns:
        Both, at node n.
    """
    moved = loops.nodes[n, parameter] - loops.nodes[farthest, parameter]
    if abs(moved) > RESOLUTION and moved * way <= 0.0:
        if way != 0.0:
            loops.fold[farthest] = 1
            loops.nodes[farthest, 7 + parameter] = 0.0
        return math.copysign(1.0, moved), n
    return way, n if moved * way > 0.0 else farthest


def add_step(first: int, loops: Loops, walk: Walk) -> bool:
    """Append the point ahead of a walk, and before it the one where the parameter stands still; False for none there.

    Args:
        first: the curve's first node.
        loops: appended to.
        walk: from its last point to the one ahead.
    """
    parameter, n = walk.parameter[0], loops.size[0]
    a = n - 1
    if add_node(loops, walk.y, walk.ty, 0) < 0 or turns_twice(loops.nodes[a], loops.nodes[n], parameter):
        return False
    if not turns(loops.nodes[a], loops.nodes[n], parameter):
        return True
    if not point_where_still(loops.nodes[a], loops.nodes[n], parameter, walk):
        return False
    walk.tz[parameter] = 0.0
    before, after = 0.0, 0.0
    for j in range(7):
        before = max(before, abs(walk.z[j] - loops.nodes[a, j]))
        after = max(after, abs(walk.z[j] - loops.nodes[n, j]))
    if before <= RESOLUTION and a == first:  # it began there
        return True
    still = n
    if before <= RESOLUTION:
        still = a
    elif after > RESOLUTION and add_node(loops, walk.y, walk.ty, 0) < 0:
        return False
    for j in range(7):
        loops.nodes[still, j], loops.nodes[still, 7 + j] = walk.z[j], walk.tz[j]
    return True


def turns(a: Array, b: Array, parameter: int) -> bool:
    """Whether the parameter turns back between two nodes; by less than the resolution it may be for rounding."""
    da, db, moved = a[7 + parameter], b[7 + parameter], abs(b[parameter] - a[parameter])
    return bool(da * db < 0.0 and moved + chord_length(a, b) * (abs(da) + abs(db)) > RESOLUTION)


def turns_twice(a: Array, b: Array, parameter: int) -> bool:
    """Whether the parameter turns back and back again between two nodes, by the cubic through both."""
    length = chord_length(a, b)
    first, second = still_shares(a, b, length, parameter)
    twice = first > 0.0 and second > 0.0
    return twice and abs(cubic(a, b, length, first, parameter) - cubic(a, b, length, second, parameter)) > RESOLUTION


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
    p, q = a[walk.parameter[0]], b[walk.parameter[0]]
    if math.isnan(slices.p[i0]):
        back = n > first and lies_between(loops.nodes[first], a, b, 0.0)
        if back:
            close_loop(loops, n, first)
        return back
    closes = False
    if n > first and passes(slices.p[i0], p, q):
        closes = point_passed(a, b, i0, slices, walk) == k0
        if closes:
            q = nearest_copy(slices.p[i0], 0.5 * (p + q))  # others that are passed later were passed at first
        else:
            count_point(a, b, i0, slices, loops, walk)
    for i in range(slices.size[0]):
        if i != i0 and passes(slices.p[i], p, q):
            count_point(a, b, i, slices, loops, walk)
    if closes:
        close_loop(loops, n, first)
    return closes


def passes(value: float, p: float, q: float) -> bool:
    """Whether a value of the parameter, or one whole turns away, is passed between p and q; NaN never is."""
    value = nearest_copy(value, 0.5 * (p + q))
    return min(p, q) < value <= max(p, q)


def point_passed(a: Array, b: Array, i: int, slices: Slices, walk: Walk) -> int:
    """Which point of slice i a curve passes between two nodes, -1 for none."""
    parameter, length = walk.parameter[0], chord_length(a, b)
    value = nearest_copy(slices.p[i], 0.5 * (a[parameter] + b[parameter]))
    u = cubic_root(a, b, length, parameter, value, 0.0, 1.0)
    for j in range(7):
        walk.z[j] = cubic(a, b, length, u, j)
    nearest, least, second = nearest_of(slices, i, walk.z)
    # Curves may be near to each other.
    if least > PASSED_SHARE * second and point_at(a, b, parameter, value, u, walk):
        nearest, least, second = nearest_of(slices, i, walk.z)
    return nearest if least <= min(PASSED, PASSED_SHARE * second) else -1


def count_all_passed(i: int, first: int, slices: Slices, loops: Loops, walk: Walk) -> None:
    """Count the points of slice i that the curves from the first one on pass."""
    parameter = walk.parameter[0]
    for c in range(first, loops.size[1]):
        for n in range(loops.ends[c, 0], loops.ends[c, 1] - 1):
            a, b = loops.nodes[n], loops.nodes[n + 1]
            if passes(slices.p[i], a[parameter], b[parameter]):
                count_point(a, b, i, slices, loops, walk)


def count_point(a: Array, b: Array, i: int, slices: Slices, loops: Loops, walk: Walk) -> None:
    """Count the point of slice i that a curve passes between two nodes; a doubt for none, and for one passed before."""
    k = point_passed(a, b, i, slices, walk)
    if k >= 0:
        slices.passed[i, k] += 1
    loops.size[3] += k < 0 or slices.passed[i, k] > 1


def close_loop(loops: Loops, n: int, first: int) -> None:
    """End the curve after node n with its first one, whole turns away."""
    a, b, start = loops.nodes[n], loops.nodes[n + 1], loops.nodes[first]
    for j in range(7):
        b[j] = a[j] + wrapped(start[j] - a[j])
        b[7 + j] = start[7 + j]
    loops.fold[n + 1] = 0
    loops.size[0] = n + 2
