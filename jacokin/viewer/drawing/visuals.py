"""The visual meshes of a description: what its author drew, beside the shapes that collide."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin

from jacokin.arrays import Array
from jacokin.errors import ModelError
from jacokin.model import poses
from jacokin.model.descriptions import meshes as mesh_files
from jacokin.model.descriptions import mjcf
from jacokin.model.robot import Robot
from jacokin.viewer.drawing.meshes import Mesh, box, cylinder, merged, of_geom, placed, sphere
from jacokin.viewer.drawing.parts import Part

SHOWN_GROUPS = 3  # of an MJCF's geoms: the viewers of MuJoCo show groups 0 to 2 unless told otherwise


def visuals_of(robot: Robot) -> tuple[Part, ...] | None:
    """The base and the part that each joint moves, as the file draws them.

    Returns:
        None where the file draws nothing but the shapes that collide: bundled robots, and files without visuals.

    Raises:
        ModelError: a mesh is not found or cannot be read; names it.
    """
    content = robot.source.content
    if content is None:
        return None
    drawn = _of_urdf(robot, content) if isinstance(content, str) else _of_mjcf(robot, content)
    if not drawn:
        return None
    names = ("base", *robot.joint_names)
    return tuple(Part(name, merged(drawn.get(number, []))) for number, name in enumerate(names))


def _of_urdf(robot: Robot, text: str) -> dict[int, list[Mesh]]:
    """Meshes by the number of the joint that moves them, in its frame."""
    read: dict[Path, Mesh] = {}
    drawn: dict[int, list[Mesh]] = {}
    for link in ET.fromstring(text).findall("link"):
        name = link.get("name", "")
        if name not in robot.frames:
            continue
        frame = robot.pin_model.frames[robot.frame_id(name)]
        for visual in link.findall("visual"):
            mesh = _of_visual(robot, visual, read)
            if mesh is not None:
                place = frame.placement * _origin(visual)
                drawn.setdefault(frame.parentJoint, []).append(placed(mesh, place.rotation, place.translation))
    return drawn


def _of_visual(robot: Robot, visual: ET.Element, read: dict[Path, Mesh]) -> Mesh | None:
    """One `<visual>` of a checked URDF in its own axes."""
    for shape in visual.findall("geometry/*"):
        if shape.tag == "box":
            return box(0.5 * _numbers(shape, "size"))
        if shape.tag == "sphere":
            return sphere(float(_numbers(shape, "radius")[0]))
        if shape.tag in ("cylinder", "capsule"):
            return cylinder(float(_numbers(shape, "radius")[0]), 0.5 * float(_numbers(shape, "length")[0]))
        if shape.tag == "mesh":
            source = robot.source
            found = mesh_files.find(shape.get("filename", ""), source.path, source.package_dirs)
            if found not in read:
                read[found] = _load(found, source.path)
            scale = _numbers(shape, "scale", "1 1 1")
            faces = read[found].faces if np.prod(scale) > 0.0 else read[found].faces[:, ::-1]  # a mirrored mesh
            return Mesh((read[found].vertices * scale).astype(np.float32), faces)
    return None


def _load(file: Path, description: Path) -> Mesh:
    """A mesh file of any format that trimesh reads, as one mesh.

    Raises:
        ModelError: it cannot be read, or holds no triangles.
    """
    import trimesh

    try:
        whole = trimesh.load_mesh(file)
        vertices, faces = np.asarray(whole.vertices), np.asarray(whole.faces)
    except Exception as error:  # whatever the reader of that format raises
        raise ModelError(f"{description}: mesh {file} cannot be read: {error!r}") from error
    if not len(faces) or not np.isfinite(vertices).all():
        raise ModelError(f"{description}: mesh {file} holds no triangles, or vertices that are not finite")
    return Mesh(vertices.astype(np.float32), faces.astype(np.uint32))


def _of_mjcf(robot: Robot, model: mujoco.MjModel) -> dict[int, list[Mesh]]:
    """As `_of_urdf`; empty where every geom that is shown collides."""
    drawn: dict[int, list[Mesh]] = {}
    decorative = False
    for geom in range(model.ngeom):
        body = int(model.geom_bodyid[geom])
        name = mjcf.body_name(model, body)
        material = int(model.geom_matid[geom])
        alpha = model.geom_rgba[geom][3] if material < 0 else model.mat_rgba[material][3]
        if not body or name not in robot.frames or model.geom_group[geom] >= SHOWN_GROUPS or not alpha:
            continue
        mesh = of_geom(model, geom)
        if mesh is not None:
            frame = robot.pin_model.frames[robot.frame_id(name)]
            here = placed(mesh, frame.placement.rotation, frame.placement.translation)
            drawn.setdefault(frame.parentJoint, []).append(here)
            decorative |= not (model.geom_contype[geom] or model.geom_conaffinity[geom])
    return drawn if decorative else {}


def _origin(visual: ET.Element) -> pin.SE3:
    origin = visual.find("origin")
    if origin is None:
        return pin.SE3.Identity()
    return pin.SE3(poses.rotation_from_rpy(_numbers(origin, "rpy", "0 0 0")), _numbers(origin, "xyz", "0 0 0"))


def _numbers(element: ET.Element, name: str, default: str = "") -> Array:
    return np.array([float(part) for part in element.get(name, default).split()])
