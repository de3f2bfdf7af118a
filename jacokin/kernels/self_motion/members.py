"""Members for a first look: at values of the parameter, and roughly where curves turn back or pass limits between them.

Nothing is followed, so a curve between two values is not seen, and which points belong together is guessed.
"""

from __future__ import annotations

import math

from jacokin.arrays import Array
from jacokin.kernels.limits import TURN
from jacokin.kernels.self_motion.arcs import NODES
from jacokin.kernels.self_motion.follow import chord_length, cubic_between
from jacokin.kernels.self_motion.graph import Graph, misfit
from jacokin.kernels.self_motion.slices import Slices, wrapped

#: Share of the way, and rest [rad], that the tangents of two points on one curve may leave unexplained.
DEFECT, REST = 0.5, 0.05
#: [rad] two points at one value that are farther apart do not meet before the next one.
FARTHEST_PAIR = 2.5
#: A curve from one of them to the other bends like part of a circle of which this is left at least, see `add_folds`.
LEAST_TURNING = 0.5
#: [rad] past its limits by so much, a joint may be within them at the member itself.
NEARLY = 0.1
#: Halvings of the way between two values that a limit is passed on.
HALVINGS = 8
#: Columns of a row: a point, then 1 where it is a guess.
GUESSED = 7


def scatter(parameter: int, n: int, closed: bool, slices: Slices, limits: Array, graph: Graph, rows: Array) -> int:
    """Fill rows with the points within the limits at n values, and with guesses between these.

    Args:
        parameter: index of the joint that is the parameter.
        n: number of slices, which are filled.
        closed: whether the last one is followed by the first, one turn on.
        slices: the points.
        limits: (2, 7) [rad].
        graph: its marks of points are used.
        rows: (NODES, 14), filled.

    Returns:
        How many rows there are.
    """
    count = 0
    for i in range(n):
        for k in range(slices.filled[i]):
            if count < NODES and is_inside(slices.x[i, k], limits, 0.0):
                for j in range(7):
                    rows[count, j] = slices.x[i, k, j]
                rows[count, GUESSED] = 0.0
                count += 1
    for i in range(n if closed else n - 1):
        j = i + 1 if i + 1 < n else 0
        shift = TURN if j == 0 else 0.0
        pair_points(slices, i, j, shift, parameter, graph)
        for a in range(slices.filled[i]):
            if graph.mate[a] >= 0:
                count = add_crossings(slices, i, a, j, graph.mate[a], limits, graph, rows, count)
        count = add_folds(parameter, slices, i, 1.0, graph, limits, rows, count)
        for b in range(slices.filled[j]):
            graph.mate[b] = graph.claimed[b]
        count = add_folds(parameter, slices, j, -1.0, graph, limits, rows, count)
    return count


def is_inside(x: Array, limits: Array, slack: float) -> bool:
    """Whether some copies of the joints are past their limits by no more than a slack [rad]."""
    for j in range(7):
        if limits[0, j] > -math.inf and limits[1, j] < math.inf:
            half = 0.5 * (limits[1, j] - limits[0, j])
            if abs(wrapped(x[j] - limits[0, j] - half)) > half + slack:
                return False
    return True


def pair_points(slices: Slices, i: int, j: int, shift: float, parameter: int, graph: Graph) -> None:
    """Fill graph.mate for the points of slice i, and graph.claimed for those of slice j, with the likely other one."""
    h = slices.p[j] + shift - slices.p[i]
    for b in range(slices.filled[j]):
        graph.claimed[b] = -1
    for a in range(slices.filled[i]):
        graph.mate[a] = -1
        best = math.inf
        for b in range(slices.filled[j]):
            if slices.sign[i, a] != slices.sign[j, b] or graph.claimed[b] >= 0:
                continue
            way, defect = misfit(slices.x[i, a], slices.t[i, a], slices.x[j, b], slices.t[j, b], h, parameter)
            if defect < best and defect <= REST + DEFECT * way:
                best = defect
                graph.mate[a] = b
        if graph.mate[a] >= 0:
            graph.claimed[graph.mate[a]] = a


def add_crossings(
    slices: Slices, i: int, a: int, j: int, b: int, limits: Array, graph: Graph, rows: Array, count: int
) -> int:
    """Add where limits are passed between two points of one curve; returns how many rows there are then."""
    first, last = graph.traced[0], graph.traced[1]
    for m in range(7):
        first[m], first[7 + m] = slices.x[i, a, m], slices.t[i, a, m]
        last[m], last[7 + m] = first[m] + wrapped(slices.x[j, b, m] - first[m]), slices.t[j, b, m]
    length = chord_length(first, last)
    for m in range(7):
        if not (limits[0, m] > -math.inf and limits[1, m] < math.inf):
            continue
        for side in range(2):
            limit = first[m] + wrapped(limits[side, m] - first[m])
            # The other copy is a turn away: no way between two values is as long.
            if (first[m] - limit) * (last[m] - limit) >= 0.0 or count == NODES:
                continue
            low, high = 0.0, 1.0
            for _ in range(HALVINGS):
                middle = 0.5 * (low + high)
                if (first[m] - limit) * (cubic_between(first, last, length, middle, m) - limit) > 0.0:
                    low = middle
                else:
                    high = middle
            for k in range(7):
                rows[count, k] = cubic_between(first, last, length, high, k)
            rows[count, m] = limit
            rows[count, GUESSED] = 1.0
            if is_inside(rows[count], limits, NEARLY):
                count += 1
    return count


def add_folds(
    parameter: int, slices: Slices, i: int, ahead: float, graph: Graph, limits: Array, rows: Array, count: int
) -> int:
    """Add where two points of slice i without a mate meet, ahead of it (1) or before it (-1); returns how many rows."""
    first, last = graph.traced[0], graph.traced[1]
    for a in range(slices.filled[i]):
        if graph.mate[a] >= 0 or slices.sign[i, a] < 0.0:
            continue
        best, other = FARTHEST_PAIR * FARTHEST_PAIR, -1
        for b in range(slices.filled[i]):
            if graph.mate[b] < 0 and slices.sign[i, b] < 0.0:
                square = 0.0
                for m in range(7):
                    d = wrapped(slices.x[i, b, m] - slices.x[i, a, m])
                    square += d * d
                if square < best:
                    best, other = square, b
        if other < 0 or count == NODES:
            continue
        turning = 0.0  # of the curve against the way between both, twice the cosine
        for m in range(7):
            first[m], first[7 + m] = slices.x[i, a, m], ahead * slices.t[i, a, m]
            last[m] = first[m] + wrapped(slices.x[i, other, m] - first[m])
            last[7 + m] = -ahead * slices.t[i, other, m]
            turning += (last[m] - first[m]) * (first[7 + m] + last[7 + m])
        way = math.sqrt(best)
        if way == 0.0:
            continue
        length = 2.0 * way / max(1.0 + 0.5 * turning / way, LEAST_TURNING)  # as if it were part of a circle
        share = fold_between(slices.t[i, a, parameter], slices.t[i, other, parameter])
        for m in range(7):
            rows[count, m] = cubic_between(first, last, length, share, m)
        rows[count, GUESSED] = 1.0
        if is_inside(rows[count], limits, NEARLY):
            count += 1
    return count


def fold_between(up: float, down: float) -> float:
    """Where a cubic on [0, 1] with equal ends turns back; its slopes there, without their signs."""
    more = down - up
    half = more - up  # up + 2 half u - 3 more u^2 = 0
    u = up / (math.sqrt(half * half + 3.0 * more * up) - half)
    return u if 0.0 < u < 1.0 else 0.5
