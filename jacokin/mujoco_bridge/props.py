"""Things to handle: simple shapes that can be observed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np

from jacokin.errors import InvalidInputError, UnknownNameError
from jacokin.model import checks
from jacokin.mujoco_bridge.entities.entity import Entity
from jacokin.mujoco_bridge.observables.observable import MJCFFeature, Observable, Observables, observable

_SHAPES = {
    "box": (mujoco.mjtGeom.mjGEOM_BOX, 3),
    "sphere": (mujoco.mjtGeom.mjGEOM_SPHERE, 1),
    "cylinder": (mujoco.mjtGeom.mjGEOM_CYLINDER, 2),
    "capsule": (mujoco.mjtGeom.mjGEOM_CAPSULE, 2),
}
_SENSORS = {
    "position": mujoco.mjtSensor.mjSENS_FRAMEPOS,
    "orientation": mujoco.mjtSensor.mjSENS_FRAMEQUAT,
    "linear_velocity": mujoco.mjtSensor.mjSENS_FRAMELINVEL,
    "angular_velocity": mujoco.mjtSensor.mjSENS_FRAMEANGVEL,
}
_GEOM = "geom"


class Primitive(Entity):
    """One rigid shape. `Arena.add_free_entity` lets it move."""

    def _build(
        self,
        geom_type: str = "box",
        size: Sequence[float] = (0.02, 0.02, 0.02),
        mass: float = 0.05,
        rgba: Sequence[float] = (0.8, 0.3, 0.2, 1.0),
        name: str | None = None,
    ) -> None:
        """Build the shape.

        Args:
            geom_type: "box", "sphere", "cylinder" or "capsule".
            size: half-lengths of a box (3), radius of a sphere (1), radius and half-length of the others (2) [m].
            mass: [kg].
            rgba: colour, 0..1.
            name: replaces ``primitive`` in the names of its elements.

        Raises:
            UnknownNameError: no such shape.
            InvalidInputError: a size or mass that is not positive, or the wrong number of sizes or colours.
        """
        if not isinstance(geom_type, str) or geom_type not in _SHAPES:
            raise UnknownNameError("geom_type", str(geom_type), _SHAPES)
        shape, count = _SHAPES[geom_type]
        lengths = checks.vector("size", size, count, "m")
        if not (lengths > 0.0).all():
            raise InvalidInputError(f"size of a {geom_type} must be {count} positive lengths [m], got {size!r}")
        if not isinstance(mass, int | float | np.number) or not (np.isfinite(mass) and mass > 0.0):
            raise InvalidInputError(f"mass must be a positive number [kg], got {mass!r}")
        colour = checks.vector("rgba", rgba, 4, "0..1")
        spec = self._mjcf_root = mujoco.MjSpec()
        spec.modelname = name or "primitive"
        spec.compiler.degree = False
        self._geom = spec.worldbody.add_geom(
            name=_GEOM, type=shape, size=[*lengths, *[0.0] * (3 - count)], mass=mass, rgba=colour
        )
        self._sensors = {
            quantity: spec.add_sensor(name=quantity, type=kind, objtype=mujoco.mjtObj.mjOBJ_GEOM, objname=_GEOM)
            for quantity, kind in _SENSORS.items()
        }

    def _build_observables(self) -> Observables:
        return FreePropObservables(self)

    @property
    def geom(self) -> Any:
        """The geom element."""
        return self._geom

    @property
    def sensors(self) -> dict[str, Any]:
        """The sensors of position, orientation, linear_velocity and angular_velocity, in the world."""
        return self._sensors


class FreePropObservables(Observables):
    """Pose and velocity of a prop in the world."""

    @observable
    def position(self) -> Observable:
        """Position of the shape's centre, (3,) [m]."""
        return MJCFFeature("sensordata", self._entity.sensors["position"])

    @observable
    def orientation(self) -> Observable:
        """Orientation, (4,) wxyz."""
        return MJCFFeature("sensordata", self._entity.sensors["orientation"])

    @observable
    def linear_velocity(self) -> Observable:
        """Velocity of the shape's centre, (3,) [m/s]."""
        return MJCFFeature("sensordata", self._entity.sensors["linear_velocity"])

    @observable
    def angular_velocity(self) -> Observable:
        """Angular velocity, (3,) [rad/s]."""
        return MJCFFeature("sensordata", self._entity.sensors["angular_velocity"])
