"""What the tracker can be asked for: poses, parts of poses and regions, on any frame, with weights; and their tasks.

Each target constrains one frame; `Tracker.step` takes one of them or several at once. All are in the base frame. A task
is the error e of a frame against its target and the Jacobian J of that error, weights included: a displacement x of the
joints with J x = e reaches the target to first order. It also measures the error in metres and radians.
"""

from __future__ import annotations

import functools
import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.ik import targets
from jacokin.ik.targets import RADIAN_IN_METRES
from jacokin.model import checks, poses
from jacokin.model.robot import Robot

RIGID = 1e-9  # a pose this near to rigid is used as it is; others are checked and made rigid
FAR = 100.0  # [m] from the base; nothing beyond is within reach, and its error would drown all else in the QP
IN_BASE = pin.LOCAL_WORLD_ALIGNED  # at the frame's origin, axes of the base
TOOL_FRAME = "jacokin_tool"


@dataclass(frozen=True, slots=True, eq=False)
class TrackingTarget(targets.PartialTarget):
    """What all targets share.

    Attributes:
        frame: the frame it is for; None for the tracker's own frame (with its tool).
        weight: how much it counts against other targets of the same priority, > 0.
        priority: 0 comes first. Targets of the next number use what freedom is left, and cost those before nothing.
    """

    frame: str | None = field(default=None, kw_only=True)
    weight: float = field(default=1.0, kw_only=True)
    priority: int = field(default=0, kw_only=True)

    def __post_init__(self) -> None:
        """Check weight and priority."""
        object.__setattr__(self, "weight", checks.positive("weight", self.weight))
        object.__setattr__(self, "priority", checks.whole_number("priority", self.priority))

    def make_task(self, frame: int) -> FrameTask:
        """The task for the tracker, on a frame by its number."""
        raise InvalidInputError(f"unknown kind of target {type(self).__name__}")


@dataclass(frozen=True, slots=True, eq=False)
class PoseTarget(TrackingTarget):
    """Position and orientation: T_base_frame as `pin.SE3` or (4, 4)."""

    pose: pin.SE3 | ArrayLike

    def __post_init__(self) -> None:
        """Check the pose."""
        TrackingTarget.__post_init__(self)
        object.__setattr__(self, "pose", poses.checked_pose(self.pose, "pose"))

    def constraint(self) -> targets.Constraint:
        """Position and orientation."""
        assert isinstance(self.pose, pin.SE3)  # __post_init__ made it one
        return targets.Constraint(position=self.pose.translation.copy(), rotation=self.pose.rotation.copy())

    def make_task(self, frame: int) -> FrameTask:
        """Position and orientation."""
        assert isinstance(self.pose, pin.SE3)  # __post_init__ made it one
        return PoseTask(frame, self.weight, self.pose)


@dataclass(frozen=True, slots=True, eq=False)
class PositionTarget(TrackingTarget):
    """Position (3,) [m]; the orientation is free."""

    position: ArrayLike

    def __post_init__(self) -> None:
        """Check the position."""
        TrackingTarget.__post_init__(self)
        object.__setattr__(self, "position", checks.read_only(checks.vector("position", self.position, 3, "m")))

    def constraint(self) -> targets.Constraint:
        """The position."""
        return targets.Constraint(position=np.asarray(self.position))

    def make_task(self, frame: int) -> FrameTask:
        """Position alone."""
        return PositionTask(frame, self.weight, np.asarray(self.position))


