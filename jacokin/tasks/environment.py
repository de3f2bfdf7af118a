"""`Environment`: a task for dm_env, with the names, observations, actions and rewards of dm_control's manipulation."""

from __future__ import annotations

import copy
from collections import OrderedDict
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from jacokin.errors import needed
from jacokin.model import checks
from jacokin.mujoco_bridge import Physics
from jacokin.mujoco_bridge.arena import CONTACTS, FIRM
from jacokin.mujoco_bridge.base import RandomState
from jacokin.tasks import registry
from jacokin.tasks.episode import PICTURE, Episode, Snapshot, clip_action
from jacokin.tasks.task import CAMERA, CONTROL_TIMESTEP, Task, check_rewards

with needed("dm_env", "tasks"):
    import dm_env
    from dm_env import specs

ObservationDict = OrderedDict[str, NDArray[Any]]


class Environment(dm_env.Environment):  # type: ignore[misc]  # dm_env has no types
    """One task; made by `load`.

    Episodes end at the time limit, ours after 10 s, 250 steps, with discount 1. Observations have the leading axis of
    dm_control's buffers and are new arrays each time. Pickles and copies, in the middle of an episode too.
    """

    def __init__(self, name: str, seed: int | RandomState | None = None, *, contact: str = FIRM) -> None:
        """Compile the scene; see `load`."""
        task, observed = registry.task_and_observations(name)
        self._name = name.rpartition(":")[2]
        self._random_state = checked_random_state(seed)
        self._contact = checks.choice("contact", contact, CONTACTS)
        self._episode = Episode(task, contact)
        self._has_camera = observed == registry.VISION
        self._features = [
            each for each in self._episode.task.features if each.is_proprioceptive or not self._has_camera
        ]

    @property
    def name(self) -> str:
        """The name it was loaded by."""
        return self._name

    @property
    def task(self) -> Task:
        """The task."""
        return self._episode.task

    @property
    def physics(self) -> Physics:
        """The simulation."""
        return self._episode.physics

    @property
    def random_state(self) -> RandomState:
        """The source of all random numbers."""
        return self._random_state

    def control_timestep(self) -> float:
        """Time between two actions [s]."""
        return CONTROL_TIMESTEP

    def reset(self) -> dm_env.TimeStep:
        """Start an episode.

        Raises:
            EpisodeInitializationError: no initial state was found.
        """
        self._episode.start(self._random_state)
        return dm_env.restart(self._observation())

    def step(self, action: ArrayLike) -> dm_env.TimeStep:
        """Apply an action for 0.04 s; starts an episode instead, if there is none or the last has ended.

        A step that is interrupted (Ctrl-C) ends the episode.

        Args:
            action: (9,) velocities of the joints and the fingers [rad/s]; beyond the limits, the limits are applied.

        Raises:
            InvalidInputError: wrong shape, not numbers, or NaN; nothing is simulated. Or a reward of your own is not
                finite; the next call starts an episode.
            PhysicsError: the simulation diverged; the next call starts an episode.
        """
        episode = self._episode
        if episode.steps is None or episode.is_over:
            return self.reset()
        values = clip_action(action, episode.lower, episode.upper)
        steps, episode.steps = episode.steps, None  # until the step is complete
        episode.advance(values)
        episode.action = values
        reward = float(episode.task.score(episode.state))
        check_rewards(self._name, reward, f" after step {steps + 1}")
        observation = self._observation()
        episode.steps = steps + 1
        kind = dm_env.StepType.LAST if episode.is_over else dm_env.StepType.MID
        return dm_env.TimeStep(kind, reward, 1.0, observation)

    def action_spec(self) -> specs.BoundedArray:
        """Velocities (9,) of the arm's joints and the fingers [rad/s]."""
        model = self._episode.physics.model
        name = "\t".join(model.actuator(i).name for i in range(model.nu))
        return specs.BoundedArray((model.nu,), np.float64, self._episode.lower, self._episode.upper, name)

    def observation_spec(self) -> OrderedDict[str, specs.Array]:
        """Shapes and types of the observations, by key, in their order."""
        found: OrderedDict[str, specs.Array] = OrderedDict()
        if self._has_camera:
            found[CAMERA] = specs.BoundedArray((1, PICTURE, PICTURE, 3), np.uint8, 0, 255, CAMERA)
        for each in self._features:
            found[each.name] = specs.Array((1, *each.shape), np.float64, each.name)
        return found

    def reward_spec(self) -> specs.Array:
        """A number, of our tasks in 0..1."""
        return specs.Array((), np.float64, "reward")

    def close(self) -> None:
        """Free what pictures need."""
        self._episode.close()

    def _observation(self) -> ObservationDict:
        view, goal = self._episode.view, self._episode.goal
        found: ObservationDict = OrderedDict()
        if self._has_camera:
            found[CAMERA] = self._episode.picture()[None]
        for each in self._features:
            found[each.name] = np.array(each.value(view, goal), dtype=np.float64)[None]
        return found

    def __reduce__(self) -> tuple[Callable[..., Environment], tuple[object, ...], Snapshot]:
        """Pickle the name, the source of random numbers, and where the episode is."""
        task, _ = registry.task_and_observations(self._name)
        made = (self._name, self._random_state, task, registry.own_entry(task), self._contact)
        return _again, made, self._episode.snapshot()

    def __setstate__(self, snapshot: Snapshot) -> None:
        """Go back to where the episode was."""
        self._episode.restore(snapshot)

    def __copy__(self) -> Environment:
        """A second environment in the same state: two cannot share a simulation, so this is `copy.deepcopy`."""
        return copy.deepcopy(self)


def _again(
    name: str, random_state: RandomState, task: str, entry: registry.TaskEntry | None, contact: str
) -> Environment:
    registry.receive(task, entry)
    return Environment(name, random_state, contact=contact)


def load(name: str, seed: int | RandomState | None = None, *, contact: str = FIRM) -> Environment:
    """Make an environment.

    Args:
        name: one of `names`, or an id that was registered, with its module and a colon in front if that is to be
            imported; without ``_features`` or ``_vision`` features are observed.
        seed: of the random numbers, or their source itself; None for another one each time.
        contact: how friction is solved: "firm", so that what the hand holds stays where it is held, or "dm_control", as
            there, where it creeps.

    Raises:
        UnknownNameError: no such task or contact; tells the nearest name and lists all.
        InvalidInputError: seed is neither a whole number from 0 nor a source of random numbers.
        MissingExtraError: dm_env is not installed.
    """
    return Environment(name, seed, contact=contact)


def checked_random_state(seed: object) -> RandomState:
    """The source of random numbers that a seed means.

    Raises:
        InvalidInputError: not a seed.
    """
    if isinstance(seed, np.random.Generator | np.random.RandomState):
        return seed
    if seed is None:
        return np.random.default_rng()
    if isinstance(seed, bool | np.timedelta64) or not isinstance(seed, int | np.integer) or seed < 0:
        raise checks.refusal("seed", "a whole number >= 0, a numpy.random.Generator or None", seed)
    return np.random.default_rng(int(seed))
