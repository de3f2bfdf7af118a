"""Makes the tasks known to Gymnasium."""

from __future__ import annotations

import gymnasium

from jacokin.tasks.ids import IDS


def register() -> None:
    """Make the tasks known to ``gymnasium.make``; again has no effect."""
    for task, name in IDS.items():
        if name not in gymnasium.registry:
            gymnasium.register(
                name,
                entry_point="jacokin.tasks.gym.environment:TaskEnv",
                vector_entry_point="jacokin.tasks.gym.make_vector:make_vector",
                kwargs={"task": task},
            )
