"""The entry point: contact, distances and motions of an arm among obstacles. Read this file first.

shapes         what a shape is, and its farthest points
separation     how far two convex shapes are apart; simplex, and penetration where they overlap
cloud          how far a shape is from a cloud of points
cloud_surface  where the surface is that these points make
pairs          where two shapes are nearest, and would be if one turned a little
arm, tree      where the arm's shapes are, and which obstacles are near
touching       pairs that touch: groups of shapes by their spheres, then shapes by theirs, then exactly
nearest        the least distance, or what a motion could bring together first: best first
motion         straight motions, certain between the places that are looked at too
"""

from __future__ import annotations

import math
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.contact.arm import LAST_SHAPE, ArmShapes, Places, place_links, relate
from jacokin.kernels.contact.cloud import shape_separation
from jacokin.kernels.contact.motion import Course, await_all, is_clear, least_on_motion, make_course
from jacokin.kernels.contact.nearest import ENTRY, Finder, Search, find_nearest, list_all, make_finder
from jacokin.kernels.contact.pairs import PAIR_NUMBERS, measure_pair
from jacokin.kernels.contact.separation import make_separation_work
from jacokin.kernels.contact.shapes import NODE_NUMBERS, SHAPE_INTEGERS, SHAPE_NUMBERS, Shapes
from jacokin.kernels.contact.touching import Counts, Geometry, Hits, find_touching
from jacokin.kernels.contact.tree import DEEPEST, Tree

#: What to do with rows of configurations: whether each is in contact; the pairs that touch in the first; the least
#: distance of each. What to do with pairs of rows, start and end of motions: whether each is clear; its least distance.
#: The distances of given pairs at the first, as far as their reach; rows are pairs then.
ContactTask = IntEnum(
    "ContactTask", "TOUCHES LIST_TOUCHING LEAST_DISTANCE CLEAR_MOTION LEAST_ON_MOTION MEASURE_PAIRS", start=0
)
#: Where the options' integers are: task, rows or motions, then what of the geometry counts.
ContactInteger = IntEnum("ContactInteger", "TASK ROWS DOF GROUPS MEETINGS NODES PLANES COUNT", start=0)
#: And its numbers: margin, margin of the base with obstacles, slack or accuracy [m].
ContactNumber = IntEnum("ContactNumber", "MARGIN_KEPT BASE_MARGIN SLACK COUNT", start=0)


class ContactWork(NamedTuple):
    """What a call reads and writes; one set for each thread."""

    integers: NDArray[np.int64]  # (7,)
    numbers: Array  # (3,)
    q: Array  # (rows dof,) [rad]; a motion has two rows
    geometry: Geometry
    places: Places
    hits: Hits
    finder: Finder
    course: Course
    value: Array  # (rows, 2) 1 for contact or a motion that is not clear; distance [m]; where on a motion
    named: NDArray[np.int64]  # (rows, 2) the pair of shapes
    given: NDArray[np.int64]  # (pairs, 2) to be measured
    reach: Array  # (pairs,) [m]; farther apart, a lower bound of the distance larger than it will do
    measured: Array  # (pairs, 10) distance, nearest points on both shapes and normal from the first, in the world


def run_contact(work: ContactWork) -> int:
    """Do a task; returns how many pairs touch, or 0. This is what gets compiled: it allocates nothing."""
    integers, numbers = work.integers, work.numbers
    task, rows = integers[ContactInteger.TASK], integers[ContactInteger.ROWS]
    counts = counts_of(work)
    margin, standing, slack = (
        numbers[ContactNumber.MARGIN_KEPT],
        numbers[ContactNumber.BASE_MARGIN],
        numbers[ContactNumber.SLACK],
    )
    geometry, places, hits, finder, course = work.geometry, work.places, work.hits, work.finder, work.course
    if task in (ContactTask.TOUCHES, ContactTask.LIST_TOUCHING):
        found = 0
        for i in range(rows):
            q = work.q[i * counts.dof : (i + 1) * counts.dof]
            place_links(geometry.arm, counts.dof, counts.groups, q, places)
            found = find_touching(geometry, counts, places, hits, margin, standing, task == ContactTask.LIST_TOUCHING)
            work.value[i, 0] = float(found)
        return found
    if task == ContactTask.LEAST_DISTANCE:
        count = list_all(geometry.arm, geometry.tree, counts, course.near)
        for i in range(rows):
            q = work.q[i * counts.dof : (i + 1) * counts.dof]
            place_links(geometry.arm, counts.dof, counts.groups, q, places)
            a, b, near = finder.best[0], finder.best[1], math.inf
            if i == 0:
                finder.best[0], finder.best[1] = -1, -1
            elif a >= 0:  # rows are near to each other more often than not, and so is their nearest pair
                relate(geometry.shapes, places.frames, a, b, hits.pair.relative)
                near = shape_separation(geometry.shapes, (a, b), hits.pair, math.inf, -math.inf, math.inf, True)
            search = Search(0.0, False, near, math.inf, course.step)
            least, _ = find_nearest(geometry, counts, places, finder, search, course.near, 0, count)
            work.value[i, 0] = least
            work.named[i, 0], work.named[i, 1] = finder.best[0], finder.best[1]
        return 0
    if task == ContactTask.MEASURE_PAIRS:
        place_links(geometry.arm, counts.dof, counts.groups, work.q, places)
        for i in range(rows):
            measure_pair(geometry.shapes, places, hits.pair, work.given[i], work.reach[i], work.measured[i])
        return 0
    for i in range(rows):
        start = work.q[2 * i * counts.dof : (2 * i + 1) * counts.dof]
        end = work.q[(2 * i + 1) * counts.dof : (2 * i + 2) * counts.dof]
        course.pair[0], course.pair[1] = -1, -1
        if task == ContactTask.CLEAR_MOTION:
            work.value[i, 0] = 0.0 if stays_clear(work, start, end, 0.0) else 1.0
        else:
            for j in range(counts.dof):
                course.step[j] = end[j] - start[j]
            least_on_motion(geometry, counts, places, finder, course, start, slack)
            work.value[i, 0] = course.found[0]
        work.value[i, 1] = course.found[1]
        work.named[i, 0], work.named[i, 1] = course.pair[0], course.pair[1]
    return 0


