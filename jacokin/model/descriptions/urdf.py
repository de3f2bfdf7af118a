"""URDF files: checked, and read by Pinocchio, but for `<mimic>`, which Pinocchio drops; SRDF files beside them."""

from __future__ import annotations

import math
import re
import xml.etree.ElementTree as ET
import xml.parsers.expat
from collections import Counter
from collections.abc import Mapping, Sequence
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from jacokin import files
from jacokin.errors import InvalidInputError, ModelError
from jacokin.model.descriptions.chain import MOST_JOINTS, Coupling, Description

JOINT_TYPES = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")

# Attributes that hold numbers, by the element's tag: how many. Elements and attributes that are not named are ignored.
ONE, THREE = (1,), (3,)
NUMBERS: Mapping[str, Mapping[str, Sequence[int]]] = {
    "origin": {"xyz": THREE, "rpy": THREE},
    "axis": {"xyz": THREE},
    "limit": {"lower": ONE, "upper": ONE, "effort": ONE, "velocity": ONE},
    "dynamics": {"damping": ONE, "friction": ONE},
    "mimic": {"multiplier": ONE, "offset": ONE},
    "safety_controller": {"soft_lower_limit": ONE, "soft_upper_limit": ONE, "k_position": ONE, "k_velocity": ONE},
    "calibration": {"rising": ONE, "falling": ONE, "reference_position": ONE},
    "mass": {"value": ONE},
    "inertia": {"ixx": ONE, "ixy": ONE, "ixz": ONE, "iyy": ONE, "iyz": ONE, "izz": ONE},
    "box": {"size": THREE},
    "cylinder": {"radius": ONE, "length": ONE},
    "sphere": {"radius": ONE},
    "capsule": {"radius": ONE, "length": ONE},
    "mesh": {"scale": (3, 1)},  # one number for all three axes, as some exporters write it
    "color": {"rgba": (4, 3)},
}
# Attributes that an element cannot do without.
REQUIRED: Mapping[str, Sequence[str]] = {
    "mimic": ("joint",),
    "safety_controller": ("k_velocity",),
    "mass": ("value",),
    "inertia": ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"),
    "box": ("size",),
    "cylinder": ("radius", "length"),
    "sphere": ("radius",),
    "capsule": ("radius", "length"),
    "mesh": ("filename",),
}

_NUMBERS = re.compile(rf"{files.NUMBER_TEXT.pattern}(\s+{files.NUMBER_TEXT.pattern})*", re.ASCII)
KINEMATIC_TAGS = ("link", "joint")  # of a <robot>; materials, transmissions and plugins are for other programs
TEMPLATE = ("${", "$(")  # how xacro's expressions begin
MALFORMED = "malformed"  # attribute of a collision shape: what is wrong with it, said where contact is asked for


