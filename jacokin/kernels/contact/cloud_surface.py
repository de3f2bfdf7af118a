"""The surface that points of a cloud make, as a shape that comes near finds it.

The point that is nearest changes whenever a shape has moved by what lies between two points, and with it the direction
to it. Points that are about as near tell together where the surface is, and which way it looks.
"""

from __future__ import annotations

import math

from jacokin.arrays import Array
from jacokin.kernels.contact.separation import SeparationWork
from jacokin.kernels.contact.shapes import (
    FIRST_NODE,
    FIRST_VERTEX,
    LAST_VERTEX,
    LEAVES,
    MARGIN,
    NODE_HALF,
    NODE_RADIUS,
    Shapes,
    box_distance,
)
from jacokin.kernels.vector import Vec, dot, mix, norm

#: [m] beyond the nearest point, within which others tell of the surface.
BAND = 1e-2
#: Points that are nearer to each other than this part of their distance are one.
GRAIN = 0.15
#: Points tell of a surface if the cosine of the angle between it and their direction is larger.
BEHIND = 0.3
#: Points that are taken at most, and their columns: direction in the first shape's frame, distance [m].
MOST_AROUND, AROUND_NUMBERS = 512, 4


def find_surface(
    shapes: Shapes, b: int, work: SeparationWork, at: Vec, normal: Vec, distance: float, around: Array
) -> tuple[Vec, float]:
    """Which way the surface of a cloud looks, and how far it is along that.

    Args:
        shapes: all of them.
        b: the cloud; `work.relative` says where it is.
        work: its stack is used.
        at: the point of the first shape that is nearest to it, in that shape's frame [m].
        normal: the direction to the nearest point.
        distance: of that [m].
        around: (MOST_AROUND, 4) to work in.

    Returns:
        The direction of the surface, and its distance, no larger than the one given [m].
    """
    count = find_around(shapes, b, work, at, distance, around)
    for turn in range(2):
        total = (0.0, 0.0, 0.0)
        for k in range(count):
            weight = weight_of(around, k, distance)
            way = (around[k, 0], around[k, 1], around[k, 2])
            if turn == 1:
                weight *= max(dot(normal, way) - BEHIND, 0.0)
            total = mix(total, 1.0, way, weight, way, 0.0)
        size = norm(total)
        if size > 0.0:
            normal = (total[0] / size, total[1] / size, total[2] / size)
    level = distance
    for k in range(count):
        along = dot(normal, (around[k, 0], around[k, 1], around[k, 2]))
        weight = weight_of(around, k, distance) * max(along - BEHIND, 0.0) / (1.0 - BEHIND)
        level = min(level, around[k, 3] * (weight * along + 1.0 - weight))
    return normal, level


def weight_of(around: Array, k: int, distance: float) -> float:
    """How much a point tells of the surface: less, the farther it is."""
    part = min(max(1.0 - (around[k, 3] - distance) / BAND, 0.0), 1.0)
    return float(part * part)


def find_around(shapes: Shapes, b: int, work: SeparationWork, at: Vec, distance: float, around: Array) -> int:
    """Fill where points of a cloud are from a point: those that are not much farther than a distance; how many."""
    r, stack, margin = work.relative, work.stack, shapes.numbers[b, MARGIN]
    x, y, z = at[0] - r[0, 3], at[1] - r[1, 3], at[2] - r[2, 3]
    c = (
        r[0, 0] * x + r[1, 0] * y + r[2, 0] * z,
        r[0, 1] * x + r[1, 1] * y + r[2, 1] * z,
        r[0, 2] * x + r[1, 2] * y + r[2, 2] * z,
    )
    within, grain = distance + BAND + margin, GRAIN * (distance + BAND)
    first, total = shapes.integers[b, FIRST_VERTEX], shapes.integers[b, LAST_VERTEX] - shapes.integers[b, FIRST_VERTEX]
    root, leaves, size, count = shapes.integers[b, FIRST_NODE], shapes.integers[b, LEAVES], 1, 0
    stack[0] = 0
    while size > 0:
        size -= 1
        node = stack[size]
        box = shapes.nodes[root + node]
        u, v, w = abs(c[0] - box[0]), abs(c[1] - box[1]), abs(c[2] - box[2])
        if box_distance(u - box[NODE_HALF], v - box[NODE_HALF + 1], w - box[NODE_HALF + 2]) > within:
            continue
        if box[NODE_RADIUS] < grain:
            count = note(r, c, box, within, margin, around, count)
        elif node < leaves - 1:
            stack[size], stack[size + 1] = 2 * node + 1, 2 * node + 2
            size += 2
        else:
            leaf = node - (leaves - 1)
            for k in range(first + total * leaf // leaves, first + total * (leaf + 1) // leaves):
                count = note(r, c, shapes.points[k], within, margin, around, count)
    return count


def note(r: Array, c: Vec, p: Array, within: float, margin: float, around: Array, count: int) -> int:
    """Add where a point is from another one if it is not too far; how many there are."""
    x, y, z = p[0] - c[0], p[1] - c[1], p[2] - c[2]
    length = math.sqrt(x * x + y * y + z * z)
    if length > within or length <= margin or count == MOST_AROUND:
        return count
    for i in range(3):
        around[count, i] = (r[i, 0] * x + r[i, 1] * y + r[i, 2] * z) / length
    around[count, 3] = length - margin
    return count + 1
