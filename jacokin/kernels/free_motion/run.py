"""The entry point: a motion from one configuration to any of some goals, without contact. Read this file first.

    straight    the straight motion to each goal in turn, until one is clear
    ways        two trees grow until they meet (`trees`), the way takes less time (`shortcuts`), and how much of its
                corners may be cut off is found (`corners`); the quickest of some ways is taken
    rows        it is written from stop to stop (`rows`)

Looking for ways goes on where it was, some steps with each call, so that a caller can look at the clock.
"""

from __future__ import annotations

import math
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.contact.run import NOTHING, make_contact_work, stands_clear
from jacokin.kernels.contact.sweep import make_sweep
from jacokin.kernels.contact.touching import Geometry
from jacokin.kernels.free_motion.corners import cut_corners
from jacokin.kernels.free_motion.rows import RowWork, duration_of, make_row_work, write_way
from jacokin.kernels.free_motion.shortcuts import (
    Way,
    WayInteger,
    end_at,
    join_branches,
    make_way,
    put,
    shorten,
    skip_corners,
)
from jacokin.kernels.free_motion.sight import Sight, is_free, moves_clear
from jacokin.kernels.free_motion.space import (
    HINDRANCES,
    Hindrances,
    Space,
    make_space,
    remember,
    weigh,
)
from jacokin.kernels.free_motion.trees import (
    NONE,
    SearchInteger,
    SearchNumber,
    Trees,
    grow_trees,
    make_trees,
    plant,
)

#: What to do. LOOK: whether motions may pass the start. CORNERS, ROWS: of a way that is given.
MotionTask = IntEnum("MotionTask", "LOOK STRAIGHT_MOTIONS FIND_WAYS CORNERS ROWS", start=0)
#: What comes next. TIMING takes more room for the corners of a way where there is too little.
CHOOSING, SEARCHING, SHORTENING, TIMING, FINISHED = range(5)
#: Where the options' integers are: task, joints, goals, how many clear goals are enough, steps of a search and tries of
#: a shortcut in one call, the failures in a row that end shortcuts, how many corners at the beginning and at the end of
#: a way are not cut, how many ways are still to be looked for, and 1 when the time is over. Filled in are what comes
#: next, how many samples of a search are enough, and goal and points of the quickest way, NONE without any.
MotionInteger = IntEnum(
    "MotionInteger",
    "TASK JOINTS GOALS ENOUGH STEPS TRIES_IN_VAIN KEPT_FIRST KEPT_LAST WAYS IS_LATE STAGE MOST_SAMPLES GOAL POINTS "
    "COUNT",
    start=0,
)
#: What is known about the quickest way: how long it takes in all, and at full speed [s].
MotionNumber = IntEnum("MotionNumber", "DURATION AT_FULL_SPEED COUNT", start=0)
#: What is known about a goal. NEAR: it is clear, and nearer to something than motions to it can be certified with.
GoalState = IntEnum("GoalState", "UNKNOWN IN_CONTACT STRAIGHT BLOCKED NEAR", start=0)

MOST_ROOTS = 48  # goals of one search
MOST_SAMPLES = 200_000  # after which a search is given up, whatever time is left
MOST_AGAIN = 1000  # of a search for a quicker way, if all of the time could be saved
DIRECT = 1.5  # times as long as to a nearer goal, a straight motion is compared with ways around
QUICKER = 0.98  # part of the time of one way that another is to take


class MotionWork(NamedTuple):
    """What a call reads and writes; one set for each thread."""

    integers: NDArray[np.int64]  # (MOTION_INTEGERS,)
    numbers: Array  # (MOTION_NUMBERS,)
    space: Space
    sight: Sight
    hindrances: Hindrances
    generator: NDArray[np.int64]  # (6,) none of the first and second three all zero
    start: Array  # (dof,) [rad]
    goals: Array  # (goals dof,) the one that is reached soonest first [rad]
    known: NDArray[np.int64]  # (goals,)
    touching: NDArray[np.int64]  # (goals, 2) what touches there
    chosen: NDArray[np.int64]  # (roots,) goals from which the second tree grows
    trees: Trees
    way: Way
    cuts: Array  # (room,) of the corners of the way [s]
    best: Array  # (room dof,) the quickest way [rad]
    best_cuts: Array  # (room,)
    rows: RowWork


