"""`Arm`: any serial arm as numbers, and where its joints are, in blocks of configurations.

A block holds `LANES` configurations side by side: each quantity is a row of so many numbers. The innermost loops run
along these rows without branches or calls, so that compilers make vector instructions of them; each lane does the same
operations in the same order, whatever the vectors' width.

Joints turn about, or slide along, the z axis of their own frame.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.trigonometry import (
    LARGEST_ANGLE,
    QUARTERS_PER_RADIAN,
    TO_WHOLE,
    sin_cos,
    sin_cos_within_quarter,
)

#: Configurations in a block.
LANES = 16
#: Rows of a placement: the columns x, y, z of its rotation, and its position.
PLACE = 12


class Arm(NamedTuple):
    """The joints up to a frame."""

    placements: Array  # (joints + 1, 3, 4) of each joint after the one before, at zero; the last one of the frame
    sliding: Array  # (joints,) 1 for a joint that slides
    columns: NDArray[np.int64]  # (1,) joints in a row of q, those after the frame included


class Block(NamedTuple):
    """Where the joints of some configurations are."""

    turned: Array  # (3, LANES) angle, sine and cosine of one joint
    places: Array  # (joints + 2, 12, LANES) of the base, of each joint after it has moved, and of the frame


def make_arm() -> Arm:
    """Arrays of any length."""
    return Arm(np.empty((0, 3, 4)), np.empty(0), np.empty(1, np.int64))


def make_block() -> Block:
    """Arrays of any length."""
    return Block(np.empty((3, LANES)), np.empty((0, PLACE, LANES)))


def place_joints(arm: Arm, q: Array, first: int, block: Block) -> None:
    """Place the joints of the configurations from the first one on; the last one again in lanes that are left over."""
    places, columns = block.places, arm.columns[0]
    last = len(q) // columns - 1
    for k in range(PLACE):
        for i in range(LANES):
            places[0, k, i] = 1.0 if k in (0, 4, 8) else 0.0
    for j in range(len(arm.sliding)):
        for i in range(LANES):
            block.turned[0, i] = q[min(first + i, last) * columns + j]
        move(arm.placements, j, arm.sliding[j] != 0.0, block.turned, places)


def move(placements: Array, j: int, slides: bool, turned: Array, places: Array) -> None:
    """Place joint j after the one before, moved by the first row of turned [rad] or [m]; a turn fills the others."""
    if slides:
        place(placements, j, places)
        for row in range(3):
            for i in range(LANES):
                places[j + 1, row + 9, i] += places[j + 1, row + 6, i] * turned[0, i]
    else:
        turn_sines(turned)
        turn(placements, j, turned, places)


def turn_sines(turned: Array) -> None:
    """Fill in sines and cosines of angles [rad], side by side: (3, n) rows of angles, sines and cosines."""
    largest, count = 0.0, turned.shape[1]
    for i in range(count):
        largest = max(largest, abs(turned[0, i]))
    if largest < LARGEST_ANGLE:
        for i in range(count):
            s, c = sin_cos_of_moderate(turned[0, i])
            turned[1, i] = s
            turned[2, i] = c
    else:
        for i in range(count):
            s, c = sin_cos(turned[0, i])
            turned[1, i] = s
            turned[2, i] = c


def sin_cos_of_moderate(angle: float) -> tuple[float, float]:
    """`sin_cos` of an angle below `LARGEST_ANGLE` [rad]: its polynomials, without branches and whole numbers."""
    quarters = angle * QUARTERS_PER_RADIAN + TO_WHOLE - TO_WHOLE
    s, c = sin_cos_within_quarter(angle, quarters)
    place = quarters - 4.0 * (quarters * 0.25 + TO_WHOLE - TO_WHOLE)  # -2, -1, 0, 1 or 2
    turn_c, turn_s = 1.0 - abs(place), place * (2.0 - abs(place))  # of the quarters: 0, 1 or -1
    return s * turn_c + c * turn_s, c * turn_c - s * turn_s


def turn(placements: Array, j: int, turned: Array, places: Array) -> None:
    """Place joint j, which turns, after the one before."""
    a, b, c, d = placements[j, 0, 0], placements[j, 0, 1], placements[j, 0, 2], placements[j, 0, 3]
    e, f, g, h = placements[j, 1, 0], placements[j, 1, 1], placements[j, 1, 2], placements[j, 1, 3]
    m, n, o, p = placements[j, 2, 0], placements[j, 2, 1], placements[j, 2, 2], placements[j, 2, 3]
    for row in range(3):
        for i in range(LANES):
            x, y, z = places[j, row, i], places[j, row + 3, i], places[j, row + 6, i]
            s, t = turned[1, i], turned[2, i]
            u, v = x * a + y * e + z * m, x * b + y * f + z * n
            places[j + 1, row, i] = u * t + v * s
            places[j + 1, row + 3, i] = v * t - u * s
            places[j + 1, row + 6, i] = x * c + y * g + z * o
            places[j + 1, row + 9, i] = places[j, row + 9, i] + (x * d + y * h + z * p)


def place(placements: Array, j: int, places: Array) -> None:
    """Place joint j as it is at zero after the one before, or the frame after the last joint."""
    a, b, c, d = placements[j, 0, 0], placements[j, 0, 1], placements[j, 0, 2], placements[j, 0, 3]
    e, f, g, h = placements[j, 1, 0], placements[j, 1, 1], placements[j, 1, 2], placements[j, 1, 3]
    m, n, o, p = placements[j, 2, 0], placements[j, 2, 1], placements[j, 2, 2], placements[j, 2, 3]
    for row in range(3):
        for i in range(LANES):
            x, y, z = places[j, row, i], places[j, row + 3, i], places[j, row + 6, i]
            places[j + 1, row, i] = x * a + y * e + z * m
            places[j + 1, row + 3, i] = x * b + y * f + z * n
            places[j + 1, row + 6, i] = x * c + y * g + z * o
            places[j + 1, row + 9, i] = places[j, row + 9, i] + (x * d + y * h + z * p)
