"""A way that takes less time, by straight motions between any two places of it, of all joints or of one.

Geraerts and Overmars: Creating high-quality paths for motion planning, 2007.
"""

from __future__ import annotations

import math
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.free_motion.sight import Sight, moves_clear
from jacokin.kernels.free_motion.space import Space, difference, length_of, time_of, uniform
from jacokin.kernels.free_motion.trees import MEETING, NONE, SearchInteger, Trees, node_at
from jacokin.kernels.limits import TURN

WORTH = 1e-2  # part of its time that a shortcut must save
#: Where a way keeps its whole numbers: how many configurations it has, the number of its goal, and shortcuts in a row
#: that were none.
WayInteger = IntEnum("WayInteger", "POINTS GOAL FAILURES COUNT", start=0)


class Way(NamedTuple):
    """Configurations with clear straight motions between them."""

    q: Array  # (room dof,) [rad]; unlimited joints turn on
    times: Array  # (room,) at full speed [s]
    other: Array  # (room dof,) the way that is tried
    integers: NDArray[np.int64]  # (WAY_INTEGERS,)
    step: Array  # (dof,) [rad]


def make_way(dof: int, room: int) -> Way:
    """Fresh work arrays for so many configurations."""
    return Way(
        np.empty(room * dof), np.empty(room), np.empty(room * dof), np.zeros(WayInteger.COUNT, np.int64), np.zeros(dof)
    )


def join_branches(trees: Trees, space: Space, dof: int, start: Array, way: Way) -> None:
    """Fill the way from a start (dof,) through both trees where they met, each joint turning the short way on."""
    room, node, depth = len(trees.parents) // 2, trees.integers[SearchInteger.MET_FIRST], 0
    while trees.parents[node] != NONE:
        node, depth = trees.parents[node], depth + 1
    points = depth + 1
    node = trees.integers[SearchInteger.MET_FIRST]
    for k in range(depth, 0, -1):
        put(way.q, dof, k, trees.q[node_at(trees, dof, 0, node) :])
        node = trees.parents[node]
    put(way.q, dof, 0, start)
    node = trees.integers[SearchInteger.MET_SECOND]
    while node != NONE:
        put(way.q, dof, points, trees.q[node_at(trees, dof, 1, node) :])
        way.integers[WayInteger.GOAL], points = node, points + 1
        node = trees.parents[room + node]
    kept = 1
    for k in range(1, points):
        last, new = way.q[(kept - 1) * dof : kept * dof], way.q[k * dof : (k + 1) * dof]
        difference(space, dof, last, new, way.step)
        if length_of(space, dof, way.step) <= MEETING and k < points - 1:
            continue
        for j in range(dof):
            way.q[kept * dof + j] = last[j] + way.step[j] if space.unlimited[j] else new[j]
        kept += 1
    way.integers[WayInteger.POINTS], way.integers[WayInteger.FAILURES] = kept, 0
    measure(way, space, dof)


def end_at(way: Way, space: Space, dof: int, goal: Array) -> None:
    """Let the way be within the limits, and end whole turns apart from a goal (dof,), but for rounding."""
    for m in range(way.integers[WayInteger.POINTS]):
        for j in range(dof):
            way.q[m * dof + j] = min(max(way.q[m * dof + j], space.lower[j]), space.upper[j])
    last = (way.integers[WayInteger.POINTS] - 1) * dof
    for j in range(dof):
        way.q[last + j] = goal[j] + TURN * math.floor((way.q[last + j] - goal[j]) / TURN + 0.5)


def shorten(
    way: Way, space: Space, dof: int, sight: Sight, generator: NDArray[np.int64], tries: int, patience: int
) -> bool:
    """Try so many shortcuts; True when as many as the patience allows were none, one after another."""
    integers = way.integers
    for _ in range(tries):
        if integers[WayInteger.FAILURES] >= patience or integers[WayInteger.POINTS] < 3:
            return True
        total = way.times[integers[WayInteger.POINTS] - 1]
        a, b = uniform(generator) * total, uniform(generator) * total
        joint = int(uniform(generator) * 2.0 * dof)  # the first half of the numbers stand for all joints at once
        first, second = min(a, b), max(a, b)
        if joint < dof:
            shorter = cut(way, space, dof, sight, first, second)
        else:
            shorter = cut_joint(way, space, dof, sight, first, second, joint - dof)
        integers[WayInteger.FAILURES] = 0 if shorter else integers[WayInteger.FAILURES] + 1
    return False


def skip_corners(way: Way, space: Space, dof: int, sight: Sight) -> None:
    """Leave out corners where the motion past them is clear and takes no more time, the largest detours first."""
    corner = 1
    while corner < way.integers[WayInteger.POINTS] - 1:
        for last in range(way.integers[WayInteger.POINTS] - 1, corner, -1):
            before = way.q[(corner - 1) * dof : corner * dof]
            difference(space, dof, before, way.q[last * dof : (last + 1) * dof], way.step)
            time = time_of(space, dof, way.step)
            if time > way.times[last] - way.times[corner - 1] + 1e-12:
                continue
            end = way.other[:dof]
            for j in range(dof):
                end[j] = before[j] + way.step[j]
            if moves_clear(sight, before, end, 0.0):
                turn_on(way, space, dof, corner - 1, last, way.step)
                close_gap(way, dof, corner, last)
                measure(way, space, dof)
                break
        corner += 1