def run_free_motion(work: MotionWork) -> int:
    """Do a task; this is what gets compiled: it allocates nothing.

    Returns:
        Of a look, 1 where motions may pass; of straight motions, how many goals are near to something; of ways, what
        comes next; of corners, 0; of rows, their number.
    """
    integers, sight, way = work.integers, work.sight, work.way
    task, dof = integers[MotionInteger.TASK], integers[MotionInteger.JOINTS]
    if task == MotionTask.LOOK:
        return 1 if is_free(sight, work.start) else 0
    if task == MotionTask.STRAIGHT_MOTIONS:
        return try_straight(work)
    if task == MotionTask.FIND_WAYS:
        integers[MotionInteger.STAGE] = find_ways(work)
        return int(integers[MotionInteger.STAGE])
    if task == MotionTask.CORNERS:
        kept = integers[MotionInteger.KEPT_FIRST], integers[MotionInteger.KEPT_LAST]
        cut_corners(way, work.space, dof, sight, work.cuts, kept)
        return 0
    return write_way(work.rows, way, work.cuts, work.space, sight)


def find_ways(work: MotionWork) -> int:
    """Go on looking for ways around what blocks straight motions, until the quickest of them is known."""
    integers, trees, space, sight, way = work.integers, work.trees, work.space, work.sight, work.way
    dof, steps, is_late = integers[MotionInteger.JOINTS], integers[MotionInteger.STEPS], integers[MotionInteger.IS_LATE]
    stage = integers[MotionInteger.STAGE]
    if stage == CHOOSING:
        weigh(space, dof)
        roots = choose_goals(work)
        if roots == 0:
            return finish(work)
        plant(trees, space, dof, work.start, work.goals, work.chosen, roots)
        stage = SEARCHING
    if stage == SEARCHING:
        left = integers[MotionInteger.MOST_SAMPLES] - trees.integers[SearchInteger.SAMPLES]
        if is_late or left <= 0:
            return finish(work) if integers[MotionInteger.GOAL] == NONE else CHOOSING
        if not grow_trees(trees, space, dof, sight, work.hindrances, work.generator, min(steps, left)):
            return SEARCHING
        join_branches(trees, space, dof, work.start, way)
        skip_corners(way, space, dof, sight)
        stage = SHORTENING
    if stage == SHORTENING:
        patience = 0 if is_late else integers[MotionInteger.TRIES_IN_VAIN]
        if not shorten(way, space, dof, sight, work.generator, steps, patience):
            return SHORTENING
        skip_corners(way, space, dof, sight)
        end_at(way, space, dof, work.goals[work.chosen[way.integers[WayInteger.GOAL]] * dof :])
        cut_corners(way, space, dof, sight, work.cuts, (0, 0))
    stage = compare(work)
    return finish(work) if stage == CHOOSING and integers[MotionInteger.WAYS] == 0 else stage


def choose_goals(work: MotionWork) -> int:
    """Choose goals that are clear, and can be reached more quickly than by what is known; returns how many.

    There is none when no more ways are asked for, or the time is over.
    """
    integers = work.integers
    is_first, bound, least, roots = integers[MotionInteger.GOAL] == NONE, math.inf, math.inf, 0
    if integers[MotionInteger.WAYS] == 0 or (integers[MotionInteger.IS_LATE] and not is_first):
        return 0
    if not is_first:
        bound = QUICKER * work.numbers[MotionNumber.AT_FULL_SPEED]
    for k in range(integers[MotionInteger.GOALS]):
        if work.known[k] < GoalState.BLOCKED:
            continue
        time = time_to(work, k)
        if time < bound and roots < MOST_ROOTS:
            work.chosen[roots] = k
            roots, least = roots + 1, min(least, time)
    integers[MotionInteger.WAYS] -= 1
    integers[MotionInteger.MOST_SAMPLES] = MOST_SAMPLES
    if not is_first and roots > 0:  # no way saves more than this part of the time
        integers[MotionInteger.MOST_SAMPLES] = math.ceil(MOST_AGAIN * (1.0 - least / bound))
    work.trees.numbers[SearchNumber.BOUND] = bound
    return roots


def time_to(work: MotionWork, goal: int) -> float:
    """Of the straight motion to a goal at full speed [s]."""
    dof, most = work.integers[MotionInteger.JOINTS], 0.0
    for j in range(dof):
        most = max(most, abs(work.goals[goal * dof + j] - work.start[j]) / work.space.speed[j])
    return most


