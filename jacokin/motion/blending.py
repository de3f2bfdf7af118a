"""Time for a way of straight joint motions: through its corners without stopping, within limits at every instant.

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
from jacokin.kernels.course_times import JOINTS, PIECES, POINTS, fit_course_times, make_course_work
from jacokin.kernels.free_motion.corners import STRAIGHT
from jacokin.kernels.library import Calls
from jacokin.kernels.motion_rows import make_sample_work, sample_course

USED = 1.0 - 1e-9  # of the limits; what remains is for rounding

_fit = Calls(fit_course_times, make_course_work, kept=500)  # corners
_sample = Calls(sample_course, make_sample_work, kept=20_000)  # rows


def straightened(way: Array, cuts: Array, full: Array) -> tuple[Array, Array]:
    """A way (n, dof) [rad] and its cuts (n,) without corners that are none; see `fit_time`."""
    if len(way) < 3:
        return way, cuts
    steps = way[1:] - way[:-1]
    slopes = steps / (np.abs(steps) / full).max(axis=1)[:, None]
    kept = np.ones(len(way), dtype=np.bool_)
    kept[1:-1] = (np.abs(slopes[1:] - slopes[:-1]) / full).max(axis=1) >= STRAIGHT
    return way[kept], cuts[kept]


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

    def sampled(self, steps: int) -> Array:
        """Configurations (steps + 1, dof) [rad] at equal steps of time from start to end."""
        (pieces, dof), places, rows = self.q.shape, len(self.t), steps + 1
        call = _sample.with_room(dof, rows, places)
        work = call.work
        work.counts[:], work.span[0] = (dof, rows, places), self.t[-1]
        work.begins[: pieces + 1], work.piece[:places] = self.begins, self.piece
        work.t[:places], work.s[:places], work.speed[:places] = self.t, self.s, self.speed
        size = pieces * dof
        work.at[:size], work.slope[:size], work.bend[:size] = self.q.ravel(), self.slope.ravel(), self.bend.ravel()
        call()
        return work.q[: rows * dof].reshape(rows, dof).copy()


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
    work.counts[JOINTS], work.counts[POINTS], work.end[0] = dof, points, end
    work.way[: points * dof], work.cuts[:points], work.full[:dof] = way.ravel(), cuts, full
    work.velocity[:dof], work.acceleration[:dof] = USED * velocity, USED * acceleration
    places = call()
    pieces = int(work.counts[PIECES])
    q, slope, bend = (each[: pieces * dof].reshape(pieces, dof).copy() for each in (work.at, work.slope, work.bend))
    s, t, speed = (each[:places].copy() for each in (work.s, work.t, work.speed))
    return TimedCourse(work.ends[: pieces + 1].copy(), q, slope, bend, s, t, speed, work.piece[:places].copy())
