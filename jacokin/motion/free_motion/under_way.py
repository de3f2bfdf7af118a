"""Plans for an arm that moves: how it comes to rest, and how it goes on without stopping.

An arm that moves can always be planned for from where it stops. Of the ways to stop, the straight one is tried first,
all joints coming to rest together, then the one on which each joint brakes as hard as it may. Where the rest of the
plan leaves the straight stop in a direction that differs little, the arm need not stop: the corner between the two is
cut like any other (`timed_course`), and the course is timed from its end at rest backwards to the speed of now.

Rows begin with exactly the positions and velocities of now; accelerations may jump there, within their limits.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from jacokin.arrays import Array
from jacokin.ik.seeds import ON_LIMIT, checked_start
from jacokin.model.contact import Pair
from jacokin.model.robot import Robot, unit_of
from jacokin.motion.free_motion.search import WaySearch
from jacokin.motion.free_motion.timed_course import TimedCourse, fit_time
from jacokin.motion.rows import (
    HELD,
    WHOLE_TICK,
    Limits,
    MotionState,
    Rows,
    checked_velocity,
    controlled_rows,
    joined,
    past_limits,
)
from jacokin.motion.timing import check_ticks

AT_REST = 1e-9  # [rad/s] a slower arm stands
LONGER = (1.0, 1.5, 2.0, 3.0)  # times as long as the quickest straight stop, where torques are limited


class Stop(NamedTuple):
    """A motion to rest."""

    rows: Rows
    """In which it was found."""
    is_straight: bool
    """Whether it goes along the velocity of its start."""

    @property
    def end(self) -> Array:
        """(dof,) where the arm rests [rad]."""
        return np.asarray(self.rows.q[-1])

    def in_steps(self, dt: float) -> Rows:
        """The motion of the stop in rows `dt` [s] apart; `dt` divides the step that it was found in."""
        t = self.rows.t
        count = round(float(t[-1]) / dt)
        if count == len(t) - 1:
            return self.rows
        fine = np.array([np.interp(np.arange(count + 1) * dt, t, column) for column in self.rows.a.T]).T
        return _integrated(self.rows.q[0], self.rows.v[0], fine, dt)

    def then(self, rows: Rows) -> Rows:
        """The stop, and a motion from rest in rows of any step after it."""
        if len(rows.t) == 1:
            return self.rows
        return joined(self.in_steps(float(rows.t[1])), rows)


class NoStop(NamedTuple):
    """Why a moving arm cannot come to rest."""

    reason: str


def velocity_now(robot: Robot, state: MotionState, limit: Array) -> tuple[Array, Array]:
    """Checked positions (dof,) [rad] and velocities (dof,) [rad/s] of a motion, these within their limits (dof,).

    Raises:
        InvalidInputError: malformed, or faster than the limits.
    """
    q = checked_start(robot, state.q, "start.q", outside=True)
    return q, np.clip(checked_velocity(robot, state.v, limit), -limit, limit)


def find_stop(
    robot: Robot,
    now: tuple[Array, Array],
    limits: Limits,
    dt: float,
    search: WaySearch,
    torque_strain: Callable[[Rows], float] | None = None,
) -> Stop | NoStop:
    """The quickest of some motions to rest that stays within the limits and clear.

    Args:
        robot: the arm.
        now: its positions (dof,) [rad] and velocities (dof,) [rad/s].
        limits: of velocity, acceleration and jerk.
        dt: step from row to row [s].
        search: knows what may touch.
        torque_strain: how many times as long rows must take for torques to be held; None for no limits of torque.

    Raises:
        InvalidInputError: the stop takes more than `MAX_TICKS` rows.
    """
    reasons = list[str]()
    for rows, is_straight in _stops(*now, limits, dt, LONGER if torque_strain else LONGER[:1]):
        reason = _hindrance(robot, rows, search, is_straight=is_straight)
        if not reason and torque_strain is not None and torque_strain(rows) > HELD:
            reason = "it needs more torque than `torque_limit`"
        if not reason:
            return Stop(rows, is_straight)
        reasons.append(reason)
    return NoStop("; ".join(dict.fromkeys(reasons)))


def _stops(q: Array, v: Array, limits: Limits, dt: float, longer: tuple[float, ...]) -> Iterator[tuple[Rows, bool]]:
    """Rows of motions to rest, and whether each is straight."""
    jerk = np.full_like(v, np.inf) if limits.jerk is None else limits.jerk
    size = np.maximum(np.abs(v), AT_REST)
    together = float((limits.acceleration / size).min()), float((jerk / size).min())
    for factor in longer:
        braking = brake(together[0] / factor, together[1] / factor, dt)
        yield _integrated(q, v, braking[:, None] * v, dt), True
    each = [brake(a, j, dt) for a, j in zip((limits.acceleration / size).tolist(), (jerk / size).tolist(), strict=True)]
    count = max(map(len, each))
    own = np.array([np.append(braking, np.zeros(count - len(braking))) for braking in each]).T
    yield _integrated(q, v, own * v, dt), False


def brake(acceleration: float, jerk: float, dt: float) -> Array:
    """Accelerations (n,) at ticks of `dt` [s], changing steadily in between, that take a velocity from 1 to 0.

    Without a limit of jerk it begins with the largest at once, and ends with what is left to one or two ticks.

    Args:
        acceleration: the largest, for a velocity of 1 [1/s].
        jerk: the largest [1/s^2]; inf for none.
        dt: [s].
    """
    least = 1.0 / (acceleration * dt)
    check_ticks(np.array([least * dt + dt]), dt)
    if jerk == math.inf:
        full = math.floor(least + 0.5)  # ticks of full braking
        if not full:
            return np.array([-2.0 / dt, 0.0])
        rest = min(max(1.0 / dt - (full - 0.5) * acceleration, 0.0), acceleration)
        return -np.array([*[acceleration] * full, rest, 0.0])
    # Ramps of so many ticks at both ends, and in the middle the full pull: one ramp and the middle take the velocity.
    count = max(math.ceil(least - WHOLE_TICK), 1)
    ramp = max(math.ceil(1.0 / (jerk * dt * dt * count) - WHOLE_TICK), 1)
    if ramp > count:
        ramp = count = math.ceil(1.0 / (math.sqrt(jerk) * dt) - WHOLE_TICK)
    check_ticks(np.array([(ramp + count) * dt]), dt)
    tick = np.arange(ramp + count + 1)
    return np.asarray(-np.minimum(np.minimum(tick, tick[::-1]) / ramp, 1.0) / (count * dt))


def _integrated(q: Array, v: Array, a: Array, dt: float) -> Rows:
    """The motion to rest from positions and velocities (dof,), with accelerations (n, dof) that change steadily."""
    speed = np.vstack([v, v + dt * np.cumsum(0.5 * (a[1:] + a[:-1]), axis=0)])
    speed[-1] = 0.0
    moved = np.cumsum(dt * speed[:-1] + dt * dt / 6.0 * (2.0 * a[:-1] + a[1:]), axis=0)
    return Rows(dt * np.arange(len(a), dtype=np.float64), np.vstack([q, q + moved]), speed, a)


def _hindrance(robot: Robot, rows: Rows, search: WaySearch, *, is_straight: bool) -> str:
    """What a motion to rest runs into; "" for nothing."""
    start, end = rows.q[0], rows.q[-1]
    past = np.maximum(end - np.maximum(robot.upper, start), np.minimum(robot.lower, start) - end)
    worst = int(np.argmax(past))
    if past[worst] > ON_LIMIT:
        return f"{robot.joint_names[worst]} would stop {past[worst]:.3g} {unit_of(robot, worst)} past its limit"
    pair = _touching(rows, search, is_straight=is_straight)
    return "" if pair is None else f"{pair[0]} and {pair[1]} touch on the way to rest"


def _touching(rows: Rows, search: WaySearch, *, is_straight: bool) -> Pair | None:
    """What touches, or gets nearer to what is near at the start; None for nothing."""
    leaving, contact = search.leaving, search.contact
    near = leaving.near(rows.q[0])
    if is_straight:
        return leaving.follow(rows.q[0], rows.q[-1], near)[1] if near else contact.in_the_way(rows.q[0], rows.q[-1])
    if near:
        return leaving.nearest(near)[1]
    bulges = 0.125 * float(rows.t[1]) ** 2 * np.maximum(np.abs(rows.a[:-1]), np.abs(rows.a[1:])) @ contact.levers
    for begin, end, bulge in zip(rows.q[:-1], rows.q[1:], bulges.tolist(), strict=True):
        pair = contact.in_the_way(begin, end, extra=bulge)
        if pair is not None:
            return pair
    return None


def go_directly(stop: Stop, end: Array, limits: Limits, longest: float, search: WaySearch) -> Rows | None:
    """The quickest motion to rest at a configuration with steadily changing accelerations; None where there is none.

    No joint turns back that could stop before its end.

    Args:
        stop: how the arm moves now, and its step from row to row.
        end: (dof,) [rad].
        limits: of velocity and acceleration.
        longest: that it may take [s].
        search: knows what may touch.
    """
    start, v, dt = stop.rows.q[0], stop.rows.v[0], float(stop.rows.t[1])
    moved = end - start
    T = dt * np.arange(2, max(math.floor(longest / dt), 1) + 1, dtype=np.float64)[:, None]
    first, last = 6.0 * moved / T**2 - 4.0 * v / T, 2.0 * v / T - 6.0 * moved / T**2
    fits = (np.maximum(np.abs(first), np.abs(last)) <= limits.acceleration).all(axis=1)
    turns = first * last < 0.0  # where the acceleration is zero in between, the velocity is largest
    peak = v - np.where(turns, 0.5 * first**2 / np.where(turns, last - first, 1.0), 0.0) * T
    fits &= (np.abs(peak) <= limits.velocity).all(axis=1)
    in_time = moved * np.sign(v) >= 0.5 * v**2 / limits.acceleration
    fits &= ((np.abs(v) * T <= 3.0 * np.abs(moved)) | ~in_time | (np.abs(v) <= AT_REST)).all(axis=1)
    if not fits.any():
        return None
    row = int(np.argmax(fits))
    shares = np.linspace(0.0, 1.0, row + 3)[:, None]
    rows = _integrated(start, v, first[row] + shares * (last[row] - first[row]), dt)
    rows.q[-1] = end  # but for rounding
    return rows if _touching(rows, search, is_straight=False) is None else None


class GoingOn(NamedTuple):
    """A course that the arm enters at the speed that it has, and leaves at rest; backwards, it is one from rest."""

    backwards: TimedCourse
    start: Array
    """(dof,) [rad]."""
    v: Array
    """(dof,) [rad/s]."""
    lead: float
    """For so long the velocity stays as it is first [s]."""

    @property
    def duration(self) -> float:
        """From start to end [s]."""
        return self.lead + self.backwards.duration

    def at(self, t: Array) -> Array:
        """Configurations (m, dof) at times (m,) [s], before the start, too, and after the end [rad]."""
        left = np.clip(self.duration - t, 0.0, self.backwards.duration)
        q = self.backwards.at(left)[0]
        return np.where((t < self.lead)[:, None], self.start + t[:, None] * self.v, q)

    def rows(self, dt: float) -> Rows:
        """Those of the spline with control points on the course, which begins as the arm moves now."""
        count = math.ceil(self.duration / dt - WHOLE_TICK) + 1
        values = self.at(dt * np.arange(-1, count + 2, dtype=np.float64))
        rows = controlled_rows(values[1:-1], np.diff(values, axis=0), dt)
        rows.q[0], rows.v[0], rows.q[-1] = self.start, self.v, values[-1]  # but for rounding
        return rows


def go_on(
    robot: Robot, stop: Stop, way: Array, search: WaySearch, limits: Limits, speed: Array, dt: float
) -> Rows | None:
    """The motion that bends from the straight stop onto the way after it, without stopping; None where there is none.

    Where the turn is too sharp for a corner at the stop, the corner may lie farther ahead.

    Args:
        robot: the arm.
        stop: where it would rest, and how it moves now.
        way: (n, dof) lines from there to the goal, clear [rad].
        search: finds how much of corners may be cut.
        limits: of velocity and acceleration.
        speed: (dof,) by which lines are measured.
        dt: step from row to row [s].
    """
    if not stop.is_straight:
        return None
    now, v = stop.rows.q[0], stop.rows.v[0]
    first = now + dt * v
    for reach in (1.0, 2.0, 4.0):  # times as far as the stop
        corner = now + reach * (stop.end - now)
        if float((corner - first) @ v) <= 0.0:
            continue
        if reach > 1.0 and not _is_clear(robot, search, (stop.end, corner, way[1])):
            return None
        rows = _bent(robot, (now, v), np.vstack([first, corner, way[1:]]), search, limits, speed, dt)
        if rows is not None:
            return rows
    return None


def _is_clear(robot: Robot, search: WaySearch, lines: tuple[Array, ...]) -> bool:
    """Whether straight motions between configurations (dof,), one after another, are within the limits and clear."""
    if any((q < robot.lower).any() or (q > robot.upper).any() for q in lines):
        return False
    return all(search.contact.in_the_way(start, end) is None for start, end in pairwise(lines))


def _bent(
    robot: Robot,
    now: tuple[Array, Array],
    lines: Array,
    search: WaySearch,
    limits: Limits,
    speed: Array,
    dt: float,
) -> Rows | None:
    """Rows along lines (n, dof) whose corners are cut, from positions and velocities now (dof,) a tick before them.

    None where the lines cannot be entered at that speed, or rows break a limit.
    """
    v = now[1]
    lines, cuts = search.cut_corners(lines)
    step = lines[1] - lines[0]
    begin = float(np.abs(v).max() / np.abs(step).max()) * float((np.abs(step) / speed).max())  # ds/dt
    hard = limits.acceleration / (1.0 + 1e-4)  # rounding of the speed takes some
    timed = fit_time(lines[::-1], cuts[::-1], speed, limits.velocity, hard, begin)
    if timed.speed[-1] < begin * (1.0 - 1e-8):  # rounding
        return None
    rows = GoingOn(timed, *now, dt).rows(dt)
    kept = float(limits.strain(rows).max()) <= HELD and past_limits(rows, robot.lower, robot.upper).max() <= ON_LIMIT
    return rows if kept else None