@dataclass(frozen=True, slots=True, eq=False)
class OrientationTarget(TrackingTarget):
    """Orientation (3, 3); the position is free."""

    rotation: ArrayLike

    def __post_init__(self) -> None:
        """Check the rotation."""
        TrackingTarget.__post_init__(self)
        object.__setattr__(self, "rotation", checks.read_only(poses.checked_rotation("rotation", self.rotation)))

    def constraint(self) -> targets.Constraint:
        """The orientation."""
        return targets.Constraint(rotation=np.asarray(self.rotation))

    def make_task(self, frame: int) -> FrameTask:
        """Orientation alone."""
        return PoseTask(frame, self.weight, pin.SE3(np.asarray(self.rotation), np.zeros(3)), orientation_only=True)


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
        object.__setattr__(self, "direction", checks.read_only(poses.unit_vector("direction", self.direction)))
        object.__setattr__(self, "axis", checks.read_only(poses.unit_vector("axis", self.axis)))

    def constraint(self) -> targets.Constraint:
        """The direction of the axis."""
        return targets.Constraint(axis=np.asarray(self.axis), direction=np.asarray(self.direction))

    def make_task(self, frame: int) -> FrameTask:
        """Two directions aligned."""
        return AxisTask(frame, self.weight, np.asarray(self.axis), np.asarray(self.direction))


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
            corner = checks.read_only(checks.array(name, value, "3 numbers", "m"))
            if corner.shape != (3,) or np.isnan(corner).any():
                raise checks.refusal(name, "3 numbers", value, "m")
            object.__setattr__(self, name, corner)
            corners.append(corner)
        if not (corners[0] <= corners[1]).all():
            raise InvalidInputError(f"lower {corners[0].tolist()} must not exceed upper {corners[1].tolist()}")

    def make_task(self, frame: int) -> FrameTask:
        """Position in the box."""
        return RegionTask(frame, self.weight, np.asarray(self.lower), np.asarray(self.upper))


@dataclass(frozen=True, slots=True, eq=False)
class JointTarget(TrackingTarget):
    """Joint angles (dof,) [rad]; unlimited joints turn as far as the numbers say. It takes no `frame`."""

    q: ArrayLike

    def __post_init__(self) -> None:
        """Check the angles, whose number the tracker checks."""
        TrackingTarget.__post_init__(self)
        if self.frame is not None:
            raise InvalidInputError("a JointTarget is for all joints and takes no frame")
        array = checks.array("q", self.q, "joint angles", "rad")
        object.__setattr__(self, "q", checks.read_only(checks.vector("q", array, max(array.size, 1), "rad")))

    def make_task(self, frame: int) -> FrameTask:
        """Every joint at its angle."""
        return JointTask(frame, self.weight, np.asarray(self.q))


class TaskFactory:
    """Makes tasks from what `Tracker.step` takes."""

    def __init__(self, kinematics: Kinematics) -> None:
        """Keep the kinematics for its frames."""
        self._kinematics = kinematics

    def tasks(self, target: pin.SE3 | ArrayLike | TrackingTarget | Sequence[TrackingTarget] | None) -> list[FrameTask]:
        """Tasks for a target or several; errors as in `Tracker.step`."""
        if isinstance(target, pin.SE3):
            return [PoseTask(self._kinematics.tool, 1.0, target if _rigid(target) else poses.checked_pose(target))]
        if isinstance(target, TrackingTarget):
            return [self._task(target)]
        if isinstance(target, list | tuple) and any(isinstance(one, TrackingTarget) for one in target):
            return [self._task(one) for one in target]
        checked = targets.checked_target(target)  # refuses what is neither a pose nor a position
        if checked.position_only:
            return [self._task(PositionTarget(checked.position))]
        return [PoseTask(self._kinematics.tool, 1.0, pin.SE3(checked.rotation, checked.position))]

    def _task(self, target: TrackingTarget) -> FrameTask:
        if not isinstance(target, TrackingTarget):
            raise InvalidInputError(
                f"several targets must each be a PoseTarget, PositionTarget, ..., got {type(target).__name__}"
            )
        if isinstance(target, JointTarget):
            self._kinematics.robot.configuration(target.q, "JointTarget")
        task = target.make_task(self._kinematics.frame(target.frame))
        task.priority = target.priority
        return task


