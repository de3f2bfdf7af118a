"""What a solver is asked for, checked once: a pose, a position whose orientation is free, or a free axis."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple, TypeAlias

import numpy as np
import pinocchio as pin
from numpy.random import default_rng  # at once: the first closest configuration does not wait for it
from numpy.typing import ArrayLike, NDArray

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.ik.preferences import Cost
from jacokin.ik.seeds import DEFAULT_RANDOM_SEED
from jacokin.model import checks, poses
from jacokin.model.angles import TURN
from jacokin.model.poses import FreeAxis

#: [m/rad] An orientation error of one radian counts as much as this position error. It is the order of the distance
#: from the arm's tool frame to its fingertips; there is no source for the figure.
RADIAN_IN_METRES = 0.1
SQRT_8 = math.sqrt(8.0)
ALL_AXES = checks.read_only(np.eye(3))


class TargetPose(NamedTuple):
    """A checked target in the base frame: a pose, a position, or a pose that may turn about an axis of the tool."""

    matrix: Array
    """(4, 4) T_base_tool, at angle 0 about a free axis; its rotation means nothing when `position_only`."""
    position_only: bool = False
    """True when the orientation is free."""
    free_axis: FreeAxis | None = None
    """The axis that the tool may turn about, and the range of the angle; None for none."""
    turned_about: Array | None = None
    """(3,) axis in the tool frame of a free axis that this is a pose of; None for none."""

    @property
    def free_axes(self) -> Array | None:
        """(k, 3) axes of the tool, in its frame, that an answer may turn about; None for a pose."""
        if self.position_only:
            return ALL_AXES
        return None if self.turned_about is None else self.turned_about[np.newaxis]

    @property
    def position(self) -> Array:
        """(3,) position of the tool [m]."""
        return self.matrix[:3, 3]

    @property
    def rotation(self) -> Array:
        """(3, 3) orientation of the tool."""
        return self.matrix[:3, :3]

    def moved_to(self, position: Array) -> TargetPose:
        """This target at another position (3,) [m]."""
        matrix = self.matrix.copy()
        matrix[:3, 3] = position
        return self._replace(matrix=matrix)

    def at(self, angle: float) -> TargetPose:
        """The pose at an angle about the free axis [rad]; the target itself where there is none."""
        free = self.free_axis
        return self if free is None else TargetPose(free.matrix_at(angle), turned_about=free.axis)

    def angle_of(self, tool: pin.SE3) -> float:
        """The angle in the range of the free axis at which this is nearest to a pose of the tool [rad]."""
        assert self.free_axis is not None
        return self.nearest_angle(self.free_axis.parameter_of(tool.rotation))

    def nearest_angle(self, angle: float) -> float:
        """The angle in the range of the free axis that is nearest to a value [rad], up to whole turns."""
        if self.free_axis is None:
            return angle
        low, high = self.free_axis.range
        moved = angle + TURN * round((0.5 * (low + high) - angle) / TURN)
        return min(max(moved, low), high)


class Request(NamedTuple):
    """One solve as it was asked for, after every argument was checked: what to reach, from where, how hard to try."""

    target: TargetPose
    """What to reach."""
    seed: Array
    """(dof,) where the solve starts [rad], inside the limits."""
    note: str
    """What had to be done to the seed; empty for nothing."""
    rng: np.random.Generator | None
    """Randomness of the restarts; None for a fixed seed."""
    restarts: int
    """Random starts of the QP at most."""
    closest: bool
    """Whether a failure looks for the closest configuration."""
    cost: Cost | None = None
    """What makes one configuration better than another; None for the distance to the seed."""

    def generator(self) -> np.random.Generator:
        """The caller's generator, or a fresh one with a fixed seed."""
        return default_rng(DEFAULT_RANDOM_SEED) if self.rng is None else self.rng

    def message(self, sentence: str) -> str:
        """A sentence and the note in one."""
        return f"{sentence}; {self.note}" if self.note else sentence


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


def combine(parts: Sequence[PartialTarget], frame: str) -> TargetPose:
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
        raise InvalidInputError("both an orientation and an axis are given; the orientation fixes the axis, too")
    if "axis" in fixed:
        rotation = rotation_between(fixed["axis"], fixed["direction"])
        return _turning(FreeAxis(pin.SE3(rotation, fixed["position"]), axis=fixed["axis"]))
    matrix = _at(fixed["position"])
    if "rotation" in fixed:
        matrix[:3, :3] = fixed["rotation"]
    return TargetPose(matrix, position_only="rotation" not in fixed)


def rotation_between(axis: Array, direction: Array) -> Array:
    """A rotation (3, 3) that takes one unit vector (3,) to another."""
    quaternion = pin.Quaternion.FromTwoVectors(np.asarray(axis), np.asarray(direction))
    return np.asarray(quaternion.toRotationMatrix(), dtype=np.float64)


def pose_matrix(target: Target) -> Array | None:
    """The matrix (4, 4), unchecked, of a target that is nothing but a pose: what most calls bring; None for others."""
    if type(target) is np.ndarray:
        return target if target.dtype is checks.FLOAT64 and target.shape == (4, 4) else None
    return np.asarray(target.homogeneous) if isinstance(target, pin.SE3) else None


