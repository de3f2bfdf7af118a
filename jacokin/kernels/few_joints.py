"""Configurations of an arm of three to five joints from those of its chain of six, see `jacokin.ik.virtual_joints`.

Those whose last joints must stand at zero: rows in which they nearly do are least squares of the others away from the
pose, or nearly reach it by chance; Gauss and Newton tell.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.branches import (
    COLUMNS,
    DISTANCE,
    FAMILY,
    MAX_BRANCHES,
    ORIENTATION_ERROR,
    POSITION_ERROR,
    WITHIN_LIMITS,
    copy_row,
)
from jacokin.kernels.chain import errors, linearise
from jacokin.kernels.limits import circular_distance, nearest_copy, same_configuration
from jacokin.kernels.tolerances import LIMIT_SNAP

#: [rad] of a joint that should stand at zero: from there on the pose is another one's; and below there is nothing to
#: correct.
STANDS, STOOD = 0.03, 1e-10
#: Of the method of Gauss and Newton at most, and [rad] of the one after which it ends: the next one would be rounding.
STEPS, LAST_STEP = 8, 1e-7
#: Sweeps of Jacobi's method, the cosine between columns that is none, and the part of the largest singular value below
#: which one is rounding.
SWEEPS, SQUARE, RANK = 30, 1e-15, 6 * 2.220446049250313e-16


#: [rad] configurations nearer than that are one, and an angle so near to its range is in it.
SAME = 1e-7
ROWS, REAL, FREE, IS_TURNED, ALONG, IS_POSITION = range(6)


class FewWork(NamedTuple):
    """Rows in and out, and what the steps need."""

    chain: Array  # (7, 3, 4) placements
    T: Array  # (4, 4) the target
    bounds: Array  # (2, 6) of the arm's joints [rad], infinite for others
    tolerances: Array  # (2,) of position [m] and orientation [rad]
    counts: NDArray[np.int64]
    """(6,) rows; joints that are the arm's, first ones of the chain; how many need not stand; whether the next one is
    the angle about a free axis; whether the arm's last joint turns about that itself, 1, or against it, -1, else 0, and
    is not in the chain; whether only the position is asked for."""
    seed: Array  # (6,) [rad]
    range: Array  # (2,) of the angle about the free axis [rad]
    rows: Array  # (24, 17) changed in place, see `branches`
    angles: Array  # (24,) about the free axis [rad]
    q: Array  # (6,) [rad]
    row: Array  # (17,)
    system: Array  # (6, 7)
    vectors: Array  # (6, 6)
    step: Array  # (6,)


def make_few_work() -> FewWork:
    """Fresh arrays."""
    return FewWork(
        np.zeros((7, 3, 4)),
        np.eye(4),
        np.array([np.full(6, -np.inf), np.full(6, np.inf)]),
        np.zeros(2),
        np.zeros(6, np.int64),
        np.zeros(6),
        np.zeros(2),
        np.zeros((MAX_BRANCHES, COLUMNS)),
        np.zeros(MAX_BRANCHES),
        np.zeros(6),
        np.zeros(COLUMNS),
        np.zeros((6, 7)),
        np.zeros((6, 6)),
        np.zeros(6),
    )


def take_few(work: FewWork) -> int:
    """Make rows of the chain those of the arm, nearest to the seed first, each configuration once; how many."""
    counts, rows, angles, row, kept = work.counts, work.rows, work.angles, work.row, 0
    for i in range(counts[ROWS]):
        if counts[FREE] < 6 and not stands(rows[i], work):
            continue
        copy_row(rows[i], row)
        angle, k = make_own(row, work), kept
        while k > 0 and rows[k - 1, DISTANCE] > row[DISTANCE]:
            copy_row(rows[k - 1], rows[k])
            angles[k] = angles[k - 1]
            k -= 1
        copy_row(row, rows[k])
        angles[k] = angle
        kept += 1
    if counts[FREE] < 6 or counts[IS_POSITION] == 1:  # several of the chain's may be one of the arm's
        kept = keep_different(rows, angles, kept)
    return kept


def make_own(row: Array, work: FewWork) -> float:
    """Make a row of the chain one of the arm; returns the angle about the free axis [rad]."""
    counts, seed, bounds, real = work.counts, work.seed, work.bounds, work.counts[REAL]
    sign, dof = float(counts[ALONG]), real + abs(counts[ALONG])
    angle, within = 0.0, True
    if counts[IS_TURNED] == 1:
        low, high = work.range[0], work.range[1]
        turned = row[real] + sign * seed[real]
        angle = min(max(nearest_copy(turned, 0.5 * (low + high)), low), high)
        beyond = nearest_copy(turned - angle, 0.0)
        if dof > real:  # the joint that turns about the axis itself goes where the range has it
            row[real] = seed[real] - sign * beyond
            row[6 + real] = min(row[real] - bounds[0, real], bounds[1, real] - row[real])
        else:
            within = abs(beyond) <= SAME
    if counts[IS_POSITION] == 1:
        row[ORIENTATION_ERROR] = row[FAMILY] = 0.0
    square = 0.0
    for j in range(6):
        if j < dof:
            within = within and row[6 + j] >= 0.0
            square += (row[j] - seed[j]) * (row[j] - seed[j])
        else:
            row[j] = row[6 + j] = 0.0
    row[DISTANCE], row[WITHIN_LIMITS] = math.sqrt(square), 1.0 if within else 0.0
    return angle


def keep_different(rows: Array, angles: Array, count: int) -> int:
    """Keep, in order, rows whose configurations differ from all before them; how many."""
    kept = 0
    for i in range(count):
        known = False
        for k in range(kept):
            known = known or same_configuration(rows[i], rows[k], SAME)
        if not known:
            copy_row(rows[i], rows[kept])
            angles[kept] = angles[i]
            kept += 1
    return kept


def stands(row: Array, work: FewWork) -> bool:
    """Whether the last joints of a row stand at zero within the tolerances; it is changed so that they do."""
    real, free, q, stood = work.counts[REAL], work.counts[FREE], work.q, 0.0
    for j in range(free, 6):
        stood = max(stood, circular_distance(row[j]))
    if stood >= STANDS:
        return False
    for j in range(6):
        q[j] = row[j] if j < free else 0.0
        row[j] = q[j]
    if stood < STOOD:
        return True
    for _ in range(STEPS):
        linearise(work.chain, work.T, q, work.system)
        fill_least_squares(work.system, free, work.vectors, work.step)
        largest = 0.0
        for j in range(free):
            q[j] += work.step[j]
            largest = max(largest, abs(work.step[j]))
        if largest < LAST_STEP:
            break
    for j in range(6):
        if j < real:
            onto = min(max(q[j], work.bounds[0, j]), work.bounds[1, j])
            q[j] = onto if abs(onto - q[j]) < LIMIT_SNAP else q[j]
            row[6 + j] = min(q[j] - work.bounds[0, j], work.bounds[1, j] - q[j])
        row[j] = q[j]
    row[POSITION_ERROR], row[ORIENTATION_ERROR] = errors(work.chain, work.T, q)
    return bool(row[POSITION_ERROR] <= work.tolerances[0] and row[ORIENTATION_ERROR] <= work.tolerances[1])


def fill_least_squares(system: Array, columns: int, vectors: Array, step: Array) -> None:
    """Fill step with the shortest of the least squares of system (6, 7): the first columns against the last one.

    By singular values: columns are rotated until they are at right angles (Hestenes, 1958), which keeps small ones.
    """
    for i in range(columns):
        step[i] = 0.0
        for j in range(columns):
            vectors[i, j] = 1.0 if i == j else 0.0
    for _ in range(SWEEPS):
        turned = False
        for a in range(columns):
            for b in range(a + 1, columns):
                turned = turn_columns(system, a, b, columns, vectors) or turned
        if not turned:
            break
    largest = 0.0
    for a in range(columns):
        largest = max(largest, product_of_columns(system, a, a))
    for a in range(columns):
        square = product_of_columns(system, a, a)
        if square > RANK * RANK * largest:
            share = product_of_columns(system, a, 6) / square
            for j in range(columns):
                step[j] += share * vectors[j, a]


def product_of_columns(system: Array, a: int, b: int) -> float:
    """The scalar product of two columns (6,)."""
    total = 0.0
    for i in range(6):
        total += system[i, a] * system[i, b]
    return total


def turn_columns(system: Array, a: int, b: int, columns: int, vectors: Array) -> bool:
    """Rotate two columns, and those of vectors, until they are at right angles; whether they were not."""
    square_a, square_b = product_of_columns(system, a, a), product_of_columns(system, b, b)
    product = product_of_columns(system, a, b)
    if abs(product) <= SQUARE * math.sqrt(square_a * square_b):
        return False
    theta = 0.5 * (square_b - square_a) / product
    t = math.copysign(1.0, theta) / (abs(theta) + math.hypot(theta, 1.0))
    c = 1.0 / math.sqrt(t * t + 1.0)
    s = t * c
    for i in range(6):
        x, y = system[i, a], system[i, b]
        system[i, a], system[i, b] = c * x - s * y, s * x + c * y
    for i in range(columns):
        x, y = vectors[i, a], vectors[i, b]
        vectors[i, a], vectors[i, b] = c * x - s * y, s * x + c * y
    return True