def _rigid(pose: pin.SE3) -> bool:
    """Whether a pose is finite, right-handed and orthonormal to 1e-9; cheap, as every tick asks it."""
    (a, b, c), (d, e, f), (g, h, i) = pose.rotation.tolist()
    x, y, z = pose.translation.tolist()
    misfit: float = (
        abs(a * a + b * b + c * c - 1.0)
        + abs(d * d + e * e + f * f - 1.0)
        + abs(a * d + b * e + c * f)
        + abs(b * f - c * e - g)
        + abs(c * d - a * f - h)
        + abs(a * e - b * d - i)
    )
    return bool(misfit < RIGID and abs(x) + abs(y) + abs(z) < 1e9)


class Kinematics:
    """The arm with a tool frame.

    Attributes:
        robot: the arm.
        tool: number of the tool frame.
    """

    def __init__(self, robot: Robot, frame: str, tool: pin.SE3 | None) -> None:
        """Add the tool frame to a copy of the robot's model.

        Args:
            robot: the arm.
            frame: the frame that carries the tool.
            tool: T_frame_tool; None for the frame itself.

        Raises:
            UnknownNameError: no such frame.
            InvalidInputError: it is fixed to the base.
        """
        self.robot = robot
        self._model = pin.Model(robot.pin_model)
        carrier = self._model.frames[self.frame(frame)]
        placement = carrier.placement if tool is None else carrier.placement * tool
        self.tool: int = self._model.addFrame(
            pin.Frame(TOOL_FRAME, carrier.parentJoint, placement, pin.FrameType.OP_FRAME)
        )
        self._data = self._model.createData()
        self._computed: Array | None = None

    def __getstate__(self) -> dict[str, Any]:
        """Everything but what was computed last."""
        return {**self.__dict__, "_computed": None}

    def move_to(self, q: Array) -> None:
        """Compute the joints' poses and Jacobian at a configuration (dof,) [rad], unless it was the last one.

        Arrays are told apart by identity: `q` must not change afterwards.
        """
        if self._computed is q:
            return
        self._computed = None  # until it is done
        pin.computeJointJacobians(self._model, self._data, q)
        self._computed = q

    @property
    def q(self) -> Array:
        """(dof,) configuration of the last `move_to` [rad]."""
        assert self._computed is not None
        return self._computed

    def frame(self, name: str | None) -> int:
        """Number of a frame; None for the tool.

        Raises:
            UnknownNameError: no such frame.
            InvalidInputError: it is fixed to the base.
        """
        if name is None:
            return self.tool
        number = self.robot.frame_id(name)
        if self._model.frames[number].parentJoint == 0:
            moving = [n for n in self.robot.frames if self._model.frames[self.robot.frame_id(n)].parentJoint > 0]
            raise InvalidInputError(f"frame {name!r} is fixed to the base and cannot follow a target; {moving} move")
        return number

    def pose(self, frame: int) -> pin.SE3:
        """T_base_frame; changes with the next `move_to`."""
        return pin.updateFramePlacement(self._model, self._data, frame)

    def jacobian(self, frame: int, reference: pin.ReferenceFrame) -> Array:
        """(6, dof) linear rows [m/rad], then angular ones."""
        jacobian: Array = pin.getFrameJacobian(self._model, self._data, frame, reference)
        return jacobian.reshape(6, -1)  # one joint gives six numbers without a second axis

    def jacobian_change(self, displacement: Array) -> Array:
        """(6, dof) by how much the tool's Jacobian in base axes changes with a small displacement (dof,) [rad]."""
        assert self._computed is not None
        pin.computeJointJacobiansTimeVariation(self._model, self._data, self._computed, displacement)
        pin.updateFramePlacement(self._model, self._data, self.tool)
        change: Array = pin.getFrameJacobianTimeVariation(self._model, self._data, self.tool, IN_BASE)
        return change.reshape(6, -1)


def _limit_distance(position: Array) -> Array:
    """The position (3,) [m], or if it is farther than `FAR` from the base, the one at `FAR` on the way there."""
    largest: float = max(map(abs, position.tolist()))  # a third of what numpy takes, at every tick
    if largest <= FAR:
        return position
    direction = position / largest  # whose norm does not overflow
    return np.asarray(FAR * direction / np.linalg.norm(direction))


