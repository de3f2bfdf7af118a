"""Obstacles in a tree of boxes: which of them a sphere can come near to."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.contact.shapes import box_distance
from jacokin.kernels.vector import Vec

#: Levels of a tree that halves what it holds each time, and one more.
DEEPEST = 64


class Tree(NamedTuple):
    """Obstacles that stand still."""

    boxes: Array  # (nodes, 6) centres and half sizes of the nodes, along the axes of the world [m]
    children: NDArray[np.int64]  # (nodes, 2) the two nodes inside; for one obstacle -1 and the number of its shape
    planes: NDArray[np.int64]  # (planes,) numbers of the shapes that have no end


def reaches_node(tree: Tree, node: int, p: Vec, reach: float) -> bool:
    """Whether a point comes as near to the box of a node as a reach, which is not negative [m]."""
    box = tree.boxes[node]
    u = max(abs(p[0] - box[0]) - box[3], 0.0)
    v = max(abs(p[1] - box[1]) - box[4], 0.0)
    w = max(abs(p[2] - box[2]) - box[5], 0.0)
    return bool(u * u + v * v + w * w <= reach * reach)


def node_bound(tree: Tree, node: int, p: Vec) -> float:
    """A lower bound of the distance from a point to what a node holds, negative inside of it [m]."""
    box = tree.boxes[node]
    return box_distance(abs(p[0] - box[0]) - box[3], abs(p[1] - box[1]) - box[4], abs(p[2] - box[2]) - box[5])
