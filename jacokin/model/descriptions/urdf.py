"""URDF robots of users: checked, parsed by yourdfpy for what Pinocchio drops, and read by Pinocchio."""

from __future__ import annotations

import io
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from copy import deepcopy
from pathlib import Path

import pinocchio as pin

from jacokin.errors import ModelError
from jacokin.model.descriptions import urdf_checks
from jacokin.model.descriptions.whole import Coupling, Whole

KINEMATIC_TAGS = ("link", "joint")  # of a <robot>; materials, transmissions and plugins are for other programs
SHAPE_TAGS = ("visual", "collision")


def read(path: Path) -> Whole:
    """The whole robot of a user's URDF file.

    Raises:
        ModelError: the file is malformed; the message names the element at fault.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise ModelError(f"{path}: cannot be read: {error}") from error
    robot = urdf_checks.checked(text, str(path))
    text = ET.tostring(robot, encoding="unicode")
    couplings = [Coupling(frozenset((joint,)), "mimic") for joint in _mimic_joints(text, str(path))]
    return _whole(_parse(kinematic_text(robot), str(path)), couplings, text)


def read_bundled(path: Path) -> Whole:
    """The whole robot of a URDF file that this project generated: not checked again."""
    return _whole(_parse(path.read_text(encoding="utf-8"), str(path)), (), None)


def _whole(model: pin.Model, couplings: Sequence[Coupling], content: str | None) -> Whole:
    return Whole(
        model=model,
        reference=pin.neutral(model),
        kind="urdf",
        base=_root_link(model),
        couplings=couplings,
        content=content,
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
    """Links with their inertials, and joints: the URDF without shapes and without what is for other programs."""
    bare = ET.Element("robot", name=robot.get("name", ""))
    for element in robot:
        if element.tag in KINEMATIC_TAGS:
            copy = deepcopy(element)
            for child in list(copy):
                if child.tag in SHAPE_TAGS:
                    copy.remove(child)
            bare.append(copy)
    return ET.tostring(bare, encoding="unicode")


def _mimic_joints(text: str, source: str) -> list[str]:
    """Names of the joints that follow another one, as yourdfpy reads them; Pinocchio drops the relation."""
    import yourdfpy

    try:
        parsed = yourdfpy.URDF.load(io.BytesIO(text.encode()), load_meshes=False, build_scene_graph=False)
    except Exception as error:  # yourdfpy raises whatever its walk through the XML stumbles over
        raise ModelError(f"{source}: yourdfpy cannot read this URDF: {error!r}") from error
    return [joint.name for joint in parsed.robot.joints if joint.mimic is not None]
