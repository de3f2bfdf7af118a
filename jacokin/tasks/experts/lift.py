"""Lifting: take a thing and raise it."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from jacokin.tasks.experts import grasps, motions
from jacokin.tasks.experts.arm import CLOSE, OPEN, Arm
from jacokin.tasks.experts.motions import BRICK, SQUEEZE, Script, up

HEIGHT = 0.33  # [m]
BOX = "unnamed_model/"
HALF_BOX = 0.09  # [m]
OVER_BOX, AROUND_BOX = 0.1, -0.02  # [m] of the pinch site above the top of the box
BOX_STEPS = 30  # until the fingers are as closed as the box lets them be


def lift_brick(arm: Arm) -> Script:
    """Grasp a brick and lift it; again if it falls."""
    while True:
        grasp = grasps.plan(arm, arm.prop(BRICK), [up(HEIGHT)]) or grasps.plan(arm, arm.prop(BRICK))
        if grasp is None:
            yield from motions.stay(arm, 0.0)
            return
        yield from grasps.take(arm, grasp)
        yield from motions.move(arm, motions.moved(grasp.pose, up(HEIGHT)), SQUEEZE)
        q = arm.q.copy()
        while grasps.holds(arm, arm.prop(BRICK)):
            yield arm.towards(q, CLOSE)


def lift_large_box(arm: Arm) -> Script:
    """Try to lift the large box by one of its edges.

    The open hand is 0.17 m wide and the box 0.18 m, so no two opposite sides can be pinched. What can be is an upright
    edge, the thumb on one side and two fingers on the other. That needs friction of more than 1, and there is 1: the
    script is a try, and the record of the experts has what comes of it.
    """
    box = arm.prop(BOX)
    best, cost = None, np.inf
    for corner in np.pi * np.array((0.25, 0.75, 1.25, 1.75)):
        outwards = box.rotation @ np.array((np.cos(corner), np.sin(corner), 0.0))
        across = np.array((-outwards[1], outwards[0], 0.0))
        edge = box.translation + (np.sqrt(2.0) * HALF_BOX - 0.03) * outwards
        for sign in (1.0, -1.0):
            tool = grasps.pointing(sign * across)
            at = pin.SE3(tool, edge + up(HALF_BOX + AROUND_BOX) - tool @ grasps.CENTRE)
            for q in arm.configurations(motions.moved(at, up(OVER_BOX)))[:4]:
                if arm.chain([at], q, 2.0) is not None:
                    value = arm.duration(arm.q, q)
                    if value < cost:
                        best, cost = (q, at), value
    if best is not None:
        yield from motions.go(arm, best[0], OPEN, tolerance=0.05)
        yield from motions.move(arm, best[1], 0.4)
        yield from motions.close(arm, BOX_STEPS)
        yield from motions.move(arm, motions.moved(best[1], up(HEIGHT)), SQUEEZE, speed=0.1)
    yield from motions.stay(arm, CLOSE)
