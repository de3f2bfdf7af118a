"""Writes a description as URDF: continuous and revolute joints, rigid links for frames, primitives."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping
from typing import Any

from urdf.description import Body, Description, Inertial, Joint, Placement, Shape, Vector


def urdf_text(robot: Description, table: Mapping[str, Any], header: str) -> str:
    """The URDF file of one robot."""
    root = ET.Element("robot", name=robot.name)
    root.append(ET.Comment(header))
    for look in ("dark", "light"):
        material = ET.SubElement(root, "material", name=look)
        ET.SubElement(material, "color", rgba=numbers(table["looks"][look]["rgba"]))
    for body in robot.bodies:
        _link(root, body)
        if body.parent is not None:
            _joint(root, body.name, body.parent, body.placement, body.joint, table)
    for frame in robot.frames:
        ET.SubElement(root, "link", name=frame.name)
        _joint(root, frame.name, frame.parent, frame.placement, None, table)
    ET.indent(root)
    return '<?xml version="1.0"?>\n' + ET.tostring(root, encoding="unicode") + "\n"


def numbers(values: Vector | list[float]) -> str:
    """Values with as many digits as it takes to read them back unchanged."""
    return " ".join(repr(float(x)) for x in values)


def _link(root: ET.Element, body: Body) -> None:
    link = ET.SubElement(root, "link", name=body.name)
    if body.inertial is not None:
        _inertial(link, body.inertial)
    for shape in body.shapes:
        for use in ("visual", "collision"):
            element = ET.SubElement(link, use, name=f"{body.name}_{shape.name}")
            _origin(element, shape.placement)
            _geometry(element, shape)
            if use == "visual":
                ET.SubElement(element, "material", name=shape.look)


def _inertial(link: ET.Element, inertial: Inertial) -> None:
    element = ET.SubElement(link, "inertial")
    ET.SubElement(element, "origin", xyz=numbers(inertial.com), rpy="0.0 0.0 0.0")
    ET.SubElement(element, "mass", value=repr(inertial.mass))
    names = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
    ET.SubElement(element, "inertia", {n: repr(x) for n, x in zip(names, inertial.inertia, strict=True)})


def _geometry(parent: ET.Element, shape: Shape) -> None:
    geometry = ET.SubElement(parent, "geometry")
    if shape.kind == "box":
        ET.SubElement(geometry, "box", size=numbers([2 * x for x in shape.size]))
    elif shape.kind == "cylinder":
        radius, half_length = shape.size
        ET.SubElement(geometry, "cylinder", radius=repr(radius), length=repr(2 * half_length))
    else:
        ET.SubElement(geometry, "sphere", radius=repr(shape.size[0]))


def _origin(parent: ET.Element, placement: Placement) -> None:
    ET.SubElement(parent, "origin", xyz=numbers(placement.xyz), rpy=numbers(placement.rpy))


def _joint(
    root: ET.Element,
    child: str,
    parent: str,
    placement: Placement,
    joint: Joint | None,
    table: Mapping[str, Any],
) -> None:
    if joint is None:
        element = ET.SubElement(root, "joint", name=f"{child}_mount", type="fixed")
    else:
        kind = "continuous" if joint.limits is None else "revolute"
        element = ET.SubElement(root, "joint", name=joint.name, type=kind)
    _origin(element, placement)
    ET.SubElement(element, "parent", link=parent)
    ET.SubElement(element, "child", link=child)
    if joint is None:
        return
    ET.SubElement(element, "axis", xyz="0 0 1")
    bounds = {} if joint.limits is None else {"lower": repr(joint.limits[0]), "upper": repr(joint.limits[1])}
    ET.SubElement(element, "limit", bounds, effort=repr(joint.effort), velocity=repr(joint.velocity))
    dynamics = table["dynamics"][joint.group]
    ET.SubElement(element, "dynamics", damping=repr(dynamics["damping"]), friction=repr(dynamics["frictionloss"]))
