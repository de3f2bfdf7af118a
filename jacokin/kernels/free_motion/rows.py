"""The rows of a way, and how long it takes, from stop to stop within limits of velocity, acceleration and jerk.

A section is one line, or some lines with all corners between them cut. A line takes the least time in whole ticks. Cut
corners are passed by a timed course, whose accelerations jump, averaged over so much time that the jerk is limited,
too (`motion_rows`). That leaves lines as they are, and cuts corners a little more: there it is looked at for contact.
A corner where something would touch is cut less, until the arm stands still there, as it does at all of them where that
is quicker.
"""

from __future__ import annotations

import math
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.course_times import USED, CourseInteger, CourseWork, fit_course_times, make_course_work, stands
from jacokin.kernels.free_motion.corners import CHORD, CORNER_TRIES, LARGEST_CUT
from jacokin.kernels.free_motion.shortcuts import Way, WayInteger
from jacokin.kernels.free_motion.sight import Sight, moves_clear
from jacokin.kernels.free_motion.space import Space
from jacokin.kernels.motion_rows import AverageWork, SampleWork, average_rows, sample_course, ticks_averaged
from jacokin.kernels.rest_to_rest import LONGEST, NEVER, RestWork, fit_line, make_rest_work

WHOLE_TICK = 1e-9  # a duration this near to whole ticks is whole; division rounds
CUT_LESS = -1  # ticks of a section that is to be written again
#: The options' numbers: time from row to row [s], and how many times as long the motion is to take.
RowNumber = IntEnum("RowNumber", "DT SLOWER COUNT", start=0)


class RowWork(NamedTuple):
    """What is read and written to write rows; arrays may have more room."""

    numbers: Array  # (ROW_NUMBERS,)
    limits: Array  # (3 dof,) of velocity, acceleration and jerk of each joint in turn; infinite for none
    course: CourseWork  # of one section, within slightly less than these limits
    counts: NDArray[np.int64]  # (3,) of what samples, and of what averages
    span: Array  # (1,) [s]
    lower: Array  # (dof,) of what a section passes [rad]
    upper: Array  # (dof,)
    taken: Array  # (rows dof,) of its course [rad]
    rest: RestWork  # of one line; its rows are those of the way


def make_row_work(dof: int = 0, points: int = 0, rows: int = 0) -> RowWork:
    """Fresh work arrays for a way of so many points, and so many rows."""
    lower, upper = np.zeros((2, dof))
    limits, course = np.full(3 * dof, np.inf), make_course_work(dof, points)
    counts, taken, rest = np.zeros(3, np.int64), np.zeros(rows * dof), make_rest_work(dof, rows)
    return RowWork(np.ones(RowNumber.COUNT), limits, course, counts, np.zeros(1), lower, upper, taken, rest)


def duration_of(work: RowWork, way: Way, cuts: Array, space: Space) -> float:
    """About what a way takes, corners passed [s]; exact without limits of jerk, and for lines with full speed."""
    total, begin, change, t = 0.0, 0.0, change_of(work, len(space.speed)), work.course.t
    if way.integers[WayInteger.POINTS] < 2:
        return total
    for i in range(1, fit_section(work, way, cuts, space, 0, way.integers[WayInteger.POINTS] - 1)):
        if stands(work.course, work.course.s[i]):
            taken, begin = t[i] - begin, t[i]
            slower = slower_by(taken, change)
            total += slower * taken + change / (slower * slower)
    return total


def write_way(work: RowWork, way: Way, cuts: Array, space: Space, sight: Sight) -> int:
    """Fill in the rows of a way that begins and ends at rest; the cuts of corners where something touches get less.

    Returns:
        How many there are, or `NEVER`. Where that is more than there is room for, some are missing, and it may be more.
    """
    first, row, dof, dt, slower = 0, 0, len(space.speed), work.numbers[RowNumber.DT], work.numbers[RowNumber.SLOWER]
    for j in range(dof):
        for k in range(3):
            work.rest.limits[3 * j + k] = work.limits[3 * j + k] / slower ** (k + 1)
    work.rest.counts[0], work.rest.dt[0] = dof, dt
    while first < way.integers[WayInteger.POINTS] - 1:
        last = first + 1
        while cuts[last] > 0.0:
            last += 1
        ticks = write_section(work, way, cuts, space, sight, (first, last), row)
        if ticks >= LONGEST:
            return NEVER
        if ticks != CUT_LESS:
            first, row = last, row + ticks
    return row + 1


