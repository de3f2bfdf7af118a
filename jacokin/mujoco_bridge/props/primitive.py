"""Props that move freely: one simple shape, a box with sites at its corners. All sizes are in `sizes.toml`."""

from __future__ import annotations

import functools
import itertools
import tomllib
from collections.abc import Mapping
from importlib import resources
from typing import Any

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, ModelError, shown
from jacokin.model import checks
from jacokin.model.mujoco_twin import mesh_vertices
from jacokin.mujoco_bridge import workspaces
from jacokin.mujoco_bridge.entity import Entity, new_spec
from jacokin.mujoco_bridge.observables import MJCFFeature, Observable, Observables, observable

SENSORS: Mapping[str, mujoco.mjtSensor] = {
    "position": mujoco.mjtSensor.mjSENS_FRAMEPOS,
    "orientation": mujoco.mjtSensor.mjSENS_FRAMEQUAT,
    "linear_velocity": mujoco.mjtSensor.mjSENS_FRAMELINVEL,
    "angular_velocity": mujoco.mjtSensor.mjSENS_FRAMEANGVEL,
}
DENSITY = 1000.0  # [kg/m^3] MuJoCo's own default
HIDDEN_GROUP = 4  # of geoms that touch but are not drawn

_SHAPES = {
    "box": (mujoco.mjtGeom.mjGEOM_BOX, 3),
    "sphere": (mujoco.mjtGeom.mjGEOM_SPHERE, 1),
    "cylinder": (mujoco.mjtGeom.mjGEOM_CYLINDER, 2),
    "capsule": (mujoco.mjtGeom.mjGEOM_CAPSULE, 2),
    "ellipsoid": (mujoco.mjtGeom.mjGEOM_ELLIPSOID, 3),
}
_GREY = (0.5, 0.5, 0.5, 1.0)  # of the large box, as in dm_control


class FreeProp(Entity):
    """A prop with sensors of the pose and the velocity of one of its parts, in the world."""

    _sensors: dict[str, mujoco.MjsSensor]
    _vertices: list[mujoco.MjsSite]
    height_above_lowest: float
    """[m] of the origin above the lowest point of what collides, when the prop is upright."""

    def _add_sensors(
        self, part: mujoco.MjsGeom | mujoco.MjsSite, sensors: Mapping[str, mujoco.mjtSensor] = SENSORS
    ) -> None:
        """Measure a geom or site of the prop; `_build` calls this once."""
        is_geom = isinstance(part, mujoco.MjsGeom)
        kind = mujoco.mjtObj.mjOBJ_GEOM if is_geom else mujoco.mjtObj.mjOBJ_SITE
        self._sensors = {
            name: self._mjcf_root.add_sensor(name=name, type=sensor, objtype=kind, objname=part.name)
            for name, sensor in sensors.items()
        }

    def _add_vertices(self) -> None:
        """Add sites at the corners of the box that encloses all that collides; `_build` may call this last."""
        lower, upper = bounds(self._mjcf_root)
        self.height_above_lowest = -float(lower[2])
        self._vertices = add_vertex_sites(self._mjcf_root.worldbody, (lower + upper) / 2.0, (upper - lower) / 2.0)

    def _build_observables(self) -> Observables:
        return FreePropObservables(self)

    @property
    def vertices(self) -> list[mujoco.MjsSite]:
        """The eight sites at the corners of the bounding box."""
        return self._vertices

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


class Primitive(FreeProp):
    """One rigid shape. `Arena.add_free_entity` lets it move."""

    def _build(
        self,
        geom_type: str = "box",
        size: ArrayLike = (0.02, 0.02, 0.02),
        mass: float | None = None,
        rgba: ArrayLike = (0.8, 0.3, 0.2, 1.0),
        name: str | None = None,
        *,
        density: float = DENSITY,
        **geom_options: Any,
    ) -> None:
        """Build the shape.

        Args:
            geom_type: "box", "sphere", "cylinder", "capsule" or "ellipsoid".
            size: half-lengths of a box or ellipsoid (3), radius of a sphere (1), radius and half-length of the others
                (2) [m].
            mass: [kg]; None for that of the density.
            rgba: colour, 0..1.
            name: replaces ``primitive`` in the names of its elements.
            density: [kg/m^3], used without a mass.
            geom_options: attributes of the geom, as `mujoco.MjSpec` has them: ``pos``, ``quat``, ``friction``, ...

        Raises:
            UnknownNameError: no such shape; lists the valid ones.
            InvalidInputError: a size, mass or density that is not positive, the wrong number of sizes or colours, or
                an attribute that MuJoCo refuses.
        """
        shape, count = _SHAPES[checks.choice("geom_type", geom_type, _SHAPES)]
        lengths = checks.vector("size", size, count, "m")
        if not (lengths > 0.0).all():
            raise InvalidInputError(f"size of a {geom_type} must be {count} positive lengths [m], got {shown(size)}")
        if mass is not None:
            geom_options["mass"] = checks.positive("mass", mass, "kg")
        colour = checks.vector("rgba", rgba, 4, "0..1")
        spec = self._mjcf_root = new_spec("primitive", name)
        try:
            self._geom = spec.worldbody.add_geom(
                name="geom",
                type=shape,
                size=np.concatenate([lengths, np.zeros(3 - count)]),
                rgba=colour,
                density=checks.positive("density", density, "kg/m^3"),
                **geom_options,
            )
        except (TypeError, ValueError) as error:
            raise refused_attributes(geom_options, error) from error
        self._add_sensors(self._geom)
        self._add_vertices()

    @property
    def geom(self) -> mujoco.MjsGeom:
        """The geom element."""
        return self._geom


