"""Shapes as the kernels see them: rows of numbers, their farthest points, and bounds on distances to them.

A shape is a core and a margin around it: a sphere is a point with a margin, a capsule a segment with one. All are
convex but clouds, which are many points with one margin (`cloud`).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.vector import Vec

#: What a core is. Half sizes along x, y, z say how large: all zero for a point, (0, 0, h) for a segment, (r, r, h) for
#: a cylinder, those of its bounding box for a mesh and a cloud. A plane is z = 0, and everything below it is solid.
POINT, SEGMENT, BOX, CYLINDER, ELLIPSOID, MESH, PLANE, CLOUD = range(8)

#: Columns of a row of numbers: rotation and position in the link's frame as (3, 4), half sizes, margin, and a sphere
#: around the shape (its centre in the link's frame, its radius). The centre is the shape's origin, but that of a cloud
#: is the middle of its bounding box.
SIZE, MARGIN, CENTRE, RADIUS, SHAPE_NUMBERS = 12, 15, 16, 19, 20
#: Columns of a row of integers: what it is, the link that carries it (0 is the base, an obstacle's comes
#: after the last), where its vertices are, or its points, and of a cloud the first node and how many leaves there are.
KIND, LINK, FIRST_VERTEX, LAST_VERTEX, FIRST_NODE, LEAVES, SHAPE_INTEGERS = range(7)
#: Columns of a node of a cloud: centre and half sizes of a box around its points, and how far its corners
#: are from the centre.
NODE_HALF, NODE_RADIUS, NODE_NUMBERS = 3, 6, 7


class Shapes(NamedTuple):
    """The shapes of an arm, and after them its obstacles."""

    numbers: Array  # (n, 20) [m]
    integers: NDArray[np.int64]  # (n, 6)
    vertices: Array  # (m, 3) of the hulls of meshes, in the frame of their shape [m]
    first_edge: NDArray[np.int64]  # (m + 1,) where a vertex's neighbours begin
    neighbours: NDArray[np.int64]  # vertices at the other end of the hulls' edges
    points: Array  # (k, 3) of clouds, in the frame of their shape, those of a leaf together [m]
    nodes: Array  # (l, 7) of clouds, see `cloud` [m]


def core_support(shapes: Shapes, i: int, x: float, y: float, z: float, hint: int) -> tuple[Vec, int]:
    """The point of a core that is farthest in a direction, in the shape's frame.

    Args:
        shapes: all of them.
        i: which one.
        x: first coordinate of the direction, of any length, in the shape's frame.
        y: second.
        z: third.
        hint: vertex of a mesh where the search starts; the last answer is a good one.

    Returns:
        The point [m], and the vertex that it is.
    """
    kind, size = shapes.integers[i, KIND], shapes.numbers[i]
    if kind in (POINT, CLOUD):  # one point of a cloud at a time is measured, and the frame put there
        return (0.0, 0.0, 0.0), hint
    if kind == SEGMENT:
        return (0.0, 0.0, math.copysign(size[SIZE + 2], z)), hint
    if kind == BOX:
        return (math.copysign(size[SIZE], x), math.copysign(size[SIZE + 1], y), math.copysign(size[SIZE + 2], z)), hint
    if kind == CYLINDER:
        across = math.sqrt(x * x + y * y)
        part = size[SIZE] / across if across > 0.0 else 0.0
        return (part * x, part * y, math.copysign(size[SIZE + 2], z)), hint
    if kind == ELLIPSOID:
        u, v, w = size[SIZE] * x, size[SIZE + 1] * y, size[SIZE + 2] * z
        length = math.sqrt(u * u + v * v + w * w)
        part = 1.0 / length if length > 0.0 else 0.0
        return (part * size[SIZE] * u, part * size[SIZE + 1] * v, part * size[SIZE + 2] * w), hint
    return farthest_vertex(shapes, hint, x, y, z)


def farthest_vertex(shapes: Shapes, start: int, x: float, y: float, z: float) -> tuple[Vec, int]:
    """Walk along the edges of a hull as long as that leads farther; on a convex hull this finds the farthest vertex."""
    vertices = shapes.vertices
    best = start
    height = x * vertices[start, 0] + y * vertices[start, 1] + z * vertices[start, 2]
    walking = True
    while walking:
        walking = False
        here = best
        for k in range(shapes.first_edge[here], shapes.first_edge[here + 1]):
            j = shapes.neighbours[k]
            other = x * vertices[j, 0] + y * vertices[j, 1] + z * vertices[j, 2]
            if other > height:
                best, height, walking = j, other, True
    return (vertices[best, 0], vertices[best, 1], vertices[best, 2]), best


def point_bound(shapes: Shapes, i: int, p: Vec) -> float:
    """A lower bound of the distance from a point of its link's frame to a shape, negative inside of it [m]."""
    row = shapes.numbers[i]
    d0, d1, d2 = p[0] - row[CENTRE], p[1] - row[CENTRE + 1], p[2] - row[CENTRE + 2]
    z = row[2] * d0 + row[6] * d1 + row[10] * d2
    if shapes.integers[i, KIND] == PLANE:
        return float(z)
    x = row[0] * d0 + row[4] * d1 + row[8] * d2
    y = row[1] * d0 + row[5] * d1 + row[9] * d2
    return core_bound(shapes, i, x, y, z)


