"""Observables of a prop that moves freely."""

from __future__ import annotations

from jacokin.mujoco_bridge.observable import MJCFFeature, Observable, Observables, observable


class FreePropObservables(Observables):
    """Pose and velocity of a free prop, in the world.

    Read from the sensors ``position``, ``orientation``, ``linear_velocity`` and
    ``angular_velocity`` of the entity.
    """

    @observable
    def position(self) -> Observable:
        """Position in the world, (3,) [m]."""
        return MJCFFeature("sensordata", self._entity.position)

    @observable
    def orientation(self) -> Observable:
        """Orientation world <- prop as a quaternion wxyz, (4,)."""
        return MJCFFeature("sensordata", self._entity.orientation)

    @observable
    def linear_velocity(self) -> Observable:
        """Velocity in the world's axes, (3,) [m/s]."""
        return MJCFFeature("sensordata", self._entity.linear_velocity)

    @observable
    def angular_velocity(self) -> Observable:
        """Angular velocity in the world's axes, (3,) [rad/s]."""
        return MJCFFeature("sensordata", self._entity.angular_velocity)
