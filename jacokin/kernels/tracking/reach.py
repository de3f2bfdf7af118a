"""How much of a displacement keeps shapes apart: distances where it leads, and on the way to rest from there.

A part of the way from braking to the displacement is tried. It may be taken where no pair gets too near, and where an
arm that brakes from then on comes to rest without coming too near to anything. Obstacles may move.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.contact.arm import Places, place_links
from jacokin.kernels.contact.run import NOTHING, measure_pair
from jacokin.kernels.contact.separation import SeparationWork, make_separation_work
from jacokin.kernels.contact.shapes import CENTRE
from jacokin.kernels.contact.touching import Geometry
from jacokin.kernels.tracking.limits import CHANGE, LIMIT_NUMBERS, brake, move
from jacokin.kernels.tracking.near import CLOSING, DISTANCE, NEAR_NUMBERS, NORMAL, POINT
from jacokin.kernels.trigonometry import sin_cos
from jacokin.kernels.vector import Vec, cross, dot, mix, norm

#: [m] beyond the watched range up to which distances are measured.
HORIZON = 0.05
#: [m] rounding of a distance.
WORSE = 1e-9
#: [m] shapes may come nearer than the distance between two places of a way to rest that are looked at.
BETWEEN = 0.01
#: Places of a way to rest that are looked at, before it counts as not clear.
LOOKS = 12
#: Columns of a pair's integers: its shapes as they are measured, 1 where these are exchanged, the row of the obstacle
#: that can move or -1, and 1 while something is inside its obstacle: then it is free, as the way out may lead others
#: deeper first. The joints between its shapes are those from the first one to before the last.
FIRST, SECOND, EXCHANGED, MOVER, LEAVING, INNER, OUTER, PAIR_INTEGERS = range(8)
#: Columns of its numbers: the distance below which it is watched [m], at least how far apart it was and is [m], and at
#: least how far apart it is to be on the way to rest.
WATCH, BEFORE, BOUND, NEEDED, PAIR_NUMBERS = range(5)
#: Counts: links and groups of shapes; whether any obstacle moves; what to find out, see below; filled: pairs near.
LINKS, GROUPS, MOVING, ASKED, NEAR, REACH_COUNTS = range(6)
#: Numbers: the distance kept [m], control step [s], time in which moving obstacles are looked at [s], the part of the
#: way from braking to the displacement, how far beyond the watched range is measured [m]; filled: least distance on the
#: way to rest less the one needed [m], and the least bound of all pairs [m].
KEPT, TIME_STEP, FORESIGHT, PART, BEYOND, SPARE, LEAST, REACH_NUMBERS = range(8)
#: What to find out: distances; whether they are kept; whether the arm could come to rest.
DISTANCES, KEEPING, RESTING = 0, 1, 2
#: What `try_reach` returns: too near; the arm could come to rest, or that was not asked; it could not.
TOO_NEAR, CLEAR, NOT_CLEAR = range(3)


class Movers(NamedTuple):
    """Obstacles that can move."""

    shapes: NDArray[np.int64]  # (k,) their numbers
    poses: Array  # (k, 3, 4) in the base
    twists: Array  # (k, 6) velocity of the shape's origin [m/s], then angular [rad/s], in base axes
    speeds: Array  # (k,) largest speed of any point [m/s]
    centres: Array  # (k, 3) of the spheres around them, in their frames [m]


class Waiting(NamedTuple):
    """Parts of a way to rest that are to be looked into, each with pairs and their distances at its ends."""

    ends: NDArray[np.int64]  # (LOOKS + 2, 3) first and last tick, and how many pairs
    pairs: NDArray[np.int64]  # ((LOOKS + 2) pairs,)
    first: Array  # ((LOOKS + 2) pairs,) [m]
    last: Array  # ((LOOKS + 2) pairs,) [m]


class ReachWork(NamedTuple):
    """What a call reads and writes."""

    counts: NDArray[np.int64]  # (5,)
    numbers: Array  # (7,)
    limits: Array  # (dof, 7) see `limits`
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
    measured: Array  # (1, 10) to work in
    integers: NDArray[np.int64]  # (pairs, 7)
    ways: Array  # (pairs, 3) out of the obstacle, for pairs that leave one; unit vectors
    bounds: Array  # (pairs, 4)
    levers: Array  # (pairs dof,) how far at most a joint moves a pair nearer [m/rad]
    near: NDArray[np.int64]  # (pairs,) filled: pairs in the watched range
    rows: Array  # (pairs, 8) filled with their numbers, see `near`
    movers: Movers
    waiting: Waiting


def make_reach_work(geometry: Geometry = NOTHING, pairs: int = 0, movers: int = 0) -> ReachWork:
    """Fresh work arrays for an arm among obstacles, so many pairs of shapes, and obstacles that can move."""
    dof, groups = len(geometry.arm.joint_kinds), len(geometry.arm.groups)
    frames = np.zeros((dof + 2 if dof else 0, 3, 4))
    frames[:] = np.eye(3, 4)
    room = (LOOKS + 2) * pairs
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
        np.zeros((1, 10)),
        np.zeros((pairs, PAIR_INTEGERS), np.int64),
        np.zeros((pairs, 3)),
        np.zeros((pairs, PAIR_NUMBERS)),
        np.zeros(pairs * dof),
        np.zeros(pairs, np.int64),
        np.zeros((pairs, NEAR_NUMBERS)),
        Movers(
            np.zeros(movers, np.int64),
            np.zeros((movers, 3, 4)),
            np.zeros((movers, 6)),
            np.zeros(movers),
            np.zeros((movers, 3)),
        ),
        Waiting(np.zeros((LOOKS + 2, 3), np.int64), np.zeros(room, np.int64), np.zeros(room), np.zeros(room)),
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
    """Fill bounds, and the pairs that are near with their numbers; only those that may be are measured."""
    dof, bounds, count, least = len(work.q), work.bounds, 0, math.inf
    place_links(work.geometry.arm, work.counts[LINKS], work.counts[GROUPS], work.q, work.places)
    row = work.measured[0]
    for i in range(len(bounds)):
        bound, watch = bounds[i, BEFORE], bounds[i, WATCH]
        for j in range(dof):
            bound -= work.levers[i * dof + j] * abs(work.q[j] - work.start[j])
        if bound < watch:
            reach = watch + work.numbers[BEYOND]
            measure_pair(work.geometry.shapes, work.places, work.pair, work.integers[i], reach, row)
            bound = row[0]
            if bound < watch:
                note_near(work, i, count, row)
                count += 1
        bounds[i, BOUND] = bound
        least = min(least, bound)
    work.counts[NEAR], work.numbers[LEAST] = count, least


def note_near(work: ReachWork, i: int, at: int, row: Array) -> None:
    """Fill the numbers of a pair that was measured."""
    to, mover = work.rows[at], work.integers[i, MOVER]
    exchanged = work.integers[i, EXCHANGED] == 1
    work.near[at] = i
    to[DISTANCE], to[CLOSING] = row[0], 0.0
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
    kept, bounds = work.numbers[KEPT], work.bounds
    for k in range(work.counts[NEAR]):
        i = work.near[k]
        if bounds[i, BEFORE] >= kept and work.integers[i, LEAVING] == 0 and bounds[i, BOUND] < kept - WORSE:
            return False
    before, after = math.inf, math.inf
    for i in range(len(bounds)):
        if work.integers[i, LEAVING] == 0:
            before, after = min(before, bounds[i, BEFORE]), min(after, bounds[i, BOUND])
    return bool(after >= min(kept, before) - WORSE)


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
    size, looks, clear, pairs = 1, 0, True, len(work.bounds)
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
        if looks > LOOKS:
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
    """How far joint j goes in some ticks of braking [rad].

    A joint that was at u a dt moves by (u - 1) a dt^2 in the first tick, by (u - 2) a dt^2 in the next, and so on.
    """
    n = min(math.floor(work.speed[j]), float(tick))
    return float(work.unit[j] * (work.speed[j] * n - 0.5 * n * (n + 1.0)))


def find_doubtful(work: ReachWork, ticks: int) -> int:
    """Fill the first part that waits with pairs that could come too near within some ticks of braking; how many."""
    dof, count, bounds = len(work.q), 0, work.bounds
    for j in range(dof):
        work.at[j] = abs(work.q[j] + braked(work, j, ticks) - work.q[j])
    for i in range(len(bounds)):
        needed = min(work.numbers[KEPT], bounds[i, BEFORE]) - WORSE
        if work.integers[i, LEAVING] == 1:
            needed = -math.inf
        way = rate_of(work, i) * ticks
        for j in range(dof):
            way += work.levers[i * dof + j] * work.at[j]
        bounds[i, NEEDED] = needed
        if bounds[i, BOUND] - way < needed:
            work.waiting.pairs[count], work.waiting.first[count] = i, bounds[i, BOUND]
            count += 1
    return count


def rate_of(work: ReachWork, i: int) -> float:
    """How far the obstacle of a pair moves in a tick, at most [m]."""
    mover = work.integers[i, MOVER]
    return float(work.movers.speeds[mover] * work.numbers[TIME_STEP]) if mover >= 0 else 0.0


def least_spare(work: ReachWork, part: int) -> float:
    """The least distance at the end of a part of the way, less the one needed [m]."""
    waiting, offset, least = work.waiting, part * len(work.bounds), math.inf
    for k in range(waiting.ends[part, 2]):
        least = min(least, waiting.last[offset + k] - work.bounds[waiting.pairs[offset + k], NEEDED])
    return least


def keep_unsure(work: ReachWork, part: int) -> int:
    """Keep the pairs of a part of the way that could come too near within it; returns how many."""
    dof, waiting, offset, kept = len(work.q), work.waiting, part * len(work.bounds), 0
    start, end = waiting.ends[part, 0], waiting.ends[part, 1]
    for j in range(dof):
        work.at[j] = abs(braked(work, j, end) - braked(work, j, start))
    for k in range(waiting.ends[part, 2]):
        i, first, last = waiting.pairs[offset + k], waiting.first[offset + k], waiting.last[offset + k]
        way = rate_of(work, i) * (end - start)
        for j in range(dof):
            way += work.levers[i * dof + j] * work.at[j]
        close = 0.5 * (first + last - way) < work.bounds[i, NEEDED] - BETWEEN
        if close and work.bounds[i, BEFORE] >= work.numbers[KEPT]:
            waiting.pairs[offset + kept], waiting.first[offset + kept] = i, first
            waiting.last[offset + kept] = last
            kept += 1
    waiting.ends[part, 2] = kept
    return kept


def look(work: ReachWork, tick: int, part: int, distances: Array) -> None:
    """Fill the distances of the pairs of a part of the way when the arm has braked for some ticks."""
    waiting, offset = work.waiting, part * len(work.bounds)
    for j in range(len(work.q)):
        work.at[j] = work.q[j] + braked(work, j, tick)
    place_links(work.geometry.arm, work.counts[LINKS], work.counts[GROUPS], work.at, work.places)
    if work.counts[MOVING] == 1:
        place_movers(work, tick * work.numbers[TIME_STEP])
    row = work.measured[0]
    for k in range(waiting.ends[part, 2]):
        i = waiting.pairs[offset + k]
        reach = work.bounds[i, WATCH] + HORIZON
        measure_pair(work.geometry.shapes, work.places, work.pair, work.integers[i], reach, row)
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
    return mix(a, c, cross(axis, a), s, axis, (1.0 - c) * dot(axis, a))
