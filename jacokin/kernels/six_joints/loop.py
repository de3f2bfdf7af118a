"""The closed loop of an arm at its target, and the twelve ways to number its joints.

Forward kinematics at the target, chain[0] Rz(q1) chain[1] ... Rz(q6) chain[6] = T, is a loop of six joints and six
links: Rz(q1) K_1 ... Rz(q6) K_6 = 1, where K_6 = chain[6] T^-1 chain[0] carries the target. A loop has no beginning and
no direction: it may be numbered from any joint, forwards or backwards. Below, theta_1 .. theta_6 and L_1 .. L_6 are the
angles and links of one such labelling, and theta_3 is the angle that is solved for first.
"""

from __future__ import annotations

import math
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from jacokin.arrays import Array
from jacokin.kernels.trigonometry import sin_cos
from jacokin.kernels.vector import Vec

#: 0..5 begin at that joint and go forwards, 6..11 at the joint 6 less, backwards.
LABELLINGS = 12
#: Structures with a form of their own: axes 4, 5 and 6 of a labelling meet; axes 2, 3 and 4 are parallel, 5 and 6 meet;
#: axes 2 and 3 are parallel, 1 and 4 in one plane across them, 4 and 5 meet; the same with axis 4 beside joint 3.
Form = IntEnum("Form", "GENERAL SPHERICAL_WRIST PARALLEL_AXES PLANAR_ARM ELBOW_OFFSET", start=0)
#: Neighbours of an arm, and how far a link is moved: [rad], and part of the arm's length. Branches whose Jacobian has
#: singular values above 1e-3 move by less than Newton's method brings back; structures are broken well above rounding.
NEIGHBOURS, LINK_MOVE = 3, 1e-5


def rotation_about(axis: Vec, angle: float) -> Array:
    """The rotation matrix (3, 3) of a turn [rad] about a unit vector."""
    x, y, z = axis
    s, c = sin_cos(angle)
    across = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return c * np.eye(3) + s * across + (1.0 - c) * np.outer(axis, axis)


def _small_placements() -> Array:
    """(6, 6, 3, 4) rotations and shifts of about `LINK_MOVE`, as irregular as can be, each followed by its opposite."""
    placements = np.zeros((2 * NEIGHBOURS, 6, 3, 4))
    for n in range(NEIGHBOURS):
        for i in range(6):
            x, y, z, *shift = (sin_cos(1.0 + 7.0 * n + 3.3 * i + 1.7 * j * j)[0] for j in range(6))
            size = math.sqrt(x * x + y * y + z * z)
            for k, move in ((2 * n, LINK_MOVE), (2 * n + 1, -LINK_MOVE)):
                placements[k, i, :, :3] = rotation_about((x / size, y / size, z / size), move * size)
                placements[k, i, :, 3] = move * np.array(shift)
    return placements


SMALL_PLACEMENTS = _small_placements()


class SixArm(NamedTuple):
    """What the solver knows about an arm of any structure, apart from its chain."""

    scale: float  # what lengths are multiplied by, so that the arm's is about 1 [1/m]; 0 for an arm built like a Jaco
    own: int  # the labelling that the arm is solved in
    neighbours: int  # the one that its neighbours are solved in
    form: int  # `GENERAL`, or the structure that gives its branches more directly,
    form_labelling: int  # and the labelling in which it does
    first: float  # of the two axes on whose point that form rests, where the point is on each, lengths scaled; of a
    second: float  # planar arm, by how much it misses the structure, and nothing


def joint_of(labelling: int, i: int) -> int:
    """The joint, from 0, whose angle is theta_(i + 1)."""
    return (labelling + i) % 6 if labelling < 6 else (labelling - i) % 6


def fill_links(chain: Array, T: Array, scale: float, labelling: int, links: Array) -> None:
    """Fill links (6, 3, 4) with L_1 .. L_6.

    Args:
        chain: (7, 3, 4) the model's placements [-, m].
        T: (4, 4) the target.
        scale: what lengths are multiplied by, so that the arm's is about 1 [1/m].
        labelling: see `LABELLINGS`.
        links: filled.
    """
    for i in range(6):
        if labelling < 6:
            fill_link(chain, T, scale, (labelling + i) % 6, links[i])
        else:
            fill_link(chain, T, scale, (labelling - i - 1) % 6, links[i])
            turn_round(links[i])


def fill_link(chain: Array, T: Array, scale: float, j: int, link: Array) -> None:
    """Fill link (3, 4) with K_(j + 1), lengths scaled."""
    if j < 5:
        for row in range(3):
            for column in range(3):
                link[row, column] = chain[j + 1, row, column]
            link[row, 3] = scale * chain[j + 1, row, 3]
        return
    # chain[6] T^-1 chain[0]: first T^-1 chain[0], column by column, then chain[6] in front.
    for column in range(4):
        x, y, z = chain[0, 0, column], chain[0, 1, column], chain[0, 2, column]
        if column == 3:
            x, y, z = x - T[0, 3], y - T[1, 3], z - T[2, 3]
        a = T[0, 0] * x + T[1, 0] * y + T[2, 0] * z
        b = T[0, 1] * x + T[1, 1] * y + T[2, 1] * z
        c = T[0, 2] * x + T[1, 2] * y + T[2, 2] * z
        for row in range(3):
            value = chain[6, row, 0] * a + chain[6, row, 1] * b + chain[6, row, 2] * c
            link[row, column] = value if column < 3 else scale * (value + chain[6, row, 3])


def turn_round(link: Array) -> None:
    """Invert a link (3, 4) in place, seen from frames turned half about x: its joints then turn the same way."""
    p = (link[0, 3], link[1, 3], link[2, 3])
    x, y, z = column_of(link, 0), column_of(link, 1), column_of(link, 2)
    for i in range(3):
        link[0, i], link[1, i], link[2, i] = x[i], -y[i], -z[i]
        if i > 0:
            link[0, i], link[1, i], link[2, i] = -link[0, i], -link[1, i], -link[2, i]
    link[0, 3] = -(x[0] * p[0] + x[1] * p[1] + x[2] * p[2])
    link[1, 3] = y[0] * p[0] + y[1] * p[1] + y[2] * p[2]
    link[2, 3] = z[0] * p[0] + z[1] * p[1] + z[2] * p[2]


def column_of(link: Array, i: int) -> Vec:
    """Column i of a (3, 4) placement."""
    return (link[0, i], link[1, i], link[2, i])


def move_links(links: Array, n: int) -> None:
    """Follow each link by a small placement, in place: a structure that the arm has is broken.

    Those of an odd number are the opposite ones of those before.
    """
    for i in range(6):
        link, small = links[i], SMALL_PLACEMENTS[n, i]
        for row in range(3):
            x, y, z = link[row, 0], link[row, 1], link[row, 2]
            for column in range(4):
                value = x * small[0, column] + y * small[1, column] + z * small[2, column]
                link[row, column] = value if column < 3 else link[row, 3] + value
