"""How far two shapes are apart and where, and in which other points as soon as one of them turns a little.

A flat side that is parallel to another shape has its nearest point anywhere, and in another corner after the least
turn. What keeps that one point away keeps none of the others.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.contact.arm import Places, relate
from jacokin.kernels.contact.cloud import find_points, separate_point, shape_separation
from jacokin.kernels.contact.cloud_surface import find_surface
from jacokin.kernels.contact.separation import SeparationWork
from jacokin.kernels.contact.shapes import CLOUD, KIND, LINK, MARGIN, Shapes, core_support
from jacokin.kernels.vector import Vec, cross, dot, minus, mix, norm, rotated

#: Columns of a measured pair: distance [m], nearest points on both shapes, normal from the first; all in the world.
FIRST_POINT, SECOND_POINT, WAY, PAIR_NUMBERS = 1, 4, 7, 10
#: After these, how far apart the surfaces are along the normal [m]: that of a cloud is one that its points make.
LEVEL, SURFACE_NUMBERS = 10, 11
#: The second shape is turned by each of these angles [rad], about so many axes along the other one's surface: far, and
#: little, as corners of a side that is not quite flat are nearest then, which are behind others after a large turn. All
#: corners that are found, at most.
TILTS, AXES, CORNERS = (0.15, 0.02), 8, 16
#: Points of a cloud that are looked at one by one; so many that are near make a surface, which is looked at instead.
MOST_POINTS, DENSE = 64, 160
#: [m] corners that are nearer to each other are one.
ONE_CORNER = 1e-3


def measure_pair(
    shapes: Shapes, places: Places, work: SeparationWork, pair: NDArray[np.int64], reach: float, row: Array
) -> None:
    """Fill the numbers (10,) of a pair; beyond the reach [m] its distance only, or a lower bound that is beyond it."""
    relate(shapes, places.frames, pair[0], pair[1], work.relative)
    row[0] = shape_separation(shapes, (pair[0], pair[1]), work, reach, -math.inf, math.inf, True)
    if row[0] <= reach:
        fill_points(shapes, places, pair, witness(work, 0), witness(work, 1), witness(work, 2), row)


def measure_surfaces(
    shapes: Shapes,
    places: Places,
    work: SeparationWork,
    pair: NDArray[np.int64],
    reach: float,
    around: Array,
    row: Array,
) -> None:
    """Fill the numbers (11,) of a pair as `measure_pair` does, but the direction and the level of its surfaces."""
    measure_pair(shapes, places, work, pair, reach, row)
    row[LEVEL] = row[0]
    if row[0] > reach or row[0] <= 0.0 or shapes.integers[pair[1], KIND] != CLOUD:
        return
    n, first, second = witness(work, 0), witness(work, 1), witness(work, 2)
    at = mix(first, 1.0, n, shapes.numbers[pair[0], MARGIN], n, 0.0)
    normal, level = find_surface(shapes, pair[1], work, at, n, row[0], around)
    fill_points(shapes, places, pair, normal, first, second, row)
    row[LEVEL] = level
    for i in range(3):
        work.witness[0, i] = normal[i]


def measure_corners(
    shapes: Shapes, places: Places, work: SeparationWork, pair: NDArray[np.int64], around: Array, rows: Array
) -> int:
    """Fill the numbers (1 + CORNERS, 11) of a pair, and of points of it that are the nearest ones once it is tilted.

    These are as far apart as they are along the normal of the pair.

    Returns:
        How many rows are filled.
    """
    measure_surfaces(shapes, places, work, pair, math.inf, around, rows[0])
    normal, pivot, count = witness(work, 0), witness(work, 2), 1
    margins = shapes.numbers[pair[0], MARGIN] + shapes.numbers[pair[1], MARGIN]
    along = perpendicular(normal)
    across = cross(normal, along)
    for k in range(CORNERS):
        angle, size = 2.0 * math.pi * (k % AXES) / AXES, TILTS[k // AXES]
        axis = mix(along, math.cos(angle), across, math.sin(angle), normal, 0.0)
        relate(shapes, places.frames, pair[0], pair[1], work.relative)
        way = rotated(normal, axis, math.sin(size), math.cos(size))
        if stays_nearest(shapes, places, work, pair, normal, way, rows, count):
            continue
        tilt(work.relative, pivot, axis, size)
        shape_separation(shapes, (pair[0], pair[1]), work, math.inf, -math.inf, math.inf, True)
        first, second = witness(work, 1), tilted(witness(work, 2), pivot, axis, -size)
        fill_points(shapes, places, pair, normal, first, second, rows[count])
        if not is_known(rows, count):
            rows[count, 0] = rows[count, LEVEL] = dot(normal, minus(second, first)) - margins
            count += 1
    return count


def measure_points(
    shapes: Shapes,
    places: Places,
    work: SeparationWork,
    pair: NDArray[np.int64],
    within: float,
    found: NDArray[np.int64],
    rows: Array,
) -> int:
    """Fill the numbers (MOST_POINTS, 11) of a shape and each point of a cloud, the second, within a distance [m].

    Returns:
        How many points there are; more than room in `found` if they are too many. Rows are filled if there is one for
        each.
    """
    relate(shapes, places.frames, pair[0], pair[1], work.relative)
    count = find_points(shapes, pair, work, within, found)
    for k in range(count if count <= MOST_POINTS else 0):
        row = rows[k]
        row[0] = row[LEVEL] = separate_point(shapes, pair, work, found[k])
        fill_points(shapes, places, pair, witness(work, 0), witness(work, 1), witness(work, 2), row)
    return count


def witness(work: SeparationWork, row: int) -> Vec:
    """The normal (row 0) or a nearest point of the cores (1, 2) as they were measured, in the first shape's frame."""
    return (work.witness[row, 0], work.witness[row, 1], work.witness[row, 2])


