"""Forward kinematics in plain NumPy, independent of Pinocchio and of jacokin's loaders."""

from __future__ import annotations

import math
import tomllib
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from jacokin.arrays import Array


def rotation_about(axis: Array, angle: Array) -> Array:
    """Rotations (n, 3, 3) about a unit axis (3,) by angles (n,) [rad], by Rodrigues' formula."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    sine, versine = np.sin(angle)[:, None, None], 2.0 * np.sin(0.5 * angle)[:, None, None] ** 2
    return np.asarray(np.eye(3) + sine * cross + versine * (cross @ cross))


def placement(xyz: Array, rpy: Array) -> Array:
    """A homogeneous matrix (4, 4) from a position [m] and R = Rz(yaw) Ry(pitch) Rx(roll) [rad]."""
    T = np.eye(4)
    T[:3, 3] = xyz
    for axis, angle in zip(np.eye(3)[::-1], np.asarray(rpy)[::-1], strict=True):
        T[:3, :3] = T[:3, :3] @ rotation_about(axis, np.array([angle]))[0]
    return T


class Chain:
    """Joints in a row, and a tip after the last one.

    Attributes:
        lower: (dof,) limits [rad or m]; infinite on joints without limits.
        upper: (dof,) as `lower`.
    """

    def __init__(self, joints: list[tuple[Array, Array, bool]], lower: Array, upper: Array, tip: Array) -> None:
        """Keep T_parent_joint, axis and whether it slides of each joint, and T_joint_tip of the last one."""
        self._joints = joints
        self.lower = lower
        self.upper = upper
        self._tip = tip

    def forward(self, q: Array) -> Array:
        """T_base_tip (n, 4, 4) at configurations (n, dof)."""
        T = np.tile(np.eye(4), (len(q), 1, 1))
        for (T_parent_joint, axis, slides), value in zip(self._joints, q.T, strict=True):
            moved = np.tile(np.eye(4), (len(q), 1, 1))
            if slides:
                moved[:, :3, 3] = value[:, None] * axis
            else:
                moved[:, :3, :3] = rotation_about(axis, value)
            T = T @ T_parent_joint @ moved
        return np.asarray(T @ self._tip)


def bundled_chain(folder: Path, name: str, frame: str) -> Chain:
    """The chain of a bundled robot to one of its named frames, from the table of its family."""
    tables = [tomllib.loads((folder / file).read_text(encoding="utf-8")) for file in ("jaco.toml", "gen3.toml")]
    table = next(each for each in tables if name in each["variants"])
    rows = _section(table["arms"], table["variants"][name]["arm"])
    joints, lower, upper = [], [], []
    for row in (row for key, row in rows.items() if key.startswith("joint_")):
        joints.append((placement(np.array(row["xyz"]), _angles(row["rpy"])), np.array([0.0, 0.0, 1.0]), False))
        limited = row["type"] == "revolute"
        lower.append(_limit(row, "lower") if limited else -math.inf)
        upper.append(_limit(row, "upper") if limited else math.inf)
    site = rows["sites"][frame] if "sites" in rows else table["sites"][frame]
    tip = placement(np.array(site["xyz"]), _angles(site["rpy"]))
    if site["parent"] == "hand":  # mounted at the wrist site
        wrist, mount = table["sites"]["wristsite"], table["hand_mount"]
        T_link_wrist = placement(np.array(wrist["xyz"]), _angles(wrist["rpy"]))
        tip = T_link_wrist @ placement(np.array(mount["xyz"]), _angles(mount["rpy"])) @ tip
    return Chain(joints, np.array(lower), np.array(upper), tip)


def urdf_chain(text: str, joint_names: tuple[str, ...], tip: str, base: str) -> Chain | None:
    """The chain of a URDF whose moving joints are these; None when it is not a chain from base to tip."""
    root = ET.fromstring(text)
    by_child = {_attribute(joint, "child", "link"): joint for joint in root.findall("joint")}
    row: list[ET.Element] = []
    link = tip
    while link != base:
        if link not in by_child or len(row) > len(by_child):
            return None
        row.insert(0, by_child[link])
        link = _attribute(by_child[link], "parent", "link")
    fixed, joints = np.eye(4), []
    for joint in row:
        origin = joint.find("origin")
        attributes = {} if origin is None else origin.attrib
        xyz, rpy = (np.array([float(word) for word in attributes.get(key, "0 0 0").split()]) for key in ("xyz", "rpy"))
        fixed = fixed @ placement(xyz, rpy)
        if joint.get("name") in joint_names:
            axis = np.array([float(word) for word in _attribute(joint, "axis", "xyz", "1 0 0").split()])
            joints.append((fixed, axis / np.linalg.norm(axis), joint.get("type") == "prismatic"))
            fixed = np.eye(4)
        elif joint.get("type") != "fixed":
            return None  # locked at a position that jacokin chooses
    if len(joints) != len(joint_names):
        return None
    unknown = np.full(len(joints), np.nan)
    return Chain(joints, unknown, unknown, fixed)


def rotation_error(a: Array, b: Array) -> Array:
    """Angles [rad] between rotations (n, 3, 3), accurate for small ones."""
    chord = np.linalg.norm(a - b, axis=(-2, -1)) / math.sqrt(8.0)
    return np.asarray(2.0 * np.arcsin(np.minimum(chord, 1.0)))


def _section(group: Mapping[str, Any], name: str) -> dict[str, Any]:
    own = dict(group[name])
    merged = _section(group, own.pop("like")) if "like" in own else {}
    for key, value in own.items():
        merged[key] = {**merged[key], **value} if isinstance(value, dict) and key in merged else value
    return merged


def _limit(row: Mapping[str, Any], side: str) -> float:
    """[rad]; the table has it in degrees or in radians."""
    return math.radians(row[f"{side}_deg"]) if f"{side}_deg" in row else float(row[side])


def _angles(values: list[float | str]) -> Array:
    """Numbers [rad], or texts such as "-pi/2"."""
    found = []
    for value in values:
        if isinstance(value, str):
            numerator, _, divisor = value.partition("/")
            value = math.copysign(math.pi, -1.0 if numerator.startswith("-") else 1.0) / float(divisor or 1)
        found.append(float(value))
    return np.array(found)


def _attribute(element: ET.Element, child: str, name: str, default: str = "") -> str:
    found = element.find(child)
    return default if found is None else found.get(name, default)
