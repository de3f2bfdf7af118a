"""Time for a way of straight joint motions: through its corners without stopping, within limits at every instant.

Each corner is cut by a parabola that begins and ends in the direction of its lines (`BlendedCourse`). Along lines and
parabolas the joints' accelerations are linear functions of the place while the place's own acceleration is constant,
so limits that hold at both ends of a piece hold all along it: what the passes of TOPP-RA (see `timing`) find on their
grid is valid between its points, too. From rest to rest.

A place s counts time at full speed [s]: no joint can be at s + ds sooner than ds after s.
"""

from __future__ import annotations

import threading
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.course_times import CourseWork, fit_course_times, make_course_work
from jacokin.kernels.free_motion.corners import STRAIGHT
from jacokin.kernels.library import Call
from jacokin.kernels.motion_rows import SampleWork, sample_course

USED = 1.0 - 1e-9  # of the limits; what remains is for rounding
FIRST_ROOM, ROOM_KEPT = 32, 1000  # lines and parabolas, for which a thread keeps the memory

_local = threading.local()  # the kernel with work arrays of each thread


@dataclass(frozen=True, slots=True)
class BlendedCourse:
    """Lines and parabolas, one after another.

    Attributes:
        s: (n + 1,) where they begin, and the end.
        q: (n, dof) configuration at the beginning of each [rad].
        slope: (n, dof) dq/ds there.
        bend: (n, dof) d2q/ds2, which is constant; zero on lines.
    """

    s: Array
    q: Array
    slope: Array
    bend: Array

    def at(self, s: Array) -> tuple[Array, Array, Array]:
        """Configurations (m, dof), slopes and bends at places (m,)."""
        i = np.clip(np.searchsorted(self.s, s, side="right") - 1, 0, len(self.q) - 1)
        gone = (s - self.s[i])[:, None]
        return (
            self.q[i] + gone * (self.slope[i] + 0.5 * gone * self.bend[i]),
            self.slope[i] + gone * self.bend[i],
            self.bend[i],
        )


def round_corners(way: Array, velocity: Array, cuts: Array) -> tuple[BlendedCourse, Array]:
    """A course along a way (n, dof) [rad] that cuts its corners, and the places (m,) where it must stop.

    Args:
        way: configurations, no two in a row equal; at least two.
        velocity: (dof,) limits [rad/s].
        cuts: (n,) how much time at full speed is cut off on both sides of a corner, less than half of the shorter line
            [s]; 0 where the corner stays.
    """
    steps = np.diff(way, axis=0)
    lengths = (np.abs(steps) / velocity).max(axis=1)
    slopes = steps / lengths[:, None]
    change, corner, cut = np.diff(slopes, axis=0), cuts[1:-1, None], cuts[1:-1] > 0.0
    # Lines, and between them parabolas, which are left out where nothing is cut off.
    pieces = np.zeros((3, 2 * len(steps) - 1, way.shape[1]))
    q, slope, bend = pieces
    q[::2], q[1::2] = way[:-1] + cuts[:-1, None] * slopes, way[1:-1] - corner * slopes[:-1]
    slope[::2], slope[1::2] = slopes, slopes[:-1]
    bend[1::2] = change / np.where(cut[:, None], 2.0 * corner, 1.0)
    s = np.zeros(2 * len(steps))
    s[1::2], s[2::2] = lengths - cuts[:-1] - cuts[1:], 2.0 * cuts[1:-1]
    s = np.cumsum(s)
    stops = s[2:-1:2][~cut & ((np.abs(change) / velocity).max(axis=1, initial=0.0) >= STRAIGHT)]
    kept = np.ones(2 * len(steps), dtype=bool)
    kept[1:-1:2] = cut
    q, slope, bend = pieces[:, kept[:-1]]
    return BlendedCourse(s[kept], q, slope, bend), np.concatenate([s[:1], stops, s[-1:]])


