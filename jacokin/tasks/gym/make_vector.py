"""`make_vector`: the entry point of ``gymnasium.make_vec``."""

from __future__ import annotations

from typing import Any

import gymnasium

from jacokin.errors import InvalidInputError
from jacokin.model import checks
from jacokin.tasks.gym import batched
from jacokin.tasks.gym.vector import ThreadedVectorEnv


def make_vector(num_envs: int = 1, *, threads: int = 1, **options: Any) -> gymnasium.vector.VectorEnv[Any, Any, Any]:
    """Make environments of one task that are stepped together.

    Args:
        num_envs: how many.
        threads: how many threads simulate.
        options: as for `TaskEnv`, without rendering.

    Raises:
        InvalidInputError: a wrong number, or an option that vectors do not have.
    """
    checks.whole_number("num_envs", num_envs, 1)
    checks.whole_number("threads", threads, 1)
    if options.pop("render_mode", None) is not None:
        raise InvalidInputError("a vector of environments does not render; make a single one with the same seed")
    plain = options.get("control", "joint_velocity") == "joint_velocity" and options.get("randomization") is None
    if plain and options.get("observations", "features") == "features" and batched.is_available():
        return batched.BatchedVectorEnv(num_envs, threads, **options)
    return ThreadedVectorEnv(num_envs, threads, **options)