def write_section(
    work: RowWork, way: Way, cuts: Array, space: Space, sight: Sight, points: tuple[int, int], row: int
) -> int:
    """Fill in the rows of a section between two points of the way; returns ticks, or `CUT_LESS`."""
    first, last, dof, dt = points[0], points[1], len(space.speed), work.rest.dt[0]
    slower = work.numbers[RowNumber.SLOWER]
    if last == first + 1:
        return write_lines(work, way, dof, points, row)
    places = fit_section(work, way, cuts, space, first, last)
    duration, change = work.course.t[places - 1], change_of(work, dof)
    if change == 0.0:
        return write_course(work, way, dof, places, points, row, slower)
    stopping = write_lines(work, way, dof, points, row)
    slower *= slower_by(slower * duration, 2.0 * slower * change)
    if slower * duration >= stopping * dt:
        return stopping
    ticks = write_course(work, way, dof, places, points, row, slower)
    if ticks >= stopping:
        return write_lines(work, way, dof, points, row)
    if (row + ticks + 1) * dof > len(work.taken):
        return ticks
    touching = first_touching(work, space, sight, places, row, ticks)
    if touching < 0:
        return ticks
    corner = first + nearest_corner(work, places, (touching - 0.5 * work.counts[2]) * dt / slower)
    cuts[corner] *= 0.5
    if cuts[corner] < least_cut(way, space, dof, corner):
        cuts[corner] = 0.0
    return CUT_LESS


def write_lines(work: RowWork, way: Way, dof: int, points: tuple[int, int], row: int) -> int:
    """Fill in the rows of lines with stops between them; returns ticks."""
    rest, total = work.rest, 0
    for line in range(points[0], points[1]):
        for j in range(dof):
            rest.start[j], rest.end[j] = way.q[line * dof + j], way.q[(line + 1) * dof + j]
        q, v, a = rows_from(work, (row + total) * dof)
        ticks = fit_line(
            RestWork(rest.counts, rest.dt, rest.start, rest.end, rest.limits, rest.shares, rest.ticks, q, v, a)
        )
        if ticks >= LONGEST:
            return NEVER
        total += ticks
    return total


def write_course(
    work: RowWork, way: Way, dof: int, places: int, points: tuple[int, int], row: int, slower: float
) -> int:
    """Fill in the averages of the course of a section, taken so many times as slowly; returns ticks."""
    course, counts, limits, dt = work.course, work.counts, work.rest.limits, work.rest.dt
    work.span[0] = course.t[places - 1]
    if slower * work.span[0] / dt[0] > LONGEST:
        return NEVER
    steps = max(1, math.ceil(slower * work.span[0] / dt[0] - WHOLE_TICK))
    if (row + steps + 3) * dof > len(work.taken):
        return int(steps + 2)
    for j in range(dof):
        work.lower[j] = work.upper[j] = way.q[points[0] * dof + j]
        for k in range(points[0] + 1, points[1] + 1):
            work.lower[j] = min(work.lower[j], way.q[k * dof + j])
            work.upper[j] = max(work.upper[j], way.q[k * dof + j])
    counts[0], counts[1], counts[2] = dof, steps + 1, places
    at, slope, bend = course.at, course.slope, course.bend
    t, s, speed, piece, begins = course.t, course.s, course.speed, course.piece, course.ends
    lower, upper, taken = work.lower, work.upper, work.taken
    sample_course(SampleWork(counts, work.span, t, s, speed, piece, begins, at, slope, bend, lower, upper, taken))
    counts[2] = ticks_averaged(taken, dof, steps + 1, limits, dt[0])
    ticks = steps + counts[2] + 1
    if (row + ticks + 1) * dof > len(work.taken):
        return int(ticks)
    q, v, a = rows_from(work, row * dof)
    average_rows(AverageWork(counts, dt, taken, q, v, a))
    for j in range(dof):  # but for rounding
        q[j], q[ticks * dof + j] = way.q[points[0] * dof + j], way.q[points[1] * dof + j]
    return int(ticks)


def rows_from(work: RowWork, at: int) -> tuple[Array, Array, Array]:
    """Positions, velocities and accelerations of the rows of the way, the first ones left out."""
    return work.rest.q[at:], work.rest.v[at:], work.rest.a[at:]


