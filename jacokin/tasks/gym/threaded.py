"""Single environments that are stepped by threads, for what MuJoCo's batches cannot do, or are not there for."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode

from jacokin.arrays import Array
from jacokin.mujoco_bridge.control import queries
from jacokin.tasks.gym import rows
from jacokin.tasks.gym.environment import TaskEnv
from jacokin.tasks.gym.vector import Begun, Indices, Outcome, Values, VectorTaskEnv

_PARTS = 4  # into which the work of each thread is divided, as some steps take longer than others


class ThreadedVectorEnv(VectorTaskEnv):
    """Environments with a simulation each, on threads."""

    def __init__(
        self, num_envs: int, threads: int, autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP, **options: Any
    ) -> None:
        """Make the environments; options as for `TaskEnv`."""
        self._environments = [TaskEnv(**options) for _ in range(num_envs)]
        super().__init__(self._environments[0], num_envs, autoreset_mode)
        self._parts = threads * _PARTS
        self._pool = ThreadPoolExecutor(threads)

    def _begin(self, ids: Indices, seeds: Sequence[int | None], replayed: Sequence[Values | None]) -> Begun:
        environments = [self._environments[index] for index in ids]
        return queries.run_all(
            [each.resetting(*given) for each, *given in zip(environments, seeds, replayed, strict=True)]
        )

    def _advance(self, values: Array, ids: Indices) -> Outcome:
        count = self.num_envs
        outcome = Outcome(
            rows.zeros(self.single_observation_space, count),
            np.zeros(count),
            np.zeros(count, dtype=bool),
            np.zeros(count, dtype=bool),
        )

        has_camera = self._first.options.has_camera
        errors: dict[int, str] = {}

        def simulate(part: Indices) -> None:
            for index in part.tolist():
                errors[index] = self._environments[index].simulate(values[index])
                if not has_camera:
                    note(index)

        def note(index: int) -> None:
            observation, reward, _, is_over, info = self._environments[index].after_simulation(errors[index])
            rows.put(outcome.observations, index, observation)
            outcome.rewards[index], outcome.is_over[index] = reward, is_over
            outcome.is_success[index] = info["is_success"]
            if "error" in info:
                outcome.errors[index] = info["error"]

        list(self._pool.map(simulate, np.array_split(ids, self._parts)))
        for index in ids.tolist() if has_camera else ():  # OpenGL is bound to the thread that pictures are taken in
            note(index)
        return outcome

    def close_extras(self, **kwargs: Any) -> None:
        """End the threads."""
        self._pool.shutdown()
        for environment in self._environments:
            environment.close()
