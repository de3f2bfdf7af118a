"""`expert`: a scripted policy for a task, and the scripts that reach and lift."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
import pinocchio as pin

from jacokin.arrays import Array
from jacokin.model import checks
from jacokin.tasks.experts import grasps
from jacokin.tasks.experts.driver import BRICK, CLOSE, OPEN, SQUEEZE, ArmDriver, Script, shift, up
from jacokin.tasks.experts.grasps import point_down
from jacokin.tasks.experts.place import IN_CRADLE, ON_BRICK, place
from jacokin.tasks.experts.stack import stack
from jacokin.tasks.registry import FEATURES, TASKS

DOWN = point_down(np.array((0.0, 1.0, 0.0)))
_ABOVE = 0.036  # [m] the middle of a brick: near enough, and the fingers do not push it away
HEIGHT = 0.33  # [m] by which things are lifted
BOX = "unnamed_model/"  # prefix of the observations of the large box
HALF_BOX = 0.09  # [m]
OVER_BOX, AROUND_BOX = 0.1, -0.02  # [m] of the pinch site above the top of the box
BOX_STEPS = 30  # until the fingers are as closed as the box lets them be


def reach(arm: ArmDriver) -> Script:
    """Bring the pinch site to the target, in its present orientation where that is possible."""
    seen = arm.find("target_position")
    while True:
        position = arm.get(seen[0], 3) if seen else arm.get(f"{BRICK}position", 3) + up(_ABOVE)
        for rotation in (arm.pose.rotation, DOWN):
            found = arm.configurations(pin.SE3(rotation, position))
            if len(found):
                break
        yield arm.towards(found[0] if len(found) else arm.q, 0.0)


def lift_brick(arm: ArmDriver) -> Script:
    """Grasp a brick and lift it; again if it falls."""
    while True:
        grasp = grasps.plan(arm, arm.prop(BRICK), [up(HEIGHT)]) or grasps.plan(arm, arm.prop(BRICK))
        if grasp is None:
            yield from arm.stay(0.0)
            return
        yield from grasps.take(arm, grasp)
        yield from arm.move(shift(grasp.pose, up(HEIGHT)), SQUEEZE)
        q = arm.q.copy()
        while grasps.holds(arm, arm.prop(BRICK)):
            yield arm.towards(q, CLOSE)


def lift_large_box(arm: ArmDriver) -> Script:
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
            tool = point_down(sign * across)
            at = pin.SE3(tool, edge + up(HALF_BOX + AROUND_BOX) - tool @ grasps.CENTRE)
            for q in arm.configurations(shift(at, up(OVER_BOX)))[:4]:
                if arm.chain([at], q, 2.0) is not None:
                    value = arm.duration(arm.q, q)
                    if value < cost:
                        best, cost = (q, at), value
    if best is not None:
        yield from arm.go(best[0], OPEN, tolerance=0.05)
        yield from arm.move(best[1], 0.4)
        yield from arm.close(BOX_STEPS)
        yield from arm.move(shift(best[1], up(HEIGHT)), SQUEEZE, speed=0.1)
    yield from arm.stay(CLOSE)


SCRIPTS: dict[str, Callable[[ArmDriver], Script]] = {
    **{name: reach for name in TASKS if name.startswith("reach")},
    "lift_brick": lift_brick,
    "lift_large_box": lift_large_box,
    **{name: stack for name in TASKS if name.startswith("stack")},
    "place_brick": partial(place, rest=ON_BRICK),
    "place_cradle": partial(place, rest=IN_CRADLE),
}


class Expert:
    """A scripted policy; call it with an observation of features by name to get an action.

    It goes by what it has seen since `reset`, and by nothing but observations.
    """

    def __init__(self, script: Callable[[ArmDriver], Script]) -> None:
        """Follow a script."""
        self._script = script
        self._arm = ArmDriver()
        self._actions: Script | None = None

    def reset(self) -> None:
        """Begin anew, at the start of an episode."""
        self._actions = None

    def __call__(self, observation: object) -> Array:
        """The action (9,) for an observation [rad/s].

        Args:
            observation: the features by name, with or without the leading axis of dm_control's buffers.

        Raises:
            InvalidInputError: something else.
        """
        self._arm.observe(observation)
        if self._actions is None:
            self._actions = self._script(self._arm)
        return np.asarray(next(self._actions))


def expert(name: str) -> Expert:
    """A scripted policy for a task, which uses nothing but observations, the solver and the robot.

    Args:
        name: of the task or its environment, such as "lift_brick" or "lift_brick_features".

    Raises:
        UnknownNameError: there is no expert for this task; lists the experts.
    """
    task = name.removesuffix(f"_{FEATURES}") if isinstance(name, str) else name
    return Expert(SCRIPTS[checks.choice("expert", task, SCRIPTS)])
