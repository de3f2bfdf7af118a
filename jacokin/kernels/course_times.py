"""The least time from rest along a way whose corners are cut: its lines and parabolas, and how fast these are passed.

See `motion.free_motion.timed_course` for what a course is, and `speeds` for how speeds are found. On lines and
parabolas the limits of an interval are linear functions of its place, so those at both ends are all.
"""

from __future__ import annotations

import math
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.free_motion.corners import STRAIGHT
from jacokin.kernels.speeds import STILL, SpeedWork, fit_speeds, make_speed_work

USED = 1.0 - 1e-9  # of limits; what remains is for rounding
GRID = 0.02  # [s] between places, at least
ON_CURVE = 12  # pieces of a parabola
ON_LINE = 24  # pieces of a line at most
MOST_PLACES = ON_LINE + 3  # of a line, with where full speed is reached and left, and its middle
SAME = 1e-9  # [s] places that are nearer to each other are one
#: Where the counts are: joints, points of the way; filled in are lines and parabolas, and places where it stands still.
CourseInteger = IntEnum("CourseInteger", "JOINTS POINTS PIECES STOPS COUNT", start=0)


class CourseWork(NamedTuple):
    """What a call reads and writes; arrays may have more room."""

    counts: NDArray[np.int64]  # (COURSE_INTEGERS,)
    way: Array  # (points dof,) lines from one to the next, no two in a row equal [rad]
    cuts: Array  # (points,) how much is cut off on both sides of a corner [s] at full speed; 0 where it stays
    full: Array  # (dof,) full speed [rad/s]
    velocity: Array  # (dof,) limits [rad/s]
    acceleration: Array  # (dof,) limits [rad/s^2]
    end: Array  # (1,) ds/dt at the last place, at most
    ends: Array  # (pieces + 1,) filled in: where each begins, and the end [s] at full speed
    at: Array  # (pieces dof,) configuration at the beginning of each [rad]
    slope: Array  # (pieces dof,) dq/ds there
    bend: Array  # (pieces dof,) d2q/ds2, zero on lines
    stops: Array  # (stops,) places where it stands still
    s: Array  # (places,)
    t: Array  # (places,) when each is passed [s]
    speed: Array  # (places,) ds/dt there
    piece: NDArray[np.int64]  # (places,) the number of the line or parabola that begins there, or goes on
    speeds: SpeedWork


def make_course_work(dof: int = 0, points: int = 0) -> CourseWork:
    """Fresh work arrays for a way of so many points."""
    pieces, ends, places = (2 * points, 2 * points + 1, 2 * points * MOST_PLACES + 1) if points else (0, 0, 0)
    s, t, speed = np.zeros((3, places))
    return CourseWork(
        np.zeros(CourseInteger.COUNT, np.int64),
        np.zeros(points * dof),
        np.zeros(points),
        np.zeros(dof),
        np.zeros(dof),
        np.zeros(dof),
        np.zeros(1),
        np.zeros(ends),
        np.zeros(pieces * dof),
        np.zeros(pieces * dof),
        np.zeros(pieces * dof),
        np.zeros(ends),
        s,
        t,
        speed,
        np.zeros(places, np.int64),
        make_speed_work(2 * dof, places),
    )


def fit_course_times(work: CourseWork) -> int:
    """Fill lines and parabolas, places, times and speeds; returns how many places there are."""
    lay_course(work)
    count, dof = lay_grid(work), work.counts[CourseInteger.JOINTS]
    speeds = work.speeds
    speeds.counts[0], speeds.counts[1] = count - 1, 2 * dof
    largest = 0.0
    for i in range(count):
        speeds.top[i] = 0.0 if stands(work, work.s[i]) else math.inf
    for i in range(count - 1):
        at, on = work.piece[i] * dof, work.s[i] - work.ends[work.piece[i]]
        h, own = work.s[i + 1] - work.s[i], math.inf
        speeds.lengths[i] = h
        for j in range(dof):
            bend = work.bend[at + j]
            first = work.slope[at + j] + on * bend
            last = first + h * bend
            steep = max(abs(first), abs(last))
            if steep * math.sqrt(own) > work.velocity[j]:
                own = (work.velocity[j] / steep) ** 2
            if abs(bend) * own > work.acceleration[j]:
                own = work.acceleration[j] / abs(bend)
            # How a joint's acceleration changes with that of the place, at both ends; there x is 2 h u larger.
            later = last + 2.0 * h * bend
            speeds.high[2 * dof * i + j], speeds.high[2 * dof * i + dof + j] = first, later
            speeds.tilt[2 * dof * i + j] = bend
            largest = max(largest, abs(first), abs(later))
        speeds.top[i], speeds.top[i + 1] = min(speeds.top[i], own), min(speeds.top[i + 1], own)
    for i in range(count - 1):
        limit(work, i, dof, 1e-9 * largest)  # a joint that changes less with the place limits nothing
    speeds.top[0], speeds.top[count - 1] = 0.0, min(speeds.top[count - 1], work.end[0] ** 2)
    fit_speeds(speeds)
    work.t[0] = 0.0
    for i in range(count):
        work.speed[i] = math.sqrt(speeds.x[i])
        if i > 0:
            whole = 2.0 * speeds.lengths[i - 1] / max(work.speed[i - 1] + work.speed[i], STILL)
            work.t[i] = work.t[i - 1] + whole
    return count