def stays_nearest(
    shapes: Shapes,
    places: Places,
    work: SeparationWork,
    pair: NDArray[np.int64],
    normal: Vec,
    tilted_normal: Vec,
    rows: Array,
    count: int,
) -> bool:
    """Whether the first shape's nearest point stays that when the other one is tilted, if that one is flat.

    The row after those that are filled is used to find out.
    """
    if shapes.integers[pair[0], KIND] == CLOUD:
        return False
    x, y, z = tilted_normal
    p, work.hints[0] = core_support(shapes, pair[0], x, y, z, work.hints[0])
    fill_points(shapes, places, pair, normal, p, p, rows[count])
    return is_at(rows[0], rows[count], FIRST_POINT)


def perpendicular(normal: Vec) -> Vec:
    """A unit vector across another one."""
    x, y, z = abs(normal[0]), abs(normal[1]), abs(normal[2])
    least = (1.0, 0.0, 0.0) if x <= y and x <= z else ((0.0, 1.0, 0.0) if y <= z else (0.0, 0.0, 1.0))
    a = cross(normal, least)
    size = norm(a)
    return (a[0] / size, a[1] / size, a[2] / size)


def tilted(p: Vec, pivot: Vec, axis: Vec, angle: float) -> Vec:
    """A point turned about an axis through another one."""
    p = rotated(minus(p, pivot), axis, math.sin(angle), math.cos(angle))
    return (p[0] + pivot[0], p[1] + pivot[1], p[2] + pivot[2])


def tilt(frame: Array, pivot: Vec, axis: Vec, angle: float) -> None:
    """Turn a frame (3, 4) about an axis through a point."""
    place = tilted((frame[0, 3], frame[1, 3], frame[2, 3]), pivot, axis, angle)
    for k in range(3):
        a = rotated((frame[0, k], frame[1, k], frame[2, k]), axis, math.sin(angle), math.cos(angle))
        for i in range(3):
            frame[i, k] = a[i]
    for i in range(3):
        frame[i, 3] = place[i]


def is_known(rows: Array, count: int) -> bool:
    """Whether the corners that come after some rows are in one of them."""
    known = False
    for r in range(count):
        known = known or (is_at(rows[r], rows[count], FIRST_POINT) and is_at(rows[r], rows[count], SECOND_POINT))
    return known


def is_at(one: Array, other: Array, point: int) -> bool:
    """Whether two rows have the same corner."""
    x, y, z = one[point] - other[point], one[point + 1] - other[point + 1], one[point + 2] - other[point + 2]
    return bool(x * x + y * y + z * z < ONE_CORNER * ONE_CORNER)


def fill_points(
    shapes: Shapes, places: Places, pair: NDArray[np.int64], normal: Vec, first: Vec, second: Vec, row: Array
) -> None:
    """Fill points and normal of a row from those of the cores, in the first shape's frame."""
    shape, frame = shapes.numbers[pair[0]], places.frames[shapes.integers[pair[0], LINK]]
    for to in (FIRST_POINT, SECOND_POINT, WAY):
        p = normal
        if to == FIRST_POINT:
            p = mix(first, 1.0, normal, shape[MARGIN], normal, 0.0)
        elif to == SECOND_POINT:
            p = mix(second, 1.0, normal, -shapes.numbers[pair[1], MARGIN], normal, 0.0)
        u = shape[0] * p[0] + shape[1] * p[1] + shape[2] * p[2]
        v = shape[4] * p[0] + shape[5] * p[1] + shape[6] * p[2]
        w = shape[8] * p[0] + shape[9] * p[1] + shape[10] * p[2]
        if to != WAY:
            u, v, w = u + shape[3], v + shape[7], w + shape[11]
        for i in range(3):
            row[to + i] = frame[i, 0] * u + frame[i, 1] * v + frame[i, 2] * w
            if to != WAY:
                row[to + i] += frame[i, 3]
