"""The scripts: what an expert does, one action after the other.

A script is a generator of actions. Before each it is resumed, the arm has a new observation.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from jacokin.arrays import Array
from jacokin.ik import Capsule, Scene, Sphere
from jacokin.mujoco_bridge import robots
from jacokin.tasks.experts.arm import CLOSE, DOWN, OPEN, RELEASE, Arm, yaw_of, yawed

Script = Iterator[Array]

BRICK = "duplo2x4/"
CENTRE = np.array((0.0, -0.012, 0.0))  # [m] of the fingers' grip in the frame of the pinch site
GRASP_HEIGHT = 0.012  # [m] of the pinch site above the bottom of a brick
ABOVE = 0.08  # [m] where the hand waits above a brick
WIDE = 1.0  # [rad] of the fingers around the short side of a brick
SQUEEZE_STEPS = 10  # control steps until a grip holds
LIFT = 0.33  # [m]
# Tilts along the long and the short side of a brick [rad], and shifts along the long side [m], that may be tried.
GRASPS = tuple(
    (tilt, lean, shift)
    for tilt, lean in ((0.0, 0.0), (0.15, 0.0), (-0.15, 0.0), (0.3, 0.0), (-0.3, 0.0), (0.0, 0.2), (0.0, -0.2))
    for shift in (0.0, 0.012, -0.012, 0.022, -0.022)
)
SPREAD = 0.03  # [m] of the finger tips from their middle, by which one is lower when the hand is tilted
ROOM = 0.006  # [m] between the arm and a pedestal
HINDRANCE = 500.0  # [s/m] by which a grasp is worse that has less room
ATTEMPTS = 3  # to grasp
CLEAR = 0.055  # [m] of a brick above the pedestal on its way
REST = 0.02  # [m] of a brick above the top of the pedestal when it is released
HELD = 0.03  # [m] a brick that is higher is held
AWAY = 0.23  # [m] of the hand above the pedestal at the end
RELEASE_STEPS = 6
_PILLAR = (0.07, 0.2)  # [m] radius and length of the pedestal
_SPHERE, _OFFSET = 0.049, 0.0343  # [m] radius of the spheres of its cradle, and how far out and down they are
_HALF = 0.012  # [m] from the bottom of a brick to where it is observed


def up(height: float) -> Array:
    """A vertical way [m]."""
    return np.array((0.0, 0.0, height))


def stay(arm: Arm, fingers: float) -> Script:
    """Stay where the arm is now, for ever."""
    q = arm.q.copy()
    while True:
        yield arm.towards(q, fingers)


def go(arm: Arm, q: Array, fingers: float, *, tolerance: float = 0.01, steps: int = 125, speed: float = 1.0) -> Script:
    """Go to a configuration; the fingers go to an angle, or squeeze if it is beyond their limits."""
    for _ in range(steps):
        if arm.is_at(q, tolerance):
            return
        yield arm.towards(q, CLOSE if fingers > 1.4 else arm.fingers_to(fingers), speed)


def reach(arm: Arm) -> Script:
    """Bring the pinch site to the target."""
    seen = arm.find("target_position")
    while True:
        target = arm.get(seen[0], 3) if seen else arm.get(f"{BRICK}position", 3)
        # Any yaw will do; the present one is near.
        rotation = arm.robot.forward_kinematics(arm.q, "pinchsite").rotation
        height = np.array((0.0, 0.0, 0.0 if seen else 0.02))
        for wanted in (rotation, DOWN):
            found = arm.configurations(target + height, wanted)
            if len(found):
                break
        yield arm.towards(found[0], 0.0) if len(found) else arm.towards(arm.q, 0.0)


SQUEEZE = 2.0  # beyond the limits of the fingers: they squeeze


def grasp(arm: Arm, brick: str, scene: Scene | None = None) -> Iterator[Array]:
    """Take a brick that lies on the table between the fingers."""
    plan = _best_grasp(arm, brick, scene)
    if plan is None:
        return
    above, at = plan
    yield from go(arm, above, WIDE, tolerance=0.03)
    yield from go(arm, at, WIDE, tolerance=0.006, steps=50)
    for _ in range(SQUEEZE_STEPS):
        yield arm.towards(at, CLOSE)


def _best_grasp(arm: Arm, brick: str, scene: Scene | None) -> tuple[Array, Array] | None:
    """Configurations above and at a brick: quick to reach, and with room between the arm and a pedestal."""
    position = arm.get(f"{brick}position", 3) - (0.0, 0.0, _HALF)
    yaw = yaw_of(arm.get(f"{brick}orientation", 4))
    best, cost = None, np.inf
    for turn in (0.0, np.pi):
        for tilt, lean, shift in ((0.0, 0.0, 0.0),) if scene is None else GRASPS:
            rotation = yawed(yaw + turn, tilt, lean)
            sideways = abs(np.sin(tilt)) + abs(np.sin(lean))
            along = shift * np.array((-np.sin(yaw), np.cos(yaw), 0.0))
            tool = position + along + (0.0, 0.0, GRASP_HEIGHT + SPREAD * sideways) - rotation @ CENTRE
            for q in arm.configurations(tool, rotation)[:4]:
                away = tool - ABOVE * rotation[:, 2]
                before = arm.configurations(away, rotation, seed=q)
                if not len(before) or arm.durations(before[:1], q)[0] > 1.0:
                    continue
                value = float(arm.durations(before[:1], arm.q)[0]) + 3.0 * (abs(tilt) + abs(lean)) + 40.0 * abs(shift)
                if scene is not None:
                    room = float(np.min(arm.robot.clearance(arm.way(arm.q, before[0], q), scene)))
                    value += HINDRANCE * max(0.0, ROOM - room)
                if value < cost:
                    best, cost = (before[0], q), value
    return best


def lift_brick(arm: Arm) -> Script:
    """Grasp a brick and lift it."""
    yield from grasp(arm, BRICK)
    rotation = arm.robot.forward_kinematics(arm.q, "pinchsite").rotation
    found = arm.configurations(arm.tool + up(LIFT), rotation)
    if len(found):
        yield from go(arm, found[0], SQUEEZE, tolerance=0.004, steps=1000)
    yield from stay(arm, CLOSE)


def _pillar(top: Array) -> Scene:
    """The pedestal as an obstacle, in the frame of the arm's base."""
    radius, length = _PILLAR
    centre = top - robots.ARM_OFFSET
    pillar = Capsule("pillar", radius, length, centre - (0.0, 0.0, radius + length / 2.0))
    around = np.arange(3) * 2.0 * np.pi / 3.0
    spheres = [
        Sphere(f"sphere_{number}", _SPHERE, centre + _OFFSET * np.array((np.sin(angle), np.cos(angle), -1.0)))
        for number, angle in enumerate(around)
    ]
    return Scene([pillar, *spheres], finger_angle=WIDE)


