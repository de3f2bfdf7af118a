"""The entry point: one tick, from where the arm is to where it is after it. Read this file first.

tick       from what is missing to the targets to a displacement of the joints
reach      as much of the displacement as is clear
near       what shapes that are near add to a tick
rest       a displacement after which the arm can come to rest clear of what is near
watch      which of them a displacement could bring near
twist      how much of a twist the joints can follow
inverse    what they do for it
limits     how far each joint may go in a tick

Python comes in between only where a QP solver has to, for targets of later priorities and objectives, and to look at
the clock.
"""

from __future__ import annotations

from typing import NamedTuple

from jacokin.kernels.tracking.limits import AT_BOUND, STEP, move
from jacokin.kernels.tracking.problem import fill_damped
from jacokin.kernels.tracking.reach import (
    ASKED,
    BEYOND,
    CLEAR,
    DISTANCES,
    HORIZON,
    KEEPING,
    LEAST,
    LEAST_BEFORE,
    MOVING,
    NOT_CLEAR,
    PART,
    RESTING,
    SPARE,
    ReachWork,
    make_reach_work,
    try_reach,
)
from jacokin.kernels.tracking.rest import turn_aside
from jacokin.kernels.tracking.tasks import TASK_INTEGERS, TASK_NUMBERS, is_rigid, place_joints, take_pose
from jacokin.kernels.tracking.tick import (
    APART,
    BEST,
    CAN_STOP,
    DAMPED,
    FIRST_TASKS,
    GREW,
    GROWS,
    GUARDED,
    IF_RIGID,
    IN_PARTS,
    MOST_SPARE,
    NEEDS_QP,
    POSED,
    REFINED,
    ROWS,
    SLOWED,
    SOLVED,
    STAGE,
    STOPS_AT_ONCE,
    TASKS,
    TRIED,
    TickWork,
    finish_tick,
    is_within_limits,
    keeps_inequalities,
    linearise_tick,
    make_tick_work,
    report_tick,
    solve_tick,
)
from jacokin.kernels.tracking.twist import TwistWork, follow_twist, make_twist_work
from jacokin.kernels.tracking.watch import take_near, watch_corners

#: Where a call goes on: what near shapes and limits ask of any displacement, and no more; what those ask that a total
#: could bring near, and no more; a whole tick; one whose total was found elsewhere; one along a twist, linearised; one
#: whose displacement was found elsewhere; what of the displacement is clear; the report.
LINEARISE, LOOK_AHEAD, WHOLE, FROM_TOTAL, FROM_TWIST, FROM_STEP, TRY, REPORT = range(8)
#: What it returns beside 0 on the way, and what `find_step` does with a QP solver to be called: the arm is on its
#: target; the displacement of this tick is there, and something else may be added to it; time to look at the clock.
#: Or nothing was done, as the pose is not rigid.
ON_TARGET, NEEDS_MORE, UNFINISHED, NOT_RIGID = 1, 3, 4, -1
#: Of the way from braking to what the arm would do, tried until nothing is too near.
PARTS = (1.0, 0.5, 0.2, 0.05)


class RunWork(NamedTuple):
    """What a call reads and writes."""

    tick: TickWork
    reach: ReachWork  # empty where nothing is kept apart
    twist: TwistWork


def make_run_work() -> RunWork:
    """Empty arrays."""
    return RunWork(make_tick_work(), make_reach_work(), make_twist_work())


def run_tick(work: RunWork) -> int:
    """Go on with a tick from its stage; for one of `LINEARISE`, returns how many pairs of shapes are too near."""
    tick, counts = work.tick, work.tick.counts
    stage = counts[STAGE]
    if counts[POSED] == IF_RIGID and not is_rigid(tick.pose):
        return NOT_RIGID
    if counts[POSED] > 0:
        take_pose(tick.tasks, tick.pose)
    counts[POSED] = 0
    if stage == LINEARISE:
        take_near(tick, work.reach, 0)
        return linearise_tick(tick)
    if stage == LOOK_AHEAD:
        place_joints(tick.arm, tick.q)
        watch_corners(tick, work.reach)
        return 0
    if stage <= FROM_TOTAL:
        outcome = find_step(work, stage)
        counts[GREW], counts[APART] = int(outcome == GROWS), int(tick.near.counts[2] > 0)
        if outcome >= NEEDS_QP:
            return outcome
        if outcome == SOLVED and has_more(tick):
            return NEEDS_MORE
    if stage == FROM_TWIST:
        follow_twist(tick, work.reach, work.twist)
    if stage <= FROM_STEP:
        if stage != FROM_TWIST and counts[GUARDED] == 1:
            turn_aside(tick, work.reach)
        keep_bounds(tick)
        begin_reach(work)
        if counts[IN_PARTS] == 1:
            return UNFINISHED
    if stage <= TRY and not reach_clear(work):
        return UNFINISHED
    on_target = report_tick(tick)
    keep_tasks(tick)
    return on_target


