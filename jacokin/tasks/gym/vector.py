"""Many environments of one task in one process: resets, infos and checks. `simulations` has what moves them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, PhysicsError
from jacokin.model import checks
from jacokin.tasks.episode import bounded
from jacokin.tasks.gym import packing
from jacokin.tasks.gym.environment import OPTIONS, Info, TaskEnv
from jacokin.tasks.gym.packing import Observation
from jacokin.tasks.gym.simulations import Begun, Flags, Indices, Outcome, Simulations

Steps = tuple[Observation, Array, Flags, Flags, Info]

AUTORESET_MODES = tuple(mode.value for mode in AutoresetMode)


class VectorTaskEnv(VectorEnv[Observation, Any, NDArray[Any]]):
    """Environments that are stepped together, and reset as one of Gymnasium's `AutoresetMode` says.

    Environment i equals a single one that was reset with the same seed, bit for bit on one version of MuJoCo.
    """

    def __init__(
        self, num_envs: int, threads: int, autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP, **options: Any
    ) -> None:
        """Make the environments.

        Args:
            num_envs: how many.
            threads: how many threads simulate.
            autoreset_mode: when an environment whose episode has ended is reset.
            options: as for `TaskEnv`.

        Raises:
            UnknownNameError: no such mode.
        """
        checks.whole_number("num_envs", num_envs, 1)
        checks.whole_number("threads", threads, 1)
        value = autoreset_mode.value if isinstance(autoreset_mode, AutoresetMode) else autoreset_mode
        self.autoreset_mode = AutoresetMode(checks.choice("autoreset_mode", value, AUTORESET_MODES))
        first = self._first = TaskEnv(**options)
        self._simulations = Simulations(first, num_envs, threads)
        self.metadata = {**first.metadata, "autoreset_mode": self.autoreset_mode, "render_modes": []}
        self.num_envs = num_envs
        self.single_observation_space = first.observation_space
        self.single_action_space = first.action_space
        self.observation_space = batch_space(first.observation_space, num_envs)
        self.action_space = batch_space(first.action_space, num_envs)
        self._bounds = tuple(np.broadcast_to(bound, (num_envs, *bound.shape)) for bound in first._control.bounds)
        names = [] if first.randomization is None else first.randomization.names
        self._values = {name: np.zeros(num_envs) for name in names}
        self._is_over = np.zeros(num_envs, dtype=bool)
        self._has_begun = np.zeros(num_envs, dtype=bool)
        self._last = packing.zeros(first.observation_space, num_envs)

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: Mapping[str, Any] | None = None,
    ) -> tuple[Observation, Info]:
        """Start an episode in every environment, or in some.

        Args:
            seed: of the first environment, the others get the following numbers; or one for each.
            options: "reset_mask", which to reset, (num_envs,) bool; "randomization", the values of earlier episodes as
                `infos` had them.

        Raises:
            InvalidInputError: wrong seeds or options; nothing is changed.
        """
        if not isinstance(options, Mapping | None):
            raise InvalidInputError(f"options must be a dict or None, got {checks.shown(options)}")
        given = dict(options or {})
        ids = np.flatnonzero(self._mask(given.pop("reset_mask", True)))
        all_seeds, each = self._seeds(seed), self._each(given)
        seeds = [all_seeds[index] for index in ids]
        replayed = [self._first._checked_reset(all_seeds[index], each[index]) for index in ids]
        infos = self._started(ids, self._simulations.begin(ids, seeds, replayed), self._last, {})
        self._is_over[ids] = False
        self._has_begun[ids] = True
        return packing.copied(self._last), infos

    def step(self, values: NDArray[Any]) -> Steps:
        """Apply an action in every environment.

        By default those whose episode has ended start another one instead.

        Args:
            values: (num_envs, ...) actions.

        Raises:
            InvalidInputError: wrong shape, not numbers, or NaN; nothing is simulated.
            PhysicsError: an environment has no episode: call `reset`.
        """
        if not self._has_begun.all():
            raise PhysicsError("there is no episode: call reset() before step()")
        checked = bounded(values, *self._bounds)
        self._first._control.check(checked)
        ended, goes_on = np.flatnonzero(self._is_over), np.flatnonzero(~self._is_over)
        if len(ended) and self.autoreset_mode is AutoresetMode.DISABLED:
            raise PhysicsError(
                f"the episodes of environments {ended.tolist()} have ended: call reset(options={{'reset_mask': ...}})"
            )
        begun = self._begin_again(ended)
        outcome = self._simulations.advance(checked, goes_on)
        observations, truncated = outcome.observations, outcome.is_over
        for index in outcome.errors:
            packing.put(observations, index, packing.row(self._last, index))
        outcome.rewards[ended], truncated[ended] = 0.0, False
        if self.autoreset_mode is AutoresetMode.SAME_STEP:
            infos = self._started_over(np.flatnonzero(truncated), outcome)
        else:
            infos = self._started(ended, begun, observations, self._infos(outcome, goes_on))
            self._is_over = truncated.copy()
        self._last = packing.copied(observations)
        return observations, outcome.rewards, np.zeros(self.num_envs, dtype=bool), truncated, infos

    def _begin_again(self, ids: Indices) -> Begun:
        """Start further episodes."""
        return self._simulations.begin(ids, [None] * len(ids), [None] * len(ids)) if len(ids) else []

    def _started(self, ids: Indices, begun: Begun, observations: Observation, infos: Info) -> Info:
        """Note what the starts of episodes gave, among the observations and infos of all."""
        for index, (observation, info) in zip(ids.tolist(), begun, strict=True):
            packing.put(observations, index, observation)
            infos = self._add_info(infos, info, index)
            for name, value in info.get("randomization", {}).items():
                self._values[name][index] = value
        return infos

    def _started_over(self, ended: Indices, outcome: Outcome) -> Info:
        """Start other episodes in the same step; the infos have the last observations and infos of those that ended."""
        infos = self._infos(outcome, np.flatnonzero(~outcome.is_over))
        for index in ended.tolist():
            last: Info = {"is_success": bool(outcome.is_success[index])}
            if self._values:
                last["randomization"] = {name: float(column[index]) for name, column in self._values.items()}
            if index in outcome.errors:
                last["error"] = outcome.errors[index]
            observation = packing.copied(packing.row(outcome.observations, index))
            infos = self._add_info(infos, {"final_obs": observation, "final_info": last}, index)
        return self._started(ended, self._begin_again(ended), outcome.observations, infos)

    def _infos(self, outcome: Outcome, ids: Indices) -> Info:
        """The infos of steps of some environments, as `VectorEnv._add_info` would put them together one by one."""
        found: Info = {}
        if not len(ids):
            return found
        is_there = np.zeros(self.num_envs, dtype=bool)
        is_there[ids] = True
        found.update(is_success=outcome.is_success & is_there, _is_success=is_there)
        if self._values:
            columns: Info = {}
            for name, column in self._values.items():
                columns.update({name: np.where(is_there, column, 0.0), f"_{name}": is_there.copy()})
            found.update(randomization=columns, _randomization=is_there.copy())
        for index in ids[np.isin(ids, list(outcome.errors))].tolist() if outcome.errors else ():
            found = self._add_info(found, {"error": outcome.errors[index]}, index)
        return found

    def close_extras(self, **kwargs: Any) -> None:
        """Free what pictures need."""
        if hasattr(self, "_simulations"):  # Gymnasium also closes what its options kept from being made
            self._simulations.close()

    def _mask(self, value: object) -> Flags:
        if value is True:
            return np.ones(self.num_envs, dtype=bool)
        if not isinstance(value, np.ndarray) or value.dtype != bool or value.shape != (self.num_envs,):
            raise InvalidInputError(f"reset_mask must be a bool array ({self.num_envs},), got {checks.shown(value)}")
        return value

    def _seeds(self, seed: int | Sequence[int | None] | None) -> list[int | None]:
        if seed is None:
            return [None] * self.num_envs
        if isinstance(seed, int | np.integer) and not isinstance(seed, bool):
            return [int(seed) + index for index in range(self.num_envs)]
        if not isinstance(seed, Sequence | np.ndarray) or isinstance(seed, str) or len(seed) != self.num_envs:
            raise InvalidInputError(f"seed must be one number, or {self.num_envs}, got {checks.shown(seed)}")
        return list(seed)

    def _each(self, options: Mapping[str, Any]) -> list[dict[str, Any]]:
        """The options of each environment: their values of the randomization are rows of columns."""
        if not isinstance(options.get("randomization"), Mapping):
            return [dict(options)] * self.num_envs
        columns = {name: value for name, value in options["randomization"].items() if not str(name).startswith("_")}
        for name, column in columns.items():
            if np.shape(column) != (self.num_envs,):
                raise InvalidInputError(f"{name} must have shape ({self.num_envs},), got {checks.shown(column)}")
        return [
            {**options, "randomization": {name: column[index] for name, column in columns.items()}}
            for index in range(self.num_envs)
        ]


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
