"""The pairs of shapes that a displacement could bring near, and what follows for it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.contact.arm import HINGE, place_links
from jacokin.kernels.contact.pairs import (
    DENSE,
    LEVEL,
    MOST_POINTS,
    measure_corners,
    measure_pair,
    measure_points,
    measure_surfaces,
)
from jacokin.kernels.contact.shapes import CLOUD, KIND, RADIUS
from jacokin.kernels.tracking.near import (
    BUFFER,
    BY_POINTS,
    CORNERED,
    DISTANCE,
    FIRST_JOINT,
    GAP,
    LAST_JOINT,
    LEAVES,
    NEAR_NUMBERS,
    NORMAL,
    POINT,
    ROW,
    change_of_distance,
    fill_change,
    keep_apart,
    room_of,
)
from jacokin.kernels.tracking.reach import (
    ALLOWED,
    GROUPS,
    HORIZON,
    INNER,
    LEAVING,
    LINKS,
    NEAR,
    OUTER,
    ReachWork,
    look_ahead,
    note_near,
    watched_range,
)
from jacokin.kernels.tracking.tasks import axis_of, place_joints
from jacokin.kernels.tracking.tick import GUARDED, TickWork
from jacokin.kernels.vector import cross, mix, norm

#: [m] farther away than the nearest point of a cloud, up to which each point has an inequality of its own; halved so
#: often where they are too many: those that are left out are the last to become the nearest ones.
BESIDE, HALVED = 0.03, 2


def take_near(tick: TickWork, reach: ReachWork, first: int) -> None:
    """Hand over pairs of shapes that are near, from a first one on; those that leave an obstacle go the way out."""
    near = tick.near
    near.counts[0] = first
    if tick.counts[GUARDED] == 0:
        return
    for k in range(first, reach.counts[NEAR]):
        i = reach.near[k]
        pair = reach.pairs.integers[i]
        near.integers[k, FIRST_JOINT], near.integers[k, LAST_JOINT] = pair[INNER], pair[OUTER]
        near.integers[k, LEAVES], near.integers[k, CORNERED] = pair[LEAVING], 0
        for c in range(NEAR_NUMBERS):
            near.numbers[k, c] = reach.rows[k, c]
        if pair[LEAVING] == 1:
            for c in range(3):
                near.numbers[k, NORMAL + c] = reach.pairs.exits[i, c]
    near.counts[0] = reach.counts[NEAR]


def watch(tick: TickWork, reach: ReachWork, displacement: Array) -> bool:
    """Add what follows for the pairs that a displacement could bring near; the frames are where the arm is.

    No other pair can hold it up: the inequality of each is one that it satisfies.

    Returns:
        Whether shapes are placed there, too.
    """
    known, placed = tick.near.counts[0], False
    if tick.counts[GUARDED] == 1:
        placed = look_ahead(reach, tick.q, displacement)
        take_near(tick, reach, known)
        keep_apart(tick.arm, tick.near, known, tick.near.counts[1])
    return placed


def watch_corners(tick: TickWork, reach: ReachWork) -> None:
    """Add what follows for all pairs, and their corners, that the total could bring near."""
    add_corners(tick, reach, watch(tick, reach, tick.total))


def could_come_near(reach: ReachWork, i: int) -> bool:
    """Whether the displacement that `fill_ways` saw last could bring pair i too near."""
    pairs = reach.pairs
    within = reach.numbers[ALLOWED] + BUFFER + reach.movers.coming[pairs.mover[i]] + reach.levers.ways[pairs.lever[i]]
    return bool(pairs.integers[i, LEAVING] == 0 and pairs.bound[i] < within)


def place_there(tick: TickWork, reach: ReachWork, displacement: Array) -> None:
    """Place shapes and joints after a displacement (dof,) [rad]."""
    for j in range(len(tick.q)):
        reach.at[j] = tick.q[j] + displacement[j]
    place_links(reach.geometry.arm, reach.counts[LINKS], reach.counts[GROUPS], reach.at, reach.places)
    place_joints(tick.arm, reach.at)


def measure_there(tick: TickWork, reach: ReachWork, k: int) -> bool:
    """Fill tick.there with near pair k as it is where everything is placed; False where it is far."""
    i, there, row = reach.near[k], tick.there, reach.measured[0]
    pair, far = reach.pairs.integers[i], watched_range(reach, i) + HORIZON
    if tick.near.integers[k, CORNERED] == BY_POINTS:
        measure_pair(reach.geometry.shapes, reach.places, reach.pair, pair, far, row)
        row[LEVEL] = row[0]
    else:
        measure_surfaces(reach.geometry.shapes, reach.places, reach.pair, pair, far, reach.around, row)
    if row[0] > far:
        return False
    note_near(reach, i, row, there.numbers[0])
    there.integers[0, FIRST_JOINT], there.integers[0, LAST_JOINT] = pair[INNER], pair[OUTER]
    return True


def could_turn_near(tick: TickWork, reach: ReachWork, k: int) -> bool:
    """Whether the total could bring any point of a near pair too near, to first order."""
    near, arm = tick.near, tick.arm
    row, pair = near.numbers[k], reach.pairs.integers[reach.near[k]]
    point, normal = (row[POINT], row[POINT + 1], row[POINT + 2]), (row[NORMAL], row[NORMAL + 1], row[NORMAL + 2])
    room, turn = room_of(near, k), (0.0, 0.0, 0.0)
    for j in range(near.integers[k, FIRST_JOINT], near.integers[k, LAST_JOINT]):
        room += change_of_distance(arm, j, point, normal) * tick.total[j]
        if arm.kinds[j] == HINGE:
            turn = mix(turn, 1.0, axis_of(arm.frames, j + 1, 2), tick.total[j], turn, 0.0)
    shapes = reach.geometry.shapes.numbers
    size = 2.0 * min(shapes[pair[0], RADIUS], shapes[pair[1], RADIUS])
    return bool(near.integers[k, LEAVES] == 0 and room < size * norm(cross(turn, normal)))


def add_corners(tick: TickWork, reach: ReachWork, placed: bool) -> None:
    """Add inequalities for other corners of the pairs that the total could bring too near with them.

    Each point of a cloud has one of its own: which of them is the nearest changes from tick to tick, and with it the
    direction of the surface.

    Args:
        tick: with the total.
        reach: measures.
        placed: whether shapes are placed where the arm is.
    """
    near, there = tick.near, tick.there
    for k in range(near.counts[0]):
        if near.integers[k, CORNERED] > 0 or not could_turn_near(tick, reach, k):
            continue
        if not placed:
            place_links(reach.geometry.arm, reach.counts[LINKS], reach.counts[GROUPS], tick.q, reach.places)
            placed = True
        near.integers[k, CORNERED] = 1
        i = reach.near[k]
        pair = reach.pairs.integers[i]
        there.integers[0, FIRST_JOINT], there.integers[0, LAST_JOINT] = pair[INNER], pair[OUTER]
        shapes, rows = reach.geometry.shapes, reach.corners
        if shapes.integers[pair[1], KIND] == CLOUD:
            count = measure_nearest(reach, pair, near.numbers[k, DISTANCE] - min(room_of(near, k), 0.0))
            for c in range(count):
                note_near(reach, i, rows[c], there.numbers[0])
                add_row(tick, near.integers[k, ROW] if c == 0 else near.counts[1])
            if count > 0:
                near.integers[k, CORNERED] = BY_POINTS
                continue
        for c in range(1, measure_corners(shapes, reach.places, reach.pair, pair, reach.around, rows)):
            note_near(reach, i, rows[c], there.numbers[0])
            # Points of a cloud beside the nearest one are farther away than they are along its surface's normal.
            there.numbers[0, GAP] = max(there.numbers[0, GAP], near.numbers[k, GAP])
            add_row(tick, near.counts[1])


def measure_nearest(reach: ReachWork, pair: NDArray[np.int64], distance: float) -> int:
    """Measure the nearest points of a cloud, not much farther away than a distance [m]; 0 where they are a surface."""
    beside = BESIDE
    count = measure_points(
        reach.geometry.shapes, reach.places, reach.pair, pair, distance + beside, reach.points, reach.corners
    )
    for _ in range(HALVED):
        if MOST_POINTS < count <= DENSE:
            beside *= 0.5
            count = measure_points(
                reach.geometry.shapes, reach.places, reach.pair, pair, distance + beside, reach.points, reach.corners
            )
    return count if count <= MOST_POINTS else 0


def add_row(tick: TickWork, at: int) -> None:
    """Put the inequality for the pair that is measured there into a row, of which there may be one more."""
    near, there = tick.near, tick.there
    room = room_of(there, 0)
    fill_change(tick.arm, there, 0, -1.0, near.rows, at * len(tick.q))
    near.ends[at], near.rooms[at] = max(room, 0.0), room
    near.counts[1] = max(near.counts[1], at + 1)
