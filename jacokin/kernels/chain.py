"""Kinematics of one configuration: poses, errors against a target, Jacobians, and Newton's method."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from jacokin.arrays import Array
from jacokin.kernels.tolerances import DAMPING, SMALLEST_PIVOT
from jacokin.kernels.trigonometry import angle_of, sin_cos
from jacokin.kernels.vector import Vec, cross, dot, minus, mix, norm

#: Smaller pivots mean a singular system of seven joints.
SMALLEST_PIVOT_7 = 1e-13
#: [m] and [rad]; a residual above this is a step that went astray.
ASTRAY = 1.0


#: Columns of a rotation, and a position [m].
Frame = tuple[Vec, Vec, Vec, Vec]
BASE: Frame = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.0, 0.0, 0.0))


def forward(chain: Array, q: Array) -> Frame:
    """Columns x, y, z of the solved frame's rotation, and its position [m].

    Args:
        chain: (7, 3, 4) placements between joints that turn about z.
        q: (6,) joint angles [rad].
    """
    x, y, z, p = BASE
    for i in range(6):
        x, y, z, p = moved(chain, i, False, q[i], x, y, z, p)
    return place(chain, 6, x, y, z, p)


def moved(chain: Array, j: int, slides: bool, q: float, x: Vec, y: Vec, z: Vec, p: Vec) -> Frame:
    """The frame x, y, z, p followed by joint j: its placement, then q about its z axis [rad], or along it [m]."""
    x, y, z, p = place(chain, j, x, y, z, p)
    if slides:
        return x, y, z, (p[0] + q * z[0], p[1] + q * z[1], p[2] + q * z[2])
    s, c = sin_cos(q)
    return mix(x, c, y, s, y, 0.0), mix(y, c, x, -s, x, 0.0), z, p


def place(chain: Array, i: int, x: Vec, y: Vec, z: Vec, p: Vec) -> Frame:
    """The frame x, y, z, p followed by the constant placement i."""
    d = mix(x, chain[i, 0, 3], y, chain[i, 1, 3], z, chain[i, 2, 3])
    return (
        mix(x, chain[i, 0, 0], y, chain[i, 1, 0], z, chain[i, 2, 0]),
        mix(x, chain[i, 0, 1], y, chain[i, 1, 1], z, chain[i, 2, 1]),
        mix(x, chain[i, 0, 2], y, chain[i, 1, 2], z, chain[i, 2, 2]),
        (p[0] + d[0], p[1] + d[1], p[2] + d[2]),
    )


def deviation(T: Array, x: Vec, y: Vec, z: Vec, p: Vec) -> tuple[Vec, Vec, float]:
    """Position difference target - reached [m], rotation difference as sin(angle) axis, and cos(angle)."""
    tx, ty, tz, tp = columns_of(T)
    return between(tx, ty, tz, tp, x, y, z, p)


def columns_of(T: Array) -> Frame:
    """The columns of a pose: axes and position."""
    x, y, z = (T[0, 0], T[1, 0], T[2, 0]), (T[0, 1], T[1, 1], T[2, 1]), (T[0, 2], T[1, 2], T[2, 2])
    return x, y, z, (T[0, 3], T[1, 3], T[2, 3])


def between(tx: Vec, ty: Vec, tz: Vec, tp: Vec, x: Vec, y: Vec, z: Vec, p: Vec) -> tuple[Vec, Vec, float]:
    """`deviation` from the columns of a target."""
    turn = mix(cross(x, tx), 0.5, cross(y, ty), 0.5, cross(z, tz), 0.5)
    return minus(tp, p), turn, 0.5 * (dot(x, tx) + dot(y, ty) + dot(z, tz) - 1.0)


def errors(chain: Array, T: Array, q: Array) -> tuple[float, float]:
    """Position error [m] and orientation error [rad] of q against the (4, 4) target."""
    x, y, z, p = forward(chain, q)
    d, turn, cosine = deviation(T, x, y, z, p)
    return norm(d), angle_of(norm(turn), cosine)


def fill_system(joints: int, chain: Array, T: Array, q: Array, system: Array) -> tuple[Vec, Vec, float]:
    """Fill the first six rows of system with the Jacobian of so many joints and, in the next column, the deviation.

    Returns:
        The deviation from the target, as `deviation` gives it.
    """
    x, y, z, p = BASE
    for j in range(joints):
        x, y, z, p = moved(chain, j, False, q[j], x, y, z, p)
        for i in range(3):
            system[i, j] = p[i]
            system[i + 3, j] = z[i]
    x, y, z, end = place(chain, joints, x, y, z, p)
    position, turn, cosine = deviation(T, x, y, z, end)
    for j in range(joints):
        axis = (system[3, j], system[4, j], system[5, j])
        v = cross(axis, minus(end, (system[0, j], system[1, j], system[2, j])))
        for i in range(3):
            system[i, j] = v[i]
    for i in range(3):
        system[i, joints] = position[i]
        system[i + 3, joints] = turn[i]
    return position, turn, cosine


# Six joints: the pose determines them.


def linearise(chain: Array, T: Array, q: Array, system: Array) -> None:
    """Fill system (6, 7) with the Jacobian and, in column 6, the deviation from the target."""
    fill_system(6, chain, T, q, system)


class Newton(NamedTuple):
    """A configuration and what Newton's method on it needs."""

    q: Array  # (6,) [rad], changed in place
    held: Array  # (6,) 1 for joints that a least-squares step leaves alone
    system: Array  # (6, 7)
    normal: Array  # (6, 7)


