"""A tick towards targets: from where the arm is to a displacement of its joints, and the report on where it led.

tasks      what is missing to the targets, its Jacobian, and how that turns
problem    the squared error to second order, and its least value
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.contact.pairs import CORNERS, MOST_POINTS
from jacokin.kernels.tracking.aside import PLACES, Aside, make_aside
from jacokin.kernels.tracking.limits import (
    CATCHING,
    LIMIT_NUMBERS,
    LOWER,
    UPPER,
    fill_bounds,
    fill_room,
    keep_to_target,
    limit_reached,
    move,
    take_stride,
)
from jacokin.kernels.tracking.near import NearPairs, find_too_near, keep_apart, make_near_pairs
from jacokin.kernels.tracking.problem import (
    TINY,
    Problem,
    begin,
    divide,
    is_singular,
    make_problem,
    make_regular,
    take_worthwhile,
)
from jacokin.kernels.tracking.tasks import (
    TASK_INTEGERS,
    JointFrames,
    TaskRows,
    add_bend,
    fill_errors,
    fill_faces,
    fill_jacobian,
    make_task_rows,
    measure_task,
    place_joints,
    rows_of,
)

#: Of a squared error: a step that leaves less goes on to the target, the less is left the farther.
REMOVED = 0.02
#: Of how far the end of a joint's way comes towards it, relative to how far the joint goes itself.
MOST_NEARING = 3.0
#: [s] over which that is averaged: where the Hessian loses a negative eigenvalue, the end jumps.
AVERAGED = 0.05
#: Columns of the counts: tasks, those that come first, those of the tick before; rows of errors of the first tasks and
#: of all; whether the targets moved in the tick before; filled: whether they moved.
TASKS, FIRST_TASKS, TASKS_BEFORE, ROWS, ALL_ROWS, MOVED_BEFORE, MOVED = range(7)
#: Whether the Hessian will be needed; whether to report on a motion, or the arm has only been measured; whether to find
#: out if the pose is singular, filled with the answer.
REFINED, GOES, SINGULAR = range(7, 10)
#: Where a call goes on, see `run`; whether it returns so that Python can look at the clock; whether shapes are kept
#: apart; whether every joint may stop within a tick; whether the arm can stop clear of everything, before the tick, and
#: filled for after it. Filled: whether bounds took something from the displacement; whether every step made the error
#: grow; whether shapes are moved apart; parts of it that were tried, and the one from which the arm keeps farthest away
#: without being able to stop. Whether it is known where the tick before was to lead; whether the target is to be taken
#: from `pose`: as it is, or if it is rigid.
STAGE, IN_PARTS, GUARDED, STOPS_AT_ONCE, CAN_STOP, SLOWED, GREW, APART, TRIED, BEST, AIMED, POSED = range(10, 22)
TICK_COUNTS = 22
AS_IT_IS, IF_RIGID = 1, 2
#: Of the numbers: control step [s]; error that is not worth while to be made smaller [m]; tolerances [m], [rad].
#: Filled: squared error, damping, how far that part keeps away [m]; and after the tick the largest distance [m] and
#: angle [rad] of the first tasks, the fastest joint's velocity [rad/s], and how far joints are past their limits [rad].
TIME_STEP, NEGLIGIBLE, NEAR_ENOUGH, TURNED_ENOUGH, COST, DAMPED, MOST_SPARE = range(7)
DISTANCE, ANGLE, FASTEST, PAST, TICK_NUMBERS = range(7, 12)
#: What a tick comes to: a displacement; none, as every step makes the error grow; what is missing in all is beyond a
#: limit or a distance, and a QP solver must find it within the joints' limits.
SOLVED, GROWS, NEEDS_QP = range(3)


class TickWork(NamedTuple):
    """What a call reads and writes."""

    counts: NDArray[np.int64]  # (22,)
    numbers: Array  # (12,)
    arm: JointFrames
    limits: Array  # (dof, 8)
    q: Array  # (dof,) where the arm is [rad]
    v: Array  # (dof,) its velocity over the last tick [rad/s]
    pose: Array  # (4, 4) that the only task is for
    tasks: TaskRows
    before: TaskRows  # of the tick before
    moved_before: Array  # (rows,) by how much the targets moved the error in the tick before
    moved: Array  # (rows,) filled: in this one
    near: NearPairs
    there: NearPairs  # one that is measured where the arm may go
    aside: Aside
    problem: Problem
    columns: Array  # (dof, 6) to work in
    room: Array  # (2 dof,) filled: least and largest displacement to the limits [rad]
    bounds: Array  # (2 dof,) filled: in this tick
    total: Array  # (dof,) what is missing to the target at the end of the tick [rad]
    along: Array  # (dof,) what follows a target that moves [rad]
    along_change: Array  # (dof,) by how much that changes with the target's motion [rad]
    aim: Array  # (2 dof,) where the tick before was to lead in all [rad], and its `find_nearing`; filled for this one
    step: Array  # (dof,) filled: the displacement of this tick [rad]
    after: Array  # (3 dof,) where the arm is after the tick [rad]; filled: its velocity then, and its acceleration
    reached: NDArray[np.int64]  # (dof,) filled with what each joint runs into, see `limits`


def make_joint_frames(dof: int = 0) -> JointFrames:
    """Fresh arrays of an arm with the base where it is."""
    frames = np.zeros((dof + 1 if dof else 0, 3, 4))
    frames[:] = np.eye(3, 4)
    return JointFrames(np.zeros(dof, np.int64), np.zeros((dof, 3, 4)), frames)


def make_tick_work(dof: int = 0, tasks: int = 0, pairs: int = 0, clouds: int = 0) -> TickWork:
    """Fresh arrays for so many joints, tasks and pairs of shapes, of which so many have a cloud."""
    rows, more = tasks * max(dof, 6), 6 * tasks + CORNERS * pairs + MOST_POINTS * clouds
    return TickWork(
        np.zeros(TICK_COUNTS, np.int64),
        np.zeros(TICK_NUMBERS),
        make_joint_frames(dof),
        np.zeros((dof, LIMIT_NUMBERS)),
        np.zeros(dof),
        np.zeros(dof),
        np.eye(4),
        make_task_rows(dof, tasks),
        make_task_rows(dof, tasks),
        np.zeros(rows),
        np.zeros(rows),
        make_near_pairs(dof, pairs, more),
        make_near_pairs(dof, 1),
        make_aside(dof, more + (1 + PLACES) * pairs),
        make_problem(dof, rows),
        np.zeros((dof, 6)),
        np.zeros(2 * dof),
        np.zeros(2 * dof),
        np.zeros(dof),
        np.zeros(dof),
        np.zeros(dof),
        np.zeros(2 * dof),
        np.zeros(dof),
        np.zeros(3 * dof),
        np.zeros(dof, np.int64),
    )


def solve_tick(work: TickWork) -> None:
    """Find what is missing to the targets in all, whatever limits and distances allow; and what they are."""
    counts, numbers, problem, near, q = work.counts, work.numbers, work.problem, work.near, work.q
    dof, tasks, first = len(q), work.tasks, counts[FIRST_TASKS]
    place_joints(work.arm, q)
    fill_errors(work.arm.frames, tasks, 0, counts[TASKS], q, problem.error)
    fill_jacobian(work.arm, tasks, counts[TASKS], work.columns, problem.jacobian)
    count_rows(work, dof)
    rows = counts[ROWS]
    find_moved(work, rows)
    cost = begin(problem, rows, dof)
    numbers[COST] = cost
    add_bend(work.arm, tasks, first, work.columns, problem.left, problem.hessian)
    begun = fill_faces(work.arm, tasks, first, work.columns, near.rows, near.ends)
    keep_apart(work.arm, near, 0, begun)
    find_too_near(near)
    numbers[DAMPED] = make_regular(problem, cost, numbers[NEGLIGIBLE], dof)
    fill_bounds(work.limits, q, work.v, numbers[TIME_STEP], work.bounds[:dof], work.bounds[dof:])
    fill_room(work.limits, q, work.room[:dof], work.room[dof:])
    for j in range(dof):
        work.total[j] = -problem.gradient[j]
    divide(problem, work.total, dof)


def is_within_limits(work: TickWork) -> bool:
    """Whether all that is missing is within the joints' limits."""
    dof, within = len(work.q), True
    for j in range(dof):
        within = within and work.room[j] <= work.total[j] <= work.room[dof + j]
    return within


