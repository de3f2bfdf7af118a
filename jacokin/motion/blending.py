"""Time for a way of straight joint motions: through its corners without stopping, within limits at every instant.

Each corner is cut by a parabola that begins and ends in the direction of its lines (`Course`). Along a way of lines and
parabolas the joints' accelerations are linear functions of the place while the place's own acceleration is constant,
so limits that hold at both ends of a piece hold all along it: what the passes of TOPP-RA (see `timing`) find on their
grid is valid between its points, too. From rest to rest.

A place s counts time at full speed [s]: no joint can be at s + ds sooner than ds after s.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from jacokin.arrays import Array

LARGEST_CUT = 0.45  # of the shorter of two lines is cut off at their corner
CORNER_TRIES = 5  # each cuts half as much
STRAIGHT = 1e-9  # a corner whose directions differ by less is none
GRID = 0.02  # [s] between places, at least
ON_CURVE = 12  # pieces of a parabola
ON_LINE = 24  # pieces of a line at most
USED = 1.0 - 1e-9  # of the limits; what remains is for rounding
STILL = 1e-12


@dataclass(frozen=True, slots=True)
class Course:
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


def round_corners(way: Array, velocity: Array, is_clear: Callable[[Array, Array], bool]) -> tuple[Course, Array]:
    """A course along a way (n, dof) [rad] that cuts its corners, and the places (m,) where it must stop.

    Args:
        way: configurations, no two in a row equal; at least two.
        velocity: (dof,) limits [rad/s].
        is_clear: whether the parabola from a corner's line, given by its (3, dof) control points, is clear; its second
            argument is (dof,) dq from one end to the other.
    """
    steps = np.diff(way, axis=0)
    lengths = (np.abs(steps) / velocity).max(axis=1)
    slopes = steps / lengths[:, None]
    cut = np.zeros(len(way))
    stops = [0.0]
    for corner in range(1, len(way) - 1):
        turn = slopes[corner] - slopes[corner - 1]
        if np.abs(turn / velocity).max() < STRAIGHT:
            continue
        size = LARGEST_CUT * float(min(lengths[corner - 1], lengths[corner]))
        for _ in range(CORNER_TRIES):
            ends = way[corner] - size * slopes[corner - 1], way[corner] + size * slopes[corner]
            if is_clear(np.array([ends[0], way[corner], ends[1]]), np.abs(turn) * size):
                cut[corner] = size
                break
            size *= 0.5
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
    return Course(np.array(s), np.array(q), np.array(slope), np.array(bend)), np.array([*stops, s[-1]])


@dataclass(frozen=True, slots=True)
class TimedCourse:
    """A course and when each place of it is passed; between neighbours of a grid, places accelerate steadily.

    Attributes:
        course: the lines and parabolas.
        s: (n,) places, all ends of lines and parabolas among them.
        t: (n,) times [s].
        speed: (n,) ds/dt there.
    """

    course: Course
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


def fit_time(course: Course, stops: Array, velocity: Array, acceleration: Array) -> TimedCourse:
    """The least time from rest to rest along a course, on a grid.

    Args:
        course: lines and parabolas.
        stops: (m,) places where it stands still, both ends among them.
        velocity: (dof,) limits [rad/s].
        acceleration: (dof,) limits [rad/s^2].
    """
    s, piece = _grid(course, stops, velocity, acceleration)
    on = np.stack([s[:-1] - course.s[piece], s[1:] - course.s[piece]])[:, :, None]
    slope = course.slope[piece] + on * course.bend[piece]  # (2, n, dof) at both ends of each interval
    bend, limit = course.bend[piece], USED * acceleration
    h = np.diff(s)
    with np.errstate(divide="ignore"):
        fastest = (USED * velocity / np.abs(slope).max(axis=0)).min(axis=1) ** 2
        turning = (limit / np.abs(bend)).min(axis=1)
    top = np.full(len(s), np.inf)
    np.minimum(top[:-1], np.minimum(fastest, turning), out=top[:-1])
    np.minimum(top[1:], np.minimum(fastest, turning), out=top[1:])
    top[np.isclose(s[:, None], stops, rtol=0.0, atol=1e-12).any(axis=1)] = 0.0
    x = _fastest(h, slope, bend, limit, top)
    speed = np.sqrt(x)
    times = 2.0 * h / np.maximum(speed[:-1] + speed[1:], STILL)
    return TimedCourse(course, s, np.append(0.0, np.cumsum(times)), speed)


def _grid(course: Course, stops: Array, velocity: Array, acceleration: Array) -> tuple[Array, np.ndarray]:
    """Places (n,), and the line or parabola (n - 1,) that lies between each two."""
    places: list[Array] = []
    pieces: list[int] = []
    for piece, (low, high) in enumerate(zip(course.s[:-1].tolist(), course.s[1:].tolist(), strict=True)):
        straight = not course.bend[piece].any()
        count = int(np.clip(np.ceil((high - low) / GRID), 2, ON_LINE if straight else ON_CURVE))
        inner = low + (high - low) * np.arange(count) / count
        if straight:  # where full speed is reached from rest, or left
            size = np.abs(course.slope[piece])
            gain = float((acceleration / np.maximum(size, STILL)).min())
            run = 0.5 * float((velocity / np.maximum(size, STILL)).min()) ** 2 / gain
            marks = [end + sign * run for end, sign in ((low, 1.0), (high, -1.0)) if np.isclose(stops, end).any()]
            marks += [0.5 * (low + high)]
            inner = np.unique(np.concatenate([inner, [mark for mark in marks if low < mark < high]]))
            inner = inner[np.append(True, np.diff(inner) > 1e-9)]
        places.append(inner)
        pieces += [piece] * len(inner)
    return np.append(np.concatenate(places), course.s[-1]), np.array(pieces, dtype=np.intp)


def _fastest(h: Array, slope: Array, bend: Array, limit: Array, top: Array) -> Array:
    """The largest squared speeds (n,), by a pass backward that finds what can be followed, and one forward.

    With x = speed^2 at the beginning of an interval and u the acceleration on it, a joint's acceleration is
    slope u + bend x there, and slope u + bend (x + 2 h u) at the end: linear in both.
    """
    n = len(h)
    reach = top.copy()
    rate = np.concatenate([slope[0], slope[1] + 2.0 * h[:, None] * bend], axis=1)  # (n, 2 dof) of u
    pull = np.concatenate([bend, bend], axis=1)  # of x
    bound = np.concatenate([limit, limit])
    size = np.abs(rate)
    counts = size > 1e-9 * np.abs(rate).max()
    safe = np.where(counts, size, 1.0)
    high = np.where(counts, bound / safe, np.inf)  # u <= high - tilt x, u >= -high - tilt x
    tilt = np.where(counts, np.sign(rate) * pull / safe, 0.0)
    for i in range(n - 1, -1, -1):
        reach[i] = min(reach[i], _controllable(high[i], tilt[i], 0.5 / h[i], reach[i + 1]))
    x = np.zeros(n + 1)
    for i in range(n):
        u = float((high[i] - tilt[i] * x[i]).min())
        x[i + 1] = max(min(reach[i + 1], x[i] + 2.0 * h[i] * u), 0.0)
    return x


def _controllable(high: Array, tilt: Array, half: float, ahead: float) -> float:
    """The largest x from which some u leads to an x of at most `ahead`, and of no less than zero.

    Every lower bound of u must stay below every upper one; both are linear in x.
    """
    finite = np.isfinite(high)
    above, below = high[finite], -high[finite]
    tilts = tilt[finite]
    upper = np.append(above, half * ahead), np.append(-tilts, -half)
    lower = np.append(below, 0.0), np.append(-tilts, -half)
    room = upper[0][:, None] - lower[0]
    growing = lower[1] - upper[1][:, None]
    bounded = growing > STILL
    return float((room[bounded] / growing[bounded]).min()) if bounded.any() else np.inf
