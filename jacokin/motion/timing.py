"""Time parametrisation: when each place of a path is passed, within velocity and acceleration limits.

Lines run at constant speed, or as fast as the joints allow between stops, by reachability analysis as TOPP-RA does it
(Pham and Pham: A new approach to time-optimal path parameterization based on reachability analysis, 2018): a backward
pass finds the largest speeds from which the path can be followed to its end, a forward pass takes them. The package
`toppra` does it for splines, with linear programs compiled for each platform; between the knots of a piecewise linear
path each program is the least of a few quotients (`kernels/speeds`).

A place u counts lines: 2.5 is half way along the third.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.kernels.library import Call
from jacokin.kernels.speeds import SpeedWork, fit_speeds, make_speed_work
from jacokin.model import checks
from jacokin.model.robot import Robot

WHOLE_TICK = 1e-9  # a duration this near to whole ticks is whole; division rounds
MAX_TICKS = 10_000_000  # more than a day at 100 Hz: a speed or a step was mistyped
ACCELERATION_USED = 0.9  # part of the acceleration limits that is planned with where ticks are checked
LINE_USED = 0.8, 0.98  # parts of acceleration and velocity limits for a line that is tracked, no tick of it checked
NO_MOTION = 1e-12  # [rad] a joint that moves less along a line limits nothing
PATH_SPEED_USED = 0.995  # of the velocity limits where ticks are checked: one may take in a little of a faster part
ATTEMPTS = 24  # to find a pace whose ticks are all within the limits
LESS = 0.9  # of the limits is used at the next attempt
ROOM_KEPT = 10_000  # intervals, of which a thread keeps the memory
EASED, LEAST_EASED = 0.97, 0.5  # of its speed is left to a part of the path, beside the excess and at least


_local = threading.local()  # the kernel with work arrays of each thread


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


def fit_ticks(
    u: Array,
    q: Array,
    joints_at: Callable[[Array], Array],
    times: Array,
    dt: float,
    velocity: Array,
    acceleration: Array | None,
) -> Array:
    """Places of the ticks along a path that every joint can follow, no faster than asked.

    Args:
        u: (n,) places of knots.
        q: (n, dof) configurations there [rad].
        joints_at: the configurations (m, dof) at places (m,) [rad].
        times: (lines,) asked for each line [s].
        dt: control step [s].
        velocity: (dof,) limits [rad/s].
        acceleration: (dof,) limits [rad/s^2], from rest to rest then; None for none.

    Raises:
        InvalidInputError: more than ten million ticks, or none.
    """
    line = np.clip(0.5 * (u[:-1] + u[1:]), 0.0, None).astype(np.intp)
    least = np.maximum(np.diff(u) * times[line], 1e-12)
    part, top_speed, ticks = PATH_SPEED_USED, np.full(len(u) - 1, np.inf), u
    for _ in range(ATTEMPTS):
        if acceleration is None:
            schedule = fit_speed(u, q, least, part * velocity)
        else:
            stops = _corners(u, q, least, acceleration, dt)
            usable = ACCELERATION_USED * acceleration
            schedule = fit_acceleration(u, q, least, part * velocity, usable, stops, top_speed)
        check_ticks(np.asarray(np.bincount(line, np.diff(schedule.t)), dtype=np.float64), dt)
        ticks = schedule.ticks(dt)
        v = np.diff(joints_at(ticks), axis=0) / dt
        fast = float((np.abs(v) / velocity).max())
        if fast > 1.0:
            part *= min(LESS, 1.0 / fast) if fast > 1.05 else 1.0 / fast - 1e-6
        if schedule.speed is None or acceleration is None:
            if fast <= 1.0:
                break
            continue
        still = np.zeros((1, v.shape[1]))
        change = np.abs(np.diff(np.vstack([still, v, still]), axis=0)) / dt
        hard = (change / acceleration).max(axis=1)
        if fast <= 1.0 and (hard <= 1.0).all():
            break
        speed, slower = np.maximum(schedule.speed[:-1], schedule.speed[1:]), top_speed.copy()
        for tick in np.flatnonzero(hard > 1.0).tolist():  # slower where ticks gain or lose speed too quickly
            near = (u[1:] >= ticks[max(tick - 1, 0)]) & (u[:-1] <= ticks[min(tick + 1, len(ticks) - 1)])
            slower[near] = np.minimum(slower[near], max(LEAST_EASED, EASED / hard[tick]) * speed[near].max())
        top_speed = slower
    return ticks


def _corners(u: Array, q: Array, least: Array, acceleration: Array, dt: float) -> NDArray[np.bool_]:
    """(n,) True at both ends, and where the joints' velocities change suddenly from one line to the next."""
    v = np.diff(q, axis=0) / least[:, None]
    jump = np.abs(np.diff(v, axis=0)) - 0.5 * (least[:-1] + least[1:])[:, None] * acceleration
    sudden = (jump > 0.1 * acceleration * dt).any(axis=1)
    stops = np.zeros(len(u), dtype=np.bool_)
    stops[1:-1] = sudden & (u[1:-1] == np.round(u[1:-1]))
    stops[[0, -1]] = True
    return stops


