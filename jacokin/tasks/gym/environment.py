"""`TaskEnv`: one task as an environment of Gymnasium, and its window of `render_mode="human"`."""

from __future__ import annotations

import atexit
import copy
import inspect
import itertools
import os
import sys
import threading
import warnings
from collections import deque
from collections.abc import Callable, Mapping
from typing import Any

import gymnasium
import mujoco
import numpy as np
from gymnasium import spaces
from gymnasium.envs.registration import EnvSpec
from numpy.typing import ArrayLike, NDArray

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, PhysicsError, shown
from jacokin.model import checks
from jacokin.mujoco_bridge.arena import FIRM
from jacokin.showing import has_display
from jacokin.tasks import registry
from jacokin.tasks.episode import DEPTH, Episode, Snapshot, clip_action
from jacokin.tasks.features import ids
from jacokin.tasks.gym.controls import CONTROLS, Control
from jacokin.tasks.gym.packing import EnvOptions, Observation, Packing, add_pictures
from jacokin.tasks.randomization import FEATURE_BIAS, Pushes, Randomization, Variation, delay, has_offsets, has_pushes
from jacokin.tasks.task import CAMERAS, CONTROL_TIMESTEP, WHOLE, Measure, State, Task, check_rewards, measured

RENDER_MODES = ("rgb_array", "human", "depth_array")
NO_EPISODE = "there is no episode, or the last step was not completed: call reset() before step()"
SIZE = 480  # rows and columns of rendered pictures [pixels]
DELAY = "observation_delay"
_METADATA = {"render_modes": list(RENDER_MODES), "render_fps": round(1.0 / CONTROL_TIMESTEP)}

Info = dict[str, Any]


