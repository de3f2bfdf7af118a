"""Where joints pass their limits along an arc, and the intervals between: what exists and is within the limits."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.limits import TURN
from jacokin.kernels.self_motion.arcs import Arcs
from jacokin.kernels.self_motion.follow import Walk, between, chord_length, node_between, share_of, where_joint_is
from jacokin.kernels.self_motion.slices import wrapped

#: [rad] where a joint comes to its limit just as another leaves its own, rounding may put the point past one of them.
CORNER = 1e-10
#: [rad] the same of a single point, which callers look at again: nearly singular curves are known no better.
SINGLE = 1e-7
#: [rad] a part this far outside is within the limits but for rounding, however long; others that SINGLE lets pass are
#: no longer than the second one: of longer ones the ends alone may be within.
SNAP, LONGEST_POINT = 1e-9, 1e-5
#: Share of the square of a chord: an extremum this near to a limit is looked at on halves of the chord.
DOUBT = 2e-3
#: [rad] shorter chords are not halved.
SHORTEST_CHORD = 1e-7
HALVINGS = 14
#: Of one chord, in all: it has two extrema at most, and one more half may be open at each. More are open by rounding.
DIVISIONS = 4 * HALVINGS
#: [rad] a joint that changes by less along a chord stands still there, but for rounding.
STILL = 1e-11
#: Shares of a chord at which a joint touches its limit once.
SAME_SHARE = 1e-3
EVENTS, INTERVALS = 512, 256
#: Columns of an event: first node of its chord, share of the chord, code, point. A code is 2 j for the lower and
#: 2 j + 1 for the upper limit of joint j; -1 - n for an arc's end of kind n.
NODE, SHARE, CODE, POINT, EVENT_COLUMNS = 0, 1, 2, 3, 10
#: Columns of an interval: arc, first and last chord, codes of both ends, shares of both chords, points at both ends.
INTERVAL_COLUMNS = 21


class Cuts(NamedTuple):
    """Events of one arc, and the intervals of all arcs."""

    limits: Array  # (2, 7) lower and upper limits [rad], infinite where a joint is unlimited
    events: Array  # (EVENTS, 10)
    intervals: Array  # (INTERVALS, 21)
    stack: Array  # (16, 29) halves of a chord: its nodes, how often it was halved
    lost: NDArray[np.int64]  # (1,) places that were not found, next to where curves meet


def make_cuts() -> Cuts:
    """Fresh arrays."""
    return Cuts(
        np.empty((2, 7)),
        np.empty((EVENTS, EVENT_COLUMNS)),
        np.empty((INTERVALS, INTERVAL_COLUMNS)),
        np.empty((HALVINGS + 2, 29)),
        np.zeros(1, np.int64),
    )


def excess(x: Array, limits: Array) -> float:
    """How far joints are past their limits, in their nearest 2 pi copies [rad]; < 0 within them, -inf without any."""
    most = -math.inf
    for j in range(7):
        if limits[0, j] > -math.inf:
            middle, half = 0.5 * (limits[0, j] + limits[1, j]), 0.5 * (limits[1, j] - limits[0, j])
            most = max(most, abs(wrapped(x[j] - middle)) - half)
    return most


def doubtful(v0: float, v1: float, d0: float, d1: float, slack: float) -> bool:
    """Whether the cubic with these values and slopes at 0 and 1 has an extremum between that leaves its sign open."""
    c3, c2 = 2.0 * (v0 - v1) + d0 + d1, 3.0 * (v1 - v0) - 2.0 * d0 - d1
    square = c2 * c2 - 3.0 * c3 * d0
    if square <= 0.0:
        return False
    q = -(c2 + math.copysign(math.sqrt(square), c2))
    for n in range(2):
        denominator, numerator = (3.0 * c3, q) if n == 0 else (q, d0)
        u = numerator / denominator if denominator != 0.0 else -1.0
        if 0.0 < u < 1.0:
            value = v0 + u * (d0 + u * (c2 + u * c3))
            if abs(value) < slack or value * v0 <= 0.0 or value * v1 <= 0.0:
                return True
    return False


def stays(v0: float, v1: float, d0: float, d1: float, side: int) -> bool:
    """Whether the same cubic stays within a lower (0) or upper (1) limit at zero, where it stands still."""
    within = max(v0, v1) <= 0.0 if side > 0 else min(v0, v1) >= 0.0
    return within and abs(v1 - v0) + abs(d0) + abs(d1) < STILL


def divide(stack: Array, top: int, x: Array, t: Array) -> None:
    """Replace the part on top of the stack by the two that a point divides it into."""
    half, later = stack[top], stack[top + 1]
    half[28] += 1.0
    later[28] = half[28]
    for m in range(7):
        later[14 + m], later[21 + m] = half[14 + m], half[21 + m]
        later[m], later[7 + m] = x[m], t[m]
        half[14 + m], half[21 + m] = x[m], t[m]


def add_crossings(
    chain: Array, T: Array, arcs: Arcs, node: int, j: int, level: float, code: int, n: int, cuts: Cuts, walk: Walk
) -> int:
    """Append the places where joint j crosses a level on the chord that begins at a node; returns the new count."""
    stack, side = cuts.stack, code - 2 * j
    for m in range(14):
        stack[0, m] = arcs.nodes[node, m]
        stack[0, 14 + m] = arcs.nodes[node + 1, m]
    stack[0, 28] = 0.0
    top, divisions = 0, 0
    while top >= 0:
        half = stack[top]
        a, b = half[0:14], half[14:28]
        length = chord_length(a, b)
        v0, v1, d0, d1 = a[j] - level, b[j] - level, a[7 + j] * length, b[7 + j] * length
        open_ = doubtful(v0, v1, d0, d1, max(DOUBT * length * length, SINGLE)) and not stays(v0, v1, d0, d1, side)
        long = length > SHORTEST_CHORD and half[28] < HALVINGS and divisions < DIVISIONS
        if open_ and long and node_between(chain, T, a, b, 0.5, walk) != 0.0:
            divide(stack, top, walk.x, walk.t)
            top, divisions = top + 1, divisions + 1
            continue
        crosses = (v0 < 0.0) != (v1 < 0.0) and n < EVENTS
        if crosses and where_joint_is(chain, T, a, b, j, level, walk.x, walk) < 0.0:
            cuts.lost[0] += 1
        elif crosses:
            event = cuts.events[n]
            whole = min(max(share_of(arcs.nodes[node], arcs.nodes[node + 1], walk.x), 0.0), 1.0)
            event[NODE], event[SHARE], event[CODE] = node, whole, code
            for m in range(7):
                event[POINT + m] = walk.x[m]
            event[POINT + j] = level
            n += 1
        elif open_ and is_touching(v0, side) and is_touching(v1, side):
            # At the extremum itself: another joint may pass its limit just there.
            share = d0 / (d0 - d1) if d0 * d1 < 0.0 else 0.0
            exact = share > 0.0 and between(chain, T, a, b, share, walk.x, walk)
            nearer = a if abs(v0) < abs(v1) else b
            n = add_touch(arcs, node, j, level, code, walk.x if exact else nearer, n, cuts)
        top -= 1
    return n


def is_touching(v: float, side: int) -> bool:
    """Whether a joint this far above its lower (0) or upper (1) limit is on it: by more outside, for a single point."""
    return abs(v) < CORNER or 0.0 < (v if side > 0 else -v) < SINGLE


def add_touch(arcs: Arcs, node: int, j: int, level: float, code: int, x: Array, n: int, cuts: Cuts) -> int:
    """Append two events where joint j comes to a level and leaves it on the same side; returns the new count."""
    share = min(max(share_of(arcs.nodes[node], arcs.nodes[node + 1], x), 0.0), 1.0)
    if n + 2 > EVENTS or (
        n > 0
        and cuts.events[n - 1, NODE] == node
        and cuts.events[n - 1, CODE] == code
        and abs(cuts.events[n - 1, SHARE] - share) < SAME_SHARE
    ):
        return n
    for k in range(n, n + 2):
        event = cuts.events[k]
        event[NODE], event[SHARE], event[CODE] = node, share, code
        for m in range(7):
            event[POINT + m] = x[m]
        if abs(x[j] - level) < CORNER:
            event[POINT + j] = level
    return n + 2


def events_of_arc(chain: Array, T: Array, arcs: Arcs, arc: int, cuts: Cuts, walk: Walk) -> int:
    """Fill cuts.events with where limits are crossed along an arc, in order; returns how many."""
    n = 0
    for j in range(7):
        if not cuts.limits[0, j] > -math.inf:
            continue
        for node in range(arcs.arcs[arc, 0], arcs.arcs[arc, 1] - 1):
            here, there = arcs.nodes[node, j], arcs.nodes[node + 1, j]
            farthest = abs(there - here) + 0.1 + chord_length(arcs.nodes[node], arcs.nodes[node + 1])
            for side in range(2):
                level = cuts.limits[side, j]
                level += TURN * math.floor((0.5 * (here + there) - level) / TURN + 0.5)
                if abs(level - 0.5 * (here + there)) <= farthest:
                    n = add_crossings(chain, T, arcs, node, j, level, 2 * j + side, n, cuts, walk)
    for i in range(1, n):
        k = i
        while k > 0 and comes_before(cuts.events[k], cuts.events[k - 1]):
            for m in range(EVENT_COLUMNS):
                swap = cuts.events[k, m]
                cuts.events[k, m] = cuts.events[k - 1, m]
                cuts.events[k - 1, m] = swap
            k -= 1
    return n


def comes_before(a: Array, b: Array) -> bool:
    """Whether event a lies before event b on their arc."""
    return bool(a[NODE] < b[NODE] or (a[NODE] == b[NODE] and a[SHARE] < b[SHARE]))


def point_between(chain: Array, T: Array, arcs: Arcs, arc: int, i: int, n: int, cuts: Cuts, walk: Walk) -> bool:
    """Fill walk.x with a point between events i - 1 and i of n on an arc; any point between tells for all of them.

    False, and counted in cuts.lost, where none is found.
    """
    a, u, b, v = arcs.arcs[arc, 0], 0.0, arcs.arcs[arc, 1] - 2, 1.0  # first and last chord
    if i > 0:
        a, u = int(cuts.events[i - 1, NODE]), cuts.events[i - 1, SHARE]
    if i < n:
        b, v = int(cuts.events[i, NODE]), cuts.events[i, SHARE]
    middle, share = (a + b) // 2, 0.5
    if a == b:
        share = 0.5 * (u + v)
    elif b == a + 1:
        middle, share = (a, 0.5 * (u + 1.0)) if 1.0 - u > v else (b, 0.5 * v)
    if between(chain, T, arcs.nodes[middle], arcs.nodes[middle + 1], share, walk.x, walk):
        return True
    if a == b:
        cuts.lost[0] += 1
        return False
    for m in range(7):
        walk.x[m] = arcs.nodes[(a + b + 1) // 2, m]
    return True


def cut(chain: Array, T: Array, arcs: Arcs, cuts: Cuts, walk: Walk) -> int:
    """Fill cuts.intervals with the parts of all arcs that are within the limits; returns how many."""
    found = 0
    cuts.lost[0] = 0
    for arc in range(arcs.size[1]):
        n = events_of_arc(chain, T, arcs, arc, cuts, walk)
        before = False  # whether the part before is within the limits, or a single point that is
        for i in range(n + 1):
            keep = point_between(chain, T, arcs, arc, i, n, cuts, walk) and excess(walk.x, cuts.limits) <= 0.0
            first, last = i - 1, i
            if not keep and not before and 0 < i < n:
                # A single point, unless it is the end of the part after it.
                start, stop = cuts.events[i - 1, POINT : POINT + 7], cuts.events[i, POINT : POINT + 7]
                past = excess(walk.x, cuts.limits)
                single = past <= SINGLE and (past <= SNAP or way_between(start, stop) <= LONGEST_POINT)
                if not single:
                    event = i - 1 if excess(start, cuts.limits) <= excess(stop, cuts.limits) else i
                    first, last = event, event
                    single = excess(cuts.events[event, POINT : POINT + 7], cuts.limits) <= SINGLE
                keep = single and not (
                    point_between(chain, T, arcs, arc, i + 1, n, cuts, walk) and excess(walk.x, cuts.limits) <= 0.0
                )
            before = keep
            if keep and found < INTERVALS:
                enter_interval(arcs, arc, first, last, n, cuts, found)
                found += 1
    return found


def way_between(a: Array, b: Array) -> float:
    """How far two points are apart in the joint that is farthest [rad]."""
    most = 0.0
    for j in range(7):
        most = max(most, abs(a[j] - b[j]))
    return most


def enter_interval(arcs: Arcs, arc: int, start: int, stop: int, n: int, cuts: Cuts, found: int) -> None:
    """Fill a row of cuts.intervals with what lies between two of n events; -1 and n are the ends of the arc."""
    first, last = arcs.arcs[arc, 0], arcs.arcs[arc, 1] - 2
    row = cuts.intervals[found]
    row[0], row[1], row[3], row[5] = arc, first, -1 - arcs.arcs[arc, 2], 0.0
    row[2], row[4], row[6] = last, -1 - arcs.arcs[arc, 3], 1.0
    if start >= 0:
        event = cuts.events[start]
        row[1], row[3], row[5] = event[NODE], event[CODE], event[SHARE]
    if stop < n:
        event = cuts.events[stop]
        row[2], row[4], row[6] = event[NODE], event[CODE], event[SHARE]
    for m in range(7):
        row[7 + m] = cuts.events[start, POINT + m] if start >= 0 else arcs.nodes[first, m]
        row[14 + m] = cuts.events[stop, POINT + m] if stop < n else arcs.nodes[last + 1, m]
