"""Ways to grasp boxes, cylinders and spheres: where the tool is, about which axis it may turn, how wide the hand opens.

The hand is a Jaco's, and the tool its `end_effector`: it lies between the pads of the fingers, which close along its x
axis, and its z axis points away from the palm.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.model import checks, poses
from jacokin.model.angles import TURN
from jacokin.model.poses import FreeAxis

#: Angles of the fingers [rad], and half the room between their pads then [m], of the shapes in the descriptions.
ANGLES = np.array([0.15, 0.4, 0.6, 0.8, 1.0, 1.2, 1.35])
HALF_ROOMS = np.array([0.060, 0.050, 0.041, 0.031, 0.021, 0.011, 0.003])
SPARE = 0.019  # [m] between pads and object, on each side; the knuckles of the fingers are nearer
DEPTH = 0.017  # [m] below the side of an object that the tool comes to, at most: farther back is the palm
TILT = 0.15  # [rad] by which a hand that holds a box may turn about the axis along which the fingers close
SPACING = 0.04  # [m] between grasps along an object
DIRECTIONS = 24  # from which a sphere is grasped
AROUND = 24  # directions from which a cylinder is grasped


@dataclass(frozen=True, slots=True, eq=False)
class Grasp:
    """One way to grasp something.

    Attributes:
        target: where the tool is: a pose that may turn about an axis.
        opening: of the fingers before they close: angle [rad], or [m] where they slide; None for as the robot was
            loaded.
    """

    target: FreeAxis
    opening: float | None = None


def box(size: ArrayLike, pose: pin.SE3 | ArrayLike) -> list[Grasp]:
    """Grasps across each pair of sides of a box that the hand can span, from every side it can come from.

    The hand may tilt about the axis along which the fingers close.

    Args:
        size: (3,) edge lengths [m].
        pose: T_base_box, or the position of its centre (3,) [m].

    Raises:
        InvalidInputError: malformed, or too large for the hand.
    """
    edges = checks.positive_vector("size", size, 3, "m")
    T_base_box = _placed(pose)
    found = []
    for across in range(3):
        if edges[across] > 2.0 * (HALF_ROOMS[0] - SPARE):
            continue
        opening = opening_for(float(edges[across]))
        for along, sign, turned in itertools.product((k for k in range(3) if k != across), (-1.0, 1.0), (-1.0, 1.0)):
            out = sign * np.eye(3)[along]
            tool = _tool(turned * np.eye(3)[across], -out)
            other = 3 - across - along
            deep = 0.5 * edges[along] - min(0.5 * edges[along], DEPTH)
            for shift in _places(float(edges[other])):
                centre = deep * out + shift * np.eye(3)[other]
                at = T_base_box * pin.SE3(tool, centre)
                found.append(Grasp(FreeAxis(at, axis=[1.0, 0.0, 0.0], range=(-TILT, TILT)), opening))
    if not found:
        raise _too_large(f"the shortest edge, {edges.min():.3g} m,")
    return found


def cylinder(radius: float, length: float, pose: pin.SE3 | ArrayLike) -> list[Grasp]:
    """Grasps around a cylinder from any side, and from both ends.

    Args:
        radius: [m].
        length: along its z axis [m].
        pose: T_base_cylinder, or the position of its centre (3,) [m].

    Raises:
        InvalidInputError: malformed, or too large for the hand.
    """
    width = 2.0 * checks.positive("radius", radius, "m")
    tall = checks.positive("length", length, "m")
    T_base_cylinder = _placed(pose)
    opening = opening_for(width)
    z, found = np.array([0.0, 0.0, 1.0]), []
    for sign in (1.0, -1.0):
        deep = 0.5 * tall - min(0.5 * tall, DEPTH)
        end = pin.SE3(_tool(np.array([1.0, 0.0, 0.0]), -sign * z), sign * deep * z)
        found.append(Grasp(FreeAxis(T_base_cylinder * end, axis=[0.0, 0.0, 1.0]), opening))
    for turn, sign, shift in itertools.product(np.arange(AROUND) * TURN / AROUND, (1.0, -1.0), _places(tall)):
        out = np.array([np.cos(turn), np.sin(turn), 0.0])
        side = _tool(sign * np.cross(z, out), -out)
        at = T_base_cylinder * pin.SE3(side, shift * z + max(0.0, radius - DEPTH) * out)
        found.append(Grasp(FreeAxis(at, axis=[1.0, 0.0, 0.0], range=(-TILT, TILT)), opening))
    return found


def sphere(radius: float, position: ArrayLike) -> list[Grasp]:
    """Grasps of a sphere from directions spread evenly, each with any turn of the hand.

    Args:
        radius: [m].
        position: (3,) of its centre [m].

    Raises:
        InvalidInputError: malformed, or too large for the hand.
    """
    opening = opening_for(2.0 * checks.positive("radius", radius, "m"))
    centre = checks.vector("position", position, 3, "m")
    found = []
    for k in range(DIRECTIONS):  # a spiral from pole to pole
        height = 1.0 - (2.0 * k + 1.0) / DIRECTIONS
        turn = np.pi * (1.0 + np.sqrt(5.0)) * k
        flat = np.sqrt(1.0 - height * height)
        out = np.array([flat * np.cos(turn), flat * np.sin(turn), height])
        across = np.array([-np.sin(turn), np.cos(turn), 0.0])
        at = pin.SE3(_tool(across, -out), centre + max(0.0, radius - DEPTH) * out)
        found.append(Grasp(FreeAxis(at, axis=[0.0, 0.0, 1.0]), opening))
    return found


def opening_for(width: float) -> float:
    """The angle of the fingers [rad] at which something so wide [m] has room between them.

    Raises:
        InvalidInputError: wider than the hand opens.
    """
    half = 0.5 * width + SPARE
    if half > HALF_ROOMS[0]:
        raise _too_large(f"{width:.3g} m")
    return float(np.interp(-half, -HALF_ROOMS, ANGLES))


def _too_large(what: str) -> InvalidInputError:
    return InvalidInputError(f"{what} is more than the hand spans, {2.0 * (HALF_ROOMS[0] - SPARE):.3g} m")


def _placed(pose: pin.SE3 | ArrayLike) -> pin.SE3:
    if not isinstance(pose, pin.SE3) and np.ndim(pose) == 1:
        return pin.SE3(np.eye(3), checks.vector("pose", pose, 3, "m"))
    return poses.checked_pose(pose, "pose")


def _tool(across: Array, ahead: Array) -> Array:
    """Rotation of a tool whose fingers close along one direction, and that points in another."""
    return np.column_stack([across, np.cross(ahead, across), ahead])


def _places(length: float) -> Iterator[float]:
    """Where along an edge the hand may take it, from its middle [m]."""
    room = max(0.0, 0.5 * length - DEPTH)
    count = int(room / SPACING)
    return (SPACING * k for k in sorted(range(-count, count + 1), key=abs))
