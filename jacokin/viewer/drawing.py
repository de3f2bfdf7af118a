"""What is drawn, as triangle meshes: an arm by the shapes that collide or by its visual meshes, and obstacles."""

from __future__ import annotations

import functools
import xml.etree.ElementTree as ET
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.errors import ModelError
from jacokin.model import poses
from jacokin.model.descriptions import mjcf
from jacokin.model.descriptions.meshes import TriangleMesh, find_mesh, hull_of, read_mesh_file
from jacokin.model.descriptions.shapes import mesh_scale
from jacokin.model.descriptions.urdf import origin_of
from jacokin.model.mujoco_twin import compile_spec, rgba_of, to_spec
from jacokin.model.point_cloud import PointCloud
from jacokin.model.robot import Robot
from jacokin.model.scene import Scene

SIGNS = np.array(list(product((-1.0, 1.0), repeat=3)))  # of the corners of a box
SIDES = 24  # of what is round; from the equator of a sphere to its pole, a quarter of it
STEPS = 3  # of a rounded edge
PLATE = (1.0, 1.0, 0.002)  # [m] half edges of what is drawn of a floor
BONE_RADIUS = 0.02  # [m] of the sticks that stand for an arm without shapes
DRAWN_POINTS = 20_000  # of a cloud: browsers draw eight triangles for each
# Faces of an octahedron whose corners are x, y, z, -x, -y, -z; counter-clockwise from outside.
OCTAHEDRON = np.array([(0, 1, 2), (1, 3, 2), (3, 4, 2), (4, 0, 2), (1, 0, 5), (3, 1, 5), (4, 3, 5), (0, 4, 5)])


Colour = tuple[int, int, int]
PLAIN: Colour = (205, 211, 219)  # of a mesh without a colour


@dataclass(frozen=True, slots=True, eq=False)
class Triangles:
    """A triangle mesh."""

    vertices: NDArray[np.float32]
    """(v, 3) [m]."""
    faces: NDArray[np.uint32]
    """(f, 3) counter-clockwise from outside."""


@dataclass(frozen=True, slots=True, eq=False)
class ColouredMesh:
    """Triangles of one colour."""

    mesh: Triangles
    """In the frame of its part."""
    colour: Colour = PLAIN
    """Red, green, blue."""
    smooth: bool = False
    """Whether the light runs smoothly over its edges."""


@dataclass(frozen=True, slots=True, eq=False)
class ArmPart:
    """What one joint moves, in Pinocchio's frame of that joint; the base is part 0."""

    name: str
    """Of the joint; "base" for the base."""
    pieces: tuple[ColouredMesh, ...] = ()
    """What is drawn, each colour once."""
    shapes: dict[str, Triangles] = field(default_factory=dict)
    """The collision shapes by name. What is drawn of them has rounded edges, some millimetres inside."""

    @property
    def mesh(self) -> Triangles | None:
        """All pieces as one; None where there is nothing to draw."""
        return merge([piece.mesh for piece in self.pieces])


def load_parts(
    robot: Robot, finger_angle: float | None = None, *, sides: int | None = None
) -> tuple[tuple[ArmPart, ...], str]:
    """The base and the part each joint moves, base to tip; and why it is sticks from joint to joint, or "".

    Args:
        robot: the arm.
        finger_angle: where its fingers stand [rad], or [m] where they slide; None for as it was loaded.
        sides: draw with so few sides of what is round, a multiple of 4, and with sharp edges; None for a good look.
    """
    try:
        model = compile_spec(to_spec(robot, geometry=True, finger_angle=finger_angle), robot)
    except ModelError as error:
        return build_sticks(robot), str(error)
    first = model.body(1).id  # bodies are the world, the base, and one for each joint, in the order of the joints
    parts = []
    for index, name in enumerate(("base", *robot.joint_names)):
        geoms = [g for g in range(model.ngeom) if model.geom_bodyid[g] == first + index]
        found = {str(model.geom(geom).name): mesh for geom in geoms if (mesh := read_geom(model, geom)) is not None}
        pieces = [piece for geom in geoms if (piece := draw_geom(model, geom, sides)) is not None]
        parts.append(ArmPart(name, by_colour(pieces), found))
    if any(part.pieces for part in parts):
        return tuple(parts), ""
    return build_sticks(robot), "the description has no collision shapes"


