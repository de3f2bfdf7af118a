"""The axis of a joint of Pinocchio, in the joint's own frame, and frames whose z it is."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from jacokin.arrays import Array


class JointAxis(NamedTuple):
    """What a joint of one coordinate moves about, or along."""

    direction: Array
    """(3,) of length 1."""
    slides: bool
    """Whether it moves along it."""


def axis_of(model: pin.Model, index: int) -> JointAxis:
    """The axis of a joint, by its number."""
    joint = model.joints[index]
    data = joint.createData()
    joint.calc(data, np.zeros(model.nq))
    subspace = np.asarray(data.S).ravel()
    slides = not subspace[3:].any()
    return JointAxis(subspace[:3] if slides else subspace[3:], slides)


def turn_of(model: pin.Model, index: int) -> Array:
    """Rotation (3, 3) from axes with z along a joint's axis to the joint's own."""
    return frame_with_z(axis_of(model, index).direction)


def frame_with_z(z: Array) -> Array:
    """A rotation (3, 3) whose third column is a unit vector: the identity for z itself, quarter turns for x and y."""
    if z[2] == 1.0:
        return np.eye(3)
    x = np.cross(z, np.eye(3)[int(np.argmin(np.abs(z)))])
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])
