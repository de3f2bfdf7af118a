"""Targets, checked once: a pose, or a position whose orientation is free."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, shown
from jacokin.model import checks, poses


@dataclass(frozen=True, slots=True, eq=False)
class TargetPose:
    """A checked target in the base frame.

    Attributes:
        matrix: (4, 4) T_base_tool; its rotation means nothing when `position_only`.
        position_only: True when the orientation is free.
    """

    matrix: Array
    position_only: bool

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


def checked_batch(targets: Sequence[pin.SE3] | ArrayLike) -> tuple[Array, NDArray[np.bool_]]:
    """Targets of a batch: poses (n, 4, 4), positions (n, 3), or a sequence of what `checked` takes.

    Returns:
        (n, 4, 4) matrices and (n,) where the orientation is free.

    Raises:
        InvalidInputError: empty, or a target is malformed; names its row.
    """
    if isinstance(targets, np.ndarray) and targets.ndim == 3 and targets.shape[1:] == (4, 4) and len(targets):
        try:
            numbers = checks.numbers(targets)
        except TypeError as error:
            raise InvalidInputError(f"targets must be real numbers, got dtype {targets.dtype}") from error
        matrices = poses.checked_matrices("targets", np.array(numbers, order="C"))
        return matrices, np.zeros(len(matrices), dtype=np.bool_)
    try:
        rows = list(targets)  # type: ignore[arg-type]  # whatever cannot be listed is refused below
    except TypeError as error:
        raise InvalidInputError(f"targets must be a sequence of poses, got {shown(targets)}") from error
    if not rows:
        raise InvalidInputError("targets is empty")
    each = [checked(row, f"targets[{index}]") for index, row in enumerate(rows)]
    return np.array([target.matrix for target in each]), np.array([target.position_only for target in each])


def _at(position: Array) -> Array:
    matrix = np.eye(4)
    matrix[:3, 3] = position
    return matrix
