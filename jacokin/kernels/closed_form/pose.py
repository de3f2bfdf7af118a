"""One pose to all its branches: roots, candidates, verification on the model, duplicates, order."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from jacokin.arrays import Array
from jacokin.kernels.branches import (
    ABREAST,
    FOUND,
    MAX_BRANCHES,
    ORIENTATION_ERROR,
    POSITION_ERROR,
    BranchWork,
    PoseQuery,
    add_branch,
    add_fold,
    add_verified,
    collect,
    make_branches,
    note_full,
    take_nearest,
    verify,
)
from jacokin.kernels.closed_form.arm import ArmConstants, Pose, pose_of
from jacokin.kernels.closed_form.resultant import DEGREE, fourier_of_divided_F, fourier_of_F
from jacokin.kernels.closed_form.roots import MAX_ROOTS, RootWork, add_known, add_known_pair, find_roots, make_roots
from jacokin.kernels.closed_form.wrist import (
    GOING,
    MAX_STARTS,
    Q6,
    STARTED,
    Starts,
    complete,
    fill_starts,
    refine,
    refine_abreast,
    starts_along_axis_1,
    starts_at_q6,
    starts_on_axis_5,
)
from jacokin.kernels.limits import circular_distance, same_configuration
from jacokin.kernels.six_joints.pose import SixWork, make_six, solve_six_joints
from jacokin.kernels.tolerances import (
    EXACT_MISFIT,
    FOLD_DETERMINANT,
    MAX_FOLD_WIDTH,
    MAX_PAIR_SQUARE,
    MIN_WIDTH,
    MISFIT_FACTOR,
    POLISHED_CLOSURE,
    REACH_SLACK,
    SAME_FOLD,
    SAME_ROOT,
    SAME_START,
)

#: How often F is searched again with the roots found meanwhile: at most once for each branch.
MAX_PASSES = MAX_BRANCHES


class Work(NamedTuple):
    """Arrays the solver writes to; one set for each thread."""

    roots: RootWork  # for F(q6)
    inner: RootWork  # for g(q5)
    starts: Starts
    branches: BranchWork
    six: SixWork


def make_work(rows: Array) -> Work:
    """Fresh work arrays, writing the branches to rows."""
    return Work(
        make_roots(),
        make_roots(),
        Starts(np.empty((MAX_STARTS, 4)), np.zeros(1, np.int64)),
        make_branches(rows),
        make_six(),
    )


def solve_pose(arm: Array, k: ArmConstants, query: PoseQuery, work: Work) -> None:
    """Fill work.branches.rows with every branch of one target, in no particular order."""
    work.branches.filled[0], work.branches.filled[1] = 0, 0
    work.branches.fold.filled[0], work.branches.lanes.filled[0], work.six.vanishes[0] = 0, 0, 0
    if k.six.scale > 0.0:
        solve_six_joints(k.six, query, work.six, work.branches)
        return
    pose = pose_of(arm, k, query.T)
    if not pose.distance <= math.sqrt(k.R2) + abs(k.c4) + abs(k.b5) + REACH_SLACK:
        return
    branches_at_double_roots(k, pose, query, work)
    for turn in range(2 if k.misfit > EXACT_MISFIT else 1):
        branches_at_roots(k, pose, query, work, turn * MISFIT_FACTOR * k.misfit)


def branches_at_double_roots(k: ArmConstants, pose: Pose, query: PoseQuery, work: Work) -> None:
    """The branches where F has multiple roots that are known beforehand, or nearly; their q6 become known roots."""
    starts, roots = work.starts, work.roots
    roots.known_count[0], roots.known_count[1], starts.filled[0] = 0, 0, 0
    if k.misfit > EXACT_MISFIT:
        return
    starts_along_axis_1(k, pose, starts)
    starts_on_axis_5(k, pose, starts, work.inner)
    note_full(work.branches, starts.filled[0], MAX_STARTS)
    for n in range(starts.filled[0]):
        branch_from_start(k, pose, query, work, n, True, FOLD_DETERMINANT)
    note_known(work)


def note_known(work: Work) -> None:
    """Make the q6 of all branches and folds that were found known roots of F.

    A branch that stands for both of a fold is a double root, and a fold without branches a pair of complex ones.
    """
    roots, branches, fold = work.roots, work.branches, work.branches.fold
    roots.known_count[0], roots.known_count[1] = 0, 0
    for i in range(branches.filled[0]):
        add_known(roots, branches.rows[i, 5])
    for n in range(fold.filled[0]):
        if branches_of_fold(branches, n) == 1:
            for i in range(branches.filled[0]):
                if same_configuration(fold.known[n], branches.rows[i], SAME_FOLD):
                    add_known(roots, 2.0 * fold.known[n, 5] - branches.rows[i, 5])
    roots.known_count[0] -= roots.known_count[0] % 2
    for n in range(fold.filled[0]):
        if abs(fold.pairs[n, 1]) < MAX_PAIR_SQUARE and branches_of_fold(branches, n) == 0:
            add_known_pair(roots, fold.pairs[n, 0], fold.pairs[n, 1])


def branches_of_fold(work: BranchWork, n: int) -> int:
    """How many branches there are at a fold; -1 if it is the same as an earlier one."""
    fold, count = work.fold, 0
    for i in range(n):
        if same_configuration(fold.known[n], fold.known[i], SAME_FOLD):
            return -1
    for i in range(work.filled[0]):
        count += same_configuration(fold.known[n], work.rows[i], MAX_FOLD_WIDTH)
    return count


def branches_at_roots(k: ArmConstants, pose: Pose, query: PoseQuery, work: Work, tolerance: float) -> None:
    """Every branch at every root of F; with a tolerance, only those near a double root.

    Where F touches zero, and then in undecided intervals, the widest first, there may be any number of branches. As
    soon as some are found, F is divided by what they bring, which may leave nothing undecided.
    """
    roots, exact = work.roots.roots, k.misfit <= EXACT_MISFIT
    for _ in range(MAX_PASSES):
        noise = divide_by_known(k, pose, work.roots)
        found = find_roots(noise, tolerance, work.roots)
        note_full(work.branches, found, MAX_ROOTS)
        before = work.branches.filled[0]
        if tolerance == 0.0:
            branches_at_single_roots(k, pose, query, work, found)
        for i in range(found):
            if roots[i, 2] > 0.0:
                branches_in_interval(k, pose, query, work, roots[i, 0], roots[i, 1])
                roots[i, 1] = 0.0
        while not (exact and work.branches.filled[0] > before):
            widest = -1
            for i in range(found):
                if roots[i, 1] > 0.0 and (widest < 0 or roots[i, 1] > roots[widest, 1]):
                    widest = i
            if widest < 0:
                return
            branches_in_interval(k, pose, query, work, roots[widest, 0], roots[widest, 1])
            roots[widest, 1] = 0.0
        undecided = 0
        for i in range(found):
            undecided += roots[i, 1] > 0.0
        if undecided == 0:
            return
        note_known(work)


def divide_by_known(k: ArmConstants, pose: Pose, roots: RootWork) -> float:
    """Fill roots with the coefficients of F, divided by its known roots if they are exact; returns the noise of F."""
    singles, pairs = roots.known_count[0], roots.known_count[1]
    while 0 < singles + 2 * pairs <= 2 * DEGREE:
        noise = fourier_of_divided_F(k, pose, roots.known, singles, pairs, roots.cosine, roots.sine)
        if noise < math.inf:
            return noise
        singles, pairs = (singles, 0) if pairs > 0 else (0, 0)
    return fourier_of_F(k, pose, roots.cosine, roots.sine, roots.stack)


def branches_at_single_roots(k: ArmConstants, pose: Pose, query: PoseQuery, work: Work, found: int) -> None:
    """The branch of each single root: from its best start, side by side with those of others, or else from any."""
    roots, lanes, count = work.roots.roots, work.branches.lanes, 0
    for i in range(found):
        if roots[i, 1] == 0.0:
            lanes.rows[Q6, count], lanes.mark[count] = roots[i, 0], i
            count += 1
            if count == ABREAST:
                settle_roots(k, pose, query, work, count, found)
                count = 0
    if count > 0:
        settle_roots(k, pose, query, work, count, found)


def settle_roots(k: ArmConstants, pose: Pose, query: PoseQuery, work: Work, count: int, found: int) -> None:
    """Add the branches of single roots side by side, of so many that were found; or the nearest, if that is wanted."""
    branches, lanes, roots = work.branches, work.branches.lanes, work.roots.roots
    for n in range(count, ABREAST):
        lanes.rows[Q6, n] = lanes.rows[Q6, 0]
    fill_starts(k, pose, lanes.rows)
    refine_abreast(k, pose, lanes.rows)
    for n in range(count):
        collect(branches, n, lanes.mark[n] if lanes.rows[STARTED, n] > 0.0 else ~lanes.mark[n], 0.0)
    if count == found and are_sure(k, work) and take_nearest(query, branches):
        return
    for n in range(verify(query, branches)):
        i, before = lanes.mark[n], branches.filled[0]
        q6 = roots[i if i >= 0 else ~i, 0]
        if i < 0 or not (add_verified(query, branches, n) and has_branch_at(branches, before, q6)):
            branch_at_root(k, pose, query, work, q6)


def are_sure(k: ArmConstants, work: Work) -> bool:
    """Whether the nearest branch alone is wanted, and each candidate that was collected is the branch of its root."""
    branches, lanes, rows = work.branches, work.branches.lanes, work.branches.lanes.rows
    sure = branches.wanted[0] > 0 and branches.filled[0] == 0 and branches.fold.filled[0] == 0
    sure = sure and k.misfit <= EXACT_MISFIT
    for n in range(lanes.filled[0]):
        sure = sure and lanes.mark[n] >= 0 and rows[GOING, n] == 0.0
        sure = sure and circular_distance(rows[FOUND + 5, n] - work.roots.roots[lanes.mark[n], 0]) < SAME_ROOT
    return sure


def branch_at_root(k: ArmConstants, pose: Pose, query: PoseQuery, work: Work, q6: float) -> None:
    """The branch of a single root: from its best start, or else from any.

    A branch that was known before does not count, though it has the same q6: F was divided by what it brings, and the
    root is another's. So it is where axis 4 is along axis 1, and axis 3 along axis 5 as well.
    """
    starts, branches = work.starts, work.branches
    before = branches.filled[0]
    for attempt in range(2):
        # A single root is so near its branch that Newton's method succeeds beside a fold, too.
        smallest_det = FOLD_DETERMINANT * attempt
        starts.filled[0] = 0
        starts_at_q6(k, pose, q6, attempt * MIN_WIDTH, starts, work.inner)
        note_full(branches, starts.filled[0], MAX_STARTS)
        for n in range(starts.filled[0]):
            branch_from_start(k, pose, query, work, n, False, smallest_det)
            if has_branch_at(branches, before, q6):
                return
        if k.misfit > EXACT_MISFIT and branches.filled[0] > before:
            return


def has_branch_at(work: BranchWork, first: int, q6: float) -> bool:
    """Whether the branch of a single root is there, from row `first` on; mostly it is the last one."""
    for i in range(work.filled[0] - 1, first - 1, -1):  # noqa: SIM110  # numba compiles no generator expressions
        if circular_distance(work.rows[i, 5] - q6) < SAME_ROOT:
            return True
    return False


def branches_in_interval(k: ArmConstants, pose: Pose, query: PoseQuery, work: Work, q6: float, half: float) -> None:
    """The branches of an undecided interval, from its middle and its ends: several roots may share it.

    Most starts are wrong or repeat each other; those that end on a known branch are dropped early. How far off a start
    is tells nothing: right ones may be as far off as wrong ones.
    """
    skip_known = k.misfit <= EXACT_MISFIT
    work.starts.filled[0] = 0
    for i in range(3):
        starts_at_q6(k, pose, q6 + (i - 1) * half, half, work.starts, work.inner)
    note_full(work.branches, work.starts.filled[0], MAX_STARTS)
    for n in range(work.starts.filled[0]):
        branch_from_start(k, pose, query, work, n, skip_known, FOLD_DETERMINANT)


def branch_from_start(
    k: ArmConstants, pose: Pose, query: PoseQuery, work: Work, n: int, skip_known: bool, smallest_det: float
) -> None:
    """Refine start n and append its branch; with a determinant below ``smallest_det``, both branches of a fold."""
    branches = work.branches
    first = (work.starts.rows[n, 0], work.starts.rows[n, 1], work.starts.rows[n, 2])
    while True:
        q1, q5, q6, singular = refine(k, pose, first[0], first[1], first[2], smallest_det)
        if skip_known and is_known(branches, q1, q5, q6):
            return
        complete(k, pose, q1, q5, q6, branches.newton.q)
        if not singular:
            add_branch(query, branches, 0.0)
            return
        if add_fold(query, branches):
            return
        first, smallest_det = (q1, q5, q6), 0.0


def is_known(work: BranchWork, q1: float, q5: float, q6: float) -> bool:
    """Whether a branch that needs no polishing has these three angles, which fix the other three."""
    rows = work.rows
    for i in range(work.filled[0]):
        if (
            circular_distance(rows[i, 0] - q1) < SAME_START
            and circular_distance(rows[i, 4] - q5) < SAME_START
            and circular_distance(rows[i, 5] - q6) < SAME_START
            and max(rows[i, POSITION_ERROR], rows[i, ORIENTATION_ERROR]) <= POLISHED_CLOSURE
        ):
            return True
    return False
