"""A way of straight lines in sections from rest to rest, and their rows within limits of velocity, acceleration, jerk.

A section is one line, or some lines with all corners between them cut. A line takes the least time in whole steps. Cut
corners are passed by a `TimedCourse`, whose accelerations jump, averaged over so much time that the jerk is limited,
too (`rows.averaged_rows`). That leaves lines as they are, and cuts corners a little more: there it is looked at for
contact, and the arm stands still at a corner where something would touch, or at all where that is quicker.

Each corner is cut by a parabola that begins and ends in the direction of its lines. Along lines and
parabolas the joints' accelerations are linear functions of the place while the place's own acceleration is constant,
so limits that hold at both ends of a piece hold all along it: what the passes of TOPP-RA (see `timing`) find on their
grid is valid between its points, too. From rest to rest.

A place s counts time at full speed [s]: no joint can be at s + ds sooner than ds after s.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.course_times import CourseInteger, fit_course_times, make_course_work
from jacokin.kernels.free_motion.corners import CHORD, CORNER_TRIES, LARGEST_CUT
from jacokin.kernels.library import Calls
from jacokin.kernels.motion_rows import make_sample_work, sample_course
from jacokin.model.contact import Contact
from jacokin.motion.joint_motion import rest_to_rest
from jacokin.motion.rows import Limits, Rows, averaged_rows
from jacokin.motion.timing import BETWEEN, MOST_PLACES, steps_of

_fit = Calls(fit_course_times, make_course_work, kept=500)  # corners
_sample = Calls(sample_course, make_sample_work, kept=20_000)  # rows


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

    def sampled(self, steps: int, way: Array) -> Array:
        """Configurations (steps + 1, dof) [rad] at equal steps of time from start to end.

        No joint is beyond the corners of the way (n, dof) by rounding.
        """
        (pieces, dof), places, rows = self.q.shape, len(self.t), steps + 1
        call = _sample.with_room(dof, rows, places)
        work = call.work
        work.counts[:], work.span[0] = (dof, rows, places), self.t[-1]
        work.lower[:dof], work.upper[:dof] = way.min(axis=0), way.max(axis=0)
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
    used = 1.0 - 1e-9  # of the limits; what remains is for rounding
    call = _fit.with_room(dof, points)
    work = call.work
    work.counts[CourseInteger.JOINTS], work.counts[CourseInteger.POINTS], work.end[0] = dof, points, end
    work.way[: points * dof], work.cuts[:points], work.full[:dof] = way.ravel(), cuts, full
    work.velocity[:dof], work.acceleration[:dof] = used * velocity, used * acceleration
    places = call()
    pieces = int(work.counts[CourseInteger.PIECES])
    q, slope, bend = (each[: pieces * dof].reshape(pieces, dof).copy() for each in (work.at, work.slope, work.bend))
    s, t, speed = (each[:places].copy() for each in (work.s, work.t, work.speed))
    return TimedCourse(work.ends[: pieces + 1].copy(), q, slope, bend, s, t, speed, work.piece[:places].copy())


@dataclass(frozen=True, eq=False)
class Section:
    """Part of a way from one stop to the next."""

    way: Array
    """(n, dof) corners, both ends included [rad]."""
    cuts: Array
    """(n,) how much of each is cut off, see `fit_time`; 0 at the ends alone."""
    speed: Array
    """(dof,) by which they are measured."""
    limits: Limits

    @cached_property
    def timed(self) -> TimedCourse:
        """The course, within the limits of velocity and acceleration."""
        return fit_time(self.way, self.cuts, self.speed, self.limits.velocity, self.limits.acceleration)

    @property
    def duration(self) -> float:
        """About what it takes, corners passed [s]; exact without limits of jerk, and for lines with full speed."""
        change, course = _change(self.limits), self.timed.duration
        slower = _slower(course, change)
        return slower * course + change / slower**2

    def states(self) -> tuple[Array, Array, Array]:
        """Angles, velocities and accelerations (m, dof), so near to each other that torques change little."""
        count = int(np.clip(np.ceil(self.timed.duration / BETWEEN), 2, MOST_PLACES))
        return self.timed.at(np.linspace(0.0, self.timed.duration, count + 1))

    def write(self, dt: float, slower: float, contact: Contact | None) -> list[Rows]:
        """Rows of motions from rest to rest, one after another.

        Args:
            dt: of the rows [s].
            slower: how many times as long it is to take.
            contact: what may not touch where corners are cut more; None where that is not looked at.
        """
        limits = self.limits.slowed(slower)
        if len(self.way) > 2 and limits.jerk is None:
            return [self._average(dt, slower, None)[0]]
        lines = [rest_to_rest(start, end, limits, dt, straight=True) for start, end in pairwise(self.way)]
        if len(lines) == 1:
            return lines
        stopping = sum(len(line.t) - 1 for line in lines)
        slower_course = slower * _slower(slower * self.timed.duration, 2.0 * _change(limits))
        if slower_course * self.timed.duration >= stopping * dt:
            return lines
        rows, ticks = self._average(dt, slower_course, limits.jerk)
        if len(rows.t) - 1 >= stopping:
            return lines
        if contact is None:
            return [rows]
        touching = _touching(rows, self._leaves_lines(len(rows.t) - 1, ticks), contact)
        if touching < 0:
            return [rows]
        middle = (touching - 0.5 * ticks) * dt / slower_course
        cuts, corner = self.cuts.copy(), 1 + int(np.argmin(np.abs(self._corner_times() - middle)))
        cuts[corner] *= 0.5
        if cuts[corner] < self._least_cut(corner):
            cuts[corner] = 0.0
        parts = make_sections(self.way, cuts, self.speed, self.limits)
        return [each for part in parts for each in part.write(dt, slower, contact)]

    def _average(self, dt: float, slower: float, jerk: Array | None) -> tuple[Rows, int]:
        """The course in rows that are averaged over ticks, and over how many."""
        taken = self.timed.sampled(steps_of(slower * self.timed.duration, dt), self.way)
        rows, ticks = averaged_rows(taken, dt, jerk)
        rows.q[0], rows.q[-1] = self.way[0], self.way[-1]  # but for rounding
        return rows, ticks

    def _leaves_lines(self, steps: int, ticks: int) -> NDArray[np.bool_]:
        """Whether the motion leaves the lines (steps,) that is averaged over ticks."""
        course, last = self.timed, steps - ticks - 1
        curved: NDArray[np.bool_] = np.asarray(course.bend.any(axis=1))
        begins = np.interp(course.begins, course.s, course.t)
        times = np.linspace(0.0, course.duration, last + 1)
        piece: NDArray[np.intp] = np.asarray(np.searchsorted(begins[1:-1], times, side="right"))
        step = np.arange(steps)
        first, then = piece[np.clip(step - 1 - ticks, 0, last)], piece[np.clip(step + 1, 0, last)]
        return np.asarray((first != then) | curved[first])

    def _least_cut(self, corner: int) -> float:
        """What is cut off a corner at least, or nothing of it, as by the kernel [s]."""
        lines = np.abs(np.diff(self.way[corner - 1 : corner + 2], axis=0)) / self.speed
        return LARGEST_CUT * 0.5**CORNER_TRIES * float(lines.max(axis=1).min())

    def _corner_times(self) -> Array:
        """When the middle of each cut corner is passed [s]."""
        course = self.timed
        curved = np.flatnonzero(course.bend.any(axis=1))
        return np.interp(0.5 * (course.begins[curved] + course.begins[curved + 1]), course.s, course.t)


def make_sections(way: Array, cuts: Array, speed: Array, limits: Limits) -> list[Section]:
    """Sections of a way (n, dof) [rad] without corners that are none, between those that are not cut, `cuts` (n,)."""
    stops = [0, *(1 + np.flatnonzero(cuts[1:-1] == 0.0)).tolist(), len(way) - 1]
    return [Section(way[a : b + 1], cuts[a : b + 1], speed, limits) for a, b in pairwise(stops)]


def _change(limits: Limits) -> float:
    """How long an acceleration takes from zero to its limit [s]."""
    return 0.0 if limits.jerk is None else float((limits.acceleration / limits.jerk).max())


def _slower(course: float, averaged: float) -> float:
    """How many times as long a course should take, so that it and the time over which it is averaged are least in sum.

    Accelerations fall with the square of that, and with them the time over which to average.

    Args:
        course: what it takes [s].
        averaged: over how much time it would have to be averaged then [s].
    """
    return max(1.0, math.cbrt(2.0 * averaged / course))


def _touching(rows: Rows, looked_at: NDArray[np.bool_], contact: Contact) -> int:
    """The first of some steps (n,) on which something could touch; -1 for none."""
    reach = float(np.abs(rows.a).max(axis=0) @ contact.levers) * 0.125 * float(rows.t[1]) ** 2  # of one step [m]
    at_once = max(1, int(math.sqrt(CHORD / max(reach, 1e-8 * CHORD))))
    step, count = 0, len(looked_at)
    while step < count:
        if not looked_at[step]:
            step += 1
            continue
        after = min(step + at_once, count)
        if contact.in_the_way(rows.q[step], rows.q[after], extra=reach * (after - step) ** 2) is not None:
            return step
        step = after
    return -1
