"""Pairs of complex solutions of six joints: how far their other angles are from real ones.

Where a root x of F(x; p) comes to the real axis, two solutions become real only if all their angles do. Two complex
solutions that have one real angle in common bring a root there as well, and it leaves again.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from jacokin.arrays import Array
from jacokin.kernels.six_joints.equations import Equations

#: Unknowns of the linear equations: products of cubic forms of theta_4 and quadratic forms of theta_5.
UNKNOWNS = 12
#: Stands for a pivot that vanishes, relative to the largest element.
NO_PIVOT = 1e-30


class PairWork(NamedTuple):
    """The equations of a complex theta_3."""

    system: Array  # (12, 24) M, real and imaginary parts of each element
    vector: Array  # (24,) what it makes smallest


def make_pair_work() -> PairWork:
    """Fresh arrays."""
    return PairWork(np.zeros((UNKNOWNS, 2 * UNKNOWNS)), np.zeros(2 * UNKNOWNS))


def other_angles_apart(e: Equations, z: complex, work: PairWork) -> tuple[float, float]:
    """How far theta_4 and theta_5 are from the real axis where z = exp(i theta_3) is a root of F [rad]."""
    largest = fill_system(e, z, work.system)
    eliminate(work.system, largest)
    fill_smallest(work.system, work.vector)
    return apart(work.vector, 3, 3, 1, 3), apart(work.vector, 1, 2, 3, 4)


def fill_system(e: Equations, z: complex, system: Array) -> float:
    """Fill system with M(theta_3), see `characteristic`; returns its largest element, in absolute value."""
    c, s, largest = 0.5 * (z + 1.0 / z), -0.5j * (z - 1.0 / z), 0.0
    for i in range(UNKNOWNS):
        for j in range(2 * UNKNOWNS):
            system[i, j] = 0.0
    for i in range(6):
        for j in range(9):
            value = c * e.parts[0, i, j] + s * e.parts[1, i, j] + e.parts[2, i, j]
            system[i, 2 * j], system[i, 2 * j + 1] = value.real, value.imag
            system[i + 6, 2 * j + 6], system[i + 6, 2 * j + 7] = value.real, value.imag
            largest = max(largest, abs(value.real), abs(value.imag))
    return largest


def element(system: Array, i: int, j: int) -> complex:
    """Element (i, j) of a complex matrix."""
    return complex(system[i, 2 * j], system[i, 2 * j + 1])


def eliminate(system: Array, largest: float) -> None:
    """Make the system triangular, in place; pivots that vanish are replaced by tiny ones."""
    for column in range(UNKNOWNS):
        pivot, size = column, -1.0
        for i in range(column, UNKNOWNS):
            square = system[i, 2 * column] ** 2 + system[i, 2 * column + 1] ** 2
            if square > size:
                pivot, size = i, square
        if pivot != column:
            for j in range(2 * column, 2 * UNKNOWNS):
                kept = system[column, j]
                system[column, j] = system[pivot, j]
                system[pivot, j] = kept
        if size <= (NO_PIVOT * largest) ** 2:
            system[column, 2 * column], system[column, 2 * column + 1] = NO_PIVOT * largest, 0.0
        inverse = 1.0 / element(system, column, column)
        for i in range(column + 1, UNKNOWNS):
            factor = element(system, i, column) * inverse
            a, b = factor.real, factor.imag
            if a != 0.0 or b != 0.0:
                for j in range(column + 1, UNKNOWNS):
                    x, y = system[column, 2 * j], system[column, 2 * j + 1]
                    system[i, 2 * j] -= a * x - b * y
                    system[i, 2 * j + 1] -= a * y + b * x


def fill_smallest(system: Array, vector: Array) -> None:
    """Fill vector with what a triangular system, nearly singular, makes smallest; its length is about 1."""
    largest = 0.0
    for i in range(UNKNOWNS - 1, -1, -1):
        value = 1.0 + 0.0j
        for j in range(i + 1, UNKNOWNS):
            value -= element(system, i, j) * complex(vector[2 * j], vector[2 * j + 1])
        value /= element(system, i, i)
        vector[2 * i], vector[2 * i + 1] = value.real, value.imag
        largest = max(largest, abs(value.real), abs(value.imag))
    for i in range(2 * UNKNOWNS):
        vector[i] /= largest


def apart(v: Array, stride: int, count: int, across: int, other: int) -> float:
    """How far from the real axis the angle is whose half has the ratio S : C of neighbouring entries of v [rad].

    See `starts.half_angle` for the arguments.
    """
    cc, ss, cs = 0.0, 0.0, 0.0j
    for j in range(other):
        for i in range(count):
            n = j * across + i * stride
            a = complex(v[2 * n], v[2 * n + 1])
            b = complex(v[2 * (n + stride)], v[2 * (n + stride) + 1])
            cc += a.real * a.real + a.imag * a.imag
            ss += b.real * b.real + b.imag * b.imag
            cs += a.conjugate() * b
    c, s = (complex(cc, 0.0), cs) if cc >= ss else (cs.conjugate(), complex(ss, 0.0))
    ahead, behind = c + 1.0j * s, c - 1.0j * s
    a, b = ahead.real**2 + ahead.imag**2, behind.real**2 + behind.imag**2
    if a == 0.0 or b == 0.0:
        return math.inf
    return 0.5 * abs(math.log(a / b))
