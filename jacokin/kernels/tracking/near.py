"""What near shapes add to a tick: inequalities that keep them apart, and squares that move them apart."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.tracking.tasks import TURNS, JointFrames, axis_of
from jacokin.kernels.vector import Vec, cross, dot, minus

#: [m] the problem stays this far above the distance, so that curvature does not cost a shortened step.
BUFFER = 5e-4
#: Of moving too near pairs apart, against 1 for the target: its pull then costs microns.
SEPARATION_WEIGHT = 100.0
#: Columns of a pair that is near: its distance [m], the nearest point on its second shape, the unit vector along which
#: the distance grows (from the first shape, or the way out of an obstacle that something is inside), and how fast the
#: first shape comes nearer [m/s].
DISTANCE, POINT, NORMAL, CLOSING, NEAR_NUMBERS = 0, 1, 4, 7, 8
#: Columns of its integers: the joints between its shapes are those from the first one to before the last, and 1 where
#: something is inside its obstacle.
FIRST_JOINT, LAST_JOINT, LEAVES, NEAR_INTEGERS = range(4)
#: The distance kept [m], and the time in which obstacles that come nearer count [s].
KEPT, FORESIGHT, RULE_NUMBERS = range(3)


class NearPairs(NamedTuple):
    """Pairs of shapes that are near, and what follows for a displacement x of the joints."""

    counts: NDArray[np.int64]  # (3,) of pairs; of inequalities; of pairs that are moved apart
    rule: Array  # (2,)
    integers: NDArray[np.int64]  # (pairs, 3)
    numbers: Array  # (pairs, 8)
    rows: Array  # (room dof,) filled: rows x <= ends, after those that are there already
    ends: Array  # (room,) [m]
    apart: NDArray[np.int64]  # (pairs,) filled with the numbers of those that are moved apart: wishes x = errors
    wishes: Array  # (pairs dof,) weighted [m/rad]
    errors: Array  # (pairs,) [m]


def make_near_pairs(dof: int = 0, pairs: int = 0, more: int = 0) -> NearPairs:
    """Fresh arrays for so many pairs, and more inequalities."""
    return NearPairs(
        np.zeros(3, np.int64),
        np.zeros(RULE_NUMBERS),
        np.zeros((pairs, NEAR_INTEGERS), np.int64),
        np.zeros((pairs, NEAR_NUMBERS)),
        np.zeros((pairs + more) * dof),
        np.zeros(pairs + more),
        np.zeros(pairs, np.int64),
        np.zeros(pairs * dof),
        np.zeros(pairs),
    )


def change_of_distance(arm: JointFrames, j: int, point: Vec, normal: Vec) -> float:
    """How a distance along a normal changes with joint j, which moves the point [m/rad]."""
    axis = axis_of(arm.frames, j + 1, 2)
    if arm.kinds[j] != TURNS:
        return dot(normal, axis)
    return dot(cross(minus(point, axis_of(arm.frames, j + 1, 3)), normal), axis)


def keep_apart(arm: JointFrames, near: NearPairs, begun: int) -> None:
    """Fill inequalities, after those begun with, and wishes; the frames are where the arm is.

    No pair uses up more than its spare distance; pairs that are too near, or about to be, are moved apart.
    """
    dof, count, apart = len(arm.kinds), begun, 0
    for i in range(near.counts[0]):
        row, first, last = near.numbers[i], near.integers[i, FIRST_JOINT], near.integers[i, LAST_JOINT]
        point = (row[POINT], row[POINT + 1], row[POINT + 2])
        normal = (row[NORMAL], row[NORMAL + 1], row[NORMAL + 2])
        closing = near.rule[FORESIGHT] * row[CLOSING]
        room = row[DISTANCE] - near.rule[KEPT] - BUFFER - max(closing, 0.0)
        approaching = room < 0.0 and closing > 0.0
        if near.integers[i, LEAVES] == 0 and not approaching:
            for j in range(dof):
                inside = first <= j < last
                near.rows[count * dof + j] = -change_of_distance(arm, j, point, normal) if inside else 0.0
            near.ends[count] = max(room, 0.0)
            count += 1
        if approaching or row[DISTANCE] < near.rule[KEPT] + 0.5 * BUFFER:
            for j in range(dof):
                inside = first <= j < last
                change = change_of_distance(arm, j, point, normal) if inside else 0.0
                near.wishes[apart * dof + j] = SEPARATION_WEIGHT * change
            near.errors[apart] = -SEPARATION_WEIGHT * room
            near.apart[apart] = i
            apart += 1
    near.counts[1], near.counts[2] = count, apart
