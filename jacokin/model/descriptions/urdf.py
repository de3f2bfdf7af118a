"""URDF robots: parsed by yourdfpy, checked by us, then read by Pinocchio.

Parsers accept a lot that is not a robot: truncated XML, NaN origins, links whose parent does not exist. Everything
below is checked before Pinocchio sees the text, so that a mistake is named instead of solved.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections import Counter
from pathlib import Path

import numpy as np
import pinocchio as pin

from jacokin.errors import ModelError

JOINT_TYPES = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")
LIMITED_TYPES = ("revolute", "prismatic")
AXIS_TOLERANCE = 1e-3  # a hand-typed unit axis has three digits or more


def read(path: Path) -> tuple[pin.Model, set[str]]:
    """The whole robot of a checked URDF file, and the names of its mimic joints.

    Raises:
        ModelError: the file is malformed; the message names the element at fault.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ModelError(f"{path}: cannot be read: {error}") from error
    check(text, str(path))
    return parse(text, str(path)), mimic_joints(text)


def parse(text: str, source: str) -> pin.Model:
    """Hand URDF text to Pinocchio; only for text that has been checked or that this project generated.

    Raises:
        ModelError: Pinocchio refuses it.
    """
    try:
        model = pin.buildModelFromXML(text)
    except (ValueError, RuntimeError) as error:
        raise ModelError(f"{source}: Pinocchio cannot read this URDF: {error}") from error
    # Pinocchio names its first frame and joint "universe"; the root link is the first body frame.
    return model


def check(text: str, source: str) -> None:
    """Refuse URDF text that does not describe one tree of links with finite numbers.

    Raises:
        ModelError: names the element at fault.
    """
    try:
        robot = ET.fromstring(text)
    except ET.ParseError as error:
        raise ModelError(f"{source}: not well-formed XML (truncated?): {error}") from error
    if robot.tag != "robot":
        raise ModelError(f"{source}: the root element is <{robot.tag}>, a URDF has <robot>")
    links = [_required(link, "name", source) for link in robot.findall("link")]
    joints = robot.findall("joint")
    _unique(links, "link", source)
    _unique([_required(joint, "name", source) for joint in joints], "joint", source)
    if not links:
        raise ModelError(f"{source}: has no links")
    _check_numbers(robot, source)
    for joint in joints:
        _check_joint(joint, set(links), source)
    for link in robot.findall("link"):
        _check_inertial(link, source)
    _check_tree(joints, links, source)
    _check_with_yourdfpy(text, source)


def _required(element: ET.Element, attribute: str, source: str) -> str:
    value = element.get(attribute)
    if not value:
        raise ModelError(f"{source}: a <{element.tag}> has no {attribute}")
    return value


def _unique(names: list[str], kind: str, source: str) -> None:
    twice = [name for name, count in Counter(names).items() if count > 1]
    if twice:
        raise ModelError(f"{source}: {kind} {twice[0]!r} is defined more than once")


def _numbers(element: ET.Element, attribute: str, count: int, where: str) -> list[float] | None:
    """The finite numbers of an attribute; None when it is absent."""
    text = element.get(attribute)
    if text is None:
        return None
    try:
        values = [float(part) for part in text.split()]
    except ValueError as error:
        raise ModelError(f'{where}: {attribute}="{text}" is not made of numbers') from error
    if len(values) != count:
        raise ModelError(f'{where}: {attribute}="{text}" must have {count} numbers')
    if not all(math.isfinite(value) for value in values):
        raise ModelError(f'{where}: {attribute}="{text}" is not finite')
    return values


def _check_numbers(robot: ET.Element, source: str) -> None:
    """Origins, axes and masses everywhere in the file are finite and complete."""
    for owner in [*robot.findall("link"), *robot.findall("joint")]:
        where = f"{source}: {owner.tag} {owner.get('name')!r}"
        for element in owner.iter():
            if element.tag == "origin":
                _numbers(element, "xyz", 3, where)
                _numbers(element, "rpy", 3, where)
            elif element.tag == "axis":
                _numbers(element, "xyz", 3, where)
            elif element.tag == "mass":
                _numbers(element, "value", 1, where)
            elif element.tag == "inertia":
                for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"):
                    _numbers(element, key, 1, where)
            elif element.tag == "limit":
                for key in ("lower", "upper", "effort", "velocity"):
                    _numbers(element, key, 1, where)


