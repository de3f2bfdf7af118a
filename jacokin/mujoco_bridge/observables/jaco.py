"""Observables of the Jaco arm and of its hand."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from jacokin.mujoco_bridge.observables.bound import Bound
from jacokin.mujoco_bridge.observables.declaration import observable
from jacokin.mujoco_bridge.observables.features import MJCFFeature
from jacokin.mujoco_bridge.observables.joints import JointsObservables
from jacokin.mujoco_bridge.observables.observable import Observable

if TYPE_CHECKING:
    from jacokin.mujoco_bridge.simulation.physics import Physics


class JacoArmObservables(JointsObservables):
    """Joint positions as (sin, cos), joint velocities, joint torques."""

    @observable
    def joints_pos(self) -> Observable:
        """Joint angles as pairs (sin, cos), (n, 2): bounded, though most joints have no limits.

        ``angles_from_sin_cos`` converts them to angles.
        """
        joints = Bound(self._entity.joints)

        def read(physics: Physics) -> NDArray[np.float64]:
            q = joints(physics).qpos
            pairs = np.empty((len(q), 2))
            np.sin(q, out=pairs[:, 0])
            np.cos(q, out=pairs[:, 1])
            return pairs

        return Observable(read)

    @observable
    def joints_torque(self) -> Observable:
        """Torques about the joint axes, (n,) [N m].

        Each 3-axis sensor projected on the axis of its joint. The sensor measures what the child body exerts on its
        parent, so an external torque on the child has the opposite sign here.
        """
        sensors = Bound(self._entity.joint_torque_sensors)
        joints = Bound(self._entity.joints)

        def read(physics: Physics) -> NDArray[np.float64]:
            torques: NDArray[np.float64] = np.vecdot(sensors(physics).sensordata, joints(physics).axis)
            return torques

        return Observable(read)


class TwoFingerHandObservables(JointsObservables):
    """Finger positions and velocities, pose of the grip site: the hand with two fingers has no pinch site."""

    @observable
    def grip_site_pos(self) -> Observable:
        """Position of the grip site in the world, (3,) [m]."""
        return MJCFFeature("xpos", self._entity.grip_site)

    @observable
    def grip_site_rmat(self) -> Observable:
        """Rotation matrix R_world_gripsite in row-major order, (9,)."""
        return MJCFFeature("xmat", self._entity.grip_site)


class JacoHandObservables(JointsObservables):
    """Finger positions and velocities, pose of the pinch site."""

    @observable
    def pinch_site_pos(self) -> Observable:
        """Position of the pinch site in the world, (3,) [m]."""
        return MJCFFeature("xpos", self._entity.pinch_site)

    @observable
    def pinch_site_rmat(self) -> Observable:
        """Rotation matrix R_world_pinchsite in row-major order, (9,)."""
        return MJCFFeature("xmat", self._entity.pinch_site)
