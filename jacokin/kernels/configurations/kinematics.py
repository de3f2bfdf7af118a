"""Poses and Jacobians of a frame at many configurations."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.configurations.arm import LANES, Arm, Block, make_arm, make_block, place, place_joints

#: Reference frames of Jacobians.
Reference = IntEnum("Reference", "ALIGNED LOCAL WORLD", start=0)


class FrameWork(NamedTuple):
    """Arrays of `place_frames`."""

    arm: Arm
    q: Array  # (n * columns,) [rad] or [m]
    block: Block
    T: Array  # (n, 4, 4) written
    columns: Array  # (6, LANES) of one joint's column
    reference: NDArray[np.int64]  # (1,)
    jacobians: Array  # (n * 6 * columns,) written for the joints up to the frame; empty: not wanted


def make_frame_work() -> FrameWork:
    """Arrays of any length."""
    return FrameWork(
        make_arm(),
        np.empty(0),
        make_block(),
        np.empty((0, 4, 4)),
        np.empty((6, LANES)),
        np.empty(1, np.int64),
        np.empty(0),
    )


def place_frames(work: FrameWork) -> int:
    """Write the poses of the frame, and its Jacobians where they are wanted; returns how many."""
    n, joints, T = len(work.T), len(work.arm.sliding), work.T
    for first in range(0, n, LANES):
        place_joints(work.arm, work.q, first, work.block)
        place(work.arm.placements, joints, work.block.places)
        frame = work.block.places[joints + 1]
        count = min(LANES, n - first)
        for i in range(count):
            for row in range(3):
                for column in range(4):
                    T[first + i, row, column] = frame[3 * column + row, i]
                T[first + i, 3, row] = 0.0
            T[first + i, 3, 3] = 1.0
        if len(work.jacobians):
            write_jacobians(work, first, count)
    return n


def write_jacobians(work: FrameWork, first: int, count: int) -> None:
    """Write the Jacobians of a block whose joints and frame are placed."""
    dof, reference, jacobians = work.arm.columns[0], work.reference[0], work.jacobians
    joints = len(work.arm.sliding)
    frame = work.block.places[joints + 1]
    for j in range(joints):
        fill_column(work, j, frame, 0.0 if reference == Reference.WORLD else 1.0)
        if reference == Reference.LOCAL:
            turn_column(work.columns, frame)
        for row in range(6):
            for i in range(count):
                jacobians[((first + i) * 6 + row) * dof + j] = work.columns[row, i]


def fill_column(work: FrameWork, j: int, frame: Array, at_frame: float) -> None:
    """The velocity of the frame's origin (at_frame 1) or of the point at the base's (0), at a unit rate of joint j."""
    places, columns = work.block.places, work.columns
    if work.arm.sliding[j] != 0.0:
        for row in range(3):
            for i in range(LANES):
                columns[row, i] = places[j + 1, row + 6, i]
                columns[row + 3, i] = 0.0
        return
    for i in range(LANES):
        x, y, z = places[j + 1, 6, i], places[j + 1, 7, i], places[j + 1, 8, i]
        u = at_frame * frame[9, i] - places[j + 1, 9, i]
        v = at_frame * frame[10, i] - places[j + 1, 10, i]
        w = at_frame * frame[11, i] - places[j + 1, 11, i]
        columns[0, i] = y * w - z * v
        columns[1, i] = z * u - x * w
        columns[2, i] = x * v - y * u
        columns[3, i] = x
        columns[4, i] = y
        columns[5, i] = z


def turn_column(columns: Array, frame: Array) -> None:
    """Write a column in the axes of the frame."""
    for half in range(0, 6, 3):
        for i in range(LANES):
            x, y, z = columns[half, i], columns[half + 1, i], columns[half + 2, i]
            columns[half, i] = frame[0, i] * x + frame[1, i] * y + frame[2, i] * z
            columns[half + 1, i] = frame[3, i] * x + frame[4, i] * y + frame[5, i] * z
            columns[half + 2, i] = frame[6, i] * x + frame[7, i] * y + frame[8, i] * z
