"""The collision shapes of a robot as its description has them; those of bundled robots are read without MuJoCo.

And those of a URDF, made ready for MuJoCo: meshes as their convex hulls, and no shape without a size.
"""

from __future__ import annotations

import itertools
import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pinocchio as pin

from jacokin.arrays import Array
from jacokin.errors import ShapeError, shown
from jacokin.kernels.contact.cloud_tree import CloudTree
from jacokin.model import poses
from jacokin.model.descriptions import bundled
from jacokin.model.descriptions.meshes import (
    FARTHEST,
    THIN,
    Z_UP,
    TriangleMesh,
    find_mesh,
    hull_of,
    read_mesh_file,
    stl_bytes,
)
from jacokin.model.descriptions.urdf import MALFORMED

if TYPE_CHECKING:
    import mujoco

NO_VERTICES = np.empty((0, 3))
#: What shapes can be, simple ones first; the names are MJCF's, but for clouds of points.
KINDS = ("plane", "sphere", "capsule", "ellipsoid", "cylinder", "box", "mesh", "cloud")


class Shape(NamedTuple):
    """One convex shape, or a cloud of points, and what carries it."""

    name: str
    kind: str
    """One of `KINDS`, or what MuJoCo calls it."""
    size: Array
    """(3,) radii and half lengths as in MJCF [m]."""
    joint: int
    """Number of Pinocchio's joint that moves it; 0 for the base and for obstacles."""
    placement: pin.SE3
    """Where it is in the frame of that joint."""
    vertices: Array = NO_VERTICES
    """(n, 3) of a mesh, in the frame of the shape [m]."""
    cloud: CloudTree | None = None
    """The points of a cloud, in the frame of the shape; its radius is the first of `size`."""


def add_solid(body: mujoco.MjsBody, solid: Shape) -> mujoco.MjsGeom:
    """Add a shape to a body; a mesh must be in the model already, by the name of the shape."""
    import mujoco  # an arm alone is checked without it

    return body.add_geom(
        name=solid.name,
        type=getattr(mujoco.mjtGeom, f"mjGEOM_{solid.kind.upper()}"),
        size=(1.0, 1.0, 0.1) if solid.kind == "plane" else solid.size,  # [m] how a plane is drawn, which has no end
        meshname=solid.name if solid.kind == "mesh" else "",
        pos=solid.placement.translation,
        quat=poses.quaternion(solid.placement.rotation),
        contype=0,
        conaffinity=0,
    )


class ShapesOfLinks(NamedTuple):
    """The shapes of the links of an arm, and which of them count as contact when they touch."""

    shapes: list[Shape]
    pairs: list[tuple[int, int]]
    """Numbers of shapes: not of parent and child, and not excluded in the file."""


def read_bundled(name: str, model: pin.Model, links: Mapping[str, int]) -> ShapesOfLinks:
    """The shapes of a bundled robot, from its generated MJCF file.

    Args:
        name: of the robot.
        model: the arm, its fingers locked.
        links: number of Pinocchio's frame for each link that belongs to the arm.
    """
    root = ET.parse(bundled.urdf_folder() / f"{name}.xml").getroot()
    excluded = {frozenset((each.attrib["body1"], each.attrib["body2"])) for each in root.iter("exclude")}
    above = {child: body for body in root.iter() for child in body.findall("body")}

    def moved(body: ET.Element | None) -> ET.Element | None:
        """The first of the bodies that are welded together with one, by a joint that moves them; None for the world."""
        while body is not None and body.find("joint") is None:
            body = above.get(body)
        return body

    found: list[tuple[Shape, str, ET.Element | None, ET.Element | None]] = []
    for body in root.iter("body"):
        link, weld = body.attrib["name"], moved(body)
        if link in links:
            frame, parent = model.frames[links[link]], None if weld is None else moved(above[weld])
            found += [(_shape(geom, frame), link, weld, parent) for geom in body.findall("geom")]
    found.sort(key=lambda each: each[0].joint)  # as MuJoCo numbers them in the twin of the arm
    pairs = []
    for (a, one), (b, two) in itertools.combinations(enumerate(found), 2):
        (shape, link, weld, parent), (other_shape, other, other_weld, other_parent) = one, two
        if shape.joint == other_shape.joint or frozenset((link, other)) in excluded:
            continue
        if weld is not other_parent and other_weld is not parent:
            pairs.append((a, b))
    return ShapesOfLinks([shape for shape, *_ in found], pairs)


def _shape(geom: ET.Element, frame: pin.Frame) -> Shape:
    size = np.zeros(3)
    numbers = np.array(geom.attrib["size"].split(), dtype=np.float64)
    size[: len(numbers)] = numbers
    w, x, y, z = map(float, geom.get("quat", "1 0 0 0").split())
    turn = pin.Quaternion(w, x, y, z).normalized().toRotationMatrix()
    placement = pin.SE3(turn, np.array(geom.get("pos", "0 0 0").split(), dtype=np.float64))
    return Shape(geom.attrib["name"], geom.attrib["type"], size, frame.parentJoint, frame.placement * placement)


# The numbers of the simple shapes of a URDF that must be larger than zero for them to have a volume.
SIZES: Mapping[str, Sequence[str]] = {
    "box": ("size",),
    "sphere": ("radius",),
    "cylinder": ("radius", "length"),
    "capsule": ("radius", "length"),
}


