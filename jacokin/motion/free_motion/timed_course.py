"""When each place of a way is passed whose corners are cut, within limits of velocity and acceleration.

Each corner is cut by a parabola that begins and ends in the direction of its lines. Along lines and
parabolas the joints' accelerations are linear functions of the place while the place's own acceleration is constant,
so limits that hold at both ends of a piece hold all along it: what the passes of TOPP-RA (see `timing`) find on their
grid is valid between its points, too. From rest to rest.

A place s counts time at full speed [s]: no joint can be at s + ds sooner than ds after s.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.course_times import USED, CourseInteger, fit_course_times, make_course_work
from jacokin.kernels.library import Calls

_fit = Calls(fit_course_times, make_course_work, kept=500)  # corners


@dataclass(frozen=True, slots=True)
class TimedCourse:
    """Lines and parabolas, and when each place of them is passed; between places of a grid, they accelerate steadily.

    Attributes:
        begins: (n + 1,) where lines and parabolas begin, and the end.
        q: (n, dof) configuration at the beginning of each [rad].
        slope: (n, dof) dq/ds there.
        bend: (n, dof) d2q/ds2, which is constant; zero on lines.
        s: (m,) places, all ends of lines and parabolas among them.
        t: (m,) times [s].
        speed: (m,) ds/dt there.
        piece: (m,) the line or parabola that begins there, or goes on.
    """

    begins: Array
    q: Array
    slope: Array
    bend: Array
    s: Array
    t: Array
    speed: Array
    piece: NDArray[np.int64]

    @property
    def duration(self) -> float:
        """From start to end [s]."""
        return float(self.t[-1])

    def at(self, t: Array) -> tuple[Array, Array, Array]:
        """Configurations (k, dof) [rad], velocities [rad/s] and accelerations [rad/s^2] at times (k,) [s]."""
        i = np.clip(np.searchsorted(self.t, t, side="right") - 1, 0, len(self.t) - 2)
        gone = t - self.t[i]
        pull = (np.diff(self.speed) / np.diff(self.t))[i]
        place = np.clip(self.s[i] + gone * (self.speed[i] + 0.5 * gone * pull), self.s[i], self.s[i + 1])
        piece = self.piece[i]
        on = (place - self.begins[piece])[:, None]
        speed = np.clip(self.speed[i] + gone * pull, 0.0, None)[:, None]
        slope, bend = self.slope[piece], self.bend[piece]
        here = slope + on * bend
        q = self.q[piece] + on * (slope + 0.5 * on * bend)
        return q, here * speed, here * pull[:, None] + bend * speed**2


def fit_time(
    way: Array, cuts: Array, full: Array, velocity: Array, acceleration: Array, end: float = 0.0
) -> TimedCourse:
    """The least time from rest along a way whose corners are cut, on a grid.

    It stands still at corners that are not cut, and at the end unless that is passed.

    Args:
        way: (n, dof) configurations, no two in a row equal; at least two [rad].
        cuts: (n,) how much time at full speed is cut off on both sides of a corner, less than half of the shorter line
            [s]; 0 where the corner stays.
        full: (dof,) full speed [rad/s].
        velocity: (dof,) limits [rad/s].
        acceleration: (dof,) limits [rad/s^2].
        end: ds/dt at the end, 0 for rest; it is less there where so much cannot be reached.
    """
    points, dof = way.shape
    call = _fit.with_room(dof, points)
    work = call.work
    work.counts[CourseInteger.JOINTS], work.counts[CourseInteger.POINTS], work.end[0] = dof, points, end
    work.way[: points * dof], work.cuts[:points], work.full[:dof] = way.ravel(), cuts, full
    work.velocity[:dof], work.acceleration[:dof] = USED * velocity, USED * acceleration
    places = call()
    pieces = int(work.counts[CourseInteger.PIECES])
    q, slope, bend = (each[: pieces * dof].reshape(pieces, dof).copy() for each in (work.at, work.slope, work.bend))
    s, t, speed = (each[:places].copy() for each in (work.s, work.t, work.speed))
    return TimedCourse(work.ends[: pieces + 1].copy(), q, slope, bend, s, t, speed, work.piece[:places].copy())
