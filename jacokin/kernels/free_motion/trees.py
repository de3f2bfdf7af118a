"""Two trees of motions, one from the start and one from all goals, that grow until they meet.

RRT-Connect (Kuffner and LaValle: RRT-Connect: an efficient approach to single-query path planning, 2000): the smaller
tree takes a step towards a random configuration, and the other one goes on towards where that led. Unlimited joints
turn the short way round, and stay in [-pi, pi] here.

Most random configurations are near to one of the tree that grows, wherever that is (Hsu, Latombe and Motwani: Path
planning in expansive configuration spaces, 1997): a tree that is shut in fills its place and finds the way out. The
others are not far from what is between start and goals.

Most motions of the trees are part of no way. So they are looked at in some places only (Bohlin and Kavraki: Path
planning using lazy PRM, 2000), their ends first, and those on the way are certified where the trees have met. One that
is not certain is cut off, and the search goes on.
"""

from __future__ import annotations

import math
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.free_motion.sight import IS_BLOCKED, IS_CERTAIN, Sight, is_free, look_along, moves_clear
from jacokin.kernels.free_motion.space import (
    Hindrances,
    Space,
    difference,
    length_of,
    remember,
    time_of,
    uniform,
)
from jacokin.kernels.limits import TURN

STEP = 0.8  # [rad] by which a tree grows at once, joints weighed by their speed
MEETING = 1e-9  # [rad] two configurations that are nearer are one
PATIENCE = 50  # steps in a row that lead nowhere, after which the larger tree grows, too
NONE = -1
BLOCK = 64  # configurations of a tree whose distances are computed side by side
NEAR = 2.0  # [rad] or [m] joint by joint, how far from a tree, or from what is between the ends, random ones are
NEAR_TREE = 0.75  # part of them that are near to a tree
#: Where a search keeps its whole numbers: sizes of the trees, random configurations, steps in a row that led nowhere,
#: 1 when a tree lacked room, the two that met, and how many goals the second tree began with.
SearchInteger = IntEnum(
    "SearchInteger", "FIRST_SIZE SECOND_SIZE SAMPLES MISSES IS_FULL MET_FIRST MET_SECOND ROOT_COUNT COUNT", start=0
)
#: And its times at full speed [s]: how near the trees came to each other, and how long a way may take.
SearchNumber = IntEnum("SearchNumber", "NEAREST BOUND COUNT", start=0)


class Trees(NamedTuple):
    """Both trees: the configurations from the start in the first half, those from the goals in the second."""

    q: Array  # (2 room dof,) [rad]
    parents: NDArray[np.int64]  # (2 room,) numbers within each tree, NONE at a root
    known: NDArray[np.int64]  # (2 room,) of the motion from there, see `look_along`
    integers: NDArray[np.int64]  # (SEARCH_INTEGERS,)
    numbers: Array  # (SEARCH_NUMBERS,)
    sample: Array  # (dof,) [rad]
    step: Array  # (dof,) [rad]
    end: Array  # (dof,) [rad]
    columns: Array  # (2 dof room,) the same as q, joint by joint, infinite where a configuration is cut off [rad]
    squares: Array  # (BLOCK,) how far some of them are from another one
    around: (
        Array  # (2 dof,) lowest and highest random configuration that is not far from what is between the ends [rad]
    )


def make_trees(dof: int, room: int) -> Trees:
    """Fresh work arrays for so many configurations in each tree."""
    integers, numbers = np.zeros(SearchInteger.COUNT, np.int64), np.full(SearchNumber.COUNT, np.inf)
    sample, step, end = np.zeros((3, dof))
    q, columns = np.empty((2, 2 * room * dof))
    parents, known = np.empty((2, 2 * room), np.int64)
    squares, around = np.zeros(BLOCK), np.zeros(2 * dof)
    return Trees(q, parents, known, integers, numbers, sample, step, end, columns, squares, around)