class FrameTask(ABC):
    """One target on one frame.

    Attributes:
        priority: see `TrackingTarget`.
    """

    priority: int = 0

    def __init__(self, frame: int, weight: float) -> None:
        """Remember the frame's number and the weight."""
        self._frame = frame
        self._weight = weight

    def is_like(self, other: FrameTask) -> bool:
        """Whether it asks the same of the same frame, at another place."""
        return type(self) is type(other) and self._frame == other._frame and self._weight == other._weight

    @abstractmethod
    def error(self, kinematics: Kinematics) -> Array:
        """Weighted error e (k,): what is missing to the target."""

    @abstractmethod
    def linearise(self, kinematics: Kinematics) -> tuple[Array, Array]:
        """Weighted Jacobian J (k, dof) and the same error e (k,)."""

    @abstractmethod
    def bend(self, kinematics: Kinematics, left: Array) -> Array:
        """How J turns, against an error `left` (k,) that stays: (dof, dof), minus the sum of left_i dJ_i/dq."""

    @abstractmethod
    def measure(self, kinematics: Kinematics) -> tuple[float, float]:
        """Distance [m] and angle [rad] to the target."""

    def inequalities(self, kinematics: Kinematics) -> tuple[Array, Array] | None:
        """G and h of G x <= h that keep what is reached, or None."""
        return None


def _turned(*parts: tuple[Array, Array, Array]) -> Array:
    """The sum of error . (angular_i x moved_j) where joint i comes before j or is it, and symmetric: (dof, dof).

    For a position error it is that error times the second derivative of the position: joint i turns how joint j, which
    comes after it, moves the point.

    Args:
        parts: an error (3,), and what the joints turn and move, (3, dof) each.
    """
    rows = [angular.T.dot(pin.skew(error).T).dot(moved) for error, angular, moved in parts]
    total = rows[0] if len(rows) == 1 else rows[0] + rows[1]
    return np.asarray(total.take(_upper(len(total))))


@functools.cache
def _upper(size: int) -> NDArray[np.intp]:
    """(size, size) numbers of the elements in the upper triangle of a square, for both of its triangles."""
    row, column = np.indices((size, size))
    return np.asarray(np.minimum(row, column) * size + np.maximum(row, column))


class PoseTask(FrameTask):
    """Position and orientation, or orientation alone: the distance and the rotation vector to the target.

    Both are taken apart, unlike in the SE(3) logarithm: so the position goes straight whatever the orientation does.
    """

    def __init__(self, frame: int, weight: float, pose: pin.SE3, *, orientation_only: bool = False) -> None:
        """Keep a copy of T_base_frame, which the caller may change."""
        super().__init__(frame, weight)
        self._orientation_only = orientation_only
        self._costs = np.array([[weight]] * 3 + [[weight * RADIAN_IN_METRES]] * 3)
        self._pose = pin.SE3(pose)
        self._near = _limit_distance(self._pose.translation)

    def is_like(self, other: FrameTask) -> bool:
        """And whether both ask for a position."""
        return (
            super().is_like(other) and isinstance(other, PoseTask) and self._orientation_only == other._orientation_only
        )

    def _missing(self, kinematics: Kinematics) -> tuple[Array, Array]:
        """Position (3,) [m] and rotation vector (3,) [rad] that are missing, in base axes."""
        pose = kinematics.pose(self._frame)
        rotation = pin.log3(self._pose.rotation.dot(pose.rotation.T))
        return self._near - pose.translation, rotation

    def error(self, kinematics: Kinematics) -> Array:
        """Weighted position and rotation vector to the target."""
        position, rotation = self._missing(kinematics)
        turn = self._weight * RADIAN_IN_METRES * rotation
        return turn if self._orientation_only else np.concatenate([self._weight * position, turn])

    def linearise(self, kinematics: Kinematics) -> tuple[Array, Array]:
        """The weighted frame's Jacobian in base axes, and the error."""
        jacobian = kinematics.jacobian(self._frame, IN_BASE)
        if self._orientation_only:
            return self._weight * RADIAN_IN_METRES * jacobian[3:], self.error(kinematics)
        return self._costs * jacobian, self.error(kinematics)

    def bend(self, kinematics: Kinematics, left: Array) -> Array:
        """Of position and rotation."""
        jacobian = kinematics.jacobian(self._frame, IN_BASE)
        linear, angular, turn = jacobian[:3], jacobian[3:], self._weight * RADIAN_IN_METRES
        turned = -0.5 * turn * left[-3:], angular, angular
        return (
            _turned(turned) if self._orientation_only else _turned(turned, (-self._weight * left[:3], angular, linear))
        )

    def measure(self, kinematics: Kinematics) -> tuple[float, float]:
        """Distance and angle."""
        pose = kinematics.pose(self._frame)
        angle = poses.rotation_angle(pose.rotation.T.dot(self._pose.rotation))
        if self._orientation_only:
            return 0.0, angle
        return math.dist(pose.translation.tolist(), self._pose.translation.tolist()), angle


