"""The entry point: points sorted into the tree of boxes that `cloud` looks into.

Each node's points are halved along the longest side of the box around them, by Hoare's selection (1961).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from jacokin.arrays import Array
from jacokin.kernels.contact.shapes import NODE_HALF, NODE_NUMBERS, NODE_RADIUS

#: Points in a leaf at most: fewer make more boxes to look at, more make more points.
LEAF = 16


class CloudTree(NamedTuple):
    """Points and the boxes around them, a call's work."""

    points: Array  # (n, 3) reordered: those of a leaf are together [m]
    nodes: Array  # (2 leaves - 1, 7) filled, see `shapes`; a power of two of leaves


def make_cloud_tree(points: Array | None = None) -> CloudTree:
    """A tree yet to be built, of points (n, 3), which are copied."""
    given = np.zeros((0, 3)) if points is None else np.array(points, order="C")
    leaves = 1 << (-(-len(given) // LEAF) - 1).bit_length() if len(given) else 0
    return CloudTree(given, np.zeros((max(2 * leaves - 1, 0), NODE_NUMBERS)))


def build_cloud(tree: CloudTree) -> int:
    """Fill the nodes, level by level; returns how many there are."""
    points, nodes = tree.points, tree.nodes
    count, total, width = points.shape[0], nodes.shape[0], 1
    for node in range(total):
        if node >= 2 * width - 1:
            width *= 2
        part = node - (width - 1)
        first, last = count * part // width, count * (part + 1) // width
        axis = bound_points(points, first, last, nodes[node])
        if 2 * node + 1 < total:
            select(points, first, last, count * (2 * part + 1) // (2 * width), axis)
    return int(total)


def bound_points(points: Array, first: int, last: int, node: Array) -> int:
    """Fill a node with the box around some points, one at least; returns the axis of its longest side."""
    x, y, z = points[first, 0], points[first, 1], points[first, 2]
    low, high = (x, y, z), (x, y, z)
    for k in range(first + 1, last):
        x, y, z = points[k, 0], points[k, 1], points[k, 2]
        low = (min(low[0], x), min(low[1], y), min(low[2], z))
        high = (max(high[0], x), max(high[1], y), max(high[2], z))
    longest, square = 0, 0.0
    for axis in range(3):
        half = 0.5 * (high[axis] - low[axis])
        node[axis], node[NODE_HALF + axis] = 0.5 * (low[axis] + high[axis]), half
        square += half * half
        if half > node[NODE_HALF + longest]:
            longest = axis
    node[NODE_RADIUS] = math.sqrt(square)
    return longest


def select(points: Array, first: int, last: int, middle: int, axis: int) -> None:
    """Reorder points so that none before the middle is farther along an axis than any from there on."""
    low, high = first, last - 1
    while low < high:
        pivot = points[(low + high) // 2, axis]
        i, j = low, high
        while i <= j:
            while points[i, axis] < pivot:
                i += 1
            while pivot < points[j, axis]:
                j -= 1
            if i <= j:
                for column in range(3):
                    points[i, column], points[j, column] = points[j, column], points[i, column]
                i, j = i + 1, j - 1
        if j < middle:
            low = i
        if middle < i:
            high = j
