"""`VectorTaskEnv`: many environments of one task in one process.

It has Gymnasium's side: checks, resets and infos. `Simulations` has what moves them, a
`mujoco.batch.Batch`, whose threads run across environments. A step is done for all at once: actions, physics,
observations and rewards are arrays with a row for each environment. Only controls of the tool, noise and pictures are
computed one by one. Episodes start in the simulation of a single environment, in turns.
"""

from __future__ import annotations

import copy
import itertools
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, cast

import mujoco
import numpy as np
from gymnasium.envs.registration import EnvSpec
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space, create_empty_array
from mujoco.batch import Batch, SimulationError
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, PhysicsError
from jacokin.model import checks
from jacokin.tasks.episode import clip_action
from jacokin.tasks.features import StateView
from jacokin.tasks.gym import packing
from jacokin.tasks.gym.controls import CONTROLS
from jacokin.tasks.gym.environment import DELAY, NO_EPISODE, OPTIONS, Info, TaskEnv, checked_spec
from jacokin.tasks.gym.packing import Observation, add_pictures
from jacokin.tasks.randomization import MAX_LATENCY, SIMULATED, Randomization, delay, has_pushes
from jacokin.tasks.task import State, check_rewards

Flags = NDArray[np.bool_]
Indices = NDArray[np.intp]
Values = dict[str, float]  # of a randomization
Begun = list[tuple[Observation, Info]]
VectorStep = tuple[Observation, Array, Flags, Flags, Info]

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


