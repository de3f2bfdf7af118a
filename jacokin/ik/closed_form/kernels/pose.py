"""One pose to all its branches: roots, candidates, verification on the model, duplicates, order."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.ik.closed_form.kernels.arm import Arm, Pose, pose_of
from jacokin.ik.closed_form.kernels.chain import errors, held_step, newton_step
from jacokin.ik.closed_form.kernels.limits import circular_distance, fit_to_limits, same_configuration
from jacokin.ik.closed_form.kernels.resultant import fourier_of_F
from jacokin.ik.closed_form.kernels.roots import MAX_ROOTS, STACK, RootWork, find_roots
from jacokin.ik.closed_form.kernels.spherical import spherical_starts
from jacokin.ik.closed_form.kernels.tolerances import (
    CLOSURE,
    EXACT_MISFIT,
    FOLD_FACTOR,
    MAX_POLISH_ERROR,
    MAX_START_ERROR,
    MIN_WIDTH,
    MISFIT_FACTOR,
    POLISHED_CLOSURE,
    REACH_SLACK,
    SAME_BRANCH,
    SAME_START,
    TANGENCY_CLOSURE,
    TANGENCY_EXCESS,
)
from jacokin.ik.closed_form.kernels.wrist import MAX_STARTS, Starts, complete, refine, starts_at_q6

#: Columns of a branch: 0:6 q, 6:12 limit margins, then these.
POSITION_ERROR, ORIENTATION_ERROR, DISTANCE, WITHIN_LIMITS, FAMILY, COLUMNS = 12, 13, 14, 15, 16, 17
#: 16 is the most a 6R arm can have; families add members, and a fold may be cut in two by rounding.
MAX_BRANCHES = 24
POLISH_STEPS = 16
TANGENCY_STEPS = 3


class BranchWork(NamedTuple):
    """A candidate, what it takes to verify it, and the branches found so far."""

    q: NDArray[np.float64]  # (6,)
    held: NDArray[np.float64]  # (6,) 1 for joints held on their limit
    system: NDArray[np.float64]  # (6, 7)
    normal: NDArray[np.float64]  # (6, 7)
    row: NDArray[np.float64]  # (17,) the branch at hand
    rows: NDArray[np.float64]  # (24, 17)
    filled: NDArray[np.int64]  # (1,) how many rows


class Work(NamedTuple):
    """Arrays the solver writes to; one set for each thread."""

    roots: RootWork  # for F(q6)
    inner: RootWork  # for g(q5)
    starts: Starts
    branches: BranchWork


def make_work(rows: NDArray[np.float64]) -> Work:
    """Fresh work arrays, writing the branches to rows."""
    stack, place = np.empty((STACK, 17)), np.empty((STACK, 2))
    return Work(
        RootWork(np.empty(9), np.empty(9), np.empty((MAX_ROOTS, 2)), stack, place),
        RootWork(np.empty(9), np.empty(9), np.empty((MAX_ROOTS, 2)), stack, place),
        Starts(np.empty((MAX_STARTS, 4)), np.zeros(1, np.int64)),
        BranchWork(
            np.empty(6),
            np.empty(6),
            np.empty((6, 7)),
            np.empty((6, 7)),
            np.empty(COLUMNS),
            rows,
            np.zeros(1, np.int64),
        ),
    )


class Task(NamedTuple):
    """One target for one arm."""

    chain: NDArray[np.float64]  # (7, 3, 4)
    limits: NDArray[np.float64]  # (3, 6)
    T: NDArray[np.float64]  # (4, 4)
    seed: NDArray[np.float64]  # (6,)


def solve_pose(arm: NDArray[np.float64], k: Arm, task: Task, work: Work) -> None:
    """Fill work.branches.rows with every branch of one target, in no particular order."""
    work.branches.filled[0] = 0
    pose = pose_of(arm, k, task.T)
    if not pose.distance <= math.sqrt(k.R2) + abs(k.c4) + abs(k.b5) + REACH_SLACK:
        return
    if k.spherical:
        spherical_starts(k, pose, task.seed, work.starts, work.branches.q)
        for i in range(work.starts.filled[0]):
            complete(k, pose, work.starts.rows[i, 0], work.starts.rows[i, 1], work.starts.rows[i, 2], work.branches.q)
            add_branch(task, work.branches, work.starts.rows[i, 3])
        return
    noise = fourier_of_F(k, pose, work.roots.cosine, work.roots.sine)
    branches_at_roots(k, pose, task, work, noise, 0.0)
    if k.misfit > EXACT_MISFIT:
        branches_at_roots(k, pose, task, work, noise, MISFIT_FACTOR * k.misfit)


def branches_at_roots(k: Arm, pose: Pose, task: Task, work: Work, noise: float, tolerance: float) -> None:
    """Every branch at every root of F; with a tolerance, only those near a double root.

    A sure root carries a branch: where its best candidate yields none, all candidates are tried. In an undecided
    interval all are tried from the start, at its ends too, for several roots may share it. Most of these candidates
    are wrong or repeat each other, so that those far off and those that end on a known branch are dropped early.
    """
    starts, branches = work.starts, work.branches
    end = -math.inf  # [rad] of the undecided interval before; the next one often begins there
    for i in range(find_roots(noise, tolerance, work.roots)):
        q6, half = work.roots.roots[i, 0], work.roots.roots[i, 1]
        if half == 0.0 and tolerance > 0.0:
            continue
        before = branches.filled[0]
        skip_known = half > 0.0 and k.misfit <= EXACT_MISFIT
        max_error = MAX_START_ERROR if skip_known and half <= MIN_WIDTH else math.inf
        for attempt in range(2):
            starts.filled[0] = 0
            starts_at_q6(k, pose, q6, half + attempt * MIN_WIDTH, starts, work.inner)
            if half > 0.0:
                if abs(q6 - half - end) > SAME_START:
                    starts_at_q6(k, pose, q6 - half, half, starts, work.inner)
                end = q6 + half
                starts_at_q6(k, pose, end, half, starts, work.inner)
            for n in range(starts.filled[0]):
                q1, q5, exact, plausible = refine(
                    k, pose, starts.rows[n, 0], starts.rows[n, 1], starts.rows[n, 2], max_error
                )
                if plausible and not (skip_known and is_known(branches, q1, q5, exact)):
                    complete(k, pose, q1, q5, exact, branches.q)
                    add_branch(task, branches, 0.0)
            if half > 0.0 or branches.filled[0] > before:
                break


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


def add_branch(task: Task, work: BranchWork, family: float) -> None:
    """Polish work.q, verify it, and append it to the rows unless it is there already."""
    q, row = work.q, work.row
    distance, within = fit_to_limits(q, task.seed, task.limits, row)
    position, orientation = errors(task.chain, task.T, row)
    # Members of a family stay at the seed's angle: Newton would slide them along.
    if max(position, orientation) > (CLOSURE if family > 0.0 else POLISHED_CLOSURE):
        if not polish(task, work, max(position, orientation)):
            return
        distance, within = fit_to_limits(q, task.seed, task.limits, row)
        position, orientation = errors(task.chain, task.T, row)
    if not within and hold_on_limits(task, work):
        distance, within = fit_to_limits(q, task.seed, task.limits, row)
        position, orientation = errors(task.chain, task.T, row)
    row[POSITION_ERROR], row[ORIENTATION_ERROR] = position, orientation
    row[DISTANCE] = distance
    row[WITHIN_LIMITS] = 1.0 if within else 0.0
    row[FAMILY] = family
    insert(work)


def hold_on_limits(task: Task, work: BranchWork) -> bool:
    """Put joints slightly past a limit on it, and solve for the others: whether the pose is still reached.

    At a fold the joints are known only to the square root of the rounding errors, and a branch on a limit may come
    out 1e-8 rad past it. A regular branch does not reach the pose when a joint is held.
    """
    q, row, held = work.q, work.row, work.held
    for j in range(6):
        q[j], held[j] = row[j], 0.0
        if row[6 + j] < 0.0:
            if row[6 + j] < -TANGENCY_EXCESS:
                return False
            held[j] = 1.0
            q[j] = task.limits[0, j] if row[j] < task.limits[0, j] else task.limits[1, j]
    for _ in range(TANGENCY_STEPS):
        if not held_step(task.chain, task.T, q, held, work.system, work.normal):
            return False
    position, orientation = errors(task.chain, task.T, q)
    return max(position, orientation) < TANGENCY_CLOSURE


def polish(task: Task, work: BranchWork, worst: float) -> bool:
    """Newton on all six joints of work.q, while it helps; whether it then closes the pose."""
    q, row = work.q, work.row
    for _ in range(POLISH_STEPS):
        if not POLISHED_CLOSURE < worst < MAX_POLISH_ERROR:
            break
        for j in range(6):
            row[j] = q[j]
        position, orientation = MAX_POLISH_ERROR, MAX_POLISH_ERROR
        if newton_step(task.chain, task.T, q, work.system):
            position, orientation = errors(task.chain, task.T, q)
        if max(position, orientation) >= worst:
            for j in range(6):
                q[j] = row[j]
            break
        worst = max(position, orientation)
    return worst <= CLOSURE


def insert(work: BranchWork) -> None:
    """Add the row at hand; of rows that are the same on the circle the best one stays."""
    row, rows, count = work.row, work.rows, work.filled[0]
    here = max(row[POSITION_ERROR], row[ORIENTATION_ERROR])
    better, kept = True, 0
    for i in range(count):
        there = max(rows[i, POSITION_ERROR], rows[i, ORIENTATION_ERROR])
        if same_configuration(rows[i], row, SAME_BRANCH + FOLD_FACTOR * math.sqrt(max(here, there))):
            if here < there:
                continue
            better = False
        if kept < i:
            copy_row(rows[i], rows[kept])
        kept += 1
    if better and kept < MAX_BRANCHES:
        copy_row(row, rows[kept])
        kept += 1
    work.filled[0] = kept


def copy_row(source: NDArray[np.float64], target: NDArray[np.float64]) -> None:
    """One by one: compiled, an assignment of arrays brings the code of its error message, which allocates memory."""
    for column in range(COLUMNS):
        target[column] = source[column]


def sort_rows(work: BranchWork) -> None:
    """Order the branches by distance to the seed, by insertion."""
    rows = work.rows
    for i in range(1, work.filled[0]):
        j = i
        while j > 0 and rows[j, DISTANCE] < rows[j - 1, DISTANCE]:
            for column in range(COLUMNS):
                swap = rows[j, column]
                rows[j, column] = rows[j - 1, column]
                rows[j - 1, column] = swap
            j -= 1
