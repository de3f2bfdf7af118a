"""What is missing to the targets of a tick: their squared error to second order, and its least value.

The Hessian is that of least squares of the linearised error and, where a part of the error cannot be removed, of how
the Jacobian turns against that part; it is made positive definite. So the minimiser moves smoothly with the arm also
where the target is out of reach: there least squares alone jump from one side of a singular pose to the other at every
tick.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.limits import TURN
from jacokin.kernels.symmetric import diagonalise, factorise, is_positive, solve_factorised

#: Keeps the Hessian regular at singular poses.
TIKHONOV = 1e-10
#: [m/rad^2] relative to the error that can be removed; less lets the joints swing near singular poses.
DAMPING = 0.1
#: [m] an error below which damping vanishes with its square: so moving targets are followed to microns.
CLOSE = 0.01
#: Of a squared error: less is not told from rounding and the damping that keeps the Hessian regular.
ROUNDED = 1e-6
#: Of an error out of reach, by which it is not worth while to move on.
LITTLE = 1e-4
#: Towards the edge of what is worth while, a step fades with this power of what is to be gained: with 1, the arm steps
#: over the edge and back; with 0.5, which stops it on the edge, it never quite comes to rest.
FADING = 0.75
#: Instead of dividing by zero.
TINY = 1e-200
#: What Jacobi's method leaves beside the diagonal, squared and relative.
DIAGONAL = 1e-32
#: [m/rad] weighted: in directions with a smaller singular value the arm hardly moves the tool.
SINGULAR = 0.01
#: Part of the error in such directions from which they hold the arm back.
MOSTLY = 0.5


class Problem(NamedTuple):
    """The least of g x + x H x / 2, x (dof,) [rad]: of half the squared error."""

    error: Array  # (rows,) weighted, of the tasks that come first and then of the others
    jacobian: Array  # (rows dof,)
    left: Array  # (rows,) errors to work with
    gradient: Array  # (dof,)
    hessian: Array  # (dof dof,) without damping; not made positive unless it is in principal directions
    factor: Array  # (dof dof,) Cholesky's of what is solved with, or the principal directions in columns
    matrix: Array  # (dof dof,) to work in
    bends: Array  # (dof,) how much the Hessian bends in its principal directions, > 0
    slopes: Array  # (dof,) to work in
    principal: NDArray[np.int64]  # (1,) 1 where it is in principal directions
    worth: Array  # (1,) of the squared error: a step that gains less is not worth while [m^2]


def make_problem(dof: int = 0, rows: int = 0) -> Problem:
    """Fresh arrays for so many joints and rows of errors."""
    return Problem(
        np.zeros(rows),
        np.zeros(rows * dof),
        np.zeros(rows),
        np.zeros(dof),
        np.zeros(dof * dof),
        np.zeros(dof * dof),
        np.zeros(dof * dof),
        np.zeros(dof),
        np.zeros(dof),
        np.zeros(1, np.int64),
        np.zeros(1),
    )


def take_worthwhile(problem: Problem, x: Array) -> None:
    """Leave of a displacement (dof,) [rad] what is worth while: none of one by which next to nothing is gained.

    It is weighed as a whole, after limits and distances have had their say. Weighed direction by direction, before
    that, a joint that reaches its limit would make worth while in one tick what was not in the tick before.
    """
    gained = 0.0
    for j in range(len(x)):
        gained -= problem.gradient[j] * x[j]
    part = max(1.0 - (problem.worth[0] / max(gained, TINY)) ** FADING, 0.0)
    for j in range(len(x)):
        x[j] *= part


def damping_for(gain: float) -> float:
    """Of the Hessian [m^2/rad^2], where so much [m^2] of the squared error can be removed."""
    return DAMPING * gain / (math.sqrt(gain) + CLOSE)


def begin(problem: Problem, rows: int, dof: int) -> float:
    """Fill gradient and Hessian of least squares, and the errors that damped ones leave; returns the squared error."""
    error, jacobian, gradient, hessian = problem.error, problem.jacobian, problem.gradient, problem.hessian
    cost = 0.0
    for i in range(dof):
        gradient[i] = 0.0
        for j in range(dof):
            hessian[i * dof + j] = 0.0
    for r in range(rows):
        cost += error[r] * error[r]
        for i in range(dof):
            a = jacobian[r * dof + i]
            gradient[i] -= a * error[r]
            for j in range(i + 1):
                hessian[i * dof + j] += a * jacobian[r * dof + j]
    for i in range(dof):
        for j in range(i):
            hessian[j * dof + i] = hessian[i * dof + j]
    x = problem.slopes
    for i in range(dof):
        x[i] = gradient[i]
    factorise(hessian, problem.factor, dof, TIKHONOV + damping_for(cost), 0.0)
    solve_factorised(problem.factor, x, dof)
    for r in range(rows):
        value = error[r]
        for j in range(dof):
            value += jacobian[r * dof + j] * x[j]
        problem.left[r] = value
    return cost


def make_regular(problem: Problem, cost: float, negligible: float, dof: int) -> float:
    """Make the Hessian positive definite and damp it; returns the damping.

    Damping goes with what there is to gain: it vanishes at the least error, on target or out of reach. Where error is
    left there, it is found what a step must gain to be worth while: so the arm comes to rest.

    Args:
        problem: with gradient and Hessian.
        cost: the squared error [m^2].
        negligible: error that is not worth while [m].
        dof: joints.
    """
    gradient, hessian, bends, slopes = problem.gradient, problem.hessian, problem.bends, problem.slopes
    problem.principal[0], problem.worth[0] = 0, 0.0
    if is_positive(hessian, problem.factor, dof):
        factorise(hessian, problem.factor, dof, TIKHONOV, 0.0)
        for i in range(dof):
            slopes[i] = gradient[i]
        solve_factorised(problem.factor, slopes, dof)
        gain = 0.0
        for i in range(dof):
            gain += gradient[i] * slopes[i]
        gain = min(cost, gain)
        if cost - gain - ROUNDED * cost <= 0.0:
            damping = TIKHONOV + damping_for(gain)
            factorise(hessian, problem.factor, dof, damping, 0.0)
            return damping
    problem.principal[0] = 1
    for i in range(dof * dof):
        problem.matrix[i] = hessian[i]
    diagonalise(problem.matrix, problem.factor, dof, DIAGONAL)
    gain = 0.0
    for i in range(dof):
        bends[i] = abs(problem.matrix[i * dof + i]) + TIKHONOV
        slopes[i] = 0.0
        for j in range(dof):
            slopes[i] += gradient[j] * problem.factor[j * dof + i]
        gain += slopes[i] * slopes[i] / max(bends[i], abs(slopes[i]) / TURN)  # no farther than a turn
    gain = min(cost, gain)
    left = math.sqrt(max(cost - gain - ROUNDED * cost, 0.0))
    damping = damping_for(gain)
    problem.worth[0] = 2.0 * left * (negligible + LITTLE * left)
    for i in range(dof):
        bends[i] += damping
    return TIKHONOV + damping


def divide(problem: Problem, x: Array, dof: int) -> None:
    """Solve H x = b in place, where x (dof,) holds b."""
    if problem.principal[0] == 0:
        solve_factorised(problem.factor, x, dof)
        return
    slopes = problem.slopes
    for i in range(dof):
        slopes[i] = 0.0
        for j in range(dof):
            slopes[i] += x[j] * problem.factor[j * dof + i]
        slopes[i] /= problem.bends[i]
    for j in range(dof):
        x[j] = 0.0
        for i in range(dof):
            x[j] += problem.factor[j * dof + i] * slopes[i]


def fill_damped(problem: Problem, damping: float, dof: int) -> None:
    """Fill the matrix with the Hessian that `divide` solves with."""
    for i in range(dof):
        for j in range(dof):
            value = problem.hessian[i * dof + j] + (damping if i == j else 0.0)
            if problem.principal[0] == 1:
                value = 0.0
                for k in range(dof):
                    value += problem.factor[i * dof + k] * problem.bends[k] * problem.factor[j * dof + k]
            problem.matrix[i * dof + j] = value


def is_singular(problem: Problem, rows: int, cost: float, dof: int) -> bool:
    """Whether most of the error is in directions in which the arm hardly moves the tool; spoils what `divide` needs.

    They are those of the smaller of J J^T and J^T J.
    """
    jacobian, matrix, vectors = problem.jacobian, problem.matrix, problem.factor
    size = min(rows, dof)
    for i in range(size):
        for j in range(size):
            value = 0.0
            for k in range(dof if rows <= dof else rows):
                if rows <= dof:
                    value += jacobian[i * dof + k] * jacobian[j * dof + k]
                else:
                    value += jacobian[k * dof + i] * jacobian[k * dof + j]
            matrix[i * size + j] = value
    diagonalise(matrix, vectors, size, DIAGONAL)
    missing = 0.0
    for i in range(size):
        square = max(matrix[i * size + i], 0.0)
        if square >= SINGULAR * SINGULAR:
            continue
        along = 0.0
        for j in range(size):
            if rows <= dof:
                along += vectors[j * size + i] * problem.error[j]
            else:
                for k in range(rows):
                    along += vectors[j * size + i] * jacobian[k * dof + j] * problem.error[k]
        if rows > dof:
            along = along / math.sqrt(square) if square > 0.0 else 0.0
        missing += along * along
    return missing > MOSTLY * MOSTLY * cost