def compare(work: MotionWork) -> int:
    """Keep the way if it is the quickest so far, and go on to the next one."""
    integers, way, dof = work.integers, work.way, work.integers[MotionInteger.JOINTS]
    points = way.integers[WayInteger.POINTS]
    if points > len(work.rows.course.cuts):
        return TIMING
    duration = duration_of(work.rows, way, work.cuts, work.space)
    if integers[MotionInteger.GOAL] == NONE or duration < work.numbers[MotionNumber.DURATION]:
        integers[MotionInteger.GOAL] = work.chosen[way.integers[WayInteger.GOAL]]
        integers[MotionInteger.POINTS] = points
        work.numbers[MotionNumber.DURATION] = duration
        work.numbers[MotionNumber.AT_FULL_SPEED] = way.times[points - 1]
        for k in range(points):
            put(work.best, dof, k, way.q[k * dof : (k + 1) * dof])
            work.best_cuts[k] = work.cuts[k]
    return CHOOSING


def finish(work: MotionWork) -> int:
    """Let the way be the quickest one."""
    dof = work.integers[MotionInteger.JOINTS]
    work.way.integers[WayInteger.POINTS] = work.integers[MotionInteger.POINTS]
    for k in range(work.integers[MotionInteger.POINTS]):
        put(work.way.q, dof, k, work.best[k * dof : (k + 1) * dof])
        work.cuts[k] = work.best_cuts[k]
    return FINISHED


def try_straight(work: MotionWork) -> int:
    """Try the straight motion to each goal in turn, until one is clear; each goal before it becomes known.

    That motion is the quickest way; it is all that is looked for unless it takes much longer than one to a nearer goal.

    Returns:
        How many of the goals are near to something.
    """
    integers, sight, contact, way = work.integers, work.sight, work.sight.contact, work.way
    dof, clear, near, first = integers[MotionInteger.JOINTS], 0, 0, NONE
    integers[MotionInteger.STAGE], integers[MotionInteger.GOAL], integers[MotionInteger.POINTS] = CHOOSING, NONE, 0
    for k in range(integers[MotionInteger.GOALS]):
        goal = work.goals[k * dof : (k + 1) * dof]
        if not stands_clear(contact, goal):
            work.known[k] = GoalState.IN_CONTACT
            work.touching[k, 0], work.touching[k, 1] = contact.hits.pairs[0, 0], contact.hits.pairs[0, 1]
            continue
        if moves_clear(sight, work.start, goal, 0.0):
            work.known[k] = GoalState.STRAIGHT
            put(way.q, dof, 0, work.start)
            put(way.q, dof, 1, goal)
            way.integers[WayInteger.POINTS], way.integers[WayInteger.GOAL], work.chosen[0] = 2, 0, k
            cut_corners(way, work.space, dof, sight, work.cuts, (0, 0))
            compare(work)
            if clear == 0 or time_to(work, k) <= DIRECT * time_to(work, first):
                integers[MotionInteger.STAGE] = finish(work)
            break
        remember(work.hindrances, contact.course.pair)
        work.known[k] = GoalState.BLOCKED
        if not is_free(sight, goal):
            work.known[k] = GoalState.NEAR
            near += 1
        if clear == 0:
            first = k
        clear += 1
        if clear == integers[MotionInteger.ENOUGH]:
            break
    return near


def make_motion_work(
    geometry: Geometry = NOTHING, goals: int = 0, room: int = 0, corners: int = 0, rows: int = 0
) -> MotionWork:
    """Fresh work arrays for a geometry, so many goals, configurations of each tree, points of a timed way, and rows."""
    dof = len(geometry.arm.joint_kinds)
    return MotionWork(
        np.zeros(MotionInteger.COUNT, np.int64),
        np.zeros(MotionNumber.COUNT),
        make_space(dof),
        Sight(make_contact_work(geometry, 1 if dof else 0), make_sweep(geometry.arm)),
        Hindrances(np.zeros((HINDRANCES, 2), np.int64), np.zeros(HINDRANCES, np.int64)),
        np.ones(6, np.int64),
        np.zeros(dof),
        np.zeros(goals * dof),
        np.zeros(goals, np.int64),
        np.zeros((goals, 2), np.int64),
        np.zeros(goals, np.int64),
        make_trees(dof, room),
        make_way(dof, 2 * room),
        np.zeros(2 * room),
        np.zeros(2 * room * dof),
        np.zeros(2 * room),
        make_row_work(dof, corners, rows),
    )
