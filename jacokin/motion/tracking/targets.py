"""What the tracker can be asked for: poses, parts of poses, regions, on any frame, with weights; and their tasks.

Each target constrains one frame; `Tracker.step` takes one of them or several at once. All are in the base frame.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.ik import targets
from jacokin.model import checks, poses
from jacokin.motion.tracking.tasks import AxisTask, Kinematics, PoseTask, PositionTask, RegionTask, Task

RIGID = 1e-9  # a pose this near to rigid is used as it is; others are checked and made rigid


@dataclass(frozen=True, slots=True, eq=False)
class TrackingTarget(targets.PartialTarget):
    """What all targets share.

    Attributes:
        frame: the frame it is for; None for the tracker's own frame (with its tool).
        weight: how much it counts against other targets, > 0.
    """

    frame: str | None = field(default=None, kw_only=True)
    weight: float = field(default=1.0, kw_only=True)

    def __post_init__(self) -> None:
        """Check the weight."""
        object.__setattr__(self, "weight", checks.positive("weight", self.weight))

    def make_task(self, frame: int) -> Task:
        """The task for the tracker, on a frame by its number."""
        raise InvalidInputError(f"unknown kind of target {type(self).__name__}")


@dataclass(frozen=True, slots=True, eq=False)
class PoseTarget(TrackingTarget):
    """Position and orientation: T_base_frame as `pin.SE3` or (4, 4)."""

    pose: pin.SE3 | ArrayLike

    def __post_init__(self) -> None:
        """Check the pose."""
        TrackingTarget.__post_init__(self)
        object.__setattr__(self, "pose", poses.checked_pose(self.pose, "pose"))

    def constraint(self) -> targets.Constraint:
        """Position and orientation."""
        assert isinstance(self.pose, pin.SE3)  # __post_init__ made it one
        return targets.Constraint(position=self.pose.translation.copy(), rotation=self.pose.rotation.copy())

    def make_task(self, frame: int) -> Task:
        """Position and orientation."""
        assert isinstance(self.pose, pin.SE3)  # __post_init__ made it one
        task = PoseTask(frame, self.weight)
        task.set(self.pose)
        return task


@dataclass(frozen=True, slots=True, eq=False)
class PositionTarget(TrackingTarget):
    """Position (3,) [m]; the orientation is free."""

    position: ArrayLike

    def __post_init__(self) -> None:
        """Check the position."""
        TrackingTarget.__post_init__(self)
        object.__setattr__(self, "position", checks.read_only(checks.vector("position", self.position, 3, "m")))

    def constraint(self) -> targets.Constraint:
        """The position."""
        return targets.Constraint(position=np.asarray(self.position))

    def make_task(self, frame: int) -> Task:
        """Position alone."""
        return PositionTask(frame, self.weight, np.asarray(self.position))


@dataclass(frozen=True, slots=True, eq=False)
class OrientationTarget(TrackingTarget):
    """Orientation (3, 3); the position is free."""

    rotation: ArrayLike

    def __post_init__(self) -> None:
        """Check the rotation."""
        TrackingTarget.__post_init__(self)
        object.__setattr__(self, "rotation", checks.read_only(poses.checked_rotation("rotation", self.rotation)))

    def constraint(self) -> targets.Constraint:
        """The orientation."""
        return targets.Constraint(rotation=np.asarray(self.rotation))

    def make_task(self, frame: int) -> Task:
        """Orientation alone."""
        task = PoseTask(frame, self.weight, orientation_only=True)
        task.set(pin.SE3(np.asarray(self.rotation), np.zeros(3)))
        return task


@dataclass(frozen=True, slots=True, eq=False)
class AxisTarget(TrackingTarget):
    """One axis of the frame points in a direction; the rotation about it and the position are free.

    Attributes:
        direction: (3,) where the axis is to point, in the base frame; any length but zero.
        axis: (3,) the axis, in the frame; the z axis unless told otherwise.
    """

    direction: ArrayLike
    axis: ArrayLike = (0.0, 0.0, 1.0)

    def __post_init__(self) -> None:
        """Check and normalise both vectors."""
        TrackingTarget.__post_init__(self)
        object.__setattr__(self, "direction", _unit("direction", self.direction))
        object.__setattr__(self, "axis", _unit("axis", self.axis))

    def constraint(self) -> targets.Constraint:
        """The direction of the axis."""
        return targets.Constraint(axis=np.asarray(self.axis), direction=np.asarray(self.direction))

    def make_task(self, frame: int) -> Task:
        """Two directions aligned."""
        return AxisTask(frame, self.weight, np.asarray(self.axis), np.asarray(self.direction))


@dataclass(frozen=True, slots=True, eq=False)
class RegionTarget(TrackingTarget):
    """The position stays in a box along the base's axes; inside it, the position is free.

    Attributes:
        lower: (3,) corner with the least coordinates [m]; -inf for no bound.
        upper: (3,) corner with the largest coordinates [m]; inf for no bound.
    """

    lower: ArrayLike
    upper: ArrayLike

    def __post_init__(self) -> None:
        """Check the corners."""
        TrackingTarget.__post_init__(self)
        corners = []
        for name in ("lower", "upper"):
            value = getattr(self, name)
            try:
                corner = checks.read_only(checks.numbers(value))
            except (TypeError, ValueError) as error:
                raise InvalidInputError(f"{name} must be 3 numbers [m], got {checks.shown(value)}") from error
            if corner.shape != (3,) or np.isnan(corner).any():
                raise InvalidInputError(f"{name} must be 3 numbers [m], got {checks.shown(value)}")
            object.__setattr__(self, name, corner)
            corners.append(corner)
        if not (corners[0] <= corners[1]).all():
            raise InvalidInputError(f"lower {corners[0].tolist()} must not exceed upper {corners[1].tolist()}")

    def make_task(self, frame: int) -> Task:
        """Position in the box."""
        return RegionTask(frame, self.weight, np.asarray(self.lower), np.asarray(self.upper))


class TaskFactory:
    """Makes tasks from what `Tracker.step` takes; the one for a plain pose is built once."""

    def __init__(self, kinematics: Kinematics) -> None:
        """Keep the kinematics for its frames."""
        self._kinematics = kinematics
        self._pose = PoseTask(kinematics.tool, 1.0)

    def tasks(self, target: pin.SE3 | ArrayLike | TrackingTarget | Sequence[TrackingTarget] | None) -> list[Task]:
        """Tasks for a target or several; errors as in `Tracker.step`."""
        if isinstance(target, pin.SE3):
            self._pose.set(target if _rigid(target) else poses.checked_pose(target))
            return [self._pose]
        if isinstance(target, TrackingTarget):
            return [self._task(target)]
        if isinstance(target, list | tuple) and any(isinstance(one, TrackingTarget) for one in target):
            return [self._task(one) for one in target]
        checked = targets.checked(target)  # refuses what is neither a pose nor a position
        if checked.position_only:
            return [self._task(PositionTarget(checked.position))]
        self._pose.set(pin.SE3(checked.rotation, checked.position))
        return [self._pose]

    def _task(self, target: TrackingTarget) -> Task:
        if not isinstance(target, TrackingTarget):
            raise InvalidInputError(
                f"several targets must each be a PoseTarget, PositionTarget, ..., got {type(target).__name__}"
            )
        return target.make_task(self._kinematics.frame(target.frame))


def _rigid(pose: pin.SE3) -> bool:
    """Whether a pose is finite, right-handed and orthonormal to 1e-9; cheap, as every tick asks it."""
    (a, b, c), (d, e, f), (g, h, i) = pose.rotation.tolist()
    x, y, z = pose.translation.tolist()
    misfit: float = (
        abs(a * a + b * b + c * c - 1.0)
        + abs(d * d + e * e + f * f - 1.0)
        + abs(a * d + b * e + c * f)
        + abs(b * f - c * e - g)
        + abs(c * d - a * f - h)
        + abs(a * e - b * d - i)
    )
    return bool(misfit < RIGID and abs(x) + abs(y) + abs(z) < 1e9)


def _unit(name: str, value: ArrayLike) -> Array:
    """A vector (3,) scaled to length one."""
    vector = checks.vector(name, value, 3, "any unit")
    length = float(np.linalg.norm(vector))
    if not length > 0.0:
        raise InvalidInputError(f"{name} must not be zero")
    return checks.read_only(vector / length)
