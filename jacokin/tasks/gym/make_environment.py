"""`make_environment`: the entry point of ``gymnasium.make``."""

from __future__ import annotations

import inspect
from typing import Any

from jacokin.model import checks
from jacokin.tasks.gym.environment import TaskEnv

OPTIONS = tuple(inspect.signature(TaskEnv).parameters)


def make_environment(**options: Any) -> TaskEnv:
    """Make an environment.

    Args:
        options: as for `TaskEnv`.

    Raises:
        UnknownNameError: an unknown option; lists the valid ones.
    """
    for name in options:
        checks.choice("option", name, OPTIONS)
    return TaskEnv(**options)


make_environment.metadata = TaskEnv.metadata  # type: ignore[attr-defined]  # Gymnasium looks here for render modes