class VectorTaskEnv(VectorEnv[Observation, Any, NDArray[Any]]):
    """Environments that are stepped together, and reset as one of Gymnasium's `AutoresetMode` says.

    Environment i equals a single one that was reset with the same seed, bit for bit on one version of MuJoCo, unless
    what rests may sleep.
    """

    def __init__(
        self,
        num_envs: int = 1,
        *,
        threads: int = 1,
        sleep: bool = False,
        max_episode_steps: int | None = None,
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
        **options: Any,
    ) -> None:
        """Make the environments.

        Args:
            num_envs: how many.
            threads: how many threads simulate.
            sleep: let MuJoCo leave out props that rest until something touches them: quicker, and no longer equal to a
                single environment bit for bit.
            max_episode_steps: after which episodes are truncated, if that is before the time limit; None or -1 for the
                time limit alone.
            autoreset_mode: when an environment whose episode has ended starts another: Gymnasium's "NextStep",
                "SameStep" or "Disabled".
            options: as for `TaskEnv`, without rendering.

        Raises:
            UnknownNameError: an unknown option or mode; lists the valid ones.
            InvalidInputError: a wrong number, or an option that vectors do not have.
        """
        self._spec: EnvSpec | None = None
        if options.pop("render_mode", None) is not None:
            raise InvalidInputError("a vector of environments does not render; make a single one with the same seed")
        own = ("threads", "sleep", "max_episode_steps", "autoreset_mode")
        shared = [name for name in OPTIONS if name not in ("render_mode", "width", "height", "render_camera")]
        for name in options:
            checks.choice("option of a vector", name, (*own, *shared))
        checks.whole_number("num_envs", num_envs, 1)
        checks.whole_number("threads", threads, 1)
        checks.flag("sleep", sleep)
        value = autoreset_mode.value if isinstance(autoreset_mode, AutoresetMode) else autoreset_mode
        modes = [mode.value for mode in AutoresetMode]
        self.autoreset_mode = AutoresetMode(checks.choice("autoreset_mode", value, modes))
        first = self._first = TaskEnv(**options)
        steps = first._episode.most_steps
        if max_episode_steps not in (None, -1):
            steps = min(steps, checks.whole_number("max_episode_steps", max_episode_steps, 1))
        self._simulations = Simulations(first, num_envs, threads, steps, sleep=sleep)
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
        self._last = cast(Observation, create_empty_array(first.observation_space, num_envs))

    @property
    def observation_names(self) -> tuple[str, ...]:
        """The name of each number of the observation of one environment; see `TaskEnv.observation_names`."""
        return self._first.observation_names

    @property
    def spec(self) -> EnvSpec | None:
        """How ``gymnasium.make_vec`` made it, None otherwise."""
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        self._spec = checked_spec(spec)

    @property
    def randomization(self) -> Randomization | None:
        """What is drawn at each reset; see `TaskEnv.randomization`."""
        return self._first.randomization

    @randomization.setter
    def randomization(self, value: Randomization | Mapping[str, Any] | None) -> None:
        self._first.randomization = value

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: Mapping[str, Any] | None = None,
    ) -> tuple[Observation, Info]:
        """Start an episode in every environment, or in some; those whose reset fails or is interrupted have none.

        Args:
            seed: of the first environment, the others get the following numbers; or one for each.
            options: "reset_mask", which to reset, (num_envs,) bool; "randomization", the values of earlier episodes as
                `infos` had them.

        Raises:
            InvalidInputError: wrong seeds or options; nothing is changed.
        """
        given = dict(checks.mapping("options", {} if options is None else options, "a dict or None"))
        ids = np.flatnonzero(self._mask(given.pop("reset_mask", True)))
        all_seeds, each = self._seeds(seed), self._each(given)
        seeds = [all_seeds[index] for index in ids]
        replayed = [self._first._checked_reset(all_seeds[index], each[index]) for index in ids]
        self._has_begun[ids] = False  # until the reset is complete
        infos = self._note_starts(ids, self._simulations.begin(ids, seeds, replayed), self._last, {})
        self._is_over[ids] = False
        self._has_begun[ids] = True
        return copy.deepcopy(self._last), infos

    def step(self, values: NDArray[Any]) -> VectorStep:
        """Apply an action in every environment.

        By default those whose episode has ended start another one instead. A step that is interrupted (Ctrl-C) ends all
        episodes: call `reset`.

        Args:
            values: (num_envs, ...) actions.

        Raises:
            InvalidInputError: wrong shape, not numbers, or NaN; nothing is simulated. Or a reward of your own is not
                finite: call `reset`.
            PhysicsError: an environment has no episode: call `reset`.
        """
        if not self._has_begun.all():
            raise PhysicsError(NO_EPISODE)
        checked = clip_action(values, *self._bounds)
        self._first._control.check(checked)
        ended, goes_on = np.flatnonzero(self._is_over), np.flatnonzero(~self._is_over)
        if len(ended) and self.autoreset_mode is AutoresetMode.DISABLED:
            raise PhysicsError(
                f"the episodes of environments {ended.tolist()} have ended: call reset(options={{'reset_mask': ...}})"
            )
        begun = self._begin_again(ended)
        self._has_begun[:] = False  # until the step is complete
        outcome = self._simulations.advance(checked, goes_on)
        observations, truncated = outcome.observations, outcome.is_over
        for index in outcome.errors:
            packing.put(observations, index, packing.row(self._last, index))
        outcome.rewards[ended], truncated[ended] = 0.0, False
        if self.autoreset_mode is AutoresetMode.SAME_STEP:
            infos = self._start_over(np.flatnonzero(truncated), outcome)
        else:
            infos = self._note_starts(ended, begun, observations, self._infos(outcome, goes_on))
            self._is_over = truncated.copy()
        self._last = copy.deepcopy(observations)
        self._has_begun[:] = True
        return observations, outcome.rewards, np.zeros(self.num_envs, dtype=bool), truncated, infos

    def _begin_again(self, ids: Indices) -> Begun:
        """Start further episodes."""
        return self._simulations.begin(ids, [None] * len(ids), [None] * len(ids)) if len(ids) else []

    def _note_starts(self, ids: Indices, begun: Begun, observations: Observation, infos: Info) -> Info:
        """Note what the starts of episodes gave, among the observations and infos of all."""
        for index, (observation, info) in zip(ids.tolist(), begun, strict=True):
            packing.put(observations, index, observation)
            infos = self._add_info(infos, info, index)
            for name, value in info.get("randomization", {}).items():
                self._values[name][index] = value
        return infos

    def _start_over(self, ended: Indices, outcome: StepOutcome) -> Info:
        """Start other episodes in the same step; the infos have the last observations and infos of those that ended."""
        infos = self._infos(outcome, np.flatnonzero(~outcome.is_over))
        for index in ended.tolist():
            last: Info = {"is_success": bool(outcome.is_success[index])}
            if self._values:
                last["randomization"] = {name: float(column[index]) for name, column in self._values.items()}
            if index in outcome.errors:
                last["error"] = outcome.errors[index]
            observation = copy.deepcopy(packing.row(outcome.observations, index))
            infos = self._add_info(infos, {"final_obs": observation, "final_info": last}, index)
        return self._note_starts(ended, self._begin_again(ended), outcome.observations, infos)

    def _infos(self, outcome: StepOutcome, ids: Indices) -> Info:
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
            raise checks.refusal("reset_mask", f"a bool array ({self.num_envs},)", value)
        return value

    def _seeds(self, seed: int | Sequence[int | None] | None) -> list[int | None]:
        if seed is None:
            return [None] * self.num_envs
        if isinstance(seed, int | np.integer) and not isinstance(seed, bool):
            return [int(seed) + index for index in range(self.num_envs)]
        if not isinstance(seed, Sequence | np.ndarray) or isinstance(seed, str) or len(seed) != self.num_envs:
            raise checks.refusal("seed", f"one number, or {self.num_envs}", seed)
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


