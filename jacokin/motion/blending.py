"""Time for a way of straight joint motions: through its corners without stopping, within limits at every instant.

Each corner is cut by a parabola that begins and ends in the direction of its lines (`BlendedCourse`). Along lines and
parabolas the joints' accelerations are linear functions of the place while the place's own acceleration is constant,
so limits that hold at both ends of a piece hold all along it: what the passes of TOPP-RA (see `timing`) find on their
grid is valid between its points, too. From rest to rest.

A place s counts time at full speed [s]: no joint can be at s + ds sooner than ds after s.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from jacokin.arrays import Array
from jacokin.kernels.free_motion.corners import STRAIGHT
from jacokin.motion.timing import fit_course

GRID = 0.02  # [s] between places, at least
ON_CURVE = 12  # pieces of a parabola
ON_LINE = 24  # pieces of a line at most
USED = 1.0 - 1e-9  # of the limits; what remains is for rounding
STILL = 1e-12


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
    """

    course: BlendedCourse
    s: Array
    t: Array
    speed: Array

    @property
    def duration(self) -> float:
        """From start to end [s]."""
        return float(self.t[-1])

    def at(self, t: Array) -> tuple[Array, Array, Array]:
        """Configurations (m, dof) [rad], velocities [rad/s] and accelerations [rad/s^2] at times (m,) [s]."""
        i = np.clip(np.searchsorted(self.t, t, side="right") - 1, 0, len(self.t) - 2)
        gone, whole = t - self.t[i], self.t[i + 1] - self.t[i]
        pull = (self.speed[i + 1] - self.speed[i]) / whole
        place = np.clip(self.s[i] + gone * (self.speed[i] + 0.5 * gone * pull), self.s[i], self.s[i + 1])
        speed = np.clip(self.speed[i] + gone * pull, 0.0, None)[:, None]
        piece = np.clip(np.searchsorted(self.course.s, 0.5 * (self.s[i] + self.s[i + 1]), side="right") - 1, 0, None)
        on = (place - self.course.s[piece])[:, None]
        start, slope, bend = self.course.q[piece], self.course.slope[piece], self.course.bend[piece]
        here = slope + on * bend
        return start + on * (slope + 0.5 * on * bend), here * speed, here * pull[:, None] + bend * speed**2


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
    if len(course.q) == 1 and end == 0.0:
        return _fit_line(course, velocity, acceleration)
    s, piece = _grid(course, stops, velocity, acceleration)
    on = np.stack([s[:-1] - course.s[piece], s[1:] - course.s[piece]])[:, :, None]
    slope = course.slope[piece] + on * course.bend[piece]
    top = np.where((np.abs(s[:, None] - stops) <= STILL).any(axis=1), 0.0, np.inf)
    found = fit_course(s, slope, USED * velocity, USED * acceleration, top, end)
    return TimedCourse(course, s, found.t, found.speed)


def _fit_line(course: BlendedCourse, velocity: Array, acceleration: Array) -> TimedCourse:
    """The least time along one line: as fast as possible up to full speed or half way, and down again."""
    length, size = float(course.s[-1]), np.maximum(np.abs(course.slope[0]), STILL)
    full, gain = USED * float((velocity / size).min()), USED * float((acceleration / size).min())
    run = min(0.5 * full * full / gain, 0.5 * length)
    top = float(np.sqrt(2.0 * gain * run))
    half = 2.0 * run / top
    if 2.0 * run == length:
        return TimedCourse(
            course, np.array([0.0, run, length]), np.array([0.0, half, 2.0 * half]), np.array([0.0, top, 0.0])
        )
    rest = (length - 2.0 * run) / top
    s, t = [0.0, run, length - run, length], [0.0, half, half + rest, half + rest + half]
    return TimedCourse(course, np.array(s), np.array(t), np.array([0.0, top, top, 0.0]))


def _grid(course: BlendedCourse, stops: Array, velocity: Array, acceleration: Array) -> tuple[Array, np.ndarray]:
    """Places (n,), and the line or parabola (n - 1,) that lies between each two."""
    size = np.maximum(np.abs(course.slope), STILL)
    runs = 0.5 * (velocity / size).min(axis=1) ** 2 / (acceleration / size).min(axis=1)  # from rest to full speed
    curves = np.asarray(course.bend.any(axis=1))
    still, ends = stops.tolist(), course.s.tolist()
    places: list[float] = []
    pieces: list[int] = []
    for piece, (curved, run) in enumerate(zip(curves.tolist(), runs.tolist(), strict=True)):
        low, high = ends[piece], ends[piece + 1]
        count = min(max(math.ceil((high - low) / GRID), 2), ON_CURVE if curved else ON_LINE)
        inner = [low + (high - low) * k / count for k in range(count)]
        if not curved:  # where full speed is reached from rest, or left
            marks = [end + way for end, way in ((low, run), (high, -run)) if any(abs(s - end) <= STILL for s in still)]
            inner = sorted({*inner, *(mark for mark in (*marks, 0.5 * (low + high)) if low < mark < high)})
            inner = [low, *(there for here, there in pairwise(inner) if there - here > 1e-9)]
        places += inner
        pieces += [piece] * len(inner)
    return np.array([*places, ends[-1]]), np.array(pieces, dtype=np.intp)
