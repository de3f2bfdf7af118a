"""Forward kinematics on the model's own joint placements, errors against a target, and Newton on the joints."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.kernels.tolerances import DAMPING, SMALLEST_PIVOT
from jacokin.kernels.vector import Vec, cross, dot, minus, mix, norm


def forward(chain: NDArray[np.float64], q: NDArray[np.float64]) -> tuple[Vec, Vec, Vec, Vec]:
    """Columns x, y, z of the solved frame's rotation, and its position [m].

    Args:
        chain: (7, 3, 4) placements between joints that turn about z.
        q: (6,) joint angles [rad].
    """
    x, y, z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
    p = (0.0, 0.0, 0.0)
    for i in range(6):
        x, y, z, p = place(chain, i, x, y, z, p)
        c, s = math.cos(q[i]), math.sin(q[i])
        x, y = mix(x, c, y, s, y, 0.0), mix(y, c, x, -s, x, 0.0)
    return place(chain, 6, x, y, z, p)


def place(chain: NDArray[np.float64], i: int, x: Vec, y: Vec, z: Vec, p: Vec) -> tuple[Vec, Vec, Vec, Vec]:
    """The frame x, y, z, p followed by the constant placement i."""
    d = mix(x, chain[i, 0, 3], y, chain[i, 1, 3], z, chain[i, 2, 3])
    return (
        mix(x, chain[i, 0, 0], y, chain[i, 1, 0], z, chain[i, 2, 0]),
        mix(x, chain[i, 0, 1], y, chain[i, 1, 1], z, chain[i, 2, 1]),
        mix(x, chain[i, 0, 2], y, chain[i, 1, 2], z, chain[i, 2, 2]),
        (p[0] + d[0], p[1] + d[1], p[2] + d[2]),
    )


def deviation(T: NDArray[np.float64], x: Vec, y: Vec, z: Vec, p: Vec) -> tuple[Vec, Vec, float]:
    """Position difference target - reached [m], rotation difference as sin(angle) axis, and cos(angle)."""
    tx = (T[0, 0], T[1, 0], T[2, 0])
    ty = (T[0, 1], T[1, 1], T[2, 1])
    tz = (T[0, 2], T[1, 2], T[2, 2])
    turn = mix(cross(x, tx), 0.5, cross(y, ty), 0.5, cross(z, tz), 0.5)
    return minus((T[0, 3], T[1, 3], T[2, 3]), p), turn, 0.5 * (dot(x, tx) + dot(y, ty) + dot(z, tz) - 1.0)


def errors(chain: NDArray[np.float64], T: NDArray[np.float64], q: NDArray[np.float64]) -> tuple[float, float]:
    """Position error [m] and orientation error [rad] of q against the (4, 4) target."""
    x, y, z, p = forward(chain, q)
    d, turn, cosine = deviation(T, x, y, z, p)
    return norm(d), math.atan2(norm(turn), cosine)


def linearise(
    chain: NDArray[np.float64], T: NDArray[np.float64], q: NDArray[np.float64], system: NDArray[np.float64]
) -> None:
    """Fill system (6, 7) with the Jacobian and, in column 6, the deviation from the target."""
    x, y, z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
    p = (0.0, 0.0, 0.0)
    for j in range(6):
        x, y, z, p = place(chain, j, x, y, z, p)
        c, s = math.cos(q[j]), math.sin(q[j])
        x, y = mix(x, c, y, s, y, 0.0), mix(y, c, x, -s, x, 0.0)
        for i in range(3):
            system[i, j] = p[i]
            system[i + 3, j] = z[i]
    x, y, z, end = place(chain, 6, x, y, z, p)
    d, turn, _ = deviation(T, x, y, z, end)
    for j in range(6):
        axis = (system[3, j], system[4, j], system[5, j])
        v = cross(axis, minus(end, (system[0, j], system[1, j], system[2, j])))
        for i in range(3):
            system[i, j] = v[i]
    for i in range(3):
        system[i, 6] = d[i]
        system[i + 3, 6] = turn[i]


class Newton(NamedTuple):
    """A configuration and what Newton's method on it needs."""

    q: NDArray[np.float64]  # (6,) [rad], changed in place
    held: NDArray[np.float64]  # (6,) 1 for joints that a least-squares step leaves alone
    system: NDArray[np.float64]  # (6, 7)
    normal: NDArray[np.float64]  # (6, 7)


def make_newton() -> Newton:
    """Fresh work arrays."""
    return Newton(np.empty(6), np.empty(6), np.empty((6, 7)), np.empty((6, 7)))


def newton_step(chain: NDArray[np.float64], T: NDArray[np.float64], work: Newton) -> bool:
    """One Newton step on all joints, in place; False (q untouched) where the Jacobian is singular."""
    linearise(chain, T, work.q, work.system)
    if not eliminate(work.system):
        return False
    for j in range(6):
        work.q[j] += work.system[j, 6]
    return True


def least_squares(chain: NDArray[np.float64], T: NDArray[np.float64], work: Newton, steps: int) -> bool:
    """Gauss-Newton steps on the joints that are not held, in place; False where the equations are singular."""
    q, held, system, normal = work.q, work.held, work.system, work.normal
    for _ in range(steps):
        linearise(chain, T, q, system)
        normal_equations(system, held, normal)
        if not solve_normal(normal):
            return False
        for j in range(6):
            q[j] += normal[j, 6]
    return True


def normal_equations(system: NDArray[np.float64], held: NDArray[np.float64], normal: NDArray[np.float64]) -> None:
    """Fill normal (6, 7), on and above its diagonal, with the damped normal equations of system (6, 7).

    Held joints get a step of zero.
    """
    trace = 0.0
    for i in range(6):
        for j in range(i, 7):
            product = 0.0
            if held[i] == 0.0 and (j == 6 or held[j] == 0.0):
                for row in range(6):
                    product += system[row, i] * system[row, j]
            normal[i, j] = product
        trace += normal[i, i]
    for i in range(6):
        normal[i, i] += 1.0 if held[i] > 0.0 else DAMPING * trace


def solve_normal(normal: NDArray[np.float64]) -> bool:
    """Solve the (6, 7) equations that `normal_equations` fills, in place, by elimination; the solution is column 6.

    They are symmetric and positive, so that no pivoting is needed.
    """
    for column in range(6):
        if normal[column, column] < SMALLEST_PIVOT:
            return False
        scale = 1.0 / normal[column, column]
        for row in range(column + 1, 6):
            factor = normal[column, row] * scale
            for j in range(row, 7):
                normal[row, j] -= factor * normal[column, j]
    for i in range(5, -1, -1):
        for j in range(i + 1, 6):
            normal[i, 6] -= normal[i, j] * normal[j, 6]
        normal[i, 6] /= normal[i, i]
    return True


def eliminate(system: NDArray[np.float64]) -> bool:
    """Solve the (6, 7) system in place by Gauss-Jordan with row pivoting; the solution is column 6."""
    for column in range(6):
        pivot = column
        for row in range(column + 1, 6):
            if abs(system[row, column]) > abs(system[pivot, column]):
                pivot = row
        if abs(system[pivot, column]) < SMALLEST_PIVOT:
            return False
        for j in range(column, 7):
            swap = system[column, j]
            system[column, j] = system[pivot, j]
            system[pivot, j] = swap
        scale = 1.0 / system[column, column]
        for j in range(column, 7):
            system[column, j] *= scale
        for row in range(6):
            factor = system[row, column]
            if row != column and factor != 0.0:
                for j in range(column, 7):
                    system[row, j] -= factor * system[column, j]
    return True
