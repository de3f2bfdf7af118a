"""`plan_motion`: from a configuration to a goal without contact. Read this file first.

A plan goes through these steps:

    goals       every configuration that reaches a goal is a candidate: branches, members of curves, turns
    ends        joints outside their limits come back, and what is near at the start comes apart (`leaving`)
    search      the straight motion to each of them is tried, the quickest first; where those are blocked, ways around
                are looked for, and the quickest is taken (`search`, and kernels/free_motion)
    rows        it is written within the limits, in steps so short that controllers touch nothing between two of them

An arm that moves already is planned for from where it can stop; then it goes on without stopping where it can
(`under_way`).
"""

from __future__ import annotations

import time
import weakref
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, ModelError
from jacokin.ik.seeds import checked_start, inside_exactly, random_configurations
from jacokin.ik.solutions.curve_set import CurveSet
from jacokin.ik.solver import IKSolver
from jacokin.ik.targets import PartialTarget, Target, TargetPose, interpret
from jacokin.model import angles, checks
from jacokin.model.angles import TURN
from jacokin.model.contact import Contact, Pair, contact_of_nothing, self_contact
from jacokin.model.own_shapes import own_hulls
from jacokin.model.poses import FreeAxis
from jacokin.model.robot import Robot, acceleration_limits, copies_counted, jerk_limits, velocity_limits
from jacokin.motion.free_motion.leaving import DEEPEST, SAME_DISTANCE
from jacokin.motion.free_motion.meanwhile import Meanwhile, Motions
from jacokin.motion.free_motion.search import CutWay, Randomness, WaySearch
from jacokin.motion.free_motion.under_way import AT_REST, NoStop, Stop, find_stop, go_directly, go_on, velocity_now
from jacokin.motion.grasps import Grasp
from jacokin.motion.joint_motion import ACCELERATION
from jacokin.motion.rows import HELD, Limits, MotionState, OnTheWay, Rows, coarse, halved, resting
from jacokin.motion.timing import (
    BETWEEN,
    MOST_PLACES,
    TooHeavy,
    hold_torques,
    slowness,
    steps_of,
    torque_limits,
    torque_strain,
)
from jacokin.motion.trajectory import Aim, Goal, MotionStatus, Trajectory

SAME = 1e-9  # [rad] a motion that is shorter is none


