"""Rows of a motion as controllers take them: positions, velocities and accelerations that belong together; one state.

Controllers go from row to row by straight lines, by cubics that meet velocities, or by quintics that meet
accelerations, too. Rows whose accelerations change steadily in between are one and the same motion for the last two: a
cubic spline. A spline through given positions (`spline_rows`) swings over limits that these hold; a spline of which
they are the control points (`averaged_rows`) holds them, and takes two ticks longer.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_banded

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.ik.results import Frozen
from jacokin.ik.seeds import ON_LIMIT
from jacokin.kernels.library import Calls
from jacokin.kernels.motion_rows import BetweenWork, average_rows, look_between, make_average_work, make_between_work
from jacokin.model.contact import Contact
from jacokin.model.robot import Robot, unit_of

WHOLE_TICK = 1e-9  # a duration this near to whole ticks is whole; division rounds
MEAN = 0.25, 0.5, 0.25  # weights of three ticks
HELD = 1.0 + 1e-9  # times a limit; what is beyond is no rounding
ATTEMPTS = 30  # to find how slow a motion must be
LEAST_SLOWER = 1.001  # from attempt to attempt
ROWS_AT_ONCE = 1000  # that are looked at between each other
FINEST = 5e-4  # [s] a step from row to row that needs no halving: in it no arm leaves the line by more than 0.1 um

_average = Calls(average_rows, make_average_work, kept=20_000)  # rows
_look = Calls(look_between, make_between_work, kept=20_000)


class Rows(NamedTuple):
    """A motion in steps of equal length, to rest, and from rest unless the arm moves already."""

    t: Array
    """(n,) [s]."""
    q: Array
    """(n, dof) [rad]."""
    v: Array
    """(n, dof) [rad/s]."""
    a: Array
    """(n, dof) [rad/s^2]."""


def resting(q: Array) -> Rows:
    """The motion of an arm that stays at a configuration (dof,) [rad]."""
    still = np.zeros((1, len(q)))
    return Rows(np.zeros(1), q[None], still, still)


def cubic(t: Array, q: Array, v: Array, time: float) -> tuple[float, float, tuple[Array, Array, Array, Array]]:
    """The cubic between rows that meets their velocities, at a time within them [s].

    Returns:
        The length of its step [s], which part x of it is behind, and its factors: of 1, x, x^2 and x^3.
    """
    row = min(max(int(np.searchsorted(t, time, side="right")) - 1, 0), len(t) - 2)
    step = float(t[row + 1] - t[row])
    begin, last, moved = step * v[row], step * v[row + 1], q[row + 1] - q[row]
    factors = q[row], begin, 3.0 * moved - 2.0 * begin - last, begin + last - 2.0 * moved
    return step, (time - float(t[row])) / step, factors


def spline_rows(q: Array, dt: float) -> Rows:
    """The motion from rest to rest through configurations (n, dof) [rad] that are `dt` [s] apart.

    Its accelerations change steadily between rows and
    without jumps, so that cubics that meet its velocities, and quintics that meet its accelerations, too, are the same
    motion. One row stands still.
    """
    count = len(q)
    t, v, a = dt * np.arange(count, dtype=np.float64), np.zeros_like(q), np.zeros_like(q)
    if count == 1:
        return Rows(t, q, v, a)
    if count > 2:
        bands = np.tile([[1.0], [4.0], [1.0]], (1, count - 2))
        gained = 3.0 / dt * (q[2:] - q[:-2])
        v[1:-1] = solve_banded((1, 1), bands, gained, overwrite_ab=True, check_finite=False)
    step = np.diff(q, axis=0) / dt
    a[:-1] = (6.0 * step - 4.0 * v[:-1] - 2.0 * v[1:]) / dt
    a[-1] = (2.0 * v[-2] + 4.0 * v[-1] - 6.0 * step[-1]) / dt
    return Rows(t, q, v, a)


def most_between(rows: Rows) -> tuple[Array, Array]:
    """The largest velocities [rad/s] and accelerations [rad/s^2] (n - 1, dof) from each row to the next."""
    start, end = rows.a[:-1], rows.a[1:]
    fastest = np.maximum(np.abs(rows.v[:-1]), np.abs(rows.v[1:]))
    turns = start * end < 0.0  # where the acceleration is zero in between, the velocity is largest
    change = np.where(turns, end - start, 1.0)
    peak = rows.v[:-1] - np.where(turns, 0.5 * start**2 / change, 0.0) * np.diff(rows.t)[:, None]
    return np.maximum(fastest, np.where(turns, np.abs(peak), 0.0)), np.maximum(np.abs(start), np.abs(end))


class Limits(NamedTuple):
    """What is held from row to row."""

    velocity: Array
    """(dof,) [rad/s]; infinite for none."""
    acceleration: Array
    """(dof,) [rad/s^2]; infinite for none."""
    jerk: Array | None = None
    """(dof,) [rad/s^3]; None for none."""

    def slowed(self, factor: float) -> Limits:
        """Those of the motion that takes so many times as long, where these are to hold for this one."""
        jerk = None if self.jerk is None else self.jerk / factor**3
        return Limits(self.velocity / factor, self.acceleration / factor**2, jerk)

    def strain(self, rows: Rows) -> Array:
        """How many times as long each step (n - 1,) must take for the limits to hold in it."""
        fast, hard = most_between(rows)
        found = np.maximum((fast / self.velocity).max(axis=1), np.sqrt((hard / self.acceleration).max(axis=1)))
        if self.jerk is not None:
            sudden = np.abs(np.diff(rows.a, axis=0)) / np.diff(rows.t)[:, None]
            found = np.maximum(found, np.cbrt((sudden / self.jerk).max(axis=1)))
        return np.asarray(found)


def between(rows: Rows, steps: slice | NDArray[np.intp] = slice(None), *, quintic: bool = False) -> tuple[Array, Array]:
    """Angles and velocities (m, 9, dof) along some steps, by cubics that meet velocities, or by quintics."""
    x, x0 = np.linspace(0.0, 1.0, 9)[:, None], rows.q[:-1][steps]
    dt, moved = (rows.t[1:][steps] - rows.t[:-1][steps])[:, None], rows.q[1:][steps] - x0
    v0, v1 = dt * rows.v[:-1][steps], dt * rows.v[1:][steps]
    if quintic:
        a0, a1 = 0.5 * dt**2 * rows.a[:-1][steps], 0.5 * dt**2 * rows.a[1:][steps]
        d0, d1, d2 = moved - v0 - a0, v1 - v0 - 2.0 * a0, a1 - a0
        factors = [x0, v0, a0, 10.0 * d0 - 4.0 * d1 + d2, -15.0 * d0 + 7.0 * d1 - 2.0 * d2, 6.0 * d0 - 3.0 * d1 + d2]
    else:
        factors = [x0, v0, 3.0 * moved - 2.0 * v0 - v1, v0 + v1 - 2.0 * moved]
    at = sum(factor[:, None] * x**k for k, factor in enumerate(factors))
    speed = sum(k * factor[:, None] * x ** (k - 1) for k, factor in enumerate(factors) if k)
    return np.asarray(at), np.asarray(speed) / dt[:, None]


def sample(at: Callable[[Array], Array], duration: float, dt: float, slower: float = 1.0) -> Array:
    """Values at ticks of `dt` [s], each the mean of three ticks; the motion stands still before and after.

    Args:
        at: values (m, ...) at times (m,) [s].
        duration: of the motion [s]; it is slowed down to whole ticks.
        dt: control step [s].
        slower: how many times as long it is to take.
    """
    count = max(1, math.ceil(slower * duration / dt - WHOLE_TICK))
    times = np.linspace(0.0, duration, count + 1)
    values = at(times)
    padded = np.concatenate([np.repeat(values[:1], 2, axis=0), values, np.repeat(values[-1:], 2, axis=0)])
    found = MEAN[0] * padded[:-2] + MEAN[1] * padded[1:-1] + MEAN[2] * padded[2:]
    low, high = np.minimum(padded[:-2], padded[2:]), np.maximum(padded[:-2], padded[2:])
    low, high = np.minimum(low, padded[1:-1]), np.maximum(high, padded[1:-1])
    return np.asarray(np.clip(found, low, high))  # a mean of equal values may round


def averaged_rows(taken: Array, dt: float) -> Rows:
    """Rows of a motion from rest to rest whose jerk is not limited.

    The rows are those of the cubic B-spline whose control points it goes through. Its velocities and accelerations are
    means of the motion's own: limits that the motion holds, jumps of acceleration included, hold at every instant, and
    no joint passes an angle that it did not pass.

    On a straight line the motion stays on it; corners are cut.

    Args:
        taken: configurations (n, dof) of the motion, `dt` apart [rad]; it takes two more steps.
        dt: control step [s].
    """
    count, dof = taken.shape
    more = count + 2
    call = _average.with_room(dof, more)
    work = call.work
    work.counts[:], work.dt[0], work.taken[: taken.size] = (dof, count, 1), dt, taken.ravel()
    call()
    q, v, a = (each[: more * dof].reshape(more, dof).copy() for each in (work.q, work.v, work.a))
    return Rows(dt * np.arange(more, dtype=np.float64), q, v, a)


def controlled_rows(points: Array, steps: Array, dt: float) -> Rows:
    """Rows of the cubic B-spline with control points (n, dof) [rad] `dt` [s] apart.

    Args:
        points: one for each row.
        steps: (n + 1, dof) from the one before to the next, one before the first and one after the last among them.
        dt: [s].
    """
    change = np.diff(steps, axis=0)
    t = dt * np.arange(len(points), dtype=np.float64)
    return Rows(t, points + change / 6.0, 0.5 * (steps[:-1] + steps[1:]) / dt, change / dt**2)


def past_limits(rows: Rows, lower: Array, upper: Array) -> Array:
    """How far each step (n - 1, dof) passes limits (dof,), beyond what its rows do [rad]; 0 where it does not."""
    count, dof = rows.q.shape
    call, found = _look.with_room(dof, count), np.zeros((count - 1, dof))
    _give(call.work, rows, lower, upper)
    steps = call.work.beyond[: call()]
    found[steps] = _past(rows, steps, lower, upper)
    return found


def _give(work: BetweenWork, rows: Rows, lower: Array, upper: Array) -> None:
    """Let kernels look between rows, at what could pass limits (dof,) [rad]."""
    (count, dof), size = rows.q.shape, rows.q.size
    work.counts[0], work.counts[1], work.dt[0] = dof, count, rows.t[1]
    work.q[:size], work.a[:size] = rows.q.reshape(size), rows.a.reshape(size)
    work.lower[:dof], work.upper[:dof] = lower, upper


def _past(rows: Rows, steps: NDArray[np.int64], lower: Array, upper: Array) -> Array:
    """`past_limits` of some steps (m,)."""
    found = np.zeros((len(steps), len(lower)))
    for first in range(0, len(steps), ROWS_AT_ONCE):
        some = steps[first : first + ROWS_AT_ONCE]
        q, then, at = rows.q[some], rows.q[some + 1], between(rows, some)[0]
        room = np.minimum(np.minimum(q, then) - lower, upper - np.maximum(q, then))
        past = np.maximum(lower - at, at - upper).max(axis=1) - np.maximum(-room, 0.0)
        found[first : first + ROWS_AT_ONCE] = np.maximum(past, 0.0)
    return found


def halved(dt: float) -> Iterator[float]:
    """Steps [s], each half of the one before, at least `FINEST`."""
    yield dt
    while dt >= 2.0 * FINEST:
        dt = 0.5 * dt
        yield dt


class OnTheWay(NamedTuple):
    """What controllers must not run into on their way from row to row."""

    robot: Robot
    contact: Contact
    """What may touch."""

    def fault(self, rows: Rows) -> str:
        """What happens between two rows that happens at none of them, in a few words; "" for nothing."""
        count = len(rows.q)
        if count == 1:
            return ""
        lower, upper = self.robot.lower, self.robot.upper
        call = self.contact.between_rows(count)
        work = call.work
        _give(work.between, rows, lower, upper)
        step = call()
        if work.beyond[0]:
            past = _past(rows, work.between.beyond[: work.beyond[0]], lower, upper).max(axis=0)
            if past.max() > ON_LIMIT:
                return f"{self.robot.joint_names[int(np.argmax(past))]} could pass its limit"
        if step < 0:
            return ""
        a, b = work.contact.course.pair.tolist()
        return " could touch ".join(self.contact.ordered(a, b, by_kind=True))


def coarse(asked: float, dt: float, fault: str) -> str:
    """Why rows are `dt` [s] apart and not as asked, to be added to a sentence; "" if they are as asked."""
    return f", in rows of {dt:.6g} s: between those of {asked:.6g} s {fault}" if fault else ""


def joined(first: Rows, then: Rows) -> Rows:
    """Two motions from rest to rest, one after the other; the second begins where the first ends.

    The row between them has the mean of both accelerations.
    """
    t = np.concatenate([first.t, first.t[-1] + then.t[1:]])
    q, v, a = (np.vstack([before[:-1], after]) for before, after in zip(first[1:], then[1:], strict=True))
    a[len(first.t) - 1] = 0.5 * (first.a[-1] + then.a[0])
    return Rows(t, q, v, a)


def standing(rows: Rows, more: int, dt: float) -> Rows:
    """Rows, and so many more of a motion that stands still where they end."""
    still = np.zeros((more, rows.q.shape[1]))
    q = np.vstack([rows.q, np.tile(rows.q[-1], (more, 1))])
    return Rows(dt * np.arange(len(q), dtype=np.float64), q, np.vstack([rows.v, still]), np.vstack([rows.a, still]))


@dataclass(frozen=True, slots=True, eq=False)
class MotionState(Frozen):
    """A motion at one time, from which another tracker or a plan may go on. Arrays are read-only."""

    q: Array
    """(dof,) joint angles [rad]."""
    v: Array
    """(dof,) joint velocities [rad/s]."""
    a: Array
    """(dof,) joint accelerations [rad/s^2], the last change of the velocities."""


def checked_velocity(robot: Robot, v: object, limit: Array) -> Array:
    """Joint velocities (dof,) [rad/s] within their limits (dof,) [rad/s].

    Raises:
        InvalidInputError: malformed, or faster.
    """
    speed = robot.configuration(v, "v")  # type: ignore[arg-type]  # checked there
    fast = int(np.argmax(np.abs(speed) - limit))
    if abs(speed[fast]) > limit[fast] * (1.0 + 1e-9):  # rounding
        unit = unit_of(robot, fast)
        raise InvalidInputError(
            f"v has {robot.joint_names[fast]} at {speed[fast]:.6g} {unit}/s, its limit is {limit[fast]:.6g} {unit}/s"
        )
    return speed
