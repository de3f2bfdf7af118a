"""Props of one simple shape."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from jacokin.errors import InvalidInputError, shown
from jacokin.model import checks
from jacokin.mujoco_bridge.entities.entity import check_name
from jacokin.mujoco_bridge.props.free_prop import FreeProp

DENSITY = 1000.0  # [kg/m^3] MuJoCo's own default

_SHAPES = {
    "box": (mujoco.mjtGeom.mjGEOM_BOX, 3),
    "sphere": (mujoco.mjtGeom.mjGEOM_SPHERE, 1),
    "cylinder": (mujoco.mjtGeom.mjGEOM_CYLINDER, 2),
    "capsule": (mujoco.mjtGeom.mjGEOM_CAPSULE, 2),
    "ellipsoid": (mujoco.mjtGeom.mjGEOM_ELLIPSOID, 3),
}
_GEOM = "geom"


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
        spec = self._mjcf_root = mujoco.MjSpec()
        spec.modelname = "primitive" if name is None else check_name(name)
        spec.compiler.degree = False
        try:
            self._geom = spec.worldbody.add_geom(
                name=_GEOM,
                type=shape,
                size=np.concatenate([lengths, np.zeros(3 - count)]),
                rgba=colour,
                density=checks.positive("density", density, "kg/m^3"),
                **geom_options,
            )
        except (TypeError, ValueError) as error:
            raise InvalidInputError(f"MuJoCo refuses the attributes {geom_options} of a geom: {error}") from error
        self._add_sensors(self._geom)

    @property
    def geom(self) -> mujoco.MjsGeom:
        """The geom element."""
        return self._geom