def read(path: Path) -> Description:
    """The robot of a user's URDF file.

    Raises:
        ModelError: the file is malformed; the message names the element at fault.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise ModelError(f"{path}: cannot be read: {error}") from error
    notes: list[str] = []
    robot = check(text, str(path), notes)
    model = _parse(kinematic_text(robot), str(path))
    return _description(model, _couplings(robot), ET.tostring(robot, encoding="unicode"), notes)


def read_bundled(path: Path) -> Description:
    """The robot of a URDF file that this project generated: not checked again."""
    return _description(_parse(path.read_text(encoding="utf-8"), str(path)), (), None)


def _description(
    model: pin.Model, couplings: Sequence[Coupling], content: str | None, notes: Sequence[str] = ()
) -> Description:
    return Description(
        model=model,
        reference=pin.neutral(model),
        kind="urdf",
        base=_root_link(model),
        couplings=couplings,
        content=content,
        notes=tuple(notes),
    )


def _root_link(model: pin.Model) -> str:
    """Name of the first link that does not move."""
    for index, frame in enumerate(model.frames):
        if index and frame.type == pin.FrameType.BODY and frame.parentJoint == 0:
            return str(frame.name)
    return str(model.frames[0].name)


def _parse(text: str, source: str) -> pin.Model:
    """Hand URDF text to Pinocchio.

    Raises:
        ModelError: Pinocchio refuses it.
    """
    try:
        return pin.buildModelFromXML(text)
    except (ValueError, RuntimeError) as error:
        raise ModelError(f"{source}: Pinocchio cannot read this URDF: {error}") from error


def kinematic_text(robot: ET.Element) -> str:
    """Links with their inertials, and joints: the URDF without shapes and without what is for other programs.

    A limit of effort or velocity that is not given is 0, as parsers want the attribute; 0 stands for not given.
    """
    bare = ET.Element("robot", name=robot.get("name", ""))
    for element in robot:
        if element.tag in KINEMATIC_TAGS:
            part = ET.SubElement(bare, element.tag, element.attrib)
            for child in element:
                if child.tag == "limit":
                    ET.SubElement(part, "limit", {"effort": "0", "velocity": "0"} | child.attrib)
                elif child.tag not in ("visual", "collision"):
                    part.append(child)
    return ET.tostring(bare, encoding="unicode")


def _couplings(robot: ET.Element) -> list[Coupling]:
    """The joints that follow another one."""
    found = []
    for joint in robot.findall("joint"):
        mimic = joint.find("mimic")
        if mimic is not None:
            name, leader = joint.get("name", ""), mimic.get("joint", "")
            multiplier, offset = float(mimic.get("multiplier", "1")), float(mimic.get("offset", "0"))
            found.append(Coupling(frozenset((name,)), "mimic", leader, multiplier, offset))
    return found


def check(text: str, source: str, notes: list[str] | None = None) -> ET.Element:
    """The robot element of URDF text that describes one tree of links with finite numbers.

    Numbers are rewritten with plain blanks between them: tabs and line ends are XML, and not every parser takes them.
    What only says how the robot looks is left out where it is malformed; a malformed collision shape stays, and is
    refused where contact is asked for. A robot without a name has that of its file.

    Args:
        text: of the file.
        source: its name, for messages.
        notes: where sentences on what was left out are added.

    Raises:
        ModelError: names the element at fault.
    """
    robot = parse_xml(text, source)
    if robot.tag != "robot":
        raise ModelError(f"{source}: the root element is <{robot.tag}>, a URDF has <robot>")
    if not robot.get("name"):
        robot.set("name", Path(source).stem)
    _check_depth(robot, source)
    said: list[str] = [] if notes is None else notes
    _check_expanded(robot, source, said)
    _drop_foreign(robot)
    links, joints = robot.findall("link"), robot.findall("joint")
    _unique([_required(link, "name", source) for link in links], "link", source)
    _unique([_required(joint, "name", source) for joint in joints], "joint", source)
    if not links:
        cure = "a xacro file that only defines a macro expands to that; expand the one that uses it"
        raise ModelError(f"{source}: has no links: {cure}")
    _check_size(links, joints, source)
    _drop_malformed(robot, "material", source, said)
    for link in links:
        _drop_malformed(link, "visual", f"{source}: link {link.get('name')!r}", said)
    link_names, joint_names = ({element.get("name", "") for element in group} for group in (links, joints))
    for link in links:
        where = f"{source}: link {link.get('name')!r}"
        for collision in link.findall("collision"):
            _mark_malformed(collision, where)
        _check_numbers(link, where)
        _complete_inertial(link, where, said)
    for joint in joints:
        where = f"{source}: joint {joint.get('name')!r}"
        _check_numbers(joint, where)
        _check_joint(joint, link_names, joint_names, where)
    _check_tree(joints, [link.get("name", "") for link in links], source)
    return robot


def parse_xml(text: str, source: str) -> ET.Element:
    """The root element, with prefixes in the names as they are written.

    ROS's parser knows no namespaces, and many files use prefixes that they do not declare.

    Raises:
        ModelError: not XML.
    """
    builder = ET.TreeBuilder()
    parser = xml.parsers.expat.ParserCreate()
    parser.StartElementHandler = builder.start
    parser.EndElementHandler = builder.end
    try:
        parser.Parse(text.lstrip(), True)
        return builder.close()
    except (xml.parsers.expat.ExpatError, ValueError, AssertionError) as error:
        raise ModelError(f"{source}: not well-formed XML (truncated?): {error}") from error


def _drop_foreign(robot: ET.Element) -> None:
    """Remove elements and attributes with a prefix, and namespaces: they are for other programs."""
    for element in robot.iter():
        for name in [name for name in element.attrib if name == "xmlns" or ":" in name]:
            del element.attrib[name]
        for child in list(element):
            if ":" in child.tag:
                element.remove(child)


def _check_expanded(robot: ET.Element, source: str, notes: list[str]) -> None:
    """Refuse what xacro has yet to expand; its definitions that nothing uses are left over and mean nothing."""
    foreign = [element.tag for element in robot.iter() if element.tag.startswith("xacro:")]
    used = [tag for tag in foreign if tag not in ("xacro:property", "xacro:arg", "xacro:macro")]
    searched = (
        robot.iter() if foreign else (each for tag in KINEMATIC_TAGS for own in robot.iter(tag) for each in own.iter())
    )
    if used or any(sign in value for element in searched for value in element.attrib.values() for sign in TEMPLATE):
        raise ModelError(f"{source}: is a xacro file, not a URDF: expand it: xacro {Path(source).name} > out.urdf")
    if foreign:
        notes.append("definitions of xacro that nothing uses are skipped")


def _drop_malformed(owner: ET.Element, tag: str, where: str, notes: list[str]) -> None:
    """Remove children that only say how the robot looks and that are malformed: kinematics does not need them."""
    for element in owner.findall(tag):
        try:
            _check_numbers(element, f"{where}: {tag} {element.get('name', '')!r}")
        except ModelError as error:
            owner.remove(element)
            notes.append(f"what cannot be drawn is left out: {error}")


def _required(element: ET.Element, attribute: str, where: str) -> str:
    value = element.get(attribute)
    if not value:
        raise ModelError(f"{where}: a <{element.tag}> has no {attribute}")
    return value


def _unique(names: list[str], kind: str, source: str) -> None:
    twice = [name for name, count in Counter(names).items() if count > 1]
    if twice:
        raise ModelError(f"{source}: {kind} {twice[0]!r} is defined more than once")


def _check_depth(robot: ET.Element, source: str) -> None:
    level = [robot]
    for _ in range(100):  # writing them down again is recursive
        level = [child for element in level for child in element]
        if not level:
            return
    raise ModelError(f"{source}: elements are nested more than 100 deep")


def _check_size(links: list[ET.Element], joints: list[ET.Element], source: str) -> None:
    moving = sum(joint.get("type") != "fixed" for joint in joints)
    # Rigid links, too: the parser of Pinocchio walks the tree by recursion and ends the process.
    for count, most, what in ((moving, MOST_JOINTS, "joints that move"), (len(links), 1000, "links")):
        if count > most:
            raise ModelError(f"{source}: has {count} {what}; at most {most} are read")


def _mark_malformed(collision: ET.Element, where: str) -> None:
    """Write into a collision shape what is wrong with it, if something is."""
    collision.attrib.pop(MALFORMED, None)
    try:
        _check_numbers(collision, where)
    except ModelError as error:
        collision.set(MALFORMED, str(error))


def _check_numbers(owner: ET.Element, where: str) -> None:
    """Every number of a link, joint or material is a finite number, and what must be there is there.

    What is marked as malformed is not looked at again.
    """
    malformed = {id(part) for each in owner.findall("collision") if each.get(MALFORMED) for part in each.iter()}
    for element in owner.iter():
        if id(element) in malformed:
            continue
        for attribute in REQUIRED.get(element.tag, ()):
            _required(element, attribute, where)
        for attribute, counts in NUMBERS.get(element.tag, {}).items():
            text = element.get(attribute)
            if text is None:
                continue
            values = _numbers(text, counts, f'{where}: <{element.tag}> {attribute}="{text}"')
            never_negative = (element.tag, attribute) in (("limit", "effort"), ("limit", "velocity"), ("mass", "value"))
            if never_negative and values[0] < 0.0:
                raise ModelError(f"{where}: {element.tag} {attribute} {values[0]} is negative")
            # Some parsers refuse denormal numbers.
            element.set(attribute, " ".join(repr(value if abs(value) > 1e-300 else 0.0) for value in values))


def _numbers(text: str, counts: Sequence[int], what: str) -> list[float]:
    parts = text.split()
    if len(parts) in counts and _NUMBERS.fullmatch(text.strip()):  # of nearly all
        values = [float(part) for part in parts]
        if all(map(math.isfinite, values)):
            return values
    if any(files.NOT_FINITE_TEXT.fullmatch(part) for part in parts):
        raise ModelError(f"{what} is not finite")
    if not all(files.NUMBER_TEXT.fullmatch(part) for part in parts):
        raise ModelError(f"{what} is not made of numbers")
    if len(parts) not in counts:
        raise ModelError(f"{what} must have {counts[0]} {'number' if counts[0] == 1 else 'numbers'}")
    raise ModelError(f"{what} is not finite")  # written with an exponent that no double holds


def origin_of(element: ET.Element) -> pin.SE3:
    """Where a checked URDF places an element; the identity where it does not say."""
    origin = element.find("origin")
    texts = ["0 0 0" if origin is None else origin.get(key, "0 0 0") for key in ("xyz", "rpy")]
    xyz, rpy = (np.array(text.split(), dtype=np.float64) for text in texts)
    return pin.SE3(pin.rpy.rpyToMatrix(rpy), xyz)


def _check_single(owner: ET.Element, tags: Sequence[str], where: str) -> None:
    """Elements that parsers expect once: of two, one would take the first and another the last."""
    counts = Counter(element.tag for element in owner)
    for tag in tags:
        if counts[tag] > 1:
            raise ModelError(f"{where}: its <{owner.tag}> has more than one <{tag}>: keep one")


def _complete_inertial(link: ET.Element, where: str, notes: list[str]) -> None:
    """Refuse ambiguous masses; a body without inertia is a point, and one without mass has none."""
    _check_single(link, ("inertial",), where)
    inertial = link.find("inertial")
    if inertial is None:
        return
    _check_single(inertial, ("origin", "mass", "inertia"), where)
    if inertial.find("mass") is None:
        link.remove(inertial)
        notes.append(f"the <inertial> of link {link.get('name')!r} has no <mass> and is left out")
    elif inertial.find("inertia") is None:
        ET.SubElement(inertial, "inertia", dict.fromkeys(REQUIRED["inertia"], "0"))
        notes.append(f"the <inertial> of link {link.get('name')!r} has no <inertia>: its mass is in one point")


def _check_joint(joint: ET.Element, links: set[str], joints: set[str], where: str) -> None:
    once = ("origin", "parent", "child", "axis", "limit", "dynamics", "mimic", "safety_controller", "calibration")
    _check_single(joint, once, where)
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
        xyz = axis.get("xyz")
        if xyz is None:  # the specification's default is 1 0 0, that of Pinocchio's parser 0 0 0
            raise ModelError(f"{where}: the axis has no xyz")
        norm = math.hypot(*map(float, xyz.split()))
        if abs(norm - 1.0) > 1e-3:  # a hand-typed axis has three digits or more
            raise ModelError(f"{where}: the axis must be a unit vector, its norm is {norm:.6g}")
    _check_limit(joint, kind, where)
    dynamics = joint.find("dynamics")
    if dynamics is not None and not {"damping", "friction"} & set(dynamics.keys()):
        raise ModelError(f"{where}: a <dynamics> has neither damping nor friction")
    mimic = joint.find("mimic")
    if mimic is not None and mimic.get("joint") not in joints:
        raise ModelError(f"{where}: follows joint {mimic.get('joint')!r}, which does not exist")


def _check_limit(joint: ET.Element, kind: str, where: str) -> None:
    if kind not in ("revolute", "prismatic"):
        return
    limit = joint.find("limit")
    if limit is None:
        raise ModelError(f"{where}: a {kind} joint needs <limit>; an unlimited one has type continuous")
    for attribute in ("lower", "upper"):
        if not limit.get(attribute):
            raise ModelError(
                f"{where}: a <limit> has no {attribute}: write it [rad, or m], or type continuous for a joint "
                "without limits"
            )
    lower, upper = float(limit.get("lower", "")), float(limit.get("upper", ""))
    if lower > upper:
        raise ModelError(f"{where}: lower limit {lower} is above upper limit {upper}")


def _check_tree(joints: list[ET.Element], links: list[str], source: str) -> None:
    """Each link has one parent at most, exactly one has none, and all hang on it."""
    parent_of: dict[str, str] = {}
    for joint in joints:
        parent, child = (joint.find(role).get("link", "") for role in ("parent", "child"))  # type: ignore[union-attr]  # checked by _check_joint
        if child in parent_of:
            raise ModelError(f"{source}: link {child!r} has two parents, {parent_of[child]!r} and {parent!r}")
        parent_of[child] = parent
    try:
        TopologicalSorter({child: (parent,) for child, parent in parent_of.items()}).prepare()
    except CycleError as error:
        raise ModelError(f"{source}: the links form a cycle: {' -> '.join(error.args[1])}") from None
    roots = [link for link in links if link not in parent_of]
    if len(roots) != 1:
        raise ModelError(f"{source}: a robot has one root link, this file has {len(roots)}: {', '.join(roots)}")


class DisabledPairs(NamedTuple):
    """Links of a robot whose contact with each other does not count, by an SRDF, as MoveIt's assistant writes it."""

    path: Path
    """The file that says so."""
    pairs: tuple[tuple[str, str], ...]
    """Names of links, each pair once."""