class PositionTask(FrameTask):
    """Position alone."""

    def __init__(self, frame: int, weight: float, position: Array) -> None:
        """Keep the position (3,) [m]."""
        super().__init__(frame, weight)
        self._position, self._near = position, _limit_distance(position)

    def error(self, kinematics: Kinematics) -> Array:
        """Weighted difference of the positions."""
        return np.asarray(self._weight * (self._near - kinematics.pose(self._frame).translation))

    def linearise(self, kinematics: Kinematics) -> tuple[Array, Array]:
        """Weighted linear Jacobian, and the error."""
        return self._weight * kinematics.jacobian(self._frame, IN_BASE)[:3], self.error(kinematics)

    def bend(self, kinematics: Kinematics, left: Array) -> Array:
        """Of the position."""
        jacobian = kinematics.jacobian(self._frame, IN_BASE)
        return _turned((-self._weight * left, jacobian[3:], jacobian[:3]))

    def measure(self, kinematics: Kinematics) -> tuple[float, float]:
        """Distance; the orientation is free."""
        return math.dist(kinematics.pose(self._frame).translation.tolist(), self._position.tolist()), 0.0


class AxisTask(FrameTask):
    """One axis of the frame along a direction, by the shortest rotation.

    mink's `AxisAlignTask` takes the difference of the two unit vectors as the error. Its gradient vanishes where they
    are opposite, so the arm would stay there; the rotation vector used here is longest there.
    """

    def __init__(self, frame: int, weight: float, axis: Array, direction: Array) -> None:
        """Keep a unit axis (3,) of the frame and the unit direction (3,) of the base to align it with."""
        super().__init__(frame, weight)
        self._axis, self._direction = axis, direction

    def _rotation(self, kinematics: Kinematics) -> tuple[Array, Array, float]:
        """Where the axis points, the rotation vector to the direction, and its angle."""
        points = kinematics.pose(self._frame).rotation @ self._axis
        turn = np.cross(points, self._direction)
        sine, cosine = float(np.linalg.norm(turn)), float(points @ self._direction)
        angle = math.atan2(sine, cosine)
        if sine < 1e-12:  # aligned, or opposite: any perpendicular axis does
            turn = np.cross(points, np.eye(3)[int(np.argmin(np.abs(points)))])
            sine = float(np.linalg.norm(turn))
        return points, turn * (angle / sine), angle

    def error(self, kinematics: Kinematics) -> Array:
        """Weighted rotation vector of the shortest rotation."""
        return self._weight * RADIAN_IN_METRES * self._rotation(kinematics)[1]

    def linearise(self, kinematics: Kinematics) -> tuple[Array, Array]:
        """Weighted angular Jacobian without the rotation about the axis, and the error."""
        points, rotation, _ = self._rotation(kinematics)
        angular = kinematics.jacobian(self._frame, IN_BASE)[3:]
        weight = self._weight * RADIAN_IN_METRES
        return weight * (angular - np.outer(points, points.dot(angular))), weight * rotation

    def bend(self, kinematics: Kinematics, left: Array) -> Array:
        """Of the axis' tip: an error of rotation pulls it across the axis."""
        points = kinematics.pose(self._frame).rotation @ self._axis
        angular = kinematics.jacobian(self._frame, IN_BASE)[3:]
        tip = -pin.skew(points).dot(angular)
        return _turned((-self._weight * RADIAN_IN_METRES * np.cross(left, points), angular, tip))

    def measure(self, kinematics: Kinematics) -> tuple[float, float]:
        """Angle between axis and direction."""
        return 0.0, self._rotation(kinematics)[2]


