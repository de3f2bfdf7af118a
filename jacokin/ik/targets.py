"""What a solver is asked for, checked once: a pose, or a position whose orientation is free."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from jacokin.errors import InvalidInputError
from jacokin.model import checks, poses


RADIAN_IN_METRES = 0.1  # one radian of orientation error counts as much as this distance


@dataclass(frozen=True, slots=True)
class Target:
    """A checked target in the base frame.

    Attributes:
        pose: T_base_tool; its rotation means nothing when `position_only`.
        position_only: True when the orientation is free.
    """

    pose: pin.SE3
    position_only: bool


def checked(target: pin.SE3 | ArrayLike, name: str = "target") -> Target:
    """A target from a `pin.SE3`, a homogeneous matrix (4, 4), or a position (3,) [m].

    Raises:
        InvalidInputError: anything else, not finite, or not rigid.
    """
    if not isinstance(target, pin.SE3):
        try:
            array = np.asarray(target, dtype=np.float64)
        except (TypeError, ValueError) as error:
            raise InvalidInputError(
                f"{name} must be a pin.SE3, a (4, 4) matrix or a (3,) position, got {target!r}"
            ) from error
        if array.ndim == 1:
            position = checks.vector(name, array, 3, "m")
            return Target(pin.SE3(np.eye(3), position.copy()), position_only=True)
    return Target(poses.checked_pose(target, name), position_only=False)


def checked_batch(targets: Sequence[pin.SE3] | ArrayLike) -> list[Target]:
    """Targets of a batch: poses (n, 4, 4), positions (n, 3), or a sequence of what `checked` takes.

    Raises:
        InvalidInputError: empty, or a target is malformed; names its row.
    """
    try:
        rows = list(targets)  # type: ignore[arg-type]  # whatever cannot be listed is refused below
    except TypeError as error:
        raise InvalidInputError(f"targets must be a sequence of poses, got {targets!r}") from error
    if not rows:
        raise InvalidInputError("targets is empty")
    return [checked(row, f"targets[{index}]") for index, row in enumerate(rows)]


def errors(T_base_tool: pin.SE3, target: Target) -> tuple[float, float]:
    """Distance [m] and angle [rad] between where the tool is and the target; the angle is 0 when it is free."""
    miss = T_base_tool.translation - target.pose.translation
    position = math.sqrt(miss.dot(miss))
    if target.position_only:
        return position, 0.0
    return position, rotation_angle(T_base_tool.rotation.T @ target.pose.rotation)


def rotation_angle(rotation: NDArray[np.float64]) -> float:
    """Angle [rad] of a rotation matrix, accurate near zero and near a half turn."""
    a, b, c, d, e, f, g, h, k = rotation.ravel().tolist()
    return math.atan2(math.hypot(h - f, c - g, d - b), a + e + k - 1.0)


def nearest_copy(q: NDArray[np.float64], seed: NDArray[np.float64], free: NDArray[np.bool_]) -> NDArray[np.float64]:
    """`q` with every free joint in the 2 pi copy nearest to the seed; (dof,) or (k, dof) [rad]."""
    turns = np.round((seed - q) / (2.0 * np.pi))
    return np.where(free, q + 2.0 * np.pi * turns, q)


def circular_distance(
    q: NDArray[np.float64], seed: NDArray[np.float64], free: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """Euclidean distance to the seed [rad], the short way round on free joints; of (dof,) or (k, dof)."""
    distance: NDArray[np.float64] = np.linalg.norm(nearest_copy(q, seed, free) - seed, axis=-1)
    return distance
