"""Forward kinematics on the model's own joint placements, errors against a target, and Newton on all six joints."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from jacokin.ik.kernels_vector import Vec, cross, dot, minus, mix, norm

#: Smaller pivots mean a singular Jacobian.
SMALLEST_PIVOT = 1e-14


def forward(
    chain: NDArray[np.float64], q: NDArray[np.float64], axes: NDArray[np.float64]
) -> tuple[Vec, Vec, Vec, Vec]:
    """Columns x, y, z of the solved frame's rotation, and its position [m].

    Args:
        chain: (7, 3, 4) placements between joints that turn about z.
        q: (6,) joint angles [rad].
        axes: (6, 6) filled with each joint's axis and origin.
    """
    x, y, z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
    p = (0.0, 0.0, 0.0)
    for i in range(7):
        M = chain[i]
        d = mix(x, M[0, 3], y, M[1, 3], z, M[2, 3])
        p = (p[0] + d[0], p[1] + d[1], p[2] + d[2])
        u = mix(x, M[0, 0], y, M[1, 0], z, M[2, 0])
        v = mix(x, M[0, 1], y, M[1, 1], z, M[2, 1])
        z = mix(x, M[0, 2], y, M[1, 2], z, M[2, 2])
        if i < 6:
            axes[i, 0], axes[i, 1], axes[i, 2] = z[0], z[1], z[2]
            axes[i, 3], axes[i, 4], axes[i, 5] = p[0], p[1], p[2]
            c, s = math.cos(q[i]), math.sin(q[i])
            x = mix(u, c, v, s, v, 0.0)
            y = mix(v, c, u, -s, u, 0.0)
        else:
            x, y = u, v
    return x, y, z, p


def deviation(T: NDArray[np.float64], x: Vec, y: Vec, z: Vec, p: Vec) -> tuple[Vec, Vec, float]:
    """Position difference target - reached [m], rotation difference as sin(angle) axis, and cos(angle)."""
    tx = (T[0, 0], T[1, 0], T[2, 0])
    ty = (T[0, 1], T[1, 1], T[2, 1])
    tz = (T[0, 2], T[1, 2], T[2, 2])
    turn = mix(cross(x, tx), 0.5, cross(y, ty), 0.5, cross(z, tz), 0.5)
    return minus((T[0, 3], T[1, 3], T[2, 3]), p), turn, 0.5 * (dot(x, tx) + dot(y, ty) + dot(z, tz) - 1.0)


def errors(
    chain: NDArray[np.float64], T: NDArray[np.float64], q: NDArray[np.float64], axes: NDArray[np.float64]
) -> tuple[float, float]:
    """Position error [m] and orientation error [rad] of q against the (4, 4) target."""
    x, y, z, p = forward(chain, q, axes)
    d, turn, cosine = deviation(T, x, y, z, p)
    return norm(d), math.atan2(norm(turn), cosine)


def newton_step(
    chain: NDArray[np.float64],
    T: NDArray[np.float64],
    q: NDArray[np.float64],
    axes: NDArray[np.float64],
    system: NDArray[np.float64],
) -> bool:
    """One Newton step on the 6 x 6 Jacobian, in place; False (q untouched) where that is singular.

    ``system`` is a (6, 7) workspace.
    """
    x, y, z, p = forward(chain, q, axes)
    d, turn, _ = deviation(T, x, y, z, p)
    for j in range(6):
        axis = (axes[j, 0], axes[j, 1], axes[j, 2])
        v = cross(axis, minus(p, (axes[j, 3], axes[j, 4], axes[j, 5])))
        for i in range(3):
            system[i, j] = v[i]
            system[i + 3, j] = axis[i]
    for i in range(3):
        system[i, 6] = d[i]
        system[i + 3, 6] = turn[i]
    if not eliminate(system):
        return False
    for j in range(6):
        q[j] += system[j, 6]
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
