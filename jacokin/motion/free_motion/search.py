"""Ways from a configuration to any of some goals without contact, by the kernels of `kernels/free_motion`."""

from __future__ import annotations

import threading
import time
from collections import Counter
from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.ik.seeds import DEFAULT_RANDOM_SEED
from jacokin.kernels.contact.run import ContactNumber, among
from jacokin.kernels.free_motion.run import (
    FINISHED,
    SHORTENING,
    GoalState,
    MotionInteger,
    MotionTask,
    MotionWork,
    make_motion_work,
    run_free_motion,
)
from jacokin.kernels.free_motion.shortcuts import WayInteger, make_way
from jacokin.kernels.free_motion.space import FIRST_MODULUS, SECOND_MODULUS, make_space
from jacokin.kernels.free_motion.trees import SearchInteger, SearchNumber, make_trees
from jacokin.kernels.library import Call, SharedCalls
from jacokin.model import checks
from jacokin.model.contact import REFUSED_WITHIN, Contact, Pair
from jacokin.model.robot import Robot
from jacokin.motion.free_motion.leaving import Leaving, Nearness

MOST_STRAIGHT = 64  # clear goals to which the straight motion is tried
MOST_SAMPLES = 200_000  # after which a search is given up, whatever time is left
AT_ONCE = 256  # samples or shortcuts between two looks at the clock
FIRST_ROOM = 1024  # configurations of a tree, twice as many whenever one is full
MODULI = np.repeat([FIRST_MODULUS, SECOND_MODULUS], 3)  # of the kernels' random numbers
FARTHEST = 1e3  # [rad] or [m] from zero, random configurations of joints without one limit


class Randomness:
    """Random numbers of one motion, made when they are first needed: many motions need none."""

    __slots__ = ("_made",)

    def __init__(self, given: np.random.Generator | None = None) -> None:
        """Take a generator; None for a fixed seed."""
        self._made = given

    @property
    def generator(self) -> np.random.Generator:
        """The generator, each time the same."""
        if self._made is None:
            self._made = np.random.default_rng(DEFAULT_RANDOM_SEED)
        return self._made

    def first_numbers(self) -> NDArray[np.int64]:
        """What the generator of the kernels begins with (6,)."""
        return _usual_numbers() if self._made is None else _numbers(self._made)


def _numbers(generator: np.random.Generator) -> NDArray[np.int64]:
    return checks.sealed(generator.integers(1, MODULI))


@cache
def _usual_numbers() -> NDArray[np.int64]:
    return _numbers(np.random.default_rng(DEFAULT_RANDOM_SEED))


class CutWay(NamedTuple):
    """A way of straight lines, none of its corners a straight one."""

    q: Array
    """(n, dof) configurations [rad]; unlimited joints turn on."""
    cuts: Array
    """(n,) how much of each corner may be cut off: time at full speed on both sides [s]; 0 where it must stay."""


@dataclass(slots=True)
class Found:
    """What a search found.

    Attributes:
        way: from the start to a goal, with clear straight motions between its corners; None for none.
        goal: number of the goal at its end.
        samples: how many random configurations it took.
        nearest: how near the trees came to each other [s], at full speed.
    """

    way: CutWay | None = None
    goal: int = -1
    samples: int = 0
    nearest: float = np.inf


@dataclass(slots=True)
class StraightMotion:
    """What is known about the straight motions to goals, the one that is reached soonest first.

    Attributes:
        reached: number of the goal whose straight motion is clear; -1 where all are blocked.
        blocked: numbers of the clear goals before it; `WaySearch.touching` says what touches at the others.
        near: those of them that are nearer to something than motions there can be certified with.
    """

    reached: int
    blocked: NDArray[np.intp]
    near: list[int]


_calls = SharedCalls(run_free_motion)