class RegionTask(FrameTask):
    """Position inside a box: pulled in from outside, kept in once inside."""

    def __init__(self, frame: int, weight: float, lower: Array, upper: Array) -> None:
        """Keep the corners (3,) [m]."""
        super().__init__(frame, weight)
        self._lower, self._upper = lower, upper

    def _difference(self, kinematics: Kinematics) -> Array:
        position = kinematics.pose(self._frame).translation
        return np.asarray(np.clip(position, self._lower, self._upper) - position)

    def error(self, kinematics: Kinematics) -> Array:
        """Weighted difference to the nearest point of the box."""
        return self._weight * self._difference(kinematics)

    def linearise(self, kinematics: Kinematics) -> tuple[Array, Array]:
        """Weighted linear Jacobian along the axes of the base in which the frame is outside, and the error."""
        difference = self._difference(kinematics)
        outside = (difference != 0.0).astype(np.float64)[:, None]
        jacobian = self._weight * outside * kinematics.jacobian(self._frame, IN_BASE)[:3]
        return np.asarray(jacobian), self._weight * difference

    def bend(self, kinematics: Kinematics, left: Array) -> Array:
        """Of the position."""
        jacobian = kinematics.jacobian(self._frame, IN_BASE)
        return _turned((-self._weight * left, jacobian[3:], jacobian[:3]))

    def inequalities(self, kinematics: Kinematics) -> tuple[Array, Array] | None:
        """Faces of the box that the frame must not cross, along the axes in which it is inside."""
        position = kinematics.pose(self._frame).translation
        linear = kinematics.jacobian(self._frame, IN_BASE)[:3]
        normals = np.vstack([linear, -linear])
        gaps = np.concatenate([self._upper - position, position - self._lower])
        use = (gaps >= 0.0) & np.isfinite(gaps)
        return (normals[use], gaps[use]) if use.any() else None

    def measure(self, kinematics: Kinematics) -> tuple[float, float]:
        """Distance to the box."""
        return float(np.linalg.norm(self._difference(kinematics))), 0.0


class JointTask(FrameTask):
    """Every joint at an angle."""

    def __init__(self, frame: int, weight: float, q: Array) -> None:
        """Keep the angles (dof,) [rad]."""
        super().__init__(frame, weight)
        self._q, self._scale = q, weight * RADIAN_IN_METRES

    def error(self, kinematics: Kinematics) -> Array:
        """Weighted difference of the angles."""
        return np.asarray(self._scale * (self._q - kinematics.q))

    def linearise(self, kinematics: Kinematics) -> tuple[Array, Array]:
        """The weights, and the error."""
        return self._scale * np.eye(len(self._q)), self.error(kinematics)

    def bend(self, kinematics: Kinematics, left: Array) -> Array:
        """None: joint angles are linear in themselves."""
        return np.zeros((len(self._q), len(self._q)))

    def measure(self, kinematics: Kinematics) -> tuple[float, float]:
        """The largest difference, as an angle."""
        return 0.0, float(np.abs(self._q - kinematics.q).max())
