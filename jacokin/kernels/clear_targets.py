"""The entry point: many targets, each answered by the nearest branch that is clear of contact."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.branches import (
    COLUMNS,
    FAMILY,
    ORIENTATION_ERROR,
    POSITION_ERROR,
    WITHIN_LIMITS,
    BranchWork,
    PoseQuery,
    sort_rows,
)
from jacokin.kernels.chain import BASE
from jacokin.kernels.closed_form.arm import unpack_arm
from jacokin.kernels.closed_form.batch import (
    TargetWork,
    choose_branch,
    find_branches,
    frame_of_seed,
    is_another_seed,
    make_target_work,
)
from jacokin.kernels.contact.run import ContactWork, make_contact_work, stands_clear


class ClearWork(NamedTuple):
    """What a call reads and writes; one set for each thread."""

    targets: TargetWork  # with a row of `nearest` for each target
    contact: ContactWork
    tolerances: Array  # (2,) position [m] and orientation [rad] of a branch that reaches its target
    avoids: NDArray[np.int64]  # (1,) 1 to take another branch where one is in contact
    touching: NDArray[np.int64]  # (n,) filled with 1 where what was chosen is in contact


def make_clear_work() -> ClearWork:
    """Fresh arrays, for no target."""
    return ClearWork(make_target_work(), make_contact_work(), np.zeros(2), np.zeros(1, np.int64), np.zeros(0, np.int64))


def solve_clear_targets(work: ClearWork) -> int:
    """Solve n targets with n seeds, as `solve_targets`.

    Where another branch is taken, the one chosen is the nearest within the limits that reaches its target and is clear;
    where none is, it is the nearest. Contact of a target without a branch that reaches it is not looked for.

    Returns:
        How many rows are in contact.
    """
    targets, nearest = work.targets, work.targets.nearest
    k, branches, total = unpack_arm(targets.arm), targets.pose.branches, 0
    frame = BASE
    for i in range(nearest.shape[0]):
        if is_another_seed(targets, i):
            frame = frame_of_seed(targets, i)
        query = PoseQuery(targets.chain, targets.limits, targets.T[i], targets.seed[i])
        find_branches(targets, k, query, frame, True)
        choose_branch(branches, nearest[i])
        touching = is_answer(nearest[i], work.tolerances) and not stands_clear(work.contact, nearest[i])
        if touching and work.avoids[0] > 0:
            find_branches(targets, k, query, frame, False)
            touching = not take_clear(branches, work.contact, work.tolerances, nearest[i])
        work.touching[i] = 1 if touching else 0
        total += work.touching[i]
    return total


def is_answer(row: Array, tolerances: Array) -> bool:
    """Whether a branch is within the limits, and reaches its target."""
    near = row[POSITION_ERROR] <= tolerances[0] and row[ORIENTATION_ERROR] <= tolerances[1]
    return bool(near and row[WITHIN_LIMITS] == 1.0)


def take_clear(branches: BranchWork, contact: ContactWork, tolerances: Array, nearest: Array) -> bool:
    """Copy the nearest clear answer to a row of the batch; False where there is none.

    Where a branch stands for a whole self-motion, others of which may be clear, the row is marked as one that does.
    """
    sort_rows(branches)
    for i in range(branches.filled[0]):
        row = branches.rows[i]
        if is_answer(row, tolerances) and stands_clear(contact, row):
            for j in range(COLUMNS):
                nearest[j] = row[j]
            return True
    for i in range(branches.filled[0]):
        nearest[FAMILY] = max(nearest[FAMILY], branches.rows[i, FAMILY])
    return False
