"""Forward kinematics and Newton steps of many configurations at once, on the placements of the closed form."""

from __future__ import annotations

import numpy as np

from jacokin.arrays import Array

CLOSED = 1e-11  # [m] and [rad] an error below this is rounding
LONGEST_STEP = 0.3  # [rad] of a joint in one Newton step
ITERATIONS = 12


class Chain:
    """Six revolute joints in a row: pose = C0 Rz(q1) C1 Rz(q2) ... Rz(q6) C6."""

    def __init__(self, placements: Array) -> None:
        """Take the placements (7, 3, 4) [-, m]."""
        self._placements = placements
        self.dof = len(placements) - 1

    def poses(self, q: Array) -> tuple[Array, Array]:
        """Rotations (n, 3, 3) and positions (n, 3) [m] of the tool at configurations (n, 6) [rad]."""
        return self._walk(q)[:2]

    def _walk(self, q: Array) -> tuple[Array, Array, Array, Array]:
        """Pose of the tool, and axes (n, 6, 3) and origins (n, 6, 3) of the joints."""
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

    def errors(self, q: Array, T: Array) -> tuple[Array, Array]:
        """Position (n,) [m] and orientation (n,) [rad, for small ones] errors against poses (n, 4, 4)."""
        rotation, position = self.poses(q)
        linear, angular = _error(rotation, position, T)
        return np.linalg.norm(linear, axis=1), np.linalg.norm(angular, axis=1)

    def closed(self, q: Array, T: Array) -> tuple[Array, Array]:
        """Newton's method from configurations (n, 6) towards poses (n, 4, 4).

        Returns:
            (n, 6) where it ended, and (n,) the larger of the position [m] and orientation [rad] errors there.
        """
        q = q.copy()
        worst = np.full(len(q), np.inf)
        active = np.arange(len(q))
        for _ in range(ITERATIONS):
            rotation, position, axes, origins = self._walk(q[active])
            linear, angular = _error(rotation, position, T[active])
            worst[active] = np.maximum(np.linalg.norm(linear, axis=1), np.linalg.norm(angular, axis=1))
            going = worst[active] > CLOSED
            if not going.any():
                break
            active = active[going]
            moved = np.cross(axes[going], position[going, None] - origins[going])
            jacobian = np.swapaxes(np.concatenate([moved, axes[going]], axis=2), 1, 2)
            step = _solved(jacobian, np.concatenate([linear[going], angular[going]], axis=1))
            longest = np.abs(step).max(axis=1, keepdims=True)
            q[active] += step * np.minimum(1.0, LONGEST_STEP / np.maximum(longest, LONGEST_STEP))
        return q, worst


def _error(rotation: Array, position: Array, T: Array) -> tuple[Array, Array]:
    """Linear (n, 3) [m] and angular (n, 3) error in the base: the angle's sine, its length exact when it is small."""
    columns = np.cross(rotation, T[:, :3, :3], axisa=1, axisb=1).sum(axis=1)
    return T[:, :3, 3] - position, 0.5 * columns


def _solved(jacobian: Array, error: Array) -> Array:
    try:
        return np.asarray(np.linalg.solve(jacobian, error[..., None])[..., 0])
    except np.linalg.LinAlgError:  # one of them is exactly singular
        return np.asarray((np.linalg.pinv(jacobian) @ error[..., None])[..., 0])
