"""Six equations in theta_3, theta_4 and theta_5: what is left of the loop without theta_1, theta_2 and theta_6.

With A = L_2 Rz(theta_3) L_3 Rz(theta_4) L_4 Rz(theta_5) L_5 the loop says A = Rz(-theta_2) L_1^-1 Rz(-theta_1) L_6^-1
Rz(-theta_6). Position p and z axis l of both sides do not depend on theta_6, and the fifteen numbers

    phi = (1, p, l, p x l, (p.p) l - 2 (p.l) p, p.p, p.l)

are linear in (cos, sin, 1) of every other angle: a placement in front acts on them as a matrix (Raghavan and Roth,
1993). Turned by theta_2, the z components and the scalars stay: six equations, linear in (sin theta_1, cos theta_1, 1).
The x and y components as complex numbers are turned by exp(-i theta_2): four complex equations with three columns. What
is orthogonal to these columns has neither angle: four and two real equations.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from jacokin.arrays import Array
from jacokin.kernels.vector import Vec, cross, dot

#: Places in phi: 1, the four vectors, p.p, p.l.
ONE, P, L, M, K, PP, PL, SIZE_OF_PHI = 0, 1, 4, 7, 10, 13, 14, 15


class Equations(NamedTuple):
    """The equations of one target in one labelling, and what it takes to write them."""

    links: Array  # (6, 3, 4)
    right: Array  # (3, 15) phi of the right side before it is turned by theta_2: parts of sin, cos theta_1, and 1
    rows: Array  # (6, 15) the equations, acting on phi of Rz(theta_3) L_3 ... L_5
    columns: Array  # (9, 15) phi of L_3 ... L_5, parts of the forms in theta_4, theta_5
    thirds: Array  # (3, 15) the same of L_4 ... L_5, forms in theta_5
    parts: Array  # (3, 6, 9) the equations: parts of cos, sin theta_3, and 1, by forms in theta_4, theta_5
    house: Array  # (6, 2) reflectors
    null: Array  # (3, 8) the four complex equations, transposed: real and imaginary parts


def make_equations() -> Equations:
    """Fresh work arrays."""
    return Equations(
        np.zeros((6, 3, 4)),
        np.zeros((3, SIZE_OF_PHI)),
        np.zeros((6, SIZE_OF_PHI)),
        np.zeros((9, SIZE_OF_PHI)),
        np.zeros((3, SIZE_OF_PHI)),
        np.zeros((3, 6, 9)),
        np.zeros((6, 2)),
        np.zeros((3, 8)),
    )


def vector_at(phi: Array, i: int) -> Vec:
    """The vector that begins at place i."""
    return (phi[i], phi[i + 1], phi[i + 2])


def put_vector(phi: Array, i: int, v: Vec) -> None:
    """Write a vector at place i."""
    phi[i], phi[i + 1], phi[i + 2] = v[0], v[1], v[2]


def turned_by(link: Array, v: Vec) -> Vec:
    """R v."""
    return (
        link[0, 0] * v[0] + link[0, 1] * v[1] + link[0, 2] * v[2],
        link[1, 0] * v[0] + link[1, 1] * v[1] + link[1, 2] * v[2],
        link[2, 0] * v[0] + link[2, 1] * v[1] + link[2, 2] * v[2],
    )


def turned_back_by(link: Array, v: Vec) -> Vec:
    """R^T v."""
    return (
        link[0, 0] * v[0] + link[1, 0] * v[1] + link[2, 0] * v[2],
        link[0, 1] * v[0] + link[1, 1] * v[1] + link[2, 1] * v[2],
        link[0, 2] * v[0] + link[1, 2] * v[1] + link[2, 2] * v[2],
    )


def fill_phi(p: Vec, z: Vec, phi: Array) -> None:
    """Fill phi (15,) of a position and a z axis."""
    pp, pz = dot(p, p), dot(p, z)
    phi[ONE], phi[PP], phi[PL] = 1.0, pp, pz
    put_vector(phi, P, p)
    put_vector(phi, L, z)
    put_vector(phi, M, cross(p, z))
    for i in range(3):
        phi[K + i] = pp * z[i] - 2.0 * pz * p[i]


def place_before(link: Array, inverse: bool, phi: Array) -> None:
    """Put a link (3, 4), or its inverse, in front of what phi (15,) describes, in place; any linear part of a phi."""
    t = (link[0, 3], link[1, 3], link[2, 3])
    if inverse:
        t = turned_back_by(link, t)
        t = (-t[0], -t[1], -t[2])
        p, z = turned_back_by(link, vector_at(phi, P)), turned_back_by(link, vector_at(phi, L))
        m, k = turned_back_by(link, vector_at(phi, M)), turned_back_by(link, vector_at(phi, K))
    else:
        p, z = turned_by(link, vector_at(phi, P)), turned_by(link, vector_at(phi, L))
        m, k = turned_by(link, vector_at(phi, M)), turned_by(link, vector_at(phi, K))
    one, tt, tz = phi[ONE], dot(t, t), dot(t, z)
    txm, txz = cross(t, m), cross(t, z)
    for i in range(3):
        phi[P + i] = p[i] + one * t[i]
        phi[L + i] = z[i]
        phi[M + i] = m[i] + txz[i]
        phi[K + i] = k[i] - 2.0 * txm[i] + tt * z[i] - 2.0 * (phi[PL] + tz) * t[i]
    phi[PP] += 2.0 * dot(t, p) + one * tt
    phi[PL] += tz


def pull_back(link: Array, row: Array) -> None:
    """Make an equation row (15,) on phi one on the phi before which the link (3, 4) is placed, in place."""
    t = (link[0, 3], link[1, 3], link[2, 3])
    p, z, m, k = vector_at(row, P), vector_at(row, L), vector_at(row, M), vector_at(row, K)
    tt, kt = dot(t, t), dot(k, t)
    mxt, kxt = cross(m, t), cross(k, t)
    pp, pz = row[PP], row[PL]
    row[ONE] += dot(p, t) + pp * tt
    row[PL] = pz - 2.0 * kt
    p = (p[0] + 2.0 * pp * t[0], p[1] + 2.0 * pp * t[1], p[2] + 2.0 * pp * t[2])
    along = pz - 2.0 * kt
    z = (
        z[0] + mxt[0] + tt * k[0] + along * t[0],
        z[1] + mxt[1] + tt * k[1] + along * t[1],
        z[2] + mxt[2] + tt * k[2] + along * t[2],
    )
    m = (m[0] - 2.0 * kxt[0], m[1] - 2.0 * kxt[1], m[2] - 2.0 * kxt[2])
    put_vector(row, P, turned_back_by(link, p))
    put_vector(row, L, turned_back_by(link, z))
    put_vector(row, M, turned_back_by(link, m))
    put_vector(row, K, turned_back_by(link, k))


def fill_forms(phi: Array, forms: Array, first: int, step: int) -> None:
    """Three rows of forms, from first on: phi turned about z by an angle, in terms of its half: C^2, C S, S^2."""
    for i in range(SIZE_OF_PHI):
        forms[first, i] = phi[i]
        forms[first + step, i] = 0.0
        forms[first + 2 * step, i] = phi[i]
    for v in (P, L, M, K):
        forms[first + step, v] = -2.0 * phi[v + 1]
        forms[first + step, v + 1] = 2.0 * phi[v]
        forms[first + 2 * step, v] = -phi[v]
        forms[first + 2 * step, v + 1] = -phi[v + 1]


def fill_left(e: Equations) -> None:
    """Fill columns: phi of L_3 Rz(theta_4) L_4 Rz(theta_5) L_5 by forms 3 (of theta_4) + (of theta_5)."""
    links = e.links
    phi = e.rows[0]  # free as yet
    fill_phi((links[4, 0, 3], links[4, 1, 3], links[4, 2, 3]), (links[4, 0, 2], links[4, 1, 2], links[4, 2, 2]), phi)
    fill_forms(phi, e.thirds, 0, 1)
    for i in range(3):
        place_before(links[3], False, e.thirds[i])
        fill_forms(e.thirds[i], e.columns, i, 3)
    for i in range(9):
        place_before(links[2], False, e.columns[i])


def fill_right(e: Equations) -> None:
    """Fill right: phi of L_1^-1 Rz(-theta_1) L_6^-1, by sin theta_1, cos theta_1, 1."""
    links, right = e.links, e.right
    t = turned_back_by(links[5], (links[5, 0, 3], links[5, 1, 3], links[5, 2, 3]))
    phi = right[2]
    fill_phi((-t[0], -t[1], -t[2]), (links[5, 2, 0], links[5, 2, 1], links[5, 2, 2]), phi)
    for i in range(SIZE_OF_PHI):
        right[0, i], right[1, i] = 0.0, 0.0
    for v in (P, L, M, K):
        right[0, v], right[0, v + 1] = phi[v + 1], -phi[v]
        right[1, v], right[1, v + 1] = phi[v], phi[v + 1]
        phi[v], phi[v + 1] = 0.0, 0.0
    for i in range(3):
        place_before(links[0], True, right[i])


def area_of_columns(e: Equations) -> tuple[float, float]:
    """The square of the area that the two columns span which theta_2 turns: at most, were they at right angles, and it.

    Four rows are orthogonal to both: where these are on one line, such rows are rounding.
    """
    a, b, ab = 0.0, 0.0, 0.0
    for j in range(6):
        x, y = e.right[0, still_place(j)], e.right[1, still_place(j)]
        a, b, ab = a + x * x, b + y * y, ab + x * y
    return a * b, a * b - ab * ab


def still_place(i: int) -> int:
    """Places of phi that theta_2 does not turn."""
    return P + 2 + 3 * i if i < 4 else PP + i - 4


def fill_rows(e: Equations) -> None:
    """Fill rows with what is orthogonal to the columns of theta_1 and theta_2."""
    rows, right = e.rows, e.right
    for i in range(6):
        for j in range(SIZE_OF_PHI):
            rows[i, j] = 0.0
    reflect_still(e)
    # Rows 0 to 3 are the last four rows of the orthogonal matrix that the two reflections make.
    for i in range(4):
        for j in range(6):
            rows[i, still_place(j)] = 1.0 if j == i + 2 else 0.0
        for n in range(1, -1, -1):
            along = 0.0
            for j in range(n, 6):
                along += e.house[j, n] * rows[i, still_place(j)]
            for j in range(n, 6):
                rows[i, still_place(j)] -= 2.0 * along * e.house[j, n]
        constant = 0.0
        for j in range(6):
            constant += rows[i, still_place(j)] * right[2, still_place(j)]
        rows[i, ONE] = -constant
    null_of_turned(e)
    for i in range(6):
        pull_back(e.links[1], rows[i])


def reflect_still(e: Equations) -> None:
    """Fill house with two unit vectors, whose reflections make the columns (6, 2) of theta_1 triangular."""
    house, right = e.house, e.right
    for j in range(6):
        house[j, 0], house[j, 1] = right[0, still_place(j)], right[1, still_place(j)]
    for n in range(2):
        for j in range(n):
            house[j, n] = 0.0
        size = 0.0
        for j in range(n, 6):
            size += house[j, n] * house[j, n]
        length = math.sqrt(size)
        house[n, n] += length if house[n, n] >= 0.0 else -length
        size = 0.0
        for j in range(n, 6):
            size += house[j, n] * house[j, n]
        scale = 1.0 / math.sqrt(size) if size > 0.0 else 0.0
        for j in range(n, 6):
            house[j, n] *= scale
        if n == 0:
            along = 0.0
            for j in range(6):
                along += house[j, 0] * house[j, 1]
            for j in range(6):
                house[j, 1] -= 2.0 * along * house[j, 0]


def null_of_turned(e: Equations) -> None:
    """Fill rows 4 and 5 from the complex vector that is orthogonal to the three columns of theta_2.

    Gauss-Jordan elimination of the three columns, transposed, with complete pivoting: the column without a pivot is
    the free one.
    """
    null, rows, right = e.null, e.rows, e.right
    for i in range(3):
        for v in range(4):
            null[i, 2 * v], null[i, 2 * v + 1] = right[i, P + 3 * v], right[i, P + 3 * v + 1]
    used = 0
    pivots = (-1, -1, -1)
    for i in range(3):
        best, row, column = -1.0, 0, 0
        for r in range(i, 3):
            for v in range(4):
                size = null[r, 2 * v] * null[r, 2 * v] + null[r, 2 * v + 1] * null[r, 2 * v + 1]
                if not used >> v & 1 and size > best:
                    best, row, column = size, r, v
        used |= 1 << column
        pivots = (
            (column, pivots[1], pivots[2])
            if i == 0
            else ((pivots[0], column, -1) if i == 1 else (pivots[0], pivots[1], column))
        )
        for j in range(8):
            swap = null[i, j]
            null[i, j] = null[row, j]
            null[row, j] = swap
        if best <= 0.0:
            continue
        a, b = null[i, 2 * column] / best, -null[i, 2 * column + 1] / best
        for v in range(4):
            x, y = null[i, 2 * v], null[i, 2 * v + 1]
            null[i, 2 * v], null[i, 2 * v + 1] = a * x - b * y, a * y + b * x
        for r in range(3):
            a, b = null[r, 2 * column], null[r, 2 * column + 1]
            if r != i and (a != 0.0 or b != 0.0):
                for v in range(4):
                    x, y = null[i, 2 * v], null[i, 2 * v + 1]
                    null[r, 2 * v] -= a * x - b * y
                    null[r, 2 * v + 1] -= a * y + b * x
    free = 0
    for v in range(4):
        if not used >> v & 1:
            free = v
    size = 1.0
    for i in range(3):
        size += null[i, 2 * free] * null[i, 2 * free] + null[i, 2 * free + 1] * null[i, 2 * free + 1]
    scale = 1.0 / math.sqrt(size)
    for v in range(4):
        a, b = (scale, 0.0) if v == free else (0.0, 0.0)
        for i in range(3):
            if pivots[i] == v:
                a, b = -scale * null[i, 2 * free], -scale * null[i, 2 * free + 1]
        # (a + i b)(x + i y): real part, then imaginary part.
        rows[4, P + 3 * v], rows[4, P + 3 * v + 1] = a, -b
        rows[5, P + 3 * v], rows[5, P + 3 * v + 1] = b, a


def fill_parts(e: Equations) -> None:
    """Fill parts: rows times columns turned by theta_3, by cos theta_3, sin theta_3, 1."""
    rows, columns, parts = e.rows, e.columns, e.parts
    for i in range(6):
        for j in range(9):
            c, s = 0.0, 0.0
            one = rows[i, ONE] * columns[j, ONE] + rows[i, PP] * columns[j, PP] + rows[i, PL] * columns[j, PL]
            for v in (P, L, M, K):
                x, y = columns[j, v], columns[j, v + 1]
                c += rows[i, v] * x + rows[i, v + 1] * y
                s += rows[i, v + 1] * x - rows[i, v] * y
                one += rows[i, v + 2] * columns[j, v + 2]
            parts[0, i, j], parts[1, i, j], parts[2, i, j] = c, s, one


def write_equations(e: Equations) -> None:
    """From links to parts."""
    fill_left(e)
    fill_right(e)
    fill_rows(e)
    fill_parts(e)
