"""Time parametrisation: when each place of a path is passed, within velocity and acceleration limits.

Lines run at constant speed, or as fast as the joints allow between stops, by reachability analysis as TOPP-RA does it
(Pham and Pham: A new approach to time-optimal path parameterization based on reachability analysis, 2018): a backward
pass finds the largest speeds from which the path can be followed to its end, a forward pass takes them. The package
`toppra` does it for splines, with linear programs compiled for each platform; between the knots of a piecewise linear
path each program is the least of a few quotients (`kernels/speeds`).

A place u counts lines: 2.5 is half way along the third.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.kernels.library import Calls
from jacokin.kernels.speeds import STILL, fit_speeds, make_speed_work
from jacokin.model import checks
from jacokin.model.robot import Robot
from jacokin.motion.rows import ATTEMPTS, HELD, LEAST_SLOWER, WHOLE_TICK, Rows, sample

MAX_TICKS = 10_000_000  # more than a day at 100 Hz: a speed or a step was mistyped
LINE_USED = 0.8, 0.98  # parts of acceleration and velocity limits for a line that is tracked, no tick of it checked

_fit = Calls(fit_speeds, make_speed_work, kept=10_000)  # intervals


def check_ticks(durations: Array, dt: float) -> None:
    """Refuse a path that takes too many ticks of `dt` [s], or none; durations of its lines (n,) [s].

    Raises:
        InvalidInputError: names the longest segment.
    """
    total = float(durations.sum())
    if not total / dt <= MAX_TICKS:
        raise InvalidInputError(
            f"the path takes {total:.6g} s, most of it segment {int(np.argmax(durations))}: more than {MAX_TICKS} "
            f"ticks of {dt:.6g} s"
        )
    if total < dt * (1.0 - WHOLE_TICK):
        raise InvalidInputError(f"the path takes {total:.6g} s, less than one control step of {dt:.6g} s")


def steps_of(duration: float, dt: float) -> int:
    """How many steps of `dt` [s] a motion takes, slowed down to whole ones; at least one.

    Raises:
        InvalidInputError: too many.
    """
    if duration / dt > MAX_TICKS:
        check_ticks(np.array([duration]), dt)
    return max(1, math.ceil(duration / dt - WHOLE_TICK))


def sample_lines(durations: Array, dt: float) -> Array:
    """Places at every tick of `dt` [s], each line at constant speed, for durations (lines,) [s].

    Each line takes whole ticks, rounded up, and is slowed down to that; one that takes no time has none.
    """
    places = [np.zeros(1)]
    for line, duration in enumerate(durations.tolist()):
        if duration > 0.0:
            ticks = max(1, int(np.ceil(duration / dt - WHOLE_TICK)))
            places.append(line + np.arange(1, ticks + 1) / ticks)
    return np.concatenate(places)


def with_ramps(places: Array, ramp: int) -> Array:
    """Places (m,) of ticks from rest to rest, for those (n,) of ticks at full speed.

    They are the same ones between two ramps of so many ticks, an even number and less than n, in which the speed rises
    and falls steadily. It takes `ramp` + 2 ticks longer.
    """
    whole = len(places) - 1

    def gone(tick: Array) -> Array:
        """How many of the ticks at full speed are behind at ticks (m,)."""
        if not ramp:
            return tick
        up, down = np.minimum(tick, ramp), np.clip(tick - whole, 0.0, ramp)
        return np.asarray(0.5 * up**2 / ramp + np.clip(tick - ramp, 0.0, whole - ramp) + down - 0.5 * down**2 / ramp)

    return np.asarray(np.interp(sample(gone, float(whole + ramp), 1.0), np.arange(whole + 1), places))


@dataclass(frozen=True, slots=True)
class Schedule:
    """When each place is passed; between neighbours, places accelerate steadily.

    Attributes:
        u: (n,) places.
        t: (n,) times [s].
        speed: (n,) du/dt there.
    """

    u: Array
    t: Array
    speed: Array

    @property
    def duration(self) -> float:
        """From start to end [s]."""
        return float(self.t[-1])

    def at(self, times: Array) -> Array:
        """Places (m,) at times (m,) [s]."""
        i = np.clip(np.searchsorted(self.t, times, side="right") - 1, 0, len(self.t) - 2)
        length, start, end = self.u[i + 1] - self.u[i], self.speed[i], self.speed[i + 1]
        gone = times - self.t[i]
        found = self.u[i] + start * gone + 0.25 * (end**2 - start**2) / length * gone**2
        return np.maximum.accumulate(np.clip(found, self.u[i], self.u[i + 1]))

    def ticks(self, dt: float) -> Array:
        """Places (m,) at every tick of `dt` [s]; the last one is the end, and the whole is slowed down to that."""
        count = max(1, int(np.ceil(self.t[-1] / dt - WHOLE_TICK)))
        return self.at(np.linspace(0.0, self.duration, count + 1))


def fit_course(
    s: Array,
    slope: Array,
    velocity: Array,
    acceleration: Array,
    top: Array,
    *,
    sudden: Array | None = None,
) -> Schedule:
    """The least time from rest to rest along a course whose direction changes steadily from place to place.

    A joint's acceleration is slope u + bend x, with x the square of the speed and u the acceleration of the place: at
    the beginning of an interval with x, at its end with x + 2 h u. Both are linear in x and u, and what lies between
    lies within.

    Args:
        s: (n + 1,) places, rising.
        slope: (2, n, dof) dq/ds at the beginning and at the end of each interval.
        velocity: (dof,) limits [rad/s]; infinite for none.
        acceleration: (dof,) limits [rad/s^2].
        top: (n + 1,) largest speed of each place, 0 where it stands still; infinite where nothing else limits it.
        sudden: (n, dof) what corners add to accelerations on each interval, in proportion to speed; None for nothing.
    """
    h, limits = np.diff(s), np.broadcast_to(acceleration, slope[0].shape)
    bend = (slope[1] - slope[0]) / h[:, None]
    bends = [bend]
    with np.errstate(divide="ignore"):
        fastest = (velocity / np.abs(slope).max(axis=0)).min(axis=1) ** 2
        if sudden is not None and sudden.any():  # with r a speed near by, sqrt(x) <= (x / r + r) / 2
            # Near that speed corners take 0.7 of the limit of acceleration.
            near = np.minimum(np.maximum(top[:-1], top[1:]), (0.7 * acceleration / sudden).min(axis=1))
            near = np.maximum(near, STILL)[:, None]
            limits = limits - 0.5 * sudden * near
            bends = [bend + 0.5 * sudden / near, bend - 0.5 * sudden / near]
        turning = np.min([(limits / np.abs(each)).min(axis=1) for each in bends], axis=0)
    most, own = top**2, np.minimum(fastest, turning)
    np.minimum(most[:-1], own, out=most[:-1])
    np.minimum(most[1:], own, out=most[1:])
    most[0] = most[-1] = 0.0
    # Of u, at the beginning and at the end of each interval.
    rate = np.concatenate([part for each in bends for part in (slope[0], slope[1] + 2.0 * h[:, None] * each)], axis=1)
    size = np.abs(rate)
    counts = size > 1e-9 * size.max()  # less limits nothing
    safe = np.where(counts, size, 1.0)
    high = np.where(counts, np.concatenate([limits] * (2 * len(bends)), axis=1) / safe, np.inf)
    bent = np.concatenate([each for each in bends for _ in range(2)], axis=1)
    tilt = np.where(counts, np.sign(rate) * bent / safe, 0.0)
    speed = largest_speeds(h, high, tilt, most)
    times = 2.0 * h / np.maximum(speed[:-1] + speed[1:], STILL)
    return Schedule(s, np.append(0.0, np.cumsum(times)), speed)


def slopes(s: Array, q: Array) -> Array:
    """(2, n, dof) dq/ds at the ends of the intervals between places (n + 1,), for configurations (n + 1, dof) there."""
    found = np.gradient(q, s, axis=0, edge_order=2 if len(s) > 2 else 1)
    return np.stack([found[:-1], found[1:]])


def fit_line(u: Array, q: Array, duration: float, velocity: Array, acceleration: Array) -> Schedule:
    """From rest to rest along a line, within parts of the limits that leave room for what following it takes.

    Args:
        u: (n,) places, both ends of the line included.
        q: (n, dof) configurations there [rad].
        duration: of the line at the speed asked for [s]; no part of it is run through faster.
        velocity: (dof,) limits [rad/s].
        acceleration: (dof,) limits [rad/s^2].
    """
    if len(u) == 2:  # at rest at both, it would never move
        u, q = np.insert(u, 1, u.mean()), np.insert(q, 1, q.mean(axis=0), axis=0)
    usable, speed = LINE_USED[0] * acceleration, LINE_USED[1] * velocity
    return fit_course(u, slopes(u, q), speed, usable, np.full(len(u), 1.0 / duration))


def largest_speeds(lengths: Array, high: Array, tilt: Array, top: Array) -> Array:
    """The largest speeds (n + 1,) with which the places of a path can be passed, from rest.

    Args:
        lengths: (n,) of the intervals between places.
        high: (n, limits) with u the acceleration on an interval and x = speed^2, |u + tilt x| <= high; infinite where
            there is no limit.
        tilt: (n, limits).
        top: (n + 1,) the largest x of each place.
    """
    count, limits = high.shape
    call = _fit.with_room(limits, count)
    work = call.work
    work.counts[:] = high.shape
    work.lengths[:count], work.top[: count + 1] = lengths, top
    work.high[: high.size], work.tilt[: high.size] = high.ravel(), tilt.ravel()
    call()
    return np.sqrt(work.x[: count + 1])


BETWEEN = 0.002  # [s] between places that are looked at; in this time torques change by parts in a thousand
MOST_PLACES = 20_000
USED = 0.99  # of a limit; what remains is for what lies between the places
SLOWEST = 0.02  # of its speed, at which a motion counts as one that gravity forbids


class TooHeavy(NamedTuple):
    """What gravity asks for where no slowness helps."""

    joint: int
    torque: float
    """[N m]."""

    def explain(self, robot: Robot) -> str:
        """In a sentence."""
        return f"{robot.joint_names[self.joint]} needs {self.torque:.4g} N m on the way, standing still"


def torque_limits(robot: Robot, limit: ArrayLike | bool | None) -> Array | None:
    """Checked limits (dof,) [N m]: those given, the robot's own for True, or none.

    Raises:
        InvalidInputError: neither one number nor one for each joint, one that is not positive, or True where the file
            gives no efforts.
        ModelError: the description gives no masses.
    """
    if limit is None or limit is False:
        return None
    robot.check_masses()
    return robot.known_efforts() if limit is True else checks.positive_vector("torque_limit", limit, robot.dof, "N m")


def slowness(robot: Robot, states: tuple[Array, Array, Array], limit: Array) -> float | TooHeavy:
    """How many times as long a motion must take for no joint to need more torque than its limit (dof,) [N m].

    A motion that takes k times as long needs the same torque against gravity and 1 / k^2 of what its velocities and
    accelerations ask for, so the least k that keeps a limit is found directly.

    Args:
        robot: the arm.
        states: angles, velocities and accelerations (n, dof) of the motion.
        limit: (dof,) [N m].
    """
    gravity, share = _shares(robot, states, USED * limit)
    heavy = np.abs(gravity) - USED * limit
    if heavy.max() > 0.0:
        row, joint = np.unravel_index(int(np.argmax(heavy)), heavy.shape)
        return TooHeavy(int(joint), float(gravity[row, joint]))
    least = float(share.min())
    if least >= 1.0:
        return 1.0
    if least < SLOWEST**2:
        row, joint = np.unravel_index(int(np.argmin(share)), share.shape)
        return TooHeavy(int(joint), float(gravity[row, joint]))
    return 1.0 / float(np.sqrt(least))


def torque_strain(robot: Robot, rows: Rows, limit: Array) -> float:
    """How many times as long rows must take for no joint to need more torque than its limit (dof,) [N m]."""
    least = float(_shares(robot, (rows.q, rows.v, rows.a), limit)[1].min())
    return 1.0 / float(np.sqrt(max(least, SLOWEST**2)))


def hold_torques(robot: Robot, write: Callable[[float], Rows], limit: Array | None, slower: float = 1.0) -> Rows:
    """Rows in which no joint needs more torque than its limit (dof,) [N m]; None for none.

    Args:
        robot: the arm.
        write: rows of a motion that takes so many times as long.
        limit: (dof,) [N m].
        slower: where to begin.
    """
    for _ in range(ATTEMPTS):
        rows = write(slower)
        worst = 0.0 if limit is None else torque_strain(robot, rows, limit)
        if worst <= HELD:
            break
        slower *= max(worst, LEAST_SLOWER)
    return rows


def _shares(robot: Robot, rows: tuple[Array, Array, Array], limit: Array) -> tuple[Array, Array]:
    """Torques (n, dof) against gravity [N m], and the share (n, dof) of what else is needed that limits leave."""
    still = np.zeros(rows[0].shape)
    gravity = robot.inverse_dynamics(rows[0], still, still)
    moving = robot.inverse_dynamics(*rows) - gravity
    room = limit - np.where(moving > 0.0, gravity, -gravity)
    with np.errstate(divide="ignore", invalid="ignore"):
        return gravity, np.where(moving == 0.0, np.inf, room / np.abs(moving))
