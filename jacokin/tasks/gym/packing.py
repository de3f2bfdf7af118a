"""`EnvOptions`, what a Gymnasium environment was asked for, and `Packing`, the observations that follow from them.

Observations are one array or a dictionary, of one simulation or of many.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.model import checks
from jacokin.tasks import registry
from jacokin.tasks.episode import PICTURE
from jacokin.tasks.features import StateView
from jacokin.tasks.gym.controls import CONTROLS
from jacokin.tasks.task import CAMERA, Task

Observation = Array | dict[str, NDArray[Any]]
REWARDS = ("dense", "sparse")
PROPRIOCEPTION = "proprioception"  # key of the features of the robot beside a picture


@dataclass(frozen=True, slots=True)
class EnvOptions:
    """What distinguishes the environments of one task; checked when they are made.

    Attributes:
        task: name of the task.
        control: what actions mean: "joint_velocity", "tool_velocity" or "tool_pose".
        reward: "dense", the reference's, or "sparse", 1 when the task is solved and 0 otherwise.
        goal: whether observations contain what is achieved and desired.
        observations: "features", or "vision": a picture, and of the features those of the robot.
        flatten: whether the features are one array; otherwise a dictionary by name.
    """

    task: str
    control: str = "joint_velocity"
    reward: str = "dense"
    goal: bool = False
    observations: str = registry.FEATURES
    flatten: bool = True

    def __post_init__(self) -> None:
        """Check the options.

        Raises:
            UnknownNameError: an unknown task or option; lists the valid ones.
            InvalidInputError: options that do not go together.
        """
        entry = registry.TASKS[checks.choice("task", self.task, registry.TASKS)]
        checks.choice("control", self.control, CONTROLS)
        checks.choice("reward", self.reward, REWARDS)
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
        self.space = self._space()

    def _space(self) -> spaces.Space[Any]:
        options = self._options
        flat = _box(self._size)
        if options.goal:
            return spaces.Dict(
                {"observation": flat, "achieved_goal": _box(self.goal_size), "desired_goal": _box(self.goal_size)}
            )
        if options.flatten and not options.has_camera:
            return flat
        found: dict[str, spaces.Space[Any]] = {}
        if options.has_camera:
            found[CAMERA] = spaces.Box(0, 255, (PICTURE, PICTURE, 3), np.uint8)
        if options.flatten:
            found[PROPRIOCEPTION] = flat
        else:
            found.update({each.name: _box(*each.shape) for each in self._features})
        return spaces.Dict(found)

    def pack(self, view: StateView, goal: Array, achieved: Array, desired: Array) -> Observation:
        """The observation, as new arrays, without the picture.

        Args:
            view: of one simulation, or of n.
            goal: (goal_size,), or (n, goal_size).
            achieved: what is achieved.
            desired: what is desired.
        """
        options = self._options
        if not options.flatten:
            return {each.name: np.array(each.read(view, goal)) for each in self._features}
        leading = view.qpos.shape[:-1]
        flat = np.empty((*leading, self._size))
        for each, where in zip(self._features, self._slices, strict=True):
            value = each.read(view, goal)
            flat[..., where] = value if len(each.shape) == 1 else value.reshape(*leading, -1)
        if options.goal:
            return {"observation": flat, "achieved_goal": np.array(achieved), "desired_goal": np.array(desired)}
        return {PROPRIOCEPTION: flat} if options.has_camera else flat

    def add_noise(self, observation: Observation, deviation: float, random_state: np.random.Generator) -> None:
        """Add normal noise to the features of one environment and to what it achieves, in place."""
        if isinstance(observation, np.ndarray):
            observation += random_state.normal(0.0, deviation, observation.shape)
            return
        names = ["observation", "achieved_goal"] if self._options.goal else [PROPRIOCEPTION]
        for name in names if self._options.flatten else [each.name for each in self._features]:
            observation[name] += random_state.normal(0.0, deviation, observation[name].shape)


def add_picture(observation: Observation, picture: NDArray[Any]) -> Observation:
    """The observation with the picture in front."""
    assert isinstance(observation, dict)
    return {CAMERA: picture, **observation}


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
