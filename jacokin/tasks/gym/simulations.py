"""The simulations of many environments: those of a `mujoco.batch.Batch`, whose threads run across them.

A step is done for all at once: actions, physics, observations and rewards are arrays with a row for each environment.
Only controls of the tool, noise and pictures are computed one by one. Episodes start in the simulation of a single
environment, in turns.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import mujoco
import numpy as np
from mujoco.batch import Batch, SimulationError
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.mujoco_bridge.control import queries
from jacokin.tasks.episode import PICTURE, STEPS
from jacokin.tasks.features import View
from jacokin.tasks.gym import packing
from jacokin.tasks.gym.controls import CONTROLS
from jacokin.tasks.gym.environment import Info, TaskEnv
from jacokin.tasks.gym.packing import Observation, with_picture
from jacokin.tasks.randomization import MAX_LATENCY, SIMULATED, steps_of
from jacokin.tasks.task import CONTROL_TIMESTEP, SUBSTEPS

Flags = NDArray[np.bool_]
Indices = NDArray[np.intp]
Values = dict[str, float]  # of a randomization
Begun = list[tuple[Observation, Info]]

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


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """What a step gave.

    Attributes:
        observations: of all environments, in new arrays.
        rewards: (n,).
        is_success: (n,).
        is_over: (n,) whether the episode has ended.
        errors: why simulations diverged, by the number of the environment; its observation does not count.
    """

    observations: Observation
    rewards: Array
    is_success: Flags
    is_over: Flags
    errors: dict[int, str]


class Simulations:
    """Simulations of the task of an environment, each with its own random numbers and constants of the model."""

    def __init__(self, first: TaskEnv, count: int, threads: int) -> None:
        """Make the batch.

        Args:
            first: the environment in which episodes are started; it is of no other use then.
            count: how many simulations.
            threads: how many threads simulate.
        """
        self._first, self._count = first, count
        model, control = first.model, first.options.control
        flags = model.opt.disableflags
        # MuJoCo would put a diverged simulation back to its reference state, and go on as if nothing had happened.
        model.opt.disableflags = flags | int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
        self._batch = Batch(model, count, threads, persistent=True)
        model.opt.disableflags = flags
        self._ctrl: Array = self._batch.bind("ctrl")
        self._view = View.of(self._batch)
        self._goals = np.zeros((count, first.task.goal_size))
        self._steps = np.zeros(count, dtype=np.intp)
        self._random: list[np.random.Generator | None] = [None] * count
        self._values: list[Values] = [{}] * count
        self._states: Array = np.zeros_like(self._batch.state)  # of episodes that are being started
        self._controls = [CONTROLS[control](first._episode.lower, first._episode.upper) for _ in range(count)]
        self._rows = [] if control == "joint_velocity" else [self._view.row(index) for index in range(count)]
        names = () if first.randomization is None else first.randomization.names
        self._constants: dict[str, Array] = {name: self._batch.expand(name) for name in SIMULATED if names}
        self._is_noisy = "observation_noise" in names
        delays = round(MAX_LATENCY / CONTROL_TIMESTEP) + 1 if "latency" in names else 0
        self._delayed = np.zeros((delays, *self._ctrl.shape))
        self._delays = np.zeros(count, dtype=np.intp)
        self._pictured = mujoco.MjData(model) if first.options.has_camera else None

    def begin(self, ids: Indices, seeds: Sequence[int | None], replayed: Sequence[Values | None]) -> Begun:
        """Start episodes in some environments, with checked arguments; see `TaskEnv._resetting`.

        Raises:
            EpisodeInitializationError: no initial state was found for one of them.
        """
        numbers, waiting = ids.tolist(), set[int]()

        @contextmanager
        def switch(place: int) -> Iterator[None]:
            with self._as_first(numbers[place], is_waiting=place in waiting):
                yield
            waiting.add(place)

        runs = [self._first._resetting(seed, values) for seed, values in zip(seeds, replayed, strict=True)]
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
        first._np_random, first._control = self._random[index], self._controls[index]
        if is_waiting:
            if self._constants:
                first._apply(self._values[index])
            physics.set_state(self._states[index])
        try:
            yield
        finally:
            self._random[index] = first.np_random
        self._states[index] = physics.get_state()
        self._values[index], self._delays[index] = first._values, steps_of(first._values)
        for name, constants in self._constants.items():
            constants[index] = getattr(first.model, name)
        if first._episode.steps is not None:  # the start is complete
            self._goals[index] = first._episode.goal

    def advance(self, actions: Array, ids: Indices) -> Outcome:
        """Step some environments; what the outcome says of others does not count.

        Args:
            actions: (n, ...) checked actions of all.
            ids: which to step.
        """
        first, view, goals = self._first, self._view, self._goals
        errors = self._simulate(actions, ids) if len(ids) else {}
        self._steps[ids] += 1
        achieved, desired = first.task.achieved(view, goals), first.task.desired(view, goals)
        observations = first._packing.pack(view, goals, achieved, desired)
        going = [index for index in ids.tolist() if index not in errors]
        if self._pictured is not None:
            observations = with_picture(observations, self._pictures(going))
        for index in going if self._is_noisy else ():
            random_state = self._random[index]
            assert random_state is not None
            deviation = self._values[index]["observation_noise"]
            first._packing.add_noise(packing.row(observations, index), deviation, random_state)
        outcome = Outcome(
            observations,
            np.array(first._rewards(achieved, desired)),
            np.array(first.task.success(achieved, desired)),
            self._steps >= STEPS,
            errors,
        )
        for index in errors:
            outcome.rewards[index], outcome.is_success[index], outcome.is_over[index] = 0.0, False, True
        return outcome

    def _simulate(self, actions: Array, ids: Indices) -> dict[int, str]:
        """Simulate a control step; returns why some simulations have diverged."""
        batch, view, errors = self._batch, self._view, dict[int, str]()
        velocities = actions[ids]
        if self._rows:
            velocities = np.array([self._controls[i].velocities(self._rows[i], actions[i]) for i in ids.tolist()])
        self._ctrl[ids] = self._late(velocities, ids) if len(self._delayed) else velocities
        try:
            batch.step(None if len(ids) == self._count else ids, SUBSTEPS, _VELOCITIES)
        except SimulationError as error:
            errors.update({int(index): f"MuJoCo gave up: {batch.error(int(index))}" for index in error.ids})
        # NaN is not below the bound either.
        is_well = (np.abs(view.qpos).max(axis=1) < _HUGE) & (np.abs(view.qvel).max(axis=1) < _HUGE)
        is_well &= ~batch.warning[..., 1].any(axis=1)
        for index in ids[~is_well[ids]].tolist():
            counts = batch.warning[index, :, 1]
            found = [text for kind, text in _WARNINGS.items() if int(kind) < len(counts) and counts[int(kind)]]
            errors.setdefault(index, "; ".join(found) or "the simulation is unstable")
        return errors

    def _late(self, velocities: Array, ids: Indices) -> Array:
        """The velocities asked for some steps ago; none at first."""
        steps, delayed = self._steps[ids], self._delayed
        delayed[steps % len(delayed), ids] = velocities
        asked = steps - self._delays[ids]
        return np.where((asked >= 0)[:, None], delayed[asked % len(delayed), ids], 0.0)

    def _pictures(self, ids: Sequence[int]) -> NDArray[np.generic]:
        """What the cameras of some environments see; black elsewhere."""
        found = np.zeros((self._count, PICTURE, PICTURE, 3), dtype=np.uint8)
        for index in ids:
            if self._constants:
                self._first._apply(self._values[index])
            self._first.task.show_goal(self._goals[index])
            self._batch.get_data(index, self._pictured)
            found[index] = self._first._episode.picture(data=self._pictured)
        return found

    def close(self) -> None:
        """Free what pictures need."""
        self._first.close()
