"""`write_urdf` and `write_mjcf`: the description of a calibrated arm, for programs that read files.

Only the joints of the arm move; links, masses, shapes and fingers stay as the description has them.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from copy import deepcopy
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin

from jacokin import files
from jacokin.arrays import Array
from jacokin.errors import ModelError
from jacokin.model import checks, poses
from jacokin.model.descriptions import bundled, mjcf
from jacokin.model.descriptions.urdf import MALFORMED, origin_of
from jacokin.model.measured_arm import moved
from jacokin.model.robot import Robot, checked_robot


def write_urdf(robot: Robot, path: str | Path) -> None:
    """Write the URDF of an arm, its joints where its calibration has them.

    Args:
        robot: a bundled one, or one from a URDF.
        path: the file; file names of meshes in it are made absolute.

    Raises:
        InvalidInputError: not a Robot, or the file cannot be written.
        ModelError: the robot is described by an MJCF.
    """
    source = checked_robot("robot", robot).source
    if source.kind != "urdf":
        raise ModelError(f"{source.path}: is an MJCF: write_mjcf writes it")
    text = source.content if isinstance(source.content, str) else source.path.read_text(encoding="utf-8")
    tree = ET.fromstring(text, ET.XMLParser(target=ET.TreeBuilder(insert_comments=True)))
    for joint, motion in _motions(robot).items():
        element = next(each for each in tree.findall("joint") if each.get("name") == joint)
        place, origin = origin_of(element) * motion, element.find("origin")
        if origin is None:
            origin = ET.SubElement(element, "origin")
        origin.set("xyz", _text(place.translation))
        origin.set("rpy", _text(pin.rpy.matrixToRpy(place.rotation)))
    for collision in tree.iter("collision"):
        collision.attrib.pop(MALFORMED, None)
    for mesh in tree.iter("mesh"):
        name = mesh.get("filename", "")
        if name and "://" not in name:
            mesh.set("filename", str(source.path.parent / name))
    _write(path, ET.tostring(tree, encoding="unicode", xml_declaration=True) + "\n")


def write_mjcf(robot: Robot, path: str | Path) -> None:
    """Write the MJCF of an arm, its joints where its calibration has them; MuJoCo's own text of it.

    Args:
        robot: a bundled one, or one from an MJCF, which is read again.
        path: the file; meshes are looked for where the description has them.

    Raises:
        InvalidInputError: not a Robot, or the file cannot be written.
        ModelError: the robot is described by a URDF of the user's, or MuJoCo cannot load the description any more.
    """
    source = checked_robot("robot", robot).source
    if source.bundled is None and source.kind != "mjcf":
        raise ModelError(f"{source.path}: is a URDF: write_urdf writes it")
    described = source.path if source.bundled is None else bundled.urdf_folder() / f"{source.bundled}.xml"
    try:
        spec = mujoco.MjSpec.from_file(str(described))
        move_joints(spec, robot)
        for name in ("meshdir", "texturedir"):
            setattr(spec, name, str(described.parent / getattr(spec, name)))
        spec.compiler.savecompiled = False  # six digits, otherwise
        text = spec.to_xml()
    except mjcf.MUJOCO_ERRORS as error:
        raise ModelError(f"{described}: MuJoCo cannot load this file: {error}") from error
    _write(path, text)


def move_joints(spec: mujoco.MjSpec, robot: Robot, *, prefix: str = "") -> None:
    """Move the bodies of a description to where a robot's calibration has them.

    Args:
        spec: the description, not attached to anything.
        robot: the calibrated arm.
        prefix: before the names of its joints in the description.

    Raises:
        ModelError: a joint shares its body with another, or its body is turned within a `<frame>`.
    """
    motions = _motions(robot)
    if not motions:
        return
    compiled = spec.copy().compile()
    for body, (joint, T_parent_body) in _bodies(compiled, robot, prefix).items():
        element = spec.joint(prefix + joint).parent
        if element.frame is not None:
            if element.alt.type != mujoco.mjtOrientation.mjORIENTATION_QUAT:
                raise ModelError(
                    f"body {mjcf.body_name(compiled, body)!r} stands in a <frame>: give its orientation as a quaternion"
                )
            described = mjcf.placement(element.quat, element.pos)
            moved_body = mjcf.placement(compiled.body_quat[body], compiled.body_pos[body])
            T_parent_body = described * moved_body.inverse() * T_parent_body
        element.alt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT
        element.pos, element.quat = T_parent_body.translation, poses.quaternion(T_parent_body.rotation)


def move_bodies(model: mujoco.MjModel, robot: Robot) -> mujoco.MjModel:
    """A compiled description with its bodies where a robot's calibration has them; itself without one."""
    if not _motions(robot):
        return model
    copy = deepcopy(model)
    for body, (_, T_parent_body) in _bodies(copy, robot, "").items():
        copy.body_pos[body] = T_parent_body.translation
        copy.body_quat[body] = poses.quaternion(T_parent_body.rotation)
    mujoco.mj_setConst(copy, mujoco.MjData(copy))
    return copy


def _motions(robot: Robot) -> dict[str, pin.SE3]:
    """Of the joints that are not where they are described: pose in the described frame, in the joint's own axes."""
    joints = () if robot.calibration is None else robot.calibration.joints
    return {
        name: moved(robot.pin_model, index, joint)
        for index, (name, joint) in enumerate(joints, start=1)
        if joint.placement != pin.SE3.Identity()
    }


def _bodies(model: mujoco.MjModel, robot: Robot, prefix: str) -> dict[int, tuple[str, pin.SE3]]:
    """Of each body that moves: its joint, and its new pose in its parent."""
    found: dict[int, tuple[str, pin.SE3]] = {}
    motions = _motions(robot)
    for joint, index in zip(motions, mjcf.joint_ids(model, [prefix + name for name in motions]), strict=True):
        body = int(model.jnt_bodyid[index])
        if model.body_jntnum[body] != 1:
            raise ModelError(f"body {mjcf.body_name(model, body)!r} has several joints: give each a body of its own")
        # Pinocchio's joint frame stands at the hinge's anchor, turned so that both zeros agree.
        _, T_zero = mjcf.pinocchio_joint(model, index)
        T_body_joint = pin.SE3(np.eye(3), np.array(model.jnt_pos[index])) * T_zero
        T_parent_body = mjcf.placement(model.body_quat[body], model.body_pos[body])
        found[body] = (joint, T_parent_body * T_body_joint * motions[joint] * T_body_joint.inverse())
    return found


def _text(numbers: Array) -> str:
    return " ".join(map(repr, numbers.tolist()))


def _write(path: str | Path, text: str) -> None:
    with files.replacing(checks.path("path", path)) as temporary:
        temporary.write_text(text, encoding="utf-8")
