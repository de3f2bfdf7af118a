"""Where an entity is and how it moves: pose and velocity of the body that holds it.

An entity with a free joint (`Arena.add_free_entity`) has a pose in the world and a velocity. The pose of any other is
that of its body in the parent body, and it has no velocity of its own. If that body is a mocap body, which stands still
but may be put elsewhere, the pose is part of the simulation's state, otherwise of its model.
"""

from __future__ import annotations

import abc

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from jacokin.errors import PhysicsError
from jacokin.model import checks
from jacokin.mujoco_bridge.quaternions import product, rotation_matrix, unit_quaternion
from jacokin.mujoco_bridge.simulation.physics import Physics, check_physics

Vector = NDArray[np.float64]


class Placed(abc.ABC):
    """Poses and velocities of an entity."""

    @property
    @abc.abstractmethod
    def name(self) -> str:
        """Name in messages."""

    @property
    @abc.abstractmethod
    def mount(self) -> mujoco.MjsBody | None:
        """The body that holds the entity; None if it is not attached."""

    @property
    def freejoint(self) -> mujoco.MjsJoint | None:
        """The free joint by which the entity moves, or None."""
        mount = self.mount
        joints = [] if mount is None else mount.joints
        return next((joint for joint in joints if joint.type == mujoco.mjtJoint.mjJNT_FREE), None)

    @property
    def is_mocap(self) -> bool:
        """Whether the body that holds the entity is a mocap body."""
        return self.mount is not None and bool(self.mount.mocap)

    def get_pose(self, physics: Physics) -> tuple[Vector, Vector]:
        """Position (3,) [m] and orientation (4,) wxyz: in the world for a free entity, else in the parent body.

        Raises:
            PhysicsError: the entity is not attached.
        """
        check_physics(physics)
        free = self.freejoint
        if free is not None:
            qpos = physics.bind(free).qpos
            return qpos[:3].copy(), qpos[3:].copy()
        bound = physics.bind(self._mounted())
        if self.is_mocap:
            return bound.mocap_pos.copy(), bound.mocap_quat.copy()
        return bound.pos.copy(), bound.quat.copy()

    def set_pose(
        self, physics: Physics, position: ArrayLike | None = None, quaternion: ArrayLike | None = None
    ) -> None:
        """Place the entity: in the world if it is free, else in its parent body.

        Args:
            physics: the simulation.
            position: (3,) [m]; None leaves it.
            quaternion: (4,) wxyz; None leaves it.

        Raises:
            PhysicsError: the entity is not attached.
            InvalidInputError: a malformed position or quaternion.
        """
        check_physics(physics)
        at = None if position is None else checks.vector("position", position, 3, "m")
        turn = None if quaternion is None else unit_quaternion("quaternion", quaternion)
        free = self.freejoint
        bound = physics.bind(self._mounted() if free is None else free)
        if free is not None:
            place, orientation = bound.qpos[:3], bound.qpos[3:]
        elif self.is_mocap:
            place, orientation = bound.mocap_pos, bound.mocap_quat
        else:
            place, orientation = bound.pos, bound.quat
        if at is not None:
            place[:] = at
        if turn is not None:
            orientation[:] = turn

    def shift_pose(
        self,
        physics: Physics,
        position: ArrayLike | None = None,
        quaternion: ArrayLike | None = None,
        rotate_velocity: bool = False,
    ) -> None:
        """Move and turn the entity relative to where it is.

        Args:
            physics: the simulation.
            position: (3,) added to its position [m]; None leaves it.
            quaternion: (4,) wxyz, by which the entity is turned about its own origin, about axes of the world (of the
                parent body if it is not free); None leaves the orientation.
            rotate_velocity: turn the linear velocity of a free entity too. Its angular velocity is kept in axes of
                the entity, so it turns anyway.

        Raises:
            PhysicsError: the entity is not attached.
            InvalidInputError: a malformed position or quaternion.
        """
        checks.flag("rotate_velocity", rotate_velocity)
        at, turn = self.get_pose(physics)
        shifted = None if position is None else at + checks.vector("position", position, 3, "m")
        if quaternion is None:
            self.set_pose(physics, shifted)
            return
        rotation = unit_quaternion("quaternion", quaternion)
        self.set_pose(physics, shifted, product(rotation, turn))
        if rotate_velocity and self.freejoint is not None:
            linear, _ = self.get_velocity(physics)
            self.set_velocity(physics, rotation_matrix(rotation) @ linear)

    def get_velocity(self, physics: Physics) -> tuple[Vector, Vector]:
        """Velocity (3,) [m/s] in axes of the world and angular velocity (3,) [rad/s] in axes of the entity.

        Raises:
            PhysicsError: the entity is not free.
        """
        qvel = check_physics(physics).bind(self._free()).qvel
        return qvel[:3].copy(), qvel[3:].copy()

    def set_velocity(
        self, physics: Physics, velocity: ArrayLike | None = None, angular_velocity: ArrayLike | None = None
    ) -> None:
        """Set the velocity of a free entity.

        Args:
            physics: the simulation.
            velocity: (3,) in axes of the world [m/s]; None leaves it.
            angular_velocity: (3,) in axes of the entity [rad/s]; None leaves it.

        Raises:
            PhysicsError: the entity is not free.
            InvalidInputError: a malformed velocity.
        """
        qvel = check_physics(physics).bind(self._free()).qvel
        linear = None if velocity is None else checks.vector("velocity", velocity, 3, "m/s")
        angular = None if angular_velocity is None else checks.vector("angular_velocity", angular_velocity, 3, "rad/s")
        if linear is not None:
            qvel[:3] = linear
        if angular is not None:
            qvel[3:] = angular

    def _mounted(self) -> mujoco.MjsBody:
        if self.mount is None:
            raise PhysicsError(f"{self.name!r} is not attached to anything and has no pose")
        return self.mount

    def _free(self) -> mujoco.MjsJoint:
        free = self.freejoint
        if free is None:
            raise PhysicsError(f"{self.name!r} has no free joint and no velocity; attach it with add_free_entity")
        return free
