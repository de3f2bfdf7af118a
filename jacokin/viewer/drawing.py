"""What is drawn, as triangle meshes: an arm by the shapes that collide or by its visual meshes, and obstacles."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import dataclass, field
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.errors import ModelError
from jacokin.model import poses
from jacokin.model.descriptions import meshes as mesh_files
from jacokin.model.descriptions import mjcf
from jacokin.model.mujoco_twin import to_mujoco
from jacokin.model.robot import Robot
from jacokin.model.scene import Scene

SIDES = 24  # of what is round
RINGS = 6  # from the equator of a sphere to its pole
PLATE = (1.0, 1.0, 0.002)  # [m] half edges of what is drawn of a floor
BONE_RADIUS = 0.02  # [m] of the sticks that stand for an arm without shapes
SHOWN_GROUPS = 3  # of an MJCF's geoms: the viewers of MuJoCo show groups 0 to 2 unless told otherwise


@dataclass(frozen=True, slots=True, eq=False)
class Mesh:
    """A triangle mesh."""

    vertices: NDArray[np.float32]
    """(v, 3) [m]."""
    faces: NDArray[np.uint32]
    """(f, 3) counter-clockwise from outside."""


@dataclass(frozen=True, slots=True, eq=False)
class ArmPart:
    """What one joint moves, in Pinocchio's frame of that joint; the base is part 0."""

    name: str
    """Of the joint; "base" for the base."""
    mesh: Mesh | None
    """None where there is nothing to draw."""
    shapes: dict[str, Mesh] = field(default_factory=dict)
    """The collision shapes by name, which are merged in the mesh of an arm that is drawn by them."""


def load_parts(robot: Robot) -> tuple[tuple[ArmPart, ...], str]:
    """The base and the part each joint moves, base to tip; and why it is sticks from joint to joint, or ""."""
    try:
        model = to_mujoco(robot, geometry=True)
    except ModelError as error:
        return _sticks(robot), str(error)
    first = model.body(1).id  # bodies are the world, the base, and one for each joint, in the order of the joints
    parts = []
    for index, name in enumerate(("base", *robot.joint_names)):
        geoms = [g for g in range(model.ngeom) if model.geom_bodyid[g] == first + index]
        found = {str(model.geom(geom).name): mesh for geom in geoms if (mesh := read_geom(model, geom)) is not None}
        parts.append(ArmPart(name, merge(list(found.values())), found))
    if any(part.mesh for part in parts):
        return tuple(parts), ""
    return _sticks(robot), "the description has no collision shapes"


def build_obstacles(scene: Scene) -> dict[str, Mesh]:
    """The shapes of a scene by name, in the base frame; a floor as a thin plate."""
    spec = mujoco.MjSpec()
    for obstacle in scene:
        obstacle.add_to(spec.worldbody)
    model = spec.compile()
    meshes = {}
    for geom in range(model.ngeom):
        mesh = read_geom(model, geom)
        if mesh is None:
            z = float(model.geom_pos[geom][2])
            mesh = move(box(np.array(PLATE)), pin.SE3(np.eye(3), np.array([0.0, 0.0, z - PLATE[2]])))
        meshes[str(model.geom(geom).name)] = mesh
    return meshes


def _sticks(robot: Robot) -> tuple[ArmPart, ...]:
    """A ball at each joint and a stick from there to the next joint, or to the default frame."""
    model = robot.pin_model
    ends: list[Array] = [np.array(model.jointPlacements[joint].translation) for joint in range(1, model.njoints)]
    ends.append(np.array(model.frames[robot.frame_id()].placement.translation))
    parts = []
    for name, end in zip(("base", *robot.joint_names), ends, strict=True):
        meshes = [sphere(1.5 * BONE_RADIUS)]
        length = float(np.linalg.norm(end))
        if length > 1e-6:  # [m] below that there is nothing to see
            along = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), end)
            meshes.append(move(cylinder(BONE_RADIUS, 0.5 * length), pin.SE3(along, 0.5 * end)))
        parts.append(ArmPart(name, merge(meshes)))
    return tuple(parts)


