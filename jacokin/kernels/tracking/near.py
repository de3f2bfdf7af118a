"""What near shapes add to a tick: inequalities that keep them apart, and which of them are too near."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.contact.arm import HINGE
from jacokin.kernels.tracking.tasks import JointFrames, axis_of
from jacokin.kernels.vector import Vec, cross, dot, minus

#: [m] the problem stays this far above the distance, so that curvature does not cost a shortened step.
BUFFER = 5e-4
#: [m] rounding of a distance.
WORSE = 1e-9
#: Columns of a pair that is near: its distance [m], the nearest point on its second shape, the unit vector along which
#: the distance grows (from the first shape, or the way out of an obstacle that something is inside), how fast the
#: first shape comes nearer [m/s], how far apart the surfaces are along that vector [m], and the distance kept [m].
DISTANCE, POINT, NORMAL, CLOSING, GAP, KEPT, NEAR_NUMBERS = 0, 1, 4, 7, 8, 9, 10
#: Columns of its integers: the joints between its shapes are those from the first one to before the last; 1 where
#: something is inside its obstacle; 1 where its corners have inequalities, too, or `BY_POINTS`, where points of
#: its cloud have them instead; the row of its own.
FIRST_JOINT, LAST_JOINT, LEAVES, CORNERED, ROW, NEAR_INTEGERS = range(6)
BY_POINTS = 2


class NearPairs(NamedTuple):
    """Pairs of shapes that are near, and what follows for a displacement x of the joints."""

    counts: NDArray[np.int64]  # (4,) of pairs; of inequalities; of pairs that are too near; of faces of targets
    foresight: Array  # (1,) time in which obstacles that come nearer count [s]
    integers: NDArray[np.int64]  # (pairs, 5)
    numbers: Array  # (pairs, 10)
    rows: Array  # (room dof,) filled: rows x <= ends, after those that are there already
    ends: Array  # (room,) [m]
    rooms: Array  # (room,) filled: the same, but negative for pairs that are to move apart [m]
    apart: NDArray[np.int64]  # (pairs,) filled with the numbers of those that are too near, or about to be


def make_near_pairs(dof: int = 0, pairs: int = 0, more: int = 0) -> NearPairs:
    """Fresh arrays for so many pairs, and more inequalities."""
    return NearPairs(
        np.zeros(4, np.int64),
        np.zeros(1),
        np.zeros((pairs, NEAR_INTEGERS), np.int64),
        np.zeros((pairs, NEAR_NUMBERS)),
        np.zeros((pairs + more) * dof),
        np.zeros(pairs + more),
        np.zeros(pairs + more),
        np.zeros(pairs, np.int64),
    )


def change_of_distance(arm: JointFrames, j: int, point: Vec, normal: Vec) -> float:
    """How a distance along a normal changes with joint j, which moves the point [m/rad]."""
    axis = axis_of(arm.frames, j + 1, 2)
    if arm.kinds[j] != HINGE:
        return dot(normal, axis)
    return dot(cross(minus(point, axis_of(arm.frames, j + 1, 3)), normal), axis)


def keep_apart(arm: JointFrames, near: NearPairs, first: int, begun: int) -> None:
    """Fill inequalities for the pairs from a first one on, after those begun with; the frames are where the arm is.

    No pair uses up more than its spare distance.
    """
    dof, count = len(arm.kinds), begun
    if first == 0:
        near.counts[3] = begun
    for i in range(first, near.counts[0]):
        if near.integers[i, LEAVES] == 0:
            room = room_of(near, i)
            fill_change(arm, near, i, -1.0, near.rows, count * dof)
            near.ends[count], near.rooms[count], near.integers[i, ROW] = max(room, 0.0), room, count
            count += 1
    near.counts[1] = count


def find_too_near(near: NearPairs) -> None:
    """Fill which pairs are too near, or about to be."""
    near.counts[2] = 0
    for i in range(near.counts[0]):
        coming = near.numbers[i, CLOSING] > 0.0 and room_of(near, i) < 0.0
        if coming or near.numbers[i, DISTANCE] < near.numbers[i, KEPT] - 2.0 * WORSE:
            near.apart[near.counts[2]] = i
            near.counts[2] += 1


def room_of(near: NearPairs, i: int) -> float:
    """By how much a pair may come nearer, beside what its obstacle moves [m]."""
    closing = near.foresight[0] * near.numbers[i, CLOSING]
    return float(near.numbers[i, GAP] - near.numbers[i, KEPT] - BUFFER - max(closing, 0.0))


def fill_change(arm: JointFrames, near: NearPairs, i: int, weight: float, rows: Array, at: int) -> None:
    """Fill how the distance of a pair changes with each joint, weighted [m/rad]."""
    row = near.numbers[i]
    point, normal = (row[POINT], row[POINT + 1], row[POINT + 2]), (row[NORMAL], row[NORMAL + 1], row[NORMAL + 2])
    for j in range(len(arm.kinds)):
        between = near.integers[i, FIRST_JOINT] <= j < near.integers[i, LAST_JOINT]
        rows[at + j] = weight * change_of_distance(arm, j, point, normal) if between else 0.0
