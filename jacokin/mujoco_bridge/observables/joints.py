"""Observables of an entity with joints."""

from __future__ import annotations

from jacokin.mujoco_bridge.observables.declaration import Observables, observable
from jacokin.mujoco_bridge.observables.features import MJCFFeature
from jacokin.mujoco_bridge.observables.observable import Observable


class JointsObservables(Observables):
    """Positions and velocities of the entity's ``joints``."""

    @observable
    def joints_pos(self) -> Observable:
        """Positions, one per joint [rad, m on slide joints]."""
        return MJCFFeature("qpos", self._entity.joints)

    @observable
    def joints_vel(self) -> Observable:
        """Velocities, one per joint [rad/s, m/s on slide joints]."""
        return MJCFFeature("qvel", self._entity.joints)
