"""Unit quaternions as the bridge takes them."""

from __future__ import annotations

import math

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.model import checks
from jacokin.model.poses import QUATERNION_NORM_TOLERANCE


def unit_quaternion(name: str, quat_wxyz: ArrayLike) -> Array:
    """The quaternion (4,) wxyz with norm 1, refused when its norm is off by more than 1 %.

    Raises:
        InvalidInputError: wrong shape, not finite, or far from norm 1.
    """
    quat = checks.vector(name, quat_wxyz, 4, "wxyz")
    norm = math.sqrt(quat.dot(quat))
    if abs(norm - 1.0) > QUATERNION_NORM_TOLERANCE:
        raise InvalidInputError(f"{name} must have norm 1 (within 1 %), got norm {norm:.6g} for {quat.tolist()}")
    unit: Array = quat / norm
    return unit


def rotation_matrix(unit_quat_wxyz: Array) -> Array:
    """Rotation matrix (3, 3) of a unit quaternion (4,) wxyz."""
    rotation = np.empty(9)
    mujoco.mju_quat2Mat(rotation, unit_quat_wxyz)
    return rotation.reshape(3, 3)


def product(first_wxyz: Array, second_wxyz: Array) -> Array:
    """The quaternion (4,) wxyz that rotates by the second and then by the first."""
    quat = np.empty(4)
    mujoco.mju_mulQuat(quat, first_wxyz, second_wxyz)
    return quat
