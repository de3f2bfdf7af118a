"""The entry point: a motion from one configuration to any of some goals, without contact. Read this file first.

    straight    the straight motion to each goal in turn, until one is clear
    search      two trees grow until they meet (`trees`), the way takes less time (`shortcuts`), and how much of its
                corners may be cut off is found (`corners`)

A search and shortcuts go on where they were, some steps with each call, so that a caller can look at the clock.
"""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.contact.run import NOTHING, make_contact_work, stands_clear
from jacokin.kernels.contact.sweep import make_sweep
from jacokin.kernels.contact.touching import Geometry
from jacokin.kernels.free_motion.corners import cut_corners
from jacokin.kernels.free_motion.shortcuts import (
    Way,
    WayInteger,
    end_at,
    join_branches,
    make_way,
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
)
from jacokin.kernels.free_motion.trees import Trees, grow_trees, make_trees, plant

#: What to do. LOOK: whether motions may pass the start. CORNERS: of a way that is given.
MotionTask = IntEnum("MotionTask", "LOOK STRAIGHT_MOTIONS BEGIN_SEARCH GO_ON_SEARCH SHORTEN CORNERS", start=0)
#: How far a search has come.
SEARCHING, SHORTENING, FINISHED = range(3)
#: Where the options' integers are: task, joints, goals, how many clear goals are enough, roots, steps of a search and
#: tries of a shortcut in one call, the failures in a row that end shortcuts, and how many corners at the beginning and
#: at the end of a way are not cut.
MotionInteger = IntEnum(
    "MotionInteger", "TASK JOINTS GOALS ENOUGH ROOTS STEPS TRIES_IN_VAIN KEPT_FIRST KEPT_LAST COUNT", start=0
)
#: What is known about a goal. NEAR: it is clear, and nearer to something than motions to it can be certified with.
GoalState = IntEnum("GoalState", "UNKNOWN IN_CONTACT STRAIGHT BLOCKED NEAR", start=0)


class MotionWork(NamedTuple):
    """What a call reads and writes; one set for each thread."""

    integers: NDArray[np.int64]  # (MOTION_INTEGERS,)
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


def run_free_motion(work: MotionWork) -> int:
    """Do a task; this is what gets compiled: it allocates nothing.

    Returns:
        Of straight motions, the number of the first goal that is reached so, or -1; of a look, 1 where motions may
        pass; otherwise the stage.
    """
    integers, space, sight, way = work.integers, work.space, work.sight, work.way
    task, dof = integers[MotionInteger.TASK], integers[MotionInteger.JOINTS]
    if task == MotionTask.LOOK:
        return 1 if is_free(sight, work.start) else 0
    if task == MotionTask.STRAIGHT_MOTIONS:
        return try_straight(work)
    trees, steps, patience = work.trees, integers[MotionInteger.STEPS], integers[MotionInteger.TRIES_IN_VAIN]
    if task in (MotionTask.BEGIN_SEARCH, MotionTask.GO_ON_SEARCH):
        if task == MotionTask.BEGIN_SEARCH:
            plant(trees, space, dof, work.start, work.goals, work.chosen, integers[MotionInteger.ROOTS])
        if not grow_trees(trees, space, dof, sight, work.hindrances, work.generator, steps):
            return SEARCHING
        join_branches(trees, space, dof, work.start, way)
        skip_corners(way, space, dof, sight)
    if task != MotionTask.CORNERS:
        if not shorten(way, space, dof, sight, work.generator, steps, patience):
            return SHORTENING
        skip_corners(way, space, dof, sight)
        end_at(way, dof, work.goals[work.chosen[way.integers[WayInteger.GOAL]] * dof :])
    kept = integers[MotionInteger.KEPT_FIRST], integers[MotionInteger.KEPT_LAST]
    cut_corners(way, space, dof, sight, work.cuts, kept)
    return FINISHED


def try_straight(work: MotionWork) -> int:
    """The first goal that a straight motion reaches, or -1; each goal before it becomes known."""
    integers, sight, contact = work.integers, work.sight, work.sight.contact
    dof, clear = integers[MotionInteger.JOINTS], 0
    for k in range(integers[MotionInteger.GOALS]):
        goal = work.goals[k * dof : (k + 1) * dof]
        if not stands_clear(contact, goal):
            work.known[k] = GoalState.IN_CONTACT
            work.touching[k, 0], work.touching[k, 1] = contact.hits.pairs[0, 0], contact.hits.pairs[0, 1]
            continue
        if moves_clear(sight, work.start, goal, 0.0):
            work.known[k] = GoalState.STRAIGHT
            return k
        remember(work.hindrances, contact.course.pair)
        work.known[k] = GoalState.BLOCKED
        if not is_free(sight, goal):
            work.known[k] = GoalState.NEAR
        clear += 1
        if clear == integers[MotionInteger.ENOUGH]:
            break
    return -1


def make_motion_work(geometry: Geometry = NOTHING, goals: int = 0, room: int = 0) -> MotionWork:
    """Fresh work arrays for a geometry, so many goals, and so many configurations of each tree."""
    dof = len(geometry.arm.joint_kinds)
    return MotionWork(
        np.zeros(MotionInteger.COUNT, np.int64),
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
    )