@dataclass(frozen=True, slots=True)
class Schedule:
    """When each knot is passed.

    Attributes:
        u: (n,) places of the knots.
        t: (n,) times [s].
        speed: (n,) du/dt at the knots; None when it is constant between them.
    """

    u: Array
    t: Array
    speed: Array | None = None

    def ticks(self, dt: float) -> Array:
        """Places (m,) at every tick of `dt` [s]; the last one is the end, and the whole is slowed down to that."""
        count = max(1, int(np.ceil(self.t[-1] / dt - 1e-9)))
        times = np.arange(count + 1) * (self.t[-1] / count)
        times[-1] = self.t[-1]
        if self.speed is None:
            return np.asarray(np.interp(times, self.t, self.u))
        i = np.clip(np.searchsorted(self.t, times, side="right") - 1, 0, len(self.t) - 2)
        length, start, end = self.u[i + 1] - self.u[i], self.speed[i], self.speed[i + 1]
        gone = times - self.t[i]
        found = self.u[i] + start * gone + 0.25 * (end**2 - start**2) / length * gone**2
        return np.maximum.accumulate(np.clip(found, self.u[i], self.u[i + 1]))


def fit_speed(u: Array, q: Array, least: Array, velocity: Array) -> Schedule:
    """Each interval takes the time that was asked for, or the longer one that the joints need.

    Args:
        u: (n,) places.
        q: (n, dof) [rad].
        least: (n - 1,) time asked for each interval [s].
        velocity: (dof,) limits [rad/s], as far as they are to be used.
    """
    needed = (np.abs(np.diff(q, axis=0)) / velocity).max(axis=1)
    return Schedule(u, np.append(0.0, np.cumsum(np.maximum(least, needed))))


