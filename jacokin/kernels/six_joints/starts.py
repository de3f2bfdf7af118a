"""From a root theta_3 to configurations: the null vector of M gives theta_4 and theta_5, then the loop the rest."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.chain import bring_pivot
from jacokin.kernels.six_joints.equations import (
    SIZE_OF_PHI,
    Equations,
    K,
    L,
    M,
    P,
    fill_phi,
    still_place,
)
from jacokin.kernels.six_joints.loop import column_of, joint_of
from jacokin.kernels.tolerances import SMALLEST_PIVOT
from jacokin.kernels.vector import Vec

ROUNDS_OF_SUBSPACE = 2
MOST_STARTS = 6


class NullSpace(NamedTuple):
    """M decomposed, the two vectors that it makes smallest, and the configurations that follow."""

    lu: Array  # (12, 12)
    order: NDArray[np.int64]  # (12,) rows of M
    vectors: Array  # (2, 12)
    other: Array  # (12,)
    mixed: Array  # (12,)
    phi: Array  # (15,)
    starts: Array  # (6, 6) [rad]


def make_null_space() -> NullSpace:
    """Fresh work arrays."""
    return NullSpace(
        np.zeros((12, 12)),
        np.zeros(12, np.int64),
        np.zeros((2, 12)),
        np.zeros(12),
        np.zeros(12),
        np.zeros(SIZE_OF_PHI),
        np.zeros((MOST_STARTS, 6)),
    )


def decompose(e: Equations, theta_3: float, work: NullSpace) -> None:
    """Fill lu and order with the triangular factors of M(theta_3), pivots that vanish replaced by tiny ones."""
    lu, parts = work.lu, e.parts
    c, s = math.cos(theta_3), math.sin(theta_3)
    largest = 0.0
    for i in range(6):
        for j in range(3):
            lu[i, j + 9] = 0.0
            lu[i + 6, j] = 0.0
        for j in range(9):
            value = c * parts[0, i, j] + s * parts[1, i, j] + parts[2, i, j]
            lu[i, j] = value
            lu[i + 6, j + 3] = value
            largest = max(largest, abs(value))
    for i in range(12):
        work.order[i] = i
    for column in range(12):
        pivot = bring_pivot(lu, column, 12, 0, 12)
        index = work.order[column]
        work.order[column] = work.order[pivot]
        work.order[pivot] = index
        if abs(lu[column, column]) < SMALLEST_PIVOT * SMALLEST_PIVOT * largest:
            lu[column, column] = SMALLEST_PIVOT * SMALLEST_PIVOT * largest
        for row in range(column + 1, 12):
            factor = lu[row, column] / lu[column, column]
            lu[row, column] = factor
            for j in range(column + 1, 12):
                lu[row, j] -= factor * lu[column, j]


def back_substitute(lu: Array, v: Array) -> None:
    """Solve U x = v in place."""
    for i in range(11, -1, -1):
        value = v[i]
        for j in range(i + 1, 12):
            value -= lu[i, j] * v[j]
        v[i] = value / lu[i, i]


def solve_decomposed(work: NullSpace, v: Array) -> None:
    """Solve M x = v in place."""
    lu, other = work.lu, work.other
    for i in range(12):
        value = v[work.order[i]]
        for j in range(i):
            value -= lu[i, j] * other[j]
        other[i] = value
    for i in range(12):
        v[i] = other[i]
    back_substitute(lu, v)


def solve_transposed(work: NullSpace, v: Array) -> None:
    """Solve M^T x = v in place."""
    lu, other = work.lu, work.other
    for i in range(12):
        value = v[i]
        for j in range(i):
            value -= lu[j, i] * other[j]
        other[i] = value / lu[i, i]
    for i in range(11, -1, -1):
        for j in range(i + 1, 12):
            other[i] -= lu[j, i] * other[j]
    for i in range(12):
        v[work.order[i]] = other[i]


def normalise(v: Array) -> None:
    """Make a vector one of length 1, in place."""
    largest, size = 0.0, 0.0
    for i in range(12):
        largest = max(largest, abs(v[i]))
    scale = 1.0 / largest if largest > 0.0 else 0.0
    for i in range(12):
        v[i] *= scale
        size += v[i] * v[i]
    scale = 1.0 / math.sqrt(size) if size > 0.0 else 0.0
    for i in range(12):
        v[i] *= scale


def orthonormalise(vectors: Array) -> None:
    """Make two vectors (2, 12) orthonormal, in place."""
    normalise(vectors[0])
    normalise(vectors[1])
    for _ in range(2):
        along = 0.0
        for i in range(12):
            along += vectors[0, i] * vectors[1, i]
        for i in range(12):
            vectors[1, i] -= along * vectors[0, i]
        normalise(vectors[1])


def fill_null_space(work: NullSpace) -> None:
    """Fill vectors with the two directions that M makes smallest, by inverse iteration."""
    vectors = work.vectors
    for i in range(12):
        vectors[0, i] = 1.0
        vectors[1, i] = 1.0 if i % 2 == 0 else -1.0 + 0.1 * i
    for _ in range(ROUNDS_OF_SUBSPACE):
        for n in range(2):
            solve_transposed(work, vectors[n])
        orthonormalise(vectors)
        for n in range(2):
            solve_decomposed(work, vectors[n])
        orthonormalise(vectors)


def fill_null_vector(work: NullSpace) -> None:
    """Fill vectors[0] with the direction that M makes smallest, where no other is nearly as small."""
    for i in range(12):
        work.vectors[0, i] = 1.0
    back_substitute(work.lu, work.vectors[0])


def half_angle(v: Array, stride: int, count: int, across: int, other: int) -> float:
    """The angle whose half has the ratio S : C of neighbouring entries of v, in the least-squares sense.

    Args:
        v: (12,) products of forms.
        stride: from one form of the angle to the next.
        count: how many ratios there are.
        across: from one form of the other angle to the next.
        other: how many of those there are.
    """
    cc, cs, ss = 0.0, 0.0, 0.0
    for j in range(other):
        for i in range(count):
            a, b = v[j * across + i * stride], v[j * across + (i + 1) * stride]
            cc += a * a
            cs += a * b
            ss += b * b
    return math.atan2(2.0 * cs, cc - ss)


def fill_starts(e: Equations, labelling: int, theta_3: float, work: NullSpace) -> int:
    """Fill starts with the configurations that two null vectors may hold; returns how many.

    True null vectors are products: shifted by one form of theta_4 (or theta_5) they are multiplied by S : C. With two
    vectors, of which mixtures were found, that is an eigenproblem of two rows.
    """
    count = 0
    for turn in range(2):
        stride, rows = (3, 9) if turn == 0 else (1, 12)
        p00, p01, p11, r00, r01, r10, r11, size = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for i in range(rows):
            if turn == 1 and i % 3 == 2:
                continue
            a, b = work.vectors[0, i], work.vectors[1, i]
            c, d = work.vectors[0, i + stride], work.vectors[1, i + stride]
            p00, p01, p11 = p00 + a * a, p01 + a * b, p11 + b * b
            r00, r01, r10, r11 = r00 + a * c, r01 + a * d, r10 + b * c, r11 + b * d
            size += c * c + d * d
        det = p00 * p11 - p01 * p01
        if det <= 0.0 or size <= 0.0:
            continue
        m00, m01 = (p11 * r00 - p01 * r10) / det, (p11 * r01 - p01 * r11) / det
        m10, m11 = (p00 * r10 - p01 * r00) / det, (p00 * r11 - p01 * r01) / det
        mean, half = 0.5 * (m00 + m11), 0.5 * (m00 - m11)
        apart = math.sqrt(max(half * half + m01 * m10, 0.0))
        for k in range(2):
            value = mean + apart if k == 0 else mean - apart
            # An eigenvector, from the longer row of M - value.
            x, y = m01, value - m00
            if abs(value - m11) + abs(m10) > abs(x) + abs(y):
                x, y = value - m11, m10
            for i in range(12):
                work.mixed[i] = x * work.vectors[0, i] + y * work.vectors[1, i]
            start_from(e, labelling, theta_3, work.mixed, work, work.starts[count])
            count += 1
    for n in range(2):
        start_from(e, labelling, theta_3, work.vectors[n], work, work.starts[count])
        count += 1
    return count


def start_from(e: Equations, labelling: int, theta_3: float, v: Array, work: NullSpace, q: Array) -> None:
    """Fill q (6,) with the configuration that follows from theta_3 and a null vector v (12,)."""
    links, right, phi = e.links, e.right, work.phi
    theta_4 = half_angle(v, 3, 3, 1, 3)
    theta_5 = half_angle(v, 1, 2, 3, 4)
    # A = L_2 Rz(theta_3) L_3 Rz(theta_4) L_4 Rz(theta_5) L_5, from the right: its x and z axes, and position.
    x, z, p = column_of(links[4], 0), column_of(links[4], 2), column_of(links[4], 3)
    for i in range(3):
        angle = theta_5 if i == 0 else (theta_4 if i == 1 else theta_3)
        c, s = math.cos(angle), math.sin(angle)
        link = links[3 - i]
        t = column_of(link, 3)
        x, z = turned_and_placed(link, c, s, x), turned_and_placed(link, c, s, z)
        p = turned_and_placed(link, c, s, p)
        p = (p[0] + t[0], p[1] + t[1], p[2] + t[2])
    fill_phi(p, z, phi)
    theta_1 = angle_1(right, phi)
    c1, s1 = math.cos(theta_1), math.sin(theta_1)
    u, w = 0.0, 0.0
    for v0 in (P, L, M, K):
        a = s1 * right[0, v0] + c1 * right[1, v0] + right[2, v0]
        b = s1 * right[0, v0 + 1] + c1 * right[1, v0 + 1] + right[2, v0 + 1]
        u += a * phi[v0] + b * phi[v0 + 1]
        w += a * phi[v0 + 1] - b * phi[v0]
    theta_2 = -math.atan2(w, u)
    # A = Rz(-theta_2) L_1^-1 Rz(-theta_1) L_6^-1 Rz(-theta_6): the x axes of both sides.
    x = (math.cos(theta_2) * x[0] - math.sin(theta_2) * x[1], math.sin(theta_2) * x[0] + math.cos(theta_2) * x[1], x[2])
    x = (
        links[0, 0, 0] * x[0] + links[0, 0, 1] * x[1] + links[0, 0, 2] * x[2],
        links[0, 1, 0] * x[0] + links[0, 1, 1] * x[1] + links[0, 1, 2] * x[2],
        links[0, 2, 0] * x[0] + links[0, 2, 1] * x[1] + links[0, 2, 2] * x[2],
    )
    x = (c1 * x[0] - s1 * x[1], s1 * x[0] + c1 * x[1], x[2])
    x = (
        links[5, 0, 0] * x[0] + links[5, 0, 1] * x[1] + links[5, 0, 2] * x[2],
        links[5, 1, 0] * x[0] + links[5, 1, 1] * x[1] + links[5, 1, 2] * x[2],
        links[5, 2, 0] * x[0] + links[5, 2, 1] * x[1] + links[5, 2, 2] * x[2],
    )
    theta_6 = -math.atan2(x[1], x[0])
    q[joint_of(labelling, 0)], q[joint_of(labelling, 1)], q[joint_of(labelling, 2)] = theta_1, theta_2, theta_3
    q[joint_of(labelling, 3)], q[joint_of(labelling, 4)], q[joint_of(labelling, 5)] = theta_4, theta_5, theta_6


def turned_and_placed(link: Array, c: float, s: float, v: Vec) -> Vec:
    """R Rz v."""
    x, y, z = c * v[0] - s * v[1], s * v[0] + c * v[1], v[2]
    return (
        link[0, 0] * x + link[0, 1] * y + link[0, 2] * z,
        link[1, 0] * x + link[1, 1] * y + link[1, 2] * z,
        link[2, 0] * x + link[2, 1] * y + link[2, 2] * z,
    )


def angle_1(right: Array, phi: Array) -> float:
    """theta_1 from the six equations that theta_2 does not turn, in the least-squares sense."""
    ss, sc, cc, sr, cr = 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(6):
        place = still_place(i)
        a, b = right[0, place], right[1, place]
        rest = phi[place] - right[2, place]
        ss += a * a
        sc += a * b
        cc += b * b
        sr += a * rest
        cr += b * rest
    return math.atan2(sr * cc - cr * sc, cr * ss - sr * sc)
