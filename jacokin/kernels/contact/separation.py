"""How far two convex shapes are apart, by Gilbert, Johnson and Keerthi's method on their farthest points."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.contact.penetration import Polytope, make_polytope, penetration
from jacokin.kernels.contact.shapes import (
    FIRST_VERTEX,
    KIND,
    MARGIN,
    PLANE,
    Shapes,
    core_support,
    support_of_difference,
)
from jacokin.kernels.contact.simplex import nearest_in_simplex
from jacokin.kernels.contact.tree import DEEPEST
from jacokin.kernels.vector import Vec

#: [m] a distance is known this well when the search ends.
DISTANCE_TOLERANCE = 1e-9
#: How well distances are known that need not be exact.
ROUGHNESS = 0.1
#: [m] cores nearer than this overlap.
OVERLAP = 1e-11
#: Steps after which the search ends whatever it has reached; polytopes need some 10, round shapes some 30.
MOST_STEPS = 128


class SeparationWork(NamedTuple):
    """What measuring one pair needs, and what it leaves."""

    relative: Array  # (3, 4) the second shape's frame in the first's
    simplex: Array  # (4, 9) corners: difference, point on the first, point on the second, in the first's frame
    weights: Array  # (4,)
    hints: NDArray[np.int64]  # (2,) vertices where the last support was
    witness: Array  # (3, 3) normal from the first to the second, point on the first, on the second; first's frame
    polytope: Polytope
    stack: NDArray[np.int64]  # (DEEPEST,) nodes of a cloud that wait to be looked into
    bounds: Array  # (DEEPEST,) how near what they hold can be [m]


def make_separation_work() -> SeparationWork:
    """Fresh work arrays."""
    return SeparationWork(
        np.zeros((3, 4)),
        np.zeros((4, 9)),
        np.zeros(4),
        np.zeros(2, np.int64),
        np.zeros((3, 3)),
        make_polytope(),
        np.zeros(DEEPEST, np.int64),
        np.zeros(DEEPEST),
    )


def separation(
    shapes: Shapes, pair: tuple[int, int], work: SeparationWork, enough: float, little: float, rough: float, deep: bool
) -> float:
    """Distance of two shapes, negative where they overlap [m]; `work.relative` says where they are.

    Args:
        shapes: all of them.
        pair: numbers of the two; a plane is the second.
        work: its witness is filled; where the search ends early, only its normal, along which they are apart.
        enough: as soon as they are known to be farther apart, a lower bound larger than this is returned [m].
        little: as soon as they are known to be nearer, an upper bound not larger than this is returned [m].
        rough: where they are farther apart than this, a lower bound of what is beyond it will do, known to a part of
            itself, `ROUGHNESS` [m].
        deep: True to measure how deep cores that overlap are, False to return minus the margins then.
    """
    a, b = pair
    if shapes.integers[b, KIND] == PLANE:
        return above_plane(shapes, a, work)
    r, simplex, weights, witness = work.relative, work.simplex, work.weights, work.witness
    margin = shapes.numbers[a, MARGIN] + shapes.numbers[b, MARGIN]
    work.hints[0], work.hints[1] = shapes.integers[a, FIRST_VERTEX], shapes.integers[b, FIRST_VERTEX]
    v = (-r[0, 3], -r[1, 3], -r[2, 3])
    square = v[0] * v[0] + v[1] * v[1] + v[2] * v[2]
    if square == 0.0:
        v, square = (1.0, 0.0, 0.0), 1.0
    length = math.sqrt(square)
    count, bound, upper, known = 0, -math.inf, math.inf, False
    for _ in range(MOST_STEPS):
        height = -support_of_difference(shapes, pair, r, work.hints, (-v[0], -v[1], -v[2]), simplex[count])
        bound = max(bound, height / length)
        if bound - margin > enough or upper - bound <= ROUGHNESS * (bound - margin - rough):
            for i in range(3):
                witness[0, i] = -v[i] / length
            return float(bound - margin)
        if known and (upper - bound <= DISTANCE_TOLERANCE or is_corner(simplex, count)):
            break
        left = nearest_in_simplex(simplex, weights, count + 1)
        if left == 4:
            upper = 0.0
            break
        x, y, z = 0.0, 0.0, 0.0
        for i in range(left):
            x += weights[i] * simplex[i, 0]
            y += weights[i] * simplex[i, 1]
            z += weights[i] * simplex[i, 2]
        square = x * x + y * y + z * z
        length = math.sqrt(square)
        if length < OVERLAP:
            upper = 0.0
            break
        if known and length >= upper:  # rounding: no progress
            break
        v, count, upper, known = (x, y, z), left, length, True
        fill_witness(simplex, weights, left, v, length, witness)
        if upper - margin <= little:
            return float(upper - margin)
    if upper > 0.0:
        return float(max(upper, 0.0) - margin)
    if deep:
        return float(-penetration(shapes, pair, r, work.hints, work.polytope, witness) - margin)
    return float(-margin)


def is_corner(simplex: Array, new: int) -> bool:
    """Whether a new corner is one of the older ones."""
    for i in range(new):
        if simplex[i, 0] == simplex[new, 0] and simplex[i, 1] == simplex[new, 1] and simplex[i, 2] == simplex[new, 2]:
            return True
    return False


def fill_witness(simplex: Array, weights: Array, count: int, v: Vec, length: float, witness: Array) -> None:
    """Normal and nearest points of the cores."""
    for i in range(3):
        witness[0, i] = -v[i] / length
        for side in range(2):
            total = 0.0
            for row in range(count):
                total += weights[row] * simplex[row, 3 + 3 * side + i]
            witness[1 + side, i] = total


def above_plane(shapes: Shapes, a: int, work: SeparationWork) -> float:
    """Height of a shape's lowest point above a plane [m]."""
    r, witness = work.relative, work.witness
    down = (-r[0, 2], -r[1, 2], -r[2, 2])
    p, _ = core_support(shapes, a, down[0], down[1], down[2], shapes.integers[a, FIRST_VERTEX])
    core = -(down[0] * (p[0] - r[0, 3]) + down[1] * (p[1] - r[1, 3]) + down[2] * (p[2] - r[2, 3]))
    for i in range(3):
        witness[0, i] = down[i]
        witness[1, i] = p[i]
        witness[2, i] = p[i] + core * down[i]
    return float(core - shapes.numbers[a, MARGIN])
