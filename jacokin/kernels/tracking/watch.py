"""The pairs of shapes that a displacement could bring near, and what follows for it."""

from __future__ import annotations

from jacokin.arrays import Array
from jacokin.kernels.contact.arm import place_links
from jacokin.kernels.contact.run import measure_pair
from jacokin.kernels.tracking.near import (
    BUFFER,
    FIRST_JOINT,
    LAST_JOINT,
    LEAVES,
    NEAR_NUMBERS,
    NORMAL,
    fill_change,
    keep_apart,
    room_of,
)
from jacokin.kernels.tracking.reach import (
    GROUPS,
    HORIZON,
    INNER,
    KEPT,
    LEAVING,
    LINKS,
    NEAR,
    OUTER,
    ReachWork,
    fill_ways,
    look_ahead,
    note_near,
    watched_range,
)
from jacokin.kernels.tracking.tasks import place_joints
from jacokin.kernels.tracking.tick import GUARDED, TickWork

#: [rad] of a displacement, how far along it pairs are measured.
ALONG = 0.02
#: [m] by which they may come nearer.
NEARER = 2e-5


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
        near.integers[k, LEAVES] = pair[LEAVING]
        for c in range(NEAR_NUMBERS):
            near.numbers[k, c] = reach.rows[k, c]
        if pair[LEAVING] == 1:
            for c in range(3):
                near.numbers[k, NORMAL + c] = reach.pairs.exits[i, c]
    near.counts[0] = reach.counts[NEAR]


def watch(tick: TickWork, reach: ReachWork, displacement: Array) -> None:
    """Add what follows for the pairs that a displacement could bring near; the frames are where the arm is.

    No other pair can hold it up: the inequality of each is one that it satisfies.
    """
    known = tick.near.counts[0]
    if tick.counts[GUARDED] == 1:
        look_ahead(reach, tick.q, displacement)
        take_near(tick, reach, known)
        keep_apart(tick.arm, tick.near, known, tick.near.counts[1])


def could_come_near(reach: ReachWork, i: int) -> bool:
    """Whether the displacement that `fill_ways` saw last could bring pair i too near."""
    pairs = reach.pairs
    within = reach.numbers[KEPT] + BUFFER + reach.movers.coming[pairs.mover[i]] + reach.levers.ways[pairs.lever[i]]
    return bool(pairs.integers[i, LEAVING] == 0 and pairs.bound[i] < within)


def place_there(tick: TickWork, reach: ReachWork, displacement: Array, part: float) -> None:
    """Place shapes and joints after a part of a displacement (dof,) [rad]."""
    for j in range(len(tick.q)):
        reach.at[j] = tick.q[j] + part * displacement[j]
    place_links(reach.geometry.arm, reach.counts[LINKS], reach.counts[GROUPS], reach.at, reach.places)
    place_joints(tick.arm, reach.at)


def measure_there(tick: TickWork, reach: ReachWork, i: int) -> bool:
    """Fill tick.there with pair i as it is where everything is placed; False where it is far."""
    there, pair, row = tick.there, reach.pairs.integers[i], reach.measured[0]
    far = watched_range(reach, i) + HORIZON
    measure_pair(reach.geometry.shapes, reach.places, reach.pair, pair, far, row)
    if row[0] > far:
        return False
    note_near(reach, i, row, there.numbers[0])
    there.integers[0, FIRST_JOINT], there.integers[0, LAST_JOINT] = pair[INNER], pair[OUTER]
    return True


def cut(tick: TickWork, reach: ReachWork) -> int:
    """Add inequalities for pairs that would come too near, by what they are like along the total; how many.

    Where a shape is parallel to an obstacle another corner is the nearest one as soon as it turns: the total would turn
    it to and fro from tick to tick.
    """
    near, pairs, begun = tick.near, reach.pairs, tick.near.counts[1]
    dof, most = len(tick.q), 0.0
    if begun == near.counts[3]:
        return 0
    for j in range(dof):
        most = max(most, abs(tick.total[j]))
    part, placed = min(1.0, ALONG / max(most, ALONG)), False
    for j in range(dof):
        reach.at[j] = tick.total[j]
    fill_ways(reach)
    for k in range(reach.counts[NEAR]):
        i = reach.near[k]
        is_full = near.counts[1] + len(pairs.bound) - near.counts[0] == len(near.ends)  # others may come
        if is_full or not could_come_near(reach, i):
            continue
        if not placed:
            place_there(tick, reach, tick.total, part)
            placed = True
        if not measure_there(tick, reach, i):
            continue
        room, at, used = room_of(tick.there, 0), near.counts[1], 0.0
        fill_change(tick.arm, tick.there, 0, -1.0, near.rows, at * dof)
        for j in range(dof):
            used += near.rows[at * dof + j] * tick.total[j]
        room = max(room + part * used, 0.0)
        if used > room + NEARER:
            near.ends[at] = near.rooms[at] = room
            near.counts[1] += 1
    if placed:
        place_joints(tick.arm, tick.q)
    return int(near.counts[1] - begun)
