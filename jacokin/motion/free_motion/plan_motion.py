"""`plan_motion`: from a configuration to a goal without contact. Read this file first.

A plan goes through these steps:

    goals       every configuration that reaches a goal is a candidate: branches, members of families, turns
    straight    the straight motion to each of them, the quickest first, is certified (`Contact.in_the_way`)
    trees       where those are blocked, two trees grow from start and goals until they meet
    shortcuts   the way is shortened
    blending    its corners are rounded, and it is timed within the limits (`motion.blending`)
"""

from __future__ import annotations

import itertools
import time
import weakref
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from jacokin.arrays import Array
from jacokin.errors import ModelError
from jacokin.ik.seeds import DEFAULT_RANDOM_SEED, checked_start, inside_exactly
from jacokin.ik.solver import IKSolver
from jacokin.ik.targets import interpret
from jacokin.model import checks
from jacokin.model.contact import Contact
from jacokin.model.obstacles import Surroundings
from jacokin.model.robot import Robot, velocity_limits
from jacokin.motion.blending import TimedCourse, fit_time, round_corners
from jacokin.motion.free_motion.goals import GoalFinder, list_aims
from jacokin.motion.free_motion.shortcuts import shorten
from jacokin.motion.free_motion.trees import Search, Space, TreeSearch
from jacokin.motion.grasps import Grasp
from jacokin.motion.joint_motion import ACCELERATION, SmoothLines
from jacokin.motion.timing import MAX_TICKS, check_ticks
from jacokin.motion.trajectory import Goal, JointMotion, MotionStatus

MOST_ROOTS = 48  # goals from which the second tree grows, the quickest to reach
MOST_STRAIGHT = 64  # goals to which the straight motion is tried
DETOUR = 1.5  # a straight motion this many times slower than the nearest goal allows is compared with a way around
SEARCH_SHARE = 0.8  # of the time is for the search; the rest for shortcuts
CHORD = 2e-4  # [m] shapes may be nearer on a rounded corner than on the chords that are certified
SAME = 1e-9  # [rad] a motion that is shorter is none


def plan_motion(
    solver: IKSolver,
    start: ArrayLike,
    goal: Any,
    *,
    time_limit: float = 1.0,
    rng: np.random.Generator | None = None,
    dt: float = 0.01,
    velocity_limit: ArrayLike | None = None,
    acceleration_limit: ArrayLike = ACCELERATION,
    jerk_limit: ArrayLike | None = None,
) -> JointMotion:
    """A joint motion from a configuration to a goal, without contact all along it.

    What touches is what the solver's scene says, with the solver's `clearance`; contact counts whatever its
    `collision`. Motions are certified, not sampled: nothing is stepped over.

    Args:
        solver: knows the arm, its tool, and its scene.
        start: (dof,) where the arm is [rad].
        goal: a configuration (dof,) [rad], a pose T_base_tool, a `FreeAxis`, a position (3,) [m], a `Grasp`, or a list
            of them, any of which will do. What is reached soonest is taken.
        time_limit: for the search [s]. It does not change what is found, only whether the search is cut.
        rng: randomness of the search; None for a fixed seed.
        dt: sampling step [s]; the last row is at the end of the motion, whole step or not.
        velocity_limit: (dof,) or one for all [rad/s]; None for the robot's own.
        acceleration_limit: (dof,) or one for all [rad/s^2].
        jerk_limit: (dof,) or one for all [rad/s^3]; None for none. With one, the arm stands still at corners.

    Returns:
        The motion from rest to rest, its limits held at every instant, with the goal that was taken, and the least
        distance at each row. Without a way it stays at the start, and `outcome` and `message` say why.

    Raises:
        InvalidInputError: a malformed argument, or a configuration outside the limits.
        UnknownNameError: the scene speaks of a link that is not there.
        MissingExtraError: `jerk_limit` is given, and Ruckig is not installed.
    """
    checks.instance("solver", solver, IKSolver, "an IKSolver")
    robot = solver.robot
    q = checked_start(robot, start, "start", noise=0.0)
    limit = checks.positive("time_limit", time_limit, "s")
    generator = np.random.default_rng(DEFAULT_RANDOM_SEED) if rng is None else checks.generator("rng", rng)
    velocity = velocity_limits(robot, velocity_limit)
    acceleration = checks.positive_vector("acceleration_limit", acceleration_limit, robot.dof, "rad/s^2")
    jerk = None if jerk_limit is None else checks.positive_vector("jerk_limit", jerk_limit, robot.dof, "rad/s^3")
    request = _Request(solver, q, velocity, acceleration, jerk, checks.positive("dt", dt, "s"))
    aims = list_aims(robot, goal)
    return request.plan(aims, generator, time.monotonic() + limit, limit)