def cut(way: Way, space: Space, dof: int, sight: Sight, first: float, second: float) -> bool:
    """Join two times on the way by a straight motion; False, with nothing done, where it touches or saves nothing."""
    points = way.integers[WayInteger.POINTS]
    i, j = line_at(way, first), line_at(way, second)
    if i == j or points + 2 > len(way.times):
        return False
    a, b = way.other[:dof], way.other[dof : 2 * dof]
    between(way, dof, i, first, a)
    between(way, dof, j, second, b)
    difference(space, dof, a, b, way.step)
    saved = second - first - time_of(space, dof, way.step)
    if saved <= WORTH * way.times[points - 1]:
        return False
    shifted = way.other[2 * dof : 3 * dof]
    for k in range(dof):
        shifted[k] = a[k] + way.step[k] if space.unlimited[k] else b[k]
    if not moves_clear(sight, a, shifted, 0.0):
        return False
    for k in range(dof):  # whole turns, by which the rest of the way is another copy
        turns = math.floor((shifted[k] - b[k]) / TURN + 0.5)
        if turns != 0.0:
            for m in range(j + 1, points):
                way.q[m * dof + k] += TURN * turns
    tail, moved = j + 1, i + 3
    if moved > tail:
        for m in range(points - 1, tail - 1, -1):
            put(way.q, dof, m + moved - tail, way.q[m * dof : (m + 1) * dof])
    else:
        for m in range(tail, points):
            put(way.q, dof, m + moved - tail, way.q[m * dof : (m + 1) * dof])
    put(way.q, dof, i + 1, a)
    put(way.q, dof, i + 2, shifted)
    way.integers[WayInteger.POINTS] = points + moved - tail
    measure(way, space, dof)
    return True


def cut_joint(way: Way, space: Space, dof: int, sight: Sight, first: float, second: float, joint: int) -> bool:
    """Let one joint move steadily between two times; False, with nothing done, where that touches or saves nothing."""
    points = way.integers[WayInteger.POINTS]
    i, j = line_at(way, first), line_at(way, second)
    if i == j or points + 2 > len(way.times):
        return False
    other, count = way.other, j - i + 2
    between(way, dof, i, first, other[:dof])
    for m in range(i + 1, j + 1):
        put(other, dof, m - i, way.q[m * dof : (m + 1) * dof])
    between(way, dof, j, second, other[(count - 1) * dof : count * dof])
    low, high = other[joint], other[(count - 1) * dof + joint]
    for m in range(i + 1, j + 1):
        share = (way.times[m] - first) / (second - first)
        other[(m - i) * dof + joint] = low + share * (high - low)
    time = 0.0
    for m in range(count - 1):
        difference_on(other, dof, m, way.step)
        time += time_of(space, dof, way.step)
    if second - first - time <= WORTH * way.times[points - 1]:
        return False
    for m in range(count - 1):
        if not moves_clear(sight, other[m * dof : (m + 1) * dof], other[(m + 1) * dof : (m + 2) * dof], 0.0):
            return False
    for m in range(points - 1, j, -1):
        put(way.q, dof, m + 2, way.q[m * dof : (m + 1) * dof])
    for m in range(count):
        put(way.q, dof, i + 1 + m, other[m * dof : (m + 1) * dof])
    way.integers[WayInteger.POINTS] = points + 2
    measure(way, space, dof)
    return True


def turn_on(way: Way, space: Space, dof: int, first: int, last: int, step: Array) -> None:
    """Move what begins with a configuration by whole turns, so that the step leads to it from an earlier one."""
    for j in range(dof):
        if not space.unlimited[j]:
            continue
        missing = way.q[first * dof + j] + step[j] - way.q[last * dof + j]
        turns = math.floor(missing / TURN + 0.5)
        if turns != 0.0:
            for m in range(last, way.integers[WayInteger.POINTS]):
                way.q[m * dof + j] += TURN * turns


def close_gap(way: Way, dof: int, first: int, last: int) -> None:
    """Leave out the configurations from the first up to, not with, the last."""
    points = way.integers[WayInteger.POINTS]
    for m in range(last, points):
        put(way.q, dof, m - last + first, way.q[m * dof : (m + 1) * dof])
    way.integers[WayInteger.POINTS] = points - last + first


def measure(way: Way, space: Space, dof: int) -> None:
    """Fill the times of the way."""
    way.times[0] = 0.0
    for m in range(1, way.integers[WayInteger.POINTS]):
        difference_on(way.q, dof, m - 1, way.step)
        way.times[m] = way.times[m - 1] + time_of(space, dof, way.step)


def difference_on(q: Array, dof: int, m: int, step: Array) -> None:
    """Fill the step (dof,) from one configuration of a way to the next."""
    for j in range(dof):
        step[j] = q[(m + 1) * dof + j] - q[m * dof + j]


def line_at(way: Way, time: float) -> int:
    """The number of the line that is passed at a time."""
    line = 0
    while line < way.integers[WayInteger.POINTS] - 2 and way.times[line + 1] <= time:
        line += 1
    return line


def between(way: Way, dof: int, line: int, time: float, q: Array) -> None:
    """Fill the configuration that is passed at a time on a line."""
    whole = way.times[line + 1] - way.times[line]
    share = (time - way.times[line]) / whole if whole > 0.0 else 0.0
    for j in range(dof):
        low, high = way.q[line * dof + j], way.q[(line + 1) * dof + j]
        q[j] = min(max(low + share * (high - low), min(low, high)), max(low, high))


def put(q: Array, dof: int, m: int, value: Array) -> None:
    """Set a configuration of a way."""
    for j in range(dof):
        q[m * dof + j] = value[j]
