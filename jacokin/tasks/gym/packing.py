"""`EnvOptions`, what a Gymnasium environment was asked for, and `Packing`, the observations that follow from them.

Observations are one array or a dictionary, of one simulation or of many.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, cast

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.model import checks
from jacokin.mujoco_bridge.arena import CONTACTS, FIRM
from jacokin.tasks import registry
from jacokin.tasks.episode import DEPTH, PICTURE, SEGMENTATION
from jacokin.tasks.features import StateView
from jacokin.tasks.gym.controls import CONTROLS
from jacokin.tasks.randomization import FEATURE_BIAS, FEATURE_NOISE
from jacokin.tasks.task import CAMERA, CAMERAS, CONTROL_TIMESTEP, PHYSICS_TIMESTEP, Measure, State, Task

Observation = Array | dict[str, NDArray[Any]]
LONGEST_STEP = 1.0  # [s]
PROPRIOCEPTION = "proprioception"  # key of the features of the robot beside a picture
OBSERVATION = "observation"  # key of all features beside goals


@dataclass(frozen=True, slots=True)
class EnvOptions:
    """What distinguishes the environments of one task; checked when they are made.

    Attributes:
        task: name of the task.
        control: what actions mean: one of `controls.CONTROLS`, such as "joint_velocity" or "tool_pose".
        reward: "dense", the task's, "sparse", 1 when it is solved and 0 otherwise, or a function of a `State`.
        goal: whether observations contain what is achieved and desired.
        observations: "features", or "vision": a picture, and of the features those of the robot.
        flatten: whether the features are one array; otherwise a dictionary by name.
        cameras: sizes (height, width) of the pictures by the name of the camera, with "/depth" or "/segmentation" after
            it for those; None for the reference's.
        control_timestep: time between two actions [s].
        contact: how friction is solved: "firm" or "dm_control".
    """

    task: str
    control: str = "joint_velocity"
    reward: str | Measure = "dense"
    goal: bool = False
    observations: str = registry.FEATURES
    flatten: bool = True
    cameras: Mapping[str, tuple[int, int]] | None = field(default=None, hash=False)
    control_timestep: float = CONTROL_TIMESTEP
    contact: str = FIRM

    def __post_init__(self) -> None:
        """Check the options.

        Raises:
            UnknownNameError: an unknown task or option; lists the valid ones.
            InvalidInputError: options that do not go together, or the module of the task cannot be imported.
        """
        object.__setattr__(self, "task", registry.imported(self.task))
        entry = registry.TASKS[checks.choice("task", self.task, registry.TASKS)]
        checks.choice("control", self.control, CONTROLS)
        if not callable(self.reward):
            checks.choice("reward", self.reward, ("dense", "sparse"))
        checks.choice("contact", self.contact, CONTACTS)
        checks.flag("goal", self.goal)
        checks.flag("flatten", self.flatten)
        checks.choice("observations", self.observations, registry.OBSERVATIONS)
        if self.observations not in entry.observations:
            raise InvalidInputError(
                f"{self.task} cannot be observed by {self.observations!r}: a picture does not show which order is "
                f"wanted. Valid: {', '.join(entry.observations)}"
            )
        if self.goal and not (self.flatten and self.observations == registry.FEATURES):
            raise InvalidInputError("goal=True needs observations='features' and flatten=True")

        timestep = checks.positive("control_timestep", self.control_timestep, "s")
        substeps = round(timestep / PHYSICS_TIMESTEP)
        is_multiple = abs(timestep - substeps * PHYSICS_TIMESTEP) <= 1e-9  # rounding
        if not is_multiple or not PHYSICS_TIMESTEP <= timestep <= LONGEST_STEP:
            raise checks.refusal(
                "control_timestep", f"a multiple of {PHYSICS_TIMESTEP:g} s up to {LONGEST_STEP:g} s", timestep, "s"
            )
        object.__setattr__(self, "control_timestep", timestep)
        if self.cameras is not None:
            if not self.has_camera:
                raise InvalidInputError("cameras need observations='vision'")
            given = checks.mapping("cameras", self.cameras, "a dict of sizes by name")
            object.__setattr__(self, "cameras", {name: _size(name, size) for name, size in given.items()})

    @property
    def sizes(self) -> Mapping[str, tuple[int, int]]:
        """Sizes (height, width) of the pictures that are observed, by the name of the camera [pixels]."""
        if not self.has_camera:
            return {}
        return {CAMERA: (PICTURE, PICTURE)} if self.cameras is None else self.cameras

    @property
    def has_camera(self) -> bool:
        """Whether a picture is observed."""
        return self.observations == registry.VISION


class Packing:
    """Puts features together.

    Attributes:
        space: of the observations of one environment.
        goal_size: how many numbers are achieved, and desired.
    """

    def __init__(self, task: Task, options: EnvOptions) -> None:
        """Prepare for a task that has been reset."""
        self._task = task
        self._options = options
        self._features = [each for each in task.features if each.is_proprioceptive or not options.has_camera]
        ends = np.cumsum([int(np.prod(each.shape)) for each in self._features]).tolist()
        self._slices = [slice(start, end) for start, end in zip([0, *ends[:-1]], ends, strict=True)]
        self._size = ends[-1]
        view, goal = StateView.of(task.physics.data), np.zeros(task.goal_size)
        self.goal_size = int(task.achieved(view, goal).shape[-1])
        if options.goal and not self.goal_size:
            raise InvalidInputError(f"goal=True needs a task with achieved= and desired=, which {options.task!r} lacks")
        self.space = self._space()

    def _space(self) -> spaces.Space[Any]:
        options = self._options
        flat = _box(self._size)
        if options.goal:
            return spaces.Dict(
                {OBSERVATION: flat, "achieved_goal": _box(self.goal_size), "desired_goal": _box(self.goal_size)}
            )
        if options.flatten and not options.has_camera:
            return flat
        found: dict[str, spaces.Space[Any]] = {}
        for name, size in options.sizes.items():
            found[name] = self._picture_space(name, size)
        if options.flatten:
            found[PROPRIOCEPTION] = flat
        else:
            found.update({each.name: _box(*each.shape) for each in self._features})
        # Of a dictionary Gymnasium sorts the names, of pairs it keeps their order: that of `pack`, flat or not.
        return spaces.Dict(list(found.items()))

    def _picture_space(self, name: str, size: tuple[int, int]) -> spaces.Box:
        kind = name.partition("/")[2]
        if kind == DEPTH:
            return spaces.Box(0.0, np.inf, (*size, 1), np.float32)
        if kind == SEGMENTATION:
            return spaces.Box(-1, int(self._task.physics.model.ngeom) - 1, (*size, 1), np.int32)
        return spaces.Box(0, 255, (*size, 3), np.uint8)

    @functools.cached_property
    def names(self) -> tuple[str, ...]:
        """The name of each number of ``gymnasium.spaces.flatten(space, observation)``, which a flat observation is."""
        if not isinstance(self.space, spaces.Dict):
            return self.names_of(OBSERVATION)
        return tuple(name for key in self.space.spaces for name in self.names_of(key))

    def names_of(self, key: str) -> tuple[str, ...]:
        """The name of each number of a part of the observation: that of its feature, and where in it the number is.

        Args:
            key: of the part; that of a flat observation is "observation".
        """
        if self._options.flatten and key in (OBSERVATION, PROPRIOCEPTION):
            return tuple(name for each in self._features for name in number_names(each.name, each.shape))
        shape = cast(spaces.Dict, self.space)[key].shape
        assert shape is not None  # a Box
        return number_names(key, shape)

    def pack(self, state: State) -> Observation:
        """The observation, as new arrays, without the picture, of one simulation or of n."""
        options, view, goal = self._options, state.view, state.goal
        if not options.flatten:
            return {each.name: np.array(each.value(view, goal), dtype=np.float64) for each in self._features}
        leading = view.qpos.shape[:-1]
        flat = np.empty((*leading, self._size))
        for each, where in zip(self._features, self._slices, strict=True):
            value = each.value(view, goal)
            flat[..., where] = value if len(each.shape) == 1 else value.reshape(*leading, -1)
        if options.goal:
            return {
                OBSERVATION: flat,
                "achieved_goal": np.array(state.achieved),
                "desired_goal": np.array(state.desired),
            }
        return {PROPRIOCEPTION: flat} if options.has_camera else flat

    def disturb(
        self,
        observation: Observation,
        values: Mapping[str, float],
        bias: Array,
        deviations: Array,
        random_state: np.random.Generator | None,
    ) -> None:
        """Add bias and noise to the features of one environment and to what it achieves, in place.

        Args:
            observation: of the environment.
            values: of its randomization.
            bias: as of `draw_bias`.
            deviations: as of `deviations`.
            random_state: draws the noise; None where nothing is random.
        """
        if random_state is None:
            return
        self._add(observation, bias)
        if len(deviations):
            self._add(observation, deviations * random_state.normal(size=len(deviations)))
        if "observation_noise" in values:
            for each in self._noisy(observation):
                each += random_state.normal(0.0, values["observation_noise"], each.shape)

    def draw_bias(self, values: Mapping[str, float], random_state: np.random.Generator) -> Array:
        """What `disturb` adds all through an episode with these values; (0,) for nothing."""
        size, found = self._size + self.goal_size * self._options.goal, np.zeros(0)
        if "observation_bias" in values:
            found = random_state.normal(0.0, values["observation_bias"], size)
        deviations = self.deviations(values, FEATURE_BIAS)
        if len(deviations):
            found = (found if len(found) else np.zeros(size)) + deviations * random_state.normal(size=size)
        return np.asarray(found)

    def _add(self, observation: Observation, bias: Array) -> None:
        start = 0
        for values in self._noisy(observation) if len(bias) else ():
            values += bias[start : start + values.size].reshape(values.shape)
            start += values.size

    def deviations(self, values: Mapping[str, float], field: str = FEATURE_NOISE) -> Array:
        """Deviations of the noise, or the bias, of single features, for as many normal numbers; (0,) without any.

        Raises:
            UnknownNameError: that of something that is not observed; lists what is.
        """
        prefix = f"{field}/"
        noisy = {name.removeprefix(prefix): value for name, value in values.items() if name.startswith(prefix)}
        if not noisy:
            return np.zeros(0)
        slices = {each.name: where for each, where in zip(self._features, self._slices, strict=True)}
        if self._options.goal:
            slices["achieved_goal"] = slice(self._size, self._size + self.goal_size)
        found = np.zeros(self._size + self.goal_size * self._options.goal)
        for name, value in noisy.items():
            found[slices[checks.choice("feature", name, slices)]] = value
        return found

    def _noisy(self, observation: Observation) -> list[NDArray[Any]]:
        """The arrays of an observation that are measured."""
        if isinstance(observation, np.ndarray):
            return [observation]
        names = ["observation", "achieved_goal"] if self._options.goal else [PROPRIOCEPTION]
        return [observation[name] for name in (names if self._options.flatten else [f.name for f in self._features])]


def number_names(name: str, shape: tuple[int, ...]) -> tuple[str, ...]:
    """The names of the numbers of an array: ``position.0``, ``joints_pos.5.1``; rows one after another."""
    return tuple(".".join((name, *map(str, index))) for index in np.ndindex(*shape))


def add_pictures(observation: Observation, pictures: Mapping[str, NDArray[Any]]) -> Observation:
    """The observation with the pictures in front."""
    assert isinstance(observation, dict)
    return {**pictures, **observation}


def _size(name: str, size: Any) -> tuple[int, int]:
    pictures = [f"{camera}{kind}" for kind in ("", f"/{DEPTH}", f"/{SEGMENTATION}") for camera in CAMERAS]
    checks.choice("camera", name, pictures)
    if not isinstance(size, tuple | list) or len(size) != 2:
        raise checks.refusal(f"the size of camera {name!r}", "(height, width)", size, "pixels")
    # MuJoCo's buffer has room for 480.
    height, width = (checks.whole_number(f"the size of camera {name!r}", each, 1, 480) for each in size)
    return height, width


def _box(*shape: int) -> spaces.Box:
    return spaces.Box(-np.inf, np.inf, shape, np.float64)


def row(observations: Observation, index: int) -> Observation:
    """The observation of one environment: views."""
    if isinstance(observations, np.ndarray):
        return np.asarray(observations[index])
    return {name: value[index] for name, value in observations.items()}


def put(observations: Observation, index: int, observation: Observation) -> None:
    """Write the observation of one environment."""
    if isinstance(observations, np.ndarray):
        observations[index] = np.asarray(observation)
    else:
        for name, value in cast(Mapping[str, Any], observation).items():
            observations[name][index] = value
