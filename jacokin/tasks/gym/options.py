"""The options of the Gymnasium environments, checked once."""

from __future__ import annotations

from dataclasses import dataclass

from jacokin.errors import InvalidInputError
from jacokin.model import checks
from jacokin.tasks import registry

CONTROLS = ("joint_velocity", "tool_velocity", "tool_pose")
REWARDS = ("dense", "sparse")
RENDER_MODES = ("rgb_array", "human", "depth_array")


@dataclass(frozen=True, slots=True)
class Options:
    """What distinguishes the environments of one task.

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