def plan_motion(
    solver: IKSolver,
    start: ArrayLike | MotionState,
    goal: Any,
    *,
    time_limit: float = 1.0,
    ways: int = 2,
    rng: np.random.Generator | None = None,
    dt: float = 0.01,
    velocity_limit: ArrayLike | None = None,
    acceleration_limit: ArrayLike = ACCELERATION,
    jerk_limit: ArrayLike | None = None,
    torque_limit: ArrayLike | bool | None = None,
    meanwhile: Motions | None = None,
) -> Trajectory:
    """A joint motion from a configuration to a goal, without contact all along it.

    What touches is what the solver's scene says, with the solver's `clearance`; contact counts whatever its
    `collision`. Motions are certified, not sampled: nothing is stepped over.

    Args:
        solver: knows the arm, its tool, and its scene.
        start: (dof,) where the arm is [rad]. A joint up to 1e-6 rad past its limit is on it; one that is farther out
            first comes straight back. Shapes that touch there, up to 1 cm deep, or are nearer than the clearance, first
            come apart, without any of them getting nearer. Or a motion under way, `Trajectory.state_at(time)` or
            `state` of a tracker: then the plan begins with exactly its positions and velocities. It goes on without
            stopping where the way to the goal bends little enough, and first comes to rest elsewhere: straight on, or
            with each joint braking as hard as it may. Its accelerations are not continued; with a jerk limit they begin
            at zero.
        goal: a configuration (dof,) [rad], a pose T_base_tool, a `FreeAxis`, a position (3,) [m], a `Grasp`, or a list
            of them, any of which will do. What is reached soonest is taken. A configuration is reached as it is given,
            on unlimited joints whole turns apart. On three joints (3,) is a configuration, and a position is a
            `PositionTarget`.
        time_limit: for all but the first look at a scene and writing the rows [s]. It does not change what is found,
            only whether the search is cut: then the quickest way so far is taken.
        ways: how many ways are looked for where the straight motion is blocked; the quickest is taken.
        rng: randomness of the search; None for a fixed seed.
        dt: step from row to row [s]; smaller where controllers could touch something between two rows, as `message`
            says.
        velocity_limit: (dof,) or one for all [rad/s]; None for the robot's own.
        acceleration_limit: (dof,) or one for all [rad/s^2].
        jerk_limit: (dof,) or one for all [rad/s^3]; None for none.
        torque_limit: (dof,) or one for all [N m]; True for the robot's own (`effort_limit`), None for none. The whole
            motion is slowed down until no joint needs more, what the robot carries (`Robot.with_payload`) included.
        meanwhile: motions of other robots, which the scene has by these names (`Scene.adding_robot`), at the same time:
            trajectories, or (trajectory, time [s]) where the arm begins at a time of theirs. Before and after them the
            robots stand still. The arm keeps clear of them at every time, also while it waits: it may wait at its
            start, or move aside first, and what reaches the goal soonest of some ways is taken. It must start at rest.

    Returns:
        The motion to rest, its limits held at every instant as controllers go from row to row, with the goal that was
        taken, and the least distance at each row, measured when it is first asked for. Without a way it stays at the
        start, or comes to rest if the arm moves there, and `outcome` and `message` say why. An arm that cannot stop
        clear and within its limits gets one row, its start, and the outcome CANNOT_STOP.

    Raises:
        InvalidInputError: a malformed argument, a goal outside the limits, or a start faster than the limits.
        UnknownNameError: the scene speaks of a link that is not there, or has no robot of a name in `meanwhile`.
        ModelError: the shapes of the description cannot be loaded; with collision="ignore" the motion is planned
            without looking for contact then, and `message` says so.
    """
    checks.instance("solver", solver, IKSolver, "an IKSolver")
    robot = solver.robot
    q = robot.home if isinstance(start, MotionState) else checked_start(robot, start, "start", outside=True)
    limit = checks.positive("time_limit", time_limit, "s")
    randomness = Randomness(None if rng is None else checks.generator("rng", rng))
    velocity = velocity_limits(robot, velocity_limit)
    acceleration, jerk = acceleration_limits(robot, acceleration_limit), jerk_limits(robot, jerk_limit)
    torque = torque_limits(robot, torque_limit)
    step, count = checks.positive("dt", dt, "s"), checks.whole_number("ways", ways, 1, 1000)  # some seconds
    speed = np.minimum(velocity, np.sqrt(np.pi * acceleration))
    slowest = float(speed.min())
    request = _Request(
        solver=solver,
        start=q,
        velocity=velocity,
        acceleration=acceleration,
        jerk=jerk,
        torque=torque,
        dt=step,
        ways=count,
        speed=speed / slowest,
        unit=1.0 / slowest,
    )
    aims, search = list_aims(goal), search_of(solver)
    begun = time.monotonic()
    if isinstance(start, MotionState):
        now = velocity_now(robot, start, velocity)
        request = request._replace(start=now[0])
        if np.abs(now[1]).max() > AT_REST:
            if meanwhile is not None:
                raise InvalidInputError("with meanwhile the arm must start at rest, and start is a motion under way")
            found = request.stop_from(now, search)
            if isinstance(found, Trajectory):
                return found
            request = found
    if meanwhile is not None:
        plan = partial(
            plan_motion,
            ways=count,
            rng=rng,
            velocity_limit=velocity,
            acceleration_limit=acceleration,
            jerk_limit=jerk,
            torque_limit=torque,
        )
        return Meanwhile(solver, meanwhile, begun + limit).plan(plan, request.start, goal, step)
    return request.plan(aims, search, randomness, begun, begun + limit)


