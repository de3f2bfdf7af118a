"""Rotation matrices of many orientations at once; `jacokin.model.poses` has those of one."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.model.poses import QUATERNION_NORM_TOLERANCE


def rotations_from_quats(quats_wxyz: Array) -> tuple[Array, NDArray[np.int_]]:
    """Rotations (n, 3, 3) of quaternions (n, 4), and the rows whose norm is not within 1 % of one (no rotations)."""
    with np.errstate(over="ignore"):
        norms = np.linalg.norm(quats_wxyz, axis=1)
    wrong = np.flatnonzero(~(np.abs(norms - 1.0) <= QUATERNION_NORM_TOLERANCE))
    norms[wrong] = np.nan
    w, x, y, z = (quats_wxyz / norms[:, None]).T
    rotation = np.empty((len(quats_wxyz), 3, 3))
    rotation[:, 0] = np.stack([1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)], axis=1)
    rotation[:, 1] = np.stack([2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)], axis=1)
    rotation[:, 2] = np.stack([2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)], axis=1)
    return rotation, wrong


def rotations_from_rpys(rpys: Array) -> Array:
    """Rotations (n, 3, 3) of R = Rz(yaw) Ry(pitch) Rx(roll), angles (n, 3) [rad]."""
    (sr, sp, sy), (cr, cp, cy) = np.sin(rpys).T, np.cos(rpys).T
    rotation = np.empty((len(rpys), 3, 3))
    rotation[:, 0] = np.stack([cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr], axis=1)
    rotation[:, 1] = np.stack([sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr], axis=1)
    rotation[:, 2] = np.stack([-sp, cp * sr, cp * cr], axis=1)
    return rotation
