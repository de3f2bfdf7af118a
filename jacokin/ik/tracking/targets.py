"""What the tracker can be asked for besides a pose: parts of a pose, a region, other frames, weights.

Each target constrains one frame; `Tracker.step` takes one of them or several at once. All are in the base frame.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.model import checks, poses


@dataclass(frozen=True, slots=True, eq=False)
class TrackingTarget:
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


@dataclass(frozen=True, slots=True, eq=False)
class PoseTarget(TrackingTarget):
    """Position and orientation: T_base_frame as `pin.SE3` or (4, 4)."""

    pose: pin.SE3 | ArrayLike

    def __post_init__(self) -> None:
        """Check the pose."""
        TrackingTarget.__post_init__(self)
        object.__setattr__(self, "pose", poses.checked_pose(self.pose, "pose"))


@dataclass(frozen=True, slots=True, eq=False)
class PositionTarget(TrackingTarget):
    """Position (3,) [m]; the orientation is free."""

    position: ArrayLike

    def __post_init__(self) -> None:
        """Check the position."""
        TrackingTarget.__post_init__(self)
        object.__setattr__(self, "position", checks.read_only(checks.vector("position", self.position, 3, "m")))


@dataclass(frozen=True, slots=True, eq=False)
class OrientationTarget(TrackingTarget):
    """Orientation (3, 3); the position is free."""

    rotation: ArrayLike

    def __post_init__(self) -> None:
        """Check the rotation."""
        TrackingTarget.__post_init__(self)
        object.__setattr__(self, "rotation", checks.read_only(poses.checked_rotation("rotation", self.rotation)))


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


def _unit(name: str, value: ArrayLike) -> Array:
    """A vector (3,) scaled to length one."""
    vector = checks.vector(name, value, 3, "any unit")
    length = float(np.linalg.norm(vector))
    if not length > 0.0:
        raise InvalidInputError(f"{name} must not be zero")
    return checks.read_only(vector / length)
