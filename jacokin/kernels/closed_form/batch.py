"""The entry point: every branch of one target, or the best branch of each of many."""

from __future__ import annotations

import math
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from jacokin.arrays import Array
from jacokin.kernels.branches import (
    COLUMNS,
    DISTANCE,
    FAMILY,
    MAX_BRANCHES,
    WITHIN_LIMITS,
    BranchWork,
    PoseQuery,
    add_beside_seed,
    copy_row,
    sort_rows,
)
from jacokin.kernels.chain import BASE, Frame, columns_of, deviation, forward
from jacokin.kernels.closed_form.arm import ARM_CONSTANTS, ArmConstants, unpack_arm
from jacokin.kernels.closed_form.pose import Work, make_work, solve_pose
from jacokin.kernels.six_joints.continua import ENDS, add_from_everywhere
from jacokin.kernels.tolerances import NEAR_SEED, RIGID
from jacokin.kernels.trigonometry import angle_of
from jacokin.kernels.vector import cross, dot, norm

#: What `solve_targets` returns for a target that it does not take.
NOT_RIGID = -(2**62)
#: Columns of a batch result: 0:17 the chosen branch, then these.
BatchColumn = IntEnum("BatchColumn", "BRANCHES BRANCHES_WITHIN_LIMITS LARGEST_MARGIN COUNT", start=17)


class TargetWork(NamedTuple):
    """What a call reads and writes; one set for each thread."""

    chain: Array  # (7, 3, 4) the model's placements, see ``geometry``
    arm: Array  # (46,) the constants of the closed form
    limits: Array  # (3, 6) lower and upper limits, and the snap distance [rad]
    T: Array  # (n, 4, 4) targets, T_base_frame
    seed: Array  # (n, 6) seeds [rad]
    pose: Work  # its rows (24, 17) are filled with the branches of the last target, nearest to its seed first
    best: Array  # (n, 20) filled with one row for each target; or (0, 20)
    nearest: Array  # (n, 17) filled with the beginning of such a row; or (0, 17), as `best`, for all of one target only


def make_target_work() -> TargetWork:
    """Fresh arrays, for no target."""
    return TargetWork(
        np.zeros((7, 3, 4)),
        np.zeros(ARM_CONSTANTS),
        np.zeros((3, 6)),
        np.empty((0, 4, 4)),
        np.empty((0, 6)),
        make_work(np.empty((MAX_BRANCHES, COLUMNS))),
        np.empty((0, BatchColumn.COUNT)),
        np.empty((0, COLUMNS)),
    )


def solve_targets(work: TargetWork) -> int:
    """Solve n targets with n seeds.

    A row of ``work.best`` is the branch within the limits nearest to the seed; without one, the branch that breaks a
    limit least; NaN without any branch. What it says of the others has to be asked for: ``work.nearest`` is filled
    without them where the nearest is in no doubt.

    Returns:
        How many rows were filled for the last target; its complement, ~count, if branches may be missing: a table was
        full, or doubt remains. `NOT_RIGID`, and nothing solved, where all branches of no rigid target were asked for.
    """
    k, branches, best, nearest = unpack_arm(work.arm), work.pose.branches, work.best, work.nearest
    is_one = best.shape[0] + nearest.shape[0] == 0
    if is_one and not is_rigid(work.T[0]):
        return NOT_RIGID
    frame = BASE
    for i in range(work.T.shape[0]):
        query = PoseQuery(work.chain, work.limits, work.T[i], work.seed[i])
        if is_another_seed(work, i):
            frame = frame_of_seed(work, i)
        find_branches(work, k, query, frame, i < nearest.shape[0])
        if i < best.shape[0]:
            count_branches(branches, best[i])
            choose_branch(branches, best[i])
        elif i < nearest.shape[0]:
            choose_branch(branches, nearest[i])
    if is_one:
        sort_rows(branches)
    count = int(branches.filled[0])
    return ~count if branches.filled[1] > 0 else count


def frame_of_seed(work: TargetWork, i: int) -> Frame:
    """The frame at seed i."""
    return forward(work.chain, work.seed[i])


def is_another_seed(work: TargetWork, i: int) -> bool:
    """Whether seed i is not the one before it: many targets have one seed."""
    another = i == 0
    for j in range(6):
        another = another or work.seed[i, j] != work.seed[i - 1, j]
    return another


