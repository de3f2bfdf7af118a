"""Ways from a configuration to any of some goals without contact, and their rows, by `kernels/free_motion`."""

from __future__ import annotations

import threading
import time
from collections import Counter
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.ik.seeds import DEFAULT_RANDOM_SEED
from jacokin.kernels.contact.run import ContactNumber, among
from jacokin.kernels.course_times import make_course_work
from jacokin.kernels.free_motion.rows import RowNumber
from jacokin.kernels.free_motion.run import (
    FINISHED,
    TIMING,
    GoalState,
    MotionInteger,
    MotionNumber,
    MotionTask,
    MotionWork,
    make_motion_work,
    run_free_motion,
)
from jacokin.kernels.free_motion.shortcuts import WayInteger, make_way
from jacokin.kernels.free_motion.space import FIRST_MODULUS, SECOND_MODULUS, make_space
from jacokin.kernels.free_motion.trees import SearchInteger, SearchNumber, make_trees
from jacokin.kernels.library import Call, SharedCalls
from jacokin.kernels.rest_to_rest import make_rest_work
from jacokin.model import checks
from jacokin.model.contact import REFUSED_WITHIN, Contact, Pair
from jacokin.model.robot import Robot
from jacokin.motion.free_motion.leaving import Leaving, Nearness
from jacokin.motion.rows import Limits, Rows
from jacokin.motion.timing import MAX_TICKS, check_ticks

MOST_STRAIGHT = 64  # clear goals to which the straight motion is tried
AT_ONCE = 256  # samples or shortcuts between two looks at the clock
IN_VAIN = 70  # shortcuts that are none, one after another, after which there are no more
FIRST_ROOM = 1024  # configurations of a tree, twice as many whenever one is full
CORNERS, ROWS = 64, 2048  # of a way that is timed and written; for more there is room when they are needed
KEPT_ROOM, KEPT_ROWS = 16_384, 20_000  # what takes more is given back
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


