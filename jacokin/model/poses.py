"""`pose` and `FreeAxis`, which build targets, and the checks of poses, rotations and quaternions that users give.

Quaternions are wxyz. Roll-pitch-yaw means R = Rz(yaw) Ry(pitch) Rx(roll).
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, TypeVar, overload

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.model import checks
from jacokin.model.angles import TURN

logger = logging.getLogger(__name__)

FARTHEST = 10.0  # [m] no arm of this kind reaches so far
NEAREST_MM = 10.0  # [mm] the tool of none comes so near to its base
QUATERNION_NORM_TOLERANCE = 0.01  # hand-typed quaternions have two or three digits; more than 1 % is a mistake
RIGID_TOLERANCE = 1e-6  # |R^T R - I|: admits float32 matrices (1e-7), refuses scaled or sheared ones
ORTHONORMAL = 1e-14  # |R^T R - I| of a product of a dozen rotations: rounding, left as it is
# The tool pointing vertically down: half a turn about the horizontal axis (0, 1, 1) / sqrt(2) of the tool.
DOWN_QUAT_WXYZ = (0.0, math.sqrt(0.5), math.sqrt(0.5), 0.0)
TURN_TOLERANCE = 1e-12  # [rad] a range this near to a full turn, shorter or longer, is one: what a double resolves
FARTHEST_ANGLE = 1e3  # [rad] of a range: a parameter keeps its digits

Kind = TypeVar("Kind")


@overload
def pose(
    position: ArrayLike,
    quat_wxyz: ArrayLike | None = None,
    *,
    rpy: ArrayLike | None = None,
    rotation: ArrayLike | None = None,
    down: bool = False,
    approach: None = None,
) -> pin.SE3: ...


@overload
def pose(position: ArrayLike, *, approach: ArrayLike) -> FreeAxis: ...


def pose(
    position: ArrayLike,
    quat_wxyz: ArrayLike | None = None,
    *,
    rpy: ArrayLike | None = None,
    rotation: ArrayLike | None = None,
    down: bool = False,
    approach: ArrayLike | None = None,
) -> pin.SE3 | FreeAxis:
    """Build a pose from a position and at most one orientation; without one the orientation is the identity.

    ``approach`` counts as an orientation that leaves the roll free: the result is a `FreeAxis` about the tool's z axis,
    which points the way given. At parameter 0 the tool's x axis is horizontal, and its y axis points up; where the
    approach is vertical, x is the base's y axis, so that straight down is ``down=True``.

    Args:
        position: (3,) position [m].
        quat_wxyz: (4,) quaternion w, x, y, z; normalised when its norm is within 1 % of one.
        rpy: (3,) roll, pitch, yaw [rad], R = Rz(yaw) Ry(pitch) Rx(roll).
        rotation: (3, 3) rotation matrix.
        down: True for a tool pointing vertically down.
        approach: (3,) direction in the base in which the tool's z axis points, any length but zero.

    Returns:
        The pose as `pin.SE3`; with ``approach`` a `FreeAxis`.

    Raises:
        InvalidInputError: more than one orientation, or a malformed one.
    """
    down = checks.flag("down", down)
    orientations = {
        "quat_wxyz": quat_wxyz,
        "rpy": rpy,
        "rotation": rotation,
        "down": down or None,
        "approach": approach,
    }
    given = [name for name, value in orientations.items() if value is not None]
    if len(given) > 1:
        raise InvalidInputError(f"give at most one orientation, got {' and '.join(given)}")
    at = checks.vector("position", position, 3, "m").copy()
    if np.abs(at).max() > FARTHEST:
        shown = checks.shown(position)
        logger.warning("pose: position is in metres, and %s exceeds %g m; 350 mm are 0.35", shown, FARTHEST)
    if approach is not None:
        return FreeAxis(pin.SE3(_facing(unit_vector("approach", approach)), at), axis=(0.0, 0.0, 1.0))
    if quat_wxyz is not None:
        return pin.SE3(rotation_from_quat_wxyz(quat_wxyz), at)
    if rpy is not None:
        rotation = rotation_from_rpy(rpy)
        if np.abs(rpy).max() > TURN:
            logger.warning("pose: rpy is in radians, and an angle of %s exceeds a full turn", checks.shown(rpy))
        return pin.SE3(rotation, at)
    if rotation is not None:
        return pin.SE3(checked_rotation("rotation", rotation), at)
    if down:
        return pin.SE3(rotation_from_quat_wxyz(DOWN_QUAT_WXYZ), at)
    return pin.SE3(np.eye(3), at)


def pose_from_kinova(position_mm: ArrayLike, angles_deg: ArrayLike) -> pin.SE3:
    """A pose from the numbers of Kinova's software, R = Rx(a) Ry(b) Rz(c).

    Args:
        position_mm: (3,) position [mm].
        angles_deg: (3,) Euler angles about x, y and z [deg].

    Raises:
        InvalidInputError: wrong shape or not finite.
    """
    position = checks.vector("position_mm", position_mm, 3, "mm")
    angles = np.radians(checks.vector("angles_deg", angles_deg, 3, "deg"))
    if np.linalg.norm(position) < NEAREST_MM:
        shown = checks.shown(position_mm)
        logger.warning("position_mm is in millimetres, and %s is less than %g mm from the base", shown, NEAREST_MM)
    # The inverse of Rx(a) Ry(b) Rz(c) is Rz(-c) Ry(-b) Rx(-a).
    return pin.SE3(pin.rpy.rpyToMatrix(-angles).T, 1e-3 * position)


def pose_to_kinova(pose: pin.SE3 | ArrayLike) -> tuple[Array, Array]:
    """Position (3,) [mm] and Euler angles (3,) [deg] of a pose, as `pose_from_kinova` takes them.

    Raises:
        InvalidInputError: malformed pose.
    """
    at = checked_pose(pose, "pose")
    angles = -np.degrees(pin.rpy.matrixToRpy(np.ascontiguousarray(at.rotation.T)))
    return 1e3 * at.translation, angles


def _facing(z: Array) -> Array:
    """The rotation (3, 3) of a tool whose z axis points along a unit vector (3,), its x axis horizontal."""
    across = math.hypot(z[0], z[1])  # the sine of the angle from the vertical, which has no horizontal direction
    x = np.array([0.0, 1.0, 0.0]) if across < 1e-9 else np.array([-z[1], z[0], 0.0]) / across
    x = x - (x @ z) * z
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])


class FreeAxis:
    """A target: the tool at a pose, or turned from there about an axis through its origin. Immutable.

    The parameter p [rad] turns the tool by the right hand about the axis: T_base_tool = pose * Rot(axis, p).
    """

    __slots__ = ("_axis", "_matrix", "_range")

    def __init__(
        self,
        pose: pin.SE3 | ArrayLike,
        *,
        axis: ArrayLike,
        range: Sequence[float] | Array = (-math.pi, math.pi),  # noqa: A002 - the word users look for
    ) -> None:
        """Check the target.

        Args:
            pose: T_base_tool at p = 0, as `pin.SE3` or (4, 4).
            axis: (3,) direction of the axis in the tool frame; any length but zero.
            range: least and largest p [rad]; up to a full turn.

        Raises:
            InvalidInputError: a malformed pose, an axis of length zero, a range that is empty, not finite or longer
                than a turn.
        """
        matrix = checks.sealed(matrix_of(pose, "pose"))
        direction = unit_vector("axis", axis)
        low, high = checks.vector("range", range, 2, "rad").tolist()
        if not low < high:
            raise InvalidInputError(f"range must be (least, largest) with least < largest, got {low} to {high} rad")
        if high - low > TURN + TURN_TOLERANCE:
            raise InvalidInputError(f"range must be at most one turn, got {low} to {high} rad")
        if max(abs(low), abs(high)) > FARTHEST_ANGLE:
            raise InvalidInputError(f"range must be within {FARTHEST_ANGLE:g} rad of zero, got {low} to {high} rad")
        self._matrix = matrix
        self._axis = checks.read_only(direction)
        self._range = (low, high)

    @property
    def pose(self) -> pin.SE3:
        """The pose of the tool in the base at p = 0, a fresh object."""
        return pin.SE3(self._matrix[:3, :3], self._matrix[:3, 3])

    @property
    def matrix(self) -> Array:
        """(4, 4) the pose, read-only."""
        return self._matrix

    @property
    def axis(self) -> Array:
        """(3,) unit vector in the tool frame, read-only."""
        return self._axis

    @property
    def range(self) -> tuple[float, float]:
        """Least and largest p [rad]."""
        return self._range

    @property
    def full_turn(self) -> bool:
        """Whether every p is in the range."""
        return bool(self._range[1] - self._range[0] >= TURN - TURN_TOLERANCE)

    def at(self, parameter: float) -> pin.SE3:
        """The pose of the tool in the base, turned by p [rad]."""
        matrix = self.matrix_at(checks.number("parameter", parameter, "rad"))
        return pin.SE3(matrix[:3, :3], matrix[:3, 3])

    def matrix_at(self, parameter: float) -> Array:
        """The pose (4, 4) turned by p [rad], for callers inside the package: the argument is trusted."""
        matrix = self._matrix.copy()
        matrix[:3, :3] = matrix[:3, :3] @ pin.AngleAxis(parameter, self._axis).toRotationMatrix()
        return matrix

    def parameter_of(self, rotation: Array) -> float:
        """The p in [-pi, pi] whose orientation is nearest to a rotation (3, 3) of the tool in the base [rad]."""
        turn = pin.Quaternion(np.ascontiguousarray(self._matrix[:3, :3].T @ rotation))
        along = float(self._axis @ turn.coeffs()[:3])
        angle = 2.0 * math.atan2(along, float(turn.coeffs()[3]))
        return angle - TURN * round(angle / TURN)

    def __repr__(self) -> str:
        """Position, axis and range."""
        low, high = self._range
        return f"FreeAxis(at {self._matrix[:3, 3].tolist()} m, axis={self._axis.tolist()}, range=({low:g}, {high:g}))"

    def __reduce__(self) -> tuple[object, tuple[object, ...]]:
        """Rebuild from the arguments."""
        return partial(FreeAxis, axis=self._axis, range=self._range), (self._matrix,)


def giving_copies(*names: str) -> Callable[[type[Kind]], type[Kind]]:
    """Make fields of a dataclass with slots give copies of the poses they hold: a `pin.SE3` can be written to."""

    def decorate(kind: type[Kind]) -> type[Kind]:
        for name in names:
            setattr(kind, name, _copying(kind.__dict__[name]))
        return kind

    return decorate


def _copying(slot: Any) -> property:  # Any: the descriptor of a slot has no type of its own
    def read(owner: object) -> object:
        value = slot.__get__(owner)
        return value.copy() if isinstance(value, pin.SE3) else value

    return property(read, slot.__set__)


def checked_pose(target: pin.SE3 | ArrayLike, name: str = "target") -> pin.SE3:
    """A rigid pose from a `pin.SE3` or a homogeneous matrix (4, 4); a fresh object, positions in [m].

    Raises:
        InvalidInputError: wrong type or shape, not finite, or not rigid.
    """
    matrix = matrix_of(target, name)
    return pin.SE3(matrix[:3, :3], matrix[:3, 3])


def checked_place(name: str, value: pin.SE3 | ArrayLike) -> pin.SE3:
    """A pose from a pose or a position (3,) [m], with the axes of the base then.

    Raises:
        InvalidInputError: neither, or malformed.
    """
    if isinstance(value, pin.SE3):
        return checked_pose(value, name)
    array = checks.array(name, value, "a pose or a position")
    if array.ndim == 1:
        return pin.SE3(np.eye(3), checks.vector(name, array, 3, "m"))
    return checked_pose(array, name)


def matrix_of(target: pin.SE3 | ArrayLike, name: str = "target") -> Array:
    """A rigid homogeneous matrix (4, 4), always a copy, of a `pin.SE3` or a matrix, positions in [m].

    Raises:
        InvalidInputError: wrong type or shape, not finite, or not rigid.
    """
    if isinstance(target, pin.SE3):
        return checked_matrix(name, target.homogeneous)
    matrix = np.array(checks.array(name, target, "a pin.SE3 or a (4, 4) matrix"), order="C")
    if matrix.shape != (4, 4):
        raise InvalidInputError(f"{name} must be a pin.SE3 or a (4, 4) matrix, got shape {matrix.shape}")
    return checked_matrix(name, matrix)


def checked_matrix(name: str, matrix: Array) -> Array:
    """A homogeneous matrix (4, 4) whose rotation is made orthonormal in place; refused when it is not rigid.

    Raises:
        InvalidInputError: not finite, a last row that is not 0 0 0 1, sheared, scaled or a reflection.
    """
    # Sixteen numbers: plain floats are faster than NumPy here, and this runs before every solve.
    a, b, c, x, d, e, f, y, g, h, k, z, p, q, r, one = matrix.ravel().tolist()
    aa, bb, cc = a * a + d * d + g * g - 1.0, b * b + e * e + h * h - 1.0, c * c + f * f + k * k - 1.0
    ab, ac, bc = a * b + d * e + g * h, a * c + d * f + g * k, b * c + e * f + h * k
    is_right_handed = a * (e * k - f * h) - b * (d * k - f * g) + c * (d * h - e * g) > 0.0
    has_exact_last_row = one == 1.0 and p == q == r == 0.0
    squares = aa * aa + bb * bb + cc * cc + ab * ab + ac * ac + bc * bc
    if squares <= ORTHONORMAL**2 and is_right_handed and has_exact_last_row and math.isfinite(x + y + z):
        return matrix
    if not np.isfinite(matrix).all():
        raise InvalidInputError(f"{name} must be finite")
    if not has_exact_last_row and not max(abs(p), abs(q), abs(r), abs(one - 1.0)) <= RIGID_TOLERANCE:
        raise InvalidInputError(f"{name}: the last row must be 0 0 0 1, got {matrix[3].tolist()}")
    misfit = max(map(abs, (aa, bb, cc, ab, ac, bc)))
    if not misfit <= RIGID_TOLERANCE:
        raise InvalidInputError(f"{name} is not a rotation: R^T R differs from the identity by {misfit:.3g}")
    if not is_right_handed:
        raise InvalidInputError(f"{name} is a reflection (determinant -1), not a rotation")
    if misfit > ORTHONORMAL:
        _orthonormalise(matrix[:3, :3])
    if not has_exact_last_row:
        matrix[3] = 0.0, 0.0, 0.0, 1.0
    return matrix


def checked_matrices(name: str, matrices: Array) -> Array:
    """Poses (n, 4, 4) in which each is rigid, made exactly so in place.

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