def place(arm: Arm) -> Script:
    """Grasp a brick, put it on the pedestal, and take the hand away upwards."""
    target = arm.get("pedestal/position", 3)
    scene = _pillar(target)
    for _ in range(ATTEMPTS):
        yield from grasp(arm, BRICK, scene)
        yield from _rise(arm, target[2] + CLEAR, _bottom(arm)[2])
        if _bottom(arm)[2] > HELD:
            break
    rotation = arm.robot.forward_kinematics(arm.q, "pinchsite").rotation
    grip = arm.tool - _bottom(arm)
    for height, tolerance in ((CLEAR, 0.03), (REST, 0.01)):
        found = arm.configurations(target + grip + (0.0, 0.0, height), rotation)
        if len(found):
            yield from go(arm, found[0], SQUEEZE, tolerance=tolerance, steps=60)
    q = arm.q.copy()
    for _ in range(RELEASE_STEPS):
        yield arm.towards(q, RELEASE)
    found = arm.configurations(np.array((*arm.tool[:2], target[2] + AWAY)), rotation)
    if len(found):
        yield from go(arm, found[0], OPEN)
    yield from stay(arm, 0.0)


def _bottom(arm: Arm) -> Array:
    """Position of the bottom of the brick, as long as it lies or is held upright [m]."""
    return arm.get(f"{BRICK}position", 3) - (0.0, 0.0, _HALF)


def _rise(arm: Arm, height: float, bottom: float) -> Script:
    """Lift what is held until its bottom is at a height."""
    rotation = arm.robot.forward_kinematics(arm.q, "pinchsite").rotation
    found = arm.configurations(arm.tool + up(height - bottom), rotation)
    if len(found):
        yield from go(arm, found[0], SQUEEZE, tolerance=0.06, steps=60)
