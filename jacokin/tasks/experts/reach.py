"""Reaching: bring the pinch site to a site or to a brick."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from jacokin.tasks.experts.arm import Arm
from jacokin.tasks.experts.grasps import pointing
from jacokin.tasks.experts.motions import BRICK, Script, up

DOWN = pointing(np.array((0.0, 1.0, 0.0)))
_ABOVE = 0.036  # [m] the middle of a brick: near enough, and the fingers do not push it away


def reach(arm: Arm) -> Script:
    """Bring the pinch site to the target, in its present orientation where that is possible."""
    seen = arm.find("target_position")
    while True:
        position = arm.get(seen[0], 3) if seen else arm.get(f"{BRICK}position", 3) + up(_ABOVE)
        for rotation in (arm.pose.rotation, DOWN):
            found = arm.configurations(pin.SE3(rotation, position))
            if len(found):
                break
        yield arm.towards(found[0] if len(found) else arm.q, 0.0)