def build_obstacles(scene: Scene) -> dict[str, Triangles]:
    """The shapes of a scene by name, in the base frame; a floor as a thin plate."""
    spec = mujoco.MjSpec()
    meshes = {}
    for obstacle in scene:
        if isinstance(obstacle, PointCloud):
            meshes[obstacle.name] = cloud(obstacle)
        else:
            obstacle.add_to(spec.worldbody)
    model = spec.compile()
    for geom in range(model.ngeom):
        mesh = read_geom(model, geom)
        if mesh is None:
            z = float(model.geom_pos[geom][2])
            mesh = move(box(np.array(PLATE)), pin.SE3(np.eye(3), np.array([0.0, 0.0, z - PLATE[2]])))
        meshes[str(model.geom(geom).name)] = mesh
    return meshes


def build_sticks(robot: Robot) -> tuple[ArmPart, ...]:
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
        parts.append(ArmPart(name, by_colour([ColouredMesh(mesh, smooth=True) for mesh in meshes])))
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
    return tuple(ArmPart(name, by_colour(drawn.get(number, []))) for number, name in enumerate(names))


def _read_urdf(robot: Robot, text: str) -> dict[int, list[ColouredMesh]]:
    """Pieces by the number of the joint that moves them, in its frame."""
    read: dict[Path, TriangleMesh] = {}
    drawn: dict[int, list[ColouredMesh]] = {}
    tree = ET.fromstring(text)
    looks = {each.get("name", ""): each for each in tree.findall("material")}
    for link in tree.findall("link"):
        name = link.get("name", "")
        if name not in robot.frames:
            continue
        frame = robot.pin_model.frames[robot.frame_id(name)]
        for visual in link.findall("visual"):
            mesh = _read_visual(robot, visual, read)
            if mesh is not None:
                piece = ColouredMesh(move(mesh, frame.placement * origin_of(visual)), _look(visual, looks))
                drawn.setdefault(frame.parentJoint, []).append(piece)
    return drawn


def _look(visual: ET.Element, looks: dict[str, ET.Element]) -> Colour:
    """The colour of a `<visual>`: its own, or that of the material it names."""
    material = visual.find("material")
    if material is None:
        return PLAIN
    for owner in (material, looks.get(material.get("name", ""))):
        colour = None if owner is None else owner.find("color")
        if colour is not None:
            return to_colour(_numbers(colour, "rgba", "1 1 1 1"))
    return PLAIN


def _read_visual(robot: Robot, visual: ET.Element, read: dict[Path, TriangleMesh]) -> Triangles | None:
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
            found = find_mesh(shape.get("filename", ""), source.path, source.package_dirs)
            if found not in read:
                read[found] = read_mesh_file(found, source.path)
            scale, mesh = mesh_scale(shape), read[found]
            faces = mesh.faces if np.prod(scale) > 0.0 else mesh.faces[:, ::-1]  # a mirrored mesh
            return Triangles((mesh.vertices * scale).astype(np.float32), faces.astype(np.uint32))
    return None


def _read_mjcf(robot: Robot, model: mujoco.MjModel) -> dict[int, list[ColouredMesh]]:
    """Meshes of the geoms of each joint that are shown; empty where every one of them collides."""
    drawn: dict[int, list[ColouredMesh]] = {}
    decorative = False
    for geom in range(model.ngeom):
        body = int(model.geom_bodyid[geom])
        name = mjcf.body_name(model, body)
        alpha = rgba_of(model, geom)[3]
        # The viewers of MuJoCo show groups 0 to 2 unless told otherwise.
        if not body or name not in robot.frames or model.geom_group[geom] >= 3 or not alpha:
            continue
        mesh = read_geom(model, geom)
        if mesh is not None:
            frame = robot.pin_model.frames[robot.frame_id(name)]
            piece = ColouredMesh(move(mesh, frame.placement), to_colour(rgba_of(model, geom)))
            drawn.setdefault(frame.parentJoint, []).append(piece)
            decorative |= not (model.geom_contype[geom] or model.geom_conaffinity[geom])
    return drawn if decorative else {}