def keeps_inequalities(work: TickWork, first: int) -> bool:
    """Whether all that is missing satisfies the inequalities from a first one on."""
    dof, near = len(work.q), work.near
    for r in range(first, near.counts[1]):
        used = 0.0
        for j in range(dof):
            used += near.rows[r * dof + j] * work.total[j]
        if used > near.ends[r]:
            return False
    return True


def count_rows(work: TickWork, dof: int) -> None:
    """Fill the numbers of rows of errors."""
    rows = 0
    for t in range(work.counts[TASKS]):
        if t == work.counts[FIRST_TASKS]:
            work.counts[ROWS] = rows
        rows += rows_of(work.tasks.integers[t, 0], dof)
    work.counts[ALL_ROWS] = rows
    if work.counts[TASKS] == work.counts[FIRST_TASKS]:
        work.counts[ROWS] = rows


def find_moved(work: TickWork, rows: int) -> None:
    """Fill how the errors at this configuration changed with the targets in the last tick.

    They have not moved where the tick before was asked for something else; where that was to lead says nothing then.
    """
    counts, tasks, before = work.counts, work.tasks, work.before
    aimed = counts[AIMED]
    counts[MOVED] = counts[AIMED] = 0
    if counts[TASKS_BEFORE] != counts[FIRST_TASKS]:
        return
    for t in range(counts[FIRST_TASKS]):
        for k in range(TASK_INTEGERS):
            if tasks.integers[t, k] != before.integers[t, k]:
                return
        if tasks.numbers[t, 0] != before.numbers[t, 0]:
            return
    fill_errors(work.arm.frames, before, 0, counts[TASKS_BEFORE], work.q, work.moved)
    for r in range(rows):
        work.moved[r] = work.problem.error[r] - work.moved[r]
        if work.moved[r] != 0.0:
            counts[MOVED] = 1
    counts[AIMED] = aimed


