"""The obstacles of a compiled MuJoCo model: its geoms that stand still and can collide."""

from __future__ import annotations

from collections.abc import Iterable

import mujoco
import numpy as np
import pinocchio as pin

from jacokin.errors import InvalidInputError, UnknownNameError, shown
from jacokin.model import poses
from jacokin.model.descriptions import mjcf
from jacokin.model.obstacles import Box, Capsule, Cylinder, Floor, Obstacle, Sphere

HORIZONTAL = 1e-9  # a plane whose normal misses the vertical by less is a floor
THINNEST = 1e-6  # [m] of a bounding box: a flat mesh has no thickness
GEOM = mujoco.mjtGeom


def obstacles(model: mujoco.MjModel, base: str | pin.SE3 | None, exclude: Iterable[str]) -> list[Obstacle]:
    """The shapes in the frame of the arm's base; see `Scene.from_mujoco`.

    Raises:
        InvalidInputError: not a model, or a plane that is not horizontal in the base frame.
        UnknownNameError: no such body, site or geom.
    """
    if not isinstance(model, mujoco.MjModel):
        raise InvalidInputError(f"model must be a compiled mujoco.MjModel, got {shown(model)}")
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    T_base_world = _base(model, data, base).inverse()
    left_out = _excluded(model, exclude) | _carriers(model)
    found: list[Obstacle] = []
    for geom in range(model.ngeom):
        body = int(model.geom_bodyid[geom])
        collides = model.geom_contype[geom] or model.geom_conaffinity[geom]
        if model.body_weldid[body] != 0 or not collides or geom in left_out:
            continue
        T_world_geom = pin.SE3(data.geom_xmat[geom].reshape(3, 3).copy(), data.geom_xpos[geom].copy())
        found.append(_shape(model, geom, T_base_world * T_world_geom))
    return found


def _shape(model: mujoco.MjModel, geom: int, pose: pin.SE3) -> Obstacle:
    name = _name(model, geom)
    kind, size = int(model.geom_type[geom]), model.geom_size[geom]
    if kind == GEOM.mjGEOM_PLANE:
        if pose.rotation[2, 2] < 1.0 - HORIZONTAL:
            raise InvalidInputError(f"the plane {name!r} is not horizontal in the base: leave it out with exclude")
        return Floor(float(pose.translation[2]), name)
    if kind == GEOM.mjGEOM_SPHERE:
        return Sphere(name, float(size[0]), pose.translation)
    if kind == GEOM.mjGEOM_CAPSULE:
        return Capsule(name, float(size[0]), 2.0 * float(size[1]), pose)
    if kind == GEOM.mjGEOM_CYLINDER:
        return Cylinder(name, float(size[0]), 2.0 * float(size[1]), pose)
    centre, half = model.geom_aabb[geom][:3], np.maximum(model.geom_aabb[geom][3:], 0.5 * THINNEST)
    return Box(name, 2.0 * half, pose * pin.SE3(np.eye(3), centre))


def _name(model: mujoco.MjModel, geom: int) -> str:
    """Name of a geom; unnamed ones get a name from their body and number."""
    return str(model.geom(geom).name) or f"{mjcf.body_name(model, int(model.geom_bodyid[geom]))}#{geom}"


def _base(model: mujoco.MjModel, data: mujoco.MjData, base: str | pin.SE3 | None) -> pin.SE3:
    """T_world_base."""
    if base is None:
        return pin.SE3.Identity()
    if not isinstance(base, str):
        return poses.checked_pose(base, "base")
    body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, base)
    if body >= 0:
        return mjcf.placement(data.xquat[body], data.xpos[body])
    site = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, base)
    if site >= 0:
        return pin.SE3(data.site_xmat[site].reshape(3, 3).copy(), data.site_xpos[site].copy())
    names = [model.body(i).name for i in range(model.nbody)] + [model.site(i).name for i in range(model.nsite)]
    raise UnknownNameError("body or site", base, [name for name in names if name])


def _excluded(model: mujoco.MjModel, exclude: Iterable[str]) -> set[int]:
    geoms = {_name(model, geom): geom for geom in range(model.ngeom)}
    bodies = {mjcf.body_name(model, body): body for body in range(model.nbody)}
    found: set[int] = set()
    for name in exclude:
        if name in geoms:
            found.add(geoms[name])
        elif name in bodies:
            found.update(np.flatnonzero(model.geom_bodyid == bodies[name]).tolist())
        else:
            raise UnknownNameError("geom or body", name, [*geoms, *bodies])
    return found


def _carriers(model: mujoco.MjModel) -> set[int]:
    """Geoms of bodies, the world aside, that stand still and carry a hinge or a slide: bases of arms."""
    found: set[int] = set()
    for joint in range(model.njnt):
        parent = int(model.body_parentid[model.jnt_bodyid[joint]])
        if model.jnt_type[joint] in mjcf.SCALAR_JOINTS and parent and model.body_weldid[parent] == 0:
            found.update(np.flatnonzero(model.geom_bodyid == parent).tolist())
    return found
