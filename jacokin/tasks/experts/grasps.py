"""Grasps of a brick: where the hand goes, how it takes the brick, and whether it holds it."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from jacokin.arrays import Array
from jacokin.ik import Scene
from jacokin.tasks.experts.driver import ArmDriver, Script, shift, up

CENTRE = np.array((0.0, -0.012, 0.0))  # [m] of the fingers' grip in the frame of the pinch site
HALF = np.array((0.016, 0.032, 0.012))  # [m] of a brick
ABOVE = 0.08  # [m] from where the hand comes straight
WIDE = 1.0  # [rad] of the fingers around the short side of a brick
ROOM = 0.006  # [m] between the arm and an obstacle
LONGEST_STEP = 1.0  # [s] from one configuration to the next without a change of branch


@dataclass(frozen=True, slots=True)
class Side:
    """How the hand may hold a brick across one of its sides, so that it is not lost when it is lifted.

    Attributes:
        fingers: their angle around the brick before they close [rad].
        closed: their angle when they hold it [rad].
        steps: until they hold it.
        penalty: for a grip that is less firm [s].
        tilts: of the hand across the direction in which the fingers close, and around it [rad], the firmest first; each
            with the shifts along the hand that go with it [m].
    """

    fingers: float
    closed: float
    steps: int
    penalty: float
    tilts: tuple[tuple[float, float, tuple[float, ...]], ...]


_LITTLE_TILTED = ((0.0, 0.0), (0.15, 0.0), (-0.15, 0.0), (0.3, 0.0), (-0.3, 0.0), (0.0, 0.2), (0.0, -0.2))
_SHORT_SHIFTS, _LONG_SHIFTS = (0.0, 0.01, -0.01, 0.02, -0.02), (0.0, 0.01, -0.01, 0.016, -0.016)
SHORT = Side(
    fingers=WIDE,
    closed=1.1,
    steps=9,
    penalty=0.0,
    tilts=tuple((tilt, lean, _SHORT_SHIFTS) for tilt, lean in (*_LITTLE_TILTED, (0.45, 0.0), (0.6, 0.0))),
)
LONG = Side(
    fingers=0.6,
    closed=0.9,
    steps=14,
    penalty=0.4,
    tilts=(
        *((tilt, lean, _LONG_SHIFTS) for tilt, lean in _LITTLE_TILTED),
        (0.45, 0.0, (0.0, -0.01, -0.016)),
        (0.6, 0.0, (0.0, -0.01, -0.016)),
        (-0.45, 0.0, (0.0, 0.01, 0.016)),
    ),
)


@dataclass(frozen=True, slots=True, eq=False)
class BrickGrasp:
    """Where the hand goes.

    Attributes:
        way: configurations on the way, the last of which is at the brick [rad].
        pose: T_world_tool at the brick.
        room: between the arm and obstacles near the brick [m].
        side: how the hand holds the brick there.
    """

    way: tuple[Array, ...]
    pose: pin.SE3
    room: float
    side: Side


def turn_upright(rotation: Array) -> Array:
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
    arm: ArmDriver, brick: pin.SE3, ways: Sequence[Array] = (), scene: Scene | None = None, height: float = 0.0
) -> BrickGrasp | None:
    """The grasp that is quick to reach, and leaves room between the arm and obstacles; None if none is possible.

    Args:
        arm: the arm.
        brick: T_world_brick.
        ways: where it is carried then, from where it lies [m].
        scene: obstacles, in the frame of the arm's base.
        height: of the tool, at least, where it begins to come straight [m].
    """
    best, cost = None, np.inf
    for side in (SHORT,) if scene is None else (SHORT, LONG):
        opened, closed = (None if scene is None else scene.with_fingers(angle) for angle in (side.fingers, side.closed))
        for at, penalty in poses(brick, side, straight=scene is None):
            before = shift(at, -ABOVE * at.rotation[:, 2])
            for q in arm.configurations(before)[:4]:
                if arm.duration(arm.q, q) + penalty >= cost:
                    break  # those that follow take longer
                stops = arm.chain([at, *(shift(at, way) for way in ways)], q, LONGEST_STEP)
                if stops is None:
                    continue
                room = min(_room(arm, opened, q, stops[0]), _room(arm, closed, *stops))
                for way in _ways_to(arm, before, q, height):
                    value = arm.duration(arm.q, *way, stops[0]) + penalty
                    if value < cost:
                        # 1 cm less of room counts as 5 s more.
                        value += 500.0 * max(0.0, ROOM - min(room, _room(arm, opened, arm.q, *way)))
                    if value < cost:
                        best, cost = BrickGrasp((*way, stops[0]), at, room, side), value
    return best


def poses(brick: pin.SE3, side: Side, straight: bool) -> Iterator[tuple[pin.SE3, float]]:
    """T_world_tool of a hand that holds a brick, each with its penalty [s]; straight or in every way."""
    rotation = turn_upright(brick.rotation)
    vertical = int(np.abs(rotation[2]).argmax())
    horizontal = sorted({0, 1, 2} - {vertical}, key=lambda axis: HALF[axis])
    across = horizontal[side is LONG]
    for sign, (tilt, lean, shifts) in itertools.product((1.0, -1.0), side.tilts[:1] if straight else side.tilts):
        tool = point_down(sign * rotation[:, across], tilt, lean)
        sideways = point_down(sign * rotation[:, across])[:, 1]
        # The finger tips are 3 cm from their middle: one is lower when the hand is tilted.
        lower = 0.03 * (abs(np.sin(tilt)) + abs(np.sin(lean)))
        for sideways_by in shifts[:1] if straight else shifts:
            middle = brick.translation + sideways_by * sideways + up(lower)
            penalty = side.penalty + 1.5 * (abs(tilt) + abs(lean)) + 20.0 * abs(sideways_by)  # [s/rad], [s/m]
            yield pin.SE3(tool, middle - tool @ CENTRE), penalty


def _room(arm: ArmDriver, scene: Scene | None, *stops: Array) -> float:
    """The least distance between the arm and obstacles on its way [m]."""
    if scene is None:
        return np.inf
    return arm.room(arm.way(*stops) if len(stops) > 1 else stops[0][np.newaxis], scene)


def _ways_to(arm: ArmDriver, before: pin.SE3, q: Array, height: float) -> list[tuple[Array, ...]]:
    """The ways to where the hand comes straight: at once, or from above."""
    rise = height - float(before.translation[2])
    higher = None if rise <= 0.0 else arm.chain([shift(before, up(rise))], q, LONGEST_STEP)
    return [(q,)] if higher is None else [(q,), (higher[0], q)]


def take(arm: ArmDriver, grasp: BrickGrasp) -> Script:
    """Go there and close the fingers."""
    # In rad: of the last stop on the way, of that before it, and so on.
    stops = list(zip(reversed(grasp.way), (0.006, 0.03, 0.15), strict=False))
    for q, tolerance in reversed(stops):
        yield from arm.go(q, grasp.side.fingers, tolerance=tolerance, around=q is not grasp.way[-1])
    yield from arm.close(grasp.side.steps)


def holds(arm: ArmDriver, brick: pin.SE3, distance: float = 0.03) -> bool:
    """Whether a brick is between the fingers, within some distance of the middle of the grip [m]."""
    return bool(np.linalg.norm(arm.pose.act(CENTRE) - brick.translation) < distance)


def point_down(across: Array, tilt: float = 0.0, lean: float = 0.0) -> Array:
    """R_world_tool of a hand that points down.

    Args:
        across: (3,) horizontal direction in which the fingers close.
        tilt: about the tool's x axis, across which the two fingers stand side by side [rad].
        lean: then about its y axis, around which they close [rad].
    """
    c, s = across[:2] / np.linalg.norm(across[:2])
    down = np.array(((c, s, 0.0), (s, -c, 0.0), (0.0, 0.0, -1.0)))
    return np.asarray(down @ pin.utils.rotate("x", tilt) @ pin.utils.rotate("y", lean))
