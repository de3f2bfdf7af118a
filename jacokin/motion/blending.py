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
    cut, stops = cuts.tolist(), [0.0]
    s, q, slope, bend = [0.0], [], [], []
    for line in range(len(slopes)):
        if line and cut[line] > 0.0:
            q.append(way[line] - cut[line] * slopes[line - 1])
            slope.append(slopes[line - 1])
            bend.append((slopes[line] - slopes[line - 1]) / (2.0 * cut[line]))
            s.append(s[-1] + 2.0 * cut[line])
        elif line and np.abs((slopes[line] - slopes[line - 1]) / velocity).max() >= STRAIGHT:
            stops.append(s[-1])
        q.append(way[line] + cut[line] * slopes[line])
        slope.append(slopes[line])
        bend.append(np.zeros_like(slopes[line]))
        s.append(s[-1] + lengths[line] - cut[line] - cut[line + 1])
    return BlendedCourse(np.array(s), np.array(q), np.array(slope), np.array(bend)), np.array([*stops, s[-1]])


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
        i, gone, pull, on, piece = self._places(t)
        speed = np.clip(self.speed[i] + gone * pull, 0.0, None)[:, None]
        slope, bend = self.course.slope[piece], self.course.bend[piece]
        here = slope + on * bend
        q = self.course.q[piece] + on * (slope + 0.5 * on * bend)
        return q, here * speed, here * pull[:, None] + bend * speed**2

    def q_at(self, t: Array) -> Array:
        """Configurations (m, dof) [rad] at times (m,) [s]."""
        _, _, _, on, piece = self._places(t)
        course = self.course
        return np.asarray(course.q[piece] + on * (course.slope[piece] + 0.5 * on * course.bend[piece]))

    def _places(self, t: Array) -> tuple[NDArray[np.intp], Array, Array, Array, NDArray[np.int64]]:
        """At times (m,) [s]: the interval of the grid, the time since its beginning, the acceleration of the place.

        And how far it is (m, 1) on its line or parabola, and which that is.
        """
        i = np.clip(np.searchsorted(self.t, t, side="right") - 1, 0, len(self.t) - 2)
        gone = t - self.t[i]
        pull = (np.diff(self.speed) / np.diff(self.t))[i]
        place = np.clip(self.s[i] + gone * (self.speed[i] + 0.5 * gone * pull), self.s[i], self.s[i + 1])
        piece = self.piece[i]
        return i, gone, pull, (place - self.course.s[piece])[:, None], piece


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
