"""Targets from what users know: poses, and poses that may turn about one axis of the tool."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import overload

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.model import checks, poses
from jacokin.model.angles import TURN

#: [rad] a range this near to a full turn is one, and one longer by no more than this is too: what a double resolves.
FULL_TURN = 1e-12
#: Sine; an approach this near to vertical has no horizontal direction of its own.
VERTICAL = 1e-9
FARTHEST_ANGLE = 1e3  # [rad] of a range: a parameter keeps its digits


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
        matrix = poses.matrix_of(pose, "pose")
        matrix.setflags(write=False)
        direction = checks.vector("axis", axis, 3, "")
        length = math.hypot(*direction.tolist())  # infinite where it overflows, without a warning
        if not length > 0.0 or not math.isfinite(length):
            raise InvalidInputError(f"axis must have a direction, got {direction.tolist()}")
        low, high = checks.vector("range", range, 2, "rad").tolist()
        if not low < high:
            raise InvalidInputError(f"range must be (least, largest) [rad] with least < largest, got ({low}, {high})")
        if high - low > TURN + FULL_TURN:
            raise InvalidInputError(f"range must be at most one turn, got {high - low:.6g} rad from {low} to {high}")
        if max(abs(low), abs(high)) > FARTHEST_ANGLE:
            raise InvalidInputError(f"range must be within {FARTHEST_ANGLE:g} rad of zero, got ({low}, {high})")
        self._matrix = matrix
        self._axis = checks.read_only(direction / length)
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
        return bool(self._range[1] - self._range[0] >= TURN - FULL_TURN)

    def at(self, parameter: float) -> pin.SE3:
        """The pose of the tool in the base, turned by p [rad]."""
        matrix = self.matrix_at(checks.number("parameter", parameter, "rad"))
        return pin.SE3(matrix[:3, :3], matrix[:3, 3])

    def matrix_at(self, parameter: float) -> Array:
        """As `at`, (4, 4), for callers inside the package: the argument is trusted."""
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
        return _rebuild, (self._matrix, self._axis, self._range)


def _rebuild(matrix: Array, axis: Array, limits: tuple[float, float]) -> FreeAxis:
    return FreeAxis(matrix, axis=axis, range=limits)


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
    given = [n for n, v in (("quat_wxyz", quat_wxyz), ("rpy", rpy), ("rotation", rotation)) if v is not None]
    if down:
        given.append("down")
    if approach is not None:
        given.append("approach")
    if len(given) > 1:
        raise InvalidInputError(f"give at most one orientation, got {' and '.join(given)}")
    at = checks.vector("position", position, 3, "m").copy()
    if approach is not None:
        return FreeAxis(pin.SE3(_facing(approach), at), axis=(0.0, 0.0, 1.0))
    if quat_wxyz is not None:
        return pin.SE3(poses.rotation_from_quat_wxyz(quat_wxyz), at)
    if rpy is not None:
        return pin.SE3(poses.rotation_from_rpy(rpy), at)
    if rotation is not None:
        return pin.SE3(poses.checked_rotation("rotation", rotation), at)
    if down:
        return pin.SE3(poses.rotation_from_quat_wxyz(poses.DOWN_QUAT_WXYZ), at)
    return pin.SE3(np.eye(3), at)


def _facing(approach: ArrayLike) -> Array:
    """The rotation (3, 3) of a tool whose z axis points in a direction (3,), its x axis horizontal."""
    z = checks.vector("approach", approach, 3, "")
    length = math.hypot(*z.tolist())
    if not length > 0.0 or not math.isfinite(length):
        raise InvalidInputError(f"approach must have a direction, got {z.tolist()}")
    z = z / length
    across = math.hypot(z[0], z[1])
    x = np.array([0.0, 1.0, 0.0]) if across < VERTICAL else np.array([-z[1], z[0], 0.0]) / across
    x = x - (x @ z) * z
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])
