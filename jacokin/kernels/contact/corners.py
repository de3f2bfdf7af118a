"""Points of two shapes that are nearest to each other as soon as one of them turns a little.

A flat side that is parallel to another shape has its nearest point anywhere, and in another corner after the smallest
turn. What keeps that one point away keeps none of the others.
"""

from __future__ import annotations

import math

from jacokin.arrays import Array
from jacokin.kernels.contact.arm import Places, relate
from jacokin.kernels.contact.cloud import put, shape_separation, turned
from jacokin.kernels.contact.separation import SeparationWork
from jacokin.kernels.contact.shapes import MARGIN, Shapes, core_support
from jacokin.kernels.vector import Vec, cross, dot, minus, mix, norm

#: [rad] of a turn, two ways about two axes.
TURN, TURNS = 0.15, 8
#: [m] points that are nearer to each other are one.
ONE = 1e-3


def turn_about(frame: Array, place: Vec, axis: Vec, angle: float) -> None:
    """Turn a frame (3, 4) about an axis through a place, both in the same coordinates."""
    c, s = math.cos(angle), math.sin(angle)
    for column in range(4):
        p = (frame[0, column], frame[1, column], frame[2, column])
        if column == 3:
            p = minus(p, place)
        p = mix(p, c, cross(axis, p), s, axis, (1.0 - c) * dot(axis, p))
        for i in range(3):
            frame[i, column] = p[i] + place[i] if column == 3 else p[i]


def tangent(normal: Vec) -> Vec:
    """A unit vector perpendicular to another one."""
    least, k = 2.0, 0
    for i in range(3):
        if abs(normal[i]) < least:
            least, k = abs(normal[i]), i
    t = cross(normal, (1.0 if k == 0 else 0.0, 1.0 if k == 1 else 0.0, 1.0 if k == 2 else 0.0))
    size = norm(t)
    return (t[0] / size, t[1] / size, t[2] / size)


def measure_corners(
    shapes: Shapes, places: Places, work: SeparationWork, pair: tuple[int, int], reach: float, rows: Array
) -> int:
    """Fill rows (4, 10) as `measure_pair` does, with other points than the nearest ones and their distance along the normal.

    Returns how many.
    """
    a, b = pair
    relate(shapes, places.frames, a, b, work.relative)
    if shape_separation(shapes, pair, work, reach, -math.inf, math.inf, True) > reach:
        return 0
    w = work.witness
    n, first, second = (w[0, 0], w[0, 1], w[0, 2]), (w[1, 0], w[1, 1], w[1, 2]), (w[2, 0], w[2, 1], w[2, 2])
    margins = shapes.numbers[a, MARGIN] + shapes.numbers[b, MARGIN]
    along = tangent(n)
    across = cross(n, along)
    count = 0
    for k in range(TURNS):
        way, angle = 2.0 * math.pi * k / TURNS, TURN
        axis = mix(along, math.cos(way), across, math.sin(way), n, 0.0)
        if stays(shapes, work, (a, b), (n, cross(axis, n)), (first, second), rows, count):
            continue
        turn_about(work.relative, second, axis, angle)
        found = shape_separation(shapes, pair, work, reach, -math.inf, math.inf, True)
        turn_about(work.relative, second, axis, -angle)
        if found > reach:
            continue
        p, c, s = (w[2, 0] - second[0], w[2, 1] - second[1], w[2, 2] - second[2]), math.cos(angle), -math.sin(angle)
        p = mix(p, c, cross(axis, p), s, axis, (1.0 - c) * dot(axis, p))
        there = (p[0] + second[0], p[1] + second[1], p[2] + second[2])
        here = (w[1, 0], w[1, 1], w[1, 2])
        if is_known(rows, count, there, second):
            continue
        for i in range(3):
            rows[count, 10 + i] = there[i]
        rows[count, 0] = dot(n, minus(there, here)) - margins
        fill_world(shapes, places, pair, n, here, there, rows[count])
        count += 1
    return count


def stays(
    shapes: Shapes,
    work: SeparationWork,
    pair: tuple[int, int],
    ways: tuple[Vec, Vec],
    nearest: tuple[Vec, Vec],
    rows: Array,
    count: int,
) -> bool:
    """Whether the farthest point of either shape, as it is turned, is known."""
    n, across = ways
    c, s, r = math.cos(TURN), math.sin(TURN), work.relative
    d = mix(n, c, across, s, n, 0.0)
    p, work.hints[0] = core_support(shapes, pair[0], d[0], d[1], d[2], work.hints[0])
    away = minus(p, nearest[0])
    if dot(away, away) < ONE * ONE:
        return True
    d = mix(n, -c, across, s, n, 0.0)
    x = r[0, 0] * d[0] + r[1, 0] * d[1] + r[2, 0] * d[2]
    y = r[0, 1] * d[0] + r[1, 1] * d[1] + r[2, 1] * d[2]
    z = r[0, 2] * d[0] + r[1, 2] * d[1] + r[2, 2] * d[2]
    p, work.hints[1] = core_support(shapes, pair[1], x, y, z, work.hints[1])
    return is_known(rows, count, turned(r, p, (r[0, 3], r[1, 3], r[2, 3])), nearest[1])


def is_known(rows: Array, count: int, p: Vec, nearest: Vec) -> bool:
    """Whether a point is one of those that are there."""
    away = minus(p, nearest)
    known = dot(away, away) < ONE * ONE
    for r in range(count):
        away = minus(p, (rows[r, 10], rows[r, 11], rows[r, 12]))
        known = known or dot(away, away) < ONE * ONE
    return known


def fill_world(
    shapes: Shapes, places: Places, pair: tuple[int, int], normal: Vec, first: Vec, second: Vec, row: Array
) -> None:
    """Fill points (from the cores' to the shapes') and normal of a row in the world."""
    a, b = pair
    shape, frame = shapes.numbers[a], places.frames[shapes.integers[a, 1]]
    m, n = shape[MARGIN], -shapes.numbers[b, MARGIN]
    zero = (0.0, 0.0, 0.0)
    one = turned(frame, turned_in(shape, mix(first, 1.0, normal, m, normal, 0.0), True), (frame[0, 3], frame[1, 3], frame[2, 3]))
    two = turned(frame, turned_in(shape, mix(second, 1.0, normal, n, normal, 0.0), True), (frame[0, 3], frame[1, 3], frame[2, 3]))
    way = turned(frame, turned_in(shape, normal, False), zero)
    for i in range(3):
        row[1 + i], row[4 + i], row[7 + i] = one[i], two[i], way[i]


def turned_in(shape: Array, p: Vec, is_point: bool) -> Vec:
    """A point or vector of a shape's frame in its link's."""
    x = shape[0] * p[0] + shape[1] * p[1] + shape[2] * p[2]
    y = shape[4] * p[0] + shape[5] * p[1] + shape[6] * p[2]
    z = shape[8] * p[0] + shape[9] * p[1] + shape[10] * p[2]
    return (x + shape[3], y + shape[7], z + shape[11]) if is_point else (x, y, z)
