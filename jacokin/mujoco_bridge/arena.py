"""`Arena`: the root of a scene, with floor, light, a camera and the options of the simulation."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import mujoco
from numpy.typing import ArrayLike

from jacokin.model import checks
from jacokin.model.descriptions import bundled
from jacokin.mujoco_bridge.entity import Entity, new_spec

FIRM, DM_CONTROL = "firm", "dm_control"
CONTACTS = (FIRM, DM_CONTROL)
CONTACT_OPTIONS = ("impratio", "noslip_iterations", "noslip_tolerance")  # of MuJoCo

_FLOOR = "ground"
_CHECKER_RGB = ((0.62, 0.68, 0.74), (0.44, 0.50, 0.56))
_SKY_RGB = ((0.85, 0.90, 0.95), (0.45, 0.55, 0.65))
_TEXTURES = (  # name, kind, pattern, colours, pixels
    ("sky", mujoco.mjtTexture.mjTEXTURE_SKYBOX, mujoco.mjtBuiltin.mjBUILTIN_GRADIENT, _SKY_RGB, 100),
    (_FLOOR, mujoco.mjtTexture.mjTEXTURE_2D, mujoco.mjtBuiltin.mjBUILTIN_CHECKER, _CHECKER_RGB, 300),
)


class Arena(Entity):
    """A checkered floor. Attach the arm to it, then make the physics from it."""

    def _build(self, name: str | None = None, contact: str = FIRM) -> None:
        """Build the arena.

        Args:
            name: a name for the model; names of elements do not contain it.
            contact: how friction is solved: "firm", so that what the hand holds stays where it is held, or
                "dm_control", as in dm_control's manipulation suite, where it creeps.

        Raises:
            UnknownNameError: no such contact.
        """
        spec = self._mjcf_root = new_spec("arena", name)
        row = bundled.robot_table()["arena"]
        _set_options(spec, row)
        set_contact(spec.option, contact)
        _add_looks(spec)
        ground = row["ground"]
        spec.worldbody.add_geom(
            name=_FLOOR,
            type=mujoco.mjtGeom.mjGEOM_PLANE,
            size=(1.0, 1.0, 0.1),  # half-lengths of the drawn plane, and grid spacing [m]
            material=_FLOOR,
            contype=ground["contype"],
            conaffinity=ground["conaffinity"],
            friction=ground["friction"],
            solref=ground["solref"],
            solimp=ground["solimp"],
        )

    def attach_offset(
        self, entity: Entity, offset: ArrayLike, attach_site: mujoco.MjsSite | None = None
    ) -> mujoco.MjsBody:
        """Attach an entity at an offset (3,) [m]; the same as ``attach(entity, position=offset)``."""
        return self.attach(entity, attach_site, position=offset)

    def add_free_entity(
        self, entity: Entity, *, position: ArrayLike | None = None, quaternion: ArrayLike | None = None
    ) -> mujoco.MjsBody:
        """Attach an entity that moves freely; `Entity.set_pose` places it.

        Args:
            entity: what to attach.
            position: (3,) where it starts [m]; None for the origin.
            quaternion: (4,) how it starts, wxyz; None for upright.

        Returns:
            The body made to hold it.

        Raises:
            InvalidInputError: as `Entity.attach`.
        """
        body = self.attach(entity, position=position, quaternion=quaternion)
        body.add_freejoint(name=f"{entity.prefix}freejoint")
        return body


def set_contact(option: mujoco.MjOption, contact: str) -> None:
    """Set how friction is solved, in the options of a model, compiled or not.

    Args:
        option: ``spec.option`` or ``model.opt``.
        contact: one of `CONTACTS`.

    Raises:
        UnknownNameError: no such contact.
    """
    row = bundled.robot_table()["arena"]["contacts"][checks.choice("contact", contact, CONTACTS)]
    for name in CONTACT_OPTIONS:
        setattr(option, name, row[name])


def _set_options(spec: mujoco.MjSpec, row: Mapping[str, Any]) -> None:
    spec.memory = 64 * 2**20  # [bytes] two arms at q = 0, where everything touches, need more than MuJoCo's estimate
    spec.option.timestep = row["timestep"]  # [s]
    spec.option.cone = getattr(mujoco.mjtCone, f"mjCONE_{row['cone'].upper()}")
    spec.compiler.boundmass = row["boundmass"]  # [kg]
    spec.compiler.boundinertia = row["boundinertia"]  # [kg m^2]


def _add_looks(spec: mujoco.MjSpec) -> None:
    spec.visual.map.znear = 0.01  # of the model's extent
    # What faces the lamp and the camera gets the sum of these lights, which stays below 1: no picture is over-exposed,
    # not even of pure colours. Geoms reflect half of the specular ones.
    spec.visual.headlight.ambient = _grey(0.3)
    spec.visual.headlight.diffuse = _grey(0.3)
    spec.visual.headlight.specular = _grey(0.0)
    spec.stat.center = (0.0, 0.0, 0.0)
    for name, kind, pattern, (rgb1, rgb2), size in _TEXTURES:
        spec.add_texture(name=name, type=kind, builtin=pattern, rgb1=rgb1, rgb2=rgb2, width=size, height=size)
    material = spec.add_material(name=_FLOOR, texrepeat=(5.0, 5.0), texuniform=True, reflectance=0.0, specular=0.0)
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = _FLOOR
    spec.worldbody.add_light(
        pos=(0.0, 0.0, 1.5),  # [m]
        dir=(0.0, 0.0, -1.0),
        diffuse=_grey(0.35),
        specular=_grey(0.08),
        castshadow=True,
    )
    camera = spec.worldbody.add_camera(name="overview", pos=(0.75, -0.75, 0.6))
    camera.alt.type = mujoco.mjtOrientation.mjORIENTATION_XYAXES
    camera.alt.xyaxes = (0.768, 0.640, 0.0, -0.207, 0.248, 0.946)  # looks at (0, 0.15, 0.2)


def _grey(intensity: float) -> tuple[float, float, float]:
    return intensity, intensity, intensity
