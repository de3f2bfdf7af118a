"""Forward kinematics and Newton steps of many configurations at once, on the placements of the closed form."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array

CLOSED = 1e-11  # [m] and [rad] an error below this is rounding
LONGEST_STEP = 0.3  # [rad] of a coordinate in one Newton step
ITERATIONS = 12
DAMPING = 1e-14  # of a step of least length: what a singular Jacobian is inverted with


class Goal(NamedTuple):
    """Poses (n, 4, 4) for the tool, which may be turned about axes (n, 3) of its own; None when they may not."""

    T: Array
    axis: Array | None = None

    def some(self, rows: NDArray[np.intp]) -> Goal:
        """Those of some rows."""
        return Goal(self.T[rows], None if self.axis is None else self.axis[rows])


class Chain:
    """Revolute joints in a row: pose = C0 Rz(q1) C1 Rz(q2) ... Rz(qn) Cn.

    A configuration is the joint angles, followed by the angle by which the goal is turned when it has an axis.
    """

    def __init__(self, placements: Array) -> None:
        """Take the placements (dof + 1, 3, 4) [-, m]."""
        self._placements = placements
        self.dof = len(placements) - 1

    def poses(self, q: Array) -> tuple[Array, Array]:
        """Rotations (n, 3, 3) and positions (n, 3) [m] of the tool at configurations (n, dof) [rad]."""
        return self._walk(q)[:2]

    def _walk(self, q: Array) -> tuple[Array, Array, Array, Array]:
        """Pose of the tool, and axes (n, dof, 3) and origins (n, dof, 3) of the joints."""
        cos, sin = np.cos(q), np.sin(q)
        axes, origins = np.empty((*q.shape, 3)), np.empty((*q.shape, 3))
        first = self._placements[0]
        rotation = np.broadcast_to(first[:, :3], (len(q), 3, 3))
        position = np.broadcast_to(first[:, 3], (len(q), 3))
        for joint in range(self.dof):
            axes[:, joint], origins[:, joint] = rotation[:, :, 2], position
            x, y = rotation[:, :, 0], rotation[:, :, 1]
            c, s = cos[:, joint, None], sin[:, joint, None]
            turned = np.stack([c * x + s * y, c * y - s * x, rotation[:, :, 2]], axis=-1)
            placement = self._placements[joint + 1]
            position = position + turned @ placement[:, 3]
            rotation = turned @ placement[:, :3]
        return rotation, position, axes, origins

    def errors(self, x: Array, goal: Goal) -> tuple[Array, Array]:
        """Position (n,) [m] and orientation (n,) [rad, for small ones] errors at configurations (n, width)."""
        rotation, position = self.poses(x[:, : self.dof])
        linear, angular = _error(rotation, position, _turned(goal, x[:, self.dof :]))
        return np.linalg.norm(linear, axis=1), np.linalg.norm(angular, axis=1)

    def linearised(self, x: Array, goal: Goal) -> tuple[Array, Array]:
        """Errors (n, 6), linear first, and how they shrink with each coordinate (n, 6, width)."""
        rotation, position, axes, origins = self._walk(x[:, : self.dof])
        T = _turned(goal, x[:, self.dof :])
        linear, angular = _error(rotation, position, T)
        moved = np.cross(axes, position[:, None] - origins)
        jacobian = np.swapaxes(np.concatenate([moved, axes], axis=2), 1, 2)
        if goal.axis is not None:
            away = np.zeros((len(x), 6, 1))
            away[:, 3:] = -(T[:, :3, :3] @ goal.axis[:, :, None])
            jacobian = np.concatenate([jacobian, away], axis=2)
        return np.concatenate([linear, angular], axis=1), jacobian

    def closed(self, x: Array, goal: Goal, held: NDArray[np.bool_] | None = None) -> tuple[Array, Array]:
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
            error, jacobian = self.linearised(x[active], goal.some(active))
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


def _turned(goal: Goal, angle: Array) -> Array:
    """The poses (n, 4, 4), turned by angles (n, 1)."""
    if goal.axis is None:
        return goal.T
    x, y, z = goal.axis.T
    cross = np.zeros((len(goal.T), 3, 3))
    cross[:, 0, 1], cross[:, 0, 2], cross[:, 1, 2] = -z, y, -x
    cross -= np.swapaxes(cross, 1, 2)
    sine, versine = np.sin(angle)[:, :, None], 1.0 - np.cos(angle)[:, :, None]
    T = goal.T.copy()
    T[:, :3, :3] @= np.eye(3) + sine * cross + versine * (cross @ cross)
    return T


def _error(rotation: Array, position: Array, T: Array) -> tuple[Array, Array]:
    """Linear (n, 3) [m] and angular (n, 3) error in the base: the angle's sine, its length exact when it is small."""
    columns = np.cross(rotation, T[:, :3, :3], axisa=1, axisb=1).sum(axis=1)
    return T[:, :3, 3] - position, 0.5 * columns


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