@dataclass(frozen=True, slots=True, eq=False)
class _Request:
    """One motion that is asked for, checked.

    Attributes:
        solver: knows the arm and its scene.
        start: (dof,) [rad].
        velocity: (dof,) [rad/s].
        acceleration: (dof,) [rad/s^2].
        jerk: (dof,) [rad/s^3]; None for no limit.
        dt: of the rows [s].
    """

    solver: IKSolver
    start: Array
    velocity: Array
    acceleration: Array
    jerk: Array | None
    dt: float

    def plan(self, aims: Sequence[Any], rng: np.random.Generator, deadline: float, limit: float) -> JointMotion:
        """See `plan_motion`."""
        finder = GoalFinder(self.solver, self.start, rng)
        goals, reasons = list[Goal](), list[str]()
        for number, aim in enumerate(aims):
            found, reason = finder.find(number, aim)
            goals += found
            reasons += [reason] if reason else []
        contact = contact_of(self.solver)
        pair = None if contact is None else contact.first_touching(self.start)
        if pair is not None:
            return self._stay(MotionStatus.START_IN_CONTACT, f"{pair[0]} touches {pair[1]} at the start")
        if not goals:
            return self._stay(MotionStatus.UNREACHABLE, _listed(reasons))
        space = Space(self.solver.robot, self.velocity)
        times = space.time(np.array([each.q for each in goals]) - self.start)
        ordered = [goals[k] for k in np.argsort(times, kind="stable").tolist()]
        if contact is None:
            return self._go(np.array([self.start, ordered[0].q]), ordered[0], None, "")
        hindrances = Counter[tuple[str, str]]()
        clear, touched = _sort_out(ordered, contact)
        if not clear:
            sentence = f"all {len(ordered)} configurations that reach the goal touch something: {_named(touched)}"
            return self._stay(MotionStatus.GOAL_IN_CONTACT, sentence)
        best: tuple[Array, Goal] | None = None
        for each in clear[:MOST_STRAIGHT]:
            pair = contact.in_the_way(self.start, each.q)
            if pair is None:
                best = np.array([self.start, each.q]), each
                break
            hindrances[pair] += 1
        least = float(space.time(clear[0].q - self.start))
        if best is None or float(space.time(np.diff(best[0], axis=0)).sum()) > DETOUR * least:
            around, search = self._around(clear, space, contact, rng, deadline - (1.0 - SEARCH_SHARE) * limit, deadline)
            hindrances += search.hindrances
            if around is not None and (best is None or _duration(around[0], space) < _duration(best[0], space)):
                best = around
            if best is None:
                cut = (
                    "within the time" if time.monotonic() >= deadline - limit * (1 - SEARCH_SHARE) else "in all samples"
                )
                sentence = (
                    f"no way was found {cut} ({search.samples} samples); two parts of one came within "
                    f"{search.nearest:.3g} s of motion of each other; most often in the way: {_named(hindrances)}"
                )
                return self._stay(MotionStatus.NO_WAY, sentence)
        return self._go(*best, contact, "")

    def _around(
        self,
        goals: Sequence[Goal],
        space: Space,
        contact: Contact,
        rng: np.random.Generator,
        search_until: float,
        deadline: float,
    ) -> tuple[tuple[Array, Goal] | None, Search]:
        """A way around what blocks the straight motions, shortened; None where none was found in time."""
        roots = list(goals[:MOST_ROOTS])
        search = TreeSearch(space, contact, rng).find(self.start, np.array([each.q for each in roots]), search_until)
        if search.way is None:
            return None, search
        way = shorten(search.way, space, contact, rng, deadline)
        goal = roots[search.goal]
        end = Goal(checks.read_only(way[-1]), goal.number, goal.target, goal.parameter)
        return (way, end), search

    def _go(self, way: Array, goal: Goal, contact: Contact | None, note: str) -> JointMotion:
        """The timed motion along a way to a goal, measured."""
        robot = self.solver.robot
        moves = np.append(True, np.abs(np.diff(way, axis=0)).max(axis=1) > SAME)
        way = way[moves]
        if len(way) == 1:
            return self._write(np.zeros(1), way, np.zeros_like(way), np.zeros_like(way), goal, contact, "already there")
        timed = self._time(way, contact)
        if timed.duration / self.dt > MAX_TICKS:
            check_ticks(np.array([timed.duration]), self.dt)
        t = np.append(np.arange(0.0, timed.duration, self.dt), timed.duration)
        q, v, a = timed.at(t)
        q = np.clip(q, robot.lower, robot.upper)  # rounding
        q[0], q[-1], v[0], v[-1] = self.start, way[-1], 0.0, 0.0
        sentence = f"reached in {timed.duration:.4g} s"
        lines = len(way) - 1
        sentence += ", straight" if lines == 1 else f", around what is in the way by {lines} lines"
        if contact is None:
            sentence += "; the description has no collision shapes, so contact was not checked"
        return self._write(t, q, v, a, goal, contact, sentence + note)

    def _time(self, way: Array, contact: Contact | None) -> TimedCourse | SmoothLines:
        if self.jerk is not None:
            return SmoothLines(way, self.velocity, self.acceleration, self.jerk)

        def is_clear(corner: Array, turn: Array) -> bool:
            return contact is None or is_parabola_clear(corner, turn, contact)

        course, stops = round_corners(way, self.velocity, is_clear)
        return fit_time(course, stops, self.velocity, self.acceleration)

    def _write(
        self, t: Array, q: Array, v: Array, a: Array, goal: Goal, contact: Contact | None, message: str
    ) -> JointMotion:
        wrong = self._misses(goal)
        return JointMotion.of(
            self.solver.robot,
            self.velocity,
            (t, q, v, a),
            clearance=np.full(len(q), np.nan) if contact is None else contact.distances(q, self_collision=True),
            status=MotionStatus.MISSED if wrong else MotionStatus.OK,
            message=wrong or message,
            goal=goal,
        )

    def _misses(self, goal: Goal) -> str:
        """What is wrong with the end of a motion, measured by Pinocchio; "" if nothing is."""
        solver, verifier = self.solver, self.solver.verifier
        robot = solver.robot
        if not inside_exactly(robot.lower.tolist(), goal.q.tolist(), robot.upper.tolist()):
            return "the goal is outside the limits"
        if goal.target is None:
            return ""
        wanted = interpret(goal.target.target if isinstance(goal.target, Grasp) else goal.target, solver.frame)
        if wanted.free_axis is not None and goal.parameter is not None:
            wanted = wanted.at(goal.parameter)
        errors = verifier.measure(goal.q, wanted)
        return (
            ""
            if verifier.reached(goal.q, errors)
            else f"the end misses the goal by {errors[0]:.3g} m, {errors[1]:.3g} rad"
        )

    def _stay(self, status: MotionStatus, message: str) -> JointMotion:
        """A motion that does not begin."""
        rows = np.zeros(1), self.start[None], np.zeros((1, len(self.start))), np.zeros((1, len(self.start)))
        return JointMotion.of(self.solver.robot, self.velocity, rows, status=status, message=message)