def fit_section(work: RowWork, way: Way, cuts: Array, space: Space, first: int, last: int) -> int:
    """Fit the course from one point of the way to another, at rest at both; returns its places."""
    course, dof = work.course, len(space.speed)
    for j in range(dof):
        course.full[j] = space.speed[j]
        course.velocity[j], course.acceleration[j] = USED * work.limits[3 * j], USED * work.limits[3 * j + 1]
    for k in range(first, last + 1):
        course.cuts[k - first] = cuts[k]
        for j in range(dof):
            course.way[(k - first) * dof + j] = way.q[k * dof + j]
    course.counts[CourseInteger.JOINTS], course.counts[CourseInteger.POINTS] = dof, last - first + 1
    course.end[0] = 0.0
    return fit_course_times(course)


def change_of(work: RowWork, dof: int) -> float:
    """How long an acceleration takes from zero to its limit [s]."""
    most = 0.0
    for j in range(dof):
        if work.limits[3 * j + 2] < math.inf:
            most = max(most, work.limits[3 * j + 1] / work.limits[3 * j + 2])
    return most


def slower_by(course: float, averaged: float) -> float:
    """How many times as long a course should take, so that it and the time over which it is averaged are least in sum.

    Accelerations fall with the square of that, and with them the time over which to average.

    Args:
        course: what it takes [s].
        averaged: over how much time it would have to be averaged then [s].
    """
    return float(max(1.0, (2.0 * averaged / course) ** (1.0 / 3.0)))


def first_touching(work: RowWork, space: Space, sight: Sight, places: int, row: int, steps: int) -> int:
    """The first step of a section that was averaged and leaves its lines on which something could touch; -1 if none."""
    dof, dt, averaged = len(space.speed), work.rest.dt[0], work.counts[2]
    q, a, reach, last = work.rest.q[row * dof :], work.rest.a[row * dof :], 0.0, steps - averaged - 1
    for j in range(dof):
        most = 0.0
        for k in range(steps + 1):
            most = max(most, abs(a[k * dof + j]))
        reach += 0.125 * dt * dt * most * space.levers[j]  # of one step [m]
    at_once = max(1, int(math.sqrt(CHORD / max(reach, 1e-8 * CHORD))))
    step = 0
    while step < steps:
        if not leaves_lines(work, dof, places, max(step - 1 - averaged, 0), min(step + 1, last), last):
            step += 1
            continue
        after = min(step + at_once, steps)
        extra = reach * (after - step) ** 2
        if not moves_clear(sight, q[step * dof : (step + 1) * dof], q[after * dof : (after + 1) * dof], extra):
            return step
        step = after
    return -1


def leaves_lines(work: RowWork, dof: int, places: int, first: int, then: int, last: int) -> bool:
    """Whether more than one line is passed between two of the configurations that were taken of a course."""
    course = work.course
    span = course.t[places - 1] / max(last, 1)
    piece = course.piece[place_at(course.t, places, first * span)]
    leaves = piece != course.piece[place_at(course.t, places, then * span)]
    for j in range(dof):
        leaves = leaves or course.bend[piece * dof + j] != 0.0
    return bool(leaves)


def place_at(values: Array, count: int, value: float) -> int:
    """The last of some rising values, the end left out, that is at most as large."""
    low, high = 0, count - 2
    while low < high:
        middle = (low + high + 1) // 2
        if values[middle] <= value:
            low = middle
        else:
            high = middle - 1
    return low


def nearest_corner(work: RowWork, places: int, time: float) -> int:
    """The number of the corner of a course whose middle is passed at a time that is nearest to one."""
    course, found, best = work.course, 1, math.inf
    for corner in range(1, course.counts[CourseInteger.POINTS] - 1):
        middle = 0.5 * (course.ends[2 * corner - 1] + course.ends[2 * corner])
        i = place_at(course.s, places, middle)
        share = (middle - course.s[i]) / (course.s[i + 1] - course.s[i])
        away = abs(course.t[i] + share * (course.t[i + 1] - course.t[i]) - time)
        if away < best:
            found, best = corner, away
    return found


def least_cut(way: Way, space: Space, dof: int, corner: int) -> float:
    """What is cut off a corner at least, or nothing of it [s]."""
    shorter = math.inf
    for line in range(corner - 1, corner + 1):
        length = 0.0
        for j in range(dof):
            length = max(length, abs(way.q[(line + 1) * dof + j] - way.q[line * dof + j]) / space.speed[j])
        shorter = min(shorter, length)
    return LARGEST_CUT * 0.5**CORNER_TRIES * shorter
