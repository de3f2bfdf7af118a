"""`place`: take a brick, put it on a pedestal, take the hand away."""

from __future__ import annotations

import itertools

import numpy as np
import pinocchio as pin

from jacokin.arrays import Array
from jacokin.ik import Capsule, Scene, Sphere
from jacokin.mujoco_bridge import robots
from jacokin.tasks.experts import grasps
from jacokin.tasks.experts.driver import BRICK, CLOSED, OPEN, SPEED, SQUEEZE, ArmDriver, Script, shift, up

CLEAR = 0.07  # [m] of the brick's middle above the pedestal on its way
ON_BRICK, IN_CRADLE = 0.04, 0.032  # [m] of the brick's middle above the pedestal when it is released
YAWS = np.arange(12) * np.pi / 6.0  # [rad] that a brick may be turned by above the pedestal
DRAG_TILTS = (0.25, 0.4, 0.1)  # [rad] away from the pedestal, the first is preferred
LOW = 0.04  # [m] of the closed fingers above a brick, where nothing is in their way
FREE = 0.155  # [m] between the axis of the pedestal and a brick that can be grasped from above
OVER = 0.08  # [m] of the hand above the pedestal while it goes somewhere
_SPHERE, _OFFSET = 0.049, 0.0343  # [m] radius of the spheres of its cradle, and how far out and down they are
_ORIGIN = np.array((0.0, 0.0, -0.0119))  # [m] of a brick from its middle


def place(arm: ArmDriver, rest: float) -> Script:
    """Put a brick on the pedestal, again if it falls; it is released at some height above it [m]."""
    target = arm.get("pedestal/position", 3)
    scene = pillar(target)
    has_failed = False
    while True:
        brick = arm.prop(BRICK)
        if np.linalg.norm(brick.act(_ORIGIN) - target) < 0.05:  # [m]
            yield from _leave(arm, target)
            q = arm.q.copy()
            yield arm.towards(q, 0.0)
            continue
        ways = _ways(brick.translation, target)
        grasp = grasps.plan(arm, brick, ways, scene, target[2] + OVER) or grasps.plan(arm, brick)
        beside = np.linalg.norm((brick.translation - target)[:2])
        is_near = has_failed and beside < FREE
        if grasp is None or grasp.room < 0.0 or is_near:
            yield from _drag(arm, brick.translation, target, scene)
            brick = arm.prop(BRICK)
            ways = _ways(brick.translation, target)
            grasp = grasps.plan(arm, brick, ways, scene, target[2] + OVER) or grasps.plan(arm, brick)
        if grasp is None:
            yield arm.towards(arm.robot.home, arm.fingers_to(OPEN))
            continue
        yield from grasps.take(arm, grasp)
        start = arm.pose
        for way in ways:
            yield from arm.move(shift(start, way), SQUEEZE, tolerance=0.02)
            if not grasps.holds(arm, arm.prop(BRICK)):
                break
        else:
            yield from _put(arm, target, rest)
        if not grasps.holds(arm, arm.prop(BRICK)):
            has_failed = True
            yield from arm.move(shift(arm.pose, up(0.05)), grasps.WIDE, tolerance=0.02)


def _drag(arm: ArmDriver, brick: Array, target: Array, scene: Scene) -> Script:
    """Press on a brick with the closed fingers and drag it away from the pedestal."""
    outwards = (brick - target) * (1.0, 1.0, 0.0)
    beside = max(float(np.linalg.norm(outwards)), 1e-6)
    outwards /= beside
    tangent = np.array((-outwards[1], outwards[0], 0.0))
    on = brick * (1.0, 1.0, 0.0) + up(0.024) + 0.008 * outwards  # 8 mm outwards from its middle, 24 mm high
    way = max(0.0, FREE - beside) * outwards
    best, cost = None, 2.5  # [s] at most
    for yaw, tilt in itertools.product(YAWS, DRAG_TILTS):
        tool = pin.exp3(tilt * tangent) @ grasps.point_down(np.array((np.cos(yaw), np.sin(yaw), 0.0)))
        at = pin.SE3(tool, on - tool @ grasps.CENTRE)
        for height in (LOW, target[2] + OVER - at.translation[2]):
            for q in arm.configurations(shift(at, up(height)))[:4]:
                value = arm.duration(arm.q, q) + height / SPEED + abs(tilt - DRAG_TILTS[0])
                if value > cost or arm.chain([at, shift(at, way)], q, grasps.LONGEST_STEP) is None:
                    continue
                if height > LOW or arm.room(arm.way(arm.q, q), scene) > grasps.ROOM:
                    best, cost = (q, at), value
    if best is None:
        return
    yield from arm.go(best[0], CLOSED, tolerance=0.08)
    yield from arm.move(best[1], CLOSED, settle=5)
    yield from arm.move(shift(best[1], way), CLOSED, speed=0.15, settle=3)
    yield from arm.move(shift(best[1], way + up(0.06)), CLOSED, tolerance=0.03)