@dataclass(frozen=True, slots=True, eq=False)
class StepOutcome:
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

    def __init__(self, first: TaskEnv, count: int, threads: int, steps: int, *, sleep: bool) -> None:
        """Make the batch.

        Args:
            first: the environment in which episodes are started; it is of no other use then.
            count: how many simulations.
            threads: how many threads simulate.
            steps: after which an episode is over.
            sleep: whether props that rest are left out.
        """
        self._first, self._count, self._most_steps = first, count, steps
        model, control, dt = first.model, first.options.control, first.options.control_timestep
        self._substeps = first._episode.substeps
        disabled, enabled = model.opt.disableflags, model.opt.enableflags
        # MuJoCo would put a diverged simulation back to its reference state, and go on as if nothing had happened.
        model.opt.disableflags = disabled | int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
        model.opt.enableflags = enabled | (int(mujoco.mjtEnableBit.mjENBL_SLEEP) if sleep else 0)
        self._batch = Batch(model, count, threads, persistent=True)
        model.opt.disableflags, model.opt.enableflags = disabled, enabled
        self._ctrl: Array = self._batch.bind("ctrl")
        self._view = StateView.of(self._batch)
        self._goals = np.zeros((count, first.task.goal_size))
        self._steps = np.zeros(count, dtype=np.intp)
        # Of initial states, and of the randomization.
        self._random: list[tuple[np.random.Generator | None, np.random.Generator | None]] = [(None, None)] * count
        self._values: list[Values] = [{}] * count
        self._states: Array = np.zeros_like(self._batch.state)  # of episodes that are being started
        bounds, arm = (first._episode.lower, first._episode.upper), first.task.arm
        self._controls = [CONTROLS[control](*bounds, dt, arm) for _ in range(count)]
        self._rows = [] if control == "joint_velocity" else [self._view.row(index) for index in range(count)]
        names = () if first.randomization is None else first.randomization.names
        self._constants: dict[str, Array] = {name: self._batch.expand(name) for name in SIMULATED if names}
        self._forces: Array | None = self._batch.bind("xfrc_applied") if has_pushes(names) else None
        self._pushed = np.array([first._pushes.none] * count)
        self._is_varied, self._is_disturbed = bool(names), "action_noise" in names
        self._biases: list[Array] = [np.zeros(0)] * count
        self._deviations: list[Array] = [np.zeros(0)] * count
        delays = round(MAX_LATENCY / dt) + 2 if "latency" in names else 0
        self._delayed = np.zeros((delays, *self._ctrl.shape))
        self._delays = np.zeros(count, dtype=np.intp)  # of actions, in control steps
        self._changes = np.zeros(count, dtype=np.intp)  # physics steps after which the action changes
        self._is_late = DELAY in names
        self._seen: list[deque[Observation]] = [deque()] * count
        self._looks = np.full(count, self._substeps, dtype=np.intp)  # physics steps after which observations are taken
        self._pictured = mujoco.MjData(model) if first.options.has_camera else None

    def begin(self, ids: Indices, seeds: Sequence[int | None], replayed: Sequence[Values | None]) -> Begun:
        """Start episodes in some environments, with checked arguments; see `TaskEnv._start`.

        Raises:
            EpisodeInitializationError: no initial state was found for one of them.
        """
        started = zip(ids.tolist(), seeds, replayed, strict=True)
        begun, batch = [self._begin_one(*each) for each in started], self._batch
        batch.reset(ids, stage=int(mujoco.mjtStage.mjSTAGE_NONE))
        batch.state[ids] = self._states[ids]
        batch.warning[ids] = 0
        if self._constants:
            batch.set_const(ids)
        batch.forward(ids, _VELOCITIES)
        self._steps[ids] = 0
        return begun

    def _begin_one(self, index: int, seed: int | None, replayed: Values | None) -> tuple[Observation, Info]:
        """Start an episode in the first environment, and take what it is like there to another one."""
        first = self._first
        (first._np_random, first._variation_random), first._control = self._random[index], self._controls[index]
        try:
            begun = first._start(seed, replayed)
        finally:
            self._random[index] = first.np_random, first._variation_random
        self._states[index] = first.task.physics.get_state()
        self._values[index] = first._values
        self._delays[index], self._changes[index] = delay(first._values, "latency", self._substeps)
        self._biases[index], self._deviations[index] = first._bias, first._deviations
        self._pushed[index] = first._pushed
        _, early = delay(first._values, DELAY, self._substeps)
        self._seen[index], self._looks[index] = deque(first._seen), self._substeps - early
        for name, constants in self._constants.items():
            constants[index] = getattr(first.model, name)
        self._goals[index] = first._episode.goal
        return begun

    def advance(self, actions: Array, ids: Indices) -> StepOutcome:
        """Step some environments; what the outcome says of others does not count.

        Args:
            actions: (n, ...) checked actions of all.
            ids: which to step.
        """
        first, view, goals = self._first, self._view, self._goals
        errors = self._simulate(actions, ids) if len(ids) else {}
        self._steps[ids] += 1
        state = State(first.task, view, goals, actions)
        observations = first._packing.pack(state)
        going = [index for index in ids.tolist() if index not in errors]
        if self._pictured is not None:
            observations = add_pictures(observations, self._pictures([] if self._is_late else going))
        for index in going if self._is_late else ():
            late, _ = delay(self._values[index], DELAY, self._substeps)
            packing.put(observations, index, self._seen[index][max(0, len(self._seen[index]) - 1 - late)])
        for index in going if self._is_varied else ():
            seen, values, (_, random_state) = packing.row(observations, index), self._values[index], self._random[index]
            first._packing.disturb(seen, values, self._biases[index], self._deviations[index], random_state)
        rewards = np.array(first._rewards(state))
        if not np.isfinite(rewards[going]).all():
            index = next(index for index in going if not np.isfinite(rewards[index]))
            check_rewards(
                first.options.task, rewards[index], f" after step {self._steps[index]} of environment {index}"
            )
        outcome = StepOutcome(
            observations,
            rewards,
            np.array(first.task.is_solved(state)),
            self._steps >= self._most_steps,
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
        if self._forces is not None:
            self._push(self._forces, ids)
        if self._is_disturbed:
            velocities = np.array(
                [self._disturbed(index, each) for index, each in zip(ids.tolist(), velocities, strict=True)]
            )
        before, now = self._late(velocities, ids) if len(self._delayed) else (velocities, velocities)
        changes, looks = self._changes[ids], self._looks[ids]
        for start, stop in itertools.pairwise(sorted({0, self._substeps, *changes.tolist(), *looks.tolist()})):
            self._ctrl[ids] = np.where((start < changes)[:, None], before, now)
            going = np.array([index for index in ids.tolist() if index not in errors], dtype=np.intp)
            try:
                batch.step(None if len(going) == self._count else going, stop - start, _VELOCITIES)
            except SimulationError as error:
                errors.update({int(index): f"MuJoCo gave up: {batch.error(int(index))}" for index in error.ids})
            for index in ids[looks == stop].tolist() if self._is_late else ():
                self._look(index, actions[index])
        # NaN is not below the bound either.
        is_well = (np.abs(view.qpos).max(axis=1) < _HUGE) & (np.abs(view.qvel).max(axis=1) < _HUGE)
        is_well &= ~batch.warning[..., 1].any(axis=1)
        for index in ids[~is_well[ids]].tolist():
            counts = batch.warning[index, :, 1]
            found = [text for kind, text in _WARNINGS.items() if int(kind) < len(counts) and counts[int(kind)]]
            errors.setdefault(index, "; ".join(found) or "the simulation is unstable")
        return errors

    def _push(self, forces: Array, ids: Indices) -> None:
        for index in ids.tolist():
            _, random_state = self._random[index]
            assert random_state is not None
            self._first._pushes.advance(self._values[index], self._pushed[index], forces[index], random_state)

    def _disturbed(self, index: int, velocities: Array) -> Array:
        _, random_state = self._random[index]
        assert random_state is not None
        return self._first._disturbed(velocities, self._values[index], random_state)

    def _look(self, index: int, action: Array) -> None:
        """Keep an observation that is to be given late."""
        first, seen = self._first, self._seen[index]
        state = State(first.task, self._view.row(index), self._goals[index], action)
        observation = first._packing.pack(state)
        if self._pictured is not None:
            observation = add_pictures(observation, self._pictures_of(index))
        seen.append(observation)
        if len(seen) > delay(self._values[index], DELAY, self._substeps)[0] + 1:
            seen.popleft()

    def _late(self, velocities: Array, ids: Indices) -> tuple[Array, Array]:
        """The velocities asked for some steps ago, and before; none at first."""
        steps, delayed = self._steps[ids], self._delayed
        delayed[steps % len(delayed), ids] = velocities
        asked = steps - self._delays[ids]

        def at(step: Indices) -> Array:
            return np.where((step >= 0)[:, None], delayed[step % len(delayed), ids], 0.0)

        return at(asked - 1), at(asked)

    def _pictures(self, ids: Sequence[int]) -> dict[str, NDArray[Any]]:
        """What the cameras of some environments see; 0 elsewhere."""
        spaces = cast(Mapping[str, Any], self._first.observation_space)
        found = {
            name: np.zeros((self._count, *spaces[name].shape), dtype=spaces[name].dtype)
            for name in self._first.options.sizes
        }
        for index in ids:
            for name, picture in self._pictures_of(index).items():
                found[name][index] = picture
        return found

    def _pictures_of(self, index: int) -> dict[str, NDArray[np.generic]]:
        if self._constants:
            self._first._apply(self._values[index])
        self._first.task.show_goal(self._goals[index])
        self._batch.get_data(index, self._pictured)
        return self._first._pictures(self._pictured)

    def close(self) -> None:
        """Free what pictures need."""
        self._first.close()
