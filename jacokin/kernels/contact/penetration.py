"""How deep two convex shapes are in each other: a polytope grown inside their difference (EPA, van den Bergen 2001)."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.contact.shapes import Shapes, support_of_difference
from jacokin.kernels.vector import Vec, cross, dot, minus, norm

#: Corners of the polytope; a round shape's depth is then known to some 1e-5 of its size.
POLYTOPE_ROOM = 96
#: [m] the depth is known this well when growing ends.
DEPTH_TOLERANCE = 1e-7
#: [m] a difference thinner than this has no inside.
THIN = 1e-10
#: [m] a corner must be this far beyond a face to see it.
BEYOND = 1e-13


class Polytope(NamedTuple):
    """A convex polytope with triangles as faces."""

    corners: Array  # (room, 9) difference, point on the first shape, on the second
    faces: NDArray[np.int64]  # (4 room, 3) corners, anticlockwise from outside
    planes: Array  # (4 room, 4) outward normal and distance from the origin
    horizon: NDArray[np.int64]  # (4 room, 2) edges


def make_polytope() -> Polytope:
    """Fresh work arrays."""
    room = 4 * POLYTOPE_ROOM
    return Polytope(
        np.zeros((POLYTOPE_ROOM, 9)),
        np.zeros((room, 3), np.int64),
        np.zeros((room, 4)),
        np.zeros((room, 2), np.int64),
    )


def penetration(
    shapes: Shapes, pair: tuple[int, int], relative: Array, hints: NDArray[np.int64], polytope: Polytope, witness: Array
) -> float:
    """Depth of two cores that overlap [m]: how far the second must move along the normal until they only touch.

    Args:
        shapes: all of them.
        pair: numbers of the two.
        relative: (3, 4) the second shape's frame in the first's.
        hints: (2,) where searches on meshes start.
        polytope: work arrays.
        witness: (3, 3) filled with the normal, and the points on the first and the second, in the first's frame.
    """
    corners, faces, planes, horizon = polytope
    if not first_tetrahedron(shapes, pair, relative, hints, corners, witness):
        return 0.0
    count, used = 4, 0
    for i in range(4):
        j, k, opposite = (i + 1) % 4, (i + 2) % 4, (i + 3) % 4
        used = add_face(polytope, used, i, j, k, opposite)
    while True:
        nearest = 0
        for f in range(1, used):
            if planes[f, 3] < planes[nearest, 3]:
                nearest = f
        normal = (planes[nearest, 0], planes[nearest, 1], planes[nearest, 2])
        if count == POLYTOPE_ROOM:
            break
        height = support_of_difference(shapes, pair, relative, hints, normal, corners[count])
        if height - planes[nearest, 3] <= DEPTH_TOLERANCE:
            break
        w = (corners[count, 0], corners[count, 1], corners[count, 2])
        edges, kept = 0, 0
        for f in range(used):
            if planes[f, 0] * w[0] + planes[f, 1] * w[1] + planes[f, 2] * w[2] - planes[f, 3] > BEYOND:
                for i in range(3):
                    edges = toggle_edge(horizon, edges, faces[f, i], faces[f, (i + 1) % 3])
            else:
                for i in range(3):
                    faces[kept, i] = faces[f, i]
                for i in range(4):
                    planes[kept, i] = planes[f, i]
                kept += 1
        used = kept
        if used + edges > faces.shape[0]:
            break
        for e in range(edges):
            used = add_face(polytope, used, horizon[e, 0], horizon[e, 1], count, -1)
        count += 1
        if used == 0:
            return 0.0
    describe(corners, faces[nearest], normal, witness)
    return max(float(planes[nearest, 3]), 0.0)


def first_tetrahedron(
    shapes: Shapes, pair: tuple[int, int], relative: Array, hints: NDArray[np.int64], corners: Array, witness: Array
) -> bool:
    """Four corners with a volume; False, with the normal, where the difference is flat."""
    for axis in range(3):
        d = (1.0 if axis == 0 else 0.0, 1.0 if axis == 1 else 0.0, 1.0 if axis == 2 else 0.0)
        high = support_of_difference(shapes, pair, relative, hints, d, corners[0])
        low = support_of_difference(shapes, pair, relative, hints, (-d[0], -d[1], -d[2]), corners[1])
        if high + low > THIN:
            break
        if axis == 2:
            return leave_flat(corners, d, witness)
    along = minus(first_three(corners[1]), first_three(corners[0]))
    for turn in range(2):
        other = (0.0, 1.0, 0.0) if abs(along[1]) < abs(along[0]) else (1.0, 0.0, 0.0)
        d = cross(along, other)
        if turn == 1:
            d = cross(along, d)
        d = unit(d)
        if farther_side(shapes, pair, relative, hints, d, corners, 2):
            break
        if turn == 1:
            return leave_flat(corners, d, witness)
    d = unit(cross(along, minus(first_three(corners[2]), first_three(corners[0]))))
    if not farther_side(shapes, pair, relative, hints, d, corners, 3):
        return leave_flat(corners, d, witness)
    return True


def farther_side(
    shapes: Shapes, pair: tuple[int, int], relative: Array, hints: NDArray[np.int64], d: Vec, corners: Array, row: int
) -> bool:
    """Fill a corner with the point farthest from the first corner along or against a direction; False if none is."""
    level = dot(d, first_three(corners[0]))
    up = support_of_difference(shapes, pair, relative, hints, d, corners[row]) - level
    if up > THIN:
        return True
    down = support_of_difference(shapes, pair, relative, hints, (-d[0], -d[1], -d[2]), corners[row]) + level
    return down > THIN


def leave_flat(corners: Array, d: Vec, witness: Array) -> bool:
    """The witness of a difference without an inside."""
    for i in range(3):
        witness[0, i], witness[1, i], witness[2, i] = d[i], corners[0, 3 + i], corners[0, 3 + i]
    return False


def first_three(row: Array) -> Vec:
    """The difference of a corner."""
    return (row[0], row[1], row[2])


def unit(a: Vec) -> Vec:
    """The vector with length one."""
    length = norm(a)
    return (a[0] / length, a[1] / length, a[2] / length)


def add_face(polytope: Polytope, used: int, i: int, j: int, k: int, inner: int) -> int:
    """Add a triangle, turned away from an inner corner if there is one; returns how many there are."""
    corners, faces, planes, _ = polytope
    a, b, c = first_three(corners[i]), first_three(corners[j]), first_three(corners[k])
    n = cross(minus(b, a), minus(c, a))
    length = norm(n)
    if length == 0.0:  # a line: never the nearest face
        n, level = (0.0, 0.0, 0.0), math.inf
    else:
        n = (n[0] / length, n[1] / length, n[2] / length)
        level = dot(n, a)
        if inner >= 0 and dot(n, first_three(corners[inner])) > level:
            n, level, j, k = (-n[0], -n[1], -n[2]), -level, k, j
    faces[used, 0], faces[used, 1], faces[used, 2] = i, j, k
    planes[used, 0], planes[used, 1], planes[used, 2], planes[used, 3] = n[0], n[1], n[2], level
    return used + 1


def toggle_edge(horizon: NDArray[np.int64], count: int, i: int, j: int) -> int:
    """Add an edge of a removed face, or take it out where its other face was removed as well; returns the count."""
    for e in range(count):
        if horizon[e, 0] == j and horizon[e, 1] == i:
            horizon[e, 0], horizon[e, 1] = horizon[count - 1, 0], horizon[count - 1, 1]
            return count - 1
    horizon[count, 0], horizon[count, 1] = i, j
    return count + 1


def describe(corners: Array, face: NDArray[np.int64], normal: Vec, witness: Array) -> None:
    """Normal and points of the face's point nearest to the origin."""
    a, b, c = corners[face[0]], corners[face[1]], corners[face[2]]
    p, q, r = first_three(a), first_three(b), first_three(c)
    u, v, w = dot(normal, cross(q, r)), dot(normal, cross(r, p)), dot(normal, cross(p, q))
    total = u + v + w
    if total == 0.0:
        u, v, w, total = 1.0, 0.0, 0.0, 1.0
    for i in range(3):
        witness[0, i] = normal[i]
        witness[1, i] = (u * a[3 + i] + v * b[3 + i] + w * c[3 + i]) / total
        witness[2, i] = (u * a[6 + i] + v * b[6 + i] + w * c[6 + i]) / total
