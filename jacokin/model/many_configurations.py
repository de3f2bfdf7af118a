"""`Chain`: many configurations at once: placements of the tool, errors against poses, Newton's method."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.model import batches
from jacokin.model.robot import Robot

CLOSED = 1e-11  # [m] and [rad] an error below this is rounding
LONGEST_STEP = 0.3  # [rad] of a coordinate in one Newton step
ITERATIONS = 12
DAMPING = 1e-14  # of a step of least length: what a singular Jacobian is inverted with


class TargetRows(NamedTuple):
    """Poses (n, 4, 4) for the tool, which may be turned about axes (n, 3) of its own; None when they may not."""

    T: Array
    axis: Array | None = None

    def some(self, rows: NDArray[np.intp]) -> TargetRows:
        """Those of some rows."""
        return TargetRows(self.T[rows], None if self.axis is None else self.axis[rows])


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

    Against a goal, a configuration is a row of coordinates: the joint angles, followed by the angle by which the goal
    is turned when it has an axis.

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
        self._arm = batches.arm_of(model, frame_id, tool)

    @property
    def constants(self) -> tuple[Array, Array, int]:
        """Of the joints (dof, 34), the tool after the last one (3, 4), and how many joints there are up to it.

        Columns: of the rotation at zero and of what the cosine and the sine of the angle add, rows one after another;
        the offset [m]; the axis; 1 for a joint that slides.
        """
        rotations = np.stack([self._fixed, self._cosine, self._sine], axis=1).reshape(self.dof, 27)
        rows = np.column_stack([rotations, self._offsets, self._axes, self._sliding])
        return rows, self._tip.homogeneous[:3], self._joints

    def placements(self, q: Array) -> Placements:
        """Of the tool, and its velocities, at configurations (k, dof)."""
        T, jacobian = batches.poses_and_jacobians(self._arm, q, "local_world_aligned")
        linear, angular = jacobian[:, :3].swapaxes(1, 2), jacobian[:, 3:].swapaxes(1, 2)
        return Placements(T[:, :3, 3], T[:, :3, :3], linear, angular)

    def errors(self, x: Array, goal: TargetRows) -> tuple[Array, Array]:
        """Position (n,) [m] and orientation (n,) [rad, for small ones] errors at configurations (n, width)."""
        error = _error(batches.poses(self._arm, x[:, : self.dof]), _turned(goal, x[:, self.dof :]))
        return np.linalg.norm(error[:, :3], axis=1), np.linalg.norm(error[:, 3:], axis=1)

    def linearise(self, x: Array, goal: TargetRows) -> tuple[Array, Array]:
        """Errors (n, 6), linear first, and how they shrink with each coordinate (n, 6, width)."""
        placed, jacobian = batches.poses_and_jacobians(self._arm, x[:, : self.dof], "local_world_aligned")
        T = _turned(goal, x[:, self.dof :])
        if goal.axis is not None:
            away = np.zeros((len(x), 6, 1))
            away[:, 3:] = -(T[:, :3, :3] @ goal.axis[:, :, None])
            jacobian = np.concatenate([jacobian, away], axis=2)
        return _error(placed, T), jacobian

    def close(self, x: Array, goal: TargetRows, held: NDArray[np.bool_] | None = None) -> tuple[Array, Array]:
        """Newton's method from configurations (n, width) towards a goal, in steps of least length.

        Args:
            x: (n, width) where it begins.
            goal: (n,) poses.
            held: (n, width) coordinates that do not move; None for none.

        Returns:
            (n, width) where it ended, and (n,) the larger of the position [m] and orientation [rad] errors there.
        """
        x = x.copy()
        worst = np.full(len(x), np.inf)
        active = np.arange(len(x))
        for _ in range(ITERATIONS):
            error, jacobian = self.linearise(x[active], goal.some(active))
            worst[active] = np.maximum(np.linalg.norm(error[:, :3], axis=1), np.linalg.norm(error[:, 3:], axis=1))
            going = worst[active] > CLOSED
            if not going.any():
                break
            active, error, jacobian = active[going], error[going], jacobian[going]
            if held is not None:
                jacobian = jacobian * ~held[active, None, :]
            step = _solved(jacobian, error) if held is None and jacobian.shape[2] == 6 else _shortest(jacobian, error)
            longest = np.abs(step).max(axis=1, keepdims=True)
            x[active] += step * np.minimum(1.0, LONGEST_STEP / np.maximum(longest, LONGEST_STEP))
        return x, worst


def _turned(goal: TargetRows, angle: Array) -> Array:
    """The poses (n, 4, 4), turned by angles (n, 1)."""
    if goal.axis is None:
        return goal.T
    x, y, z = goal.axis.T
    skew = np.zeros((len(goal.T), 3, 3))
    skew[:, 0, 1], skew[:, 0, 2], skew[:, 1, 2] = -z, y, -x
    skew -= np.swapaxes(skew, 1, 2)
    sine, versine = np.sin(angle)[:, :, None], 1.0 - np.cos(angle)[:, :, None]
    T = goal.T.copy()
    T[:, :3, :3] @= np.eye(3) + sine * skew + versine * (skew @ skew)
    return T


def _error(reached: Array, T: Array) -> Array:
    """Errors (n, 6) of poses (n, 4, 4) against others in the base: linear [m], then the axis times sin(angle)."""
    turn = T[:, :3, :3] @ reached[:, :3, :3].swapaxes(1, 2)
    skew = turn - turn.swapaxes(1, 2)
    angular = 0.5 * np.stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]], axis=1)
    return np.hstack([T[:, :3, 3] - reached[:, :3, 3], angular])


def _solved(jacobian: Array, error: Array) -> Array:
    try:
        return np.asarray(np.linalg.solve(jacobian, error[..., None])[..., 0])
    except np.linalg.LinAlgError:  # one of them is exactly singular
        return np.asarray((np.linalg.pinv(jacobian) @ error[..., None])[..., 0])


def _shortest(jacobian: Array, error: Array) -> Array:
    """The steps (n, width) of least length."""
    back = np.swapaxes(jacobian, 1, 2)
    square = jacobian @ back
    square[:, range(6), range(6)] += DAMPING
    return np.asarray((back @ np.linalg.solve(square, error[..., None]))[..., 0])