def find_step(work: RunWork, stage: int) -> int:
    """Find the displacement of a tick, or the QP that it takes."""
    tick = work.tick
    known = 0  # inequalities that the total satisfies
    if stage == WHOLE:
        take_near(tick, work.reach, 0)
        solve_tick(tick)
    else:
        known = tick.near.counts[1]
    watch_corners(tick, work.reach)
    solved = keeps_inequalities(tick, known) and (stage == FROM_TOTAL or is_within_limits(tick))
    if has_more(tick) or not solved:
        fill_damped(tick.problem, tick.numbers[DAMPED], len(tick.q))
    if not solved:
        return NEEDS_QP
    return finish_tick(tick)


def has_more(tick: TickWork) -> bool:
    """Whether something is added to the displacement of the first targets."""
    return bool(tick.counts[TASKS] > tick.counts[FIRST_TASKS] or tick.counts[REFINED] == 1)


def keep_bounds(tick: TickWork) -> None:
    """Keep the displacement within the bounds of the tick, and find out whether that takes more than rounding."""
    dof, bounds = len(tick.q), tick.bounds
    tick.counts[SLOWED] = 0
    for j in range(dof):
        wanted = tick.step[j]
        tick.step[j] = min(max(wanted, bounds[j]), bounds[dof + j])
        if abs(tick.step[j] - wanted) > AT_BOUND * tick.limits[j, STEP]:
            tick.counts[SLOWED] = 1


def begin_reach(work: RunWork) -> None:
    """Say what is to be tried: the displacement, from where the arm is and pairs are as far apart as was found."""
    tick, reach = work.tick, work.reach
    tick.counts[STAGE], tick.counts[TRIED], tick.counts[BEST] = TRY, 0, -1
    if tick.counts[GUARDED] == 0:
        return
    for j in range(len(tick.q)):
        reach.start[j], reach.v[j], reach.displacement[j] = tick.q[j], tick.v[j], tick.step[j]
    for i in range(len(reach.pairs.bound)):
        reach.pairs.before[i] = reach.pairs.bound[i]
    reach.numbers[BEYOND], reach.numbers[LEAST_BEFORE] = HORIZON, reach.numbers[LEAST]


def reach_clear(work: RunWork) -> bool:
    """Go as much of a displacement as is clear, and find out whether the arm can stop then; False to look at the clock.

    Where the arm could not come to rest clear of everything, it brakes, unless a part of the displacement keeps farther
    away from an obstacle that comes nearer.
    """
    tick, reach, counts = work.tick, work.reach, work.tick.counts
    dof = len(tick.q)
    if counts[GUARDED] == 0:
        move(tick.limits, tick.q, tick.step, tick.after[:dof])
        counts[CAN_STOP] = 1
        return True
    asked, outcome = KEEPING if counts[STOPS_AT_ONCE] == 1 else KEEPING | RESTING, NOT_CLEAR
    while outcome != CLEAR and counts[TRIED] < len(PARTS):
        outcome = try_part(reach, PARTS[counts[TRIED]], asked)
        if outcome == NOT_CLEAR and (counts[BEST] < 0 or reach.numbers[SPARE] > tick.numbers[MOST_SPARE]):
            counts[BEST], tick.numbers[MOST_SPARE] = counts[TRIED], reach.numbers[SPARE]
        counts[TRIED] += 1
        if outcome != CLEAR and counts[IN_PARTS] == 1 and counts[TRIED] < len(PARTS):
            return False
    if outcome != CLEAR:
        certain = counts[STOPS_AT_ONCE] == 1 or (counts[CAN_STOP] == 1 and reach.counts[MOVING] == 0)
        outcome = try_part(reach, 0.0, DISTANCES if certain else RESTING)
        if outcome == NOT_CLEAR and counts[BEST] >= 0 and reach.numbers[SPARE] < tick.numbers[MOST_SPARE]:
            try_part(reach, PARTS[counts[BEST]], DISTANCES)
    counts[CAN_STOP] = int(outcome == CLEAR)
    for j in range(dof):
        tick.after[j] = reach.q[j]
    return True


def try_part(reach: ReachWork, part: float, asked: int) -> int:
    """Go a part of the way from braking to the displacement; returns what `try_reach` does."""
    reach.numbers[PART], reach.counts[ASKED] = part, asked
    return try_reach(reach)


def keep_tasks(tick: TickWork) -> None:
    """Keep what this tick was asked for, and how the targets moved: the next one looks back at it."""
    dof = len(tick.q)
    for t in range(tick.counts[FIRST_TASKS]):
        for k in range(TASK_INTEGERS):
            tick.before.integers[t, k] = tick.tasks.integers[t, k]
        for k in range(TASK_NUMBERS):
            tick.before.numbers[t, k] = tick.tasks.numbers[t, k]
    for k in range(dof * tick.counts[FIRST_TASKS]):
        tick.before.joints[k] = tick.tasks.joints[k]
    for r in range(tick.counts[ROWS]):
        tick.moved_before[r] = tick.moved[r]