def load_visuals(robot: Robot) -> tuple[ArmPart, ...] | None:
    """The base and the part that each joint moves, as the file draws them.

    Returns:
        None where the file draws nothing but the shapes that collide: bundled robots, and files without visuals.

    Raises:
        ModelError: a mesh is not found or cannot be read; names it.
    """
    content = robot.source.content
    if content is None:
        return None
    drawn = _read_urdf(robot, content) if isinstance(content, str) else _read_mjcf(robot, content)
    if not drawn:
        return None
    names = ("base", *robot.joint_names)
    return tuple(ArmPart(name, merge(drawn.get(number, []))) for number, name in enumerate(names))


def _read_urdf(robot: Robot, text: str) -> dict[int, list[Mesh]]:
    """Meshes by the number of the joint that moves them, in its frame."""
    read: dict[Path, Mesh] = {}
    drawn: dict[int, list[Mesh]] = {}
    for link in ET.fromstring(text).findall("link"):
        name = link.get("name", "")
        if name not in robot.frames:
            continue
        frame = robot.pin_model.frames[robot.frame_id(name)]
        for visual in link.findall("visual"):
            mesh = _read_visual(robot, visual, read)
            if mesh is not None:
                drawn.setdefault(frame.parentJoint, []).append(move(mesh, frame.placement * _origin(visual)))
    return drawn


def _read_visual(robot: Robot, visual: ET.Element, read: dict[Path, Mesh]) -> Mesh | None:
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


def _read_mjcf(robot: Robot, model: mujoco.MjModel) -> dict[int, list[Mesh]]:
    """As `_read_urdf`; empty where every geom that is shown collides."""
    drawn: dict[int, list[Mesh]] = {}
    decorative = False
    for geom in range(model.ngeom):
        body = int(model.geom_bodyid[geom])
        name = mjcf.body_name(model, body)
        material = int(model.geom_matid[geom])
        alpha = model.geom_rgba[geom][3] if material < 0 else model.mat_rgba[material][3]
        if not body or name not in robot.frames or model.geom_group[geom] >= SHOWN_GROUPS or not alpha:
            continue
        mesh = read_geom(model, geom)
        if mesh is not None:
            frame = robot.pin_model.frames[robot.frame_id(name)]
            drawn.setdefault(frame.parentJoint, []).append(move(mesh, frame.placement))
            decorative |= not (model.geom_contype[geom] or model.geom_conaffinity[geom])
    return drawn if decorative else {}


def _origin(visual: ET.Element) -> pin.SE3:
    origin = visual.find("origin")
    if origin is None:
        return pin.SE3.Identity()
    return pin.SE3(poses.rotation_from_rpy(_numbers(origin, "rpy", "0 0 0")), _numbers(origin, "xyz", "0 0 0"))


def _numbers(element: ET.Element, name: str, default: str = "") -> Array:
    return np.array([float(part) for part in element.get(name, default).split()])


def box(half: Array) -> Mesh:
    """A box by its half edges (3,) [m]."""
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * half
    sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [triangle for a, b, c, d in sides for triangle in ((a, b, c), (a, c, d))]
    return Mesh(corners.astype(np.float32), np.array(faces, dtype=np.uint32))


