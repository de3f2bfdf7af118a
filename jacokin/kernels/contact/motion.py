"""Straight joint motions: whether all of one is clear, and how near it comes to contact (conservative advancement)."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.contact.arm import Places, bound_rates, place_links
from jacokin.kernels.contact.nearest import ENTRY, GROUP, Finder, Search, find_nearest, list_all, room_of
from jacokin.kernels.contact.touching import Counts, Geometry

#: Parts of a motion that wait to be looked at; each is at most half of the one before, and none is shorter than what a
#: slack allows, so that there are never so many.
WAITING = 128
#: The least distance along a motion is known as well as asked for, and this part of itself.
RELATIVE_ACCURACY = 0.02


class Course(NamedTuple):
    """A straight motion, and what is known about it."""

    step: Array  # (dof,) from start to end [rad]
    q: Array  # (dof,) where it is looked at [rad]
    waiting: Array  # (WAITING, 2) parts of the motion, from 0 to 1
    spans: NDArray[np.int64]  # (WAITING, 2) where the rows of what can touch there begin and end
    near: NDArray[np.int64]  # (room, 4) these rows, see `list_all`
    rated: NDArray[np.int64]  # (groups,) 1 where the rates of a group are known
    found: Array  # (2,) least distance [m], and where: 0 at the start, 1 at the end
    pair: NDArray[np.int64]  # (2,) the nearest shapes there


def make_course(dof: int, groups: int, room: int) -> Course:
    """Fresh work arrays, with room for three times all that can touch, see `room_of`."""
    step, q = np.zeros((2, dof))
    spans, near = np.zeros((WAITING, 2), np.int64), np.zeros((3 * room, ENTRY), np.int64)
    rated = np.zeros(groups, np.int64)
    return Course(step, q, np.zeros((WAITING, 2)), spans, near, rated, np.zeros(2), np.zeros(2, np.int64))


def look_at(geometry: Geometry, counts: Counts, places: Places, course: Course, start: Array, at: float) -> None:
    """Place everything where the motion is at a share of its way."""
    for j in range(counts.dof):
        course.q[j] = start[j] + at * course.step[j]
    place_links(geometry.arm, counts.dof, counts.groups, course.q, places)


def await_all(geometry: Geometry, counts: Counts, course: Course) -> int:
    """Let all of a motion wait, with all that can touch; returns how many parts wait: one."""
    course.waiting[0, 0], course.waiting[0, 1] = 0.0, 1.0
    course.spans[0, 0], course.spans[0, 1] = 0, list_all(geometry.arm, geometry.tree, counts, course.near)
    return 1


def is_clear(
    geometry: Geometry,
    counts: Counts,
    places: Places,
    finder: Finder,
    course: Course,
    start: Array,
    margins: tuple[float, float],
    size: int,
) -> bool:
    """Whether every pair of shapes stays farther apart than a margin all along the parts of a motion that wait.

    Between the places that are looked at, nothing can come nearer than its distance there allows; what is shown to be
    far all along a part is not looked at again within it. A motion is also refused where a pair comes nearer than a
    larger margin, for then certainty takes ever smaller steps.

    Args:
        geometry: arm and obstacles.
        counts: how much of it there is.
        places: working memory.
        finder: working memory.
        course: its step and what waits are given; where it is refused, that place and the pair are left in it.
        start: (dof,) [rad].
        margins: smallest distance allowed, and the larger margin [m].
        size: how many parts wait.
    """
    waiting, spans, near = course.waiting, course.spans, course.near
    margin, refused = margins
    while size > 0:
        size -= 1
        low, high, first, last = waiting[size, 0], waiting[size, 1], spans[size, 0], spans[size, 1]
        middle, half = 0.5 * (low + high), 0.5 * (high - low)
        look_at(geometry, counts, places, course, start, middle)
        rate(geometry, counts, places, course, half, first, last)
        search = Search(margin, True, half, refused, course.step)
        covered, end = find_nearest(geometry, counts, places, finder, search, near, first, last)
        if covered < half:
            if finder.distance[0] < refused:
                leave(course, finder, middle)
                return False
            if end <= room_of(near):  # what is left near; these rows are free again after both parts
                first, last = last, end
            waiting[size, 0], waiting[size, 1] = middle + covered, high
            waiting[size + 1, 0], waiting[size + 1, 1] = low, middle - covered
            for k in range(size, size + 2):
                spans[k, 0], spans[k, 1] = first, last
            size += 2
    return True


def rate(
    geometry: Geometry, counts: Counts, places: Places, course: Course, half: float, first: int, last: int
) -> None:
    """Fill the rates of the groups that move in some rows of what can touch."""
    for g in range(counts.groups):
        course.rated[g] = 0
    for row in range(first, last):
        g = course.near[row, GROUP]
        if course.rated[g] == 0:
            course.rated[g] = 1
            bound_rates(geometry.arm, counts.dof, g, course.step, half, places)


def leave(course: Course, finder: Finder, at: float) -> None:
    """Keep the best pair and where it was found."""
    course.found[0], course.found[1] = finder.distance[0], at
    course.pair[0], course.pair[1] = finder.best[0], finder.best[1]


def least_on_motion(
    geometry: Geometry,
    counts: Counts,
    places: Places,
    finder: Finder,
    course: Course,
    start: Array,
    accuracy: float,
) -> None:
    """Fill in the least distance all along a motion; nothing on it is nearer by more than the accuracy.

    Arguments as of `is_clear`; the accuracy [m] is positive, and a part of the distance is added to it.
    """
    found, waiting, rows = course.found, course.waiting, course.near
    found[0], found[1], near = math.inf, 0.0, list_all(geometry.arm, geometry.tree, counts, rows)
    for end in range(2):
        look_at(geometry, counts, places, course, start, float(end))
        search = Search(0.0, False, found[0], math.inf, course.step)
        if find_nearest(geometry, counts, places, finder, search, rows, 0, near)[0] < found[0]:
            leave(course, finder, float(end))
    waiting[0, 0], waiting[0, 1] = 0.0, 1.0
    size = 1
    while size > 0:
        size -= 1
        low, high = waiting[size, 0], waiting[size, 1]
        middle, half = 0.5 * (low + high), 0.5 * (high - low)
        look_at(geometry, counts, places, course, start, middle)
        search = Search(0.0, False, found[0], math.inf, course.step)
        if find_nearest(geometry, counts, places, finder, search, rows, 0, near)[0] < found[0]:
            leave(course, finder, middle)
        rate(geometry, counts, places, course, half, 0, near)
        search = Search(found[0] - accuracy - RELATIVE_ACCURACY * abs(found[0]), True, half, math.inf, course.step)
        covered, _ = find_nearest(geometry, counts, places, finder, search, rows, 0, near)
        if covered < half:
            waiting[size, 0], waiting[size, 1] = middle + covered, high
            waiting[size + 1, 0], waiting[size + 1, 1] = low, middle - covered
            size += 2
