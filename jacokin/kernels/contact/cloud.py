"""How far two shapes are apart, one of which may be a cloud: points with one margin around each.

A tree of boxes holds the points of a cloud (`cloud_tree`). Node i holds what nodes 2 i + 1 and 2 i + 2 hold, and the
nodes of the last level, the leaves, hold points that follow each other, equally many but for one. A distance is the
least of the points', and only nodes that can hold a nearer one than was found are looked into.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.contact.separation import OVERLAP, SeparationWork, separation
from jacokin.kernels.contact.shapes import (
    BOX,
    CLOUD,
    CYLINDER,
    ELLIPSOID,
    FIRST_NODE,
    FIRST_VERTEX,
    KIND,
    LAST_VERTEX,
    LEAVES,
    MARGIN,
    MESH,
    NODE_HALF,
    NODE_RADIUS,
    POINT,
    RADIUS,
    SEGMENT,
    SIZE,
    Shapes,
    box_distance,
    core_bound,
)
from jacokin.kernels.vector import Vec


def shape_separation(
    shapes: Shapes, pair: tuple[int, int], work: SeparationWork, enough: float, little: float, rough: float, deep: bool
) -> float:
    """Distance of two shapes, one of which may be a cloud; arguments and returns as of `separation`.

    Of a cloud, and of a sphere and what `core_bound` is exact for, a distance may be exact where it need not be, and
    witnesses are filled where it is to be `deep`.
    """
    a, b = pair
    if shapes.integers[b, KIND] == CLOUD:
        return cloud_separation(shapes, (a, b), work, enough, little, deep)
    if shapes.integers[a, KIND] == CLOUD:
        invert(work.relative)
        found = cloud_separation(shapes, (b, a), work, enough, little, deep)
        invert(work.relative)
        exchange(work)
        return found
    if not deep and shapes.integers[a, KIND] == POINT and shapes.integers[b, KIND] in (POINT, SEGMENT, BOX, CYLINDER):
        r = work.relative
        x = -(r[0, 0] * r[0, 3] + r[1, 0] * r[1, 3] + r[2, 0] * r[2, 3])
        y = -(r[0, 1] * r[0, 3] + r[1, 1] * r[1, 3] + r[2, 1] * r[2, 3])
        z = -(r[0, 2] * r[0, 3] + r[1, 2] * r[1, 3] + r[2, 2] * r[2, 3])
        point_normal(shapes, b, (x, y, z), r, work.witness[0])
        return float(core_bound(shapes, b, x, y, z) - shapes.numbers[a, MARGIN])
    return separation(shapes, pair, work, enough, little, rough, deep)


def point_normal(shapes: Shapes, b: int, p: Vec, relative: Array, normal: Array) -> None:
    """Fill the normal from a point to a point, segment, box or cylinder, in the point's axes; zero inside of that.

    The point is in the axes of the shape, and `relative` (3, 4) the shape's frame in the point's.
    """
    row = shapes.numbers[b]
    x, y, z = p[0], p[1], p[2]
    if shapes.integers[b, KIND] == CYLINDER:
        far = math.sqrt(x * x + y * y)
        beyond = max(far - row[SIZE], 0.0) / max(far, OVERLAP)
        x, y = beyond * x, beyond * y
    else:
        x = math.copysign(max(abs(x) - row[SIZE], 0.0), x)
        y = math.copysign(max(abs(y) - row[SIZE + 1], 0.0), y)
    z = math.copysign(max(abs(z) - row[SIZE + 2], 0.0), z)
    length = max(math.sqrt(x * x + y * y + z * z), OVERLAP)
    for i in range(3):
        normal[i] = -(relative[i, 0] * x + relative[i, 1] * y + relative[i, 2] * z) / length


def cloud_separation(
    shapes: Shapes, pair: tuple[int, int], work: SeparationWork, enough: float, little: float, deep: bool
) -> float:
    """Distance of a convex shape, which is no plane, and a cloud, the second; arguments as of `shape_separation`."""
    b = pair[1]
    r, stack, bounds = work.relative, work.stack, work.bounds
    place = (r[0, 3], r[1, 3], r[2, 3])
    first, count = shapes.integers[b, FIRST_VERTEX], shapes.integers[b, LAST_VERTEX] - shapes.integers[b, FIRST_VERTEX]
    root, leaves = shapes.integers[b, FIRST_NODE], shapes.integers[b, LEAVES]
    origin = (
        -(r[0, 0] * place[0] + r[1, 0] * place[1] + r[2, 0] * place[2]),
        -(r[0, 1] * place[0] + r[1, 1] * place[1] + r[2, 1] * place[2]),
        -(r[0, 2] * place[0] + r[1, 2] * place[1] + r[2, 2] * place[2]),
    )
    least, beyond, nearest = math.inf, math.inf, -1
    stack[0], bounds[0], size = 0, node_separation(shapes, pair, work, root, place, origin, enough), 1
    while size > 0:
        size -= 1
        node, bound = stack[size], bounds[size]
        if bound > enough or bound >= least:
            beyond = min(beyond, bound)
            continue
        if node < leaves - 1:
            inner = 2 * node + 1
            most = min(enough, least)
            left = node_separation(shapes, pair, work, root + inner, place, origin, most)
            right = node_separation(shapes, pair, work, root + inner + 1, place, origin, most)
            near = 1 if left < right else 0  # the nearer one is looked into first
            stack[size + near], bounds[size + near] = inner, left
            stack[size + 1 - near], bounds[size + 1 - near] = inner + 1, right
            size += 2
            continue
        leaf = node - (leaves - 1)
        for k in range(first + count * leaf // leaves, first + count * (leaf + 1) // leaves):
            distance = point_separation(shapes, pair, work, k, place, min(enough, least), deep)
            if distance < least:
                least, nearest = distance, k
        if least <= little:
            size = 0
    if deep and nearest >= 0 and least <= enough:
        put(r, turned(r, shapes.points[nearest], place))
        separation(shapes, pair, work, math.inf, -math.inf, math.inf, True)
    put(r, place)
    return float(min(least, beyond))


def find_points(
    shapes: Shapes, pair: NDArray[np.int64], work: SeparationWork, within: float, found: NDArray[np.int64]
) -> int:
    """Fill which points of a cloud, the second, are within a distance [m] of a convex shape, which is no plane.

    Returns:
        How many there are; more than there is room for if they are too many.
    """
    a, b = pair[0], pair[1]
    r, stack = work.relative, work.stack
    place = (r[0, 3], r[1, 3], r[2, 3])
    first, total = shapes.integers[b, FIRST_VERTEX], shapes.integers[b, LAST_VERTEX] - shapes.integers[b, FIRST_VERTEX]
    root, leaves = shapes.integers[b, FIRST_NODE], shapes.integers[b, LEAVES]
    origin = (
        -(r[0, 0] * place[0] + r[1, 0] * place[1] + r[2, 0] * place[2]),
        -(r[0, 1] * place[0] + r[1, 1] * place[1] + r[2, 1] * place[2]),
        -(r[0, 2] * place[0] + r[1, 2] * place[1] + r[2, 2] * place[2]),
    )
    stack[0], size, count = 0, 1, 0
    while size > 0 and count <= len(found):
        size -= 1
        node = stack[size]
        if node_separation(shapes, (a, b), work, root + node, place, origin, within) > within:
            continue
        if node < leaves - 1:
            stack[size], stack[size + 1] = 2 * node + 1, 2 * node + 2
            size += 2
            continue
        leaf = node - (leaves - 1)
        for k in range(first + total * leaf // leaves, first + total * (leaf + 1) // leaves):
            if point_separation(shapes, (a, b), work, k, place, within, False) <= within:
                if count < len(found):
                    found[count] = k
                count += 1
    put(r, place)
    return count


def separate_point(shapes: Shapes, pair: NDArray[np.int64], work: SeparationWork, k: int) -> float:
    """The distance [m] of a convex shape and point k of a cloud, the second, with witnesses."""
    r = work.relative
    place = (r[0, 3], r[1, 3], r[2, 3])
    put(r, turned(r, shapes.points[k], place))
    distance = separation(shapes, (pair[0], pair[1]), work, math.inf, -math.inf, math.inf, True)
    put(r, place)
    return distance


def node_separation(
    shapes: Shapes, pair: tuple[int, int], work: SeparationWork, node: int, place: Vec, origin: Vec, enough: float
) -> float:
    """A lower bound of the distance to what a node holds, found with no more work than to show that it is enough [m].

    Args:
        shapes: all of them.
        pair: the convex shape and the cloud.
        work: the turn from the cloud's axes to those of the shape.
        node: number of the node.
        place: of the cloud's frame in the shape's.
        origin: of the shape's frame in the cloud's.
        enough: [m].
    """
    a, b = pair
    box, margin = shapes.nodes[node], shapes.numbers[b, MARGIN]
    bound = box_distance(
        abs(origin[0] - box[0]) - box[NODE_HALF],
        abs(origin[1] - box[1]) - box[NODE_HALF + 1],
        abs(origin[2] - box[2]) - box[NODE_HALF + 2],
    )
    bound -= shapes.numbers[a, RADIUS] + margin
    if bound > enough:
        return float(bound)
    p = turned(work.relative, box, place)
    around = box[NODE_RADIUS] + margin
    bound = max(bound, core_bound(shapes, a, p[0], p[1], p[2]) - around)
    if bound > enough or shapes.integers[a, KIND] not in (ELLIPSOID, MESH):
        return float(bound)
    put(work.relative, p)
    core = separation(shapes, pair, work, enough + box[NODE_RADIUS], -math.inf, math.inf, False)
    if core + margin + shapes.numbers[a, MARGIN] > 0.0:  # else the centre is inside, however deep
        bound = max(bound, core - box[NODE_RADIUS])
    return float(bound)


def point_separation(
    shapes: Shapes, pair: tuple[int, int], work: SeparationWork, k: int, place: Vec, enough: float, deep: bool
) -> float:
    """Distance to one point of a cloud, or a lower bound larger than `enough` [m]; arguments as above."""
    a, b = pair
    p = turned(work.relative, shapes.points[k], place)
    bound = core_bound(shapes, a, p[0], p[1], p[2]) - shapes.numbers[b, MARGIN]
    if bound > enough or shapes.integers[a, KIND] not in (ELLIPSOID, MESH):
        return float(bound)
    put(work.relative, p)
    return separation(shapes, pair, work, enough, -math.inf, math.inf, deep)


def turned(frame: Array, p: Array, place: Vec) -> Vec:
    """A point turned as a frame (3, 4) is, and moved."""
    return (
        frame[0, 0] * p[0] + frame[0, 1] * p[1] + frame[0, 2] * p[2] + place[0],
        frame[1, 0] * p[0] + frame[1, 1] * p[1] + frame[1, 2] * p[2] + place[1],
        frame[2, 0] * p[0] + frame[2, 1] * p[1] + frame[2, 2] * p[2] + place[2],
    )


def put(frame: Array, p: Vec) -> None:
    """Set the place of a frame (3, 4)."""
    frame[0, 3], frame[1, 3], frame[2, 3] = p[0], p[1], p[2]


def invert(frame: Array) -> None:
    """Invert a frame (3, 4) in place."""
    x, y, z = frame[0, 3], frame[1, 3], frame[2, 3]
    for i in range(3):
        for j in range(i):
            frame[i, j], frame[j, i] = frame[j, i], frame[i, j]
    for i in range(3):
        frame[i, 3] = -(frame[i, 0] * x + frame[i, 1] * y + frame[i, 2] * z)


def exchange(work: SeparationWork) -> None:
    """Turn witnesses in the frame of the second shape, from it to the first, into those that are asked for."""
    r, witness = work.relative, work.witness
    place = (r[0, 3], r[1, 3], r[2, 3])
    normal = turned(r, witness[0], (0.0, 0.0, 0.0))
    second, first = turned(r, witness[1], place), turned(r, witness[2], place)
    for i in range(3):
        witness[0, i], witness[1, i], witness[2, i] = -normal[i], first[i], second[i]
