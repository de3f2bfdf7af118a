"""For how long two shapes stay apart on a motion, by the direction in which they are apart.

They come nearer at most as fast as the farthest point of one moves, whichever way that is. Where they pass each other,
hardly any of it is along the direction in which they are apart, and what they lose of their distance along it grows
with the square of the time (directional motion bounds: Tang, Kim and Manocha: C2A: controlled conservative advancement
for continuous collision detection of polygonal models, 2009).
"""

from __future__ import annotations

import math

from jacokin.arrays import Array
from jacokin.kernels.contact.arm import HINGE, Places, in_world
from jacokin.kernels.contact.separation import SeparationWork
from jacokin.kernels.contact.shapes import (
    CENTRE,
    CLOUD,
    KIND,
    LINK,
    MARGIN,
    PLANE,
    RADIUS,
    Shapes,
    support_of_difference,
)
from jacokin.kernels.contact.touching import Geometry
from jacokin.kernels.vector import Vec, cross, dot

#: Normals have a length of one; shorter than the root of this are none.
NO_NORMAL = 0.5
#: Keeps a quotient finite where nothing moves.
STILL = 1e-12


def apart_along(shapes: Shapes, pair: tuple[int, int], work: SeparationWork, distance: float) -> float:
    """How far two shapes are apart along the normal that `shape_separation` left; -inf where there is none [m].

    Args:
        shapes: all of them.
        pair: numbers of the two.
        work: as `shape_separation` left it.
        distance: what it returned [m].
    """
    a, b = pair
    if shapes.integers[a, KIND] == CLOUD or shapes.integers[b, KIND] == CLOUD:
        return -math.inf
    if shapes.integers[b, KIND] == PLANE:
        return distance
    n = (work.witness[0, 0], work.witness[0, 1], work.witness[0, 2])
    if dot(n, n) < NO_NORMAL:
        return -math.inf
    over = support_of_difference(shapes, pair, work.relative, work.hints, n, work.simplex[0])
    return float(-over - shapes.numbers[a, MARGIN] - shapes.numbers[b, MARGIN])


def lasts(
    geometry: Geometry,
    places: Places,
    work: SeparationWork,
    pair: tuple[int, int],
    is_own: bool,
    step: Array,
    half: float,
    room: float,
) -> float:
    """For how many units of a motion two shapes stay apart, before and after where they are placed.

    Args:
        geometry: arm and obstacles.
        places: where the links are.
        work: with the normal along which the shapes are apart.
        pair: numbers of the two.
        is_own: whether both are shapes of the arm, the second of which moves as seen from the first; else the first.
        step: (dof,) what the joints do for each unit of the motion [rad].
        half: how many units the motion is long, either way: more than that is not certain.
        room: of their distance along the normal, how much they may lose [m].
    """
    shapes, frames = geometry.shapes, places.frames
    moving, begin = (pair[1], shapes.integers[pair[0], LINK]) if is_own else (pair[0], 0)
    row, link, n = shapes.numbers[moving], shapes.integers[moving, LINK], normal_in_world(shapes, places, pair[0], work)
    centre, core = in_world(frames, link, row[CENTRE], row[CENTRE + 1], row[CENTRE + 2]), row[RADIUS] - row[MARGIN]
    speed, moved, pull, turning = 0.0, 0.0, 0.0, (0.0, 0.0, 0.0)
    for j in range(link - 1, begin - 1, -1):
        f, turn = frames[j + 1], abs(step[j])
        axis = (f[0, 2], f[1, 2], f[2, 2])
        if geometry.arm.joint_kinds[j] != HINGE:
            speed += step[j] * dot(n, axis)
            moved += turn
            continue
        across = cross(axis, (centre[0] - f[0, 3], centre[1] - f[1, 3], centre[2] - f[2, 3]))
        speed += step[j] * dot(n, across)
        turning = (
            turning[0] + step[j] * axis[0],
            turning[1] + step[j] * axis[1],
            turning[2] + step[j] * axis[2],
        )
        lever = math.sqrt(dot(across, across)) + core + half * moved
        # The second derivative by two joints is at most the distance from the axis of the outer one.
        pull += turn * (turn * lever + 2.0 * moved)
        moved += turn * lever
    tilting = cross(n, turning)
    speed = abs(speed) + core * math.sqrt(dot(tilting, tilting))
    return float(2.0 * room / (speed + math.sqrt(speed * speed + 2.0 * pull * room) + STILL))


def normal_in_world(shapes: Shapes, places: Places, i: int, work: SeparationWork) -> Vec:
    """The normal that is known in the frame of a shape."""
    u, f, n = shapes.numbers[i], places.frames[shapes.integers[i, LINK]], work.witness[0]
    x = u[0] * n[0] + u[1] * n[1] + u[2] * n[2]
    y = u[4] * n[0] + u[5] * n[1] + u[6] * n[2]
    z = u[8] * n[0] + u[9] * n[1] + u[10] * n[2]
    return (
        f[0, 0] * x + f[0, 1] * y + f[0, 2] * z,
        f[1, 0] * x + f[1, 1] * y + f[1, 2] * z,
        f[2, 0] * x + f[2, 1] * y + f[2, 2] * z,
    )
