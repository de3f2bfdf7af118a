"""One judge for every solver: Pinocchio on the URDF file, read without jacokin."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from jacokin.arrays import Array


def rotation_angle(a: Array, b: Array) -> Array:
    """Angle between rotations (..., 3, 3) [rad]; exact for small ones, where an arc cosine is not."""
    chord = np.linalg.norm(a - b, axis=(-2, -1))
    return np.asarray(2.0 * np.arcsin(np.minimum(chord / np.sqrt(8.0), 1.0)))


def apart(a: Array, b: Array) -> Array:
    """Largest joint difference on the circle (...,) of configurations (..., dof) [rad]."""
    return np.asarray(np.abs(np.remainder(a - b + np.pi, 2.0 * np.pi) - np.pi).max(axis=-1))


class Referee:
    """Forward kinematics and limits of the arm in a URDF.

    Attributes:
        limits: (dof, 2) lower and upper [rad]; infinite on continuous joints.
    """

    def __init__(self, urdf: Path, joints: Sequence[str], frame: str) -> None:
        """Read the file; every joint not named in `joints` is locked at zero."""
        full = pin.buildModelFromUrdf(str(urdf))
        locked = [i for i, name in enumerate(full.names) if i and name not in set(joints)]
        self._model = pin.buildReducedModel(full, locked, pin.neutral(full))
        self._data = self._model.createData()
        self._frame = self._model.getFrameId(frame)
        self._joints = [self._model.joints[self._model.getJointId(name)] for name in joints]
        elements = {element.get("name"): element for element in ET.parse(urdf).getroot().iter("joint")}
        self.limits = np.array([_limits(elements[name]) for name in joints])

    def forward(self, q: Array) -> Array:
        """Poses (n, 4, 4) of configurations (n, dof)."""
        poses = np.empty((len(q), 4, 4))
        packed = np.empty(self._model.nq)
        for angles, out in zip(q, poses, strict=True):
            for joint, angle in zip(self._joints, angles, strict=True):
                value = (np.cos(angle), np.sin(angle)) if joint.nq == 2 else angle
                packed[joint.idx_q : joint.idx_q + joint.nq] = value
            pin.framesForwardKinematics(self._model, self._data, packed)
            out[:] = self._data.oMf[self._frame].homogeneous
        return poses

    def errors(self, q: Array, target: Array) -> tuple[Array, Array]:
        """Position [m] and orientation [rad] errors (n,) of configurations (n, dof) against one pose (4, 4)."""
        reached = self.forward(q)
        position = np.linalg.norm(reached[:, :3, 3] - target[:3, 3], axis=1)
        return np.asarray(position), rotation_angle(reached[:, :3, :3], target[:3, :3])

    def within_limits(self, q: Array) -> NDArray[np.bool_]:
        """Which configurations (n, dof) are inside every limit, at tolerance 0."""
        return np.asarray(((q >= self.limits[:, 0]) & (q <= self.limits[:, 1])).all(axis=1))


def _limits(joint: ET.Element) -> tuple[float, float]:
    limit = joint.find("limit")
    if joint.get("type") == "continuous" or limit is None:
        return -np.inf, np.inf
    return float(limit.attrib["lower"]), float(limit.attrib["upper"])
