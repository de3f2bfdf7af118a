"""The chords of curves on which the configuration nearest to a seed may lie, where folds are known beforehand.

Between two folds each row of `seven_joints.solve_at_q3`, or of `end_wrist`, is a smooth function of the parameter, so
that no curve is followed: intervals of the parameter are halved, and left out where no configuration in them can be
within the limits and nearer than the nearest one so far. Within a half, joints go beyond their values at its ends by
less than the middle of the whole was beside the line between its ends. Next to a fold that holds for the angle of which
the parameter is the cosine.

An arm that nearly has such a structure, as one whose wrist's axes miss each other by a part of a millimetre, is
searched as the arm that has it. Its configurations lead to those of the arm itself, by the least steps. Where one is
farther away than expected, as next to where curves all but meet, or folds may be elsewhere, the arm's own curves are
followed, from what its configurations between each two folds lead to; where one is lost, nothing is known.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.chain import Newton
from jacokin.kernels.closed_form.arm import unpack_arm
from jacokin.kernels.limits import TURN, copy_within_limits, nearest_copy
from jacokin.kernels.solution_set.curve import (
    LARGEST_RESIDUAL,
    LEAST_COSINE,
    LONGEST_STEP,
    RESIDUAL,
    RESOLUTION,
    Walk,
    tangent,
    to_curve,
    wrapped,
)
from jacokin.kernels.solution_set.end_wrist import column_of, solve_wrist_rows
from jacokin.kernels.solution_set.seven_joints import MOST_ROWS, ROUNDING, solve_rows_at_q3
from jacokin.kernels.solution_set.slices import JOINT_3, SLICES, SevenJoints, SixJoints, Slices
from jacokin.kernels.solution_set.starts import FARTHEST_START, descend
from jacokin.kernels.solution_set.trace import CurveEnd, Loops, add_node, enter_run, is_traced, trace
from jacokin.kernels.tolerances import LIMIT_SNAP

#: [rad] longest interval of the parameter to begin with, and arcs and places there is room for: one arc for each fold,
#: of which there are 20 at most, and twice the intervals and one for each arc.
COARSE, ARCS, PLACES = 1.0, 32, 160
#: Share of the way between the ends of an interval by which joints may go beyond them in any case.
BEYOND_ENDS = 0.1
#: Share of its length by which joints may go beyond the ends of a chord.
BESIDE_CHORD = 0.3
#: [rad] how far from a fold configurations are looked for first, and at last: rounding may leave none just there.
AT_FOLD, BESIDE_FOLD = 1e-8, 1e-2
#: Times as far from straight as from the fold itself a wrist is there: between, it might be straight and turn about.
STRAIGHT = 10.0
#: [rad] how far beyond the nearest solution so far others are looked for.
BEYOND = 1e-6
#: Intervals that wait their turn; and that are halved at most: rows that want more are no smooth functions, as where a
#: joint may have any value.
WAITING, MOST_HALVED = 48, 500
#: Share of its reach by which a joint of a structure may miss its equation where the arm itself may have solutions.
MISSED = 0.1


class NearSeed(NamedTuple):
    """What the search needs."""

    seed: Array  # (7,) where only solutions as near to it as the nearest one are wanted; NaN for all of them [rad]
    bounds: Array  # (2, 7) lower and upper limits of all angles, also of those with several equivalents within [rad]
    best: Array  # (1,) least distance of a configuration within the limits so far [rad]
    slack: Array  # (1,) how far the arm is from its configurations as a structure, at most [rad]; 0 where it has that
    halved: NDArray[np.int64]  # (1,) how many intervals were
    arcs: Array  # (ARCS, 6) those that count, and how many intervals each has
    angles: Array  # (PLACES,) along arcs: both ends of intervals, and their middles [rad]
    places: Array  # (PLACES, 8, 7) the rows there
    waiting: Array  # (WAITING, 17) intervals: angles, how far joints may go beyond the ends, configurations there


class Parts(NamedTuple):
    """What gives the rows at each value of the parameter."""

    kind: int  # which joint is the parameter, see `slices`
    joints: int  # of the arm: another angle is one about a free axis, and its distance from the seed does not count
    six: SixJoints
    seven: SevenJoints  # and the rows and folds of six joints
    walk: Walk  # chain of the arm itself, target, and index of the parameter
    newton: Newton


def solve_rows(parts: Parts, p: float, low: int, high: int, rows: Array) -> None:
    """Fill rows low to high - 1 with the configurations at a value of the parameter; NaN for none."""
    if parts.kind == JOINT_3:
        solve_rows_at_q3(parts.walk.chain, parts.seven.arm, parts.walk.T, p, low, high, rows)
    else:
        solve_wrist_rows(parts.six, parts.kind, p, low, high, rows, ROUNDING)


class Arc(NamedTuple):
    """Values of the parameter from one fold to the next, or all round where there is none, as far as they count."""

    middle: float  # [rad]
    half: float  # [rad]
    is_round: bool
    first: float  # angles along it, from 0 to pi
    last: float


def make_near_seed() -> NearSeed:
    """Fresh arrays, without a seed."""
    return NearSeed(
        np.full(7, np.nan),
        np.array([np.full(7, -np.inf), np.full(7, np.inf)]),
        np.zeros(1),
        np.zeros(1),
        np.zeros(1, np.int64),
        np.zeros((ARCS, 6)),
        np.zeros(PLACES),
        np.empty((PLACES, MOST_ROWS, 7)),
        np.empty((WAITING, 17)),
    )


def add_chords(limits: Array, parts: Parts, count: int, near: NearSeed, loops: Loops) -> bool:
    """Enter chords as curves, on one of which the nearest configuration is; False where that is not known.

    Args:
        limits: (2, 7), infinite for none [rad].
        parts: the arm, the target, and the folds.
        count: of the folds.
        near: the seed.
        loops: filled, without curves.
    """
    near.halved[0], size, arcs, folds = 0, 0, 0, parts.seven.folds
    for n in range(max(count, 1)):
        for turn in range(-1, 2 if count > 0 else 0):
            arc = part_of(arc_of(folds, count, n), loops.window, turn)
            if arc.first < arc.last:
                if arcs == ARCS:
                    return False
                intervals = math.ceil((parameter_at(arc, arc.last) - parameter_at(arc, arc.first)) / COARSE)
                write_arc(near.arcs[arcs], arc, intervals)
                arcs += 1
                size = place_arc(parts, arc, 2 * intervals, near, size)
                if size < 0:
                    return False
    size = 0
    for n in range(arcs):
        arc = read_arc(near.arcs[n])
        for _ in range(int(near.arcs[n, 5])):
            for row in range(MOST_ROWS):
                known = not math.isnan(near.places[size + 1, row, 0])
                if known and not search_interval(limits, parts, arc, row, size, near, loops):
                    return False
            size += 2
        size += 1
    return True


def follow_arcs(parts: Parts, count: int, near: NearSeed, loops: Loops, slices: Slices) -> bool:
    """Follow the arm's own curves from slices, one in the middle of each arc that counts; False where one may be lost.

    A row that leads to no solution there, where folds of the arm and of the structure are not the same, leads to one
    of these curves.

    Args:
        parts: the arm, which nearly has a wrist at an end; the target, and the folds.
        count: of the folds.
        near: work arrays.
        loops: the window; filled.
        slices: appended to.
    """
    arcs, walk, rows = 0, parts.walk, parts.seven.rows
    for n in range(max(count, 1)):
        for turn in range(-1, 2 if count > 0 else 0):
            arc = part_of(arc_of(parts.seven.folds, count, n), loops.window, turn)
            if arc.first < arc.last:
                if arcs == PLACES:
                    return False
                near.angles[arcs] = wrapped(parameter_at(arc, 0.5 * (arc.first + arc.last)))
                if not add_settled(parts, near.angles[arcs], near.places[arcs], slices):
                    return False
                arcs += 1
    trace(slices, loops, walk)
    for i in range(arcs):
        for row in range(MOST_ROWS):
            x = near.places[i, row : row + 1]
            if math.isnan(x[0, 0]):
                continue
            for j in range(7):
                walk.z[j] = x[0, j]
            leads = descend(parts.newton, walk) <= LARGEST_RESIDUAL
            if leads and not is_traced(loops, walk.z):
                return False
            if not (leads and is_among(walk.z, x, 1, FARTHEST_START)):
                solve_wrist_rows(parts.six, parts.kind, near.angles[i], row, row + 1, rows, ROUNDING)
                if not math.isnan(rows[row, 0]):
                    return False
    return True


def add_settled(parts: Parts, p: float, rows: Array, slices: Slices) -> bool:
    """Append a slice of the arm itself, near to the rows of a structure; False for no room.

    Rows (8, 7) are filled with those that lead to no solution at this value of the parameter, NaN for others.
    """
    i, count, walk = slices.size[0], 0, parts.walk
    if i == SLICES:
        return False
    solve_wrist_rows(parts.six, parts.kind, p, 0, MOST_ROWS, rows, MISSED)
    for row in range(MOST_ROWS):
        if math.isnan(rows[row, 0]):
            continue
        for j in range(7):
            walk.z[j] = rows[row, j]
            walk.border[j] = 1.0 if j == walk.parameter[0] else 0.0
        residual, _ = to_curve(walk.border, p, RESIDUAL, walk.z, walk.tz, walk)
        if residual <= LARGEST_RESIDUAL and is_among(walk.z, rows[row : row + 1], 1, FARTHEST_START):
            rows[row, 0] = math.nan
            if not is_among(walk.z, slices.x[i], count, RESOLUTION):
                for j in range(7):
                    slices.x[i, count, j] = walk.z[j]
                slices.passed[i, count] = 0
                count += 1
    slices.p[i], slices.counts[i], slices.doubt[i] = p, count, 0
    slices.size[0] = i + 1
    return True


def is_among(x: Array, points: Array, count: int, distance: float) -> bool:
    """Whether a point is one of so many, to a distance in each angle [rad]."""
    for n in range(count):
        away = 0.0
        for j in range(7):
            away = max(away, abs(wrapped(points[n, j] - x[j])))
        if away <= distance:
            return True
    return False


def arc_of(folds: Array, count: int, n: int) -> Arc:
    """The arc that begins at one of so many folds."""
    if count == 0:
        return Arc(0.0, math.pi, True, 0.0, math.pi)
    end = folds[n + 1] if n + 1 < count else folds[0] + TURN
    return Arc(0.5 * (folds[n] + end), 0.5 * (end - folds[n]), False, 0.0, math.pi)


def part_of(arc: Arc, window: Array, turn: int) -> Arc:
    """What of an arc is in a window, or so many turns away from it: nothing where it ends before it begins.

    All of it is where the window has no end, and once only.
    """
    if window[1] == math.inf or arc.half == 0.0:
        return Arc(arc.middle, arc.half, arc.is_round, 0.0, math.pi if turn == -1 and arc.half > 0.0 else 0.0)
    if arc.is_round:
        return Arc(window[0], window[1], True, 0.0, math.pi)
    centre = nearest_copy(window[0], arc.middle) + TURN * turn
    first = math.acos(min(max((arc.middle - centre + window[1]) / arc.half, -1.0), 1.0))
    last = math.acos(min(max((arc.middle - centre - window[1]) / arc.half, -1.0), 1.0))
    if first < BESIDE_FOLD:
        first = 0.0
    if last > math.pi - BESIDE_FOLD:
        last = math.pi
    return Arc(arc.middle, arc.half, False, first, last)


def write_arc(into: Array, arc: Arc, intervals: int) -> None:
    """Keep an arc, and how many intervals it has."""
    into[0], into[1], into[2] = arc.middle, arc.half, 1.0 if arc.is_round else 0.0
    into[3], into[4], into[5] = arc.first, arc.last, intervals


def read_arc(kept: Array) -> Arc:
    """An arc that was kept."""
    return Arc(kept[0], kept[1], kept[2] > 0.0, kept[3], kept[4])


def parameter_at(arc: Arc, angle: float) -> float:
    """The value at an angle along an arc, from 0 to pi."""
    if arc.is_round:
        return arc.middle + arc.half * (2.0 * angle / math.pi - 1.0)
    return arc.middle - arc.half * math.cos(angle)


def place_arc(parts: Parts, arc: Arc, halves: int, near: NearSeed, size: int) -> int:
    """Append the rows at ends and middles of the intervals of an arc; the next place, -1 where that is not known."""
    for n in range(1, halves + 2):
        i = size + n % (halves + 1)  # the first one last: the next one tells which rows there are
        share, inwards, aside = (n % (halves + 1)) / halves, 0.0, 0.0
        angle = (1.0 - share) * arc.first + share * arc.last
        if not arc.is_round and (angle == 0.0 or angle == math.pi):
            inwards, aside = (1.0 if angle == 0.0 else -1.0), AT_FOLD
        while True:
            near.angles[i] = angle + inwards * aside
            solve_rows(parts, parameter_at(arc, near.angles[i]), 0, MOST_ROWS, near.places[i])
            known = True
            for row in range(MOST_ROWS):
                known = known and (
                    n == 1 or math.isnan(near.places[i, row, 0]) == math.isnan(near.places[size + 1, row, 0])
                )
            if known:
                break
            aside *= 10.0
            if not 0.0 < aside < BESIDE_FOLD:
                return -1
        if aside > 0.0 and is_straight(near.places[i], middle_of_wrist(parts), STRAIGHT * aside):
            return -1
        for row in range(MOST_ROWS):
            if not offer_settled(near.places[i, row], parts, near):
                return -1
    return size + halves + 1


def middle_of_wrist(parts: Parts) -> int:
    """Index among seven angles of the joint in the middle of the wrist."""
    return 5 if parts.kind == JOINT_3 else column_of(unpack_arm(parts.six.arm).six, parts.kind, 4)


def is_straight(rows: Array, j: int, least: float) -> bool:
    """Whether axes beside joint j of a wrist are on one line in some row, to a sine; pairs turn it both ways."""
    for row in range(0, MOST_ROWS, 2):
        if not math.isnan(rows[row, 0]) and abs(math.sin(0.5 * (rows[row, j] - rows[row + 1, j]))) <= least:
            return True
    return False


def offer_row(x: Array, joints: int, near: NearSeed) -> None:
    """Take a configuration within the limits for the best so far if it is nearer, by so many joints; NaN for none."""
    near.best[0] = min(near.best[0], away_from_seed(x, joints, near, 0.0))


def away_from_seed(x: Array, joints: int, near: NearSeed, slack: float) -> float:
    """How far a configuration is from the seed [rad]; inf for none, and outside the limits by more than a slack."""
    if math.isnan(x[0]):
        return math.inf
    square = 0.0
    for j in range(7):
        low, high = near.bounds[0, j] - slack, near.bounds[1, j] + slack
        angle = copy_within_limits(x[j], near.seed[j], low, high, LIMIT_SNAP)
        if not low <= angle <= high:
            return math.inf
        if j < joints:
            square += (angle - near.seed[j]) * (angle - near.seed[j])
    return math.sqrt(square)


def offer_settled(x: Array, parts: Parts, near: NearSeed) -> bool:
    """Offer the configuration of the arm itself that one of its structure leads to; False where there is none."""
    slack = near.slack[0]
    if not away_from_seed(x, parts.joints, near, slack) - slack < near.best[0]:
        return True
    if slack == 0.0:
        offer_row(x, parts.joints, near)
        return True
    if not settle(x, parts, slack):
        return False
    offer_row(parts.walk.z, parts.joints, near)
    return True


def settle(x: Array, parts: Parts, slack: float) -> bool:
    """Fill walk.z with the configuration of the arm itself within a slack that one leads to; False for none."""
    z, square = parts.walk.z, 0.0
    for j in range(7):
        z[j] = x[j]
    if slack == 0.0:
        return True
    missing = descend(parts.newton, parts.walk)
    for j in range(7):
        square += (z[j] - x[j]) * (z[j] - x[j])
    return bool(missing <= LARGEST_RESIDUAL and square <= slack * slack)


def search_interval(limits: Array, parts: Parts, arc: Arc, row: int, first: int, near: NearSeed, loops: Loops) -> bool:
    """Enter chords of a row between two places, with one between them; False where that takes too much."""
    waiting, top, x = near.waiting, 1, near.places[first + 1, row]
    for side in range(2):
        waiting[0, side] = near.angles[first + 2 * side]
        for j in range(7):
            waiting[0, 3 + 7 * side + j] = near.places[first + 2 * side, row, j]
    halve(near, 0, near.angles[first + 1], x)
    while top >= 0:
        item = waiting[top]
        if bound(item, limits, parts, near) > near.best[0] + BEYOND or enter_chord(item, loops, parts, near):
            top -= 1
        else:
            angle = 0.5 * (item[0] + item[1])
            x = parts.seven.rows[row]
            solve_rows(parts, parameter_at(arc, angle), row, row + 1, parts.seven.rows)
            near.halved[0] += 1
            if top + 1 == WAITING or near.halved[0] > MOST_HALVED or math.isnan(x[0]):
                return False
            if not offer_settled(x, parts, near):
                return False
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


def bound(item: Array, limits: Array, parts: Parts, near: NearSeed) -> float:
    """No configuration of an interval is nearer to the seed [rad]; inf where none is within the limits."""
    square = 0.0
    for j in range(7):
        way = 0.5 * wrapped(item[10 + j] - item[3 + j])
        reach = near.slack[0] + (abs(way) if j == parts.walk.parameter[0] else abs(way) + item[2])
        centre = item[3 + j] + way
        away = abs(wrapped(centre - near.seed[j]))
        if limits[0, j] > -math.inf:
            middle = 0.5 * (limits[0, j] + limits[1, j])
            d = wrapped(centre - middle)
            if abs(d) - reach > limits[1, j] - middle:
                return math.inf
            if abs(d) + reach < math.pi:
                away = abs(middle + d - near.seed[j])
        if away > reach and j < parts.joints:
            square += (away - reach) * (away - reach)
    return math.sqrt(square)


def enter_chord(item: Array, loops: Loops, parts: Parts, near: NearSeed) -> bool:
    """Enter an interval as a curve of two nodes; False where it is not nearly straight, or there is no room."""
    square, first, walk = 0.0, loops.size[0], parts.walk
    for n in range(2):
        if not settle(item[3 + 7 * n : 10 + 7 * n], parts, near.slack[0]):
            near.halved[0] = MOST_HALVED  # nothing is known
            return False
        for j in range(7):
            walk.x[j] = walk.y[j]
            walk.y[j] = walk.z[j]
    for j in range(7):
        walk.border[j] = wrapped(walk.y[j] - walk.x[j])
        square += walk.border[j] * walk.border[j]
    length = math.sqrt(square)
    is_short = length <= RESOLUTION  # there curves meet
    if not is_short and not (length <= LONGEST_STEP and item[2] <= BESIDE_CHORD * length):
        return False
    if loops.size[1] == loops.ends.shape[0]:
        return False
    for n in range(2):
        for j in range(7):
            walk.z[j] = walk.x[j] + n * walk.border[j]
        along = 0.0
        if tangent(walk.z, walk.border, walk.tz, walk) != 0.0:
            for j in range(7):
                along += walk.border[j] * walk.tz[j]
        if not (is_short or along >= LEAST_COSINE * length) or add_node(loops, walk.z, walk.tz, 0) < 0:
            loops.size[0] = first
            return False
    enter_run(loops, first, CurveEnd.LOST)
    return True