class _Ends(NamedTuple):
    """What comes before and after what a search finds."""

    before: Array
    """(n, dof) from the start to where the search begins [rad]."""
    after: Mapping[int, Array]
    """(m, dof) by number of the goal: where the search ends, and what comes then [rad]."""
    unlimited: NDArray[np.bool_]
    """(dof,) joints of which whole turns make no difference."""

    def around(self, way: CutWay, goal: int, search: WaySearch) -> CutWay:
        """A way to a goal with what comes before and after it, corners of which are not cut."""
        tail = self.after.get(goal, way.q[-1:])
        if len(self.before) == 1 and len(tail) == 1:
            return way
        tail = tail + TURN * np.round((way.q[-1] - tail[0]) / TURN) * self.unlimited  # turned on
        lines = np.concatenate([self.before[:-1], way.q, tail[1:]])
        return search.cut_corners(lines, len(self.before) - 1, len(tail) - 1)


class _Beginning(NamedTuple):
    """How a motion begins before it is searched for."""

    rows: Array
    """(n, dof) from the start to where the search begins [rad]."""
    note: str
    """What happens there, for a sentence; "" for nothing."""


class _Request(NamedTuple):
    """One motion that is asked for, checked.

    Attributes:
        solver: knows the arm and its scene.
        start: (dof,) [rad]; joints may be outside their limits.
        velocity: (dof,) [rad/s].
        acceleration: (dof,) [rad/s^2].
        jerk: (dof,) [rad/s^3]; None for no limit.
        torque: (dof,) [N m]; None for no limit.
        dt: of the rows [s].
        ways: how many ways around are compared.
        speed: (dof,) what ways are compared by, the slowest joint 1: the velocity limit, or what a joint reaches within
            half a turn at its acceleration limit, whichever is less.
        unit: what times at that speed are counted in [s].
        stop: how the arm comes to rest at `start`; None for one that rests there.
    """

    solver: IKSolver
    start: Array
    velocity: Array
    acceleration: Array
    jerk: Array | None
    torque: Array | None
    dt: float
    ways: int
    speed: Array
    unit: float
    stop: Stop | None = None

    def stop_from(self, now: tuple[Array, Array], search: WaySearch) -> _Request | Trajectory:
        """This request from where the arm, with positions and velocities `now`, both (dof,), can stop.

        If it cannot stop, the start alone, with the reason.
        """
        strain = None if self.torque is None else partial(torque_strain, self.solver.robot, limit=self.torque)
        stop = find_stop(self.solver.robot, now, self.limits, self.dt, search, strain)
        if isinstance(stop, NoStop):
            rows = resting(now[0])._replace(v=now[1][None])
            return Trajectory.of(
                self.solver.robot, self.velocity, rows, status=MotionStatus.CANNOT_STOP, message=stop.reason
            )
        return self._replace(start=stop.end, stop=stop)

    @property
    def limits(self) -> Limits:
        """Of velocity, acceleration and jerk."""
        return Limits(self.velocity, self.acceleration, self.jerk)

    def plan(
        self, aims: Sequence[Any], search: WaySearch, rng: Randomness, begun: float, deadline: float
    ) -> Trajectory:
        """The quickest motion found to any of the aims, or one that stays at the start, with the reason."""
        inside = self.start.clip(self.solver.robot.lower, self.solver.robot.upper)
        finder = GoalFinder(self.solver, inside, rng, begun, deadline)
        goals, missed = finder.find_all(aims)
        if not goals:
            status = MotionStatus.NO_WAY if missed else MotionStatus.UNREACHABLE
            return self._stay(status, missed or finder.why_none(aims))
        rows = np.array([each.q for each in goals])
        order = self._order(rows, self.start)
        if np.abs(rows[order[0]] - self.start).max() <= SAME and not search.contact.touches(self.start):
            return self._go(CutWay(self.start[None], np.zeros(1)), 0.0, goals[order[0]], search, "")
        beginning = self._begin(search, inside, rows[order[:8]], deadline)
        if isinstance(beginning, Trajectory):
            return beginning
        before, note = beginning
        if len(before) > 1:
            order = self._order(rows, before[-1])
        rows = rows[order]
        search.begin(before[-1], rows, self.speed, self.limits, rng)
        near = search.go_straight()
        after, nearness = self._land(search, near, rows, before[-1], deadline)
        if after:
            for k, tail in after.items():
                rows[k] = tail[0]
            search.begin(before[-1], rows, self.speed, self.limits, rng)
            search.go_straight()
        for k in nearness:
            search.leave_out(k)
        found = search.find_ways(self.ways, deadline)
        if not len(found.way.q):
            if not search.has_goals:
                return self._stay(MotionStatus.GOAL_IN_CONTACT, self._why_no_goal(len(rows), search.touching, nearness))
            return self._stay(MotionStatus.NO_WAY, self._why_no_way(search, deadline))
        way = _Ends(before, after, self.solver.robot.unlimited).around(found.way, found.goal, search)
        return self._go(way, found.duration, goals[order[found.goal]], search, note)

    def _why_no_way(self, search: WaySearch, deadline: float) -> str:
        """What a search that ended without a way has seen."""
        cut = "within the time" if time.monotonic() >= deadline else "in all samples"
        return (
            f"no way was found {cut} ({search.samples} samples); two parts of one came within "
            f"{search.nearest * self.unit:.3g} s of motion of each other; most often in the way: "
            f"{_named(search.hindrances, self.solver.robot)}"
        )

    def _why_no_goal(self, count: int, touching: Counter[Pair], nearness: Mapping[int, str]) -> str:
        """Why none of so many configurations that reach the goal can be one."""
        reasons = [f"touch something: {_named(touching, self.solver.robot)}"] if touching else []
        if nearness:
            reasons.append(f"are nearer to something than motions are kept: {next(iter(nearness.values()))}")
        return f"all {count} configurations that reach the goal {', or '.join(reasons)}"

    def _order(self, rows: Array, start: Array) -> list[int]:
        """Of goals (n, dof), by the times of straight motions from a configuration (dof,) at full speed."""
        times = (np.abs(rows - start) / self.speed).max(axis=1).tolist()
        return sorted(range(len(rows)), key=times.__getitem__)

    def _begin(self, search: WaySearch, inside: Array, goals: Array, deadline: float) -> _Beginning | Trajectory:
        """Bring joints onto their limits, then apart what is near; or the motion that stays, with the reason.

        Args:
            search: knows what is near.
            inside: (dof,) the start, each joint within its limits [rad].
            goals: (n, dof), those to which a straight motion out of contact is tried [rad].
            deadline: on the clock of `time.monotonic` [s].
        """
        rows, notes = [self.start], list[str]()
        near = search.near(self.start)
        outside = np.flatnonzero(inside != self.start).tolist()
        if outside:
            names = ", ".join(self.solver.robot.joint_names[joint] for joint in outside)
            if near:
                near, pair = search.leaving.follow(self.start, inside, near)
            else:
                pair = search.contact.in_the_way(self.start, inside)
            if pair is not None:
                sentence = f"{names} starts outside its limits, and {pair[0]} and {pair[1]} touch on the way back"
                return self._stay(MotionStatus.START_IN_CONTACT, sentence)
            rows.append(inside)
            notes.append(f"{names} starts outside its limits and comes back first")
        if not near:
            return _Beginning(np.array(rows), "; ".join(notes))
        leaving = search.leaving
        distance, pair, kept = leaving.nearest(near)
        how = f"are {distance:.3g} m apart" if distance > SAME_DISTANCE else "touch"
        where = f"{pair[0]} and {pair[1]} {how} at the start"
        if distance < -DEEPEST:
            sentence = (
                f"{pair[0]} touches {pair[1]} at the start, {-distance:.3g} m deep: more than {DEEPEST} m, up to which "
                "what touches is pulled apart"
            )
            return self._stay(MotionStatus.START_IN_CONTACT, sentence)
        out = leaving.way_out(inside, near, goals, deadline)
        if out is None:
            sentence = (
                f"{where}, nearer than {kept:.3g} m (the clearance and a reserve), and no straight motion was "
                "found that parts them without bringing anything nearer"
            )
            return self._stay(MotionStatus.START_IN_CONTACT, sentence)
        notes.append(f"{where} and come apart first")
        return _Beginning(np.array([*rows[:-1], *out]), "; ".join(notes))

    def _land(
        self, search: WaySearch, goals: Sequence[int], rows: Array, start: Array, deadline: float
    ) -> tuple[dict[int, Array], dict[int, str]]:
        """Motions (n, dof) that end at goals nearer to something than a certified motion may be, by number of the goal.

        They begin where it may be. With them, why there is none to some others.
        """
        found, none = dict[int, Array](), dict[int, str]()
        for k in goals:
            leaving = search.leaving
            near = leaving.near(rows[k])
            enough = len(found) >= 16  # to choose from
            out = None if enough else leaving.way_out(rows[k], near, start[None], deadline)
            if out is not None:
                found[k] = out[::-1]
            else:
                distance, pair, kept = leaving.nearest(near)
                none[k] = f"{pair[0]} and {pair[1]} are {distance:.3g} m apart there, kept {kept:.3g} m apart"
        return found, none

    def _go(self, way: CutWay, duration: float, goal: Goal, search: WaySearch, note: str) -> Trajectory:
        """The motion along a way to a goal that takes about so long [s], measured."""
        robot, contact = self.solver.robot, search.contact
        goal = Goal(checks.read_only(way.q[-1]), goal.number, goal.target, goal.parameter)
        if len(way.q) == 1:
            if self.stop is not None:
                return self._write(self.stop.rows, goal, contact, "comes to rest there")
            return self._write(resting(way.q[0]), goal, contact, "already there")
        slower = 1.0
        if self.torque is not None:
            states = search.write(way, max(BETWEEN, duration / MOST_PLACES))
            found = slowness(robot, states[1:], self.torque)
            if isinstance(found, TooHeavy):
                return self._stay(MotionStatus.TOO_HEAVY, found.explain(robot))
            slower = found
        between, fault = OnTheWay(robot, contact), ""
        rows = self._going_on(way.q, duration, search, between)
        goes_on = rows is not None
        for step in () if goes_on else halved(self.dt):
            rows = hold_torques(robot, partial(search.write, way, step), self.torque, slower)
            if self.stop is not None:
                rows = self.stop.then(rows)
            touching = between.fault(rows)
            if not touching:
                break
            fault = touching
        assert rows is not None
        sentence = f"reached in {rows.t[-1]:.4g} s{coarse(self.dt, float(rows.t[-1] - rows.t[-2]), fault)}"
        if goes_on:
            sentence += ", going on from the motion under way"
        else:
            if self.stop is not None:
                sentence += f", coming to rest first, in {self.stop.rows.t[-1]:.4g} s"
            lines = len(way.q) - 1
            sentence += "" if slower == 1.0 else ", slower for the torques"
            sentence += ", straight" if lines == 1 else f", around what is in the way by {lines} lines"
        sentence += f"; {note}" if note else ""
        if not contact.has_shapes:
            sentence += "; the description has no collision shapes that can be loaded, so contact was not checked"
        return self._write(rows, goal, contact, sentence)

    def _going_on(self, way: Array, duration: float, search: WaySearch, between: OnTheWay) -> Rows | None:
        """The motion from the one under way to where a way (n, dof) from its stop leads, without stopping, or None.

        Along the way, which takes about so long [s], or directly to its end.
        """
        if self.stop is None or self.jerk is not None:
            return None
        longest = float(self.stop.rows.t[-1]) + duration
        steps_of(longest, self.dt)  # not too many
        rows = go_on(self.solver.robot, self.stop, way, search, self.limits, self.speed, self.dt)
        if rows is None or rows.t[-1] > longest:
            rows = go_directly(self.stop, way[-1], self.limits, longest, search)
        if rows is None or self._strain(rows) > HELD or between.fault(rows):
            return None
        return rows

    def _strain(self, rows: Rows) -> float:
        """How many times as long rows must take for the limits to hold."""
        worst = float(self.limits.strain(rows).max())
        return worst if self.torque is None else max(worst, torque_strain(self.solver.robot, rows, self.torque))

    def _write(self, rows: Rows, goal: Goal, contact: Contact, message: str) -> Trajectory:
        wrong = self._misses(goal)
        return Trajectory.of(
            self.solver.robot,
            self.velocity,
            rows,
            look=partial(contact.distances, self_collision=True) if contact.has_shapes else None,
            status=MotionStatus.MISSED if wrong else MotionStatus.OK,
            message="; ".join(word for word in (wrong or message, contact.keeping_less) if word),
            goal=goal,
        )

    def _misses(self, goal: Goal) -> str:
        """What is wrong with the end of a motion, measured by Pinocchio; "" if nothing is."""
        solver, verifier = self.solver, self.solver.verifier
        robot = solver.robot
        lower, upper = robot.limit_values
        if not inside_exactly(lower, goal.q.tolist(), upper):
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

    def _stay(self, status: MotionStatus, message: str) -> Trajectory:
        """A motion that does not begin, or ends where the arm comes to rest."""
        rows = resting(self.start) if self.stop is None else self.stop.rows
        return Trajectory.of(self.solver.robot, self.velocity, rows, status=status, message=message)


