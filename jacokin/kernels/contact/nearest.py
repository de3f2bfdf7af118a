"""The two shapes that are nearest to each other, or that a motion could bring together first: best first."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.contact.arm import (
    FIRST_PAIR,
    FIRST_SHAPE,
    GROUP_LINK,
    INNER,
    LAST_PAIR,
    LAST_SHAPE,
    OUTER,
    Places,
    in_world,
    relate,
)
from jacokin.kernels.contact.separation import SeparationWork, separation
from jacokin.kernels.contact.shapes import CENTRE, RADIUS, point_bound
from jacokin.kernels.contact.touching import Counts, Geometry, meeting_bound, pair_bound
from jacokin.kernels.contact.tree import node_bound

#: What an entry of the heap stands for.
MEETING, NODE, PLANE_BELOW, OWN_PAIR, OBSTACLE_PAIR = range(5)
#: [1/m] what nearness counts for pairs that a motion does not move.
UNMOVED = 1e12


class Heap(NamedTuple):
    """What may hold the best pair, the most promising entry on top."""

    keys: Array  # (room,) lower bounds
    entries: NDArray[np.int64]  # (room, 4) kind, two numbers, and the group that moves


class Best(NamedTuple):
    """The pair that was found."""

    pair: NDArray[np.int64]  # (2,)
    distance: Array  # (1,) [m]


class Goal(NamedTuple):
    """What is looked for: the least (distance - margin) x urgency, smaller than a value."""

    margin: float  # [m]
    moving: bool  # False: urgency is one; True: the inverse of the rate at which the pair can approach
    below: float


def make_best() -> Best:
    """Fresh work arrays."""
    return Best(np.zeros(2, np.int64), np.zeros(1))


def find_nearest(
    geometry: Geometry, counts: Counts, places: Places, heap: Heap, work: SeparationWork, goal: Goal, best: Best
) -> float:
    """The least value of all pairs, or `goal.below` where none is smaller.

    Args:
        geometry: arm and obstacles; counts leave out what does not matter.
        counts: how much of it there is.
        places: where everything is.
        heap: room for every entry.
        work: for one pair of shapes.
        goal: what is looked for.
        best: the pair of shapes, left alone where none is smaller.
    """
    shapes, arm, tree = geometry.shapes, geometry.arm, geometry.tree
    least, size = goal.below, 0
    for m in range(counts.meetings):
        urgency = urgency_of(
            counts, places, goal, arm.meetings[m, OUTER], arm.groups[arm.meetings[m, INNER], GROUP_LINK]
        )
        enough = least / urgency + goal.margin
        key = (meeting_bound(arm, places, m, enough) - goal.margin) * urgency
        size = push(heap, size, key, least, MEETING, m, 0, 0)
    if counts.nodes + counts.planes > 0:
        for g in range(counts.groups):
            if arm.groups[g, GROUP_LINK] == 0:
                continue
            urgency = urgency_of(counts, places, goal, g, 0)
            centre, reach = (places.centres[g, 0], places.centres[g, 1], places.centres[g, 2]), arm.spheres[g, 3]
            if counts.nodes > 0:
                key = (node_bound(tree, 0, centre) - reach - goal.margin) * urgency
                size = push(heap, size, key, least, NODE, 0, 0, g)
            for k in range(counts.planes):
                key = (point_bound(shapes, tree.planes[k], centre) - reach - goal.margin) * urgency
                size = push(heap, size, key, least, PLANE_BELOW, tree.planes[k], 0, g)
    while size > 0 and heap.keys[0] < least:
        kind, i, j, g = heap.entries[0, 0], heap.entries[0, 1], heap.entries[0, 2], heap.entries[0, 3]
        size = pop(heap, size)
        if kind == MEETING:
            inner, outer = arm.meetings[i, INNER], arm.meetings[i, OUTER]
            urgency = urgency_of(counts, places, goal, outer, arm.groups[inner, GROUP_LINK])
            for k in range(arm.meetings[i, FIRST_PAIR], arm.meetings[i, LAST_PAIR]):
                a, b = arm.pairs[k, 0], arm.pairs[k, 1]
                key = (pair_bound(shapes, places, a, b, least / urgency + goal.margin) - goal.margin) * urgency
                size = push(heap, size, key, least, OWN_PAIR, a, b, i)
        elif kind in (OWN_PAIR, OBSTACLE_PAIR):
            link, outer = 0, g
            if kind == OWN_PAIR:
                link, outer = arm.groups[arm.meetings[g, INNER], GROUP_LINK], arm.meetings[g, OUTER]
            urgency = urgency_of(counts, places, goal, outer, link)
            relate(shapes, places.frames, i, j, work.relative)
            distance = separation(shapes, (i, j), work, least / urgency + goal.margin, -math.inf, True)
            value = (distance - goal.margin) * urgency
            if value < least:
                least = value
                best.pair[0], best.pair[1], best.distance[0] = i, j, distance
        elif kind == NODE and tree.children[i, 0] >= 0:
            urgency = urgency_of(counts, places, goal, g, 0)
            centre, reach = (places.centres[g, 0], places.centres[g, 1], places.centres[g, 2]), arm.spheres[g, 3]
            for side in range(2):
                child = tree.children[i, side]
                key = (node_bound(tree, child, centre) - reach - goal.margin) * urgency
                size = push(heap, size, key, least, NODE, child, 0, g)
        else:
            b = i if kind == PLANE_BELOW else tree.children[i, 1]
            urgency = urgency_of(counts, places, goal, g, 0)
            for a in range(arm.groups[g, FIRST_SHAPE], arm.groups[g, LAST_SHAPE]):
                s = shapes.numbers[a]
                p = in_world(places.frames, arm.groups[g, GROUP_LINK], s[CENTRE], s[CENTRE + 1], s[CENTRE + 2])
                key = (point_bound(shapes, b, p) - s[RADIUS] - goal.margin) * urgency
                size = push(heap, size, key, least, OBSTACLE_PAIR, a, b, g)
    return least


def urgency_of(counts: Counts, places: Places, goal: Goal, g: int, link: int) -> float:
    """What a metre counts between a group and an earlier link."""
    if not goal.moving:
        return 1.0
    return float(1.0 / max(places.rates[g * (counts.dof + 1) + link], 1.0 / UNMOVED))


def push(heap: Heap, size: int, key: float, least: float, kind: int, i: int, j: int, g: int) -> int:
    """Add an entry unless it cannot be the best; returns the size of the heap."""
    if not key < least:
        return size
    keys, entries = heap.keys, heap.entries
    at = size
    while at > 0:
        parent = (at - 1) // 2
        if keys[parent] <= key:
            break
        keys[at] = keys[parent]
        for column in range(4):
            entries[at, column] = entries[parent, column]
        at = parent
    keys[at] = key
    entries[at, 0], entries[at, 1], entries[at, 2], entries[at, 3] = kind, i, j, g
    return size + 1


def pop(heap: Heap, size: int) -> int:
    """Remove the top; returns the size of the heap."""
    keys, entries = heap.keys, heap.entries
    size -= 1
    key, at, child = keys[size], 0, 1
    while child < size:
        if child + 1 < size and keys[child + 1] < keys[child]:
            child += 1
        if key <= keys[child]:
            break
        keys[at] = keys[child]
        for column in range(4):
            entries[at, column] = entries[child, column]
        at, child = child, 2 * child + 1
    keys[at] = key
    for column in range(4):
        entries[at, column] = entries[size, column]
    return size
