"""Tasks for the arm and the hand: reach, lift, place, stack.

    env = jacokin.tasks.load("reach_site_features", seed=0)  # dm_env
    timestep = env.reset()

    gymnasium.register_envs(jacokin.tasks)
    env = gymnasium.make("jacokin/ReachSite-v0")

Importing this package registers the ids, if Gymnasium is installed: `register_envs` does nothing but keep the import.

Everything public is imported from here. Read `families/reach` first, then `task`, `episode` and `environment`.
"""

from __future__ import annotations

import importlib
import importlib.util
from typing import TYPE_CHECKING

from jacokin import lazy

if TYPE_CHECKING:
    from jacokin.tasks.environment import Environment as Environment
    from jacokin.tasks.environment import load as load
    from jacokin.tasks.experts.expert import Expert as Expert
    from jacokin.tasks.experts.expert import expert as expert
    from jacokin.tasks.gym.environment import TaskEnv as TaskEnv
    from jacokin.tasks.randomization import Randomization as Randomization
    from jacokin.tasks.registry import names as names
    from jacokin.tasks.task import Task as Task

__all__, __getattr__, __dir__ = lazy.door(
    __name__,
    {
        "jacokin.tasks.environment": ("Environment", "load"),
        "jacokin.tasks.experts.expert": ("Expert", "expert"),
        "jacokin.tasks.gym.environment": ("TaskEnv",),
        "jacokin.tasks.randomization": ("Randomization",),
        "jacokin.tasks.registry": ("names",),
        "jacokin.tasks.task": ("Task",),
    },
)

if importlib.util.find_spec("gymnasium") is not None:
    importlib.import_module("jacokin.tasks.gym.registration").register()