_searches: weakref.WeakKeyDictionary[IKSolver, WaySearch] = weakref.WeakKeyDictionary()


def search_of(solver: IKSolver) -> WaySearch:
    """What looks for ways in a solver's scene, built once; of a robot without shapes, nothing touches.

    Raises:
        InvalidInputError: the scene does not fit the robot.
        ModelError: the description's shapes cannot be loaded, unless the solver ignores contact.
        UnknownNameError: the scene speaks of a link that is not there.
    """
    found = _searches.get(solver)
    if found is None:
        contact = solver.verifier.contact or _unlooked_contact(solver)
        found = _searches[solver] = WaySearch(solver.robot, contact, solver.verifier.options.clearance)
    return found


def _unlooked_contact(solver: IKSolver) -> Contact:
    """Contact where the solver does not look for it; of no shapes where they need not be loaded and cannot."""
    try:
        return self_contact(solver.robot)
    except ModelError:
        if solver.verifier.options.collision == "ignore" or solver.robot.source.content is None:
            return solver.robot.once(contact_of_nothing)
        raise


def _named(pairs: Counter[Pair], robot: Robot) -> str:
    """The pairs of shapes that are met most often, for a sentence."""
    often = [pair for pair, _ in pairs.most_common(2)]
    words, hulls = ", ".join(f"{a} and {b}" for a, b in often), own_hulls(robot)
    if any(hulls.issuperset(pair) for pair in often):
        words += ", which are hulls of meshes and may touch where these do not: load_robot(..., decompose=True)"
    return words


