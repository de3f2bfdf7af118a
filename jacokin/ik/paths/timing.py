"""How a line is run through in time: at constant speed, or from rest to rest as fast as the joints allow.

A line has length one; the part of it that is behind the tool is s(t). From rest to rest, s'(t) is a trapezoid: constant
acceleration, constant speed, constant deceleration.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

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
