"""Environments on MuJoCo's batches, which 4.0 has: one model, threads that run across simulations."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib.util import find_spec
from typing import Any

import mujoco
import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.mujoco_bridge.control import queries
from jacokin.tasks.episode import STEPS
from jacokin.tasks.gym import rows
from jacokin.tasks.gym.environment import TaskEnv
from jacokin.tasks.gym.packing import Observation
from jacokin.tasks.gym.vector import Begun, Indices, Outcome, Values, VectorTaskEnv
from jacokin.tasks.randomization import MAX_LATENCY, PHYSICAL, steps_of
from jacokin.tasks.task import CONTROL_TIMESTEP, SUBSTEPS
from jacokin.tasks.view import View

_VELOCITIES = int(mujoco.mjtStage.mjSTAGE_VEL)
_HUGE = 1e10  # where MuJoCo takes a simulation for unstable
_WARNINGS = {
    mujoco.mjtWarning.mjWARN_INERTIA: "the simulation is unstable: its inertia is singular",
    mujoco.mjtWarning.mjWARN_CONTACTFULL: "not all contacts find room in MuJoCo's memory",
    mujoco.mjtWarning.mjWARN_CNSTRFULL: "not all constraints find room in MuJoCo's memory",
    mujoco.mjtWarning.mjWARN_BADQPOS: "the simulation is unstable in qpos",
    mujoco.mjtWarning.mjWARN_BADQVEL: "the simulation is unstable in qvel",
    mujoco.mjtWarning.mjWARN_BADQACC: "the simulation is unstable in qacc",
}


def is_available() -> bool:
    """Whether MuJoCo has batches."""
    return find_spec("mujoco.batch") is not None


class BatchedVectorEnv(VectorTaskEnv):
    """Environments whose simulations are those of a `mujoco.batch.Batch`; nothing is done one by one between resets.

    Initial states are made in the simulation of one environment, in turns.
    """

    def __init__(
        self, num_envs: int, threads: int, autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP, **options: Any
    ) -> None:
        """Make the batch; options as for `TaskEnv`."""
        from mujoco.batch import Batch

        first = TaskEnv(**options)
        super().__init__(first, num_envs, autoreset_mode)
        options_of_model = first.model.opt
        flags = options_of_model.disableflags
        # MuJoCo would put a diverged simulation back to its reference state, and go on as if nothing had happened.
        options_of_model.disableflags = flags | int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
        self._batch = Batch(first.model, num_envs, threads, persistent=True)
        options_of_model.disableflags = flags
        self._ctrl: Array = self._batch.bind("ctrl")
        self._view = View.of(self._batch)
        self._goals = np.zeros((num_envs, first.task.goal_size))
        self._steps = np.zeros(num_envs, dtype=np.intp)
        self._random: list[np.random.Generator | None] = [None] * num_envs
        self._drawn: list[Values] = [{}] * num_envs
        self._states: Array = np.zeros_like(self._batch.state)  # of episodes that are being started
        self._constants: dict[str, Array] = {}
        if first.randomization is not None:
            self._constants = {name: self._batch.expand(name) for name in PHYSICAL}
        delays = round(MAX_LATENCY / CONTROL_TIMESTEP) + 1 if "latency" in self._values else 0
        self._delayed = np.zeros((delays, *self._ctrl.shape))
        self._delays = np.zeros(num_envs, dtype=np.intp)

    def _begin(self, ids: Indices, seeds: Sequence[int | None], replayed: Sequence[Values | None]) -> Begun:
        numbers, waiting = ids.tolist(), set[int]()

        @contextmanager
        def switch(place: int) -> Iterator[None]:
            with self._as_first(numbers[place], is_waiting=place in waiting):
                yield
            waiting.add(place)

        runs = [self._first.resetting(seed, values) for seed, values in zip(seeds, replayed, strict=True)]
        begun = queries.run_all(runs, switch)
        batch = self._batch
        batch.reset(ids, stage=int(mujoco.mjtStage.mjSTAGE_NONE))
        batch.state[ids] = self._states[ids]
        batch.warning[ids] = 0
        if self._constants:
            batch.set_const(ids)
        batch.forward(ids, _VELOCITIES)
        self._steps[ids] = 0
        return begun

    @contextmanager
    def _as_first(self, index: int, *, is_waiting: bool) -> Iterator[None]:
        """Let the first environment be another one; `is_waiting`: one whose episode is being started."""
        first, physics = self._first, self._first.task.physics
        first._np_random = self._random[index]
        if is_waiting:
            if self._constants:
                first._apply(self._drawn[index])
            physics.set_state(self._states[index])
        try:
            yield
        finally:
            self._random[index] = first.np_random
        self._states[index] = physics.get_state()
        if first._episode.steps is not None:  # the start is complete
            self._goals[index] = first._episode.goal
        self._drawn[index], self._delays[index] = first._values, steps_of(first._values)
        for name, constants in self._constants.items():
            constants[index] = getattr(first.model, name)

    def _advance(self, values: Array, ids: Indices) -> Outcome:
        self._ctrl[ids] = self._late(values, ids) if len(self._delayed) else values[ids]
        errors = self._simulate(ids)
        self._steps[ids] += 1
        task, view, goals = self._first.task, self._view, self._goals
        achieved, desired = task.achieved(view, goals), task.desired(view, goals)
        observations = self._first._packing.pack(view, goals, achieved, desired)
        outcome = Outcome(
            observations,
            np.array(self._first._rewards(achieved, desired)),
            np.array(task.success(achieved, desired)),
            self._steps >= STEPS,
            errors,
        )
        for index in errors:
            outcome.rewards[index], outcome.is_success[index], outcome.is_over[index] = 0.0, False, True
        if "observation_noise" in self._values:
            self._add_noise(observations, [index for index in ids.tolist() if index not in errors])
        return outcome

    def _late(self, values: Array, ids: Indices) -> Array:
        """The velocities asked for some steps ago; none at first."""
        steps, delayed = self._steps[ids], self._delayed
        delayed[steps % len(delayed), ids] = values[ids]
        asked = steps - self._delays[ids]
        return np.where((asked >= 0)[:, None], delayed[asked % len(delayed), ids], 0.0)

    def _simulate(self, ids: Indices) -> dict[int, str]:
        """Step some simulations; returns why some have diverged."""
        from mujoco.batch import SimulationError

        batch, view, errors = self._batch, self._view, dict[int, str]()
        if not len(ids):
            return errors
        try:
            batch.step(None if len(ids) == self.num_envs else ids, SUBSTEPS, _VELOCITIES)
        except SimulationError as error:
            errors.update({int(index): f"MuJoCo gave up: {batch.error(int(index))}" for index in error.ids})
        # NaN is not below the bound either.
        is_well = (np.abs(view.qpos).max(axis=1) < _HUGE) & (np.abs(view.qvel).max(axis=1) < _HUGE)
        is_well &= ~batch.warning[..., 1].any(axis=1)
        for index in ids[~is_well[ids]].tolist():
            errors.setdefault(index, self._complaint(batch.warning[index, :, 1]))
        return errors

    @staticmethod
    def _complaint(counts: NDArray[np.int32]) -> str:
        found = [text for kind, text in _WARNINGS.items() if int(kind) < len(counts) and counts[int(kind)]]
        return "; ".join(found) or "the simulation is unstable"

    def _add_noise(self, observations: Observation, ids: Sequence[int]) -> None:
        for index in ids:
            random_state = self._random[index]
            assert random_state is not None
            deviation = float(self._values["observation_noise"][index])
            self._first._packing.add_noise(rows.row(observations, index), deviation, random_state)