SPREAD = 0.7  # [rad] along a curve, between members that are tried
TURNED = float(np.radians(30.0))  # between angles about a free axis that are tried on seven joints
GOALS = "a configuration, a pose, a FreeAxis"


def list_aims(goal: Any, name: str = "goal", kinds: str = GOALS) -> tuple[Any, ...]:
    """The goals of a list, or the only one; with the name of the argument, and what it may be, for an error.

    Raises:
        InvalidInputError: an empty list.
    """
    is_list = isinstance(goal, list | tuple) and not all(isinstance(each, PartialTarget) for each in goal)
    if (isinstance(goal, list | tuple) and not goal) or (isinstance(goal, np.ndarray) and not goal.size):
        raise InvalidInputError(f"{name} is empty; give {kinds}, or a list of them")
    if is_list and not isinstance(goal[0], int | float | np.number) and not _is_matrix(goal):
        return tuple(goal)
    if isinstance(goal, np.ndarray) and goal.ndim == 3:
        return tuple(goal)
    if isinstance(goal, np.ndarray) and goal.ndim == 2 and goal.shape != (4, 4):
        return tuple(goal)
    return (goal,)


def _is_matrix(goal: Sequence[Any]) -> bool:
    """Whether a list is the rows of one homogeneous matrix."""
    return len(goal) == 4 and all(isinstance(row, list | tuple) and len(row) == 4 for row in goal)


