"""The entry point: every branch of one target, or the best branch of each of many."""

from __future__ import annotations

import numpy as np

from jacokin.arrays import Array
from jacokin.kernels.closed_form.arm import unpack_arm
from jacokin.kernels.closed_form.pose import (
    COLUMNS,
    DISTANCE,
    WITHIN_LIMITS,
    BranchWork,
    PoseQuery,
    Work,
    solve_pose,
    sort_rows,
)

#: Columns of a batch result: 0:17 the chosen branch, then these.
BRANCHES, BRANCHES_WITHIN_LIMITS, LARGEST_MARGIN, BATCH_COLUMNS = 17, 18, 19, 20


def solve_targets(chain: Array, arm: Array, limits: Array, T: Array, seed: Array, work: Work, best: Array) -> int:
    """Solve n targets with n seeds. This is what gets compiled: it allocates nothing.

    Args:
        chain: (7, 3, 4) the model's placements, see ``geometry``.
        arm: (39,) the constants of the closed form.
        limits: (3, 6) lower and upper limits, and the snap distance [rad].
        T: (n, 4, 4) targets, T_base_frame.
        seed: (n, 6) seeds [rad].
        work: arrays to work in; its rows (24, 17) are filled with the branches of the last target, nearest to its seed
            first.
        best: (n, 20) filled with one row for each target, or (0, 20) for the branches of one target only. The row is
            the branch within the limits nearest to the seed; without one, the branch that breaks a limit least; NaN
            without any branch.

    Returns:
        How many rows were filled for the last target; its complement, ~count, if a table was full and entries may have
        been dropped.
    """
    k = unpack_arm(arm)
    for i in range(T.shape[0]):
        solve_pose(arm, k, PoseQuery(chain, limits, T[i], seed[i]), work)
        if i < best.shape[0]:
            choose_branch(work.branches, best[i])
    if best.shape[0] == 0:
        sort_rows(work.branches)
    count = int(work.branches.filled[0])
    return ~count if work.branches.filled[1] > 0 else count


def choose_branch(work: BranchWork, best: Array) -> None:
    """Copy the nearest branch within the limits, or else the one least outside them, to a row of the batch."""
    rows, count = work.rows, work.filled[0]
    chosen, within, largest = -1, 0, np.nan
    for i in range(count):
        margin = smallest_margin(rows[i])
        if i == 0 or margin > largest:
            largest = margin
        if rows[i, WITHIN_LIMITS] > 0.0:
            within += 1
        if chosen < 0 or is_better(rows[i], rows[chosen]):
            chosen = i
    for j in range(COLUMNS):
        best[j] = rows[chosen, j] if chosen >= 0 else np.nan
    best[BRANCHES] = count
    best[BRANCHES_WITHIN_LIMITS] = within
    best[LARGEST_MARGIN] = largest


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