def interpret(target: Target, frame: str) -> TargetPose:
    """What a solver for a frame is asked for.

    Raises:
        InvalidInputError: not a target, or its parts do not make one.
    """
    matrix = pose_matrix(target)
    if matrix is not None:
        return TargetPose(poses.checked_matrix("target", matrix.copy() if matrix is target else matrix))
    if isinstance(target, FreeAxis):
        return _turning(target)
    if isinstance(target, PartialTarget):
        return combine([target], frame)
    if isinstance(target, list | tuple) and target and isinstance(target[0], PartialTarget):
        if not all(isinstance(part, PartialTarget) for part in target):
            raise InvalidInputError("a sequence of targets must hold targets of the tracker only")
        return combine(target, frame)
    return checked_target(target)


def checked_target(target: pin.SE3 | ArrayLike, name: str = "target") -> TargetPose:
    """A target from a `pin.SE3`, a homogeneous matrix (4, 4), or a position (3,) [m].

    Raises:
        InvalidInputError: anything else, not finite, or not rigid.
    """
    if not isinstance(target, pin.SE3):
        target = checks.array(name, target, "a pin.SE3, a (4, 4) matrix or a (3,) position")
        if target.ndim == 1:
            return TargetPose(_at(checks.vector(name, target, 3, "m")), position_only=True)
    return TargetPose(poses.matrix_of(target, name))


def checked_batch(
    targets: Sequence[Target] | ArrayLike, frame: str | None = None
) -> tuple[Array, NDArray[np.bool_], dict[int, FreeAxis]]:
    """Targets of a batch: poses (n, 4, 4), positions (n, 3), or a sequence of what `interpret` takes.

    Args:
        targets: the targets.
        frame: the solver's, for targets of the tracker; None refuses those.

    Returns:
        (n, 4, 4) matrices, (n,) where the orientation is free, and the rows that may turn about an axis.

    Raises:
        InvalidInputError: empty, one target alone, or a target is malformed; names its row.
    """
    alone = _alone(targets)
    if alone:
        raise InvalidInputError(
            f"targets must be a sequence of poses or positions, got {alone}: solve(target) takes it, or give [target]"
        )
    if isinstance(targets, np.ndarray) and targets.ndim == 3 and targets.shape[1:] == (4, 4) and len(targets):
        numbers = checks.array("targets", targets, "real numbers")
        matrices = poses.checked_matrices("targets", np.array(numbers, order="C"))
        return matrices, np.zeros(len(matrices), dtype=np.bool_), {}
    rows = checks.listed("targets", targets, "a sequence of poses")  # type: ignore[arg-type]  # is checked
    if not rows:
        raise InvalidInputError("targets is empty")
    each = [_row(row, f"targets[{index}]", frame) for index, row in enumerate(rows)]
    free = {index: target.free_axis for index, target in enumerate(each) if target.free_axis is not None}
    return np.array([target.matrix for target in each]), np.array([target.position_only for target in each]), free


def _row(row: Target, name: str, frame: str | None) -> TargetPose:
    """One target of a batch; what is no target is refused by its name."""
    if isinstance(row, FreeAxis):
        return _turning(row)
    first = row[0] if isinstance(row, list | tuple) and row else row
    if frame is not None and isinstance(first, PartialTarget):
        return interpret(row, frame)
    return checked_target(row, name)


def _alone(targets: object) -> str:
    """What a single target is; empty for anything else."""
    if isinstance(targets, pin.SE3 | FreeAxis):
        return f"one {type(targets).__name__}"
    if not isinstance(targets, np.ndarray | list | tuple) or getattr(targets, "shape", ...) == ():
        return ""
    if len(targets) not in (3, 4):
        return ""
    try:
        shape = checks.numbers(targets).shape
    except (TypeError, ValueError):  # several targets of some kind
        return ""
    return {(4, 4): "one pose of shape (4, 4)", (3,): "one position of shape (3,)"}.get(shape, "")


def _turning(target: FreeAxis) -> TargetPose:
    return TargetPose(target.matrix, free_axis=target)


def _at(position: Array) -> Array:
    matrix = np.eye(4)
    matrix[:3, 3] = position
    return matrix


def pose_errors(T_base_tool: pin.SE3, target: TargetPose) -> tuple[float, float]:
    """Distance [m] and angle [rad] between the tool and the target; the angle is 0 when the orientation is free."""
    position, orientation = matrix_errors(T_base_tool, target.matrix)
    return position, 0.0 if target.position_only else orientation


def matrix_errors(T_base_tool: pin.SE3, target: Array) -> tuple[float, float]:
    """Distance [m] and angle [rad] between the tool and a pose (4, 4)."""
    a, b, c, x, d, e, f, y, g, h, k, z, _, _, _, _ = (T_base_tool.homogeneous - target).ravel().tolist()
    position = math.hypot(x, y, z)
    chord = math.hypot(a, b, c, d, e, f, g, h, k)  # |R - R_target|_F = sqrt(8) sin(angle / 2)
    if chord < 1.0:
        return position, 2.0 * math.asin(chord / SQRT_8)
    return position, poses.rotation_angle(T_base_tool.rotation.T @ target[:3, :3])  # accurate near half a turn


def combined_error(position: float, orientation: float) -> float:
    """One measure [m] of a position error [m] and an orientation error [rad]."""
    return position + RADIAN_IN_METRES * orientation