def fit_acceleration(
    u: Array,
    q: Array,
    least: Array,
    velocity: Array,
    acceleration: Array,
    stops: NDArray[np.bool_],
    top_speed: Array,
) -> Schedule:
    """From rest to rest within velocity and acceleration limits.

    Args:
        u: (n,) places.
        q: (n, dof) [rad].
        least: (n - 1,) time asked for each interval [s].
        velocity: (dof,) limits [rad/s], as far as they are to be used.
        acceleration: (dof,) limits [rad/s^2], as far as they are to be used.
        stops: (n,) True where the path stands still.
        top_speed: (n - 1,) of u, in each interval [1/s]; infinite where nothing else limits it.
    """
    h = np.diff(u)
    slope = np.diff(q, axis=0) / h[:, None]
    fastest = np.minimum(h / least, (velocity / np.maximum(np.abs(slope), NO_MOTION)).min(axis=1))
    fastest = np.minimum(fastest, top_speed)
    # Of a knot: the slower of its two intervals.
    top = np.append(fastest, fastest[-1])
    top[1:-1] = np.minimum(fastest[:-1], fastest[1:])
    top = np.where(stops, 0.0, top**2)
    bend = np.zeros_like(slope)
    inner = np.diff(slope, axis=0) / (0.5 * (h[:-1] + h[1:]))[:, None]
    inner[stops[1:-1]] = 0.0
    bend[:-1] = inner
    bend[1:] = np.where(np.abs(bend[1:]) > np.abs(inner), bend[1:], inner)
    slope = np.where(np.abs(slope) < NO_MOTION, NO_MOTION, slope)
    # u'' in [low - tilt x, high - tilt x] for x = u'^2, joint by joint.
    with np.errstate(over="ignore"):  # what is beyond 1e308 limits nothing
        high = acceleration / np.abs(slope)
    tilt = bend / slope
    speed = largest_speeds(h, high, tilt, top)
    total = speed[:-1] + speed[1:]
    times = 2.0 * h / np.maximum(total, NO_MOTION)
    return Schedule(u, np.append(0.0, np.cumsum(times)), speed)


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
    stops = np.zeros(len(u), dtype=np.bool_)
    stops[[0, -1]] = True
    fastest = np.full(len(u) - 1, np.inf)
    usable, speed = LINE_USED[0] * acceleration, LINE_USED[1] * velocity
    return fit_acceleration(u, q, np.diff(u) * duration, speed, usable, stops, fastest)


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
    call: Call[SpeedWork] | None = getattr(_local, "call", None)
    if call is None or count > len(call.work.lengths) or high.size > len(call.work.high):
        call = Call(fit_speeds, make_speed_work(2 * count, limits))
        if count <= ROOM_KEPT:
            _local.call = call
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


class TimeLaw(Protocol):
    """Where the arm is at any time."""

    @property
    def duration(self) -> float:
        """From start to end [s]."""

    def at(self, t: Array) -> tuple[Array, Array, Array]:
        """Configurations (m, dof) [rad], velocities [rad/s] and accelerations [rad/s^2] at times (m,) [s]."""


class Slowed(NamedTuple):
    """A motion that takes so many times as long."""

    law: TimeLaw
    factor: float

    @property
    def duration(self) -> float:
        """From start to end [s]."""
        return self.law.duration * self.factor

    def at(self, t: Array) -> tuple[Array, Array, Array]:
        """As `TimeLaw.at`."""
        q, v, a = self.law.at(t / self.factor)
        return q, v / self.factor, a / self.factor**2


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


def slow_down(robot: Robot, law: TimeLaw, limit: Array) -> TimeLaw | TooHeavy:
    """The motion itself, or slower, so that no joint needs more torque than its limit (dof,) [N m].

    A motion that takes k times as long needs the same torque against gravity and 1 / k^2 of what its velocities and
    accelerations ask for, so the least k that keeps a limit is found directly.
    """
    count = int(np.clip(np.ceil(law.duration / BETWEEN), 2, MOST_PLACES))
    rows = law.at(np.linspace(0.0, law.duration, count + 1))
    still = np.zeros(robot.dof)
    gravity = np.array([robot.inverse_dynamics(q, still, still) for q in rows[0]])
    moving = np.array([robot.inverse_dynamics(*row) for row in zip(*rows, strict=True)]) - gravity
    room = USED * limit - np.where(moving > 0.0, gravity, -gravity)
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(moving == 0.0, np.inf, room / np.abs(moving))
    heavy = np.abs(gravity) - USED * limit
    if heavy.max() > 0.0:
        row, joint = np.unravel_index(int(np.argmax(heavy)), heavy.shape)
        return TooHeavy(int(joint), float(gravity[row, joint]))
    least = float(share.min())
    if least >= 1.0:
        return law
    if least < SLOWEST**2:
        row, joint = np.unravel_index(int(np.argmin(share)), share.shape)
        return TooHeavy(int(joint), float(gravity[row, joint]))
    return Slowed(law, 1.0 / float(np.sqrt(least)))
