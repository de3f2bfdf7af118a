"""What scripts consist of: go to a configuration, move the tool along a line, close and open the hand.

A script is a generator of actions. Before each it is resumed, the arm has a new observation.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pinocchio as pin

from jacokin.arrays import Array
from jacokin.tasks.experts.arm import CLOSE, CLOSED, RELEASE, Arm
from jacokin.tasks.task import CONTROL_TIMESTEP

Script = Iterator[Array]

BRICK = "duplo2x4/"  # prefix of the observations of the first brick
SQUEEZE = 2.0  # [rad] beyond the limits of the fingers: they squeeze
STUCK_STEPS, STUCK = 5, 0.01  # an arm that moves less [rad] in so many steps is stopped by something
AROUND = 0.08  # [m]
SPEED = 0.35  # [m/s] of the tool along lines
TURN = 1.0  # [rad/s]
KEEPS_UP, LAG = 0.015, 0.04  # [m] of the tool behind the line, from where that slows down, and where it waits
PATIENCE = 15  # steps of waiting, until it ends
STILL = 0.002  # [m] and [rad] from the end of a line


def up(height: float) -> Array:
    """A vertical way [m]."""
    return np.array((0.0, 0.0, height))


def moved(pose: pin.SE3, way: Array) -> pin.SE3:
    """A pose moved by a way in the world [m]."""
    return pin.SE3(pose.rotation, pose.translation + way)


def stay(arm: Arm, fingers: float) -> Script:
    """Stay where the arm is now, for ever."""
    q = arm.q.copy()
    while True:
        yield arm.towards(q, fingers)


def hold(arm: Arm, fingers: float, steps: int) -> Script:
    """Stay where the arm is now while the fingers move with a velocity [rad/s]."""
    q = arm.q.copy()
    for _ in range(steps):
        yield arm.towards(q, fingers)


def close(arm: Arm, steps: int) -> Script:
    """Squeeze."""
    yield from hold(arm, CLOSE, steps)
    arm.grip = arm.fingers.copy()


def release(arm: Arm, steps: int) -> Script:
    """Open the hand."""
    return hold(arm, RELEASE, steps)


def _fingers(arm: Arm, angle: float) -> Array:
    """Velocities that move the fingers to an angle; if it is beyond their limits, the thumb squeezes."""
    if angle <= CLOSED:
        return arm.fingers_to(angle)
    return np.concatenate(((CLOSE,), arm.fingers_to(arm.grip)[1:]))


def go(arm: Arm, q: Array, fingers: float, *, tolerance: float = 0.01, around: bool = True) -> Script:
    """Go to a configuration; the fingers go to an angle, or squeeze if it is beyond their limits.

    Args:
        arm: the arm.
        q: (6,) where to [rad].
        fingers: their angle [rad].
        tolerance: at which distance of a joint the motion ends [rad].
        around: where something stops the arm, go around it, upwards; otherwise the motion ends there.
    """
    before, step = arm.q + 1.0, 0
    while not arm.is_at(q, tolerance):
        yield arm.towards(q, _fingers(arm, fingers))
        step += 1
        if step % STUCK_STEPS == 0:
            if np.abs(arm.q - before).max() < STUCK:
                if not around:
                    return
                around = False
                yield from move(arm, moved(arm.pose, up(AROUND)), fingers, tolerance=0.02, settle=2)
            before = arm.q.copy()


def move(
    arm: Arm,
    pose: pin.SE3,
    fingers: float,
    *,
    speed: float = SPEED,
    ramp: float = 0.0,
    tolerance: float = STILL,
    settle: int = 15,
) -> Script:
    """Move the pinch site to a pose in the world along a straight line.

    Args:
        arm: the arm.
        pose: T_world_tool at the end.
        fingers: their angle [rad]; they squeeze if it is beyond their limits.
        speed: of the tool [m/s].
        ramp: time until it has this speed [s].
        tolerance: to the end, where the motion may stop [m], [rad].
        settle: steps at most from when the line has ended.
    """
    arm.follow_from_here()
    start = arm.pose
    turn = pin.log3(start.rotation.T @ pose.rotation)
    way = pose.translation - start.translation
    duration = max(float(np.linalg.norm(way)) / speed, float(np.linalg.norm(turn)) / TURN, CONTROL_TIMESTEP)
    part, waited, now, pace = 0.0, 0, start, 0.0
    while part < 1.0 and waited < PATIENCE:
        # The joints accelerate slowly, and each has its limit: the line waits for them.
        lag = float(np.linalg.norm(arm.pose.translation - now.translation)) + (0.0 if arm.is_stuck else arm.lag)
        rate = min(1.0, max(0.0, (LAG - lag) / (LAG - KEEPS_UP)))
        waited = waited + 1 if rate < 0.1 else 0
        pace = min(rate, pace + CONTROL_TIMESTEP / max(ramp, CONTROL_TIMESTEP))
        part = min(1.0, part + pace * CONTROL_TIMESTEP / duration)
        now = moved(start, part * way) * pin.SE3(pin.exp3(part * turn), np.zeros(3))
        yield arm.along(now, _fingers(arm, fingers))
    end = arm.chain([pose], arm.tracker.q, np.inf)
    for _ in range(settle):
        if waited >= PATIENCE or distance(arm.pose, pose) < tolerance:
            return
        yield arm.along(pose, _fingers(arm, fingers)) if end is None else arm.towards(end[0], _fingers(arm, fingers))


def distance(a: pin.SE3, b: pin.SE3) -> float:
    """The larger of the distance [m] and the angle [rad] between two poses."""
    turn = float(np.linalg.norm(pin.log3(a.rotation.T @ b.rotation)))
    return max(float(np.linalg.norm(a.translation - b.translation)), turn)
