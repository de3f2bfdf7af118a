"""How much of a displacement keeps shapes apart: distances where it leads, and on the way to rest from there.

A part of the way from braking to the displacement is tried. It may be taken where no pair gets too near, and where an
arm that brakes from then on comes to rest without coming too near to anything. Obstacles may move.

Of most pairs a lower bound of the distance is all that is needed: what was measured once, less what the arm and the
obstacle have moved since. A pair is measured where its bound leaves a question open: whether it is too near, whether it
is the nearest, whether a displacement or the way to rest could bring it too near.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.contact.arm import Places, place_links
from jacokin.kernels.contact.cloud_surface import AROUND_NUMBERS, MOST_AROUND
from jacokin.kernels.contact.pairs import (
    CORNERS,
    DENSE,
    LEVEL,
    MOST_POINTS,
    SURFACE_NUMBERS,
    measure_pair,
    measure_surfaces,
)
from jacokin.kernels.contact.run import NOTHING
from jacokin.kernels.contact.separation import SeparationWork, make_separation_work
from jacokin.kernels.contact.shapes import CENTRE
from jacokin.kernels.contact.touching import Geometry
from jacokin.kernels.tracking.limits import CHANGE, LIMIT_NUMBERS, brake, braking_way, move
from jacokin.kernels.tracking.near import CLOSING, DISTANCE, GAP, KEPT, NEAR_NUMBERS, NORMAL, POINT, WORSE
from jacokin.kernels.trigonometry import sin_cos
from jacokin.kernels.vector import Vec, cross, dot, norm, rotated

#: [m] beyond the distance in question up to which distances are measured.
HORIZON = 0.05
#: [m] shapes may come nearer than the distance between two places of a way to rest that are looked at.
BETWEEN = 0.01
#: Places of a way to rest that are looked at, before it counts as not clear, and parts of it that wait meanwhile.
LOOKS, DEPTH = 48, 14
#: Columns of a pair's integers: its shapes as they are measured, 1 where these are exchanged, the row of the obstacle
#: that can move or -1, and 1 while something is inside its obstacle: then it is free, as the way out may lead others
#: deeper first. The joints between its shapes are those from the first one to before the last.
FIRST, SECOND, EXCHANGED, MOVER, LEAVING, INNER, OUTER, PAIR_INTEGERS = range(8)
#: Counts: links and groups of shapes; whether any obstacle moves; what to find out, see below; filled: pairs near.
LINKS, GROUPS, MOVING, ASKED, NEAR = range(5)
#: Numbers: the distance allowed, and the one below which pairs are measured always [m]; control step [s], time in which
#: moving obstacles are looked at [s], the part of the way from braking to the displacement, how far beyond the distance
#: in question is measured [m], the least bound of all pairs before [m]; filled: that after, and the least distance on
#: the way to rest less the one needed [m].
ALLOWED, CLOSE, TIME_STEP, FORESIGHT, PART, BEYOND, LEAST_BEFORE, LEAST, SPARE, REACH_NUMBERS = range(10)
#: What to find out: distances; whether they are kept; whether the arm could come to rest.
DISTANCES, KEEPING, RESTING = 0, 1, 2
#: What `try_reach` returns: too near; the arm could come to rest, or that was not asked; it could not.
TOO_NEAR, CLEAR, NOT_CLEAR = range(3)


class Pairs(NamedTuple):
    """Pairs of shapes that are kept apart."""

    integers: NDArray[np.int64]  # (pairs, 7)
    lever: NDArray[np.int64]  # (pairs,) number of its lever
    mover: NDArray[np.int64]  # (pairs,) its obstacle in the coming and the shifts of `Movers`
    exits: Array  # (pairs, 3) out of the obstacle, for pairs that leave one; unit vectors
    before: Array  # (pairs,) at least how far apart it was [m]
    bound: Array  # (pairs,) filled: at least how far apart it is [m]
    exact: NDArray[np.int64]  # (pairs,) filled with 1 where that is the distance itself
    kept: Array  # (pairs,) the distance that is kept; less where no motion gives it [m]
    needed: Array  # (pairs,) at least how far apart it is to be on the way to rest [m]


class Levers(NamedTuple):
    """How far joints move pairs nearer at most; many pairs have the same lever."""

    lengths: Array  # (k dof,) [m/rad]
    watched: Array  # (k,) distance below which a displacement is to keep its pairs apart [m]
    ways: Array  # (k,) to work in: how far all joints move its pairs nearer at most [m]


class Movers(NamedTuple):
    """Obstacles that can move."""

    shapes: NDArray[np.int64]  # (k,) their numbers
    poses: Array  # (k, 3, 4) in the base
    twists: Array  # (k, 6) velocity of the shape's origin [m/s], then angular [rad/s], in base axes
    speeds: Array  # (k,) largest speed of any point [m/s]
    centres: Array  # (k, 3) of the spheres around them, in their frames [m]
    coming: Array  # (k + 1,) farthest that any point moves in the time looked at [m]; the last stand still
    shifts: Array  # (k + 1,) farthest that any point has moved since distances were measured [m]


class Waiting(NamedTuple):
    """Parts of a way to rest that are to be looked into, each with pairs and their distances at its ends."""

    ends: NDArray[np.int64]  # (DEPTH, 3) first and last tick, and how many pairs
    pairs: NDArray[np.int64]  # (DEPTH pairs,)
    first: Array  # (DEPTH pairs,) [m]
    last: Array  # (DEPTH pairs,) [m]


class ReachWork(NamedTuple):
    """What a call reads and writes."""

    counts: NDArray[np.int64]  # (5,)
    numbers: Array  # (9,)
    limits: Array  # (dof, 8) see `limits`
    start: Array  # (dof,) where the arm is [rad]
    v: Array  # (dof,) its velocity over the last tick [rad/s]
    displacement: Array  # (dof,) that is to be made [rad]
    q: Array  # (dof,) filled: where a part of it leads [rad]
    braking: Array  # (dof,) displacement by braking [rad]
    unit: Array  # (dof,) what a tick of braking takes from a displacement, after the tick, with the sign of that [rad]
    speed: Array  # (dof,) the displacement of the tick in that
    at: Array  # (dof,) to work in
    geometry: Geometry
    places: Places
    pair: SeparationWork
    measured: Array  # (1, 11) to work in
    corners: Array  # (MOST_POINTS, 11) to work in, more than 1 + CORNERS
    points: NDArray[np.int64]  # (DENSE,) to work in
    around: Array  # (MOST_AROUND, 4) to work in
    pairs: Pairs
    levers: Levers
    near: NDArray[np.int64]  # (pairs,) filled: pairs in the watched range
    rows: Array  # (pairs, 10) filled with their numbers, see `near`
    movers: Movers
    waiting: Waiting


def make_reach_work(geometry: Geometry = NOTHING, pairs: int = 0, movers: int = 0, levers: int = 0) -> ReachWork:
    """Fresh work arrays for an arm among obstacles, so many pairs of shapes, obstacles that can move, and levers."""
    dof, groups = len(geometry.arm.joint_kinds), len(geometry.arm.groups)
    frames = np.zeros((dof + 2 if dof else 0, 3, 4))
    frames[:] = np.eye(3, 4)
    room = DEPTH * pairs
    return ReachWork(
        np.array([dof, groups, 0, 0, 0]),
        np.zeros(REACH_NUMBERS),
        np.zeros((dof, LIMIT_NUMBERS)),
        np.zeros(dof),
        np.zeros(dof),
        np.zeros(dof),
        np.zeros(dof),
        np.zeros(dof),
        np.zeros(dof),
        np.zeros(dof),
        np.zeros(dof),
        geometry,
        Places(frames, np.zeros((groups, 3)), np.zeros(groups * (dof + 1))),
        make_separation_work(),
        np.zeros((1, SURFACE_NUMBERS)),
        np.zeros((max(1 + CORNERS, MOST_POINTS), SURFACE_NUMBERS)),
        np.zeros(DENSE, np.int64),
        np.zeros((MOST_AROUND if pairs else 0, AROUND_NUMBERS)),
        Pairs(
            np.zeros((pairs, PAIR_INTEGERS), np.int64),
            np.zeros(pairs, np.int64),
            np.zeros(pairs, np.int64),
            np.zeros((pairs, 3)),
            np.zeros(pairs),
            np.zeros(pairs),
            np.zeros(pairs, np.int64),
            np.zeros(pairs),
            np.zeros(pairs),
        ),
        Levers(np.zeros(levers * dof), np.zeros(levers), np.zeros(levers)),
        np.zeros(pairs, np.int64),
        np.zeros((pairs, NEAR_NUMBERS)),
        Movers(
            np.zeros(movers, np.int64),
            np.zeros((movers, 3, 4)),
            np.zeros((movers, 6)),
            np.zeros(movers),
            np.zeros((movers, 3)),
            np.zeros(movers + 1 if pairs else 0),
            np.zeros(movers + 1 if pairs else 0),
        ),
        Waiting(np.zeros((DEPTH, 3), np.int64), np.zeros(room, np.int64), np.zeros(room), np.zeros(room)),
    )


def try_reach(work: ReachWork) -> int:
    """Measure where a part of a displacement leads, and find out what is asked."""
    brake(work.limits, work.v, work.numbers[TIME_STEP], work.braking)
    for j in range(len(work.q)):
        work.at[j] = work.braking[j] + work.numbers[PART] * (work.displacement[j] - work.braking[j])
    move(work.limits, work.start, work.at, work.q)
    measure_distances(work)
    asked = work.counts[ASKED]
    if asked & KEEPING and not keeps_distances(work):
        return TOO_NEAR
    if asked & RESTING and not rests_clear(work):
        return NOT_CLEAR
    return CLEAR


def measure_distances(work: ReachWork) -> None:
    """Fill bounds, and the pairs that are near with their numbers.

    Those that may be too near are measured, and those of the watched ones that may be the nearest.
    """
    pairs, movers, ways = work.pairs, work.movers, work.levers.ways
    place_links(work.geometry.arm, work.counts[LINKS], work.counts[GROUPS], work.q, work.places)
    for j in range(len(work.q)):
        work.at[j] = work.q[j] - work.start[j]
    fill_ways(work)
    for i in range(len(pairs.bound)):
        pairs.bound[i] = pairs.before[i] - ways[pairs.lever[i]] - movers.shifts[pairs.mover[i]]
        pairs.exact[i] = 0
    first, nearest, least = nearest_pair(work), math.inf, math.inf
    work.counts[NEAR] = 0
    if first >= 0:
        bound = measure_within(work, first, math.inf)
        nearest = bound if pairs.exact[first] == 1 else math.inf
    coming = largest(movers.coming)
    close, watched = work.numbers[CLOSE] + coming, largest(work.levers.watched) + coming
    for i in range(len(pairs.bound)):
        bound = pairs.bound[i]
        if bound < min(max(close, nearest), watched):
            bound = measure_within(work, i, max(work.numbers[CLOSE] + movers.coming[pairs.mover[i]], nearest))
            if pairs.exact[i] == 1:
                nearest = min(nearest, bound)
        least = min(least, bound)
    work.numbers[LEAST] = least


def nearest_pair(work: ReachWork) -> int:
    """The nearest of the pairs that were near when distances were last measured; -1 for none."""
    found, least = -1, math.inf
    for k in range(work.counts[NEAR]):
        if work.rows[k, DISTANCE] < least:
            found, least = work.near[k], work.rows[k, DISTANCE]
    return int(found)


def look_ahead(work: ReachWork, q: Array, displacement: Array) -> bool:
    """Measure at a configuration, where all bounds hold, the watched pairs that a displacement could bring close.

    Returns:
        Whether shapes are placed there.
    """
    pairs, ways = work.pairs, work.levers.ways
    for j in range(len(q)):
        work.at[j] = displacement[j]
    fill_ways(work)
    most, placed = work.numbers[CLOSE] + largest(work.movers.coming) + largest(ways), False
    for i in range(len(pairs.bound)):
        if pairs.bound[i] >= most:
            continue
        within = work.numbers[CLOSE] + work.movers.coming[pairs.mover[i]] + ways[pairs.lever[i]]
        if pairs.bound[i] < within and pairs.exact[i] == 0:
            if not placed:
                place_links(work.geometry.arm, work.counts[LINKS], work.counts[GROUPS], q, work.places)
                placed = True
            measure_within(work, i, within)
    return placed


def fill_ways(work: ReachWork) -> None:
    """Fill how far each lever moves at most, by displacements of the joints."""
    levers, dof = work.levers, len(work.q)
    for k in range(len(levers.ways)):
        way = 0.0
        for j in range(dof):
            way += levers.lengths[k * dof + j] * abs(work.at[j])
        levers.ways[k] = way


def largest(values: Array) -> float:
    """The largest of some values that are not negative."""
    found = 0.0
    for i in range(len(values)):
        found = max(found, values[i])
    return found


def watched_range(work: ReachWork, i: int) -> float:
    """The distance below which a displacement is to keep a pair apart [m]."""
    return float(work.levers.watched[work.pairs.lever[i]] + work.movers.coming[work.pairs.mover[i]])


def measure_within(work: ReachWork, i: int, distance: float) -> float:
    """Measure a watched pair where everything is placed, if it may be within a distance; returns its bound [m]."""
    pairs, watched = work.pairs, watched_range(work, i)
    within = min(distance, watched)
    if pairs.bound[i] >= within or pairs.exact[i] == 1:
        return float(pairs.bound[i])
    row, reach = work.measured[0], within + work.numbers[BEYOND]
    measure_surfaces(work.geometry.shapes, work.places, work.pair, pairs.integers[i], reach, work.around, row)
    pairs.bound[i] = row[0]
    if row[0] <= reach:
        pairs.exact[i] = 1
        if row[0] < watched:
            work.near[work.counts[NEAR]] = i
            note_near(work, i, row, work.rows[work.counts[NEAR]])
            work.counts[NEAR] += 1
    return float(row[0])


def note_near(work: ReachWork, i: int, row: Array, to: Array) -> None:
    """Fill the numbers (10,) of a pair, see `near`, that was measured."""
    mover, exchanged = work.pairs.integers[i, MOVER], work.pairs.integers[i, EXCHANGED] == 1
    to[DISTANCE], to[GAP], to[CLOSING], to[KEPT] = row[0], row[LEVEL], 0.0, work.pairs.kept[i]
    for k in range(3):
        to[POINT + k] = row[1 + k] if exchanged else row[4 + k]
        to[NORMAL + k] = -row[7 + k] if exchanged else row[7 + k]
    if mover >= 0 and work.counts[MOVING] == 1:
        twist, pose = work.movers.twists[mover], work.movers.poses[mover]
        normal = (to[NORMAL], to[NORMAL + 1], to[NORMAL + 2])
        there = (
            to[POINT] - row[0] * normal[0] - pose[0, 3],
            to[POINT + 1] - row[0] * normal[1] - pose[1, 3],
            to[POINT + 2] - row[0] * normal[2] - pose[2, 3],
        )
        turning = cross((twist[3], twist[4], twist[5]), there)
        to[CLOSING] = dot((twist[0] + turning[0], twist[1] + turning[1], twist[2] + turning[2]), normal)


def keeps_distances(work: ReachWork) -> bool:
    """Whether no pair gets too near, and pairs that are too near already get no worse."""
    pairs = work.pairs
    for k in range(work.counts[NEAR]):
        i = work.near[k]
        kept = pairs.kept[i]
        if pairs.before[i] >= kept and pairs.integers[i, LEAVING] == 0 and pairs.bound[i] < kept - WORSE:
            return False
    if work.numbers[LEAST_BEFORE] >= work.numbers[ALLOWED]:
        return True
    before, after = math.inf, math.inf
    for i in range(len(pairs.bound)):
        if pairs.integers[i, LEAVING] == 0:
            before, after = min(before, pairs.before[i] - pairs.kept[i]), min(after, pairs.bound[i] - pairs.kept[i])
    return bool(after >= min(0.0, before) - WORSE)


def rests_clear(work: ReachWork) -> bool:
    """Whether an arm that brakes from the measured configuration on comes to rest without coming too near to anything.

    Obstacles go on as they move. At the places looked at, the distance is kept; between them no pair can come nearer by
    more than `BETWEEN`, which levers and speeds say. What is too near already must be no worse at rest.
    """
    dof, dt, limits = len(work.q), work.numbers[TIME_STEP], work.limits
    most = 0.0
    for j in range(dof):
        displacement = (work.q[j] - work.start[j]) / dt * dt
        work.speed[j] = abs(displacement) / limits[j, CHANGE]
        work.unit[j] = math.copysign(limits[j, CHANGE], displacement)
        most = max(most, work.speed[j])
    ticks = math.ceil(most)
    if work.counts[MOVING] == 1:
        ticks = max(ticks, math.ceil(work.numbers[FORESIGHT] / dt))
    waiting, least = work.waiting, math.inf
    count = find_doubtful(work, ticks)
    work.numbers[SPARE] = least
    if count == 0:
        return True
    waiting.ends[0, 0], waiting.ends[0, 1], waiting.ends[0, 2] = 0, ticks, count
    look(work, ticks, 0, waiting.last)
    size, looks, clear, pairs = 1, 0, True, len(work.pairs.bound)
    while size > 0:
        size -= 1
        least = min(least, least_spare(work, size))
        if least < 0.0:
            clear = False
            break
        start, end = waiting.ends[size, 0], waiting.ends[size, 1]
        if end - start < 2 or keep_unsure(work, size) == 0:
            continue
        looks += 1
        if looks > LOOKS or size + 2 > DEPTH:
            clear = False
            break
        middle, offset = (start + end) // 2, size * pairs
        # The second half takes the place of the whole, the first half comes after it and is looked into first.
        for k in range(waiting.ends[size, 2]):
            waiting.pairs[offset + pairs + k] = waiting.pairs[offset + k]
            waiting.first[offset + pairs + k] = waiting.first[offset + k]
        waiting.ends[size, 0] = middle
        waiting.ends[size + 1, 0], waiting.ends[size + 1, 1] = start, middle
        waiting.ends[size + 1, 2] = waiting.ends[size, 2]
        look(work, middle, size, waiting.first)
        for k in range(waiting.ends[size, 2]):
            waiting.last[offset + pairs + k] = waiting.first[offset + k]
        size += 2
    if work.counts[MOVING] == 1:
        place_movers(work, 0.0)
    work.numbers[SPARE] = least
    return clear


def braked(work: ReachWork, j: int, tick: int) -> float:
    """How far joint j goes in some ticks of braking [rad]."""
    return float(work.unit[j] * braking_way(work.speed[j], float(tick)))


def find_doubtful(work: ReachWork, ticks: int) -> int:
    """Fill the first part that waits with pairs that could come too near within some ticks of braking; how many."""
    count, pairs, ways = 0, work.pairs, work.levers.ways
    for j in range(len(work.q)):
        work.at[j] = braked(work, j, ticks)
    fill_ways(work)
    most = work.numbers[ALLOWED] + largest(ways) + largest(work.movers.speeds) * work.numbers[TIME_STEP] * ticks
    for i in range(len(pairs.bound)):
        if pairs.bound[i] >= most or pairs.integers[i, LEAVING] == 1:
            continue
        pairs.needed[i] = min(pairs.kept[i], pairs.before[i]) - WORSE
        safe = pairs.needed[i] + rate_of(work, i) * ticks + ways[pairs.lever[i]]
        if measure_within(work, i, safe) < safe:
            work.waiting.pairs[count], work.waiting.first[count] = i, pairs.bound[i]
            count += 1
    return count


def rate_of(work: ReachWork, i: int) -> float:
    """How far the obstacle of a pair moves in a tick, at most [m]."""
    mover = work.pairs.integers[i, MOVER]
    return float(work.movers.speeds[mover] * work.numbers[TIME_STEP]) if mover >= 0 else 0.0


def least_spare(work: ReachWork, part: int) -> float:
    """The least distance at the end of a part of the way, less the one needed [m]."""
    waiting, needed, offset, least = work.waiting, work.pairs.needed, part * len(work.pairs.needed), math.inf
    for k in range(waiting.ends[part, 2]):
        least = min(least, waiting.last[offset + k] - needed[waiting.pairs[offset + k]])
    return least


def keep_unsure(work: ReachWork, part: int) -> int:
    """Keep the pairs of a part of the way that could come too near within it; returns how many."""
    waiting, pairs, offset, kept = work.waiting, work.pairs, part * len(work.pairs.bound), 0
    start, end = waiting.ends[part, 0], waiting.ends[part, 1]
    for j in range(len(work.q)):
        work.at[j] = braked(work, j, end) - braked(work, j, start)
    fill_ways(work)
    for k in range(waiting.ends[part, 2]):
        i, first, last = waiting.pairs[offset + k], waiting.first[offset + k], waiting.last[offset + k]
        way = rate_of(work, i) * (end - start) + work.levers.ways[pairs.lever[i]]
        close = 0.5 * (first + last - way) < pairs.needed[i] - BETWEEN
        if close and pairs.before[i] >= pairs.kept[i]:
            waiting.pairs[offset + kept], waiting.first[offset + kept] = i, first
            waiting.last[offset + kept] = last
            kept += 1
    waiting.ends[part, 2] = kept
    return kept


def look(work: ReachWork, tick: int, part: int, distances: Array) -> None:
    """Fill the distances of the pairs of a part of the way when the arm has braked for some ticks."""
    waiting, offset = work.waiting, part * len(work.pairs.bound)
    for j in range(len(work.q)):
        work.at[j] = work.q[j] + braked(work, j, tick)
    place_links(work.geometry.arm, work.counts[LINKS], work.counts[GROUPS], work.at, work.places)
    if work.counts[MOVING] == 1:
        place_movers(work, tick * work.numbers[TIME_STEP])
    row = work.measured[0]
    for k in range(waiting.ends[part, 2]):
        i = waiting.pairs[offset + k]
        reach = watched_range(work, i) + HORIZON
        measure_pair(work.geometry.shapes, work.places, work.pair, work.pairs.integers[i], reach, row)
        distances[offset + k] = row[0]


def place_movers(work: ReachWork, time: float) -> None:
    """Put obstacles where they are after a time [s]."""
    movers = work.movers
    for k in range(len(movers.shapes)):
        to, pose, twist = work.geometry.shapes.numbers[movers.shapes[k]], movers.poses[k], movers.twists[k]
        turn = (time * twist[3], time * twist[4], time * twist[5])
        angle = norm(turn)
        for column in range(3):
            axis = (pose[0, column], pose[1, column], pose[2, column])
            if angle > 0.0:
                axis = turned_about(axis, turn, angle)
            to[column], to[4 + column], to[8 + column] = axis[0], axis[1], axis[2]
        centre = movers.centres[k]
        for i in range(3):
            to[4 * i + 3] = pose[i, 3] + time * twist[i]
            to[CENTRE + i] = (
                to[4 * i] * centre[0] + to[4 * i + 1] * centre[1] + to[4 * i + 2] * centre[2] + to[4 * i + 3]
            )


def turned_about(a: Vec, turn: Vec, angle: float) -> Vec:
    """A vector after a rotation, by its rotation vector and the length of that [rad]."""
    s, c = sin_cos(angle)
    axis = (turn[0] / angle, turn[1] / angle, turn[2] / angle)
    return rotated(a, axis, s, c)
