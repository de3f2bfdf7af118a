"""The entry point: rows of simple shapes, and obstacles sorted into the tree of boxes that `tree` looks into.

Each node's obstacles are halved along the longest side of their centres, by Hoare's selection (1961).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.contact.shapes import (
    BOX,
    CENTRE,
    CLOUD,
    CYLINDER,
    ELLIPSOID,
    MARGIN,
    MESH,
    PLANE,
    POINT,
    RADIUS,
    SEGMENT,
    SHAPE_NUMBERS,
    SIZE,
)
from jacokin.kernels.contact.tree import Tree


class WorldWork(NamedTuple):
    """What a call reads and fills."""

    cores: NDArray[np.int64]  # (n,) what each shape is
    sizes: Array  # (n, 3) radii and half lengths as in MJCF [m]
    numbers: Array  # (n, 20) see `shapes`: placements are given, and rows of meshes and clouds; the rest is filled
    order: NDArray[np.int64]  # (m,) which of them are in the tree; reordered: those of a node are together
    bounds: Array  # (n, 6) filled: lowest and highest coordinates [m]
    spans: NDArray[np.int64]  # (nodes, 2) filled: where the shapes of each node begin and end
    tree: Tree  # filled, but for the planes


def make_world_work(count: int = 0, inside: NDArray[np.int64] | None = None) -> WorldWork:
    """Work arrays for so many shapes, and the numbers of those that are in the tree, which are copied."""
    order = np.zeros(0, np.int64) if inside is None else np.array(inside, np.int64)
    nodes = max(2 * len(order) - 1, 0)
    return WorldWork(
        np.zeros(count, np.int64),
        np.zeros((count, 3)),
        np.zeros((count, SHAPE_NUMBERS)),
        order,
        np.zeros((count, 6)),
        np.zeros((nodes, 2), np.int64),
        Tree(np.zeros((nodes, 6)), np.zeros((nodes, 2), np.int64), np.zeros(0, np.int64)),
    )


def build_world(work: WorldWork) -> int:
    """Fill rows and nodes, a level of the tree after another; returns how many nodes there are."""
    for i in range(len(work.cores)):
        if work.cores[i] not in (MESH, CLOUD):
            fill_row(work.numbers[i], work.cores[i], work.sizes[i])
        bound_shape(work.numbers[i], work.bounds[i])
    order, spans, boxes, children = work.order, work.spans, work.tree.boxes, work.tree.children
    total, made = boxes.shape[0], 1
    if total > 0:
        spans[0, 0], spans[0, 1] = 0, len(order)
    for node in range(total):
        first, last = spans[node, 0], spans[node, 1]
        axis = bound_all(work.bounds, order, first, last, boxes[node])
        if last - first == 1:
            children[node, 0], children[node, 1] = -1, order[first]
            continue
        middle = first + (last - first) // 2
        halve(work.bounds, order, first, last, middle, axis)
        for side in range(2):
            children[node, side] = made + side
        spans[made, 0], spans[made, 1], spans[made + 1, 0], spans[made + 1, 1] = first, middle, middle, last
        made += 2
    return int(total)


def fill_row(row: Array, core: int, size: Array) -> None:
    """Fill half sizes, margin and sphere of a shape that is neither mesh nor cloud, from its sizes."""
    x, y, z, margin = 0.0, 0.0, 0.0, 0.0
    if core in (POINT, SEGMENT):
        margin = size[0]
    if core == SEGMENT:
        z = size[1]
    elif core == CYLINDER:
        x, y, z = size[0], size[0], size[1]
    elif core in (BOX, ELLIPSOID):
        x, y, z = size[0], size[1], size[2]
    row[SIZE], row[SIZE + 1], row[SIZE + 2], row[MARGIN] = x, y, z, margin
    for i in range(3):
        row[CENTRE + i] = row[4 * i + 3]
    if core == PLANE:
        row[RADIUS] = math.inf
    elif core == ELLIPSOID:
        row[RADIUS] = max(x, max(y, z))
    else:
        around = 0.0 if core == CYLINDER else y
        row[RADIUS] = margin + math.sqrt(x * x + around * around + z * z)


def bound_shape(row: Array, bound: Array) -> None:
    """Fill lowest and highest coordinates of a shape in the frame of its link [m]; a plane is taken as a point."""
    for i in range(3):
        half = abs(row[4 * i]) * row[SIZE] + abs(row[4 * i + 1]) * row[SIZE + 1] + abs(row[4 * i + 2]) * row[SIZE + 2]
        half += row[MARGIN]
        bound[i], bound[3 + i] = row[CENTRE + i] - half, row[CENTRE + i] + half


def bound_all(bounds: Array, order: NDArray[np.int64], first: int, last: int, box: Array) -> int:
    """Fill centre and half sizes of the box around some shapes; returns the axis along which their centres differ most.

    Twice the centres are compared.
    """
    longest, most = 0, -1.0
    for axis in range(3):
        low, high, nearest, farthest = math.inf, -math.inf, math.inf, -math.inf
        for k in range(first, last):
            least, largest = bounds[order[k], axis], bounds[order[k], 3 + axis]
            low, high = min(low, least), max(high, largest)
            nearest, farthest = min(nearest, least + largest), max(farthest, least + largest)
        box[axis], box[3 + axis] = 0.5 * (low + high), 0.5 * (high - low)
        if farthest - nearest > most:
            longest, most = axis, farthest - nearest
    return longest


def halve(bounds: Array, order: NDArray[np.int64], first: int, last: int, middle: int, axis: int) -> None:
    """Reorder shapes so that those before the middle come before those from there on, see `comes_before`."""
    low, high = first, last - 1
    while low < high:
        pivot = order[(low + high) // 2]
        i, j = low, high
        while i <= j:
            while comes_before(bounds, axis, order[i], pivot):
                i += 1
            while comes_before(bounds, axis, pivot, order[j]):
                j -= 1
            if i <= j:
                order[i], order[j] = order[j], order[i]
                i, j = i + 1, j - 1
        if j < middle:
            low = i
        if middle < i:
            high = j


def comes_before(bounds: Array, axis: int, a: int, b: int) -> bool:
    """Whether the centre of a shape is before another's along an axis, or as far and its number is less."""
    u, v = bounds[a, axis] + bounds[a, 3 + axis], bounds[b, axis] + bounds[b, 3 + axis]
    return bool(u < v or (u == v and a < b))
