"""Props whose pose and velocity are measured."""

from __future__ import annotations

from collections.abc import Mapping

import mujoco

from jacokin.mujoco_bridge.entities.entity import Entity
from jacokin.mujoco_bridge.observables.declaration import Observables, observable
from jacokin.mujoco_bridge.observables.features import MJCFFeature
from jacokin.mujoco_bridge.observables.observable import Observable

_SENSORS = {
    "position": mujoco.mjtSensor.mjSENS_FRAMEPOS,
    "orientation": mujoco.mjtSensor.mjSENS_FRAMEQUAT,
    "linear_velocity": mujoco.mjtSensor.mjSENS_FRAMELINVEL,
    "angular_velocity": mujoco.mjtSensor.mjSENS_FRAMEANGVEL,
}


class FreeProp(Entity):
    """A prop with sensors of the pose and the velocity of one of its parts, in the world."""

    _sensors: dict[str, mujoco.MjsSensor]

    def _add_sensors(self, part: mujoco.MjsGeom | mujoco.MjsSite) -> None:
        """Measure a geom or site of the prop; `_build` calls this once."""
        is_geom = isinstance(part, mujoco.MjsGeom)
        kind = mujoco.mjtObj.mjOBJ_GEOM if is_geom else mujoco.mjtObj.mjOBJ_SITE
        self._sensors = {
            name: self._mjcf_root.add_sensor(name=name, type=sensor, objtype=kind, objname=part.name)
            for name, sensor in _SENSORS.items()
        }

    def _build_observables(self) -> Observables:
        return FreePropObservables(self)

    @property
    def sensors(self) -> Mapping[str, mujoco.MjsSensor]:
        """The sensors by name."""
        return self._sensors

    @property
    def position(self) -> mujoco.MjsSensor:
        """The sensor of the position, (3,) [m]."""
        return self._sensors["position"]

    @property
    def orientation(self) -> mujoco.MjsSensor:
        """The sensor of the orientation, (4,) wxyz."""
        return self._sensors["orientation"]

    @property
    def linear_velocity(self) -> mujoco.MjsSensor:
        """The sensor of the velocity, (3,) [m/s]."""
        return self._sensors["linear_velocity"]

    @property
    def angular_velocity(self) -> mujoco.MjsSensor:
        """The sensor of the angular velocity, (3,) [rad/s]."""
        return self._sensors["angular_velocity"]


class FreePropObservables(Observables):
    """Pose and velocity of a prop in the world."""

    @observable
    def position(self) -> Observable:
        """Position, (3,) [m]."""
        return MJCFFeature("sensordata", self._entity.position)

    @observable
    def orientation(self) -> Observable:
        """Orientation, (4,) wxyz."""
        return MJCFFeature("sensordata", self._entity.orientation)

    @observable
    def linear_velocity(self) -> Observable:
        """Velocity, (3,) [m/s]."""
        return MJCFFeature("sensordata", self._entity.linear_velocity)

    @observable
    def angular_velocity(self) -> Observable:
        """Angular velocity, (3,) [rad/s]."""
        return MJCFFeature("sensordata", self._entity.angular_velocity)