def revolve(profile: list[tuple[float, float]]) -> Mesh:
    """The surface that a profile of (radius, z) [m], from bottom to top, sweeps around z; its ends lie on the axis."""
    angles = np.linspace(0.0, 2.0 * np.pi, SIDES, endpoint=False)
    circle = np.stack((np.cos(angles), np.sin(angles)), axis=1)
    inner = profile[1:-1]
    rings = [np.column_stack((radius * circle, np.full(SIDES, z))) for radius, z in inner]
    vertices = np.vstack(([[0.0, 0.0, profile[0][1]]], *rings, [[0.0, 0.0, profile[-1][1]]]))
    last = len(vertices) - 1
    faces = []
    for side in range(SIDES):
        after = (side + 1) % SIDES
        faces.append((0, 1 + after, 1 + side))
        for ring in range(len(inner) - 1):
            low, high = 1 + ring * SIDES, 1 + (ring + 1) * SIDES
            faces += [(low + side, low + after, high + after), (low + side, high + after, high + side)]
        top = 1 + (len(inner) - 1) * SIDES
        faces.append((top + side, top + after, last))
    return Mesh(vertices.astype(np.float32), np.array(faces, dtype=np.uint32))


def sphere(radius: float) -> Mesh:
    """A sphere by its radius [m]."""
    return capsule(radius, 0.0)


def capsule(radius: float, half: float) -> Mesh:
    """A capsule along z by its radius and half the length of its cylinder [m]."""
    rise = np.linspace(0.0, 0.5 * np.pi, RINGS + 1)
    upper = [(radius * float(np.cos(a)), half + radius * float(np.sin(a))) for a in rise[:-1]]
    lower = [(r, -z) for r, z in reversed(upper)]
    return revolve([(0.0, -half - radius), *lower, *upper, (0.0, half + radius)])


def cylinder(radius: float, half: float) -> Mesh:
    """A cylinder along z by its radius and half its length [m]."""
    return revolve([(0.0, -half), (radius, -half), (radius, half), (0.0, half)])


def move(mesh: Mesh, place: pin.SE3) -> Mesh:
    """A mesh in other axes, given the pose of its own in them."""
    return Mesh((mesh.vertices @ place.rotation.T + place.translation).astype(np.float32), mesh.faces)


def read_geom(model: mujoco.MjModel, geom: int) -> Mesh | None:
    """One shape in the frame of its body; None for an infinite one, such as a plane."""
    kind, size = int(model.geom_type[geom]), np.array(model.geom_size[geom])
    kinds = mujoco.mjtGeom
    if kind == kinds.mjGEOM_BOX:
        mesh = box(size)
    elif kind == kinds.mjGEOM_SPHERE:
        mesh = sphere(float(size[0]))
    elif kind == kinds.mjGEOM_CAPSULE:
        mesh = capsule(float(size[0]), float(size[1]))
    elif kind == kinds.mjGEOM_CYLINDER:
        mesh = cylinder(float(size[0]), float(size[1]))
    elif kind == kinds.mjGEOM_ELLIPSOID:
        unit = sphere(1.0)
        mesh = Mesh((unit.vertices * size).astype(np.float32), unit.faces)
    elif kind == kinds.mjGEOM_MESH:
        mesh = read_mesh(model, int(model.geom_dataid[geom]))
    else:
        return None
    w, x, y, z = (float(value) for value in model.geom_quat[geom])
    return move(mesh, pin.SE3(poses.rotation_from_quat_wxyz([w, x, y, z]), np.array(model.geom_pos[geom])))


def read_mesh(model: mujoco.MjModel, mesh: int) -> Mesh:
    """A mesh of a compiled model: the convex hull that collides, where the file has no faces."""
    vertices = model.mesh_vert[model.mesh_vertadr[mesh] :][: model.mesh_vertnum[mesh]]
    faces = model.mesh_face[model.mesh_faceadr[mesh] :][: model.mesh_facenum[mesh]]
    return Mesh(np.array(vertices, dtype=np.float32), np.array(faces, dtype=np.uint32))


def merge(meshes: list[Mesh]) -> Mesh | None:
    """Several meshes as one; None for none."""
    if not meshes:
        return None
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes[:-1])])
    faces = [mesh.faces + np.uint32(start) for mesh, start in zip(meshes, starts, strict=True)]
    return Mesh(np.vstack([mesh.vertices for mesh in meshes]), np.vstack(faces))