class GoalFinder:
    """Finds the configurations that reach goals; those that are nearer to the start of the motion come first.

    It stops in the middle of the time once there is any, at the end of it otherwise.
    """

    def __init__(
        self, solver: IKSolver, start: Array, rng: Randomness, begun: float = 0.0, deadline: float = np.inf
    ) -> None:
        """Take a checked start (dof,) [rad], and when the time begins and ends on the clock of `time.monotonic` [s]."""
        self._solver, self._start, self._rng = solver, start, rng
        self._robot = solver.robot
        self._deadline, self._middle = deadline, 0.5 * (begun + deadline)
        self._any = False

    @property
    def is_late(self) -> bool:
        """Whether there is no more time."""
        return time.monotonic() >= (self._middle if self._any else self._deadline)

    def find_all(self, aims: Sequence[Any]) -> tuple[list[Goal], str]:
        """Configurations that reach any of some goals; and a sentence where time ran out before there was one.

        Raises:
            InvalidInputError: not a goal, or malformed; a configuration outside the limits.
        """
        checked, goals = [self.check(number, aim) for number, aim in enumerate(aims)], list[Goal]()
        for number, (aim, wanted) in enumerate(zip(aims, checked, strict=True)):
            if number and self.is_late:
                if goals:
                    break
                return [], f"the time was over after {number} of {len(aims)} goals, none of which is reached"
            goals += self.find(number, aim, wanted)
        return goals, ""

    def check(self, number: int, aim: Any) -> Array | TargetPose:
        """A goal, checked: a configuration (dof,) [rad], or what the tool is to reach.

        Raises:
            InvalidInputError: not a goal, or malformed; a configuration outside the limits.
        """
        robot = self._robot
        name = "goal" if number == 0 else f"goal {number}"
        if not isinstance(aim, (pin.SE3, FreeAxis, PartialTarget, Grasp, list, tuple)) or (
            isinstance(aim, list | tuple) and not (aim and isinstance(aim[0], PartialTarget))
        ):
            aim = checks.array(f"goal {number}", aim, "a configuration, a pose, a FreeAxis or a grasp")
        if isinstance(aim, np.ndarray) and aim.ndim == 1 and (aim.shape == (robot.dof,) or aim.shape != (3,)):
            return checked_start(robot, aim, name)
        return interpret(aim.target if isinstance(aim, Grasp) else aim, self._solver.frame)

    def find(self, number: int, aim: Any, wanted: Array | TargetPose) -> list[Goal]:
        """Configurations that reach one checked goal within the limits, in contact or not."""
        if isinstance(wanted, np.ndarray):
            near = angles.nearest_copy(wanted, self._start, self._robot.unlimited)
            found = [Goal(checks.sealed(near), number)]
        else:
            found = self._goals(list(self._configurations(wanted)), number, aim)
        self._any = self._any or bool(found)
        return found

    def why_none(self, aims: Sequence[Any]) -> str:
        """Why no configuration reaches any of some goals, each reason once; of as many as there is time for."""
        reasons = list[str]()
        for number, aim in enumerate(aims):
            wanted = self.check(number, aim)
            if isinstance(wanted, np.ndarray):
                continue
            if wanted.free_axis is not None and self._solver.dimension() == 1:
                reasons.append("no configuration within the limits was found at any of the angles that were tried")
            else:
                reasons.append(self._solver.solve(self._pose_of(wanted), seed=self._start, closest=False).message)
            if self.is_late:
                break
        return "; ".join(dict.fromkeys(reasons))

    def _pose_of(self, wanted: TargetPose) -> Target:
        if wanted.free_axis is not None:
            return wanted.free_axis
        return wanted.position if wanted.position_only else wanted.matrix

    def _configurations(self, wanted: TargetPose) -> Iterator[tuple[Array, float | None]]:
        """Configurations that reach a target, each with its parameter."""
        solver, verifier = self._solver, self._solver.verifier
        if wanted.free_axis is not None and solver.dimension() == 1:  # two free parameters
            yield from self._turned(wanted)
            return
        dimension = solver.dimension_of(wanted)
        if dimension == 1:
            yield from self._members(wanted)
        elif dimension == 0:
            rows = solver.solve_all(self._pose_of(wanted), self._start)
            angle = [None] * len(rows) if rows.angle is None else rows.angle.tolist()
            for index in np.flatnonzero(verifier.reached_rows(rows)).tolist():
                yield rows.q[index], angle[index]
        else:
            seeds = [self._start, self._robot.home, *random_configurations(self._robot, 6, self._rng.generator)]
            for seed in seeds:
                if self.is_late:
                    return
                result = solver.solve(self._pose_of(wanted), seed=seed, rng=self._rng.generator, closest=False)
                if verifier.reached(result.q, (result.position_error, result.orientation_error)):
                    yield result.q, result.parameter

    def _members(self, wanted: TargetPose) -> Iterator[tuple[Array, float | None]]:
        """Of each interval of curves the member nearest to the start, and some all along it."""
        found = self._solver.solve_all(self._pose_of(wanted), seed=self._start)
        assert isinstance(found, CurveSet)
        parameters, rows = found.least_and_others(self._times, SPREAD)
        yield from zip(rows, parameters.tolist(), strict=True)

    def _times(self, rows: Array) -> Array:
        """Of straight motions (n,) to some configurations (n, dof), at the robot's full speed [s]."""
        fastest = self._robot.velocity_limit
        return np.asarray((np.abs(rows - self._start) / np.where(np.isfinite(fastest), fastest, 1.0)).max(axis=1))

    def _turned(self, wanted: TargetPose) -> Iterator[tuple[Array, float | None]]:
        """On seven joints, the members nearest to the start at some angles about a free axis."""
        assert wanted.free_axis is not None
        low, high = wanted.free_axis.range
        for angle in np.linspace(low, high, max(2, int(np.ceil((high - low) / TURNED)) + 1)).tolist():
            if self.is_late:
                return
            for interval in self._solver.solve_all(wanted.at(angle).matrix, seed=self._start).intervals:
                yield interval.nearest(self._start), angle
                self._any = True

    def _goals(self, found: Sequence[tuple[Array, float | None]], number: int, aim: Aim | None) -> list[Goal]:
        """What was found, for poses, and its 2-pi equivalents within the limits."""
        robot = self._robot
        if not found:
            return []
        near = angles.nearest_copy(np.array([q for q, _ in found]), self._start, robot.unlimited)
        counted = np.concatenate([near, np.arange(len(near))[:, None]], axis=1)
        counted = angles.copies_within(counted, self._start, robot.lower, robot.upper, copies_counted(robot))
        return [Goal(row[:-1], number, aim, found[int(row[-1])][1]) for row in checks.sealed(counted)]