class WaySearch:
    """Looks for ways of one robot with what is around it; may be shared between threads."""

    def __init__(self, robot: Robot, contact: Contact, clearance: float) -> None:
        """Take what is in contact, and the distance that counts as contact [m]."""
        self.contact = contact
        self._robot, self._clearance = robot, clearance
        self._local = threading.local()

    @property
    def leaving(self) -> Leaving:
        """What finds ways out of contact, for this thread."""
        found: Leaving | None = getattr(self._local, "leaving", None)
        if found is None:
            found = self._local.leaving = Leaving(self._robot, self.contact, self._clearance)
        return found

    def near(self, q: Array) -> Nearness | None:
        """What is nearer at a configuration (dof,) than motions from there can be certified with; None for nothing."""
        call = self._call()
        call.work.start[:], call.work.integers[MotionInteger.TASK] = q, MotionTask.LOOK
        return None if call() else self.leaving.near(q)

    def begin(self, start: Array, goals: Array, speed: Array, rng: Randomness) -> None:
        """Set start (dof,) and goals (k, dof) [rad], the soonest first, and the speeds of the joints (dof,) [rad/s].

        Times at full speed are those at these speeds.
        """
        kept = getattr(self._local, "call", None)
        if kept is not None and len(kept.work.trees.parents) > 2 * 16_384:  # more is given back
            self._local.call = None
        call = self._call(len(goals))
        work = call.work
        work.start[:], work.goals[: goals.size] = start, goals.ravel()
        work.integers[MotionInteger.JOINTS], work.integers[MotionInteger.GOALS] = len(start), len(goals)
        work.space.speed[:] = speed
        work.hindrances.times[:] = 0
        self._local.rng = rng

    def go_straight(self) -> StraightMotion:
        """Try the straight motion to each goal in turn, until one is clear."""
        call = self._call()
        work = call.work
        work.integers[MotionInteger.TASK] = MotionTask.STRAIGHT_MOTIONS
        work.integers[MotionInteger.ENOUGH] = MOST_STRAIGHT
        work.known[:] = 0
        reached = call()
        known = work.known[: work.integers[MotionInteger.GOALS]]
        near = np.flatnonzero(known == GoalState.NEAR).tolist()
        return StraightMotion(reached, np.flatnonzero(known >= GoalState.BLOCKED), near)

    def go_around(
        self, goals: NDArray[np.intp], deadline: float, most_samples: int = MOST_SAMPLES, bound: float = np.inf
    ) -> Found:
        """Look for a way to one of some goals that are clear, and shorten it.

        Args:
            goals: their numbers.
            deadline: on the clock of `time.monotonic` [s], when the search is cut.
            most_samples: after which it is given up.
            bound: at full speed, it is to take less [s].
        """
        call = self._call()
        space, rng = call.work.space, self._local.rng
        if rng is not None:  # once for all ways
            call.work.generator[:] = rng.first_numbers()
            # When steps are measured, no joint counts as more than four times as fast as the slowest.
            compared = np.minimum(space.speed, 4.0 * space.speed.min())
            space.weights[:] = float(compared.sum()) / len(compared) / compared
            self._local.rng = None
        roots = goals[:48]  # the quickest to reach
        call.work.trees.numbers[SearchNumber.BOUND] = bound
        call.work.chosen[: len(roots)], call.work.integers[MotionInteger.ROOTS] = roots, len(roots)
        options, search = call.work.integers, call.work.trees.integers
        options[MotionInteger.TASK], options[MotionInteger.STEPS] = MotionTask.BEGIN_SEARCH, min(AT_ONCE, most_samples)
        options[MotionInteger.TRIES_IN_VAIN] = 70  # one after another
        options[MotionInteger.KEPT_FIRST] = options[MotionInteger.KEPT_LAST] = 0
        found = Found()
        while (stage := call()) != FINISHED:
            is_late = time.monotonic() >= deadline
            if stage == SHORTENING:
                options[MotionInteger.TASK], options[MotionInteger.STEPS] = MotionTask.SHORTEN, AT_ONCE
                if is_late:
                    options[MotionInteger.TRIES_IN_VAIN] = 0
                continue
            found.samples = int(search[SearchInteger.SAMPLES])
            if is_late or found.samples >= most_samples:
                found.nearest = float(call.work.trees.numbers[SearchNumber.NEAREST])
                return found
            options[MotionInteger.TASK] = MotionTask.GO_ON_SEARCH
            options[MotionInteger.STEPS] = min(AT_ONCE, most_samples - found.samples)
            if search[SearchInteger.IS_FULL]:
                call = self._grow()
                search = call.work.trees.integers
        found.samples = int(search[SearchInteger.SAMPLES])
        found.goal = int(roots[call.work.way.integers[WayInteger.GOAL]])
        found.way = self._way()
        return found

    def cut_corners(self, way: Array, first: int = 0, last: int = 0) -> CutWay:
        """A way (n, dof) with its corners cut, but so many at its beginning and at its end [rad]."""
        call = self._call()
        if len(way) > len(call.work.cuts):
            call = self._grow(len(way))
        work = call.work
        work.way.q[: way.size], work.way.integers[WayInteger.POINTS] = way.ravel(), len(way)
        options = work.integers
        options[MotionInteger.TASK] = MotionTask.CORNERS
        options[MotionInteger.KEPT_FIRST], options[MotionInteger.KEPT_LAST] = first, last
        call()
        return self._way()

    def _way(self) -> CutWay:
        """The way of the last call."""
        work = self._call().work
        points, dof = int(work.way.integers[WayInteger.POINTS]), len(work.start)
        return CutWay(work.way.q[: points * dof].reshape(points, dof).copy(), work.cuts[:points].copy())

    @property
    def touching(self) -> Counter[Pair]:
        """Pairs of shapes that touch at goals to which the straight motion was tried, and how often."""
        work = self._call().work
        known = work.known[: work.integers[MotionInteger.GOALS]]
        pairs = work.touching[: len(known)][known == GoalState.IN_CONTACT]
        return Counter(self.contact.ordered(a, b, by_kind=True) for a, b in pairs.tolist())

    @property
    def hindrances(self) -> Counter[Pair]:
        """Pairs of shapes that ended motions since `begin`, and how often."""
        seen = self._call().work.hindrances
        return Counter(
            {
                self.contact.ordered(a, b, by_kind=True): times
                for (a, b), times in zip(seen.pairs.tolist(), seen.times.tolist(), strict=True)
                if times
            }
        )

    def _call(self, goals: int = 0) -> Call[MotionWork]:
        """The kernels with work arrays of this thread, with room for so many goals."""
        found: Call[MotionWork] | None = getattr(self._local, "call", None)
        if found is None:
            found = self._local.call = self._first_call()
        if goals > len(found.work.known):
            dof, more = len(found.work.start), 2 * goals
            larger = found.work._replace(
                goals=np.zeros(more * dof),
                known=np.zeros(more, np.int64),
                touching=np.zeros((more, 2), np.int64),
                chosen=np.zeros(more, np.int64),
            )
            found = self._local.call = Call(run_free_motion, larger, found)
        return found

    def _first_call(self) -> Call[MotionWork]:
        """One that shares with the search before it in this thread whatever does not depend on obstacles."""
        call = _calls.call(self.contact.geometry.arm, self._make_work, self._among_obstacles)
        work, robot = call.work, self._robot
        space, numbers = work.space, work.sight.contact.numbers
        space.lower[:], space.upper[:], space.unlimited[:] = robot.lower, robot.upper, robot.unlimited
        space.low[:] = np.where(robot.unlimited, -np.pi, np.maximum(robot.lower, -FARTHEST))
        space.high[:] = np.where(robot.unlimited, np.pi, np.minimum(robot.upper, FARTHEST))
        space.levers[:] = self.contact.levers
        numbers[ContactNumber.MARGIN_KEPT], numbers[ContactNumber.SLACK] = self._clearance, REFUSED_WITHIN
        return call

    def _make_work(self) -> MotionWork:
        return make_motion_work(self.contact.geometry, MOST_STRAIGHT, FIRST_ROOM)

    def _among_obstacles(self, work: MotionWork) -> MotionWork:
        """The work arrays of this arm in another scene; the limits of a robot may be others."""
        sight = work.sight._replace(contact=among(work.sight.contact, self.contact.geometry))
        return work._replace(sight=sight, space=make_space(len(work.start)))

    def _grow(self, points: int = 0) -> Call[MotionWork]:
        """The call with trees twice as large, or for so many points, and a path for them; keeps what the trees hold."""
        work = self._call().work
        dof, room = len(work.start), len(work.trees.parents) // 2
        more = max(2 * room, points)
        trees = make_trees(dof, more)
        for tree in range(2):
            old, new = slice(tree * room, (tree + 1) * room), slice(tree * more, tree * more + room)
            trees.parents[new], trees.known[new] = work.trees.parents[old], work.trees.known[old]
            trees.q.reshape(-1, dof)[new] = work.trees.q.reshape(-1, dof)[old]
        trees.columns.reshape(2 * dof, more)[:, :room] = work.trees.columns.reshape(2 * dof, room)
        trees.integers[:], trees.numbers[:], trees.around[:] = (
            work.trees.integers,
            work.trees.numbers,
            work.trees.around,
        )
        trees.integers[SearchInteger.IS_FULL] = 0
        larger = work._replace(trees=trees, way=make_way(dof, 2 * more), cuts=np.zeros(2 * more))
        self._local.call = found = Call(run_free_motion, larger, self._call())
        return found