def finish_tick(work: TickWork) -> int:
    """Find the displacement of a tick from what is missing to the target in all."""
    dof, rows = len(work.q), work.counts[ROWS]
    take_worthwhile(work.problem, work.total)
    for j in range(dof):
        work.along[j], work.along_change[j], work.step[j] = 0.0, 0.0, work.total[j]
    lasting = 1.0 - work.counts[MOVED]
    if work.counts[MOVED] == 1 and work.counts[MOVED_BEFORE] == 1:
        lasting, left = lasting_part(work.moved_before, work.moved, rows), work.problem.left
        follow(work.problem, work.moved, lasting, rows, work.along)
        for r in range(rows):
            left[r] = work.moved[r] - work.moved_before[r]
        follow(work.problem, left, lasting, rows, work.along_change)
    find_nearing(work, lasting)
    dt, low, high = work.numbers[TIME_STEP], work.bounds[:dof], work.bounds[dof:]
    keep_to_target(work.limits, work.v, dt, work.along_change, low, high)
    take_stride(work.limits, work.total, work.along, work.aim[dof:], work.step)
    return descend(work, rows)


def find_nearing(work: TickWork, lasting: float) -> None:
    """Fill where this tick is to lead, and how far each joint finds the end of its way to come towards it.

    A way to a target is straight in the joints to second order only: of a long one there may be less left than it was
    less what a joint has gone. A fast joint would find out too late that it must turn; one that can stop within a tick
    need not know.

    Args:
        work: of the tick.
        lasting: part of the target's motion that is expected to go on; of one that jumps nothing is known.
    """
    dof, dt, aimed = len(work.q), work.numbers[TIME_STEP], work.counts[AIMED] == 1
    fresh = dt / (dt + AVERAGED)
    for j in range(dof):
        end, gone, gap = work.q[j] + work.total[j], work.v[j] * dt - work.along[j], work.total[j] - work.along[j]
        nearer = math.copysign(1.0, gap) * (work.aim[j] + work.along[j] - end)
        now, before = 0.0, work.aim[dof + j] if aimed else 0.0
        if aimed and gap * gone > 0.0 and nearer > 0.0:
            now = min(nearer / max(abs(gone), work.limits[j, CATCHING]), MOST_NEARING)
        work.aim[j], work.aim[dof + j] = end, lasting * (before + fresh * (now - before))
    work.counts[AIMED] = 1


