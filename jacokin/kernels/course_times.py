"""The least time from rest along lines and parabolas: a grid of places on them, and how fast each is passed.

See `motion.blending` for what a course is, and `speeds` for how speeds are found. On lines and parabolas the limits of
an interval are linear functions of its place, so those at both ends are all.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.speeds import SpeedWork, fit_speeds, make_speed_work

GRID = 0.02  # [s] between places, at least
ON_CURVE = 12  # pieces of a parabola
ON_LINE = 24  # pieces of a line at most
MOST_PLACES = ON_LINE + 3  # of a line, with where full speed is reached and left, and its middle
SAME = 1e-9  # [s] places that are nearer to each other are one
NO_RATE = 1e-9  # of the largest change of a joint's acceleration with that of the place: it limits nothing
STILL = 1e-12
#: Where the counts are: lines and parabolas, joints, and places where it stands still.
PIECES, JOINTS, STOPS, COURSE_INTEGERS = range(4)


class CourseWork(NamedTuple):
    """What a call reads and writes; arrays may have more room."""

    counts: NDArray[np.int64]  # (COURSE_INTEGERS,)
    ends: Array  # (pieces + 1,) where each begins, and the end [s] at full speed
    slope: Array  # (pieces dof,) dq/ds at the beginning of each
    bend: Array  # (pieces dof,) d2q/ds2, zero on lines
    stops: Array  # (stops,) places where it stands still
    velocity: Array  # (dof,) limits [rad/s]
    acceleration: Array  # (dof,) limits [rad/s^2]
    end: Array  # (1,) ds/dt at the last place, at most
    s: Array  # (places,)
    t: Array  # (places,) when each is passed [s]
    speed: Array  # (places,) ds/dt there
    piece: NDArray[np.int64]  # (places,) the number of the line or parabola that begins there, or goes on
    speeds: SpeedWork


def make_course_work(pieces: int = 0, dof: int = 0, stops: int = 0) -> CourseWork:
    """Fresh work arrays for so many lines and parabolas."""
    places = pieces * MOST_PLACES + 1 if pieces else 0
    s, t, speed = np.zeros((3, places))
    return CourseWork(
        np.zeros(COURSE_INTEGERS, np.int64),
        np.zeros(pieces + 1 if pieces else 0),
        np.zeros(pieces * dof),
        np.zeros(pieces * dof),
        np.zeros(stops),
        np.zeros(dof),
        np.zeros(dof),
        np.zeros(1),
        s,
        t,
        speed,
        np.zeros(places, np.int64),
        make_speed_work(places, 2 * dof),
    )


def fit_course_times(work: CourseWork) -> int:
    """Fill places, times and speeds; returns how many places there are."""
    count, dof = lay_grid(work), work.counts[JOINTS]
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
        limit(work, i, dof, NO_RATE * largest)
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


def lay_grid(work: CourseWork) -> int:
    """Fill places on all lines and parabolas, and which of them follows each; returns how many places there are."""
    count, dof, s = 0, work.counts[JOINTS], work.s
    for piece in range(work.counts[PIECES]):
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
    s[count] = work.ends[work.counts[PIECES]]
    work.piece[count] = work.counts[PIECES] - 1
    return count + 1


def stands(work: CourseWork, place: float) -> bool:
    """Whether the motion stands still at a place."""
    found = False
    for k in range(work.counts[STOPS]):
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