def counts_of(contact: ContactWork) -> Counts:
    """How much of the geometry counts."""
    i = contact.integers
    return Counts(
        i[ContactInteger.DOF],
        i[ContactInteger.GROUPS],
        i[ContactInteger.MEETINGS],
        i[ContactInteger.NODES],
        i[ContactInteger.PLANES],
    )


def stays_clear(contact: ContactWork, start: Array, end: Array, extra: float) -> bool:
    """Whether a straight motion is certain with so much more margin [m]; if not, the pair is left in the course."""
    geometry, course, counts = contact.geometry, contact.course, counts_of(contact)
    margin, slack = contact.numbers[ContactNumber.MARGIN_KEPT] + extra, contact.numbers[ContactNumber.SLACK]
    for j in range(counts.dof):
        course.step[j] = end[j] - start[j]
    waiting = await_all(geometry, counts, course)
    margins = margin, margin + slack
    return is_clear(geometry, counts, contact.places, contact.finder, course, start, margins, waiting)


def stands_clear(contact: ContactWork, q: Array) -> bool:
    """Whether nothing touches at a configuration (dof,); otherwise the pair is left in `contact.hits.pairs`."""
    counts = counts_of(contact)
    place_links(contact.geometry.arm, counts.dof, counts.groups, q, contact.places)
    margin = contact.numbers[ContactNumber.MARGIN_KEPT]
    return find_touching(contact.geometry, counts, contact.places, contact.hits, margin, -math.inf, False) == 0


#: No arm and no obstacle.
NOTHING = Geometry(
    Shapes(
        np.zeros((0, SHAPE_NUMBERS)),
        np.zeros((0, SHAPE_INTEGERS), np.int64),
        np.zeros((0, 3)),
        np.zeros(0, np.int64),
        np.zeros(0, np.int64),
        np.zeros((0, 3)),
        np.zeros((0, NODE_NUMBERS)),
    ),
    ArmShapes(
        np.zeros(0, np.int64),
        np.zeros((0, 3, 4)),
        np.zeros((0, 4)),
        np.zeros((0, 6)),
        np.zeros((0, 3), np.int64),
        np.zeros((0, 4), np.int64),
        np.zeros((0, 2), np.int64),
        np.zeros(0),
    ),
    Tree(np.zeros((0, 6)), np.zeros((0, 2), np.int64), np.zeros(0, np.int64)),
)


def make_contact_work(geometry: Geometry = NOTHING, rows: int = 0, pairs: int = 0) -> ContactWork:
    """Fresh work arrays for a geometry, so many configurations, and pairs to be measured; everything in it counts."""
    dof, groups = len(geometry.arm.joint_kinds), len(geometry.arm.groups)
    frames = np.zeros((dof + 2 if rows else 0, 3, 4))
    frames[:] = np.eye(3, 4)
    pair = make_separation_work()
    work = ContactWork(
        np.zeros(ContactInteger.COUNT, np.int64),
        np.zeros(ContactNumber.COUNT),
        np.zeros(rows * dof),
        geometry,
        Places(frames, np.zeros((groups, 3)), np.zeros(groups * (dof + 1))),
        Hits(np.zeros(3, np.int64), np.zeros((0, 2), np.int64), np.zeros(DEEPEST, np.int64), pair),
        make_finder(0, pair),
        make_course(dof, groups, 0),
        np.zeros((rows, 2)),
        np.zeros((rows, 2), np.int64),
        np.zeros((pairs, 2), np.int64),
        np.zeros(pairs),
        np.zeros((pairs, PAIR_NUMBERS)),
    )
    return among(work, geometry)


def among(work: ContactWork, geometry: Geometry) -> ContactWork:
    """Work arrays for the same arm among other obstacles: these, but for what depends on obstacles and options."""
    shapes, arm, tree = geometry
    dof, groups, meetings = len(arm.joint_kinds), len(arm.groups), len(arm.meetings)
    nodes, planes = len(tree.boxes), len(tree.planes)
    own = int(arm.groups[-1, LAST_SHAPE]) if groups else 0
    with_obstacles = own * (len(shapes.numbers) - own)
    room = meetings + len(arm.pairs) + groups * (nodes + planes) + with_obstacles
    touching = np.zeros((len(arm.pairs) + with_obstacles, 2), np.int64)
    return work._replace(
        integers=np.array([ContactTask.TOUCHES, work.value.shape[0], dof, groups, meetings, nodes, planes]),
        numbers=np.array([0.0, -math.inf, 0.0]),
        geometry=geometry,
        hits=work.hits._replace(last=np.full(3, -1), pairs=touching),
        finder=work.finder._replace(keys=np.zeros(room), entries=np.zeros((room, ENTRY), np.int64)),
        course=work.course._replace(near=np.zeros((3 * room, ENTRY), np.int64)),
    )