def _ways(brick: Array, target: Array) -> list[Array]:
    """Where a brick is carried: away from the pedestal, and up."""
    outwards = (brick - target) * (1.0, 1.0, 0.0)
    beside = float(np.linalg.norm(outwards))
    # A brick is lifted 12.5 cm from the axis of the pedestal, at least.
    aside = max(0.0, 0.125 - beside) * outwards / max(beside, 1e-6)
    return [aside + up(0.03), aside + up(target[2] + CLEAR - brick[2])]  # first up by 3 cm, while it goes away


def _put(arm: ArmDriver, target: Array, rest: float) -> Script:
    """Carry the brick over the pedestal, level it, lower it and let it go."""
    brick = arm.prop(BRICK)
    T_brick_tool = brick.inverse() * arm.pose
    level = grasps.turn_upright(brick.rotation)
    best, cost = None, np.inf
    for yaw in YAWS:
        above = pin.SE3(pin.utils.rotate("z", yaw) @ level, target + up(CLEAR)) * T_brick_tool
        for q in arm.configurations(above)[:4]:
            below = arm.chain([shift(above, up(rest - CLEAR))], q, grasps.LONGEST_STEP)
            if below is not None and arm.durations(q[None], arm.q)[0] < cost:
                best, cost = (q, shift(above, up(rest - CLEAR))), float(arm.durations(q[None], arm.q)[0])
    if best is None:
        return
    yield from arm.go(best[0], SQUEEZE, tolerance=0.02)
    T_tool_brick = arm.pose.inverse() * arm.prop(BRICK)
    # The joints accelerate differently, and the brick would leave its way.
    for action in arm.move(best[1], SQUEEZE, speed=0.12, ramp=0.2, settle=5):
        yield action
        T_tool_brick_now = arm.pose.inverse() * arm.prop(BRICK)
        if np.linalg.norm(T_tool_brick_now.translation - T_tool_brick.translation) > 0.002:  # [m]
            # What presses on something jumps when it is let go.
            height = arm.pose.translation[2] + 0.006 - best[1].translation[2]
            yield from arm.move(shift(best[1], up(height)), SQUEEZE, settle=8)
            break
    yield from arm.release(6)


def _leave(arm: ArmDriver, target: Array) -> Script:
    """Take the hand away upwards."""
    missing = target[2] + 0.23 - arm.pose.translation[2]  # [m] above the pedestal
    if missing > 0.01:
        above = arm.chain([shift(arm.pose, up(missing))], arm.q, np.inf)
        if above is not None:
            yield from arm.go(above[0], OPEN)


def pillar(top: Array) -> Scene:
    """The pedestal as an obstacle, in the frame of the arm's base."""
    radius, length = 0.07, 0.2  # [m]
    centre = top - robots.ARM_OFFSET
    column = Capsule("pillar", radius, length, centre - (0.0, 0.0, radius + length / 2.0))
    around = np.arange(3) * 2.0 * np.pi / 3.0
    spheres = [
        Sphere(f"sphere_{number}", _SPHERE, centre + _OFFSET * np.array((np.sin(angle), np.cos(angle), -1.0)))
        for number, angle in enumerate(around)
    ]
    return Scene([column, *spheres], finger_angle=grasps.WIDE)