def _orthonormalise(rotation: Array) -> None:
    """Move (..., 3, 3) onto the nearest orthonormal matrix; each step squares the misfit: 1e-6, 1e-12, 1e-24."""
    for _ in range(2):
        rotation[...] = rotation @ (1.5 * np.eye(3) - 0.5 * (np.swapaxes(rotation, -1, -2) @ rotation))


def checked_rotation(name: str, value: ArrayLike) -> Array:
    """A rotation matrix (3, 3) made orthonormal to the last bit, refused when it is not one within 1e-6.

    Raises:
        InvalidInputError: wrong shape, not finite, sheared, scaled or a reflection.
    """
    matrix = checks.array(name, value, "a (3, 3) rotation matrix")
    if matrix.shape != (3, 3):
        raise InvalidInputError(f"{name} must have shape (3, 3), got {matrix.shape}")
    homogeneous = np.eye(4)
    homogeneous[:3, :3] = matrix
    return checked_matrix(name, homogeneous)[:3, :3]


def unit_vector(name: str, value: ArrayLike) -> Array:
    """The direction of a vector (3,).

    Raises:
        InvalidInputError: wrong shape, not finite, or of no length.
    """
    vector = checks.vector(name, value, 3, "")
    length = math.hypot(*vector.tolist())  # infinite where it overflows, without a warning
    if not length > 0.0 or not math.isfinite(length):
        raise InvalidInputError(f"{name} must have a direction, got {vector.tolist()}")
    return vector / length


