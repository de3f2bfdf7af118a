"""Many environments of one task in one process: reset one by one, stepped together."""

from __future__ import annotations

import abc
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, ClassVar, cast

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space, concatenate, create_empty_array
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.tasks import actions
from jacokin.tasks.gym.environment import Info, TaskEnv
from jacokin.tasks.gym.packing import Observation

Flags = NDArray[np.bool_]
Steps = tuple[Observation, Array, Flags, Flags, Info]


class VectorTaskEnv(VectorEnv[Observation, Any, NDArray[Any]]):
    """Environments that begin a new episode in the step after the one that ends theirs, as Gymnasium's default is.

    Environment i equals a single one that was reset with the same seed, bit for bit on one version of MuJoCo.
    """

    metadata: ClassVar[dict[str, Any]] = {  # type: ignore[misc]  # an attribute of instances for Gymnasium
        "autoreset_mode": AutoresetMode.NEXT_STEP,
        "render_modes": [],
    }

    def __init__(self, first: TaskEnv, num_envs: int) -> None:
        """Take the spaces of an environment."""
        self.num_envs = num_envs
        self.single_observation_space = first.observation_space
        self.single_action_space = first.action_space
        self.observation_space = batch_space(first.observation_space, num_envs)
        self.action_space = batch_space(first.action_space, num_envs)
        self._bounds = tuple(np.broadcast_to(bound, (num_envs, *bound.shape)) for bound in first._control.bounds)
        self._is_over = np.zeros(num_envs, dtype=bool)
        self._has_begun = False

    @abc.abstractmethod
    def _begin(self, index: int, seed: int | None, options: Mapping[str, Any] | None) -> tuple[Observation, Info]:
        """Start an episode in one environment."""

    @abc.abstractmethod
    def _advance(
        self, values: Array, ids: NDArray[np.intp]
    ) -> tuple[list[Observation] | Observation, Array, list[Info]]:
        """Step some environments; returns observations of all, rewards of all, and the infos of the stepped."""

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: Mapping[str, Any] | None = None,
    ) -> tuple[Observation, Info]:
        """Start an episode in every environment.

        Args:
            seed: of the first environment, the others get the following numbers; or one for each.
            options: as for `TaskEnv.reset`.

        Raises:
            InvalidInputError: wrong seeds or options.
        """
        found = [self._begin(index, each, options) for index, each in enumerate(self._seeds(seed))]
        self._is_over[:] = False
        self._has_begun = True
        infos = self._infos(dict(enumerate(info for _, info in found)))
        return self._stacked([observation for observation, _ in found]), infos

    def step(self, values: NDArray[Any]) -> Steps:
        """Apply an action in every environment; those whose episode has ended start another instead.

        Args:
            values: (num_envs, ...) actions.

        Raises:
            InvalidInputError: wrong shape, not numbers, or NaN; nothing is simulated.
        """
        if not self._has_begun:
            raise InvalidInputError("call reset() before step()")
        checked = actions.bounded(values, *self._bounds)
        begins = np.flatnonzero(self._is_over)
        goes_on = np.flatnonzero(~self._is_over)
        observations, rewards, infos = self._advance(checked, goes_on)
        truncated = np.zeros(self.num_envs, dtype=bool)
        by_index = dict(zip(goes_on.tolist(), infos, strict=True))
        for going in goes_on.tolist():
            truncated[going] = by_index[going].pop("is_over")
        for index in begins.tolist():
            observation, by_index[index] = self._begin(index, None, None)
            _put(observations, index, observation)
            rewards[index] = 0.0
        self._is_over = truncated.copy()
        stacked = self._stacked(observations) if isinstance(observations, list) else observations
        return stacked, rewards, np.zeros(self.num_envs, dtype=bool), truncated, self._infos(by_index)

    def _seeds(self, seed: int | Sequence[int | None] | None) -> list[int | None]:
        if seed is None:
            return [None] * self.num_envs
        if isinstance(seed, int | np.integer):
            return [int(seed) + index for index in range(self.num_envs)]
        seeds = list(seed)
        if len(seeds) != self.num_envs:
            raise InvalidInputError(f"seed must be one number, or {self.num_envs}, got {len(seeds)}")
        return seeds

    def _stacked(self, observations: list[Observation]) -> Observation:
        space = self.single_observation_space
        empty: Any = create_empty_array(space, self.num_envs)
        found: Any = concatenate(space, observations, empty)
        return cast(Observation, found)

    def _infos(self, infos: Mapping[int, Info]) -> Info:
        found: Info = {}
        for index in sorted(infos):
            found = self._add_info(found, infos[index], index)
        return found


class ThreadedVectorEnv(VectorTaskEnv):
    """Single environments, stepped by threads."""

    def __init__(self, num_envs: int, threads: int, **options: Any) -> None:
        """Make the environments; options as for `TaskEnv`."""
        self._environments = [TaskEnv(**options) for _ in range(num_envs)]
        self._pool = ThreadPoolExecutor(threads)
        super().__init__(self._environments[0], num_envs)
        self._last: list[Observation] = []

    def _begin(self, index: int, seed: int | None, options: Mapping[str, Any] | None) -> tuple[Observation, Info]:
        observation, info = self._environments[index].reset(seed=seed, options=options)
        self._last[index : index + 1] = [observation]
        return observation, info

    def _advance(self, values: Array, ids: NDArray[np.intp]) -> tuple[list[Observation], Array, list[Info]]:
        rewards, infos = np.zeros(self.num_envs), []
        results = self._pool.map(lambda index: self._environments[index].step(values[index]), ids.tolist())
        for index, (observation, reward, _, truncated, info) in zip(ids.tolist(), results, strict=True):
            self._last[index], rewards[index] = observation, reward
            infos.append({**info, "is_over": truncated})
        return list(self._last), rewards, infos

    def close_extras(self, **kwargs: Any) -> None:
        """End the threads."""
        self._pool.shutdown()
        for environment in self._environments:
            environment.close()


def _put(observations: list[Observation] | Observation, index: int, observation: Observation) -> None:
    """Write the observation of one environment among those of all."""
    if isinstance(observations, dict) and isinstance(observation, dict):
        for name, value in observation.items():
            observations[name][index] = value
    else:
        observations[index] = observation  # type: ignore[index, assignment]  # a list or an array
