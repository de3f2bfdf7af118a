"""Stacking: take brick after brick, click it onto the one below."""

from __future__ import annotations

import itertools

import numpy as np
import pinocchio as pin

from jacokin.tasks.experts import grasps, motions
from jacokin.tasks.experts.arm import CLOSED, OPEN, Arm
from jacokin.tasks.experts.motions import SQUEEZE, Script, up

HEIGHT = 0.0192  # [m] from a brick to the one that clicks onto it
HOVER = 0.02  # [m] above that, where a brick is aligned
DEEPER = 0.006  # [m] below the place where it clicks, where the hand goes to press
HIGH = 0.08  # [m] of a brick on its way
CLICK = 0.0005  # [m] from its place, below which a brick has clicked
ALIGNMENTS = 3
FIST = 0.012  # [m] of the pinch site above what the closed fingers press on
PRESS = 0.025  # [m] deeper than its surface, for the force
RELEASE_STEPS, FIST_STEPS = 6, 8


def stack(arm: Arm) -> Script:
    """Stack the bricks in the wanted order, which is that of their names unless it is observed."""
    bricks = [name.removesuffix("position") for name in arm.find("/position") if name.startswith("duplo2x4")]
    order = list(range(len(bricks)))
    if arm.find("desired_order"):
        order = [int(k) for k in arm.whole("desired_order")]
    while True:
        for below, above in itertools.pairwise([bricks[k] for k in order]):
            if not has_clicked(arm, below, above):
                yield from _click(arm, below, above)
                break
        else:
            yield arm.towards(arm.q, arm.fingers_to(OPEN))


def has_clicked(arm: Arm, below: str, above: str) -> bool:
    """Whether a brick is in its place on another."""
    return motions.distance(place_on(arm, below, above), arm.prop(above)) < 4.0 * CLICK


def place_on(arm: Arm, below: str, above: str) -> pin.SE3:
    """T_world_brick of a brick in its place on another, turned by 180 deg if that is nearer."""
    base, brick = arm.prop(below), arm.prop(above)
    turned = base.rotation[:, 0] @ brick.rotation[:, 0] < 0.0
    rotation = base.rotation @ pin.utils.rotate("z", np.pi if turned else 0.0)
    return pin.SE3(rotation, base.translation + HEIGHT * base.rotation[:, 2])


def _click(arm: Arm, below: str, above: str) -> Script:
    """Take a brick, and press it onto another."""
    brick = arm.prop(above)
    rise = up(place_on(arm, below, above).translation[2] + HIGH - brick.translation[2])
    grasp = grasps.plan(arm, brick, [rise]) or grasps.plan(arm, brick)
    if grasp is None:
        yield arm.towards(arm.robot.home, arm.fingers_to(OPEN))
        return
    yield from grasps.take(arm, grasp)
    yield from motions.move(arm, motions.moved(arm.pose, rise), SQUEEZE, tolerance=0.03)
    if not grasps.holds(arm, arm.prop(above)):
        yield from motions.release(arm, RELEASE_STEPS)
        return
    goal = place_on(arm, below, above)
    for height, tolerance in ((HIGH, 0.02), (HOVER, 0.001)):
        tool = motions.moved(goal, up(height)) * arm.prop(above).inverse() * arm.pose
        yield from motions.move(arm, tool, SQUEEZE, tolerance=tolerance, settle=10)
    for _ in range(ALIGNMENTS):
        wanted = motions.moved(goal, up(HOVER))
        if motions.distance(wanted, arm.prop(above)) < CLICK:
            break
        tool = wanted * arm.prop(above).inverse() * tool
        yield from motions.move(arm, tool, SQUEEZE, tolerance=0.0, settle=6)
    yield from motions.move(arm, motions.moved(tool, up(-HOVER - DEEPER)), SQUEEZE, speed=0.08, settle=6)
    if has_clicked(arm, below, above):
        yield from motions.release(arm, RELEASE_STEPS)
        yield from motions.move(arm, motions.moved(arm.pose, up(HIGH)), OPEN, tolerance=0.03)
        return
    yield from motions.release(arm, RELEASE_STEPS)
    yield from motions.move(arm, motions.moved(arm.pose, up(0.04)), grasps.WIDE, tolerance=0.01, settle=4)
    yield from motions.close(arm, FIST_STEPS)
    top = arm.prop(above).translation + up(FIST)
    tool = pin.SE3(arm.pose.rotation, top - arm.pose.rotation @ grasps.CENTRE)
    yield from motions.move(arm, motions.moved(tool, up(0.015)), CLOSED, tolerance=0.003, settle=6)
    yield from motions.move(arm, motions.moved(tool, up(-PRESS)), CLOSED, speed=0.15, settle=8)
    yield from motions.move(arm, motions.moved(tool, up(HIGH)), CLOSED, tolerance=0.03)