class TaskEnv(gymnasium.Env[Observation, NDArray[Any]]):
    """A task; made by ``gymnasium.make("jacokin/ReachSite-v0")``.

    Nothing ends an episode but the time limit, ours after 10 s, so ``terminated`` is always False. Observations are new
    arrays. Pickles and copies, in the middle of an episode too.
    """

    metadata: dict[str, Any] = _METADATA  # each environment has the render modes that work on this machine

    def __init__(
        self,
        task: str,
        *,
        control: str = "joint_velocity",
        reward: str | Measure = "dense",
        goal: bool = False,
        observations: str = registry.FEATURES,
        flatten: bool = True,
        cameras: Mapping[str, tuple[int, int]] | None = None,
        control_timestep: float = CONTROL_TIMESTEP,
        contact: str = FIRM,
        randomization: Randomization | Mapping[str, Any] | None = None,
        render_mode: str | None = None,
        width: int = SIZE,
        height: int = SIZE,
        render_camera: str = WHOLE,
    ) -> None:
        """Compile the scene.

        Args:
            task: name of the task, or the id under which it was registered.
            control: what actions mean: one of `controls.CONTROLS`, such as "joint_velocity" or "tool_pose".
            reward: "dense", as in dm_control; "sparse": 1 when the task is solved, else 0; or a function of a `State`,
                of one or many, which a specification cannot keep as JSON. With goals it is given ``state.achieved`` and
                ``state.desired`` only, by `compute_reward`.
            goal: give observations with ``achieved_goal`` and ``desired_goal``.
            observations: "features" or "vision".
            flatten: give the features as one array; False for a dictionary by name.
            cameras: with "vision": which cameras observe, "front_close" or "wrist", and the sizes (height, width) of
                their pictures [pixels], at most 480; None for ``{"front_close": (84, 84)}``. "wrist/depth" is the
                depth, (height, width, 1) float32 [m], "wrist/segmentation" the number of the geom that is seen,
                (height, width, 1) int32, -1 for none; ``env.unwrapped.model.geom(number)`` tells which.
            control_timestep: time between two actions [s], a multiple of 0.002 s. Episodes last as long as before;
                ``gymnasium.make`` ends ours after 250 steps all the same, unless it is given ``max_episode_steps=-1``.
            contact: how friction is solved: "firm", so that what the hand holds stays where it is held, or
                "dm_control", as there, where it creeps.
            randomization: what is drawn at each reset beside the initial state, or the fields of a `Randomization` by
                name, as a specification in JSON has them; ``info["randomization"]`` has the values,
                ``reset(options={"randomization": values})`` uses them again.
            render_mode: what `render` gives: "rgb_array", "depth_array", "human" (a window), or None.
            width: columns of rendered pictures [pixels], at most 640.
            height: rows of rendered pictures [pixels], at most 480.
            render_camera: which camera renders them: "whole", which shows all of the arm, "front_close" or "wrist".

        Raises:
            UnknownNameError: an unknown option; lists the valid ones.
            InvalidInputError: options that do not go together.
            PhysicsError: "human" without a display.
        """
        self._spec: EnvSpec | None = None
        self.options = EnvOptions(
            task, control, reward, goal, observations, flatten, cameras, control_timestep, contact
        )
        self._randomization = None if randomization is None else Randomization.of(randomization)
        if render_mode is not None:
            checks.choice("render_mode", render_mode, RENDER_MODES)
        if render_mode == "human":
            check_display()
        self.render_mode = render_mode
        usable = [mode for mode in RENDER_MODES if mode == render_mode or is_usable(mode)]
        rate = max(1, round(1.0 / self.options.control_timestep))
        self.metadata = {**_METADATA, "render_modes": usable, "render_fps": rate}
        self._render_camera = checks.choice("render_camera", render_camera, CAMERAS)
        self._episode = Episode(self.options.task, contact, self.options.control_timestep)
        most = self.model.vis.global_
        self._size = (
            checks.whole_number("height", height, 1, most.offheight),
            checks.whole_number("width", width, 1, most.offwidth),
        )
        if not self.options.has_camera:  # otherwise pictures are as the reference has them
            quality = self.model.vis.quality
            # Of what is rendered but not observed: a fifth of the time that MuJoCo's own take on a processor.
            quality.shadowsize, quality.offsamples = 1024, 0
        self._packing = Packing(self._episode.task, self.options)
        self._control: Control = CONTROLS[control](
            self._episode.lower, self._episode.upper, self.options.control_timestep, self.task.arm
        )
        self._episode.action = np.zeros(len(self._control.bounds[0]))
        self.observation_space = self._packing.space
        self.action_space = spaces.Box(*self._control.bounds, dtype=np.float64)
        self._window: Window | None = None
        base = int(ids(self._episode.physics, self.task.arm.root_body)[0])
        self._variation = None if self.randomization is None else Variation(self.model, base)
        self._pushes = Pushes(self.model, self.dt)
        self._pushed = self._pushes.none
        # Apart from the numbers of initial states, which a seed then determines with and without randomization.
        self._variation_random: np.random.Generator | None = None
        self._values: dict[str, float] = {}
        self._delayed: deque[Array] = deque()  # actions
        self._seen: deque[Observation] = deque()  # observations that are to be given late
        self._bias: Array = np.zeros(0)
        values = {} if self._randomization is None else dict.fromkeys(self._randomization.names, 0.0)
        self._packing.deviations(values, FEATURE_BIAS)  # refuses what is not observed
        self._deviations: Array = self._packing.deviations(values)

    @property
    def observation_names(self) -> tuple[str, ...]:
        """The name of each number of a flat observation, such as ``duplo2x4/position.2``.

        They are in the order of ``gymnasium.spaces.flatten``, and so are the numbers: an environment with
        ``flatten=False`` in Gymnasium's ``FlattenObservation`` gives the same. Goals and pictures are parts as well.
        """
        return self._packing.names

    @property
    def spec(self) -> EnvSpec | None:
        """How ``gymnasium.make`` made it, None otherwise."""
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        self._spec = checked_spec(spec)

    @property
    def randomization(self) -> Randomization | None:
        """What is drawn at each reset; another one with the same fields may be set, from the next reset on."""
        return self._randomization

    @randomization.setter
    def randomization(self, value: Randomization | Mapping[str, Any] | None) -> None:
        before = self._randomization
        after = None if value is None else Randomization.of(value)
        if before is None or after is None or before.names != after.names:
            fields = [] if before is None else before.names
            raise InvalidInputError(f"another randomization must draw the same quantities, which are {fields}")
        self._randomization = after

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
        return self.options.control_timestep

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
        return self._start(seed, self._checked_reset(seed, options))

    def _checked_reset(self, seed: object, options: Mapping[str, Any] | None) -> dict[str, float] | None:
        """Check the arguments of `reset`; returns the values of an earlier episode, if they were given.

        Raises:
            InvalidInputError: as for `reset`.
        """
        given = checks.mapping("options", {} if options is None else options, "a dict or None")
        for name in given:
            checks.choice("option of reset", name, ("randomization",))
            if self.randomization is None:
                raise InvalidInputError("option of reset 'randomization' goes with an environment that has one")
        if seed is not None:
            checks.whole_number("seed", seed)
        if self.randomization is None or not given:
            return None
        return self.randomization.replayed(given["randomization"])

    def _start(self, seed: int | None, replayed: dict[str, float] | None) -> tuple[Observation, Info]:
        """Begin an episode, from checked arguments."""
        super().reset(seed=None if seed is None else int(seed))  # Gymnasium refuses NumPy's whole numbers
        if self.randomization is not None:
            if seed is not None or self._variation_random is None:
                self._variation_random = self.np_random.spawn(1)[0]
            drawn = self.randomization.draw(self._variation_random)
            self._apply(drawn if replayed is None else replayed, is_starting=True)
        self._episode.start(self.np_random)
        if has_offsets(self._values):
            self._apply(self._values)
            self._episode.physics.after_reset()
        self._control.start(self._episode.physics)
        self._delayed.clear()
        self._seen.clear()
        self._pushed = self._pushes.none
        self._deviations = self._packing.deviations(self._values)
        if self._variation_random is not None:
            self._bias = self._packing.draw_bias(self._values, self._variation_random)
        observation, _, success = self._outcome(" at the start of an episode")
        self._show()
        return observation, self._info(success)

    def step(self, action: ArrayLike) -> tuple[Observation, float, bool, bool, Info]:
        """Apply an action for a control step.

        A simulation that diverges ends the episode: the step is truncated, with the last observation and reward 0, and
        ``info["error"]`` says why. A step that is interrupted (Ctrl-C) ends it too: call `reset`.

        Args:
            action: of the action space; values beyond its bounds are put on them.

        Raises:
            InvalidInputError: wrong shape, not numbers, or NaN; nothing is simulated. Or a reward of your own is not
                finite: call `reset`.
            PhysicsError: there is no episode: call `reset`.
        """
        episode = self._episode
        steps = episode.steps
        if steps is None:
            raise PhysicsError(NO_EPISODE)
        values = clip_action(action, *self._control.bounds)
        self._control.check(values)
        episode.steps = None  # until the step is complete
        episode.action = values
        try:
            velocities = self._control.velocities(episode.view, values)
            if has_pushes(self._values):
                assert self._variation_random is not None
                self._pushes.advance(self._values, self._pushed, self.data.xfrc_applied, self._variation_random)
            if "action_noise" in self._values:
                assert self._variation_random is not None
                velocities = self._disturbed(velocities, self._values, self._variation_random)
            self._simulate(velocities)
        except PhysicsError as error:
            return copy.deepcopy(self._last), 0.0, False, True, {"is_success": False, "error": str(error)}
        observation, reward, success = self._outcome(f" after step {steps + 1}")
        self._show()
        episode.steps = steps + 1
        return observation, reward, False, episode.is_over, self._info(success)

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
        found = self._rewards(State.of_goals(achieved, desired))
        check_rewards(self.options.task, found)
        return float(found) if np.ndim(found) == 0 else found

    def compute_terminated(self, achieved_goal: ArrayLike, desired_goal: ArrayLike, info: object = None) -> bool:
        """False: nothing ends an episode but its time limit."""
        return False

    def compute_truncated(self, achieved_goal: ArrayLike, desired_goal: ArrayLike, info: object = None) -> bool:
        """Whether the time limit is reached."""
        return self._episode.is_over

    def render(self) -> NDArray[Any] | None:
        """A picture, (height, width, 3) uint8, or the depth, (height, width) float32 [m]; None in a window.

        Raises:
            PhysicsError: there is no OpenGL context, or no window can be opened.
        """
        if self.render_mode is None or self.render_mode == "human":
            self._show()
            return None
        height, width = self._size
        if self.render_mode == "depth_array":
            return self._episode.picture(height, width, camera=self._render_camera, kind=DEPTH)[..., 0]
        return self._episode.picture(height, width, camera=self._render_camera, flags={"reflection": False})

    def close(self) -> None:
        """Free what pictures need."""
        self._episode.close()
        if self._window is not None:
            self._window.close()
            self._window = None

    def _rewards(self, state: State) -> Array:
        """The rewards (...) of states, as they were asked for."""
        task, reward = self._episode.task, self.options.reward
        if callable(reward):
            return measured("reward", reward, state)
        return task.score(state) if reward == "dense" else task.is_solved(state).astype(np.float64)

    def _outcome(self, when: str) -> tuple[Observation, float, bool]:
        """The observation, the reward, and whether the task is solved.

        Raises:
            InvalidInputError: the reward is not finite; says `when`.
        """
        state = self._episode.state
        if DELAY in self._values:
            if not self._seen:  # the episode begins
                self._seen.append(self._observe(state))
            late, _ = delay(self._values, DELAY, self._episode.substeps)
            observation = copy.deepcopy(self._seen[max(0, len(self._seen) - 1 - late)])
        else:
            observation = self._observe(state)
        self._packing.disturb(observation, self._values, self._bias, self._deviations, self._variation_random)
        self._last = copy.deepcopy(observation)  # whoever gets it may change it
        reward = float(self._rewards(state))
        check_rewards(self.options.task, reward, when)
        return observation, reward, bool(self._episode.task.is_solved(state))

    def _observe(self, state: State) -> Observation:
        """The observation of now, without noise."""
        observation = self._packing.pack(state)
        return add_pictures(observation, self._pictures()) if self.options.has_camera else observation

    def _simulate(self, velocities: Array) -> None:
        """Simulate a control step; what comes late changes in the middle of it."""
        before, now = self._late(velocities)
        substeps = self._episode.substeps
        _, changed = delay(self._values, "latency", substeps)
        late, early = delay(self._values, DELAY, substeps)
        for start, stop in itertools.pairwise(sorted({0, changed, substeps - early, substeps})):
            self._episode.advance(before if start < changed else now, stop - start)
            if DELAY in self._values and stop == substeps - early:
                self._seen.append(self._observe(self._episode.state))
                if len(self._seen) > late + 1:
                    self._seen.popleft()

    def _pictures(self, data: mujoco.MjData | None = None) -> dict[str, NDArray[np.generic]]:
        """What the cameras see, of this simulation or of another of the model."""
        found = {}
        for name, size in self.options.sizes.items():
            camera, _, kind = name.partition("/")
            found[name] = self._episode.picture(*size, camera=camera, kind=kind, data=data)
        return found

    def _info(self, success: bool) -> Info:
        if self.randomization is None:
            return {"is_success": success}
        return {"is_success": success, "randomization": dict(self._values)}

    def _apply(self, values: dict[str, float], *, is_starting: bool = False) -> None:
        """Give the model these values; those that count from the start of an episode on, while that is drawn."""
        assert self._variation is not None
        self._values = values
        self._variation.apply(values, is_starting=is_starting)

    def _disturbed(self, velocities: Array, values: Mapping[str, float], random_state: np.random.Generator) -> Array:
        """Velocities (n,) with noise, within the limits of the actuators."""
        noisy = velocities + random_state.normal(0.0, values["action_noise"], velocities.shape)
        return np.asarray(np.clip(noisy, self._episode.lower, self._episode.upper))

    def _late(self, velocities: Array) -> tuple[Array, Array]:
        """The velocities asked for some steps ago, and before; none at first."""
        steps, _ = delay(self._values, "latency", self._episode.substeps)
        delayed = self._delayed
        delayed.append(velocities)
        if len(delayed) > steps + 2:
            delayed.popleft()
        before, now = (
            delayed[-1 - ago] if len(delayed) > ago else np.zeros_like(velocities) for ago in (steps + 1, steps)
        )
        return before, now

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
            "render": {
                "render_mode": self.render_mode,
                "height": height,
                "width": width,
                "render_camera": self._render_camera,
            },
            "random": (self._np_random, self._np_random_seed, self._variation_random),
            "spec": self.spec,
            "control": self._control,
            "snapshot": self._episode.snapshot(),
            "randomization": self.randomization,
            "values": self._values,
            "delayed": deque(self._delayed),
            "bias": self._bias,
            "seen": copy.deepcopy(self._seen),
            "deviations": self._deviations,
            "pushed": self._pushed.copy(),
            "last": getattr(self, "_last", None),
            "entry": registry.own_entry(self.options.task),
        }

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Compile the scene and go on."""
        options: EnvOptions = state["options"]
        registry.receive(options.task, state["entry"])
        fields = {name: getattr(options, name) for name in options.__slots__}
        self.__init__(**fields, randomization=state["randomization"], **state["render"])  # type: ignore[misc]  # an object without state is made as usual
        self._np_random, self._np_random_seed, self._variation_random = state["random"]
        self.spec = state["spec"]
        self._control = state["control"]
        self._delayed = state["delayed"]
        self._bias, self._deviations = state["bias"], state["deviations"]
        self._seen, self._pushed = state["seen"], state["pushed"]
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
        """A second environment in the same state: two cannot share a simulation, so this is `copy.deepcopy`."""
        return self.__deepcopy__({})


class Window:
    """MuJoCo's own viewer of a simulation, which what is done in it with the mouse does not reach."""

    def __init__(self, model: mujoco.MjModel) -> None:
        """Open it.

        Raises:
            PhysicsError: there is no display, or on macOS the program does not run under ``mjpython``.
        """
        check_display()
        import glfw  # comes with MuJoCo; asked first, because its viewer waits for ever where this fails
        import mujoco.viewer

        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # glfw warns of what is raised here
            if sys.platform != "darwin" and not glfw.init():
                raise PhysicsError("no window can be opened on the display; use 'rgb_array' and MUJOCO_GL=egl")
        self._model, self._shown = model, mujoco.MjData(model)
        before = set(threading.enumerate())
        try:
            self._handle = mujoco.viewer.launch_passive(model, self._shown, show_left_ui=False, show_right_ui=False)
        except RuntimeError as error:
            raise PhysicsError(f"no window can be opened: {error}") from error
        self._threads = set(threading.enumerate()) - before
        # MuJoCo ends its graphics when Python exits, and crashes where the thread of a window still draws.
        atexit.register(self.close)

    def show(self, data: mujoco.MjData) -> None:
        """Draw a state; nothing, once the window was closed by hand."""
        mujoco.mj_copyData(self._shown, self._model, data)
        self._handle.sync()

    def close(self) -> None:
        """Close it and wait for its thread; may be called again."""
        atexit.unregister(self.close)
        self._handle.close()
        for thread in self._threads:
            thread.join(5.0)  # [s]


def is_usable(render_mode: str) -> bool:
    """Whether the system has what a render mode needs: a display, or for pictures a renderer without one."""
    return has_display() or (render_mode != "human" and os.environ.get("MUJOCO_GL", "").lower() in ("egl", "osmesa"))


def check_display() -> None:
    """Refuse a window where the system names no display.

    Raises:
        PhysicsError: it does not.
    """
    if not is_usable("human"):
        raise PhysicsError("render_mode='human' needs a display; without one use 'rgb_array' and MUJOCO_GL=egl")


class FunctionSpec(EnvSpec):
    """The specification of an environment whose reward is a function."""

    def to_json(self) -> str:
        """Refuse.

        Raises:
            InvalidInputError: always: JSON keeps no functions.
        """
        raise InvalidInputError(
            f"the specification of {self.id} holds a function, reward={shown(self.kwargs['reward'])}, which JSON "
            "cannot keep: register a task with this reward, or pickle the environment"
        )


def checked_spec(spec: EnvSpec | None) -> EnvSpec | None:
    """The specification, as one that says why JSON cannot keep it if it holds a function."""
    if spec is None or not callable(spec.kwargs.get("reward")):
        return spec
    found = copy.copy(spec)
    found.__class__ = FunctionSpec
    return found


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