def unit_quaternion(name: str, quat_wxyz: ArrayLike) -> Array:
    """The quaternion (4,) wxyz with norm 1, refused when its norm is off by more than 1 %.

    Raises:
        InvalidInputError: wrong shape, not finite, or a norm off by more than 1 %.
    """
    quat = checks.vector(name, quat_wxyz, 4, "wxyz")
    norm = math.sqrt(quat.dot(quat))
    if abs(norm - 1.0) > QUATERNION_NORM_TOLERANCE:
        raise InvalidInputError(f"{name} must have norm 1 (within 1 %), got norm {norm:.6g} for {quat.tolist()}")
    unit: Array = quat / norm
    return unit


def rotation_from_quat_wxyz(quat_wxyz: ArrayLike) -> Array:
    """Rotation matrix (3, 3) of a quaternion (w, x, y, z) whose norm is within 1 % of one.

    Raises:
        InvalidInputError: wrong shape, not finite, or a norm off by more than 1 %.
    """
    w, x, y, z = unit_quaternion("quat_wxyz", quat_wxyz).tolist()
    rotation: Array = pin.Quaternion(w, x, y, z).toRotationMatrix()
    return rotation


def rotation_from_rpy(rpy: ArrayLike) -> Array:
    """Rotation matrix (3, 3) of R = Rz(yaw) Ry(pitch) Rx(roll), angles (roll, pitch, yaw) in [rad].

    Raises:
        InvalidInputError: wrong shape or not finite.
    """
    rotation: Array = pin.rpy.rpyToMatrix(checks.vector("rpy", rpy, 3, "rad"))
    return rotation


def quat_wxyz(rotation: ArrayLike) -> Array:
    """Unit quaternion (w, x, y, z) of a rotation matrix (3, 3), with w >= 0.

    Raises:
        InvalidInputError: not a rotation matrix.
    """
    return quaternion(checked_rotation("rotation", rotation))


def quaternion(rotation: Array) -> Array:
    """Unit quaternion (w, x, y, z), w >= 0, of a rotation (3, 3) that is trusted, for callers inside the package."""
    x, y, z, w = pin.Quaternion(np.asarray(rotation)).normalized().coeffs()
    quat = np.array([w, x, y, z])
    return -quat if w < 0.0 else quat


def rotation_angle(rotation: Array) -> float:
    """Angle [rad] of a rotation matrix, accurate near zero and near a half turn."""
    a, b, c, d, e, f, g, h, k = rotation.ravel().tolist()
    return math.atan2(math.hypot(h - f, c - g, d - b), a + e + k - 1.0)
