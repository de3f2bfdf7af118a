"""What the arm looks like: one mesh for each of its moving parts, from the collision shapes of the description."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

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

if TYPE_CHECKING:
    from jacokin.model.scene import Scene

PLATE = (1.0, 1.0, 0.002)  # [m] half edges of what is drawn of a floor
BONE_RADIUS = 0.02  # [m] of the sticks that stand for an arm without shapes


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """What one joint moves, in Pinocchio's frame of that joint; the base is part 0."""

    name: str
    """Of the joint; "base" for the base."""
    mesh: Mesh | None
    """None where there is nothing to draw."""
    shapes: dict[str, Mesh] = field(default_factory=dict)
    """The collision shapes by name, which are merged in the mesh of an arm that is drawn by them."""


def parts_of(robot: Robot) -> tuple[tuple[Part, ...], str]:
    """The base and the part each joint moves, base to tip; and why it is sticks from joint to joint, or ""."""
    from jacokin.model.mujoco_twin import to_mujoco

    try:
        model = to_mujoco(robot, geometry=True)
    except ModelError as error:
        return _sticks(robot), str(error)
    first = model.body(1).id  # bodies are the world, the base, and one for each joint, in the order of the joints
    parts = []
    for index, name in enumerate(("base", *robot.joint_names)):
        geoms = [g for g in range(model.ngeom) if model.geom_bodyid[g] == first + index]
        found = {str(model.geom(geom).name): mesh for geom in geoms if (mesh := of_geom(model, geom)) is not None}
        parts.append(Part(name, merged(list(found.values())), found))
    if any(part.mesh for part in parts):
        return tuple(parts), ""
    return _sticks(robot), "the description has no collision shapes"


def of_obstacles(scene: Scene) -> dict[str, Mesh]:
    """The shapes of a scene by name, in the base frame; a floor as a thin plate."""
    import mujoco

    spec = mujoco.MjSpec()
    for obstacle in scene:
        obstacle.add_to(spec.worldbody)
    model = spec.compile()
    meshes = {}
    for geom in range(model.ngeom):
        mesh = of_geom(model, geom)
        if mesh is None:
            z = float(model.geom_pos[geom][2])
            mesh = placed(box(np.array(PLATE)), np.eye(3), np.array([0.0, 0.0, z - PLATE[2]]))
        meshes[str(model.geom(geom).name)] = mesh
    return meshes


def _sticks(robot: Robot) -> tuple[Part, ...]:
    """A ball at each joint and a stick from there to the next joint, or to the default frame."""
    model = robot.pin_model
    ends: list[Array] = [np.array(model.jointPlacements[joint].translation) for joint in range(1, model.njoints)]
    ends.append(np.array(model.frames[robot.frame_id()].placement.translation))
    parts = []
    for name, end in zip(("base", *robot.joint_names), ends, strict=True):
        meshes = [sphere(1.5 * BONE_RADIUS)]
        length = float(np.linalg.norm(end))
        if length > 1e-6:  # [m] below that there is nothing to see
            meshes.append(placed(cylinder(BONE_RADIUS, 0.5 * length), _rotation_to(end / length), 0.5 * end))
        parts.append(Part(name, merged(meshes)))
    return tuple(parts)


def _rotation_to(direction: Array) -> Array:
    """A rotation (3, 3) that takes z to a unit vector (3,)."""
    helper = np.eye(3)[int(np.argmin(np.abs(direction)))]
    x = np.cross(helper, direction)
    x /= np.linalg.norm(x)
    return np.column_stack((x, np.cross(direction, x), direction))


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
