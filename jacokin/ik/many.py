"""Forward kinematics of many configurations at once, in NumPy: for searches that descend from many starts together."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from jacokin.arrays import Array
from jacokin.model.robot import Robot


class Placements(NamedTuple):
    """Where the tool and the joints of k configurations are, in the base."""

    position: Array
    """(k, 3) of the tool [m]."""
    rotation: Array
    """(k, 3, 3) of the tool."""
    linear: Array
    """(k, dof, 3) velocity of the tool for a unit rate of each joint."""
    angular: Array
    """(k, dof, 3) angular velocity of the tool for a unit rate of each joint."""


class Chain:
    """The joints of one robot up to a frame, and a tool after it.

    Attributes:
        dof: number of joints, those after the frame included.
    """

    def __init__(self, robot: Robot, frame_id: int, tool: pin.SE3 | None) -> None:
        """Read every joint of the model: its rotation is A + cos(q) B + sin(q) C."""
        self.dof = robot.dof
        model = robot.pin_model
        data, zero = model.createData(), np.zeros(model.nq)
        self._sliding = robot.sliding
        self._offsets = np.array([model.jointPlacements[joint].translation for joint in range(1, model.njoints)])
        self._axes = np.zeros((robot.dof, 3))
        self._fixed, self._cosine, self._sine = np.zeros((3, robot.dof, 3, 3))
        for index in range(robot.dof):
            twist = pin.computeJointJacobian(model, data, zero, index + 1).reshape(6, robot.dof)[:, index]
            rotation = model.jointPlacements[index + 1].rotation
            axis = self._axes[index] = twist[:3] if robot.sliding[index] else twist[3:]
            if robot.sliding[index]:
                self._fixed[index] = rotation
                continue
            along = np.outer(axis, axis)
            self._fixed[index] = rotation @ along
            self._cosine[index] = rotation @ (np.eye(3) - along)
            self._sine[index] = rotation @ pin.skew(axis)
        frame = model.frames[frame_id]
        self._joints = int(frame.parentJoint)
        self._tip = frame.placement if tool is None else frame.placement * tool

    def placements(self, q: Array) -> Placements:
        """Of the tool, and its velocities, at configurations (k, dof)."""
        angle = q[:, :, None, None]
        rotations = self._fixed + np.cos(angle) * self._cosine + np.sin(angle) * self._sine
        axes, origins = np.zeros((2, *q.shape, 3))
        rotation, position = np.broadcast_to(np.eye(3), (len(q), 3, 3)), np.zeros((len(q), 3))
        for index in range(self._joints):
            position = position + rotation @ self._offsets[index]
            rotation = rotation @ rotations[:, index]
            axes[:, index] = rotation @ self._axes[index]
            if self._sliding[index]:
                position = position + q[:, index, None] * axes[:, index]
            origins[:, index] = position
        position = position + rotation @ self._tip.translation
        rotation = rotation @ self._tip.rotation
        linear = cross(axes, position[:, None] - origins)
        if not self._sliding.any():
            return Placements(position, rotation, linear, axes)
        slides = self._sliding[:, None]
        return Placements(position, rotation, np.where(slides, axes, linear), np.where(slides, 0.0, axes))


def cross(a: Array, b: Array) -> Array:
    """Cross products over the last axis; `np.cross` takes several times as long."""
    product = np.empty(np.broadcast_shapes(a.shape, b.shape))
    product[..., 0] = a[..., 1] * b[..., 2] - a[..., 2] * b[..., 1]
    product[..., 1] = a[..., 2] * b[..., 0] - a[..., 0] * b[..., 2]
    product[..., 2] = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return product


def angle_and_axis(rotation: Array) -> tuple[Array, Array]:
    """Angles (k,) [rad] and unit axes (k, 3) of rotations (k, 3, 3); the axis is zero where there is no rotation."""
    skew = rotation - np.swapaxes(rotation, 1, 2)
    axis = np.stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]], axis=1)
    sine = np.sqrt(np.einsum("ki,ki->k", axis, axis))
    angle = np.arctan2(sine, np.trace(rotation, axis1=1, axis2=2) - 1.0)
    return angle, axis / np.maximum(sine, 1e-300)[:, None]
