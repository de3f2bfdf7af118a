"""The chords of curves on which the configuration nearest to a seed may lie, of seven joints built like a Jaco's.

Between two folds each row of `seven_joints.solve_at_q3` is a smooth function of joint 3, so that no curve is followed:
intervals of joint 3 are halved, and left out where no configuration in them can be within the limits and nearer than
the nearest one so far. Within a half, joints go beyond their values at its ends by less than the middle of the whole
was beside the line between its ends. Next to a fold that holds for the angle of which joint 3 is the cosine.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.limits import TURN, copy_within_limits
from jacokin.kernels.solution_set.curve import LEAST_COSINE, LONGEST_STEP, RESOLUTION, Walk, tangent, wrapped
from jacokin.kernels.solution_set.seven_joints import MOST_AT_Q3, solve_at_q3, solve_rows_at_q3
from jacokin.kernels.solution_set.slices import SevenJoints
from jacokin.kernels.solution_set.trace import CurveEnd, Loops, add_node, enter_run
from jacokin.kernels.tolerances import LIMIT_SNAP

#: [rad] longest interval of joint 3 to begin with, and places there is room for: twice the intervals and one for each
#: fold, of which there are 20 at most.
COARSE, PLACES = 1.0, 160
#: Share of the way between the ends of an interval by which joints may go beyond them in any case.
BEYOND_ENDS = 0.1
#: Share of its length by which joints may go beyond the ends of a chord.
BESIDE_CHORD = 0.3
#: [rad] how far from a fold configurations are looked for first, and at last: rounding may leave none just there.
AT_FOLD, BESIDE_FOLD = 1e-8, 1e-2
#: Intervals that wait their turn; and that are halved at most: rows that want more are no smooth functions, as where a
#: joint may have any value.
WAITING, MOST_HALVED = 48, 500


class NearSeed(NamedTuple):
    """What the search needs."""

    seed: Array  # (7,) where only solutions as near to it as the nearest one are wanted; NaN for all of them [rad]
    bounds: Array  # (2, 7) lower and upper limits of all angles, also of those with several equivalents within [rad]
    best: Array  # (1,) least distance of a configuration within the limits so far [rad]
    halved: NDArray[np.int64]  # (1,) how many intervals were
    angles: Array  # (PLACES,) along arcs: both ends of intervals, and their middles [rad]
    places: Array  # (PLACES, 8, 7) the rows there
    waiting: Array  # (WAITING, 17) intervals: angles, how far joints may go beyond the ends, configurations there


class Arc(NamedTuple):
    """Values of joint 3 from one fold to the next, or all round where there is none."""

    middle: float  # [rad]
    half: float  # [rad]
    is_round: bool


def make_near_seed() -> NearSeed:
    """Fresh arrays, without a seed."""
    return NearSeed(
        np.full(7, np.nan),
        np.array([np.full(7, -np.inf), np.full(7, np.inf)]),
        np.zeros(1),
        np.zeros(1, np.int64),
        np.zeros(PLACES),
        np.empty((PLACES, MOST_AT_Q3, 7)),
        np.empty((WAITING, 17)),
    )


def add_chords(limits: Array, seven: SevenJoints, count: int, near: NearSeed, loops: Loops, walk: Walk) -> bool:
    """Enter chords as curves, on one of which the nearest configuration is; False where that is not known.

    Args:
        limits: (2, 7), infinite for none [rad].
        seven: the arm, and the folds of this target.
        count: of the folds.
        near: the seed.
        loops: filled, without curves.
        walk: the curves, for tangents.
    """
    near.best[0], near.halved[0], size = math.inf, 0, 0
    for n in range(max(count, 1)):
        size = place_arc(walk, seven, arc_of(seven.folds, count, n), near, size)
        if size < 0:
            return False
    size = 0
    for n in range(max(count, 1)):
        arc = arc_of(seven.folds, count, n)
        for _ in range(parts_of(arc)):
            for row in range(MOST_AT_Q3):
                known = not math.isnan(near.places[size + 1, row, 0])
                if known and not search_interval(limits, seven, arc, row, size, near, loops, walk):
                    return False
            size += 2
        size += 1
    return True


def arc_of(folds: Array, count: int, n: int) -> Arc:
    """The arc that begins at one of so many folds."""
    if count == 0:
        return Arc(0.0, math.pi, True)
    end = folds[n + 1] if n + 1 < count else folds[0] + TURN
    return Arc(0.5 * (folds[n] + end), 0.5 * (end - folds[n]), False)


def parts_of(arc: Arc) -> int:
    """How many intervals of an arc there are to begin with."""
    return math.ceil(2.0 * arc.half / COARSE)


def joint_3(arc: Arc, angle: float) -> float:
    """The value at an angle along an arc, from 0 to pi."""
    if arc.is_round:
        return arc.middle + arc.half * (2.0 * angle / math.pi - 1.0)
    return arc.middle - arc.half * math.cos(angle)


def place_arc(walk: Walk, seven: SevenJoints, arc: Arc, near: NearSeed, size: int) -> int:
    """Append the rows at ends and middles of the intervals of an arc; the next place, -1 where that is not known."""
    parts = 2 * parts_of(arc)
    for n in range(1, parts + 2):
        i = size + n % (parts + 1)  # the first one last: the next one tells which rows there are
        angle, inwards, aside = math.pi * (n % (parts + 1)) / parts, 0.0, 0.0
        if not arc.is_round and n >= parts:
            inwards, aside = (-1.0 if n == parts else 1.0), AT_FOLD
        while True:
            near.angles[i] = angle + inwards * aside
            solve_at_q3(walk.chain, seven.arm, walk.T, joint_3(arc, near.angles[i]), near.places[i])
            known = True
            for row in range(MOST_AT_Q3):
                known = known and (
                    n == 1 or math.isnan(near.places[i, row, 0]) == math.isnan(near.places[size + 1, row, 0])
                )
            if known:
                break
            aside *= 10.0
            if not 0.0 < aside < BESIDE_FOLD:
                return -1
        for row in range(MOST_AT_Q3):
            offer_row(near.places[i, row], 7, near)
    return size + parts + 1


def offer_row(x: Array, joints: int, near: NearSeed) -> None:
    """Take a configuration within the limits for the best so far if it is nearer, by so many joints; NaN for none."""
    if math.isnan(x[0]):
        return
    square = 0.0
    for j in range(7):
        low, high = near.bounds[0, j], near.bounds[1, j]
        angle = copy_within_limits(x[j], near.seed[j], low, high, LIMIT_SNAP)
        if not low <= angle <= high:
            return
        if j < joints:
            square += (angle - near.seed[j]) * (angle - near.seed[j])
    if square < near.best[0] * near.best[0]:
        near.best[0] = math.sqrt(square)


def search_interval(
    limits: Array,
    seven: SevenJoints,
    arc: Arc,
    row: int,
    first: int,
    near: NearSeed,
    loops: Loops,
    walk: Walk,
) -> bool:
    """Enter chords of a row between two places, with one between them; False where that takes too much."""
    waiting, top, x = near.waiting, 1, near.places[first + 1, row]
    for side in range(2):
        waiting[0, side] = near.angles[first + 2 * side]
        for j in range(7):
            waiting[0, 3 + 7 * side + j] = near.places[first + 2 * side, row, j]
    halve(near, 0, near.angles[first + 1], x)
    while top >= 0:
        item = waiting[top]
        if bound(item, limits, near.seed) >= near.best[0] or enter_chord(item, loops, walk):
            top -= 1
        else:
            angle = 0.5 * (item[0] + item[1])
            x = seven.rows[row]
            solve_rows_at_q3(walk.chain, seven.arm, walk.T, joint_3(arc, angle), row, row + 1, seven.rows)
            near.halved[0] += 1
            if top + 1 == WAITING or near.halved[0] > MOST_HALVED or math.isnan(x[0]):
                return False
            offer_row(x, 7, near)
            halve(near, top, angle, x)
            top += 1
    return True


def halve(near: NearSeed, top: int, angle: float, x: Array) -> None:
    """Replace interval top by its halves, on both sides of a configuration."""
    item, other, span, bend = near.waiting[top], near.waiting[top + 1], 0.0, 0.0
    for j in range(7):
        before, after = wrapped(x[j] - item[3 + j]), wrapped(item[10 + j] - x[j])
        bend, span = max(bend, 0.5 * abs(after - before)), max(span, abs(before), abs(after))
        other[3 + j], other[10 + j], item[10 + j] = x[j], item[10 + j], x[j]
    other[0], other[1], item[1] = angle, item[1], angle
    item[2] = bend + BEYOND_ENDS * span
    other[2] = item[2]


def bound(item: Array, limits: Array, seed: Array) -> float:
    """No configuration of an interval is nearer to the seed [rad]; inf where none is within the limits."""
    square = 0.0
    for j in range(7):
        way = 0.5 * wrapped(item[10 + j] - item[3 + j])
        reach = abs(way) if j == 2 else abs(way) + item[2]
        centre = item[3 + j] + way
        away = abs(wrapped(centre - seed[j]))
        if limits[0, j] > -math.inf:
            middle = 0.5 * (limits[0, j] + limits[1, j])
            d = wrapped(centre - middle)
            if abs(d) - reach > limits[1, j] - middle:
                return math.inf
            if abs(d) + reach < math.pi:
                away = abs(middle + d - seed[j])
        if away > reach:
            square += (away - reach) * (away - reach)
    return math.sqrt(square)


def enter_chord(item: Array, loops: Loops, walk: Walk) -> bool:
    """Enter an interval as a curve of two nodes; False where it is not nearly straight, or there is no room."""
    square, first = 0.0, loops.size[0]
    for j in range(7):
        walk.border[j] = wrapped(item[10 + j] - item[3 + j])
        square += walk.border[j] * walk.border[j]
    length = math.sqrt(square)
    is_short = length <= RESOLUTION  # there curves meet
    if not is_short and not (length <= LONGEST_STEP and item[2] <= BESIDE_CHORD * length):
        return False
    if loops.size[1] == loops.ends.shape[0]:
        return False
    for n in range(2):
        for j in range(7):
            walk.z[j] = item[3 + j] + n * walk.border[j]
        along = 0.0
        if tangent(walk.z, walk.border, walk.tz, walk) != 0.0:
            for j in range(7):
                along += walk.border[j] * walk.tz[j]
        if not (is_short or along >= LEAST_COSINE * length) or add_node(loops, walk.z, walk.tz, 0) < 0:
            loops.size[0] = first
            return False
    enter_run(loops, first, CurveEnd.LOST)
    return True
