"""The collision shapes of a robot as its description has them; those of bundled robots are read without MuJoCo."""

from __future__ import annotations

import itertools
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from jacokin.arrays import Array
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