class BoxProp(Primitive):
    """A box."""

    def _build(  # type: ignore[override]  # the shape is given
        self,
        half_size: ArrayLike = (0.02, 0.02, 0.02),
        mass: float | None = None,
        rgba: ArrayLike = (0.8, 0.3, 0.2, 1.0),
        name: str | None = None,
        *,
        density: float = DENSITY,
    ) -> None:
        """Build the box.

        Args:
            half_size: (3,) half-lengths [m].
            mass: [kg]; None for that of the density.
            rgba: colour, 0..1.
            name: replaces ``box`` in the names of its elements.
            density: [kg/m^3], used without a mass.

        Raises:
            InvalidInputError: an argument is malformed.
        """
        super()._build("box", half_size, mass, rgba, "box" if name is None else name, density=density)


def large_box(name: str | None = None, observable_options: Mapping[str, object] | None = None) -> BoxProp:
    """The box of the task of lifting one, too wide for the hand to pinch.

    Args:
        name: replaces ``box`` in the names of its elements.
        observable_options: as for every `Entity`.
    """
    row = load_sizes()["large_box"]
    return BoxProp(row["half_size"], row["mass"], _GREY, name=name, observable_options=observable_options)


def refused_attributes(options: Mapping[str, Any], error: Exception) -> InvalidInputError:
    """The error about attributes that a geom of MuJoCo does not take, without the list of its overloads."""
    reason = str(error).partition(" The following argument types")[0]
    return InvalidInputError(f"MuJoCo refuses the attributes {dict(options)} of a geom: {reason}")


def add_vertex_sites(body: mujoco.MjsBody, centre: Array, half_size: Array) -> list[mujoco.MjsSite]:
    """Add a site ``vertex_0`` .. ``vertex_7`` at each corner of a box whose axes are those of its body.

    Args:
        body: the body of the box.
        centre: (3,) of the box [m].
        half_size: (3,) half-lengths [m].
    """
    corners = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
    radius = load_sizes()["vertices"]["site_radius"]
    return [
        body.add_site(
            name=f"vertex_{number}",
            pos=centre + corner * half_size,
            size=[radius] * 3,
            rgba=workspaces.RED,
            group=workspaces.SITE_GROUP,
        )
        for number, corner in enumerate(corners)
    ]


def bounds(spec: mujoco.MjSpec) -> tuple[Array, Array]:
    """The corners (3,) of the box that encloses the geoms of a spec that collide, in its initial state [m].

    Raises:
        ModelError: MuJoCo refuses the spec.
        InvalidInputError: nothing in it collides, or a plane does, which has no end.
    """
    try:
        model = spec.copy().compile()
    except (ValueError, mujoco.FatalError) as error:
        raise ModelError(f"MuJoCo cannot compile {spec.modelname!r}: {error}") from error
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    points = []
    for geom in np.flatnonzero(model.geom_contype | model.geom_conaffinity).tolist():
        kind = mujoco.mjtGeom(int(model.geom_type[geom]))
        if kind in (mujoco.mjtGeom.mjGEOM_PLANE, mujoco.mjtGeom.mjGEOM_HFIELD):
            raise InvalidInputError(f"{spec.modelname!r} holds a plane or a height field, which cannot be handled")
        if kind == mujoco.mjtGeom.mjGEOM_MESH:
            local = mesh_vertices(model, int(model.geom_dataid[geom]))
        else:
            centre, half = model.geom_aabb[geom].reshape(2, 3)
            local = centre + np.array(list(itertools.product((-1.0, 1.0), repeat=3))) * half
        points.append(data.geom_xpos[geom] + local @ data.geom_xmat[geom].reshape(3, 3).T)
    if not points:
        raise InvalidInputError(f"nothing in {spec.modelname!r} collides, so it cannot be handled")
    every = np.concatenate(points)
    return every.min(axis=0), every.max(axis=0)


@functools.cache
def load_sizes() -> Mapping[str, Any]:
    """The table of sizes as nested dictionaries; treat it as read-only."""
    return tomllib.loads(resources.files(__package__).joinpath("sizes.toml").read_text(encoding="utf-8"))
