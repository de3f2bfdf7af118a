"""Where curves meet: the other curve through a point that a walk has passed."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from jacokin.arrays import Array
from jacokin.kernels.chain import bordered_newton, linearise7
from jacokin.kernels.solution_set.curve import LARGEST_RESIDUAL, RESIDUAL, Walk
from jacokin.kernels.symmetric import diagonalise

#: [rad] how far from a meeting the other curve is looked for, and steps of Newton's method at most: where the Jacobian
#: is nearly singular all along that curve, the first ones go far.
ASIDE, ASIDE_STEPS = 0.02, 40
#: Where it is not found, how often to look nearer, and how much.
NEARER, TIMES_NEARER = 2, 0.2


class Directions(NamedTuple):
    """A symmetric matrix and its eigenvectors."""

    square: Array  # (49,)
    vectors: Array  # (49,) in columns


def make_directions() -> Directions:
    """Fresh arrays."""
    return Directions(np.empty(49), np.empty(49))


def points_aside(meeting: Array, side: float, null: Directions, x: Array, walk: Walk) -> bool:
    """Fill x with a point of the other curve, on one side of a meeting that lies between two points (14,).

    The Jacobian has two null directions there; the other curve leaves along a combination of the known one and the one
    across it, so that it is looked for across.
    """
    for j in range(7):
        x[j] = 0.5 * (meeting[j] + meeting[7 + j])
    linearise7(walk.chain, walk.T, x, walk.system)
    for i in range(7):
        for j in range(7):
            product = 0.0
            for row in range(6):
                product += walk.system[row, i] * walk.system[row, j]
            null.square[7 * i + j] = product
    diagonalise(null.square, null.vectors, 7, 0.0)
    first, second = 0, 1
    for i in range(1, 7):
        if null.square[8 * i] < null.square[8 * first]:
            first, second = i, first
        elif i > 1 and null.square[8 * i] < null.square[8 * second]:
            second = i
    along_1, along_2, length = 0.0, 0.0, 0.0
    for j in range(7):
        d = meeting[7 + j] - meeting[j]
        along_1 += d * null.vectors[7 * j + first]
        along_2 += d * null.vectors[7 * j + second]
    length = math.sqrt(along_1 * along_1 + along_2 * along_2)
    if length == 0.0:
        return False
    for j in range(7):
        walk.border[j] = (along_1 * null.vectors[7 * j + second] - along_2 * null.vectors[7 * j + first]) / length
    away = side * ASIDE
    for _ in range(1 + NEARER):
        offset = 0.0
        for j in range(7):
            x[j] = 0.5 * (meeting[j] + meeting[7 + j]) + away * walk.border[j]
            offset += walk.border[j] * x[j]
        missing = bordered_newton(walk.chain, walk.T, x, walk.border, offset, walk.system, ASIDE_STEPS, RESIDUAL)
        if missing <= LARGEST_RESIDUAL:
            return True
        away *= TIMES_NEARER
    return False
