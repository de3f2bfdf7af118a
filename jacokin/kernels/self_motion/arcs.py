"""Cutting the curves into arcs along which the parameter rises, each a run of nodes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.self_motion.graph import OPEN, Graph
from jacokin.kernels.self_motion.slices import POINTS, SLICES, Slices, wrapped

#: Nodes and arcs at most.
NODES, ARCS = 16384, 256
#: [rad] of the parameter: beside closed curves that are shorter there may be others as short, between two slices.
SHORT_LOOP = 0.1
#: [rad] ends nearer to each other are one fold.
SAME_FOLD = 1e-6
#: What an arc ends at: a fold, an end of the range, itself (a closed curve), or where the curve was lost.
FOLD_END, RANGE_END, SEAM_END, LOST_END = 0, 1, 2, 3


class Arcs(NamedTuple):
    """Arcs as runs of nodes."""

    nodes: Array  # (NODES, 14) point, unwrapped along its arc, and tangent with dp/ds >= 0
    arcs: NDArray[np.int64]  # (ARCS, 4) first node, end node, left end, right end
    visited: NDArray[np.int64]  # (SLICES, POINTS)
    size: NDArray[np.int64]  # (2,) nodes, arcs


def make_arcs() -> Arcs:
    """Fresh arrays."""
    return Arcs(
        np.empty((NODES, 14)),
        np.zeros((ARCS, 4), np.int64),
        np.zeros((SLICES, POINTS), np.int64),
        np.zeros(2, np.int64),
    )


def emit(arcs: Arcs, start: int, x: Array, t: Array, parameter: int) -> None:
    """Append a node to the arc that began at node start."""
    m = arcs.size[0]
    if m == NODES:
        return
    flip = -1.0 if t[parameter] < 0.0 else 1.0
    for j in range(7):
        arcs.nodes[m, j] = x[j] if m == start else arcs.nodes[m - 1, j] + wrapped(x[j] - arcs.nodes[m - 1, j])
        arcs.nodes[m, 7 + j] = flip * t[j]
    arcs.size[0] = m + 1


def lead_along(t: Array, a: Array, b: Array) -> None:
    """Turn a tangent round if it leads from node b to node a."""
    along = 0.0
    for j in range(7):
        along += t[j] * (b[j] - a[j])
    if along < 0.0:
        for j in range(7):
            t[j] = -t[j]


def close_arc(arcs: Arcs, start: int, left: int, right: int) -> None:
    """Enter the nodes since start as an arc."""
    n, end = arcs.size[1], arcs.size[0]
    if n < ARCS and end - start >= 2:
        # At a fold dp/ds is rounding, and its sign tells nothing.
        lead_along(arcs.nodes[start, 7:14], arcs.nodes[start], arcs.nodes[start + 1])
        lead_along(arcs.nodes[end - 1, 7:14], arcs.nodes[end - 2], arcs.nodes[end - 1])
        arcs.arcs[n, 0], arcs.arcs[n, 1], arcs.arcs[n, 2], arcs.arcs[n, 3] = start, end, left, right
        arcs.size[1] = n + 1


def begins_at_fold(graph: Graph, i: int, k: int, parameter: int, arcs: Arcs) -> bool:
    """Emit the nodes from the fold below point k of slice i up to the point; False where there is no fold."""
    link = graph.side[i, k, 0, 0]
    if link < 0 or graph.links[link, 7] == 0:
        return False
    first, rows = graph.links[link, 6], graph.links[link, 7]
    from_here = graph.side[i, k, 0, 1] == 0
    fold = -1
    for n in range(rows):
        r = n if from_here else rows - 1 - n
        if fold < 0 and graph.traced[first + r, 14] == 1.0:
            fold = r
    if fold < 0:
        return False
    start = arcs.size[0]
    for n in range(fold + 1 if from_here else rows - 1 - fold):
        r = first + (fold - n if from_here else fold + n)
        emit(arcs, start, graph.traced[r, 0:7], graph.traced[r, 7:14], parameter)
    return True


def walk_up(slices: Slices, graph: Graph, i: int, k: int, start: int, parameter: int, arcs: Arcs) -> int:
    """Emit the nodes from point k of slice i upwards to the end of its arc; returns what it ends at."""
    while True:
        emit(arcs, start, slices.x[i, k], slices.t[i, k], parameter)
        if arcs.visited[i, k] > 0:
            return SEAM_END
        arcs.visited[i, k] = 1
        link = graph.side[i, k, 1, 0]
        if link < 0:
            return RANGE_END if link == OPEN else LOST_END
        first, rows = graph.links[link, 6], graph.links[link, 7]
        from_here = graph.side[i, k, 1, 1] == 0
        for n in range(rows - 1):  # the last row is the point at the other end
            r = first + (n if from_here else rows - 2 - n)
            emit(arcs, start, graph.traced[r, 0:7], graph.traced[r, 7:14], parameter)
            if graph.traced[r, 14] == 1.0:
                return FOLD_END
        end = 3 if from_here else 0
        i, k = graph.links[link, end], graph.links[link, end + 1]


def assemble(n: int, closed: bool, parameter: int, made: int, slices: Slices, graph: Graph, arcs: Arcs) -> None:
    """Fill arcs from n joined slices: what begins at a fold, then at the range's end, then closed curves."""
    arcs.size[0], arcs.size[1] = 0, 0
    for i in range(n):
        for k in range(slices.filled[i]):
            arcs.visited[i, k] = 0
    for phase in range(3):
        for i in range(n if phase != 1 else 1):
            for k in range(slices.filled[i]):
                if arcs.visited[i, k] > 0:
                    continue
                start, left = arcs.size[0], SEAM_END
                if phase == 0:
                    left = FOLD_END
                    if not begins_at_fold(graph, i, k, parameter, arcs):
                        if graph.side[i, k, 0, 0] >= OPEN:
                            continue
                        left = LOST_END
                elif phase == 1:
                    if closed:
                        continue
                    left = RANGE_END
                close_arc(arcs, start, left, walk_up(slices, graph, i, k, start, parameter, arcs))
    for link in range(made):
        add_arcs_between_folds(graph, link, parameter, arcs)


