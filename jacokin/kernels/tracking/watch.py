"""The pairs of shapes that a displacement could bring near, and what follows for it."""

from __future__ import annotations

from jacokin.arrays import Array
from jacokin.kernels.tracking.near import FIRST_JOINT, LAST_JOINT, LEAVES, NEAR_NUMBERS, NORMAL, keep_apart
from jacokin.kernels.tracking.reach import INNER, LEAVING, NEAR, OUTER, ReachWork, look_ahead
from jacokin.kernels.tracking.tick import GUARDED, TickWork


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