def make_newton() -> Newton:
    """Fresh work arrays."""
    return Newton(np.empty(6), np.empty(6), np.empty((6, 7)), np.empty((6, 7)))


def newton_step(chain: Array, T: Array, work: Newton) -> bool:
    """One Newton step on all joints, in place; False (q untouched) where the Jacobian is singular."""
    linearise(chain, T, work.q, work.system)
    if not eliminate(work.system):
        return False
    for j in range(6):
        work.q[j] += work.system[j, 6]
    return True


def least_squares(chain: Array, T: Array, work: Newton, steps: int) -> bool:
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


def normal_equations(system: Array, held: Array, normal: Array) -> None:
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


def solve_normal(normal: Array) -> bool:
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


def bring_pivot(a: Array, column: int, rows: int, first: int, last: int) -> int:
    """Swap row ``column`` with that of the largest entry in its column from there on, in columns first to last - 1.

    Returns:
        The row that it was swapped with.
    """
    pivot = column
    for row in range(column + 1, rows):
        if abs(a[row, column]) > abs(a[pivot, column]):
            pivot = row
    if pivot != column:
        for j in range(first, last):
            swap = a[column, j]
            a[column, j] = a[pivot, j]
            a[pivot, j] = swap
    return pivot


def triangulate(a: Array, columns: int, last: int, product: float) -> float:
    """Eliminate the first columns of six rows below the diagonal, in place, up to column last - 1.

    Returns:
        A product so far, times the determinant of those columns' pivots; 0 where one vanishes.
    """
    for column in range(columns):
        if bring_pivot(a, column, 6, column, last) != column:
            product = -product
        value = a[column, column]
        if value == 0.0:
            return 0.0
        product *= value
        for row in range(column + 1, 6):
            factor = a[row, column] / value
            for j in range(column + 1, last):
                a[row, j] -= factor * a[column, j]
    return product


def eliminate(system: Array) -> bool:
    """Solve the (6, 7) system in place by Gauss-Jordan with row pivoting; the solution is column 6."""
    for column in range(6):
        bring_pivot(system, column, 6, column, 7)
        if abs(system[column, column]) < SMALLEST_PIVOT:
            return False
        scale = 1.0 / system[column, column]
        for j in range(column, 7):
            system[column, j] *= scale
        for row in range(6):
            factor = system[row, column]
            if row != column and factor != 0.0:
                for j in range(column, 7):
                    system[row, j] -= factor * system[column, j]
    return True


# Seven joints: one condition more goes with the pose. They have their own elimination, which gives the sign of the
# determinant as well: one routine for both would change roundings, and be slower for six joints.


def linearise7(chain: Array, T: Array, x: Array, system: Array) -> float:
    """Fill rows 0 to 5 of system (7, 8) with the Jacobian of seven joints and, in column 7, the deviation from T.

    Returns:
        The larger of position error [m] and orientation error [rad].
    """
    position, turn, cosine = fill_system(7, chain, T, x, system)
    return max(norm(position), angle_of(norm(turn), cosine))


def eliminate7(system: Array) -> float:
    """Solve the (7, 8) system in place by Gauss elimination with row pivoting; the solution is column 7.

    Returns:
        The determinant, 0 where it is singular.
    """
    product = 1.0
    for column in range(7):
        if bring_pivot(system, column, 7, column, 8) != column:
            product = -product
        if abs(system[column, column]) < SMALLEST_PIVOT_7:
            return 0.0
        product *= system[column, column]
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
    return product


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


def null_tangent(border: Array, t: Array, system: Array) -> float:
    """Fill t with the unit vector of the null space for which border . t > 0: the tangent of the self-motion.

    The Jacobian is in system, from `linearise7`.

    Returns:
        The determinant of the Jacobian with t as its seventh row: the product of its singular values, and a sign; 0
        where there is no tangent. Along a curve the sign does not change, and a step that leaps to another curve beside
        it changes it.
    """
    for j in range(7):
        system[6, j] = border[j]
    for i in range(6):
        system[i, 7] = 0.0
    system[6, 7] = 1.0
    determinant = eliminate7(system)
    if determinant == 0.0:
        return 0.0
    square = 0.0
    for j in range(7):
        square += system[j, 7] * system[j, 7]
    length = math.sqrt(square)
    for j in range(7):
        t[j] = system[j, 7] / length
    return determinant * length