class Found(NamedTuple):
    """What a search found."""

    way: CutWay
    """From the start to a goal, with clear straight motions between its corners; without points for none."""
    goal: int
    """Number of the goal at its end."""
    duration: float
    """Of the motion along it, about [s]."""


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

    def begin(self, start: Array, goals: Array, speed: Array, limits: Limits, rng: Randomness) -> None:
        """Set start (dof,) and goals (k, dof) [rad], the soonest first, and the speeds of the joints (dof,) [rad/s].

        Times at full speed are those at these speeds.
        """
        kept = getattr(self._local, "call", None)
        if kept is not None:
            work = kept.work
            if len(work.trees.parents) > 2 * KEPT_ROOM or len(work.rows.taken) > KEPT_ROWS * len(start):
                self._local.call = None
        work = self._call(len(goals)).work
        work.start[:], work.goals[: goals.size] = start, goals.ravel()
        work.integers[MotionInteger.JOINTS], work.integers[MotionInteger.GOALS] = len(start), len(goals)
        work.space.speed[:] = speed
        work.hindrances.times[:] = 0
        work.rows.limits[0::3], work.rows.limits[1::3] = limits.velocity, limits.acceleration
        work.rows.limits[2::3] = np.inf if limits.jerk is None else limits.jerk
        self._local.rng = rng

    def go_straight(self) -> list[int]:
        """Try the straight motion to each goal in turn, until one is clear.

        Returns:
            Numbers of those before it that are nearer to something than motions there can be certified with.
        """
        call = self._call()
        work, options = call.work, call.work.integers
        options[MotionInteger.TASK], options[MotionInteger.ENOUGH] = MotionTask.STRAIGHT_MOTIONS, MOST_STRAIGHT
        work.known[:] = GoalState.UNKNOWN
        return np.flatnonzero(work.known == GoalState.NEAR).tolist() if call() else []

    def leave_out(self, goal: int) -> None:
        """Look for no ways to a goal."""
        self._call().work.known[goal] = GoalState.UNKNOWN

    @property
    def has_goals(self) -> bool:
        """Whether any of the goals to which the straight motion was tried is clear, and not left out."""
        return bool((self._call().work.known > GoalState.IN_CONTACT).any())

    def find_ways(self, ways: int, deadline: float) -> Found:
        """Look for ways to goals that are clear, where the straight motion is none of the quickest; take the quickest.

        Args:
            ways: how many.
            deadline: on the clock of `time.monotonic` [s], when the search is cut.
        """
        call = self._call()
        work, options = call.work, call.work.integers
        if options[MotionInteger.STAGE] != FINISHED:
            work.generator[:] = self._local.rng.first_numbers()
            options[MotionInteger.TASK], options[MotionInteger.WAYS] = MotionTask.FIND_WAYS, ways
            options[MotionInteger.STEPS], options[MotionInteger.TRIES_IN_VAIN] = AT_ONCE, IN_VAIN
            options[MotionInteger.IS_LATE] = 0
            while (stage := call()) != FINISHED:
                options[MotionInteger.IS_LATE] = time.monotonic() >= deadline
                if stage == TIMING:
                    call = self._grow_course(int(call.work.way.integers[WayInteger.POINTS]))
                elif call.work.trees.integers[SearchInteger.IS_FULL]:
                    call = self._grow()
        return Found(self._way(), int(options[MotionInteger.GOAL]), float(work.numbers[MotionNumber.DURATION]))

    @property
    def samples(self) -> int:
        """How many random configurations the last search took."""
        return int(self._call().work.trees.integers[SearchInteger.SAMPLES])

    @property
    def nearest(self) -> float:
        """How near its trees came to each other [s], at full speed."""
        return float(self._call().work.trees.numbers[SearchNumber.NEAREST])

    def cut_corners(self, way: Array, first: int = 0, last: int = 0) -> CutWay:
        """A way (n, dof) with its corners cut, but so many at its beginning and at its end [rad]."""
        call = self._take(way)
        options = call.work.integers
        options[MotionInteger.TASK] = MotionTask.CORNERS
        options[MotionInteger.KEPT_FIRST], options[MotionInteger.KEPT_LAST] = first, last
        call()
        return self._way()

    def write(self, way: CutWay, dt: float, slower: float = 1.0) -> Rows:
        """Rows `dt` [s] apart of the motion along a way that takes so many times as long as the limits allow.

        Raises:
            InvalidInputError: more than `MAX_TICKS`.
        """
        call, count, dof = self._take(way.q), 0, way.q.shape[1]
        while True:
            work = call.work
            if len(way.q) > len(work.rows.course.cuts):
                call = self._grow_course(len(way.q))
                continue
            work.cuts[: len(way.q)] = way.cuts
            work.rows.numbers[RowNumber.DT], work.rows.numbers[RowNumber.SLOWER] = dt, slower
            work.integers[MotionInteger.TASK] = MotionTask.ROWS
            count = call()
            if count > MAX_TICKS:
                check_ticks(np.array([count * dt]), dt)
            if count * dof <= len(work.rows.taken):
                break
            call = self._grow_rows(count)
        q, v, a = (each[: count * dof].reshape(count, dof).copy() for each in work.rows.rest[-3:])
        return Rows(dt * np.arange(count, dtype=np.float64), q, v, a)

    def _take(self, way: Array) -> Call[MotionWork]:
        """The kernels with a way (n, dof) that is given [rad]."""
        call = self._call()
        if len(way) > len(call.work.cuts):
            call = self._grow(len(way))
        work = call.work
        work.way.q[: way.size], work.way.integers[WayInteger.POINTS] = way.ravel(), len(way)
        return call

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
            found = self._with(larger)
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
        return make_motion_work(self.contact.geometry, MOST_STRAIGHT, FIRST_ROOM, CORNERS, ROWS)

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
        best, best_cuts = np.zeros(2 * more * dof), np.zeros(2 * more)
        best[: len(work.best)], best_cuts[: len(work.best_cuts)] = work.best, work.best_cuts
        way, cuts = make_way(dof, 2 * more), np.zeros(2 * more)
        return self._with(work._replace(trees=trees, way=way, cuts=cuts, best=best, best_cuts=best_cuts))

    def _grow_course(self, points: int) -> Call[MotionWork]:
        """The call with room for the corners of a way of so many points, and more."""
        work = self._call().work
        course = make_course_work(len(work.start), 2 * points)
        return self._with(work._replace(rows=work.rows._replace(course=course)))

    def _grow_rows(self, rows: int) -> Call[MotionWork]:
        """The call with room for so many rows, and more."""
        work = self._call().work
        taken, rest = np.zeros(2 * rows * len(work.start)), make_rest_work(len(work.start), 2 * rows)
        return self._with(work._replace(rows=work.rows._replace(taken=taken, rest=rest)))

    def _with(self, work: MotionWork) -> Call[MotionWork]:
        """The call with other work arrays."""
        found: Call[MotionWork] = Call(run_free_motion, work, self._call())
        self._local.call = found
        return found
