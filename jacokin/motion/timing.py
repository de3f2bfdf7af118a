"""How a line is run through in time: at constant speed, or from rest to rest as fast as the joints allow.

A line has length one; the part of it that is behind the tool is s(t). From rest to rest, s'(t) is a trapezoid: constant
acceleration, constant speed, constant deceleration.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array

USED = 0.9  # part of the acceleration limits that a path plans with; the rest is for what following it takes
SPEED_USED = 0.98  # the same of the velocity limits
CURVATURE_USED = 0.5  # of the acceleration, the most that the bend of the joint path may use at full speed
TINY = 1e-12  # [rad] a joint that moves less along a line limits nothing
SLOWEST = 0.1  # of the speed asked for: a line that needs less passes a singular pose, and is not worth the wait


@dataclass(frozen=True, slots=True)
class Profile:
    """A line of length one in time.

    Attributes:
        duration: [s].
        ramp: the part of the duration for gaining speed, and again for losing it; 0 for constant speed, at most 0.5.
    """

    duration: float
    ramp: float = 0.0

    def parts(self, times: Array) -> Array:
        """The part of the line that is done after parts of the duration; both 0 to 1."""
        if self.ramp == 0.0:
            return times
        top = 1.0 / (1.0 - self.ramp)  # speed on the plateau
        left = 1.0 - times
        rising, falling = 0.5 * top / self.ramp * times**2, 1.0 - 0.5 * top / self.ramp * left**2
        plateau = top * (times - 0.5 * self.ramp)
        return np.select([times < self.ramp, left < self.ramp], [rising, falling], plateau)


def rest_to_rest(speed: float, acceleration: float) -> Profile:
    """The fastest trapezoid of length one.

    Args:
        speed: largest [1/s].
        acceleration: largest [1/s^2].
    """
    if speed**2 >= acceleration:  # the speed is never reached
        return Profile(2.0 / np.sqrt(acceleration), 0.5)
    duration = 1.0 / speed + speed / acceleration
    return Profile(duration, speed / acceleration / duration)


def profile_within(q: Array, duration: float, velocity: Array, acceleration: Array, dt: float) -> Profile:
    """From rest to rest along a line whose joint path is known, within velocity and acceleration limits.

    The velocity of a joint is q' s' and its acceleration q' s'' + q'' s'^2, with derivatives along the line taken from
    the samples.

    Args:
        q: (n, dof) configurations at equal steps along the line, both ends included [rad].
        duration: of the line at the speed asked for [s]; it is not run through faster.
        velocity: (dof,) limits [rad/s].
        acceleration: (dof,) limits [rad/s^2].
        dt: control step [s].
    """
    step = 1.0 / (len(q) - 1)
    slope = np.abs(np.diff(q, axis=0)).max(axis=0) / step
    bend = np.abs(np.diff(q, 2, axis=0)).max(axis=0, initial=0.0) / step**2
    slope, bend = np.maximum(slope, TINY), np.maximum(bend, TINY)
    limit = USED * acceleration
    asked = 1.0 / duration
    with np.errstate(over="ignore"):  # what is beyond 1e308 limits nothing
        fastest = min((SPEED_USED * velocity / slope).min(), np.sqrt(CURVATURE_USED * limit / bend).min())
        speed = max(min(asked, float(fastest)), SLOWEST * asked)
        left = np.maximum(limit - speed**2 * bend, (1.0 - USED) * limit)
        return rest_to_rest(speed, min(float((left / slope).min()), speed / dt))


PATH_SPEED_USED = 0.995  # part of the velocity limits: a tick may take in a little of a faster part beside it
ACCELERATION_USED = 0.9  # the same of the acceleration limits
NO_MOTION = 1e-12


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


def within_speed(u: Array, q: Array, least: Array, velocity: Array, part: float) -> Schedule:
    """Each interval takes the time that was asked for, or the longer one that the joints need.

    Args:
        u: (n,) places.
        q: (n, dof) [rad].
        least: (n - 1,) time asked for each interval [s].
        velocity: (dof,) limits [rad/s].
        part: of the limits that is used.
    """
    needed = (np.abs(np.diff(q, axis=0)) / (part * velocity)).max(axis=1)
    return Schedule(u, np.append(0.0, np.cumsum(np.maximum(least, needed))))


def within_acceleration(
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
    reach = _controllable(h, high, tilt, top)
    x = np.zeros(len(u))
    for i in range(len(h)):
        limit = float((high[i] - tilt[i] * x[i]).min())
        x[i + 1] = min(reach[i + 1], max(x[i] + 2.0 * h[i] * limit, 0.0))
    speed = np.sqrt(x)
    total = speed[:-1] + speed[1:]
    times = 2.0 * h / np.maximum(total, NO_MOTION)
    return Schedule(u, np.append(0.0, np.cumsum(times)), speed)


def _controllable(h: Array, high: Array, tilt: Array, top: Array) -> Array:
    """The largest squared speeds (n,) from which the path can be followed to its end."""
    reach = top.copy()
    for i in range(len(h) - 1, -1, -1):
        # x is possible when some u'' keeps every joint within its limits and x + 2 h u'' within [0, reach]:
        # each lower bound of u'' must not exceed any upper one. Both are linear in x: constant + factor x.
        upper = np.append(high[i], reach[i + 1] / (2.0 * h[i])), np.append(-tilt[i], -1.0 / (2.0 * h[i]))
        lower = np.append(-high[i], 0.0), np.append(-tilt[i], -1.0 / (2.0 * h[i]))
        room = upper[0][:, None] - lower[0][None, :]
        growing = lower[1][None, :] - upper[1][:, None]
        bounded = growing > NO_MOTION
        if bounded.any():
            reach[i] = min(reach[i], float((room[bounded] / growing[bounded]).min()))
    return reach
