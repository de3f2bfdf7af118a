"""Targets, checked once: a pose, or a position whose orientation is free."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple, TypeAlias

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, shown
from jacokin.model import checks, poses
from jacokin.model.poses import FreeAxis


class TargetPose(NamedTuple):
    """A checked target in the base frame."""

    matrix: Array
    """(4, 4) T_base_tool; its rotation means nothing when `position_only`."""
    position_only: bool
    """True when the orientation is free."""

    @property
    def position(self) -> Array:
        """(3,) position of the tool [m]."""
        return self.matrix[:3, 3]

    @property
    def rotation(self) -> Array:
        """(3, 3) orientation of the tool."""
        return self.matrix[:3, :3]

    def moved_to(self, position: Array) -> TargetPose:
        """The same target at another position (3,) [m]."""
        matrix = self.matrix.copy()
        matrix[:3, 3] = position
        return TargetPose(matrix, self.position_only)


class Constraint(NamedTuple):
    """What a part of a target fixes, in the base frame; None where it is free."""

    position: Array | None = None
    """(3,) [m]."""
    rotation: Array | None = None
    """(3, 3)."""
    axis: Array | None = None
    """(3,) axis of the tool, a unit vector in its frame, that points in a direction."""
    direction: Array | None = None
    """(3,) that direction, a unit vector."""


class PartialTarget:
    """A target that may leave something free; the targets of the tracker are."""

    __slots__ = ()

    frame: str | None

    def constraint(self) -> Constraint:
        """What it fixes.

        Raises:
            InvalidInputError: the target is not of a kind that inverse kinematics solves for.
        """
        raise InvalidInputError(f"{type(self).__name__} is for the tracker only")


#: What solving takes.
Target: TypeAlias = pin.SE3 | ArrayLike | FreeAxis | PartialTarget | Sequence[PartialTarget]


def combined(parts: Sequence[PartialTarget], frame: str) -> TargetPose | FreeAxis:
    """One target from its parts: a pose; a position; or a position and an axis, about which the tool may turn.

    Args:
        parts: what fixes the target, all for one frame.
        frame: the solver's frame.

    Raises:
        InvalidInputError: parts of another frame, two of a kind, or a position that is free.
    """
    fixed: dict[str, Array] = {}
    for part in parts:
        if part.frame not in (None, frame):
            raise InvalidInputError(f"{type(part).__name__} is for frame {part.frame!r}, the solver is for {frame!r}")
        for name, value in part.constraint()._asdict().items():
            if value is not None and fixed.setdefault(name, value) is not value:
                raise InvalidInputError(f"two targets fix the {name}; give one")
    if "position" not in fixed:
        raise InvalidInputError("the position is free: give a PositionTarget besides")
    if "rotation" in fixed and "axis" in fixed:
        raise InvalidInputError("both an orientation and an axis are given; the orientation says it all")
    if "axis" in fixed:
        rotation = rotation_between(fixed["axis"], fixed["direction"])
        return FreeAxis(pin.SE3(rotation, fixed["position"]), axis=fixed["axis"])
    matrix = _at(fixed["position"])
    if "rotation" in fixed:
        matrix[:3, :3] = fixed["rotation"]
    return TargetPose(matrix, position_only="rotation" not in fixed)


def rotation_between(axis: Array, direction: Array) -> Array:
    """A rotation (3, 3) that takes one unit vector (3,) to another."""
    quaternion = pin.Quaternion.FromTwoVectors(np.asarray(axis), np.asarray(direction))
    return np.asarray(quaternion.toRotationMatrix(), dtype=np.float64)


def understood(target: Target, frame: str) -> TargetPose | FreeAxis:
    """What a solver for a frame is asked for.

    Raises:
        InvalidInputError: not a target, or its parts do not make one.
    """
    if isinstance(target, pin.SE3):
        return TargetPose(poses.checked_matrix("target", target.homogeneous), position_only=False)
    if isinstance(target, FreeAxis):
        return target
    if isinstance(target, PartialTarget):
        return combined([target], frame)
    if isinstance(target, list | tuple) and target and isinstance(target[0], PartialTarget):
        if not all(isinstance(part, PartialTarget) for part in target):
            raise InvalidInputError("a sequence of targets must hold targets of the tracker only")
        return combined(target, frame)
    return checked(target)


def checked(target: pin.SE3 | ArrayLike, name: str = "target") -> TargetPose:
    """A target from a `pin.SE3`, a homogeneous matrix (4, 4), or a position (3,) [m].

    Raises:
        InvalidInputError: anything else, not finite, or not rigid.
    """
    if not isinstance(target, pin.SE3):
        try:
            target = checks.numbers(target)
        except (TypeError, ValueError) as error:
            raise InvalidInputError(
                f"{name} must be a pin.SE3, a (4, 4) matrix or a (3,) position, got {shown(target)}"
            ) from error
        if target.ndim == 1:
            return TargetPose(_at(checks.vector(name, target, 3, "m")), position_only=True)
    return TargetPose(poses.matrix_of(target, name), position_only=False)


def checked_batch(
    targets: Sequence[pin.SE3 | FreeAxis] | ArrayLike,
) -> tuple[Array, NDArray[np.bool_], dict[int, FreeAxis]]:
    """Targets of a batch: poses (n, 4, 4), positions (n, 3), or a sequence of what `checked` takes.

    Returns:
        (n, 4, 4) matrices, (n,) where the orientation is free, and the rows that may turn about an axis.

    Raises:
        InvalidInputError: empty, or a target is malformed; names its row.
    """
    if isinstance(targets, np.ndarray) and targets.ndim == 3 and targets.shape[1:] == (4, 4) and len(targets):
        try:
            numbers = checks.numbers(targets)
        except TypeError as error:
            raise InvalidInputError(f"targets must be real numbers, got dtype {targets.dtype}") from error
        matrices = poses.checked_matrices("targets", np.array(numbers, order="C"))
        return matrices, np.zeros(len(matrices), dtype=np.bool_), {}
    try:
        rows = list(targets)  # type: ignore[arg-type]  # whatever cannot be listed is refused below
    except TypeError as error:
        raise InvalidInputError(f"targets must be a sequence of poses, got {shown(targets)}") from error
    if not rows:
        raise InvalidInputError("targets is empty")
    free = {index: row for index, row in enumerate(rows) if isinstance(row, FreeAxis)}
    each = [
        TargetPose(free[index].matrix, position_only=False) if index in free else checked(row, f"targets[{index}]")
        for index, row in enumerate(rows)
    ]
    return np.array([target.matrix for target in each]), np.array([target.position_only for target in each]), free


def _at(position: Array) -> Array:
    matrix = np.eye(4)
    matrix[:3, 3] = position
    return matrix


#: [m/rad] An orientation error of one radian counts as much as this position error. It is the order of the distance
#: from the arm's tool frame to its fingertips; there is no source for the figure.
RADIAN_IN_METRES = 0.1
SQRT_8 = math.sqrt(8.0)


def pose_errors(T_base_tool: pin.SE3, target: TargetPose) -> tuple[float, float]:
    """Distance [m] and angle [rad] between the tool and the target; the angle is 0 when the orientation is free."""
    difference = T_base_tool.homogeneous - target.matrix
    (a, b, c, x), (d, e, f, y), (g, h, k, z), _ = difference.tolist()
    position = math.hypot(x, y, z)
    if target.position_only:
        return position, 0.0
    chord = math.hypot(a, b, c, d, e, f, g, h, k)  # |R - R_target|_F = sqrt(8) sin(angle / 2)
    if chord < 1.0:
        return position, 2.0 * math.asin(chord / SQRT_8)
    return position, poses.rotation_angle(T_base_tool.rotation.T @ target.rotation)  # accurate near half a turn


def combined_error(position: float, orientation: float) -> float:
    """One measure [m] of a position error [m] and an orientation error [rad]."""
    return position + RADIAN_IN_METRES * orientation
