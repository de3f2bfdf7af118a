"""`make_vector`: the entry point of ``gymnasium.make_vec``."""

from __future__ import annotations

from typing import Any

from gymnasium.vector import AutoresetMode

from jacokin.errors import InvalidInputError
from jacokin.model import checks
from jacokin.tasks.gym.make_environment import OPTIONS
from jacokin.tasks.gym.vector import VectorTaskEnv

_WITHOUT_WINDOW = [name for name in OPTIONS if name not in ("render_mode", "width", "height")]


def make_vector(
    num_envs: int = 1,
    *,
    threads: int = 1,
    autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
    **options: Any,
) -> VectorTaskEnv:
    """Make environments of one task that are stepped together.

    Args:
        num_envs: how many.
        threads: how many threads simulate.
        autoreset_mode: when an environment whose episode has ended starts another: Gymnasium's "NextStep", "SameStep"
            or "Disabled".
        options: as for `TaskEnv`, without rendering.

    Raises:
        UnknownNameError: an unknown option or mode; lists the valid ones.
        InvalidInputError: a wrong number, or an option that vectors do not have.
    """
    if options.pop("render_mode", None) is not None:
        raise InvalidInputError("a vector of environments does not render; make a single one with the same seed")
    for name in options:
        checks.choice("option of a vector", name, ("threads", "autoreset_mode", *_WITHOUT_WINDOW))
    return VectorTaskEnv(num_envs, threads, autoreset_mode, **options)
