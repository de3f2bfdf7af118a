"""Boxes whose corners can be tracked."""

from __future__ import annotations

from collections.abc import Mapping

import mujoco
from numpy.typing import ArrayLike

from jacokin.mujoco_bridge.props import table
from jacokin.mujoco_bridge.props.primitive import DENSITY, Primitive
from jacokin.mujoco_bridge.props.vertices import add_vertex_sites

_GREY = (0.5, 0.5, 0.5, 1.0)  # of the large box, as in dm_control


class Box(Primitive):
    """A box with a site at each corner."""

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
        self._vertices = add_vertex_sites(self._mjcf_root.worldbody, self.geom)

    @property
    def vertices(self) -> list[mujoco.MjsSite]:
        """The eight sites at the corners."""
        return self._vertices


def large_box(name: str | None = None, observable_options: Mapping[str, object] | None = None) -> Box:
    """The box of the task of lifting one, too wide for the hand to pinch.

    Args:
        name: replaces ``box`` in the names of its elements.
        observable_options: as for every `Entity`.
    """
    row = table.load()["large_box"]
    return Box(row["half_size"], row["mass"], _GREY, name=name, observable_options=observable_options)