def add_arcs_between_folds(graph: Graph, link: int, parameter: int, arcs: Arcs) -> None:
    """The arcs of a link that lie between two folds, and so between two slices."""
    first, rows = graph.links[link, 6], graph.links[link, 7]
    last = -1
    for n in range(rows):
        if graph.traced[first + n, 14] == 1.0:
            if last >= 0:
                start = arcs.size[0]
                rises = graph.traced[first + n, parameter] > graph.traced[first + last, parameter]
                for m in range(n - last + 1):
                    r = first + (last + m if rises else n - m)
                    emit(arcs, start, graph.traced[r, 0:7], graph.traced[r, 7:14], parameter)
                close_arc(arcs, start, FOLD_END, FOLD_END)
            last = n


def has_short_loop(arcs: Arcs, parameter: int) -> bool:
    """Whether two short arcs lead from one fold to another and back: a small closed curve."""
    for a in range(arcs.size[1]):
        first, last = arcs.arcs[a, 0], arcs.arcs[a, 1] - 1
        length = arcs.nodes[last, parameter] - arcs.nodes[first, parameter]
        if arcs.arcs[a, 2] != FOLD_END or arcs.arcs[a, 3] != FOLD_END or length >= SHORT_LOOP:
            continue
        for b in range(a):
            if is_same_point(arcs.nodes[first], arcs.nodes[arcs.arcs[b, 0]]) and is_same_point(
                arcs.nodes[last], arcs.nodes[arcs.arcs[b, 1] - 1]
            ):
                return True
    return False


def is_same_point(x: Array, y: Array) -> bool:
    """Whether two nodes are one point."""
    farthest = 0.0
    for j in range(7):
        farthest = max(farthest, abs(wrapped(x[j] - y[j])))
    return farthest <= SAME_FOLD