def straightened(way: Array, cuts: Array, velocity: Array) -> tuple[Array, Array]:
    """A way (n, dof) and its cuts (n,) without corners that are none; see `round_corners`."""
    if len(way) < 3:
        return way, cuts
    steps = np.diff(way, axis=0)
    slopes = steps / (np.abs(steps) / velocity).max(axis=1)[:, None]
    bent = (np.abs(np.diff(slopes, axis=0)) / velocity).max(axis=1, initial=0.0) >= STRAIGHT
    kept = np.concatenate([[True], bent, [True]])
    return way[kept], cuts[kept]


@dataclass(frozen=True, slots=True)
class TimedCourse:
    """A course and when each place of it is passed; between neighbours of a grid, places accelerate steadily.

    Attributes:
        course: the lines and parabolas.
        s: (n,) places, all ends of lines and parabolas among them.
        t: (n,) times [s].
        speed: (n,) ds/dt there.
        piece: (n,) the line or parabola that begins there, or goes on.
    """

    course: BlendedCourse
    s: Array
    t: Array
    speed: Array
    piece: NDArray[np.int64]

    @property
    def duration(self) -> float:
        """From start to end [s]."""
        return float(self.t[-1])

    def at(self, t: Array) -> tuple[Array, Array, Array]:
        """Configurations (m, dof) [rad], velocities [rad/s] and accelerations [rad/s^2] at times (m,) [s]."""
        i = np.clip(np.searchsorted(self.t, t, side="right") - 1, 0, len(self.t) - 2)
        gone = t - self.t[i]
        pull = (np.diff(self.speed) / np.diff(self.t))[i]
        place = np.clip(self.s[i] + gone * (self.speed[i] + 0.5 * gone * pull), self.s[i], self.s[i + 1])
        piece = self.piece[i]
        on = (place - self.course.s[piece])[:, None]
        speed = np.clip(self.speed[i] + gone * pull, 0.0, None)[:, None]
        slope, bend = self.course.slope[piece], self.course.bend[piece]
        here = slope + on * bend
        q = self.course.q[piece] + on * (slope + 0.5 * on * bend)
        return q, here * speed, here * pull[:, None] + bend * speed**2

    def sampled(self, steps: int) -> Array:
        """Configurations (steps + 1, dof) [rad] at equal steps of time from start to end."""
        course, q = self.course, np.empty((steps + 1, self.course.q.shape[1]))
        shape = (course.s, course.q.ravel(), course.slope.ravel(), course.bend.ravel())
        work = SampleWork(self.t[-1:].copy(), self.t, self.s, self.speed, self.piece, *shape, q.ravel())
        Call(sample_course, work)()
        return q


def fit_time(
    course: BlendedCourse, stops: Array, velocity: Array, acceleration: Array, end: float = 0.0
) -> TimedCourse:
    """The least time from rest along a course, on a grid.

    Args:
        course: lines and parabolas.
        stops: (m,) places where it stands still, the start among them, and the end unless it is passed.
        velocity: (dof,) limits [rad/s].
        acceleration: (dof,) limits [rad/s^2].
        end: ds/dt at the end, 0 for rest; it is less there where so much cannot be reached.
    """
    pieces, dof = course.slope.shape
    call: Call[CourseWork] | None = getattr(_local, "call", None)
    if (
        call is None
        or len(call.work.velocity) != dof
        or len(call.work.ends) <= pieces
        or len(call.work.stops) < len(stops)
    ):
        room = max(2 * pieces, FIRST_ROOM)
        call = Call(fit_course_times, make_course_work(room, dof, room + 1))
        if room <= ROOM_KEPT:
            _local.call = call
    work = call.work
    work.counts[:] = pieces, dof, len(stops)
    work.ends[: pieces + 1], work.stops[: len(stops)] = course.s, stops
    work.slope[: pieces * dof], work.bend[: pieces * dof] = course.slope.ravel(), course.bend.ravel()
    work.velocity[:], work.acceleration[:], work.end[0] = USED * velocity, USED * acceleration, end
    count = call()
    s, t, speed = (each[:count].copy() for each in (work.s, work.t, work.speed))
    return TimedCourse(course, s, t, speed, work.piece[:count].copy())
