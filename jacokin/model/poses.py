"""Poses as `pin.SE3`: building them from user input and checking those that users bring.

Quaternions are wxyz. Roll-pitch-yaw means R = Rz(yaw) Ry(pitch) Rx(roll).
"""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, shown
from jacokin.model import checks

QUATERNION_NORM_TOLERANCE = 0.01  # hand-typed quaternions have two or three digits; more than 1 % is a mistake
RIGID_TOLERANCE = 1e-6  # |R^T R - I|: admits float32 matrices (1e-7), refuses scaled or sheared ones

ORTHONORMAL = 1e-14  # |R^T R - I| of a product of a dozen rotations: rounding, left as it is

# The tool pointing vertically down: half a turn about the horizontal axis (0, 1, 1) / sqrt(2) of the tool.
DOWN_QUAT_WXYZ = (0.0, math.sqrt(0.5), math.sqrt(0.5), 0.0)


def rotation_from_quat_wxyz(quat_wxyz: ArrayLike, name: str = "quat_wxyz") -> Array:
    """Rotation matrix (3, 3) of a quaternion (w, x, y, z) whose norm is within 1 % of one.

    Raises:
        InvalidInputError: wrong shape, not finite, or a norm off by more than 1 %.
    """
    quat = checks.vector(name, quat_wxyz, 4, "wxyz")
    norm = float(np.linalg.norm(quat))
    if abs(norm - 1.0) > QUATERNION_NORM_TOLERANCE:
        raise InvalidInputError(f"{name} must have norm 1 (within 1 %), got norm {norm:.6g} for {quat.tolist()}")
    w, x, y, z = (float(c) for c in quat / norm)
    rotation: Array = pin.Quaternion(w, x, y, z).toRotationMatrix()
    return rotation


def rotation_from_rpy(rpy: ArrayLike, name: str = "rpy") -> Array:
    """Rotation matrix (3, 3) of R = Rz(yaw) Ry(pitch) Rx(roll), angles (roll, pitch, yaw) in [rad].

    Raises:
        InvalidInputError: wrong shape or not finite.
    """
    rotation: Array = pin.rpy.rpyToMatrix(checks.vector(name, rpy, 3, "rad"))
    return rotation


def checked_rotation(name: str, value: ArrayLike) -> Array:
    """A rotation matrix (3, 3) made orthonormal to the last bit, refused when it is not one within 1e-6.

    Raises:
        InvalidInputError: wrong shape, not finite, sheared, scaled or a reflection.
    """
    try:
        matrix = checks.numbers(value)
    except (TypeError, ValueError) as error:
        raise InvalidInputError(f"{name} must be a (3, 3) rotation matrix") from error
    if matrix.shape != (3, 3):
        raise InvalidInputError(f"{name} must have shape (3, 3), got {matrix.shape}")
    homogeneous = np.eye(4)
    homogeneous[:3, :3] = matrix
    return checked_matrix(name, homogeneous)[:3, :3]


def checked_matrix(name: str, matrix: Array) -> Array:
    """A homogeneous matrix (4, 4) whose rotation is made orthonormal in place; refused when it is not rigid.

    Raises:
        InvalidInputError: not finite, a last row that is not 0 0 0 1, sheared, scaled or a reflection.
    """
    # Sixteen numbers: plain floats are faster than NumPy here, and this runs before every solve.
    (a, b, c, x), (d, e, f, y), (g, h, k, z), (p, q, r, one) = matrix.tolist()
    total = a + b + c + d + e + f + g + h + k + x + y + z + p + q + r + one
    if not math.isfinite(total) and not np.isfinite(matrix).all():
        raise InvalidInputError(f"{name} must be finite")
    has_exact_last_row = one == 1.0 and p == q == r == 0.0
    if not has_exact_last_row and not max(abs(p), abs(q), abs(r), abs(one - 1.0)) <= RIGID_TOLERANCE:
        raise InvalidInputError(f"{name}: the last row must be 0 0 0 1, got {matrix[3].tolist()}")
    misfit = max(
        abs(a * a + d * d + g * g - 1.0),
        abs(b * b + e * e + h * h - 1.0),
        abs(c * c + f * f + k * k - 1.0),
        abs(a * b + d * e + g * h),
        abs(a * c + d * f + g * k),
        abs(b * c + e * f + h * k),
    )
    if not misfit <= RIGID_TOLERANCE:
        raise InvalidInputError(f"{name} is not a rotation: R^T R differs from the identity by {misfit:.3g}")
    if a * (e * k - f * h) - b * (d * k - f * g) + c * (d * h - e * g) < 0.0:
        raise InvalidInputError(f"{name} is a reflection (determinant -1), not a rotation")
    if misfit > ORTHONORMAL:
        _orthonormalise(matrix[:3, :3])
    if not has_exact_last_row:
        matrix[3] = 0.0, 0.0, 0.0, 1.0
    return matrix


