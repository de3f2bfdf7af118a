"""Tasks for the arm and the hand: reach, lift, place, stack.

    env = jacokin.tasks.load("reach_site_features", seed=0)
    timestep = env.reset()

Everything public is imported from here. Read `families/reach` first, then `task`, `episode` and `environment`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from jacokin import lazy

if TYPE_CHECKING:
    from jacokin.tasks.environment import Environment as Environment
    from jacokin.tasks.environment import load as load
    from jacokin.tasks.registry import names as names
    from jacokin.tasks.task import Task as Task

__all__, __getattr__, __dir__ = lazy.door(
    __name__,
    {
        "jacokin.tasks.environment": ("Environment", "load"),
        "jacokin.tasks.registry": ("names",),
        "jacokin.tasks.task": ("Task",),
    },
)
