"""Tasks: the error of a frame against its target, and the Jacobian of that error.

Each task gives a Jacobian J and an error e, weights included: a displacement x of the joints with J x = e reaches the
target to first order. It also measures the error in metres and radians.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from typing import Any

import numpy as np
import pinocchio as pin

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.ik.targets import RADIAN_IN_METRES
from jacokin.model import poses
from jacokin.model.robot import Robot

TOOL_FRAME = "jacokin_tool"


class Kinematics:
    """The arm with a tool frame.

    Attributes:
        tool: number of the tool frame.
    """

    def __init__(self, robot: Robot, joint: int, T_joint_tool: pin.SE3) -> None:
        """Add the tool frame to a copy of the robot's model.

        Args:
            robot: the arm.
            joint: Pinocchio's number of the joint that carries the tool.
            T_joint_tool: pose of the tool there.
        """
        self._robot = robot
        self._model = pin.Model(robot.pin_model)
        self.tool: int = self._model.addFrame(pin.Frame(TOOL_FRAME, joint, T_joint_tool, pin.FrameType.OP_FRAME))
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

    def frame(self, name: str | None) -> int:
        """Number of a frame; None for the tool.

        Raises:
            UnknownNameError: no such frame.
            InvalidInputError: it is fixed to the base.
        """
        if name is None:
            return self.tool
        number = self._robot.frame_id(name)
        if self._model.frames[number].parentJoint == 0:
            raise InvalidInputError(f"frame {name!r} is fixed to the base and cannot follow a target")
        return number

    def pose(self, frame: int) -> pin.SE3:
        """T_base_frame; changes with the next `move_to`."""
        return pin.updateFramePlacement(self._model, self._data, frame)

    def jacobian(self, frame: int, reference: pin.ReferenceFrame) -> Array:
        """(6, dof) linear rows [m/rad], then angular ones."""
        jacobian: Array = pin.getFrameJacobian(self._model, self._data, frame, reference)
        return jacobian.reshape(6, -1)  # one joint gives six numbers without a second axis


FAR = 100.0  # [m] from the base; nothing beyond is within reach, and its error would drown all else in the QP
IN_BASE = pin.LOCAL_WORLD_ALIGNED  # at the frame's origin, axes of the base


def _within_far(position: Array) -> Array:
    """The position (3,) [m], or if it is farther than `FAR` from the base, the one at `FAR` on the way there."""
    largest: float = max(map(abs, position.tolist()))  # a third of what numpy takes, at every tick
    if largest <= FAR:
        return position
    direction = position / largest  # whose norm does not overflow
    return np.asarray(FAR * direction / np.linalg.norm(direction))


class Task(ABC):
    """One target on one frame."""

    def __init__(self, frame: int, weight: float) -> None:
        """Remember the frame's number and the weight."""
        self._frame = frame
        self._weight = weight

    @abstractmethod
    def error(self, kinematics: Kinematics) -> Array:
        """Weighted error e (k,): what is missing to the target."""

    @abstractmethod
    def linearised(self, kinematics: Kinematics) -> tuple[Array, Array]:
        """Weighted Jacobian J (k, dof) and the same error e (k,)."""

    @abstractmethod
    def measure(self, kinematics: Kinematics) -> tuple[float, float]:
        """Distance [m] and angle [rad] to the target."""

    def inequalities(self, kinematics: Kinematics) -> tuple[Array, Array] | None:
        """G and h of G x <= h that keep what is reached, or None."""
        return None


class PoseTask(Task):
    """Position and orientation, or orientation alone: the SE(3) logarithm of T_target_frame.

    With M = T_target_frame, log(M exp(v)) = log(M) + Jlog(M) v to first order, so log(M) vanishes where
    Jlog(M) J x = -log(M) (Sola, Deray, Atchuthan: A micro Lie theory for state estimation in robotics, 2018).
    """

    def __init__(self, frame: int, weight: float, *, orientation_only: bool = False) -> None:
        """Start at the identity; `set` gives the pose."""
        super().__init__(frame, weight)
        self._orientation_only = orientation_only
        linear = 0.0 if orientation_only else weight
        self._cost = np.array([linear] * 3 + [weight * RADIAN_IN_METRES] * 3)
        self._costs = self._cost[:, None]
        self.set(pin.SE3.Identity())

    def set(self, pose: pin.SE3) -> None:
        """Set T_base_frame, which must not change until it is set again."""
        self._pose, position = pose, pose.translation
        near = _within_far(position)
        self._near = pose if near is position else pin.SE3(pose.rotation, near)

    def error(self, kinematics: Kinematics) -> Array:
        """Weighted logarithm of the way to the target."""
        return np.asarray(-self._cost * pin.log6(self._near.actInv(kinematics.pose(self._frame))).vector)

    def linearised(self, kinematics: Kinematics) -> tuple[Array, Array]:
        """Weighted Jacobian of that logarithm, and itself."""
        way = self._near.actInv(kinematics.pose(self._frame))
        jacobian = pin.Jlog6(way).dot(kinematics.jacobian(self._frame, pin.LOCAL))
        return self._costs * jacobian, -self._cost * pin.log6(way).vector

    def measure(self, kinematics: Kinematics) -> tuple[float, float]:
        """Distance and angle."""
        pose = kinematics.pose(self._frame)
        angle = poses.rotation_angle(pose.rotation.T.dot(self._pose.rotation))
        if self._orientation_only:
            return 0.0, angle
        return math.dist(pose.translation.tolist(), self._pose.translation.tolist()), angle


class PositionTask(Task):
    """Position alone."""

    def __init__(self, frame: int, weight: float, position: Array) -> None:
        """Keep the position (3,) [m]."""
        super().__init__(frame, weight)
        self._position, self._near = position, _within_far(position)

    def error(self, kinematics: Kinematics) -> Array:
        """Weighted difference of the positions."""
        return np.asarray(self._weight * (self._near - kinematics.pose(self._frame).translation))

    def linearised(self, kinematics: Kinematics) -> tuple[Array, Array]:
        """Weighted linear Jacobian, and the error."""
        return self._weight * kinematics.jacobian(self._frame, IN_BASE)[:3], self.error(kinematics)

    def measure(self, kinematics: Kinematics) -> tuple[float, float]:
        """Distance; the orientation is free."""
        return math.dist(kinematics.pose(self._frame).translation.tolist(), self._position.tolist()), 0.0


class AxisTask(Task):
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

    def linearised(self, kinematics: Kinematics) -> tuple[Array, Array]:
        """Weighted angular Jacobian without the rotation about the axis, and the error."""
        points, rotation, _ = self._rotation(kinematics)
        angular = kinematics.jacobian(self._frame, IN_BASE)[3:]
        weight = self._weight * RADIAN_IN_METRES
        return weight * (angular - np.outer(points, points @ angular)), weight * rotation

    def measure(self, kinematics: Kinematics) -> tuple[float, float]:
        """Angle between axis and direction."""
        return 0.0, self._rotation(kinematics)[2]


class RegionTask(Task):
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

    def linearised(self, kinematics: Kinematics) -> tuple[Array, Array]:
        """Weighted linear Jacobian along the axes of the base in which the frame is outside, and the error."""
        difference = self._difference(kinematics)
        outside = (difference != 0.0).astype(np.float64)[:, None]
        jacobian = self._weight * outside * kinematics.jacobian(self._frame, IN_BASE)[:3]
        return np.asarray(jacobian), self._weight * difference

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