def _orthonormalise(rotation: Array) -> None:
    """Move (..., 3, 3) onto the nearest orthonormal matrix; each step squares the misfit: 1e-6, 1e-12, 1e-24."""
    for _ in range(2):
        rotation[...] = rotation @ (1.5 * np.eye(3) - 0.5 * (np.swapaxes(rotation, -1, -2) @ rotation))


def checked_matrices(name: str, matrices: Array) -> Array:
    """As `checked_matrix` for (n, 4, 4) at once, in place.

    Raises:
        InvalidInputError: as there; the first row at fault is named.
    """
    rotation = matrices[:, :3, :3]
    # Entry by entry, as for one matrix: products of many small matrices take several times as long.
    (a, b, c, x), (d, e, f, y), (g, h, k, z), (p, q, r, one) = matrices.transpose(1, 2, 0).copy()
    with np.errstate(over="ignore", invalid="ignore"):
        misfit = np.abs(a * a + d * d + g * g - 1.0)
        for other in (
            b * b + e * e + h * h - 1.0,
            c * c + f * f + k * k - 1.0,
            a * b + d * e + g * h,
            a * c + d * f + g * k,
            b * c + e * f + h * k,
        ):
            np.maximum(misfit, np.abs(other), out=misfit)
        good = misfit <= RIGID_TOLERANCE
        for last in (p, q, r, one - 1.0):
            good &= np.abs(last) <= RIGID_TOLERANCE
        for finite in (x, y, z):
            good &= np.isfinite(finite)
        good &= a * (e * k - f * h) - b * (d * k - f * g) + c * (d * h - e * g) > 0.0
    if not good.all():
        index = int(np.argmin(good))
        checked_matrix(f"{name}[{index}]", matrices[index].copy())
    rough = misfit > ORTHONORMAL
    if rough.any():
        fixed = rotation[rough]
        _orthonormalise(fixed)
        matrices[rough, :3, :3] = fixed
    matrices[:, 3] = 0.0, 0.0, 0.0, 1.0
    return matrices


def matrix_of(target: pin.SE3 | ArrayLike, name: str = "target") -> Array:
    """A rigid homogeneous matrix (4, 4) of one's own from a `pin.SE3` or a matrix, positions in [m].

    Raises:
        InvalidInputError: wrong type or shape, not finite, or not rigid.
    """
    if isinstance(target, pin.SE3):
        return checked_matrix(name, target.homogeneous)
    try:
        matrix = np.array(checks.numbers(target), order="C")
    except (TypeError, ValueError) as error:
        raise InvalidInputError(f"{name} must be a pin.SE3 or a (4, 4) matrix, got {shown(target)}") from error
    if matrix.shape != (4, 4):
        raise InvalidInputError(f"{name} must be a pin.SE3 or a (4, 4) matrix, got shape {matrix.shape}")
    return checked_matrix(name, matrix)


def checked_pose(target: pin.SE3 | ArrayLike, name: str = "target") -> pin.SE3:
    """A rigid pose from a `pin.SE3` or a homogeneous matrix (4, 4); a fresh object, positions in [m].

    Raises:
        InvalidInputError: wrong type or shape, not finite, or not rigid.
    """
    matrix = matrix_of(target, name)
    return pin.SE3(matrix[:3, :3], matrix[:3, 3])


def quat_wxyz(rotation: ArrayLike) -> Array:
    """Unit quaternion (w, x, y, z) of a rotation matrix (3, 3), with w >= 0.

    Raises:
        InvalidInputError: not a rotation matrix.
    """
    return quaternion(checked_rotation("rotation", rotation))


def quaternion(rotation: Array) -> Array:
    """As `quat_wxyz`, for callers inside the package: the argument is trusted."""
    x, y, z, w = pin.Quaternion(np.asarray(rotation)).normalized().coeffs()
    quat = np.array([w, x, y, z])
    return -quat if w < 0.0 else quat


def rotation_angle(rotation: Array) -> float:
    """Angle [rad] of a rotation matrix, accurate near zero and near a half turn."""
    a, b, c, d, e, f, g, h, k = rotation.ravel().tolist()
    return math.atan2(math.hypot(h - f, c - g, d - b), a + e + k - 1.0)
