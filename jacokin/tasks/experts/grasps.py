"""How to take a brick: where the hand goes, and that it holds the brick afterwards."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from jacokin.arrays import Array
from jacokin.ik import Scene
from jacokin.tasks.experts import motions
from jacokin.tasks.experts.arm import Arm
from jacokin.tasks.experts.motions import Script, up

CENTRE = np.array((0.0, -0.012, 0.0))  # [m] of the fingers' grip in the frame of the pinch site
HALF = np.array((0.016, 0.032, 0.012))  # [m] of a brick
ABOVE = 0.08  # [m] from where the hand comes straight
WIDE = 1.0  # [rad] of the fingers around the short side of a brick
SQUEEZE_STEPS = 9  # until a grip holds
SLIPPED = 0.03  # [m] from the middle of the grip: a brick that is farther is not held
# Tilts along the long and the short side of a brick [rad], and shifts along the long side [m], that may be tried.
TILTS = tuple((tilt, 0.0) for tilt in (0.0, 0.15, -0.15, 0.3, -0.3))
TILTS += tuple((0.0, lean) for lean in (0.2, -0.2, 0.35, -0.35))
SHIFTS = (0.0, 0.01, -0.01, 0.02, -0.02)
SPREAD = 0.01  # [m] of the finger tips from their middle, by which one is lower when the hand is tilted
ROOM = 0.006  # [m] between the arm and an obstacle
HINDRANCE = 500.0  # [s/m] by which a grasp is worse that has less room
TILT_COST, SHIFT_COST = 3.0, 40.0  # [s/rad], [s/m]
TOLERANCES = (0.006, 0.03, 0.15)  # [rad] of the last stop on the way, of that before it, and so on
LONGEST_STEP = 1.0  # [s] from one configuration to the next without a change of branch


@dataclass(frozen=True, slots=True, eq=False)
class Grasp:
    """Where the hand goes.

    Attributes:
        way: configurations on the way, the last of which is at the brick [rad].
        pose: T_world_tool at the brick.
        room: between the arm and obstacles near the brick [m].
        penalty: for tilts and shifts, with which grasps are less firm [s].
    """

    way: tuple[Array, ...]
    pose: pin.SE3
    room: float
    penalty: float


def upright(rotation: Array) -> Array:
    """The rotation nearest to this one that has an axis of the prop upright."""
    axis = int(np.abs(rotation[2]).argmax())
    vertical = np.sign(rotation[2, axis]) * np.array((0.0, 0.0, 1.0))
    turn = np.cross(rotation[:, axis], vertical)
    sine = float(np.linalg.norm(turn))
    if sine < 1e-9:
        return rotation
    angle = np.arctan2(sine, float(rotation[:, axis] @ vertical))
    return np.asarray(pin.exp3(turn / sine * angle) @ rotation)


def plan(
    arm: Arm, brick: pin.SE3, ways: Sequence[Array] = (), scene: Scene | None = None, height: float = 0.0
) -> Grasp | None:
    """The grasp that is quick to reach, and leaves room between the arm and obstacles; None if none is possible.

    Args:
        arm: the arm.
        brick: T_world_brick.
        ways: where it is carried then, from where it lies [m].
        scene: obstacles, in the frame of the arm's base.
        height: of the tool, at least, where it begins to come straight [m].
    """
    rotation = upright(brick.rotation)
    vertical = int(np.abs(rotation[2]).argmax())
    across, along = sorted({0, 1, 2} - {vertical}, key=lambda axis: HALF[axis])
    best, cost = None, np.inf
    for sign, (tilt, lean), shift in itertools.product(
        (1.0, -1.0), TILTS if scene is not None else TILTS[:1], SHIFTS if scene is not None else SHIFTS[:1]
    ):
        tool = pointing(sign * rotation[:, across], tilt, lean)
        sideways = abs(np.sin(tilt)) + abs(np.sin(lean))
        middle = brick.translation + shift * rotation[:, along] + up(SPREAD * sideways)
        at = pin.SE3(tool, middle - tool @ CENTRE)
        before = motions.moved(at, -ABOVE * tool[:, 2])
        penalty = TILT_COST * (abs(tilt) + abs(lean)) + SHIFT_COST * abs(shift)
        for q in arm.configurations(before)[:4]:
            stops = arm.chain([at, *(motions.moved(at, way) for way in ways)], q, LONGEST_STEP)
            if stops is None:
                continue
            room = np.inf if scene is None else arm.room(arm.way(q, *stops), scene)
            higher = arm.chain([motions.moved(before, up(max(0.0, height - before.translation[2])))], q, LONGEST_STEP)
            for way in [(q,)] if scene is None or higher is None else [(q,), (higher[0], q)]:
                value = arm.duration(arm.q, *way, stops[0]) + penalty
                if scene is not None:
                    value += HINDRANCE * max(0.0, ROOM - min(room, arm.room(arm.way(arm.q, *way), scene)))
                if value < cost:
                    best, cost = Grasp((*way, stops[0]), at, room, penalty), value
    return best


def take(arm: Arm, grasp: Grasp) -> Script:
    """Go there and close the fingers."""
    stops = list(zip(reversed(grasp.way), TOLERANCES, strict=False))
    for q, tolerance in reversed(stops):
        yield from motions.go(arm, q, WIDE, tolerance=tolerance, around=q is not grasp.way[-1])
    yield from motions.close(arm, SQUEEZE_STEPS)


def holds(arm: Arm, brick: pin.SE3) -> bool:
    """Whether a brick is between the fingers."""
    return bool(np.linalg.norm(arm.pose.act(CENTRE) - brick.translation) < SLIPPED)


def pointing(across: Array, tilt: float = 0.0, lean: float = 0.0) -> Array:
    """R_world_tool of a hand that points down.

    Args:
        across: (3,) horizontal direction in which the fingers close.
        tilt: about the tool's x axis, across which the two fingers stand side by side [rad].
        lean: then about its y axis, around which they close [rad].
    """
    c, s = across[:2] / np.linalg.norm(across[:2])
    down = np.array(((c, s, 0.0), (s, -c, 0.0), (0.0, 0.0, -1.0)))
    return np.asarray(down @ pin.utils.rotate("x", tilt) @ pin.utils.rotate("y", lean))