def lasting_part(before: Array, moved: Array, rows: int) -> float:
    """The part of a target's motion that it has in common with the one of the tick before: it is expected to go on.

    A target that jumps stands afterwards, as far as anyone knows.
    """
    common, size = 0.0, 0.0
    for r in range(rows):
        common += before[r] * moved[r]
        size += moved[r] * moved[r]
    return min(max(common / max(size, TINY), 0.0), 1.0)


def follow(problem: Problem, moved: Array, part: float, rows: int, x: Array) -> None:
    """Fill the displacement (dof,) [rad] that follows a part of what a target moves the error by."""
    dof = len(x)
    for j in range(dof):
        x[j] = 0.0
    for r in range(rows):
        for j in range(dof):
            x[j] += part * moved[r] * problem.jacobian[r * dof + j]
    divide(problem, x, dof)


def descend(work: TickWork, rows: int) -> int:
    """Shorten a step towards targets at rest to where the error would be least, if it bends as it does over all of it.

    One that all but removes the error is corrected by what is left: so moving targets are followed to the curvature of
    the kinematics' third order.
    """
    dof, cost, left, problem = len(work.q), work.numbers[COST], work.problem.left, work.problem
    trial, slope, now = work.after[:dof], 0.0, 0.0
    move(work.limits, work.q, work.step, trial)
    place_joints(work.arm, trial)
    fill_errors(work.arm.frames, work.tasks, 0, work.counts[FIRST_TASKS], trial, left)
    for r in range(rows):
        now += left[r] * left[r]
        for j in range(dof):
            slope -= 2.0 * problem.error[r] * problem.jacobian[r * dof + j] * work.step[j]
    if now < REMOVED * cost:
        part = now / (REMOVED * cost)
        follow(problem, left, 1.0 - part * part, rows, work.along)
        for j in range(dof):
            work.step[j] += work.along[j]
        return SOLVED
    bend = now - cost - slope
    at_rest = work.counts[MOVED] == 0 and now > work.numbers[NEGLIGIBLE] * work.numbers[NEGLIGIBLE]
    if not at_rest or 2.0 * bend <= -slope:
        return SOLVED
    for j in range(dof):
        work.step[j] *= max(-0.5 * slope / bend, 0.0)
    return SOLVED if slope < 0.0 else GROWS


def linearise_tick(work: TickWork) -> int:
    """Fill the bounds of a tick, and what near shapes add; returns how many pairs are too near."""
    dof = len(work.q)
    place_joints(work.arm, work.q)
    fill_bounds(work.limits, work.q, work.v, work.numbers[TIME_STEP], work.bounds[:dof], work.bounds[dof:])
    fill_room(work.limits, work.q, work.room[:dof], work.room[dof:])
    keep_apart(work.arm, work.near, 0, 0)
    find_too_near(work.near)
    return int(work.near.counts[2])


def report_tick(work: TickWork) -> int:
    """Measure where the arm is after a tick; returns 1 where it is on its target."""
    dof, dt, numbers = len(work.q), work.numbers[TIME_STEP], work.numbers
    fastest, past = 0.0, -math.inf
    for j in range(dof):
        work.after[dof + j] = (work.after[j] - work.q[j]) / dt if work.counts[GOES] == 1 else work.v[j]
        work.after[2 * dof + j] = (work.after[dof + j] - work.v[j]) / dt
        work.reached[j] = limit_reached(work.limits, j, work.q[j], work.after[dof + j], work.v[j], dt)
        fastest = max(fastest, abs(work.after[dof + j]))
        past = max(past, max(work.after[j] - work.limits[j, UPPER], work.limits[j, LOWER] - work.after[j]))
    numbers[FASTEST], numbers[PAST] = fastest, past
    after = work.after[:dof]
    place_joints(work.arm, after)
    position, orientation = 0.0, 0.0
    for t in range(work.counts[FIRST_TASKS]):
        distance, angle = measure_task(work.arm.frames, work.tasks, t, after)
        position, orientation = max(position, distance), max(orientation, angle)
    numbers[DISTANCE], numbers[ANGLE] = position, orientation
    if position <= numbers[NEAR_ENOUGH] and orientation <= numbers[TURNED_ENOUGH]:
        return 1
    if work.counts[SINGULAR] == 1:
        work.counts[SINGULAR] = int(is_singular(work.problem, work.counts[ROWS], numbers[COST], dof))
    return 0
