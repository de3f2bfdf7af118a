"""Where the links of a serial arm and their shapes are at a configuration, and how far a motion can move them."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.chain import columns_of, moved
from jacokin.kernels.contact.shapes import LINK, Shapes
from jacokin.kernels.vector import Vec

#: Kinds of joints: about z, along z.
HINGE, SLIDE = 0, 1
#: Columns of a group of shapes of one link: the link, and the numbers of its shapes.
GROUP_LINK, FIRST_SHAPE, LAST_SHAPE = range(3)
#: Columns of a meeting of two groups: the one nearer to the base, the other, and the numbers of their pairs of shapes.
INNER, OUTER, FIRST_PAIR, LAST_PAIR = range(4)


class ArmShapes(NamedTuple):
    """A serial arm and what of it may touch what."""

    joint_kinds: NDArray[np.int64]  # (dof,)
    placements: Array  # (dof, 3, 4) of each joint's frame on the link before it
    spheres: Array  # (groups, 4) centre in the frame of the link, radius [m]
    boxes: Array  # (groups, 6) centre and half sizes along the axes of the link [m]
    groups: NDArray[np.int64]  # (groups, 3), along the chain
    meetings: NDArray[np.int64]  # (meetings, 4)
    pairs: NDArray[
        np.int64
    ]  # (pairs, 2) shapes that count as contact when they touch, the one nearer to the base first
    less: Array  # (pairs,) how much less than a margin they keep, 0 for most: their distance counts as so much more [m]


class Places(NamedTuple):
    """Where everything is at one configuration."""

    frames: Array  # (dof + 2, 3, 4) of the links in the world, the base first; the world's own is last
    centres: Array  # (groups, 3) of the groups' spheres in the world [m]
    rates: (
        Array  # (groups (dof + 1),) how far a group moves, seen from an earlier link, for each unit of the motion [m]
    )


def place_links(arm: ArmShapes, dof: int, groups: int, q: Array, places: Places) -> None:
    """Fill frames and centres at a configuration (dof,) [rad]; those of base and world are given."""
    frames = places.frames
    fill_frames(arm.placements, arm.joint_kinds, dof, q, frames)
    for g in range(groups):
        link, sphere = frames[arm.groups[g, GROUP_LINK]], arm.spheres[g]
        for i in range(3):
            places.centres[g, i] = link[i, 0] * sphere[0] + link[i, 1] * sphere[1] + link[i, 2] * sphere[2] + link[i, 3]


def fill_frames(placements: Array, kinds: NDArray[np.int64], dof: int, q: Array, frames: Array) -> None:
    """Fill frames (dof + 1, 3, 4) of joints at a configuration (dof,) [rad]; that of the base, the first, is given."""
    x, y, z, p = columns_of(frames[0])
    for j in range(dof):
        x, y, z, p = moved(placements, j, kinds[j] != HINGE, q[j], x, y, z, p)
        frame = frames[j + 1]
        for i in range(3):
            frame[i, 0], frame[i, 1], frame[i, 2], frame[i, 3] = x[i], y[i], z[i], p[i]


def bound_rates(arm: ArmShapes, dof: int, g: int, motion: Array, half: float, places: Places) -> None:
    """Fill the rates of one group for a straight motion from the placed configuration, both ways.

    Joints turn one after another, the outermost first: each moves a point by its angle times the point's distance from
    its axis, which those before it have changed by no more than they have moved it.

    Args:
        arm: the arm.
        dof: how many joints there are.
        g: the group.
        motion: (dof,) what the joints do for each unit of the motion [rad].
        half: how many units the motion is long, either way.
        places: where everything is in its middle; its rates are filled.
    """
    frames, link = places.frames, arm.groups[g, GROUP_LINK]
    radius, moved = arm.spheres[g, 3], 0.0
    places.rates[g * (dof + 1) + link] = 0.0
    for j in range(link - 1, -1, -1):
        if arm.joint_kinds[j] == HINGE:
            f = frames[j + 1]
            x = places.centres[g, 0] - f[0, 3]
            y = places.centres[g, 1] - f[1, 3]
            z = places.centres[g, 2] - f[2, 3]
            along = x * f[0, 2] + y * f[1, 2] + z * f[2, 2]
            arm_length = math.sqrt(max(x * x + y * y + z * z - along * along, 0.0)) + radius + half * moved
        else:
            arm_length = 1.0
        moved += abs(motion[j]) * arm_length
        places.rates[g * (dof + 1) + j] = moved


def relate(shapes: Shapes, frames: Array, a: int, b: int, relative: Array) -> None:
    """Fill the frame (3, 4) of shape b in that of shape a."""
    A, B = frames[shapes.integers[a, LINK]], frames[shapes.integers[b, LINK]]
    u, v = shapes.numbers[a], shapes.numbers[b]
    for i in range(3):
        # Column i of shape a's rotation in the world, then its products with the columns of shape b's frame.
        x = A[0, 0] * u[i] + A[0, 1] * u[4 + i] + A[0, 2] * u[8 + i]
        y = A[1, 0] * u[i] + A[1, 1] * u[4 + i] + A[1, 2] * u[8 + i]
        z = A[2, 0] * u[i] + A[2, 1] * u[4 + i] + A[2, 2] * u[8 + i]
        # In the axes of link b.
        bx = x * B[0, 0] + y * B[1, 0] + z * B[2, 0]
        by = x * B[0, 1] + y * B[1, 1] + z * B[2, 1]
        bz = x * B[0, 2] + y * B[1, 2] + z * B[2, 2]
        for j in range(3):
            relative[i, j] = bx * v[j] + by * v[4 + j] + bz * v[8 + j]
        offset = x * (B[0, 3] - A[0, 3]) + y * (B[1, 3] - A[1, 3]) + z * (B[2, 3] - A[2, 3])
        own = u[i] * u[3] + u[4 + i] * u[7] + u[8 + i] * u[11]
        relative[i, 3] = offset + bx * v[3] + by * v[7] + bz * v[11] - own


def in_link(frames: Array, link: int, p: Vec) -> Vec:
    """A point of the world in the frame of a link."""
    f = frames[link]
    x, y, z = p[0] - f[0, 3], p[1] - f[1, 3], p[2] - f[2, 3]
    return (
        f[0, 0] * x + f[1, 0] * y + f[2, 0] * z,
        f[0, 1] * x + f[1, 1] * y + f[2, 1] * z,
        f[0, 2] * x + f[1, 2] * y + f[2, 2] * z,
    )


def in_world(frames: Array, link: int, x: float, y: float, z: float) -> Vec:
    """A point of a link in the world."""
    f = frames[link]
    return (
        f[0, 0] * x + f[0, 1] * y + f[0, 2] * z + f[0, 3],
        f[1, 0] * x + f[1, 1] * y + f[1, 2] * z + f[1, 3],
        f[2, 0] * x + f[2, 1] * y + f[2, 2] * z + f[2, 3],
    )