def _numbers(element: ET.Element, name: str, default: str = "") -> Array:
    return np.array([float(part) for part in element.get(name, default).split()])


def to_colour(rgba: Array) -> Colour:
    """Red, green and blue from 0 to 255, from (4,) in 0..1."""
    red, green, blue = (round(255.0 * min(max(value, 0.0), 1.0)) for value in rgba[:3].tolist())
    return red, green, blue


def by_colour(pieces: list[ColouredMesh]) -> tuple[ColouredMesh, ...]:
    """Pieces with those of one look merged."""
    groups: dict[tuple[Colour, bool], list[Triangles]] = {}
    for piece in pieces:
        groups.setdefault((piece.colour, piece.smooth), []).append(piece.mesh)
    merged = [(merge(meshes), *look) for look, meshes in groups.items()]
    return tuple(ColouredMesh(mesh, colour, smooth) for mesh, colour, smooth in merged if mesh is not None)


def rounded_box(half: Array) -> Triangles:
    """A box by its half edges (3,) [m] with rounded edges, inside it."""
    radius = bevel(half)
    corners = (half - radius) * SIGNS
    ball = revolved_points(_arc(radius, 0.0, 4 * STEPS), 4 * STEPS)
    return hull((corners[:, np.newaxis] + ball).reshape(-1, 3))


def rounded_cylinder(radius: float, half: float) -> Triangles:
    """A cylinder along z by its radius and half its length [m] with rounded edges, inside it."""
    edge = bevel(np.array([radius, half]))
    profile = np.array([radius - edge, 0.0]) + _arc(edge, half - edge, 4 * STEPS)
    return hull(revolved_points(profile, 36))  # smooth


def bevel(half: Array) -> float:
    """The radius of the rounded edges of a shape by its half sizes [m]."""
    length, part = 0.006, 0.3  # [m] radius of an edge, and at most this part of the shape's least half size
    return min(length, part * float(half.min()))


def box(half: Array) -> Triangles:
    """A box by its half edges (3,) [m]."""
    return hull(half * SIGNS)


def sphere(radius: float, sides: int = SIDES) -> Triangles:
    """A sphere by its radius [m]."""
    return capsule(radius, 0.0, sides)


def capsule(radius: float, half: float, sides: int = SIDES) -> Triangles:
    """A capsule along z by its radius and half the length of its cylinder [m]."""
    return hull(revolved_points(_arc(radius, half, sides), sides))


def cylinder(radius: float, half: float, sides: int = SIDES) -> Triangles:
    """A cylinder along z by its radius and half its length [m]."""
    return hull(revolved_points(np.array([(radius, -half), (radius, half)]), sides))