def is_parabola_clear(corner: Array, turn: Array, contact: Contact) -> bool:
    """Whether a parabola with control points (3, dof) is clear.

    `turn` (dof,) is half of its second derivative by a parameter that runs from 0 to 1 [rad].
    """
    # The chord of one of n equal parts is at most turn / (4 n^2) from its part of the parabola, joint by joint.
    away = 0.25 * float(turn @ contact.levers)
    count = max(2, int(np.ceil(np.sqrt(away / CHORD))))
    u = np.linspace(0.0, 1.0, count + 1)[:, None]
    rows = (1.0 - u) ** 2 * corner[0] + 2.0 * u * (1.0 - u) * corner[1] + u**2 * corner[2]
    extra = away / count**2
    return all(contact.in_the_way(a, b, extra) is None for a, b in itertools.pairwise(rows))


_contacts: weakref.WeakKeyDictionary[IKSolver, Contact | None] = weakref.WeakKeyDictionary()


def contact_of(solver: IKSolver) -> Contact | None:
    """What checks motions in a solver's scene, built once; None for a robot without shapes.

    Raises:
        InvalidInputError: the scene does not fit the robot.
        UnknownNameError: the scene speaks of a link that is not there.
    """
    if solver not in _contacts:
        options = solver.verifier.options
        around = Surroundings() if options.scene is None else options.scene.surroundings
        _contacts[solver] = _build_contact(solver.robot, around, options.clearance)
    return _contacts[solver]


def _build_contact(robot: Robot, around: Surroundings, clearance: float) -> Contact | None:
    try:
        found = Contact(robot, around, clearance=clearance)
    except ModelError:
        if around.names:
            raise
        return None
    return found if found.has_shapes else None


def _sort_out(goals: Sequence[Goal], contact: Contact) -> tuple[list[Goal], Counter[tuple[str, str]]]:
    """The goals that are clear, and how often each pair of shapes touches at the others."""
    clear, touched = list[Goal](), Counter[tuple[str, str]]()
    for goal in goals:
        pair = contact.first_touching(goal.q)
        if pair is None:
            clear.append(goal)
        else:
            touched[pair] += 1
        if len(clear) == max(MOST_STRAIGHT, MOST_ROOTS):
            break
    return clear, touched


def _duration(way: Array, space: Space) -> float:
    return float(space.time(np.diff(way, axis=0)).sum())


def _named(pairs: Counter[tuple[str, str]]) -> str:
    """The pairs of shapes that are met most often, for a sentence."""
    return ", ".join(f"{a} and {b}" for (a, b), _ in pairs.most_common(2))


def _listed(reasons: Sequence[str]) -> str:
    """Why goals are not reached, each reason once."""
    return "; ".join(dict.fromkeys(reasons))
