"""`expert`: a scripted policy for a task."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from jacokin.arrays import Array
from jacokin.model import checks
from jacokin.tasks.experts.arm import Arm
from jacokin.tasks.experts.lift import lift_brick, lift_large_box
from jacokin.tasks.experts.motions import Script
from jacokin.tasks.experts.place import place_brick, place_cradle
from jacokin.tasks.experts.reach import reach
from jacokin.tasks.experts.stack import stack
from jacokin.tasks.registry import FEATURES, TASKS

SCRIPTS: dict[str, Callable[[Arm], Script]] = {
    **{name: reach for name in TASKS if name.startswith("reach")},
    "lift_brick": lift_brick,
    "lift_large_box": lift_large_box,
    **{name: stack for name in TASKS if name.startswith("stack")},
    "place_brick": place_brick,
    "place_cradle": place_cradle,
}


class Expert:
    """A scripted policy; call it with an observation of features by name to get an action.

    It goes by what it has seen since `reset`, and by nothing but observations.
    """

    def __init__(self, script: Callable[[Arm], Script]) -> None:
        """Follow a script."""
        self._script = script
        self._arm = Arm()
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
        UnknownNameError: there is no expert for this task; lists those there are.
    """
    task = name.removesuffix(f"_{FEATURES}") if isinstance(name, str) else name
    return Expert(SCRIPTS[checks.choice("expert", task, SCRIPTS)])
