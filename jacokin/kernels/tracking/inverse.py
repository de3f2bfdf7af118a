"""The damped inverse of a tool's Jacobian, and how its answers bend as the Jacobian changes."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from jacokin.arrays import Array
from jacokin.kernels.symmetric import diagonalise

#: Rows of the Jacobian: of the tool's velocity and angular velocity.
SIX = 6
#: Damping where nothing is to be given away: square of a weighted singular value [m^2/rad^2].
EXACT = 1e-12
#: The same against the square of the largest singular value, where next to nothing is: with less, answers at a singular
#: pose turn round within what a tick leaves undone, and jump from tick to tick.
SMOOTH = 1e-10
#: What Jacobi's method leaves beside the diagonal, squared and relative: rounding, as one matrix is always singular.
BESIDE = 1e-29
#: Halvings of the range in which a damping is looked for.
DAMPING_HALVINGS = 20
#: Instead of the square of a singular value, of a direction that does not count.
NONE = -1.0


class Inverse(NamedTuple):
    """A Jacobian J (6, dof) and its principal directions: x with the least |J x - y|^2 + damping |x|^2."""

    jacobian: Array  # (6 dof,)
    squares: Array  # (6,) of singular values, or `NONE`
    left: Array  # (36,) directions of y, in columns
    right_squares: Array  # (dof,) the same of x
    right: Array  # (dof dof,)
    matrix: Array  # (36,) to work in, as the others
    right_matrix: Array  # (dof dof,)
    parts: Array  # (6,)
    rest: Array  # (6,)
    back: Array  # (dof,)


def make_inverse(dof: int = 0) -> Inverse:
    """Fresh arrays for so many joints."""
    return Inverse(
        np.zeros(SIX * dof),
        np.zeros(SIX),
        np.zeros(SIX * SIX),
        np.zeros(dof),
        np.zeros(dof * dof),
        np.zeros(SIX * SIX),
        np.zeros(dof * dof),
        np.zeros(SIX),
        np.zeros(SIX),
        np.zeros(dof),
    )


def decompose(inverse: Inverse) -> None:
    """Find the principal directions of its Jacobian."""
    jacobian, dof = inverse.jacobian, len(inverse.back)
    for i in range(SIX):
        for k in range(SIX):
            value = 0.0
            for j in range(dof):
                value += jacobian[i * dof + j] * jacobian[k * dof + j]
            inverse.matrix[i * SIX + k] = value
    for i in range(dof):
        for k in range(dof):
            value = 0.0
            for j in range(SIX):
                value += jacobian[j * dof + i] * jacobian[j * dof + k]
            inverse.right_matrix[i * dof + k] = value
    diagonalise(inverse.matrix, inverse.left, SIX, BESIDE)
    diagonalise(inverse.right_matrix, inverse.right, dof, BESIDE)
    take_largest(inverse.matrix, SIX, dof, inverse.squares)
    take_largest(inverse.right_matrix, dof, SIX, inverse.right_squares)


def take_largest(matrix: Array, size: int, count: int, squares: Array) -> None:
    """Take so many of the eigenvalues on the diagonal of a matrix, or all; the others do not count."""
    for i in range(size):
        squares[i] = max(matrix[i * size + i], 0.0)
    for _ in range(size - count):
        least = -1
        for i in range(size):
            if squares[i] >= 0.0 and (least < 0 or squares[i] < squares[least]):
                least = i
        squares[least] = NONE


def solve_damped(inverse: Inverse, y: Array, damping: float, x: Array) -> None:
    """Fill the answer x (dof,) for y (6,)."""
    parts, dof = inverse.parts, len(x)
    for k in range(SIX):
        parts[k] = 0.0
    for i in range(SIX):
        if inverse.squares[i] >= 0.0:
            along = along_left(inverse, i, y) / (inverse.squares[i] + damping)
            for k in range(SIX):
                parts[k] += inverse.left[k * SIX + i] * along
    for j in range(dof):
        x[j] = 0.0
        for k in range(SIX):
            x[j] += inverse.jacobian[k * dof + j] * parts[k]


def along_left(inverse: Inverse, i: int, y: Array) -> float:
    """The part of y (6,) along a principal direction."""
    along = 0.0
    for k in range(SIX):
        along += inverse.left[k * SIX + i] * y[k]
    return along


def multiply(jacobian: Array, x: Array, y: Array) -> None:
    """Fill J x (6,) for x (dof,)."""
    dof = len(x)
    for k in range(SIX):
        y[k] = 0.0
        for j in range(dof):
            y[k] += jacobian[k * dof + j] * x[j]


def fill_bend(inverse: Inverse, y: Array, x: Array, turn: Array, damping: float, bend: Array) -> None:
    """Fill by how much (dof,) the answer x (dof,) for y (6,) changes where the Jacobian changes by a turn (6 dof,)."""
    dof, rest, back = len(x), inverse.rest, inverse.back
    multiply(inverse.jacobian, x, rest)
    for j in range(dof):
        back[j] = 0.0
        for k in range(SIX):
            back[j] += (y[k] - rest[k]) * turn[k * dof + j]
    multiply(turn, x, rest)
    for k in range(SIX):
        rest[k] = -rest[k]
    solve_damped(inverse, rest, damping, bend)
    for i in range(dof):
        if inverse.right_squares[i] >= 0.0:
            along = 0.0
            for j in range(dof):
                along += inverse.right[j * dof + i] * back[j]
            along /= inverse.right_squares[i] + damping
            for j in range(dof):
                bend[j] += along * inverse.right[j * dof + i]


def largest_square(inverse: Inverse) -> float:
    """The square of the largest singular value."""
    largest = 0.0
    for i in range(SIX):
        largest = max(largest, inverse.squares[i])
    return largest


def part_left(inverse: Inverse, y: Array) -> float:
    """The size of what of y (6,) no damping reaches: in directions in which x can hardly lead."""
    left = 0.0
    for i in range(SIX):
        if inverse.squares[i] >= 0.0:
            part = along_left(inverse, i, y) * EXACT / (inverse.squares[i] + EXACT)
            left += part * part
    return math.sqrt(left)


def smooth_damping(inverse: Inverse) -> float:
    """The damping where next to nothing is to be given away."""
    return max(SMOOTH * largest_square(inverse), EXACT)


def damping_leaving(inverse: Inverse, y: Array, residual: float) -> float:
    """The largest damping at which no more than a residual of y (6,), in its units, is left by damping alone.

    What `EXACT` leaves, as in directions in which x cannot lead, does not count.
    """
    least, most = EXACT, max(largest_square(inverse), EXACT)
    for _ in range(DAMPING_HALVINGS):
        middle, left = math.sqrt(least * most), 0.0
        for i in range(SIX):
            if inverse.squares[i] >= 0.0:
                square = inverse.squares[i]
                part = along_left(inverse, i, y) * square * (middle - EXACT) / ((square + middle) * (square + EXACT))
                left += part * part
        if left <= residual * residual:
            least = middle
        else:
            most = middle
    return least
