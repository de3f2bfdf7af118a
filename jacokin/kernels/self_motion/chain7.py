"""Seven joints in a chain: kinematics, and Newton steps on the pose and one condition more."""

from __future__ import annotations

import math

from jacokin.arrays import Array
from jacokin.kernels.chain import deviation, place
from jacokin.kernels.vector import cross, mix, norm

#: Smaller pivots mean a singular system.
SMALLEST_PIVOT_7 = 1e-13
#: [m] and [rad]; a residual above this is a step that went astray.
ASTRAY = 1.0


def linearise7(chain: Array, T: Array, x: Array, system: Array) -> float:
    """Fill rows 0 to 5 of system with the Jacobian and, in column 7, the deviation from the target.

    Args:
        chain: (8, 3, 4) placements between joints that turn about z.
        T: (4, 4) target.
        x: (7,) joint angles [rad].
        system: (7, 8); row 6 is left alone.

    Returns:
        The larger of position error [m] and orientation error [rad].
    """
    X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
    p = (0.0, 0.0, 0.0)
    for j in range(7):
        X, Y, Z, p = place(chain, j, X, Y, Z, p)
        for i in range(3):
            system[i, j] = p[i]
            system[i + 3, j] = Z[i]
        c, s = math.cos(x[j]), math.sin(x[j])
        X, Y = mix(X, c, Y, s, Y, 0.0), mix(Y, c, X, -s, X, 0.0)
    X, Y, Z, end = place(chain, 7, X, Y, Z, p)
    for j in range(7):
        axis = (system[3, j], system[4, j], system[5, j])
        v = cross(axis, (end[0] - system[0, j], end[1] - system[1, j], end[2] - system[2, j]))
        for i in range(3):
            system[i, j] = v[i]
    d, turn, cosine = deviation(T, X, Y, Z, end)
    for i in range(3):
        system[i, 7] = d[i]
        system[i + 3, 7] = turn[i]
    return max(norm(d), math.atan2(norm(turn), cosine))


def eliminate7(system: Array) -> float:
    """Solve the (7, 8) system in place by Gauss elimination with row pivoting; the solution is column 7.

    Returns:
        The sign of the determinant, 0 where it is singular.
    """
    sign = 1.0
    for column in range(7):
        pivot = column
        for row in range(column + 1, 7):
            if abs(system[row, column]) > abs(system[pivot, column]):
                pivot = row
        if abs(system[pivot, column]) < SMALLEST_PIVOT_7:
            return 0.0
        if pivot != column:
            sign = -sign
            for j in range(column, 8):
                swap = system[column, j]
                system[column, j] = system[pivot, j]
                system[pivot, j] = swap
        if system[column, column] < 0.0:
            sign = -sign
        scale = 1.0 / system[column, column]
        for j in range(column + 1, 8):
            system[column, j] *= scale
        for row in range(column + 1, 7):
            factor = system[row, column]
            if factor != 0.0:
                for j in range(column + 1, 8):
                    system[row, j] -= factor * system[column, j]
    for column in range(6, -1, -1):
        value = system[column, 7]
        for j in range(column + 1, 7):
            value -= system[column, j] * system[j, 7]
        system[column, 7] = value
    return sign


def bordered_newton(
    chain: Array, T: Array, x: Array, border: Array, offset: float, system: Array, steps: int, tolerance: float
) -> float:
    """Newton on the pose and border . x = offset, in place.

    Returns:
        The larger of the last closure [m or rad] and the last deviation from the condition; inf where singular.
    """
    size = math.inf
    for _ in range(steps):
        closure = linearise7(chain, T, x, system)
        rest = offset
        for j in range(7):
            system[6, j] = border[j]
            rest -= border[j] * x[j]
        system[6, 7] = rest
        size = max(closure, abs(rest))
        if size <= tolerance or size > ASTRAY:
            return size
        if eliminate7(system) == 0.0:
            return math.inf
        for j in range(7):
            x[j] += system[j, 7]
    return size


def tangent7(chain: Array, T: Array, x: Array, border: Array, t: Array, system: Array) -> float:
    """Fill t with the unit tangent of the solution curve for which border . t > 0.

    Returns:
        The sign of the determinant of the Jacobian with t as its seventh row, 0 where there is no tangent. Along a
        curve the sign does not change, and a step that leaps to another curve beside it changes it.
    """
    linearise7(chain, T, x, system)
    return null_tangent(border, t, system)


def null_tangent(border: Array, t: Array, system: Array) -> float:
    """As `tangent7`, of the Jacobian that `linearise7` left in system."""
    for j in range(7):
        system[6, j] = border[j]
    for i in range(6):
        system[i, 7] = 0.0
    system[6, 7] = 1.0
    sign = eliminate7(system)
    if sign == 0.0:
        return 0.0
    square = 0.0
    for j in range(7):
        square += system[j, 7] * system[j, 7]
    length = math.sqrt(square)
    for j in range(7):
        t[j] = system[j, 7] / length
    return sign
