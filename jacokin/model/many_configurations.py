"""`Chain`: many configurations of an arm against many poses: errors, how they shrink, and Newton's method."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.model import kinematics
from jacokin.model.robot import Robot

ALIKE = 1.0, 1.0  # weights [1/m] and [1/rad]


class TargetRows(NamedTuple):
    """Poses (n, 4, 4) for the tool, which may be turned about axes (n, 3) of its own; None when they may not."""

    T: Array
    axis: Array | None = None

    def some(self, rows: NDArray[np.intp]) -> TargetRows:
        """Those of some rows."""
        return TargetRows(self.T[rows], None if self.axis is None else self.axis[rows])


class Chain:
    """The joints of one robot up to a frame, and a tool after it.

    Against a goal, a configuration is a row of coordinates: the joint angles, followed by the angle by which the goal
    is turned when it has an axis.

    Attributes:
        dof: number of joints, those after the frame included.
        arm: the joints up to the frame as kernels take them.
    """

    def __init__(self, robot: Robot, frame_id: int, tool: pin.SE3 | None) -> None:
        """Read the joints of the model."""
        self.dof = robot.dof
        self.arm = kinematics.arm_of(robot.pin_model, frame_id, tool)

    def placements(self, q: Array) -> tuple[Array, Array]:
        """Poses (k, 4, 4) of the tool in the base at configurations (k, dof), and its Jacobians (k, 6, dof) there."""
        return kinematics.frames(self.arm, np.ascontiguousarray(q))

    def errors(self, x: Array, goal: TargetRows) -> tuple[Array, Array]:
        """Position (n,) [m] and orientation (n,) [rad, for small ones] errors at configurations (n, width)."""
        error = _error(
            kinematics.poses(self.arm, np.ascontiguousarray(x[:, : self.dof])), _turned(goal, x[:, self.dof :])
        )
        return np.linalg.norm(error[:, :3], axis=1), np.linalg.norm(error[:, 3:], axis=1)

    def linearise(self, x: Array, goal: TargetRows) -> tuple[Array, Array]:
        """Errors (n, 6), linear first, and how they shrink with each coordinate (n, 6, width)."""
        placed, jacobian = self.placements(x[:, : self.dof])
        T = _turned(goal, x[:, self.dof :])
        if goal.axis is not None:
            away = np.zeros((len(x), 6, 1))
            away[:, 3:] = -(T[:, :3, :3] @ goal.axis[:, :, None])
            jacobian = np.concatenate([jacobian, away], axis=2)
        return _error(placed, T), jacobian

    def close(
        self, x: Array, goal: TargetRows, held: NDArray[np.bool_] | None = None, weight: tuple[float, float] = ALIKE
    ) -> tuple[Array, Array]:
        """Newton's method from configurations (n, width) towards a goal, in steps of least length.

        Where fewer than six coordinates cannot reach it, least squares.

        Args:
            x: (n, width) where it begins.
            goal: (n,) poses.
            held: (n, width) coordinates that do not move; None for none.
            weight: of position and orientation in these least squares [1/m] and [1/rad].

        Returns:
            (n, width) where it ended, and (n,) the larger of the position [m] and orientation [rad] errors there.
        """
        x = x.copy()
        worst = np.full(len(x), np.inf)
        active = np.arange(len(x))
        longest = 0.3  # [rad] step of a coordinate
        for _ in range(12):
            error, jacobian = self.linearise(x[active], goal.some(active))
            worst[active] = np.maximum(np.linalg.norm(error[:, :3], axis=1), np.linalg.norm(error[:, 3:], axis=1))
            going = worst[active] > 1e-11  # [m] and [rad] rounding
            if not going.any():
                break
            active, error, jacobian = active[going], error[going], jacobian[going]
            if held is not None:
                jacobian = jacobian * ~held[active, None, :]
            if weight != ALIKE:
                rows = np.repeat(weight, 3)
                error, jacobian = error * rows, jacobian * rows[:, None]
            step = _solved(jacobian, error) if held is None and jacobian.shape[2] == 6 else _shortest(jacobian, error)
            x[active] += step * (longest / np.maximum(np.abs(step).max(axis=1, keepdims=True), longest))
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


def _error(placed: Array, T: Array) -> Array:
    """Errors (n, 6) of poses (n, 4, 4) against others in the base: linear [m], then the axis times sin(angle)."""
    turn = T[:, :3, :3] @ placed[:, :3, :3].swapaxes(1, 2)
    skew = turn - turn.swapaxes(1, 2)
    angular = 0.5 * np.stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]], axis=1)
    return np.hstack([T[:, :3, 3] - placed[:, :3, 3], angular])


def _solved(jacobian: Array, error: Array) -> Array:
    try:
        return np.asarray(np.linalg.solve(jacobian, error[..., None])[..., 0])
    except np.linalg.LinAlgError:  # one of them is exactly singular
        return np.asarray((np.linalg.pinv(jacobian) @ error[..., None])[..., 0])


def _shortest(jacobian: Array, error: Array) -> Array:
    """The steps (n, width) of least length."""
    back = np.swapaxes(jacobian, 1, 2)
    square = jacobian @ back
    square[:, range(6), range(6)] += 1e-14  # a singular Jacobian is inverted, too
    return np.asarray((back @ np.linalg.solve(square, error[..., None]))[..., 0])
