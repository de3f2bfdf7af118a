"""Writes a description, or only its arm or its hand, as MJCF: no actuators, sensors or options."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterable, Mapping
from typing import Any

from urdf.description import Body, Description, Placement, placement
from urdf.write_urdf import numbers

FINGER = "link_finger"  # how the names of fingers and their tips begin


def robot_mjcf(robot: Description, table: Mapping[str, Any], header: str) -> str:
    """Arm and hand in one file."""
    return _mjcf(robot.name, robot, robot.bodies, table, header)


def arm_mjcf(robot: Description, table: Mapping[str, Any], header: str) -> str:
    """The arm without a hand, to be attached to by its ``wristsite``."""
    return _mjcf("jaco_arm", robot, robot.arm_bodies(), table, header)


def hand_mjcf(robot: Description, table: Mapping[str, Any], header: str) -> str:
    """The hand alone, its pose the one it has in the frame of the ``wristsite``."""
    return _mjcf("jaco_hand", robot, robot.hand_bodies(), table, header, root=placement(table["hand_mount"]))


def _mjcf(
    model: str,
    robot: Description,
    bodies: tuple[Body, ...],
    table: Mapping[str, Any],
    header: str,
    root: Placement | None = None,
) -> str:
    mujoco = ET.Element("mujoco", model=model)
    mujoco.append(ET.Comment(header))
    ET.SubElement(mujoco, "compiler", angle="radian", autolimits="true")
    names = {body.name for body in bodies}
    groups = {body.joint.group for body in bodies if body.joint is not None}
    fingers = next((body.joint.group for body in bodies if body.joint and body.name.startswith(FINGER)), "")
    _defaults(mujoco, table, robot.family, [group for group in table["dynamics"] if group in groups], fingers)
    asset = ET.SubElement(mujoco, "asset")
    for look in ("dark", "light"):
        ET.SubElement(asset, "material", name=look, rgba=numbers(table["looks"][look]["rgba"]))

    elements: dict[str | None, ET.Element] = {None: ET.SubElement(mujoco, "worldbody")}
    for body in bodies:
        parent = body.parent if body.parent in names else None
        pose = root if parent is None and root is not None else body.placement
        element = ET.SubElement(elements[parent], "body", {"name": body.name} | _pose(pose))
        if parent is None:
            element.set("childclass", robot.family)
        elements[body.name] = element
        _contents(element, body, fingers)
    for frame in robot.frames:
        if frame.parent in names:
            ET.SubElement(elements[frame.parent], "site", {"name": frame.name} | _pose(frame.placement))
    _exclusions(mujoco, (pair for pair in robot.excluded if names.issuperset(pair)))
    _children_last(elements[None])
    ET.indent(mujoco)
    return ET.tostring(mujoco, encoding="unicode") + "\n"


def _defaults(mujoco: ET.Element, table: Mapping[str, Any], family: str, groups: list[str], fingers: str) -> None:
    contact, looks = table["contacts"]["arm"], table["looks"]
    whole = ET.SubElement(ET.SubElement(mujoco, "default"), "default", {"class": family})
    ET.SubElement(
        whole,
        "geom",
        mass="0",
        contype=str(contact["contype"]),
        conaffinity=str(contact["conaffinity"]),
        condim=str(contact["condim"]),
        solref=numbers(contact["solref"]),
        solimp=numbers(contact["solimp"]),
        friction=numbers(contact["friction"]),
    )
    ET.SubElement(
        whole,
        "site",
        type="sphere",
        size=numbers([looks["site"]["site_radius"]]),
        rgba=numbers(looks["site"]["rgba"]),
        group="4",
    )
    for group in groups:
        element = ET.SubElement(whole, "default", {"class": group})
        if group == fingers:
            ET.SubElement(element, "geom", condim=str(table["contacts"]["finger"]["condim"]))
        dynamics = table["dynamics"][group]
        keys = ("damping", "armature", "frictionloss")
        ET.SubElement(element, "joint", {key: repr(dynamics[key]) for key in keys})


def _contents(element: ET.Element, body: Body, fingers: str) -> None:
    if body.inertial is not None:
        ET.SubElement(
            element,
            "inertial",
            pos=numbers(body.inertial.com),
            mass=repr(body.inertial.mass),
            fullinertia=numbers(body.inertial.inertia),
        )
    if body.joint is not None:
        joint = ET.SubElement(element, "joint", {"name": body.joint.name, "class": body.joint.group})
        if body.joint.limits is not None:
            joint.set("range", numbers(body.joint.limits))
    for shape in body.shapes:
        geom = ET.SubElement(element, "geom", name=f"{body.name}_{shape.name}", type=shape.kind)
        if body.name.startswith(FINGER):
            geom.set("class", fingers)
        geom.set("size", numbers(shape.size))
        geom.attrib.update(_pose(shape.placement))
        geom.set("material", shape.look)


def _exclusions(mujoco: ET.Element, pairs: Iterable[tuple[str, str]]) -> None:
    contact = ET.SubElement(mujoco, "contact")
    for body1, body2 in pairs:
        ET.SubElement(contact, "exclude", body1=body1, body2=body2)


def _children_last(element: ET.Element) -> None:
    """Put a body's own sites before its child bodies, as a reader expects them."""
    element[:] = sorted(element, key=lambda child: child.tag == "body")
    for child in element.findall("body"):
        _children_last(child)


def _pose(pose: Placement) -> dict[str, str]:
    attributes = {}
    if any(pose.xyz):
        attributes["pos"] = numbers(pose.xyz)
    if pose.quat_wxyz != (1.0, 0.0, 0.0, 0.0):
        attributes["quat"] = numbers(pose.quat_wxyz)
    return attributes
