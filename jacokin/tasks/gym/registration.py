"""The ids of the Gymnasium environments."""

from __future__ import annotations

import gymnasium

from jacokin.tasks.registry import TASKS

NAMESPACE, VERSION = "jacokin", "v0"


def id_of(task: str) -> str:
    """The id of the environment of a task, such as "jacokin/ReachSite-v0"."""
    return f"{NAMESPACE}/{TASKS[task].id}-{VERSION}"


def register() -> None:
    """Make the tasks known to ``gymnasium.make``; again has no effect."""
    for task in TASKS:
        if id_of(task) not in gymnasium.registry:
            gymnasium.register(id_of(task), entry_point="jacokin.tasks.gym.environment:TaskEnv", kwargs={"task": task})
