"""A way of straight lines in sections from rest to rest, and their rows within limits of velocity, acceleration, jerk.

A section is one line, or some lines with all corners between them cut. A line takes the least time in whole steps. Cut
corners are passed by the course of `motion.blending`, whose accelerations jump, averaged over so much time that the
jerk is limited, too (`rows.averaged_rows`). That leaves lines as they are, and cuts corners a little more: there it is
looked at for contact, and the arm stands still at a corner where something would touch, or at all where that is
quicker.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.free_motion.corners import CHORD, CORNER_TRIES, LARGEST_CUT
from jacokin.model.contact import Contact
from jacokin.motion.blending import TimedCourse, fit_time
from jacokin.motion.joint_motion import rest_to_rest
from jacokin.motion.rows import Limits, Rows, averaged_rows
from jacokin.motion.timing import BETWEEN, MOST_PLACES, steps_of


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
        rows, ticks = averaged_rows(self.timed.sampled(steps_of(slower * self.timed.duration, dt)), dt, jerk)
        rows.q.clip(self.way.min(axis=0), self.way.max(axis=0), out=rows.q)
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
