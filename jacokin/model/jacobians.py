"""Reference frames of Jacobians, and the analytical Jacobian: rates of roll-pitch-yaw, rotation vector, quaternion.

Twists and Jacobian rows: linear first, then angular. Reference frames:

* ``local_world_aligned``: velocity of the frame's origin and angular velocity, both in base axes (as `mj_jacSite`);
* ``local``: the same velocities in the axes of the frame itself;
* ``world``: the spatial twist, whose linear part is the velocity of the point that passes the base origin.

Sources: Featherstone, Rigid Body Dynamics Algorithms (2008), ch. 2; Diebel, Representing Attitude (2006).
"""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin

from jacokin.arrays import Array
from jacokin.errors import RepresentationSingularity, UnknownNameError
from jacokin.model import checks, poses

REFERENCES = {
    "local_world_aligned": pin.ReferenceFrame.LOCAL_WORLD_ALIGNED,
    "local": pin.ReferenceFrame.LOCAL,
    "world": pin.ReferenceFrame.WORLD,
}

REPRESENTATIONS = ("rpy", "rotation_vector", "quaternion")

# Closer than this to its singularity [rad] a representation's rate is lost to rounding (gain above 1e6).
SINGULARITY_TOLERANCE = 1e-6


def reference_frame(name: str) -> pin.ReferenceFrame:
    """Pinocchio's reference frame of a name.

    Raises:
        UnknownNameError: not one of the three.
    """
    try:
        return REFERENCES[name]
    except (KeyError, TypeError):
        raise UnknownNameError("reference", name, tuple(REFERENCES)) from None


def analytical(rotation: Array, jacobian: Array, representation: str) -> Array:
    """Jacobian with its angular rows turned into rates of an orientation representation.

    Args:
        rotation: (3, 3) orientation of the frame in the base.
        jacobian: (6, n) Jacobian, local_world_aligned.
        representation: "rpy", "rotation_vector" or "quaternion" (w, x, y, z with w >= 0).

    Returns:
        (6, n), or (7, n) for the quaternion.

    Raises:
        UnknownNameError: unknown representation.
        RepresentationSingularity: rpy at pitch +-pi/2, rotation vector at a half turn.
    """
    checks.choice("representation", representation, REPRESENTATIONS)
    linear, angular = jacobian[:3], jacobian[3:]
    if representation == "rpy":
        return np.vstack((linear, _rpy_rate(rotation) @ angular))
    if representation == "rotation_vector":
        return np.vstack((linear, _rotation_vector_rate(rotation) @ angular))
    w, x, y, z = poses.quaternion(rotation)
    rate = 0.5 * np.array([[-x, -y, -z], [w, z, -y], [-z, w, x], [y, -x, w]])
    return np.vstack((linear, rate @ angular))


def _rpy_rate(rotation: Array) -> Array:
    """Matrix from angular velocity in base axes to the rates of roll, pitch and yaw."""
    cos_pitch = math.hypot(rotation[0, 0], rotation[1, 0])
    pitch = math.atan2(-rotation[2, 0], cos_pitch)
    if cos_pitch < SINGULARITY_TOLERANCE:
        raise RepresentationSingularity("rpy", "pitch", pitch)
    cos_yaw, sin_yaw = rotation[0, 0] / cos_pitch, rotation[1, 0] / cos_pitch
    tan_pitch = -rotation[2, 0] / cos_pitch
    return np.array(
        [
            [cos_yaw / cos_pitch, sin_yaw / cos_pitch, 0.0],
            [-sin_yaw, cos_yaw, 0.0],
            [cos_yaw * tan_pitch, sin_yaw * tan_pitch, 1.0],
        ]
    )


def _rotation_vector_rate(rotation: Array) -> Array:
    """Matrix from angular velocity in base axes to the rate of the rotation vector (inverse left Jacobian)."""
    vector = pin.log3(rotation)
    angle = float(np.linalg.norm(vector))
    if angle > math.pi - SINGULARITY_TOLERANCE:
        raise RepresentationSingularity("rotation_vector", "rotation angle", angle)
    rate: Array = pin.Jlog3(rotation) @ rotation.T
    return rate