class PreparedShapes(NamedTuple):
    """What a URDF needs beside its text so that MuJoCo takes its collision shapes."""

    assets: dict[str, bytes]
    """The hulls of its meshes as STL files, by the names that the text has for them now."""
    notes: tuple[str, ...]
    """Sentences on shapes that were left out, and on meshes whose axes are in doubt."""
    meshes: dict[str, TriangleMesh]
    """The meshes themselves, scaled, by the same names."""


def prepare_shapes(robot: ET.Element, path: Path, package_dirs: Sequence[Path]) -> PreparedShapes:
    """Make the collision shapes of a URDF ones that MuJoCo takes.

    A mesh becomes its convex hull, which is what collides. What is flat gets a thickness of 0.02 mm. A shape that is a
    point is left out, alone, and a name that another shape has is dropped.

    Args:
        robot: the robot element of a checked URDF; changed.
        path: the URDF file: relative names start at its folder.
        package_dirs: folders that hold packages, searched before those of ROS_PACKAGE_PATH.

    Raises:
        ShapeError: a mesh is not found or cannot be read, a size is negative, or a shape is of an unknown kind; names
            the link.
    """
    hulls = _Hulls(path, package_dirs)
    names: set[str] = set()
    notes: list[str] = []
    for link in robot.findall("link"):
        for number, collision in enumerate(link.findall("collision")):
            name = collision.get("name", "")
            where = f"collision shape {name or number + 1!r} of link {link.get('name')!r}"
            if name in names:
                collision.attrib.pop("name", None)
            names.add(name)
            if collision.get(MALFORMED):
                raise ShapeError(f"{collision.get(MALFORMED)}. Contact needs the shapes, kinematics does not")
            shape = next(iter(collision.findall("geometry/*")), None)
            if shape is not None and shape.tag != "mesh" and shape.tag not in SIZES:
                kinds = ", ".join((*SIZES, "mesh"))
                raise ShapeError(f"{path}: {where} is a <{shape.tag}>, none of {kinds}")
            try:
                has_size = shape is not None and (
                    hulls.replace(shape, notes) if shape.tag == "mesh" else _has_size(shape)
                )
            except ShapeError:
                raise
            except ValueError as error:
                raise ShapeError(f"{path}: {where}: {error}") from error
            if not has_size:
                link.remove(collision)
                notes.append(f"{where} has no size and is left out of contact")
    return PreparedShapes(hulls.assets, tuple(dict.fromkeys(notes)), hulls.meshes)


def _has_size(shape: ET.Element) -> bool:
    """Whether a simple shape is more than a point; where it is flat it gets a thickness.

    Raises:
        ValueError: a size is negative, or too large.
    """
    found = False
    for attribute in SIZES[shape.tag]:
        numbers = np.array(shape.get(attribute, "").split(), dtype=np.float64)
        if (numbers < 0.0).any() or (numbers > FARTHEST).any():
            problem = "negative" if (numbers < 0.0).any() else f"beyond {FARTHEST:g} m"
            raise ValueError(f"{attribute} {shape.get(attribute)} is {problem}")
        found |= bool((numbers > THIN).any())
        shape.set(attribute, " ".join(map(repr, np.maximum(numbers, 2.0 * THIN).tolist())))
    return found


class _Hulls:
    """The meshes of a URDF as hulls, each found once."""

    def __init__(self, path: Path, package_dirs: Sequence[Path]) -> None:
        self.assets: dict[str, bytes] = {}
        self.meshes: dict[str, TriangleMesh] = {}
        self._path, self._package_dirs = path, package_dirs
        self._found: dict[tuple[Path, tuple[float, ...]], str] = {}  # file and scale -> asset, "" for none

    def replace(self, element: ET.Element, notes: list[str]) -> bool:
        """Let a `<mesh>` name the hull of its file, scaled; False where that is a point.

        Raises:
            ShapeError: no such file, or it cannot be read.
            ValueError: it has no hull.
        """
        file_name, scale = element.get("filename", ""), mesh_scale(element)
        file = find_mesh(file_name, self._path, self._package_dirs)
        key = file, tuple(scale.tolist())
        if key not in self._found:
            mesh = read_mesh_file(file, self._path)
            if mesh.up_axis != Z_UP:
                notes.append(
                    f"the mesh {shown(file_name)} says {mesh.up_axis}; it is not turned, as viewers of robots do not"
                )
            hull = hull_of(mesh.vertices * scale)
            self._found[key] = "" if hull is None else f"{len(self.assets)}_{file.stem}.stl"
            if hull is not None:
                self.assets[self._found[key]] = stl_bytes(hull)
                self.meshes[self._found[key]] = mesh._replace(vertices=mesh.vertices * scale)
        element.attrib.pop("scale", None)
        element.set("filename", self._found[key])
        return bool(self._found[key])


def mesh_scale(element: ET.Element) -> Array:
    """(3,) by what the axes of a `<mesh>` of a checked URDF are multiplied; one number stands for all three."""
    return np.broadcast_to(np.array(element.get("scale", "1").split(), dtype=np.float64), 3)
