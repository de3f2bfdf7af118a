"""One pose to all its branches, and many poses to their best branch: the two entry points that are compiled."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.ik.kernels_arm import Arm, pose_of, unpack_arm
from jacokin.ik.kernels_chain import errors, newton_step
from jacokin.ik.kernels_limits import fit_to_limits, same_on_circle
from jacokin.ik.kernels_resultant import fourier_of_F
from jacokin.ik.kernels_roots import find_roots
from jacokin.ik.kernels_spherical import spherical_starts
from jacokin.ik.kernels_wrist import complete, refine, starts_at_q6

#: Columns of a branch: 0:6 q, 6:12 limit margins, then these.
POSITION_ERROR, ORIENTATION_ERROR, DISTANCE, LEGAL, FAMILY, COLUMNS = 12, 13, 14, 15, 16, 17
#: 16 is the most a 6R arm can have; families add members, and a fold may be cut in two by rounding.
MAX_BRANCHES = 24
#: [m] and [rad]; a branch closes at least this well, or it is none.
CLOSED = 1e-9
#: [m] and [rad]; above this, a Newton step on the model's own Jacobian is tried.
POLISHED = 2e-12
POLISH_STEPS = 8
#: [m] and [rad]; candidates farther off than this are not worth polishing.
HOPELESS = 2e-2
#: [rad] branches closer than this on the circle are one.
SAME = 1e-6
#: [m] slack of the test whether the wrist is in reach at all.
REACH_SLACK = 1e-6
#: Candidates of F within this many times the model's misfit of zero are kept as well.
LOOSENESS = 30.0
#: A misfit below this is rounding.
EXACT = 1e-12


class Work(NamedTuple):
    """Arrays the solver writes to; one set for each thread."""

    samples: NDArray[np.float64]
    fourier: NDArray[np.float64]
    stack: NDArray[np.float64]
    place: NDArray[np.float64]
    roots: NDArray[np.float64]
    more_roots: NDArray[np.float64]
    starts: NDArray[np.float64]
    axes: NDArray[np.float64]
    system: NDArray[np.float64]
    q: NDArray[np.float64]
    row: NDArray[np.float64]


def make_work() -> Work:
    """Fresh work arrays."""
    return Work(
        np.empty(17),
        np.empty((2, 9)),
        np.empty((32, 17)),
        np.empty((32, 2)),
        np.empty((64, 2)),
        np.empty((64, 2)),
        np.empty((64, 4)),
        np.empty((6, 6)),
        np.empty((6, 7)),
        np.empty(6),
        np.empty(COLUMNS),
    )


def solve_pose(
    chain: NDArray[np.float64],
    arm: NDArray[np.float64],
    k: Arm,
    limits: NDArray[np.float64],
    T: NDArray[np.float64],
    reference: NDArray[np.float64],
    work: Work,
    rows: NDArray[np.float64],
) -> int:
    """Fill rows (24, 17) with every branch of one target, in no order; returns how many."""
    pose = pose_of(arm, k, T)
    if not pose.distance <= math.sqrt(k.R2) + abs(k.c4) + abs(k.b5) + REACH_SLACK:
        return 0
    count = 0
    if k.spherical:
        for i in range(spherical_starts(k, pose, reference, work.starts, work.q)):
            complete(k, pose, work.starts[i, 0], work.starts[i, 1], work.starts[i, 2], work.q)
            count = add_branch(chain, limits, T, reference, work, rows, count, work.starts[i, 3])
        return count
    fourier_of_F(k, pose, work.samples, work.fourier[0], work.fourier[1])
    looseness = LOOSENESS * k.misfit if k.misfit > EXACT else 0.0
    found = find_roots(work.fourier[0], work.fourier[1], looseness, work.stack, work.place, work.roots)
    for i in range(found):
        q6, half = work.roots[i, 0], work.roots[i, 1]
        thorough = half > 0.0
        before = count
        starts = starts_at_q6(
            k, pose, q6, thorough, work.starts, 0, work.stack, work.place, work.fourier, work.more_roots
        )
        count = follow(chain, k, pose, limits, T, reference, work, rows, count, starts)
        if count == before and not thorough:
            starts = starts_at_q6(
                k, pose, q6, True, work.starts, 0, work.stack, work.place, work.fourier, work.more_roots
            )
            count = follow(chain, k, pose, limits, T, reference, work, rows, count, starts)
    return count


def follow(chain, k, pose, limits, T, reference, work, rows, count, starts):  # type: ignore
    """Refine each start, complete it to a configuration, and keep it if it is a branch."""
    for i in range(starts):
        q1, q5, q6, settled = refine(k, pose, work.starts[i, 0], work.starts[i, 1], work.starts[i, 2])
        complete(k, pose, q1, q5, q6, work.q)
        count = add_branch(chain, limits, T, reference, work, rows, count, 0.0)
    return count


def add_branch(
    chain: NDArray[np.float64],
    limits: NDArray[np.float64],
    T: NDArray[np.float64],
    reference: NDArray[np.float64],
    work: Work,
    rows: NDArray[np.float64],
    count: int,
    family: float,
) -> int:
    """Polish work.q, verify it, and append it to rows unless it is there already; returns the new count."""
    q, row = work.q, work.row
    position, orientation = errors(chain, T, q, work.axes)
    worst = max(position, orientation)
    if not worst < HOPELESS:
        return count
    for _ in range(POLISH_STEPS):
        if worst < POLISHED:
            break
        for j in range(6):
            row[j] = q[j]
        if not newton_step(chain, T, q, work.axes, work.system):
            break
        position, orientation = errors(chain, T, q, work.axes)
        better = max(position, orientation)
        if not better < worst:
            for j in range(6):
                q[j] = row[j]
            break
        worst = better
    if worst > CLOSED:
        return count
    distance, legal = fit_to_limits(q, reference, limits, row)
    row[POSITION_ERROR], row[ORIENTATION_ERROR] = errors(chain, T, row, work.axes)
    row[DISTANCE] = distance
    row[LEGAL] = 1.0 if legal else 0.0
    row[FAMILY] = family
    for i in range(count):
        if same_on_circle(rows[i], row, SAME):
            if max(row[POSITION_ERROR], row[ORIENTATION_ERROR]) < max(
                rows[i, POSITION_ERROR], rows[i, ORIENTATION_ERROR]
            ):
                for j in range(COLUMNS):
                    rows[i, j] = row[j]
            return count
    if count < MAX_BRANCHES:
        for j in range(COLUMNS):
            rows[count, j] = row[j]
        count += 1
    return count


def sort_rows(rows: NDArray[np.float64], count: int) -> None:
    """Order the first rows by distance to the seed, by insertion."""
    for i in range(1, count):
        j = i
        while j > 0 and rows[j, DISTANCE] < rows[j - 1, DISTANCE]:
            for column in range(COLUMNS):
                swap = rows[j, column]
                rows[j, column] = rows[j - 1, column]
                rows[j - 1, column] = swap
            j -= 1


def solve_all(
    chain: NDArray[np.float64],
    arm: NDArray[np.float64],
    limits: NDArray[np.float64],
    T: NDArray[np.float64],
    reference: NDArray[np.float64],
    rows: NDArray[np.float64],
) -> int:
    """Every branch of one target, ordered by distance to the reference; returns how many rows were filled."""
    count = solve_pose(chain, arm, unpack_arm(arm), limits, T, reference, make_work(), rows)
    sort_rows(rows, count)
    return count
