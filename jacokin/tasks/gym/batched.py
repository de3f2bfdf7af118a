"""Environments on MuJoCo's batches, which 4.0 has: one model, threads that run across simulations."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.util import find_spec
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.tasks.episode import STEPS
from jacokin.tasks.gym.environment import Info, TaskEnv
from jacokin.tasks.gym.packing import Observation
from jacokin.tasks.gym.vector import VectorTaskEnv
from jacokin.tasks.task import SUBSTEPS
from jacokin.tasks.view import View

_INPUTS = ("time", "qpos", "qvel", "qacc_warmstart", "ctrl", "qfrc_applied", "xfrc_applied", "mocap_pos", "mocap_quat")
_HUGE = 1e10  # where MuJoCo takes a simulation for unstable


def is_available() -> bool:
    """Whether MuJoCo has batches."""
    return find_spec("mujoco.batch") is not None


class BatchedVectorEnv(VectorTaskEnv):
    """Environments whose simulations are those of a `mujoco.batch.Batch`.

    Initial states are made in the simulation of one task, one after the other.
    """

    def __init__(self, num_envs: int, threads: int, **options: Any) -> None:
        """Make the batch; options as for `TaskEnv`."""
        from mujoco.batch import Batch

        self._first = TaskEnv(**options)
        super().__init__(self._first, num_envs)
        self._task = self._first.task
        options_of_model = self._first.model.opt
        flags = options_of_model.disableflags
        # MuJoCo would put a diverged simulation back to its reference state, and go on as if nothing had happened.
        options_of_model.disableflags = flags | int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
        self._batch = Batch(self._first.model, num_envs, threads, persistent=True)
        options_of_model.disableflags = flags
        bind = self._batch.bind
        self._inputs = {name: bind(name) for name in _INPUTS}
        matrices = bind("site_xmat")
        self._view = View(
            bind("qpos"),
            bind("qvel"),
            bind("site_xpos"),
            matrices.reshape(*matrices.shape[:2], 9),
            bind("sensordata"),
            bind("mocap_pos"),
        )
        self._goals = np.zeros((num_envs, self._task.goal_size))
        self._steps = np.zeros(num_envs, dtype=np.intp)
        self._random: list[np.random.Generator | None] = [None] * num_envs

    def _begin(self, index: int, seed: int | None, options: Mapping[str, Any] | None) -> tuple[Observation, Info]:
        first = self._first
        first._np_random = self._random[index]
        observation, info = first.reset(seed=seed, options=options)
        self._random[index] = first.np_random
        self._goals[index], self._steps[index] = first._episode.goal, 0
        data = first.data
        for name, array in self._inputs.items():
            array[index] = getattr(data, name)
        self._batch.forward(np.array([index]), int(mujoco.mjtStage.mjSTAGE_VEL))
        return observation, info

    def _advance(self, values: Array, ids: NDArray[np.intp]) -> tuple[Observation, Array, list[Info]]:
        some = None if len(ids) == self.num_envs else ids
        self._inputs["ctrl"][ids] = values[ids]
        message = self._simulate(some)
        self._steps[ids] += 1
        task, view, goals = self._task, self._view, self._goals
        achieved, desired = task.achieved(view, goals), task.desired(view, goals)
        observations = self._first._packing.pack(view, goals, achieved, desired)
        rewards = np.array(self._first._rewards(achieved, desired))
        success = task.success(achieved, desired)
        is_over = self._steps >= STEPS
        # NaN is not below the bound either.
        diverged = ~((np.abs(view.qpos).max(axis=1) < _HUGE) & (np.abs(view.qvel).max(axis=1) < _HUGE))
        infos: list[Info] = [
            {"is_success": bool(done), "is_over": bool(over)}
            for done, over in zip(success[ids], is_over[ids], strict=True)
        ]
        if diverged[ids].any():
            for info, index in zip(infos, ids.tolist(), strict=True):
                if diverged[index]:
                    rewards[index] = 0.0
                    info.update(is_success=False, is_over=True, error=message or "the simulation is unstable")
                    self._clear(observations, index)
        return observations, rewards, infos

    def _simulate(self, ids: NDArray[np.intp] | None) -> str:
        """Step; returns what MuJoCo complained of."""
        from mujoco.batch import SimulationError

        try:
            self._batch.step(ids, SUBSTEPS, int(mujoco.mjtStage.mjSTAGE_VEL))
        except SimulationError as error:
            return str(error)
        return ""

    def _clear(self, observations: Observation, index: int) -> None:
        """Zeros instead of what a diverged simulation shows."""
        for values in observations.values() if isinstance(observations, dict) else (observations,):
            values[index] = 0.0