def plant(
    trees: Trees, space: Space, dof: int, start: Array, goals: Array, chosen: NDArray[np.int64], roots: int
) -> None:
    """Begin a search from a start (dof,) to those goals (k dof,) that are chosen."""
    integers = trees.integers
    for k in range(SearchInteger.COUNT):
        integers[k] = 0
    integers[SearchInteger.MET_FIRST], integers[SearchInteger.MET_SECOND] = NONE, NONE
    trees.numbers[SearchNumber.NEAREST], integers[SearchInteger.ROOT_COUNT] = math.inf, roots
    add(trees, space, dof, 0, start, NONE, IS_CERTAIN)
    around = trees.around
    for j in range(dof):
        around[j], around[dof + j] = start[j] - NEAR, start[j] + NEAR
    for k in range(roots):
        goal = goals[chosen[k] * dof : (chosen[k] + 1) * dof]
        add(trees, space, dof, 1, goal, NONE, IS_CERTAIN)
        difference(space, dof, start, goal, trees.step)
        for j in range(dof):
            around[j] = min(around[j], start[j] + trees.step[j] - NEAR)
            around[dof + j] = max(around[dof + j], start[j] + trees.step[j] + NEAR)


def node_at(trees: Trees, dof: int, tree: int, node: int) -> int:
    """Where a configuration (dof,) begins."""
    return (tree * (len(trees.parents) // 2) + node) * dof


def add(trees: Trees, space: Space, dof: int, tree: int, q: Array, parent: int, known: int) -> int:
    """Add a configuration, and what is known of the motion to it; its number, or NONE where there is no room."""
    room, node = len(trees.parents) // 2, trees.integers[tree]
    if node == room:
        trees.integers[SearchInteger.IS_FULL] = 1
        return NONE
    at = node_at(trees, dof, tree, node)
    for j in range(dof):
        angle = q[j] - TURN * math.floor(q[j] / TURN + 0.5) if space.unlimited[j] else q[j]
        trees.q[at + j] = trees.columns[(tree * dof + j) * room + node] = angle
    trees.parents[tree * room + node], trees.known[tree * room + node] = parent, known
    trees.integers[tree] = node + 1
    return int(node)


def nearest_node(trees: Trees, space: Space, dof: int, tree: int, q: Array) -> int:
    """The configuration nearest to one whose unlimited joints are in [-pi, pi]."""
    best, found, squares, room = math.inf, 0, trees.squares, len(trees.parents) // 2
    for first in range(0, trees.integers[tree], BLOCK):
        size = min(BLOCK, trees.integers[tree] - first)
        for i in range(BLOCK):
            squares[i] = 0.0
        for j in range(dof):
            begin, angle, weight = (tree * dof + j) * room + first, q[j], space.weights[j]
            column = trees.columns[begin : begin + size]
            if space.unlimited[j]:
                for i in range(size):
                    away = abs(column[i] - angle)
                    away = min(away, TURN - away) * weight
                    squares[i] += away * away
            else:
                for i in range(size):
                    away = (column[i] - angle) * weight
                    squares[i] += away * away
        for i in range(size):
            if squares[i] < best:
                best, found = squares[i], first + i
    return found


def grow_trees(
    trees: Trees,
    space: Space,
    dof: int,
    sight: Sight,
    hindrances: Hindrances,
    generator: NDArray[np.int64],
    samples: int,
) -> bool:
    """Go on with a search for so many random configurations, or until there is no room; whether the trees met.

    There is room for all that one of them may add, or it is not drawn: what is found does not depend on the room.
    """
    integers, most = trees.integers, len(trees.parents) // 2 - most_added(space, dof)
    for _ in range(samples):
        if max(integers[SearchInteger.FIRST_SIZE], integers[SearchInteger.SECOND_SIZE]) > most:
            integers[SearchInteger.IS_FULL] = 1
            return False
        integers[SearchInteger.SAMPLES] += 1
        small = 0 if integers[SearchInteger.FIRST_SIZE] <= integers[SearchInteger.SECOND_SIZE] else 1
        if integers[SearchInteger.MISSES] >= PATIENCE and integers[SearchInteger.SAMPLES] % 2:
            small = 1 - small
        draw(trees, space, dof, generator, small)
        node = nearest_node(trees, space, dof, small, trees.sample)
        difference(space, dof, trees.q[node_at(trees, dof, small, node) :], trees.sample, trees.step)
        grown = grow(trees, space, dof, sight, hindrances, small, node)
        integers[SearchInteger.MISSES] = integers[SearchInteger.MISSES] + 1 if grown == NONE else 0
        if grown != NONE:
            at = node_at(trees, dof, small, grown)
            met = connect(trees, space, dof, sight, hindrances, 1 - small, trees.q[at : at + dof])
            if met != NONE:
                integers[SearchInteger.MET_FIRST], integers[SearchInteger.MET_SECOND] = (
                    (grown, met) if small == 0 else (met, grown)
                )
                first = is_branch_clear(trees, space, dof, sight, hindrances, 0, integers[SearchInteger.MET_FIRST])
                if first and is_branch_clear(
                    trees, space, dof, sight, hindrances, 1, integers[SearchInteger.MET_SECOND]
                ):
                    return True
    return False


def most_added(space: Space, dof: int) -> int:
    """How many configurations one random one can add to a tree: steps to the other end of where those lie."""
    total = 0.0
    for j in range(dof):
        far = math.pi if space.unlimited[j] else space.high[j] - space.low[j]
        total += (far * space.weights[j]) ** 2
    return int(math.sqrt(total) / STEP) + 2


def draw(trees: Trees, space: Space, dof: int, generator: NDArray[np.int64], tree: int) -> None:
    """Fill a random configuration towards which a tree is to grow; on a way to a goal where that is to be quick."""
    q, around = trees.sample, trees.around
    if trees.numbers[SearchNumber.BOUND] < math.inf:
        draw_on_way(trees, space, dof, generator)
    elif uniform(generator) < NEAR_TREE:
        at = node_at(trees, dof, tree, int(uniform(generator) * trees.integers[tree]))
        for j in range(dof):
            q[j] = draw_between(space, j, generator, trees.q[at + j] - NEAR, trees.q[at + j] + NEAR)
    else:
        for j in range(dof):
            q[j] = draw_between(space, j, generator, around[j], around[dof + j])


def draw_between(space: Space, j: int, generator: NDArray[np.int64], low: float, high: float) -> float:
    """A random position of a joint between two of which one at least is within its limits."""
    if space.unlimited[j]:
        angle = low + uniform(generator) * (high - low)
        return angle - TURN * math.floor(angle / TURN + 0.5)
    low, high = max(low, space.low[j]), min(high, space.high[j])
    return low + uniform(generator) * (high - low)


def draw_on_way(trees: Trees, space: Space, dof: int, generator: NDArray[np.int64]) -> None:
    """Fill a random configuration on a way to one of the goals that is as quick as the search asks for.

    Each joint has a part of that time to come there, and the rest of it to go on.
    """
    roots, bound = len(trees.parents) // 2, trees.numbers[SearchNumber.BOUND]
    goal = (roots + int(uniform(generator) * trees.integers[SearchInteger.ROOT_COUNT])) * dof
    difference(space, dof, trees.q[:dof], trees.q[goal : goal + dof], trees.step)
    before = uniform(generator) * bound
    for j in range(dof):
        start, end = trees.q[j], trees.q[j] + trees.step[j]
        first, then = before * space.speed[j], (bound - before) * space.speed[j]
        low, high = max(start - first, end - then), min(start + first, end + then)
        trees.sample[j] = draw_between(space, j, generator, low, high)


def is_worth(trees: Trees, space: Space, dof: int, q: Array) -> bool:
    """Whether a way through a configuration can be as quick as the search asks for."""
    bound = trees.numbers[SearchNumber.BOUND]
    if bound == math.inf:
        return True
    first = len(trees.parents) // 2
    bound -= time_between(trees, space, dof, 0, q)
    for k in range(first, first + trees.integers[SearchInteger.ROOT_COUNT]):
        if bound > 0.0 and time_between(trees, space, dof, k, q) < bound:
            return True
    return False


def time_between(trees: Trees, space: Space, dof: int, row: int, q: Array) -> float:
    """Of the motion between a row of the trees and a configuration, at full speed [s]."""
    most = 0.0
    for j in range(dof):
        away = abs(trees.q[row * dof + j] - q[j])
        if space.unlimited[j]:
            away = abs(away - TURN * math.floor(away / TURN + 0.5))
        most = max(most, away / space.speed[j])
    return most


def grow(trees: Trees, space: Space, dof: int, sight: Sight, hindrances: Hindrances, tree: int, node: int) -> int:
    """Grow a tree from a node along `trees.step` by at most a step; the number of what was added, or NONE."""
    at, end = node_at(trees, dof, tree, node), trees.end
    start = trees.q[at : at + dof]
    length = length_of(space, dof, trees.step)
    share = 1.0 if length <= STEP else STEP / length
    for j in range(dof):
        end[j] = min(max(start[j] + share * trees.step[j], space.lower[j]), space.upper[j])
    if not is_worth(trees, space, dof, end):
        return NONE
    known = look_along(sight, start, end) if is_free(sight, end) else IS_BLOCKED
    if known == IS_BLOCKED:
        remember(hindrances, sight.contact.course.pair)
        return NONE
    return add(trees, space, dof, tree, end, node, known)


def connect(trees: Trees, space: Space, dof: int, sight: Sight, hindrances: Hindrances, tree: int, q: Array) -> int:
    """Grow a tree step by step towards a configuration; the number of the node that reaches it, or NONE."""
    node = nearest_node(trees, space, dof, tree, q)
    difference(space, dof, trees.q[node_at(trees, dof, tree, node) :], q, trees.step)
    while length_of(space, dof, trees.step) > MEETING:
        node = grow(trees, space, dof, sight, hindrances, tree, node)
        trees.numbers[SearchNumber.NEAREST] = min(trees.numbers[SearchNumber.NEAREST], time_of(space, dof, trees.step))
        if node == NONE:
            return NONE
        difference(space, dof, trees.q[node_at(trees, dof, tree, node) :], q, trees.step)
    return node


def is_branch_clear(
    trees: Trees, space: Space, dof: int, sight: Sight, hindrances: Hindrances, tree: int, node: int
) -> bool:
    """Whether the motions from the root of a tree to a node are certain; what is not is cut off, with all behind it."""
    first = tree * (len(trees.parents) // 2)
    while trees.parents[first + node] != NONE:
        parent = trees.parents[first + node]
        if trees.known[first + node] == IS_CERTAIN:
            node = parent
            continue
        at = (first + parent) * dof
        start, end = trees.q[at : at + dof], trees.end
        difference(space, dof, start, trees.q[(first + node) * dof :], trees.step)
        for j in range(dof):
            end[j] = start[j] + trees.step[j]
        if not moves_clear(sight, start, end, 0.0):
            remember(hindrances, sight.contact.course.pair)
            cut_off(trees, dof, tree, node)
            return False
        node = parent
    return True


def cut_off(trees: Trees, dof: int, tree: int, node: int) -> None:
    """Put a node, and all that grew from it, infinitely far away."""
    room = len(trees.parents) // 2
    first, rows = tree * room, tree * dof * room
    for k in range(node, trees.integers[tree]):
        parent = trees.parents[first + k]
        if k == node or (parent != NONE and math.isinf(trees.columns[rows + parent])):
            for j in range(dof):
                trees.columns[rows + j * room + k] = math.inf
