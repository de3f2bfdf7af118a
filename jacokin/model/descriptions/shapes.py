"""The collision shapes of a robot as its description has them; those of bundled robots are read without MuJoCo.

And the mesh files that a URDF names: where they are, and their content in a format that MuJoCo reads.
"""

from __future__ import annotations

import itertools
import os
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path, PurePosixPath
from typing import NamedTuple
from urllib.parse import unquote, urlparse

import numpy as np
import pinocchio as pin

from jacokin.arrays import Array
from jacokin.errors import ModelError
from jacokin.model.descriptions import bundled

NO_VERTICES = np.empty((0, 3))
#: What shapes can be, simple ones first; the names are MJCF's.
KINDS = ("plane", "sphere", "capsule", "ellipsoid", "cylinder", "box", "mesh")


class Shape(NamedTuple):
    """One convex shape and what carries it."""

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


class BundledShapes(NamedTuple):
    """The shapes of the links of a bundled robot, and which of them count as contact when they touch."""

    shapes: list[Shape]
    pairs: list[tuple[int, int]]
    """Numbers of shapes: not of parent and child, and not excluded in the file."""


def read_bundled(name: str, model: pin.Model, links: Mapping[str, int]) -> BundledShapes:
    """The shapes of a bundled robot, from its generated MJCF file.

    Args:
        name: of the robot.
        model: the arm, its fingers locked.
        links: number of Pinocchio's frame for each link that belongs to the arm.
    """
    path = bundled.urdf_folder() / f"{name}.xml"
    root = ET.parse(path).getroot()
    excluded = {frozenset((each.attrib["body1"], each.attrib["body2"])) for each in root.iter("exclude")}
    welds = _welds(root, path)
    found: list[tuple[Shape, str]] = []
    for body in root.iter("body"):
        link = body.attrib["name"]
        if link not in links:
            continue
        frame = model.frames[links[link]]
        found += [(_shape(geom, frame), link) for geom in body.findall("geom")]
    found.sort(key=lambda each: each[0].joint)  # as MuJoCo numbers them in the twin of the arm
    pairs = []
    for (a, (shape, link)), (b, (other_shape, other)) in itertools.combinations(enumerate(found), 2):
        if shape.joint == other_shape.joint or frozenset((link, other)) in excluded:
            continue
        (weld, parent), (other_weld, other_parent) = welds[link], welds[other]
        if weld != other_parent and other_weld != parent:
            pairs.append((a, b))
    return BundledShapes([shape for shape, _ in found], pairs)


def _welds(root: ET.Element, path: Path) -> dict[str, tuple[str, str]]:
    """For each body the first of those that are welded together with it, and that of the body before those."""
    world = root.find("worldbody")
    assert world is not None, path  # of a generated file
    found = {"world": ("world", "")}

    def walk(body: ET.Element, name: str) -> None:
        for child in body.findall("body"):
            own, above = child.attrib["name"], found[name]
            found[own] = above if child.find("joint") is None else (own, above[0])
            walk(child, own)

    walk(world, "world")
    return found


def _shape(geom: ET.Element, frame: pin.Frame) -> Shape:
    size = np.zeros(3)
    numbers = np.array(geom.attrib["size"].split(), dtype=np.float64)
    size[: len(numbers)] = numbers
    w, x, y, z = map(float, geom.get("quat", "1 0 0 0").split())
    turn = pin.Quaternion(w, x, y, z).normalized().toRotationMatrix()
    placement = pin.SE3(turn, np.array(geom.get("pos", "0 0 0").split(), dtype=np.float64))
    return Shape(geom.attrib["name"], geom.attrib["type"], size, frame.parentJoint, frame.placement * placement)


PACKAGE_SCHEMES = ("package", "model")
SEARCH_PATH = "ROS_PACKAGE_PATH"
STL_HEADER, STL_FACE = 84, 50  # bytes of a binary file


def embed_meshes(robot: ET.Element, path: Path, package_dirs: Sequence[Path]) -> dict[str, bytes]:
    """Replace the file names of all meshes by unique ones without folders, and return the contents by these names.

    Args:
        robot: the robot element of a checked URDF; changed.
        path: the URDF file: relative names start at its folder.
        package_dirs: folders that hold packages, searched before those of ROS_PACKAGE_PATH.

    Raises:
        ModelError: a mesh is not found or cannot be read; names it.
    """
    names: dict[Path, str] = {}
    contents: dict[str, bytes] = {}
    for mesh in robot.iter("mesh"):
        file_name = mesh.get("filename", "")
        found = find_mesh(file_name, path, package_dirs)
        if found not in names:
            content, suffix = _content(found, path)
            names[found] = f"{len(names)}_{found.stem}{suffix}"  # MuJoCo's messages name it
            contents[names[found]] = content
        mesh.set("filename", names[found])
    return contents


def find_mesh(file_name: str, path: Path, package_dirs: Sequence[Path]) -> Path:
    """The file that a URDF at `path` means by the name of a mesh.

    Raises:
        ModelError: there is none; says what to give for a package.
    """
    candidates = list(_candidates(file_name, path, package_dirs))
    for candidate in candidates:
        if candidate.is_file():
            return candidate
    url = urlparse(file_name)
    advice = ""
    if url.scheme in PACKAGE_SCHEMES:
        advice = f"; give the folder that holds the package {url.netloc!r} with package_dirs= or {SEARCH_PATH}"
    raise ModelError(
        f"{path}: mesh {file_name!r} is not found{advice}. Self-contact needs the meshes, kinematics does not"
    )


def _candidates(file_name: str, path: Path, package_dirs: Sequence[Path]) -> Iterator[Path]:
    """Where a file may be: in a package, or beside the URDF."""
    url = urlparse(file_name)
    if url.scheme == "file":
        yield Path(unquote(url.path))
    elif url.scheme in PACKAGE_SCHEMES:
        inside = PurePosixPath(unquote(url.path).lstrip("/"))
        roots = [*package_dirs, *(Path(entry) for entry in os.environ.get(SEARCH_PATH, "").split(os.pathsep) if entry)]
        for root in [*roots, *path.parents]:
            yield root / url.netloc / inside
            if root.name == url.netloc:  # the folder of the package itself
                yield root / inside
    else:
        yield path.parent / file_name


def _content(mesh: Path, path: Path) -> tuple[bytes, str]:
    """The bytes of a mesh, and the suffix of their format: OBJ or binary STL, into which all others are converted."""
    try:
        content = mesh.read_bytes()
    except OSError as error:
        raise ModelError(f"{path}: mesh {mesh} cannot be read: {error}") from error
    suffix = mesh.suffix.lower()
    faces = int.from_bytes(content[STL_HEADER - 4 : STL_HEADER], "little")
    if suffix == ".obj" or (suffix == ".stl" and len(content) == STL_HEADER + STL_FACE * faces):
        return content, suffix
    import trimesh

    try:
        return trimesh.exchange.stl.export_stl(trimesh.load_mesh(mesh)), ".stl"
    except Exception as error:  # whatever the reader of that format raises
        raise ModelError(f"{path}: mesh {mesh} cannot be read: {error!r}") from error
