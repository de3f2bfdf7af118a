"""What things are placed on: a pillar, and a cradle of spheres on its top."""

from __future__ import annotations

import mujoco
import numpy as np

from jacokin.errors import InvalidInputError, shown
from jacokin.model import checks
from jacokin.mujoco_bridge import workspaces
from jacokin.mujoco_bridge.entity import Entity, new_spec
from jacokin.mujoco_bridge.observables import MJCFFeature, Observable, Observables, observable
from jacokin.mujoco_bridge.props import primitive


class Cradle(Entity):
    """Three spheres around an axis: a hollow in which things come to rest."""

    def _build(self, name: str | None = None) -> None:
        """Build the cradle.

        Args:
            name: replaces ``cradle`` in the names of its elements.
        """
        row = primitive.load_sizes()["cradle"]
        spec = self._mjcf_root = new_spec("cradle", name)
        for number in range(row["spheres"]):
            angle = 2.0 * np.pi * number / row["spheres"]
            spec.worldbody.add_geom(
                name=f"sphere_{number}",
                type=mujoco.mjtGeom.mjGEOM_SPHERE,
                size=[row["radius"], 0.0, 0.0],
                pos=row["offset"] * np.array((np.sin(angle), np.cos(angle), -1.0)),
                condim=row["condim"],
            )


class Pedestal(Entity):
    """A pillar with something on its top, which is its origin, and a site where the goal is."""

    def _build(self, cradle: Entity | None = None, target_radius: float | None = None, name: str | None = None) -> None:
        """Build the pillar.

        Args:
            cradle: what is attached to its top, such as a `Cradle` or a `Brick`; None for nothing.
            target_radius: radius of the site that marks the goal [m]; None for 0.05.
            name: replaces ``pedestal`` in the names of its elements.

        Raises:
            InvalidInputError: cradle is not an entity or is attached to another, or the radius is not positive.
        """
        if not isinstance(cradle, Entity | None):
            raise InvalidInputError(f"cradle must be an Entity or None, got {shown(cradle)}")
        row = primitive.load_sizes()["pedestal"]
        radius = row["target_radius"] if target_radius is None else checks.positive("target_radius", target_radius, "m")
        spec = self._mjcf_root = new_spec("pedestal", name)
        world = spec.worldbody
        world.add_geom(
            name="pillar",
            type=mujoco.mjtGeom.mjGEOM_CAPSULE,
            size=[row["radius"], row["height"] / 2.0, 0.0],
            pos=(0.0, 0.0, -row["radius"] - row["height"] / 2.0),
        )
        top = world.add_site(name="top", size=[row["site_radius"]] * 3, group=workspaces.SITE_GROUP)
        self._target_site = workspaces.add_target_site(world, radius, name="target", rgba=workspaces.RED)
        if cradle is not None:
            self.attach(cradle, top)

    def _build_observables(self) -> Observables:
        return PedestalObservables(self)

    @property
    def target_site(self) -> mujoco.MjsSite:
        """The site where the goal is: the top."""
        return self._target_site


class PedestalObservables(Observables):
    """Where the goal is."""

    @observable
    def position(self) -> Observable:
        """Position of the top in the world, (3,) [m]."""
        return MJCFFeature("xpos", self._entity.target_site)
