"""`TaskEnv`: one task as an environment of Gymnasium."""

from __future__ import annotations

import copy
import inspect
from collections import deque
from collections.abc import Callable, Mapping
from typing import Any

import gymnasium
import mujoco
import numpy as np
from gymnasium import spaces
from numpy.typing import ArrayLike, NDArray

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, PhysicsError
from jacokin.model import checks
from jacokin.mujoco_bridge.control import site_ik
from jacokin.mujoco_bridge.control.site_ik import Asking
from jacokin.tasks import registry
from jacokin.tasks.episode import STEPS, Episode, Snapshot, clip_action
from jacokin.tasks.features import ids
from jacokin.tasks.gym.controls import CONTROLS, Control
from jacokin.tasks.gym.packing import EnvOptions, Observation, Packing, add_picture
from jacokin.tasks.gym.window import Window, check_display, is_usable
from jacokin.tasks.randomization import Randomization, Variation, latency_steps
from jacokin.tasks.task import CONTROL_TIMESTEP, Task

RENDER_MODES = ("rgb_array", "human", "depth_array")
NO_EPISODE = "there is no episode, or the last step was not completed: call reset() before step()"
SIZE = 480  # rows and columns of rendered pictures [pixels]
_METADATA = {"render_modes": list(RENDER_MODES), "render_fps": round(1.0 / CONTROL_TIMESTEP)}

Info = dict[str, Any]


