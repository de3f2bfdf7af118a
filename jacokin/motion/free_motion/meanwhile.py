"""`Meanwhile`: plans in time, for an arm beside other robots that move. Read `plan` first.

Ways are planned among the other robots as they stand: where they stop, all along their motions, and where they begin.
Each way is then looked at in time (`find_touch`), and begun as late as it must be: the arm waits at its start. Where
the others stop a way leads past them whenever they have stopped, so that waiting helps in the end; all along their
motions it need not wait. Where the arm cannot stay at its start while they pass, it moves aside first.

Sources: Kant and Zucker, Toward efficient trajectory planning: the path-velocity decomposition, IJRR 1986, for planning
where first and when then; Erdmann and Lozano-Perez, On multiple moving objects, Algorithmica 1987, for planning one
after another.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.ik.seeds import DEFAULT_RANDOM_SEED, random_configurations
from jacokin.ik.solver import IKSolver
from jacokin.model import checks
from jacokin.model.contact import ContactBetween, Pair
from jacokin.model.obstacles import OtherRobot
from jacokin.model.robot import unit_of
from jacokin.model.scene import Scene
from jacokin.motion.rows import WHOLE_TICK, Rows, cubic, joined, resting, standing
from jacokin.motion.trajectory import MotionStatus, Trajectory

Motions: TypeAlias = Mapping[str, Trajectory | tuple[Trajectory, float]]
"""Motions of other robots by their names in the scene; with each when on it time 0 is [s]."""

SHORTEST = 1e-3  # [s] a while that is not halved: joints have moved by a milliradian
LATER = 0.05  # [s] between two times at which it is tried to begin
MOST_PLACES = 16  # of another robot along its motion, among which a way is planned
MOST_ASIDE = 200  # configurations near the start, and anywhere, that are tried to move aside to

FINAL = (MotionStatus.UNREACHABLE.name, MotionStatus.GOAL_IN_CONTACT.name, MotionStatus.TOO_HEAVY.name)  # at any time

Planning: TypeAlias = Callable[..., Trajectory]
"""Plans a motion among what stands still: `plan_motion` without the solver, start, goal, `dt` and `time_limit`."""


class TimedMotion:
    """A motion over time; before its first row, and after its last, the arm stands there.

    Attributes:
        duration: from its first row, at time 0, to its last [s].
    """

    def __init__(self, rows: Rows, begin: float = 0.0) -> None:
        """Take the rows (n,), which need not be equally far apart, and when on their clock time 0 is [s]."""
        self._t, self._q, self._v = rows.t - rows.t[0] - begin, rows.q, rows.v
        self.duration = max(float(self._t[-1]), 0.0)
        steps = np.diff(self._t)[:, None]
        pace = np.diff(self._q, axis=0) / steps if len(steps) else np.zeros((0, self._q.shape[1]))
        pulls = [(6.0 * pace - 4.0 * self._v[:-1] - 2.0 * self._v[1:]), (2.0 * self._v[:-1] + 4.0 * self._v[1:])]
        cubic = np.maximum(np.abs(pulls[0]), np.abs(pulls[1] - 6.0 * pace)) / steps
        pull, none = np.maximum(cubic, np.maximum(np.abs(rows.a[:-1]), np.abs(rows.a[1:]))), np.zeros_like(rows.q[:1])
        self._pull = np.vstack([none, pull, none])  # (n + 1, dof) largest accelerations up to each row, and after all

    def at(self, time: float) -> Array:
        """Where the joints are (dof,) at a time [s], between rows by the cubic that meets their velocities [rad]."""
        t = self._t
        if time <= t[0] or len(t) == 1:
            return np.asarray(self._q[0])
        if time >= t[-1]:
            return np.asarray(self._q[-1])
        _, x, (q, v, second, third) = cubic(t, self._q, self._v, time)
        return np.asarray(q + x * (v + x * (second + x * third)))

    def line(self, begin: float, end: float) -> tuple[tuple[Array, Array], Array]:
        """Where the joints are at two times [s], and how far (dof,) from the line between they are meanwhile [rad]."""
        t, first, last = self._t, self.at(begin), self.at(end)
        low, high = int(np.searchsorted(t, begin, side="right")), int(np.searchsorted(t, end, side="left"))
        high = max(low, high)
        there = first + (t[low:high, None] - begin) / (end - begin) * (last - first)
        away = np.abs(self._q[low:high] - there).max(axis=0, initial=0.0)
        parts = np.diff(t[low:high], prepend=begin, append=end)[:, None]
        return (first, last), away + 0.125 * (parts**2 * self._pull[low : high + 1]).max(axis=0)


class Touch(NamedTuple):
    """A contact of an arm with another robot that may happen."""

    pair: Pair
    """The shapes, that of the other robot first."""
    begin: float
    """[s]."""
    end: float
    """[s]."""


def find_touch(
    contact: ContactBetween, arm: TimedMotion, other: TimedMotion, begin: float, end: float, delay: float = 0.0
) -> Touch | None:
    """The first while in which an arm and another robot may touch; None for none: certified, not sampled.

    Of both motions a while is looked at together: each is near the straight line from where it is first to where it is
    last, and by how much it may be away from it is known from its rows and its accelerations. If the two lines keep
    farther apart than that, so do the arms, all the while; if not, the two halves of the while are looked at.

    Args:
        contact: of both.
        arm: the motion of the arm.
        other: that of the other robot.
        begin: when on the clock of the arm looking begins [s].
        end: when it ends [s].
        delay: so much later is it on the clock of the other robot [s].
    """
    count = max(int(np.ceil((end - begin) / 0.25)), 1)  # [s] a while that is looked at first
    edges = np.linspace(begin, end, count + 1)
    waiting = list(zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True))[::-1]
    while waiting:
        low, high = waiting.pop()
        own, away = arm.line(low, high)
        theirs, theirs_away = other.line(low + delay, high + delay)
        extra = float(away @ contact.levers + theirs_away @ contact.other_levers)
        pair = contact.in_the_way(own, theirs, extra)
        if pair is None:
            continue
        if high - low <= SHORTEST:
            return Touch(pair, low, high)
        middle = 0.5 * (low + high)
        waiting += [(middle, high), (low, middle)]
    return None


@dataclass(frozen=True, slots=True, eq=False)
class _Other:
    """Another robot that moves.

    Attributes:
        robot: where the scene has it.
        course: its motion, at time 0 now.
        contact: of the arm with it.
    """

    robot: OtherRobot
    course: TimedMotion
    contact: ContactBetween

    @property
    def places(self) -> list[Array]:
        """Where it is (dof,) from its first to its last place [rad]."""
        times = np.linspace(0.0, self.course.duration, 10 * MOST_PLACES)
        q = np.array([self.course.at(at) for at in times.tolist()])
        gone = np.append(0.0, np.cumsum(np.abs(np.diff(q, axis=0)).max(axis=1)))
        count = min(max(math.ceil(gone[-1] / 0.3) + 1, 2), MOST_PLACES)  # [rad] from place to place
        rows = np.unique(np.searchsorted(gone, np.linspace(0.0, gone[-1], count)))
        return [q[0], *q[rows[1:-1]], q[-1]]


class _Hindrance(NamedTuple):
    """What may touch, on the clock of the motion that it stops."""

    other: _Other
    touch: Touch

    def __str__(self) -> str:
        """For a sentence."""
        return f"{self.touch.pair[0]} and {self.touch.pair[1]}"


class _Begun(NamedTuple):
    """A motion and how long the arm waits before it."""

    motion: Trajectory
    wait: float
    """[s]."""
    hindrance: _Hindrance | None
    """Why it cannot begin sooner."""

    @property
    def duration(self) -> float:
        """Of both [s]."""
        return self.wait + self.motion.duration

    @property
    def rows(self) -> Rows:
        """The motion with what comes before it."""
        rows, rest = self.motion.rows, resting(self.motion.q[0])
        if len(rows.t) == 1 or not self.wait:
            return rows
        dt = float(rows.t[1])
        return joined(standing(rest, round(self.wait / dt), dt), rows)

    def __str__(self) -> str:
        """What happens, in a sentence."""
        if not self.wait or self.hindrance is None:
            return self.motion.message
        return f"waits {self.wait:.4g} s for {self.hindrance.other.robot.name}; then {self.motion.message}"


class Meanwhile:
    """Plans of an arm beside other robots that move."""

    def __init__(self, solver: IKSolver, motions: Motions, deadline: float) -> None:
        """Take the motions.

        Args:
            solver: knows the arm and its scene.
            motions: by the name of the robot in that scene.
            deadline: when to stop looking, on the clock of `time.monotonic` [s].

        Raises:
            InvalidInputError: malformed, or a motion of other joints than the robot has.
            UnknownNameError: the scene has no such robot.
        """
        options = solver.verifier.options
        scene = Scene() if options.scene is None else options.scene
        given = checks.mapping("meanwhile", motions, "a dict of names of robots in the scene and trajectories")
        known = {each.name: each for each in scene.robots}
        self._solver, self._deadline = solver, deadline
        self._others = list[_Other]()
        for name, motion in given.items():
            robot = known[checks.choice("robot in the scene", name, known)]
            between = ContactBetween(solver.robot, scene.surroundings, robot, clearance=options.clearance)
            self._others.append(_Other(robot, _course(robot, motion), between))
        self._standing = scene.removing(*given)
        self._first = scene.moving({each.robot.name: each.course.at(0.0) for each in self._others})
        self._last = scene.moving({each.robot.name: each.course.at(math.inf) for each in self._others})
        self._end = max((each.course.duration for each in self._others), default=0.0)

    def plan(self, plan: Planning, start: Array, goal: Any, dt: float) -> Trajectory:
        """The motion that reaches a goal soonest of those that are found; see `plan_motion`.

        Args:
            plan: plans among what stands still.
            start: (dof,) [rad].
            goal: as `plan_motion` takes it.
            dt: step from row to row [s].
        """
        found: _Begun | _Hindrance | Trajectory | None = self._find_touch(TimedMotion(resting(start)), end=0.0)
        if isinstance(found, _Hindrance):
            sentence = f"{found} touch at the start, or are nearer than the clearance"
            return self._stay(start, MotionStatus.START_IN_CONTACT, sentence)
        found = self._soonest(plan, start, goal, dt)
        if isinstance(found, _Begun):
            return self._write(found)
        if isinstance(found, Trajectory) and found.outcome in FINAL:
            return self._stay(start, MotionStatus[found.outcome], found.message)
        aside = self._aside(plan, start, goal, dt)
        if aside:
            return self._write(*aside)
        sentence = "no place to move aside to was found either"
        if isinstance(found, _Hindrance):
            sentence = f"{found} would touch, also if the arm waits at its start for longer; {sentence}"
        else:
            sentence = f"{found.message}; {sentence}"
        return self._stay(start, MotionStatus.NO_WAY, sentence)

    def _soonest(
        self, plan: Planning, start: Array, goal: Any, dt: float, now: float = 0.0
    ) -> _Begun | _Hindrance | Trajectory:
        """The motion that ends first of some from a time on [s]; or what stops the first of them, or why it fails."""
        best: _Begun | None = None
        failed: _Hindrance | Trajectory | None = None
        for scene in self._scenes():
            if failed is not None and self._is_late:
                break
            motion = self._plan(plan, scene, start, goal, dt)
            if not motion.success:
                failed = failed or motion
                if motion.outcome in FINAL:
                    break
                continue
            latest = math.inf if best is None else best.duration - motion.duration
            begun = self._begin(motion, now, latest, rests_clear=scene is not self._first)
            if isinstance(begun, _Begun):
                best = begun
            failed = failed or (begun.hindrance if isinstance(begun, _Begun) else begun)
            if failed is None:
                break
        found = best or failed
        assert found is not None
        return found

    def _plan(self, plan: Planning, scene: Scene, start: Array, goal: Any, dt: float) -> Trajectory:
        left = max(self._deadline - time.monotonic(), 1e-3)  # [s] at least
        return plan(self._solver.in_scene(scene), start, goal, dt=dt, time_limit=left)

    @property
    def _is_late(self) -> bool:
        return time.monotonic() >= self._deadline

    def _scenes(self) -> Iterator[Scene]:
        """With the others where they stop, at many of their places at once, and where they begin."""
        yield self._last
        scene = self._last
        for robot, places in ((each.robot, each.places[:-1]) for each in self._others):
            for number, q in enumerate(places):
                name = f"{robot.name}@{number}"
                scene = scene.adding_robot(robot.robot, q, name=name, base=robot.base, finger_angle=robot.finger_angle)
        yield scene
        yield self._first

    def _begin(
        self, motion: Trajectory, now: float, latest: float = math.inf, *, rests_clear: bool
    ) -> _Begun | _Hindrance | None:
        """A motion that is begun as soon as it can be; or what touches before that; or None if it can only be later.

        Args:
            motion: from rest to rest.
            now: since when the arm is at its start [s].
            latest: it may wait so long [s].
            rests_clear: whether it is known that it touches nothing of the others once they rest.
        """
        course, still, before = TimedMotion(motion.rows), TimedMotion(resting(motion.q[0])), None
        tick = float(motion.t[1]) if len(motion.t) > 1 else LATER
        step = math.ceil(LATER / tick - WHOLE_TICK) * tick
        for number in range(math.ceil(max(self._end - now, 0.0) / step) + 1):
            wait = number * step
            if wait > latest:
                return None
            if number:
                waiting = self._find_touch(still, end=step, delay=now + wait - step)
                if waiting is not None:
                    return waiting
            hindrance = self._find_touch(course, delay=now + wait, first=before, rests_clear=rests_clear)
            if hindrance is None:
                return _Begun(motion, wait, before)
            before = hindrance
        return before

    def _find_touch(
        self,
        course: TimedMotion,
        *,
        end: float = math.inf,
        delay: float = 0.0,
        first: _Hindrance | None = None,
        rests_clear: bool = True,
    ) -> _Hindrance | None:
        """What may touch first on a motion; None if nothing does.

        Args:
            course: of the arm.
            end: of looking, on its clock [s]; never later than when nothing moves any more.
            delay: so much later is it on the clock of the others [s].
            first: where to look first.
            rests_clear: whether others need not be looked at once they rest.
        """
        whiles = [(each, 0.0, self._until(each, course, end, delay, rests_clear)) for each in self._others]
        if first is not None:
            until = next(until for other, _, until in whiles if other is first.other)
            whiles.insert(0, (first.other, min(first.touch.begin, until), min(first.touch.end, until)))
        for other, begin, until in whiles:
            touch = find_touch(other.contact, course, other.course, begin, until, delay)
            if touch is not None:
                return _Hindrance(other, touch)
        return None

    @staticmethod
    def _until(other: _Other, course: TimedMotion, end: float, delay: float, rests_clear: bool) -> float:
        """When another robot need not be looked at any more, on the clock of a motion [s]."""
        rests = max(other.course.duration - delay, 0.0)
        return min(end, rests if rests_clear else max(rests, course.duration))

    def _aside(self, plan: Planning, start: Array, goal: Any, dt: float) -> tuple[_Begun, ...]:
        """The quickest of some motions to where the others never come, and to the goal from there; nothing for none."""
        contact = self._standing.contact(self._solver.robot).with_clearance(self._solver.verifier.options.clearance)
        found = list[tuple[_Begun, _Begun]]()
        for place in self._places_aside(start):
            if self._is_late or len(found) == 3:  # of which the quickest is taken
                break
            if contact.touches(place) or self._find_touch(TimedMotion(resting(place))) is not None:
                continue
            motion = self._plan(plan, self._first, start, place, dt)
            away = self._begin(motion, 0.0, rests_clear=False) if motion.success else None
            if not isinstance(away, _Begun) or len(motion.t) == 1:
                continue
            then = self._soonest(plan, motion.q[-1], goal, float(motion.t[1]), away.duration)
            if isinstance(then, _Begun):
                found.append((away, then))
        return min(found, key=lambda each: each[0].duration + each[1].duration, default=())

    def _places_aside(self, start: Array) -> list[Array]:
        """Configurations within the limits, those near the start first."""
        robot, rng = self._solver.robot, np.random.default_rng(DEFAULT_RANDOM_SEED)
        # The first are about half a radian from the start, twice as far after 20.
        near = [start + 0.5 * (1.0 + k / 20) * rng.normal(size=robot.dof) for k in range(MOST_ASIDE)]
        return [np.clip(q, robot.lower, robot.upper) for q in (*near, *random_configurations(robot, MOST_ASIDE, rng))]

    def _write(self, *parts: _Begun) -> Trajectory:
        """The motions one after another, and what happens in a sentence."""
        rows = parts[0].rows
        for part in parts[1:]:
            rows = joined(rows, part.rows)
        last = parts[-1].motion
        words = [f"moves aside first, in {part.duration:.4g} s" for part in parts[:-1]]
        return Trajectory.of(
            self._solver.robot,
            last.velocity_limit,
            rows,
            look=partial(self._distances, rows.t),
            message="; ".join([*words, str(parts[-1])]),
            goal=last.goal,
        )

    def _distances(self, t: Array, q: Array) -> Array:
        """Smallest distances (n,) [m] at times (n,) [s] and configurations (n, dof) [rad]."""
        found = self._standing.contact(self._solver.robot).distances(q, self_collision=True)
        for other in self._others:
            there = np.array([other.course.at(time) for time in t.tolist()])
            found = np.minimum(found, other.contact.distances(q, there))
        return found

    def _stay(self, start: Array, status: MotionStatus, message: str) -> Trajectory:
        robot = self._solver.robot
        return Trajectory.of(robot, robot.velocity_limit, resting(start), status=status, message=message)


def _course(robot: OtherRobot, motion: object) -> TimedMotion:
    """A checked motion of another robot.

    Raises:
        InvalidInputError: no trajectory, or of joints of other names or limits; or a time that is not a number.
    """
    name = f"meanwhile[{robot.name!r}]"
    trajectory, begin = motion if isinstance(motion, tuple) and len(motion) == 2 else (motion, 0.0)
    if not isinstance(trajectory, Trajectory):
        raise checks.refusal(name, "a Trajectory, or one and when on it the plan begins", trajectory)
    begin = checks.non_negative(f"the time in {name}", begin, "s")
    if trajectory.joint_names != robot.robot.joint_names:
        raise InvalidInputError(
            f"{name} moves {', '.join(trajectory.joint_names)}; the robot has {', '.join(robot.robot.joint_names)}"
        )
    there = np.column_stack([trajectory.lower, trajectory.upper])
    here = np.column_stack([robot.robot.lower, robot.robot.upper])
    # URDF and MJCF files of an arm round by some 1e-7 rad.
    other = np.flatnonzero(~np.isclose(there, here, rtol=0.0, atol=1e-6).all(axis=1))
    if len(other):
        joint = trajectory.joint_names[other[0]]
        unit = unit_of(robot.robot, int(other[0]))
        moved, known = (f"{low:.6g} to {high:.6g} {unit}" for low, high in (there[other[0]], here[other[0]]))
        raise InvalidInputError(
            f"{name} was made for an arm whose {joint} goes from {moved}, that of the robot in the scene goes from "
            f"{known}: add that arm to the scene"
        )
    return TimedMotion(trajectory.rows, begin)