def find_branches(work: TargetWork, k: ArmConstants, query: PoseQuery, frame: Frame, only_nearest: bool) -> None:
    """Fill in all branches of a target; only the nearest within the limits, if that suffices and is in no doubt.

    Args:
        work: all but the target is read.
        k: of its arm.
        query: the target.
        frame: at its seed.
        only_nearest: whether that suffices.
    """
    branches = work.pose.branches
    miss = miss_of(query.T, frame)
    # Beside a seed that nearly is a branch, another may be nearer than those that are found.
    branches.wanted[0] = 1 if only_nearest and miss > NEAR_SEED else 0
    solve_pose(work.arm, k, query, work.pose)
    if work.pose.six.vanishes[0] > 0:
        add_from_everywhere(query, branches)
    keep_best_end(branches)
    if miss <= NEAR_SEED:
        add_beside_seed(query, miss, branches)


def miss_of(T: Array, frame: Frame) -> float:
    """How far a frame is from a target [m or rad]."""
    x, y, z, p = frame
    d, turn, cosine = deviation(T, x, y, z, p)
    return max(norm(d), angle_of(norm(turn), cosine))


def is_rigid(T: Array) -> bool:
    """Whether a target is finite, its axes right-handed, of unit length and at right angles, and its last row exact."""
    x, y, z, p = columns_of(T)
    misfit = max(abs(dot(x, x) - 1.0), abs(dot(y, y) - 1.0), abs(dot(z, z) - 1.0))
    misfit = max(misfit, abs(dot(x, y)), abs(dot(x, z)), abs(dot(y, z)))
    is_exact = T[3, 0] == 0.0 and T[3, 1] == 0.0 and T[3, 2] == 0.0 and T[3, 3] == 1.0
    # NaN is never smaller; the largest of numbers may hide it.
    total = p[0] + p[1] + p[2] + dot(x, x) + dot(y, y) + dot(z, z)
    return bool(misfit <= RIGID and dot(x, cross(y, z)) > 0.0 and is_exact and math.isfinite(total))


def keep_best_end(work: BranchWork) -> None:
    """Of the members of continua that end before the seed's angle keep the best one."""
    rows, best, kept = work.rows, -1, 0
    for i in range(work.filled[0]):
        if rows[i, FAMILY] == ENDS and (best < 0 or is_better(rows[i], rows[best])):
            best = i
    if best < 0:
        return
    for i in range(work.filled[0]):
        if i == best or rows[i, FAMILY] != ENDS:
            copy_row(rows[i], rows[kept])
            kept += 1
    work.filled[0] = kept


def choose_branch(work: BranchWork, row: Array) -> None:
    """Copy the nearest branch within the limits, or else the one least outside them, to a row of the batch."""
    rows, chosen = work.rows, -1
    for i in range(work.filled[0]):
        if chosen < 0 or is_better(rows[i], rows[chosen]):
            chosen = i
    for j in range(COLUMNS):
        row[j] = rows[chosen, j] if chosen >= 0 else np.nan


def count_branches(work: BranchWork, row: Array) -> None:
    """Fill in what a row of the batch says of all branches."""
    rows, count = work.rows, work.filled[0]
    within, largest = 0, np.nan
    for i in range(count):
        margin = smallest_margin(rows[i])
        if i == 0 or margin > largest:
            largest = margin
        if rows[i, WITHIN_LIMITS] > 0.0:
            within += 1
    row[BatchColumn.BRANCHES], row[BatchColumn.BRANCHES_WITHIN_LIMITS] = count, within
    row[BatchColumn.LARGEST_MARGIN] = largest


def is_better(a: Array, b: Array) -> bool:
    """Within the limits before outside, then the nearer to the seed, or the one that breaks a limit least."""
    if a[WITHIN_LIMITS] != b[WITHIN_LIMITS]:
        return bool(a[WITHIN_LIMITS] > b[WITHIN_LIMITS])
    if a[WITHIN_LIMITS] > 0.0:
        return bool(a[DISTANCE] < b[DISTANCE])
    return smallest_margin(a) > smallest_margin(b)


def smallest_margin(row: Array) -> float:
    """The distance to the nearest limit, negative outside [rad]."""
    smallest = row[6]
    for j in range(7, 12):
        smallest = min(smallest, row[j])
    return float(smallest)