def _arc(radius: float, half: float, sides: int) -> Array:
    """(n, 2) radius and z [m] of two quarters of a circle, the upper one `half` up, the lower one as far down."""
    rise = np.linspace(0.0, 0.5 * np.pi, sides // 4 + 1)
    upper = np.column_stack((radius * np.cos(rise), half + radius * np.sin(rise)))
    return np.vstack((upper, upper * [1.0, -1.0]))


def revolved_points(profile: Array, sides: int) -> Array:
    """(n, 3) the points of a profile (k, 2) of radius and z [m] as it turns around z."""
    angles = np.linspace(0.0, 2.0 * np.pi, sides, endpoint=False)
    circle = np.column_stack((np.cos(angles), np.sin(angles)))
    flat = (profile[:, np.newaxis, :1] * circle).reshape(-1, 2)
    return np.column_stack((flat, np.repeat(profile[:, 1], sides)))


def hull(points: Array) -> Triangles:
    """The convex hull of points (n, 3) [m], which all these shapes are; of those that differ by rounding, one."""
    mesh = hull_of(np.round(points, 9))
    assert mesh is not None
    return Triangles(mesh.vertices.astype(np.float32), mesh.faces.astype(np.uint32))


def cloud(obstacle: PointCloud) -> Triangles:
    """An octahedron inside of the sphere around each point, in the base frame; of many points some."""
    points = obstacle.some_points(DRAWN_POINTS)
    corners = max(obstacle.radius, 0.001) * np.vstack([np.eye(3), -np.eye(3)])  # [m]
    vertices = (points[:, np.newaxis] + corners).reshape(-1, 3)
    faces = OCTAHEDRON + len(corners) * np.arange(len(points))[:, np.newaxis, np.newaxis]
    return Triangles(vertices.astype(np.float32), faces.reshape(-1, 3).astype(np.uint32))


def move(mesh: Triangles, place: pin.SE3) -> Triangles:
    """A mesh in other axes, given the pose of its own in them."""
    return Triangles((mesh.vertices @ place.rotation.T + place.translation).astype(np.float32), mesh.faces)


def draw_geom(model: mujoco.MjModel, geom: int, sides: int | None = None) -> ColouredMesh | None:
    """One shape as it is drawn: in its colour, boxes and cylinders with rounded edges, or with so few sides."""
    mesh = read_geom(model, geom, rounded=sides is None, sides=sides or SIDES)
    smooth = model.geom_type[geom] != mujoco.mjtGeom.mjGEOM_MESH
    return None if mesh is None else ColouredMesh(mesh, to_colour(rgba_of(model, geom)), smooth)


def read_geom(model: mujoco.MjModel, geom: int, *, rounded: bool = False, sides: int = SIDES) -> Triangles | None:
    """One shape in the frame of its body; None for an infinite one, such as a plane."""
    if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_MESH:
        mesh: Triangles | None = read_mesh(model, int(model.geom_dataid[geom]))
    else:
        mesh = _primitive(
            int(model.geom_type[geom]), tuple(model.geom_size[geom].tolist()), rounded=rounded, sides=sides
        )
    return None if mesh is None else _placed(mesh, model.geom_pos[geom], model.geom_quat[geom])


def read_site(model: mujoco.MjModel, site: int) -> Triangles | None:
    """The shape of a site in the frame of its body."""
    mesh = _primitive(int(model.site_type[site]), tuple(model.site_size[site].tolist()))
    return None if mesh is None else _placed(mesh, model.site_pos[site], model.site_quat[site])


def _placed(mesh: Triangles, position: Array, quat_wxyz: Array) -> Triangles:
    w, x, y, z = (float(value) for value in quat_wxyz)
    return move(mesh, pin.SE3(poses.rotation_from_quat_wxyz([w, x, y, z]), np.array(position)))


@functools.lru_cache(maxsize=256)  # arms have the same ones each time they are drawn
def _primitive(kind: int, size: tuple[float, ...], *, rounded: bool = False, sides: int = SIDES) -> Triangles | None:
    """A shape of MuJoCo by its kind and size (3,) [m]; None for what is none of those that are drawn."""
    kinds = mujoco.mjtGeom
    if kind == kinds.mjGEOM_BOX:
        half = np.array(size)
        return rounded_box(half) if rounded else box(half)
    if kind == kinds.mjGEOM_SPHERE:
        return sphere(size[0], sides)
    if kind == kinds.mjGEOM_CAPSULE:
        return capsule(size[0], size[1], sides)
    if kind == kinds.mjGEOM_CYLINDER:
        return rounded_cylinder(size[0], size[1]) if rounded else cylinder(size[0], size[1], sides)
    if kind == kinds.mjGEOM_ELLIPSOID:
        unit = sphere(1.0, sides)
        return Triangles((unit.vertices * size).astype(np.float32), unit.faces)
    return None


def read_mesh(model: mujoco.MjModel, mesh: int) -> Triangles:
    """A mesh of a compiled model: the convex hull that collides, where the file has no faces."""
    vertices = model.mesh_vert[model.mesh_vertadr[mesh] :][: model.mesh_vertnum[mesh]]
    faces = model.mesh_face[model.mesh_faceadr[mesh] :][: model.mesh_facenum[mesh]]
    return Triangles(np.array(vertices, dtype=np.float32), np.array(faces, dtype=np.uint32))


def merge(meshes: list[Triangles]) -> Triangles | None:
    """Several meshes as one; None for none."""
    if not meshes:
        return None
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes[:-1])])
    faces = [mesh.faces + np.uint32(start) for mesh, start in zip(meshes, starts, strict=True)]
    return Triangles(np.vstack([mesh.vertices for mesh in meshes]), np.vstack(faces))