def _check_joint(joint: ET.Element, links: set[str], source: str) -> None:
    name = joint.get("name")
    where = f"{source}: joint {name!r}"
    kind = joint.get("type")
    if kind not in JOINT_TYPES:
        raise ModelError(f"{where}: unknown type {kind!r}; valid: {', '.join(JOINT_TYPES)}")
    for role in ("parent", "child"):
        element = joint.find(role)
        link = element.get("link") if element is not None else None
        if link is None:
            raise ModelError(f"{where}: has no {role} link")
        if link not in links:
            raise ModelError(f"{where}: {role} link {link!r} does not exist")
    axis = joint.find("axis")
    if axis is not None and kind not in ("fixed", "floating"):
        values = _numbers(axis, "xyz", 3, where) or [1.0, 0.0, 0.0]
        norm = float(np.linalg.norm(values))
        if abs(norm - 1.0) > AXIS_TOLERANCE:
            raise ModelError(f"{where}: the axis must be a unit vector, its norm is {norm:.6g}")
    limit = joint.find("limit")
    if kind in LIMITED_TYPES:
        if limit is None:
            raise ModelError(f"{where}: a {kind} joint needs <limit>; an unlimited one has type continuous")
        lower = (_numbers(limit, "lower", 1, where) or [0.0])[0]
        upper = (_numbers(limit, "upper", 1, where) or [0.0])[0]
        if lower > upper:
            raise ModelError(f"{where}: lower limit {lower} is above upper limit {upper}")
    for key in ("effort", "velocity"):
        value = _numbers(limit, key, 1, where) if limit is not None else None
        if value is not None and value[0] < 0.0:
            raise ModelError(f"{where}: {key} limit {value[0]} is negative")


def _check_inertial(link: ET.Element, source: str) -> None:
    where = f"{source}: link {link.get('name')!r}"
    mass = link.find("inertial/mass")
    if mass is not None:
        value = (_numbers(mass, "value", 1, where) or [0.0])[0]
        if value < 0.0:
            raise ModelError(f"{where}: mass {value} is negative")


def _check_tree(joints: list[ET.Element], links: list[str], source: str) -> None:
    """Each link has one parent at most, exactly one has none, and all hang on it."""
    parent_of: dict[str, str] = {}
    for joint in joints:
        child = joint.find("child").get("link")  # type: ignore[union-attr]  # checked by _check_joint
        parent = joint.find("parent").get("link")  # type: ignore[union-attr]  # checked by _check_joint
        assert child is not None
        assert parent is not None
        if child in parent_of:
            raise ModelError(f"{source}: link {child!r} has two parents, {parent_of[child]!r} and {parent!r}")
        parent_of[child] = parent
    for link in links:
        seen = [link]
        while seen[-1] in parent_of:
            seen.append(parent_of[seen[-1]])
            if seen[-1] == link:
                raise ModelError(f"{source}: the links form a cycle: {' -> '.join(reversed(seen))}")
            if len(seen) > len(links):
                break  # the cycle is further up and is named when its own links are visited
    roots = [link for link in links if link not in parent_of]
    if len(roots) != 1:
        raise ModelError(f"{source}: a robot has one root link, this file has {len(roots)}: {', '.join(roots)}")


def _check_with_yourdfpy(text: str, source: str) -> None:
    """Let yourdfpy, the parser that tools around us use, read the same text."""
    import io

    import yourdfpy

    try:
        parsed = yourdfpy.URDF.load(io.BytesIO(text.encode()), load_meshes=False, build_scene_graph=False)
        valid = parsed.validate()
    except Exception as error:  # yourdfpy raises whatever its XML walk trips over
        raise ModelError(f"{source}: yourdfpy cannot read this URDF: {error!r}") from error
    if not valid:
        raise ModelError(f"{source}: yourdfpy finds this URDF invalid: {'; '.join(map(str, parsed.errors))}")


def mimic_joints(text: str) -> set[str]:
    """Names of the joints that follow another one."""
    return {joint.get("name", "") for joint in ET.fromstring(text).findall("joint") if joint.find("mimic") is not None}