def core_bound(shapes: Shapes, i: int, x: float, y: float, z: float) -> float:
    """A lower bound of the distance from a point to a shape with an end, in the axes of the shape and from its centre.

    It is exact for a point, a segment, a box and a cylinder, inside of them too.
    """
    row = shapes.numbers[i]
    above = abs(z) - row[SIZE + 2]
    if shapes.integers[i, KIND] == CYLINDER:
        return box_distance(math.sqrt(x * x + y * y) - row[SIZE], above, -math.inf)
    return float(box_distance(abs(x) - row[SIZE], abs(y) - row[SIZE + 1], above) - row[MARGIN])


def support_of_difference(
    shapes: Shapes, pair: tuple[int, int], relative: Array, hints: NDArray[np.int64], d: Vec, found: Array
) -> float:
    """The point of the first core minus the second that is farthest in a direction.

    Args:
        shapes: all of them.
        pair: numbers of the two.
        relative: (3, 4) the second shape's frame in the first's.
        hints: (2,) vertices where the last search ended; changed.
        d: direction in the first's frame, of any length.
        found: (9,) filled with the difference, the point on the first and that on the second, in the first's frame.

    Returns:
        How far along the direction the difference is.
    """
    a, b = pair
    r = relative
    on_a, hints[0] = core_support(shapes, a, d[0], d[1], d[2], hints[0])
    x = -(r[0, 0] * d[0] + r[1, 0] * d[1] + r[2, 0] * d[2])
    y = -(r[0, 1] * d[0] + r[1, 1] * d[1] + r[2, 1] * d[2])
    z = -(r[0, 2] * d[0] + r[1, 2] * d[1] + r[2, 2] * d[2])
    p, hints[1] = core_support(shapes, b, x, y, z, hints[1])
    for i in range(3):
        there = r[i, 0] * p[0] + r[i, 1] * p[1] + r[i, 2] * p[2] + r[i, 3]
        found[i] = on_a[i] - there
        found[3 + i] = on_a[i]
        found[6 + i] = there
    return float(d[0] * found[0] + d[1] * found[1] + d[2] * found[2])


def box_distance(u: float, v: float, w: float) -> float:
    """Distance to a box from how far a point is beyond its faces along each axis; negative inside."""
    most = max(u, max(v, w))
    if most <= 0.0:
        return most
    u, v, w = max(u, 0.0), max(v, 0.0), max(w, 0.0)
    return math.sqrt(u * u + v * v + w * w)
