"""Joining the points of neighbouring slices: directly where the slopes leave no doubt, else by following the curve."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.chain import tangent7
from jacokin.kernels.limits import TURN
from jacokin.kernels.self_motion.follow import Walk, follow, make_walk, record
from jacokin.kernels.self_motion.seven_joints import solve_rows_at_q3
from jacokin.kernels.self_motion.slices import POINTS, SLICES, SevenJoints, Slices, add_point, wrapped

#: [rad] longest way in one joint between two slices that is joined without following the curve.
DIRECT_WAY = 0.6
#: Share of the way, and rest [rad], that the mean of both slopes may leave unexplained.
DIRECT_DEFECT, DIRECT_REST = 0.01, 1e-5
#: Parts of the way between two slices at most.
MOST_PARTS = 8
#: The next best point must fit this much worse.
SECOND_BEST = 10.0
#: [rad] points nearer to each other are one.
SAME_POINT = 1e-6
#: Links and followed points at most.
LINKS, TRACED = SLICES * POINTS, 8192
#: Values of `Graph.side` besides the index of a link.
OPEN, LOST = -1, -2


class Graph(NamedTuple):
    """How the points hang together. Sides: 0 towards lower, 1 towards higher values of the parameter."""

    side: NDArray[np.int64]  # (SLICES, POINTS, 2, 2) link at each side of a point, and which end of it
    links: NDArray[np.int64]  # (LINKS, 8) slice, point, side of both ends; first traced row, number of rows
    traced: Array  # (TRACED, 15) points between the ends, see `follow.follow`
    mate: NDArray[np.int64]  # (POINTS,)
    claimed: NDArray[np.int64]  # (POINTS,)
    walk: Walk


def make_graph() -> Graph:
    """Fresh arrays."""
    return Graph(
        np.zeros((SLICES, POINTS, 2, 2), np.int64),
        np.zeros((LINKS, 8), np.int64),
        np.empty((TRACED, 15)),
        np.zeros(POINTS, np.int64),
        np.zeros(POINTS, np.int64),
        make_walk(),
    )


def misfit(x: Array, t: Array, y: Array, u: Array, h: float, parameter: int) -> tuple[float, float]:
    """The way from point x to point y, h apart in the parameter, and what of it the tangents t and u do not explain."""
    way, defect = 0.0, 0.0
    for m in range(7):
        if m != parameter:
            d = wrapped(y[m] - x[m])
            way = max(way, abs(d))
            defect = max(defect, abs(d - 0.5 * h * (t[m] / t[parameter] + u[m] / u[parameter])))
    return way, defect


def explained(x: Array, t: Array, y: Array, u: Array, h: float, parameter: int) -> bool:
    """Whether the tangents leave no doubt that one curve leads from point x to point y."""
    way, defect = misfit(x, t, y, u, h, parameter)
    return defect <= DIRECT_REST + DIRECT_DEFECT * way and way <= DIRECT_WAY


def bridge(
    chain: Array,
    T: Array,
    seven: SevenJoints,
    label: int,
    ends: tuple[Array, Array, Array, Array],
    sign: float,
    low: float,
    high: float,
    traced: Array,
    first: int,
    walk: Walk,
) -> int:
    """Fill traced from row first with closed-form points between two slices, and the point of the second one.

    Args:
        chain: (8, 3, 4).
        T: (4, 4) target.
        seven: the arm.
        label: row of `solve_at_q3`.
        ends: point and tangent at both ends.
        sign: of the determinant at both ends.
        low: joint 3 at the first slice [rad].
        high: joint 3 at the second one [rad].
        traced: see `follow`.
        first: see above.
        walk: workspace.

    Returns:
        How many rows were filled; 0 where the points do not leave it certain that they are on one curve.
    """
    x, t, y, u = ends
    parts = 2
    while parts <= MOST_PARTS and first + parts <= traced.shape[0]:
        h = (high - low) / parts
        certain = True
        for n in range(1, parts + 1):
            row = traced[first + n - 1]
            if n < parts:
                solve_rows_at_q3(chain, seven.arm, T, low + n * h, label, label + 1, seven.rows)
                if math.isnan(seven.rows[label, 0]):
                    return 0
                for j in range(7):
                    walk.border[j] = 1.0 if j == 2 else 0.0
                if tangent7(chain, T, seven.rows[label], walk.border, walk.ty, walk.system) != sign:
                    return 0
                record(traced, first + n - 1, seven.rows[label], walk.ty, 0.0)
            else:
                record(traced, first + n - 1, y, u, 0.0)
            before = traced[first + n - 2]
            if not (
                explained(x, t, row[0:7], row[7:14], h, 2)
                if n == 1
                else explained(before[0:7], before[7:14], row[0:7], row[7:14], h, 2)
            ):
                certain = False
                break
        if certain:
            return parts
        parts *= 2
    return 0


def match(slices: Slices, i: int, j: int, shift: float, parameter: int, graph: Graph) -> None:
    """Fill graph.mate: for each point of slice i the point of slice j that certainly continues it, or -1."""
    h = slices.p[j] + shift - slices.p[i]
    for k in range(POINTS):
        graph.mate[k] = -1
        graph.claimed[k] = -1
    for a in range(slices.filled[i]):
        best, second, found, way_found = math.inf, math.inf, -1, 0.0
        for b in range(slices.filled[j]):
            if slices.sign[i, a] != slices.sign[j, b]:
                continue
            x, u = slices.x[j, b], slices.t[j, b]
            way, defect = misfit(slices.x[i, a], slices.t[i, a], x, u, h, parameter)
            if defect < best:
                best, second, found, way_found = defect, best, b, way
            elif defect < second:
                second = defect
        if found < 0 or best > DIRECT_REST + DIRECT_DEFECT * way_found or way_found > DIRECT_WAY:
            continue
        if graph.claimed[found] == -1 and second > SECOND_BEST * best:
            graph.mate[a] = found
            graph.claimed[found] = a
        else:  # two points want the same one: neither is certain
            if graph.claimed[found] >= 0:
                graph.mate[graph.claimed[found]] = -1
            graph.claimed[found] = LOST


def add_link(graph: Graph, made: int, i: int, a: int, s: int, j: int, b: int, r: int, first: int, rows: int) -> int:
    """Link side s of point a in slice i with side r of point b in slice j; returns the number of links."""
    link = graph.links[made]
    link[0], link[1], link[2], link[3], link[4], link[5], link[6], link[7] = i, a, s, j, b, r, first, rows
    graph.side[i, a, s, 0], graph.side[i, a, s, 1] = made, 0
    graph.side[j, b, r, 0], graph.side[j, b, r, 1] = made, 1
    return made + 1


def find_point(slices: Slices, i: int, x: Array, parameter: int) -> int:
    """The point of slice i at x, or -1."""
    for k in range(slices.filled[i]):
        farthest = 0.0
        for m in range(7):
            if m != parameter:
                farthest = max(farthest, abs(wrapped(slices.x[i, k, m] - x[m])))
        if farthest < SAME_POINT:
            return k
    return -1


def link_labelled(
    chain: Array,
    T: Array,
    i: int,
    j: int,
    shift: float,
    made: int,
    used: int,
    seven: SevenJoints,
    slices: Slices,
    graph: Graph,
) -> tuple[int, int]:
    """Link the points of slices i and j of a seven-joint arm that certainly belong together.

    Returns:
        How many links and how many rows of graph.traced there are then.
    """
    low, high = slices.p[i], slices.p[j] + shift
    for a in range(slices.filled[i]):
        for b in range(slices.filled[j]):
            if slices.label[i, a] != slices.label[j, b] or slices.label[i, a] < 0:
                continue
            if slices.sign[i, a] != slices.sign[j, b] or graph.side[i, a, 1, 0] >= 0 or graph.side[j, b, 0, 0] >= 0:
                continue
            x, t, y, u = slices.x[i, a], slices.t[i, a], slices.x[j, b], slices.t[j, b]
            rows = 0
            if not explained(x, t, y, u, high - low, 2):
                rows = bridge(
                    chain, T, seven, slices.label[i, a], (x, t, y, u), slices.sign[i, a], low, high,
                    graph.traced, used, graph.walk,
                )  # fmt: skip
                if rows == 0:
                    continue
            made = add_link(graph, made, i, a, 1, j, b, 0, used, rows)
            used += rows
    return made, used


def link_crossing(i: int, j: int, shift: float, made: int, parameter: int, slices: Slices, graph: Graph) -> int:
    """Link points of slices i and j between which curves pass a straight wrist; returns the number of links.

    There the determinant changes its sign along a curve, and the rows of `solve_at_q3` change places.
    """
    h = slices.p[j] + shift - slices.p[i]
    for a in range(slices.filled[i]):
        for b in range(slices.filled[j]):
            if slices.sign[i, a] == slices.sign[j, b] or graph.side[i, a, 1, 0] >= 0 or graph.side[j, b, 0, 0] >= 0:
                continue
            if explained(slices.x[i, a], slices.t[i, a], slices.x[j, b], slices.t[j, b], h, parameter):
                made = add_link(graph, made, i, a, 1, j, b, 0, 0, 0)
    return made


def join(
    chain: Array, T: Array, n: int, closed: bool, parameter: int, seven: SevenJoints, slices: Slices, graph: Graph
) -> tuple[int, int]:
    """Link every point at both sides.

    Args:
        chain: (8, 3, 4).
        T: (4, 4) target.
        n: number of slices.
        closed: the last slice is followed by the first, one turn on.
        parameter: index of the joint that is the parameter.
        seven: the arm of seven joints.
        slices: the points; one that was missing is added when a curve leads to it.
        graph: filled.

    Returns:
        How many links there are, and how many sides could not be linked.
    """
    for i in range(n):
        for k in range(POINTS):
            for s in range(2):
                graph.side[i, k, s, 0] = OPEN
    made, used, faults = 0, 0, 0
    for i in range(n if closed else n - 1):
        j = i + 1 if i + 1 < n else 0
        if slices.crossed[i] > 0:
            made = link_crossing(i, j, TURN if j == 0 else 0.0, made, parameter, slices, graph)
        if parameter != 6:
            made, used = link_labelled(chain, T, i, j, TURN if j == 0 else 0.0, made, used, seven, slices, graph)
            continue
        match(slices, i, j, TURN if j == 0 else 0.0, parameter, graph)
        for a in range(slices.filled[i]):
            b = graph.mate[a]
            if b >= 0 and graph.side[i, a, 1, 0] == OPEN and graph.side[j, b, 0, 0] == OPEN:
                made = add_link(graph, made, i, a, 1, j, graph.mate[a], 0, 0, 0)
    added = True
    while added:
        added = False
        for i in range(n):
            for s in range(2):
                if not closed and i == (n - 1 if s == 1 else 0):
                    continue
                j, shift = (i + 1, 0.0) if s == 1 else (i - 1, 0.0)
                if j == n:
                    j, shift = 0, TURN
                elif j < 0:
                    j, shift = n - 1, -TURN
                a = 0
                while a < slices.filled[i]:
                    if graph.side[i, a, s, 0] == OPEN:
                        rows, wall = follow(
                            chain, T, slices.x[i, a], slices.t[i, a], parameter,
                            slices.p[i], slices.p[j] + shift, graph.traced, used, graph.walk,
                        )  # fmt: skip
                        e, r = (i, s) if wall == 0 else (j, 1 - s)
                        b, fresh = -1, False
                        if wall >= 0:
                            b, fresh = end_point(chain, T, e, parameter, graph.traced[used + rows - 1], slices, graph)
                        if b < 0 or graph.side[e, b, r, 0] >= 0 or (e == i and b == a) or made == LINKS:
                            graph.side[i, a, s, 0] = LOST
                            faults += 1
                        else:
                            made = add_link(graph, made, i, a, s, e, b, r, used, rows)
                            used += rows
                        added = added or fresh
                    a += 1
    return made, faults


def end_point(
    chain: Array, T: Array, i: int, parameter: int, end: Array, slices: Slices, graph: Graph
) -> tuple[int, bool]:
    """The point of slice i that a followed curve ended at, added if it was missing; and whether it was."""
    b = find_point(slices, i, end, parameter)
    if b >= 0 or slices.filled[i] == POINTS:
        return b, False
    b = int(slices.filled[i])
    for m in range(7):
        slices.x[i, b, m] = end[m]
    slices.x[i, b, parameter] = slices.p[i]
    return (b, True) if add_point(chain, T, parameter, i, slices, graph.walk) else (-1, False)