def find_srdf(urdf: Path) -> Path | None:
    """The SRDF of a URDF's name in the folder of that file, or in a folder called srdf beside it; None for none."""
    name = urdf.with_suffix(".srdf").name
    places = urdf.parent / name, urdf.parent.parent / "srdf" / name
    return next((place for place in places if place.is_file()), None)


def read_srdf(path: Path) -> DisabledPairs:
    """The pairs of links that a file disables.

    Raises:
        ModelError: the file cannot be read, or is no SRDF.
    """
    try:
        text = files.read_bytes(path, files.DESCRIPTION).decode("utf-8-sig")
    except InvalidInputError as error:  # names the file
        raise ModelError(str(error)) from error
    except UnicodeDecodeError as error:
        raise ModelError(f"{path}: is not an SRDF that can be read: {error}") from error
    root = parse_xml(text, str(path))
    if any(sign in text for sign in (*TEMPLATE, "xacro:")):
        raise ModelError(f"{path}: is a xacro file, not an SRDF: expand it: xacro {path.name} > out.srdf")
    if root.tag != "robot":
        raise ModelError(f"{path}: the root element is <{root.tag}>, an SRDF has <robot>")
    if root.find("link") is not None:
        raise ModelError(f"{path}: is a URDF, not an SRDF")
    found: dict[frozenset[str], tuple[str, str]] = {}
    for element in root.iter("disable_collisions"):
        first, second = element.get("link1", ""), element.get("link2", "")
        if not first or not second:
            raise ModelError(f"{path}: a <disable_collisions> has no {'link2' if first else 'link1'}")
        found.setdefault(frozenset((first, second)), (first, second))
    return DisabledPairs(path, tuple(pair for key, pair in found.items() if len(key) == 2))
