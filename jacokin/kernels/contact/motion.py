"""Straight joint motions: whether all of one is clear, and how near it comes to contact (conservative advancement)."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.contact.arm import Places, bound_rates, place_links
from jacokin.kernels.contact.nearest import Best, Goal, Heap, find_nearest, make_best
from jacokin.kernels.contact.separation import SeparationWork
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
    found: Array  # (2,) least distance [m], and where: 0 at the start, 1 at the end
    pair: NDArray[np.int64]  # (2,) the nearest shapes there
    best: Best


def make_course(dof: int) -> Course:
    """Fresh work arrays."""
    return Course(np.zeros(dof), np.zeros(dof), np.zeros((WAITING, 2)), np.zeros(2), np.zeros(2, np.int64), make_best())


def look_at(geometry: Geometry, counts: Counts, places: Places, course: Course, start: Array, at: float) -> None:
    """Place everything where the motion is at a share of its way."""
    for j in range(counts.dof):
        course.q[j] = start[j] + at * course.step[j]
    place_links(geometry.arm, counts.dof, counts.groups, course.q, places)


def is_clear(
    geometry: Geometry,
    counts: Counts,
    places: Places,
    heap: Heap,
    work: SeparationWork,
    course: Course,
    start: Array,
    margin: float,
    slack: float,
) -> bool:
    """Whether every pair of shapes stays farther apart than a margin all along a motion.

    Between the places that are looked at, nothing can come nearer than its distance there allows. A motion is also
    refused where a pair comes within `slack` of the margin, for then certainty takes ever smaller steps.

    Args:
        geometry: arm and obstacles.
        counts: how much of it there is.
        places: working memory.
        heap: working memory.
        work: working memory.
        course: its step is given; where it is refused, that place and the pair are left in it.
        start: (dof,) [rad].
        margin: smallest distance allowed [m].
        slack: positive [m].
    """
    waiting, best = course.waiting, course.best
    waiting[0, 0], waiting[0, 1] = 0.0, 1.0
    size = 1
    while size > 0:
        size -= 1
        low, high = waiting[size, 0], waiting[size, 1]
        middle, half = 0.5 * (low + high), 0.5 * (high - low)
        look_at(geometry, counts, places, course, start, middle)
        bound_rates(geometry.arm, counts.dof, counts.groups, course.step, half, places)
        covered = find_nearest(geometry, counts, places, heap, work, Goal(margin, True, half), best)
        if covered < half:
            if best.distance[0] < margin + slack:
                leave(course, middle)
                return False
            waiting[size, 0], waiting[size, 1] = middle + covered, high
            waiting[size + 1, 0], waiting[size + 1, 1] = low, middle - covered
            size += 2
    return True


def leave(course: Course, at: float) -> None:
    """Keep the best pair and where it was found."""
    course.found[0], course.found[1] = course.best.distance[0], at
    course.pair[0], course.pair[1] = course.best.pair[0], course.best.pair[1]


def least_on_motion(
    geometry: Geometry,
    counts: Counts,
    places: Places,
    heap: Heap,
    work: SeparationWork,
    course: Course,
    start: Array,
    accuracy: float,
) -> None:
    """Fill in the least distance all along a motion; nothing on it is nearer by more than the accuracy.

    Arguments as of `is_clear`; the accuracy [m] is positive, and a part of the distance is added to it.
    """
    found, waiting, best = course.found, course.waiting, course.best
    found[0], found[1] = math.inf, 0.0
    for end in range(2):
        look_at(geometry, counts, places, course, start, float(end))
        if find_nearest(geometry, counts, places, heap, work, Goal(0.0, False, found[0]), best) < found[0]:
            leave(course, float(end))
    waiting[0, 0], waiting[0, 1] = 0.0, 1.0
    size = 1
    while size > 0:
        size -= 1
        low, high = waiting[size, 0], waiting[size, 1]
        middle, half = 0.5 * (low + high), 0.5 * (high - low)
        look_at(geometry, counts, places, course, start, middle)
        if find_nearest(geometry, counts, places, heap, work, Goal(0.0, False, found[0]), best) < found[0]:
            leave(course, middle)
        bound_rates(geometry.arm, counts.dof, counts.groups, course.step, half, places)
        goal = Goal(found[0] - accuracy - RELATIVE_ACCURACY * abs(found[0]), True, half)
        covered = find_nearest(geometry, counts, places, heap, work, goal, best)
        if covered < half:
            waiting[size, 0], waiting[size, 1] = middle + covered, high
            waiting[size + 1, 0], waiting[size + 1, 1] = low, middle - covered
            size += 2