class TaskEnv(gymnasium.Env[Observation, NDArray[Any]]):
    """A task; made by ``gymnasium.make("jacokin/ReachSite-v0")``.

    Nothing ends an episode but the time limit of 10 s, so ``terminated`` is always False. Observations are new arrays.
    Pickles and copies, in the middle of an episode too.
    """

    metadata: dict[str, Any] = _METADATA  # each environment has the render modes that work on this machine

    def __init__(
        self,
        task: str,
        *,
        control: str = "joint_velocity",
        reward: str = "dense",
        goal: bool = False,
        observations: str = registry.FEATURES,
        flatten: bool = True,
        randomization: Randomization | Mapping[str, Any] | None = None,
        render_mode: str | None = None,
        width: int = SIZE,
        height: int = SIZE,
    ) -> None:
        """Compile the scene.

        Args:
            task: name of the task.
            control: what actions mean: "joint_velocity", "tool_velocity" or "tool_pose".
            reward: "dense", as in dm_control, or "sparse": 1 when the task is solved, else 0.
            goal: give observations with ``achieved_goal`` and ``desired_goal``.
            observations: "features" or "vision".
            flatten: give the features as one array; False for a dictionary by name.
            randomization: what is drawn at each reset beside the initial state, or the fields of a `Randomization` by
                name, as a specification in JSON has them; ``info["randomization"]`` has the values,
                ``reset(options={"randomization": values})`` uses them again.
            render_mode: what `render` gives: "rgb_array", "depth_array", "human" (a window), or None.
            width: columns of rendered pictures [pixels].
            height: rows of rendered pictures [pixels].

        Raises:
            UnknownNameError: an unknown option; lists the valid ones.
            InvalidInputError: options that do not go together.
            PhysicsError: "human" without a display.
        """
        self.options = EnvOptions(task, control, reward, goal, observations, flatten)
        self.randomization = None if randomization is None else Randomization.of(randomization)
        if render_mode is not None:
            checks.choice("render_mode", render_mode, RENDER_MODES)
        if render_mode == "human":
            check_display()
        self.render_mode = render_mode
        usable = [mode for mode in RENDER_MODES if mode == render_mode or is_usable(mode)]
        self.metadata = {**_METADATA, "render_modes": usable}
        self._size = checks.whole_number("height", height, 1), checks.whole_number("width", width, 1)
        self._episode = Episode(task)
        self._packing = Packing(self._episode.task, self.options)
        self._control: Control = CONTROLS[control](self._episode.lower, self._episode.upper)
        self.observation_space = self._packing.space
        self.action_space = spaces.Box(*self._control.bounds, dtype=np.float64)
        self._window: Window | None = None
        base = int(ids(self._episode.physics, self.task.arm.root_body)[0])
        self._variation = None if self.randomization is None else Variation(self.model, base)
        # Apart from the numbers of initial states, which a seed then determines with and without randomization.
        self._variation_random: np.random.Generator | None = None
        self._values: dict[str, float] = {}
        self._delayed: deque[Array] = deque()

    @property
    def task(self) -> Task:
        """The task."""
        return self._episode.task

    @property
    def model(self) -> mujoco.MjModel:
        """MuJoCo's model."""
        return self._episode.physics.model

    @property
    def data(self) -> mujoco.MjData:
        """MuJoCo's data."""
        return self._episode.physics.data

    @property
    def dt(self) -> float:
        """Time between two actions [s]."""
        return CONTROL_TIMESTEP

    def reset(self, *, seed: int | None = None, options: Mapping[str, Any] | None = None) -> tuple[Observation, Info]:
        """Start an episode.

        Args:
            seed: starts the random numbers anew; None goes on with them.
            options: "randomization", the values of an earlier episode, which are then not drawn.

        Returns:
            The observation, and ``info`` with ``is_success`` and, if anything is randomized, ``randomization``.

        Raises:
            InvalidInputError: a seed that is not a whole number >= 0, or an unknown option.
            EpisodeInitializationError: no initial state was found.
        """
        return site_ik.run(self._start(seed, self._checked_reset(seed, options)))

    def _checked_reset(self, seed: object, options: Mapping[str, Any] | None) -> dict[str, float] | None:
        """Check the arguments of `reset`; returns the values of an earlier episode, if they were given.

        Raises:
            InvalidInputError: as for `reset`.
        """
        given = checks.mapping("options", {} if options is None else options, "a dict or None")
        for name in given:
            checks.choice("option of reset", name, () if self.randomization is None else ("randomization",))
        if seed is not None:
            checks.whole_number("seed", seed)
        if self.randomization is None or not given:
            return None
        return self.randomization.replayed(given["randomization"])

    def _start(self, seed: int | None, replayed: dict[str, float] | None) -> Asking[tuple[Observation, Info]]:
        """As `reset` with checked arguments; the caller answers the queries, see `Task.starting`."""
        super().reset(seed=None if seed is None else int(seed))  # Gymnasium refuses NumPy's whole numbers
        if self.randomization is not None:
            if seed is not None or self._variation_random is None:
                self._variation_random = self.np_random.spawn(1)[0]
            drawn = self.randomization.draw(self._variation_random)
            self._apply(drawn if replayed is None else replayed)
        yield from self._episode.starting(self.np_random)
        self._control.start(self._episode.physics)
        self._delayed.clear()
        observation, _, success = self._outcome()
        self._show()
        return observation, self._info(success)

    def step(self, action: ArrayLike) -> tuple[Observation, float, bool, bool, Info]:
        """Apply an action for 0.04 s.

        A simulation that diverges ends the episode: the step is truncated, with the last observation and reward 0, and
        ``info["error"]`` says why. A step that is interrupted (Ctrl-C) ends it too: call `reset`.

        Args:
            action: of the action space; values beyond its bounds are put on them.

        Raises:
            InvalidInputError: wrong shape, not numbers, or NaN; nothing is simulated.
            PhysicsError: there is no episode: call `reset`.
        """
        episode = self._episode
        steps = episode.steps
        if steps is None:
            raise PhysicsError(NO_EPISODE)
        values = clip_action(action, *self._control.bounds)
        self._control.check(values)
        episode.steps = None  # until the step is complete
        try:
            velocities = self._control.velocities(episode.view, values)
            episode.advance(self._late(velocities) if self._values else velocities)
        except PhysicsError as error:
            return copy.deepcopy(self._last), 0.0, False, True, {"is_success": False, "error": str(error)}
        observation, reward, success = self._outcome()
        self._show()
        episode.steps = steps + 1
        return observation, reward, False, episode.steps >= STEPS, self._info(success)

    @property
    def compute_reward(self) -> Callable[..., float | Array]:
        """The reward of goals, as `step` gives it: ``compute_reward(achieved_goal, desired_goal, info=None)``.

        Both goals are arrays (..., n), ``info`` is not used, rewards are (...), a float for single goals. Goals that
        are not numbers, or of another size than in observations, raise `InvalidInputError`.

        Raises:
            AttributeError: with ``goal=False``, as other libraries tell environments with goals by this function.
        """
        if not self.options.goal:
            raise AttributeError("compute_reward needs goal=True")
        return self._rewards_of_goals

    def _rewards_of_goals(
        self, achieved_goal: ArrayLike, desired_goal: ArrayLike, info: object = None
    ) -> float | Array:
        size = self._packing.goal_size
        achieved, desired = _goals("achieved_goal", achieved_goal, size), _goals("desired_goal", desired_goal, size)
        try:
            np.broadcast_shapes(achieved.shape[:-1], desired.shape[:-1])
        except ValueError as error:
            raise InvalidInputError(
                f"achieved_goal and desired_goal must be as many, got shapes {achieved.shape} and {desired.shape}"
            ) from error
        found = self._rewards(achieved, desired)
        return float(found) if np.ndim(found) == 0 else found

    def compute_terminated(self, achieved_goal: ArrayLike, desired_goal: ArrayLike, info: object = None) -> bool:
        """False: nothing ends an episode but its time limit."""
        return False

    def compute_truncated(self, achieved_goal: ArrayLike, desired_goal: ArrayLike, info: object = None) -> bool:
        """Whether the time limit is reached."""
        return self._episode.steps is not None and self._episode.steps >= STEPS

    def render(self) -> NDArray[Any] | None:
        """A picture, (height, width, 3) uint8, or the depth, (height, width) float32 [m]; None in a window.

        Raises:
            PhysicsError: there is no OpenGL context, or no window can be opened.
        """
        if self.render_mode is None or self.render_mode == "human":
            self._show()
            return None
        height, width = self._size
        return self._episode.picture(height, width, depth=self.render_mode == "depth_array")

    def close(self) -> None:
        """Free what pictures need."""
        self._episode.close()
        if self._window is not None:
            self._window.close()
            self._window = None

    def _rewards(self, achieved: Array, desired: Array) -> Array:
        task = self._episode.task
        if self.options.reward == "dense":
            return task.reward(achieved, desired)
        return task.success(achieved, desired).astype(np.float64)

    def _outcome(self) -> tuple[Observation, float, bool]:
        """The observation, the reward, and whether the task is solved."""
        episode = self._episode
        task, view, goal = episode.task, episode.view, episode.goal
        achieved, desired = task.achieved(view, goal), task.desired(view, goal)
        observation = self._packing.pack(view, goal, achieved, desired)
        if self.options.has_camera:
            observation = add_picture(observation, episode.picture())
        if "observation_noise" in self._values:
            assert self._variation_random is not None
            self._packing.add_noise(observation, self._values["observation_noise"], self._variation_random)
        self._last = observation
        return observation, float(self._rewards(achieved, desired)), bool(task.success(achieved, desired))

    def _info(self, success: bool) -> Info:
        if self.randomization is None:
            return {"is_success": success}
        return {"is_success": success, "randomization": dict(self._values)}

    def _apply(self, values: dict[str, float]) -> None:
        """Give the model these values."""
        assert self._variation is not None
        self._values = values
        self._variation.apply(values)

    def _late(self, velocities: Array) -> Array:
        """The velocities asked for some steps ago; none at first."""
        self._delayed.append(velocities)
        late = len(self._delayed) > latency_steps(self._values)
        return self._delayed.popleft() if late else np.zeros_like(velocities)

    def _show(self) -> None:
        if self.render_mode != "human":
            return
        if self._window is None:
            self._window = Window(self.model)
        self._window.show(self.data)

    def __getstate__(self) -> dict[str, Any]:
        """How it was made, its random numbers, and where the episode is."""
        height, width = self._size
        return {
            "options": self.options,
            "render": {"render_mode": self.render_mode, "height": height, "width": width},
            "random": (self._np_random, self._np_random_seed, self._variation_random),
            "spec": self.spec,
            "control": self._control,
            "snapshot": self._episode.snapshot(),
            "randomization": self.randomization,
            "values": self._values,
            "delayed": deque(self._delayed),
            "last": getattr(self, "_last", None),
        }

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Compile the scene and go on."""
        options: EnvOptions = state["options"]
        fields = {name: getattr(options, name) for name in options.__slots__}
        self.__init__(**fields, randomization=state["randomization"], **state["render"])  # type: ignore[misc]  # an object without state is made as usual
        self._np_random, self._np_random_seed, self._variation_random = state["random"]
        self.spec = state["spec"]
        self._control = state["control"]
        self._delayed = state["delayed"]
        if self.randomization is not None and state["values"]:
            self._apply(state["values"])
        snapshot: Snapshot = state["snapshot"]
        self._episode.restore(snapshot)
        self._last = copy.deepcopy(state["last"])

    def __deepcopy__(self, memo: dict[int, Any]) -> TaskEnv:
        """An independent environment in the same state."""
        twin = object.__new__(type(self))
        state = self.__getstate__()
        twin.__setstate__({**state, **copy.deepcopy({name: state[name] for name in ("random", "control")}, memo)})
        return twin

    def __copy__(self) -> TaskEnv:
        """The same as `copy.deepcopy`: two environments cannot share a simulation."""
        return self.__deepcopy__({})


def _goals(name: str, value: ArrayLike, size: int) -> Array:
    goals = checks.array(name, value, "numbers")
    if goals.ndim < 1 or goals.shape[-1] != size:
        raise InvalidInputError(f"{name} must have shape (..., {size}), got {goals.shape}")
    return goals


OPTIONS = tuple(inspect.signature(TaskEnv).parameters)


def make_environment(**options: Any) -> TaskEnv:
    """Make an environment.

    Args:
        options: as for `TaskEnv`.

    Raises:
        UnknownNameError: an unknown option; lists the valid ones.
    """
    for name in options:
        checks.choice("option", name, OPTIONS)
    return TaskEnv(**options)


make_environment.metadata = TaskEnv.metadata  # type: ignore[attr-defined]  # Gymnasium looks here for render modes
