"""Ways to grasp boxes, cylinders and spheres: where the tool is, about which axis it may turn, how wide the hand opens.

The hand is a `Gripper`: a Jaco's if none is given, whose tool is its `end_effector`. The pads close along the x axis of
their frame, and its z axis points away from the palm.
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
from jacokin.model.gripper import JACO, Gripper
from jacokin.model.poses import FreeAxis

TILT = 0.15  # [rad] by which a hand that holds a box may turn about the axis along which the fingers close
SPACING = 0.04  # [m] between grasps along an object
DIRECTIONS = 24  # from which a sphere is grasped
AROUND = 24  # directions from which a cylinder is grasped, and turns about an axis that is not one of the tool
CENTRED = 0.002  # [m] from an axis of the tool to that of the pads: turning about either is the same
AT_ONE_TURN = 0.01  # [rad] about the axis along which the fingers close, where no larger turn is meant
CLEARED = (
    0.002  # [m] that the tips of the fingers stay short of the far side of an object, and its near side of the palm
)

X, Z = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, slots=True, eq=False)
class Grasp:
    """One way to grasp something.

    Attributes:
        target: where the tool is: a pose that may turn about an axis.
        opening: of the fingers before they close: angle [rad], or [m] where they slide; None for as the robot was
            loaded.
        gripper: the hand whose opening that is, and that comes along the z axis of its pads; None for one that comes
            along the z axis of the tool, and is the wider open the smaller the opening.
    """

    target: FreeAxis
    opening: float | None = None
    gripper: Gripper | None = None


def box(size: ArrayLike, pose: pin.SE3 | ArrayLike, *, gripper: Gripper = JACO) -> list[Grasp]:
    """Grasps across each pair of sides of a box that the hand can span, from every side it can come from.

    The hand may tilt about the axis along which the fingers close.

    Args:
        size: (3,) edge lengths [m].
        pose: T_base_box, or the position of its centre (3,) [m].
        gripper: the hand, `Gripper.of(robot)`; a Jaco's if not given.

    Raises:
        InvalidInputError: malformed, or too large for the hand.
    """
    hand = checked_gripper(gripper)
    edges = checks.positive_vector("size", size, 3, "m")
    T_base_box = _placed(pose)
    found = list[Grasp]()
    for across in range(3):
        if edges[across] > hand.span:
            continue
        opening = hand.opening_for(float(edges[across]))
        for along, sign, turned in itertools.product((k for k in range(3) if k != across), (-1.0, 1.0), (-1.0, 1.0)):
            out = sign * np.eye(3)[along]
            pads = _pads(turned * np.eye(3)[across], -out)
            other = 3 - across - along
            deep = _deep(hand, float(edges[along]))
            for shift in _places(hand, float(edges[other])):
                centre = deep * out + shift * np.eye(3)[other]
                found += _tilted(hand, T_base_box * pin.SE3(pads, centre), opening)
    if not found:
        raise InvalidInputError(
            f"the shortest edge, {edges.min():.3g} m, is more than the hand spans, {hand.span:.3g} m"
        )
    return found


def cylinder(radius: float, length: float, pose: pin.SE3 | ArrayLike, *, gripper: Gripper = JACO) -> list[Grasp]:
    """Grasps around a cylinder from any side, and from both ends.

    Args:
        radius: [m].
        length: along its z axis [m].
        pose: T_base_cylinder, or the position of its centre (3,) [m].
        gripper: the hand, `Gripper.of(robot)`; a Jaco's if not given.

    Raises:
        InvalidInputError: malformed, or too large for the hand.
    """
    hand = checked_gripper(gripper)
    width = 2.0 * checks.positive("radius", radius, "m")
    tall = checks.positive("length", length, "m")
    T_base_cylinder = _placed(pose)
    opening, found = hand.opening_for(width), list[Grasp]()
    for sign in (1.0, -1.0):
        end = pin.SE3(_pads(X, -sign * Z), sign * _deep(hand, tall) * Z)
        found += _turned(hand, T_base_cylinder * end, opening)
    for turn, sign, shift in itertools.product(np.arange(AROUND) * TURN / AROUND, (1.0, -1.0), _places(hand, tall)):
        out = np.array([np.cos(turn), np.sin(turn), 0.0])
        side = _pads(sign * np.cross(Z, out), -out)
        at = T_base_cylinder * pin.SE3(side, shift * Z + _deep(hand, width) * out)
        found += _tilted(hand, at, opening)
    return found


def sphere(radius: float, position: ArrayLike, *, gripper: Gripper = JACO) -> list[Grasp]:
    """Grasps of a sphere from directions spread evenly, each with any turn of the hand.

    Args:
        radius: [m].
        position: (3,) of its centre [m].
        gripper: the hand, `Gripper.of(robot)`; a Jaco's if not given.

    Raises:
        InvalidInputError: malformed, or too large for the hand.
    """
    hand = checked_gripper(gripper)
    width = 2.0 * checks.positive("radius", radius, "m")
    opening = hand.opening_for(width)
    centre = checks.vector("position", position, 3, "m")
    found = list[Grasp]()
    for k in range(DIRECTIONS):  # a spiral from pole to pole
        height = 1.0 - (2.0 * k + 1.0) / DIRECTIONS
        turn = np.pi * (1.0 + np.sqrt(5.0)) * k
        flat = np.sqrt(1.0 - height * height)
        out = np.array([flat * np.cos(turn), flat * np.sin(turn), height])
        across = np.array([-np.sin(turn), np.cos(turn), 0.0])
        at = pin.SE3(_pads(across, -out), centre + _deep(hand, width) * out)
        found += _turned(hand, at, opening)
    return found


def checked_gripper(gripper: object) -> Gripper:
    """A gripper.

    Raises:
        InvalidInputError: it is none.
    """
    return checks.instance("gripper", gripper, Gripper, "a Gripper, for example Gripper.of(robot)")


def _deep(hand: Gripper, length: float) -> float:
    """How far from the middle of an object the pads are [m], for a hand that comes along an extent of it [m].

    As deep as the palm allows, but no deeper than the middle, nor so deep that the tips reach out on the far side.
    """
    least = max(0.0, 0.5 * length - min(hand.depth, hand.palm - CLEARED))
    return max(least, min(hand.ahead + CLEARED - 0.5 * length, 0.5 * length)) if hand.ahead else least


def _tilted(hand: Gripper, at: pin.SE3, opening: float) -> Iterator[Grasp]:
    """Grasps with the pads at a pose T_base_pads, that may turn a little about the axis along which they close."""
    T_tool_pads = hand.pads_at(opening)
    if _off_axis(T_tool_pads, X) <= CENTRED:
        yield _grasp(hand, at, T_tool_pads, opening, X, TILT)
        return
    for tilt in (0.0, TILT, -TILT):
        yield _grasp(hand, _about(at, X, tilt), T_tool_pads, opening, X, AT_ONE_TURN)


def _turned(hand: Gripper, at: pin.SE3, opening: float) -> Iterator[Grasp]:
    """Grasps with the pads at a pose T_base_pads, or turned about the axis that points away from the palm."""
    T_tool_pads = hand.pads_at(opening)
    if _off_axis(T_tool_pads, Z) <= CENTRED:
        yield _grasp(hand, at, T_tool_pads, opening, Z, 0.5 * TURN)
        return
    for turn in np.arange(AROUND) * TURN / AROUND:
        yield _grasp(hand, _about(at, Z, float(turn)), T_tool_pads, opening, X, AT_ONE_TURN)


def _off_axis(T_tool_pads: pin.SE3, axis: Array) -> float:
    """Distance of the tool from an axis of the pads [m], about which targets turn the tool."""
    return float(np.linalg.norm(np.cross(T_tool_pads.rotation @ axis, T_tool_pads.translation)))


def _about(pose: pin.SE3, axis: Array, angle: float) -> pin.SE3:
    return pose * pin.SE3(pin.exp3(angle * axis), np.zeros(3))


def _grasp(hand: Gripper, at: pin.SE3, T_tool_pads: pin.SE3, opening: float, axis: Array, turn: float) -> Grasp:
    """A grasp with the pads at a pose T_base_pads, or turned to both sides about an axis of theirs [rad]."""
    target = FreeAxis(at * T_tool_pads.inverse(), axis=T_tool_pads.rotation @ axis, range=(-turn, turn))
    return Grasp(target, opening, hand)


def _placed(pose: pin.SE3 | ArrayLike) -> pin.SE3:
    if not isinstance(pose, pin.SE3) and np.ndim(pose) == 1:
        return pin.SE3(np.eye(3), checks.vector("pose", pose, 3, "m"))
    return poses.checked_pose(pose, "pose")


def _pads(across: Array, ahead: Array) -> Array:
    """Rotation of pads that close along one direction, of a hand that points in another."""
    return np.column_stack([across, np.cross(ahead, across), ahead])


def _places(hand: Gripper, length: float) -> Iterator[float]:
    """Where along an edge the hand may take it, from its middle [m]."""
    room = max(0.0, 0.5 * length - hand.depth)
    count = int(room / SPACING)
    return (SPACING * k for k in sorted(range(-count, count + 1), key=abs))