def limit(work: CourseWork, i: int, dof: int, least: float) -> None:
    """Turn the rates of an interval, and how much each joint's slope bends, into its limits."""
    speeds = work.speeds
    for j in range(dof):
        bend = speeds.tilt[2 * dof * i + j]
        for k in range(2 * dof * i + j, 2 * dof * (i + 1), dof):
            rate = speeds.high[k]
            if abs(rate) > least:
                speeds.high[k] = work.acceleration[j] / abs(rate)
                speeds.tilt[k] = bend / rate
            else:
                speeds.high[k], speeds.tilt[k] = math.inf, 0.0


def lay_course(work: CourseWork) -> None:
    """Fill lines and parabolas, and where the motion stands still: at its ends, and at corners that are not cut."""
    counts, dof, way, full = work.counts, work.counts[CourseInteger.JOINTS], work.way, work.full
    piece, stops, place = 0, 0, 0.0
    for line in range(counts[CourseInteger.POINTS] - 1):
        length, sharp, cut = 0.0, 0.0, work.cuts[line]
        for j in range(dof):
            length = max(length, abs(way[(line + 1) * dof + j] - way[line * dof + j]) / full[j])
        own = piece + 1 if cut > 0.0 else piece
        for j in range(dof):
            k, m = line * dof + j, own * dof + j
            slope = (way[k + dof] - way[k]) / length
            work.at[m], work.slope[m], work.bend[m] = way[k] + cut * slope, slope, 0.0
            if line > 0:
                m = piece * dof + j
                last = work.slope[m - dof]
                sharp = max(sharp, abs(slope - last) / full[j])
                if cut > 0.0:
                    work.at[m], work.slope[m], work.bend[m] = way[k] - cut * last, last, (slope - last) / (2.0 * cut)
        work.ends[piece] = place
        if cut > 0.0:
            place += 2.0 * cut
            work.ends[own] = place
        elif line == 0 or sharp >= STRAIGHT:
            work.stops[stops] = place
            stops += 1
        place += length - cut - work.cuts[line + 1]
        piece = own + 1
    work.ends[piece] = place
    if work.end[0] == 0.0:
        work.stops[stops] = place
        stops += 1
    counts[CourseInteger.PIECES], counts[CourseInteger.STOPS] = piece, stops


def lay_grid(work: CourseWork) -> int:
    """Fill places on all lines and parabolas, and which of them follows each; returns how many places there are."""
    count, dof, s = 0, work.counts[CourseInteger.JOINTS], work.s
    for piece in range(work.counts[CourseInteger.PIECES]):
        low, high, begin = work.ends[piece], work.ends[piece + 1], count
        curved, fast, gain = False, math.inf, math.inf
        for j in range(dof):
            size = max(abs(work.slope[piece * dof + j]), STILL)
            fast, gain = min(fast, work.velocity[j] / size), min(gain, work.acceleration[j] / size)
            curved = curved or work.bend[piece * dof + j] != 0.0
        parts = min(max(math.ceil((high - low) / GRID), 2), ON_CURVE if curved else ON_LINE)
        for k in range(parts):
            s[count] = low + (high - low) * k / parts
            count += 1
        if not curved:
            run = 0.5 * fast * fast / gain  # from rest to full speed
            count = insert(s, begin, count, 0.5 * (low + high), low, high)
            if stands(work, low):
                count = insert(s, begin, count, low + run, low, high)
            if stands(work, high):
                count = insert(s, begin, count, high - run, low, high)
        for k in range(begin, count):
            work.piece[k] = piece
    s[count] = work.ends[work.counts[CourseInteger.PIECES]]
    work.piece[count] = work.counts[CourseInteger.PIECES] - 1
    return count + 1


def stands(work: CourseWork, place: float) -> bool:
    """Whether the motion stands still at a place."""
    found = False
    for k in range(work.counts[CourseInteger.STOPS]):
        found = found or abs(work.stops[k] - place) <= STILL
    return found


def insert(s: Array, begin: int, count: int, place: float, low: float, high: float) -> int:
    """Insert a place among those from `begin` to `count` where it is within a line and none is there; the new count."""
    if not low + SAME < place < high - SAME:
        return count
    at = count
    while at > begin and s[at - 1] > place:
        at -= 1
    if place - s[at - 1] <= SAME or (at < count and s[at] - place <= SAME):
        return count
    for k in range(count, at, -1):
        s[k] = s[k - 1]
    s[at] = place
    return count + 1
