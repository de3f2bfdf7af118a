"""The two shapes that are nearest to each other, or that a motion could bring together first: best first."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.contact.approach import apart_along, lasts
from jacokin.kernels.contact.arm import (
    FIRST_PAIR,
    FIRST_SHAPE,
    GROUP_LINK,
    INNER,
    LAST_PAIR,
    LAST_SHAPE,
    OUTER,
    ArmShapes,
    Places,
    in_world,
    relate,
)
from jacokin.kernels.contact.cloud import shape_separation
from jacokin.kernels.contact.separation import SeparationWork
from jacokin.kernels.contact.shapes import CENTRE, LINK, RADIUS, point_bound
from jacokin.kernels.contact.touching import Counts, Geometry, meeting_bound, pair_bound
from jacokin.kernels.contact.tree import Tree, node_bound

#: What may hold the best pair: two groups, a group and what a node of the tree holds, a group and a plane, a pair of
#: the arm, a shape and an obstacle.
MEETING, NODE, PLANE_BELOW, OWN_PAIR, OBSTACLE_PAIR = range(5)
#: Columns of such an entry: which of them it is, two numbers, and the group that moves.
KIND, FIRST, SECOND, GROUP, ENTRY = range(5)
#: For a pair that is certain to stay apart, it is asked for how much longer, where all others do so many times as long.
WORTH = 1.5
#: [m] how far a motion moves the pairs that it does not move.
UNMOVED = 1e-12
#: An entry: its kind, two numbers, its group.
Entry = tuple[int, int, int, int]


class Finder(NamedTuple):
    """What may hold the best pair, as a heap with the most promising entry on top, and the pair that was found."""

    keys: Array  # (room,) lower bounds
    entries: NDArray[np.int64]  # (room, 4)
    work: SeparationWork  # for one pair of shapes
    best: NDArray[np.int64]  # (2,) the pair
    distance: Array  # (1,) of it; of a pair that keeps less than others, and so much more [m]


class Search(NamedTuple):
    """What is looked for: the least (distance - margin) / rate, smaller than a value.

    The distance of a pair that keeps less than others counts as so much larger.
    On a motion, that is for how long a pair is certain to stay apart; the direction in which it is may show more.
    """

    margin: float  # [m]
    moving: bool  # False: the rate is one; True: that at which the pair can approach
    below: float
    rough: float  # [m] distances above this need not be exact, see `separation`
    step: Array  # (dof,) what the joints do for each unit of the motion [rad]


def make_finder(room: int, work: SeparationWork) -> Finder:
    """Fresh work arrays for so many entries."""
    return Finder(np.zeros(room), np.zeros((room, ENTRY), np.int64), work, np.zeros(2, np.int64), np.zeros(1))


def list_all(arm: ArmShapes, tree: Tree, counts: Counts, rows: NDArray[np.int64]) -> int:
    """Fill in entries (room, 4) that hold all that can touch; returns how many."""
    size = 0
    for m in range(counts.meetings):
        fill(rows[size], (MEETING, m, 0, arm.meetings[m, OUTER]))
        size += 1
    for g in range(counts.groups):
        if arm.groups[g, GROUP_LINK] == 0:
            continue
        if counts.nodes > 0:
            fill(rows[size], (NODE, 0, 0, g))
            size += 1
        for k in range(counts.planes):
            fill(rows[size], (PLANE_BELOW, tree.planes[k], 0, g))
            size += 1
    return size


def find_nearest(
    geometry: Geometry,
    counts: Counts,
    places: Places,
    finder: Finder,
    search: Search,
    rows: NDArray[np.int64],
    first: int,
    last: int,
) -> tuple[float, int]:
    """The least value of all pairs, or `search.below` where none is smaller.

    Args:
        geometry: arm and obstacles; counts leave out what does not matter.
        counts: how much of it there is.
        places: where everything is.
        finder: room for every entry; its best pair is left alone where none is smaller.
        search: what is looked for.
        rows: entries that hold all that can touch, from the first on. Of a motion, those whose value was not shown to
            be `search.below` or more are written from the last on.
        first: see rows.
        last: where they end.

    Returns:
        The value, and where what was written ends; beyond `room_of(rows)` where there was too little room.
    """
    shapes, pairs, room = geometry.shapes, geometry.arm.pairs, room_of(rows)
    least, size, end, start, stop = search.below, 0, last, first, last
    while True:
        for row in range(start, stop):
            entry = read(rows[row])
            until = search.below if search.moving else least
            key = value_of(geometry, counts, places, search, until, entry)
            if key < least:
                size = push(finder, size, key, entry)
            elif key < search.below:
                end = keep(search, rows, end, entry)
        if size == 0 or not finder.keys[0] < least:
            break
        entry = read(finder.entries[0])
        kind, i, j, g = entry
        size, start = pop(finder, size), room
        stop = start
        if kind in (OWN_PAIR, OBSTACLE_PAIR):
            own, link, less = kind == OWN_PAIR, 0, 0.0
            if own:
                i, j, less = pairs[i, 0], pairs[i, 1], geometry.arm.less[i]
                link = shapes.integers[i, LINK]
            rate = rate_of(counts, places, search, g, link)
            relate(shapes, places.frames, i, j, finder.work.relative)
            enough, deep = least * rate + search.margin - less, search.rough == math.inf
            apart = shape_separation(shapes, (i, j), finder.work, enough, -math.inf, search.rough - less, deep)
            distance = apart + less
            value = (distance - search.margin) / rate
            if search.moving and value < least and (size == 0 or finder.keys[0] >= WORTH * value):
                along = apart_along(shapes, (i, j), finder.work, apart) + less
                spare = along - (search.margin if deep else search.rough)
                if spare > 0.0:
                    half = search.below
                    value = max(value, lasts(geometry, places, finder.work, (i, j), own, search.step, half, spare))
            if value < search.below:
                end = keep(search, rows, end, entry)
            if value < least:
                least = value
                finder.best[0], finder.best[1], finder.distance[0] = i, j, distance
        else:
            stop = divide(geometry, rows, start, entry)
    for k in range(size):
        end = keep(search, rows, end, read(finder.entries[k]))
    return least, end


def value_of(geometry: Geometry, counts: Counts, places: Places, search: Search, until: float, entry: Entry) -> float:
    """A lower bound of the values of an entry, found with no more work than to show that it is so large."""
    shapes, arm, link = geometry.shapes, geometry.arm, 0
    kind, i, j, g = entry
    if kind == MEETING:
        link = arm.groups[arm.meetings[i, INNER], GROUP_LINK]
    elif kind == OWN_PAIR:
        link = shapes.integers[arm.pairs[i, 0], LINK]
    rate = rate_of(counts, places, search, g, link)
    enough = until * rate + search.margin
    if kind == MEETING:
        bound = meeting_bound(arm, places, i, enough)
    elif kind == OWN_PAIR:
        less = arm.less[i]
        bound = pair_bound(shapes, places, arm.pairs[i, 0], arm.pairs[i, 1], enough - less) + less
    elif kind == OBSTACLE_PAIR:
        s = shapes.numbers[i]
        p = in_world(places.frames, arm.groups[g, GROUP_LINK], s[CENTRE], s[CENTRE + 1], s[CENTRE + 2])
        bound = point_bound(shapes, j, p) - s[RADIUS]
    else:
        centre = (places.centres[g, 0], places.centres[g, 1], places.centres[g, 2])
        bound = node_bound(geometry.tree, i, centre) if kind == NODE else point_bound(shapes, i, centre)
        bound -= arm.spheres[g, 3]
    return float((bound - search.margin) / rate)


def divide(geometry: Geometry, rows: NDArray[np.int64], start: int, entry: Entry) -> int:
    """Write the parts of an entry that is no pair to the rows; returns where they end."""
    arm, tree, stop = geometry.arm, geometry.tree, start
    kind, i, _, g = entry
    if kind == MEETING:
        for k in range(arm.meetings[i, FIRST_PAIR], arm.meetings[i, LAST_PAIR]):
            fill(rows[stop], (OWN_PAIR, k, 0, g))
            stop += 1
    elif kind == NODE and tree.children[i, 0] >= 0:
        for side in range(2):
            fill(rows[stop], (NODE, tree.children[i, side], 0, g))
            stop += 1
    else:
        b = i if kind == PLANE_BELOW else tree.children[i, 1]
        for a in range(arm.groups[g, FIRST_SHAPE], arm.groups[g, LAST_SHAPE]):
            fill(rows[stop], (OBSTACLE_PAIR, a, b, g))
            stop += 1
    return stop


def room_of(rows: NDArray[np.int64]) -> int:
    """How many entries can be kept; behind them is room for the parts of one."""
    return int(rows.shape[0] // 3 * 2)


def keep(search: Search, rows: NDArray[np.int64], end: int, entry: Entry) -> int:
    """Write an entry that a part of the motion could bring together to the end of the rows; returns their new end."""
    if not search.moving:
        return end
    if end < room_of(rows):
        fill(rows[end], entry)
    return end + 1


def fill(row: NDArray[np.int64], entry: Entry) -> None:
    """Write an entry."""
    row[KIND], row[FIRST], row[SECOND], row[GROUP] = entry


def read(row: NDArray[np.int64]) -> Entry:
    """The entry of a row."""
    return row[KIND], row[FIRST], row[SECOND], row[GROUP]


def rate_of(counts: Counts, places: Places, search: Search, g: int, link: int) -> float:
    """What a metre between a group and an earlier link is divided by."""
    if not search.moving:
        return 1.0
    return float(max(places.rates[g * (counts.dof + 1) + link], UNMOVED))


def push(finder: Finder, size: int, key: float, entry: Entry) -> int:
    """Add an entry; returns the size of the heap."""
    keys, entries = finder.keys, finder.entries
    at = size
    while at > 0:
        parent = (at - 1) // 2
        if keys[parent] <= key:
            break
        keys[at] = keys[parent]
        for column in range(ENTRY):
            entries[at, column] = entries[parent, column]
        at = parent
    keys[at] = key
    fill(entries[at], entry)
    return size + 1


def pop(finder: Finder, size: int) -> int:
    """Remove the top; returns the size of the heap."""
    keys, entries = finder.keys, finder.entries
    size -= 1
    key, at, child = keys[size], 0, 1
    while child < size:
        if child + 1 < size and keys[child + 1] < keys[child]:
            child += 1
        if key <= keys[child]:
            break
        keys[at] = keys[child]
        for column in range(ENTRY):
            entries[at, column] = entries[child, column]
        at, child = child, 2 * child + 1
    keys[at] = key
    for column in range(ENTRY):
        entries[at, column] = entries[size, column]
    return size
