"""Kinematics that is more than one call of Pinocchio: axes of joints, reference frames of Jacobians, many at once.

Twists and Jacobian rows: linear first, then angular. Reference frames:

* ``local_world_aligned``: velocity of the frame's origin and angular velocity, both in base axes (as `mj_jacSite`);
* ``local``: the same velocities in the axes of the frame itself;
* ``world``: the spatial twist, whose linear part is the velocity of the point that passes the base origin.

Many configurations go through `jacokin.kernels.configurations`; results are those of Pinocchio to rounding.

Sources: Featherstone, Rigid Body Dynamics Algorithms (2008), ch. 2; Diebel, Representing Attitude (2006).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from jacokin.arrays import Array
from jacokin.errors import RepresentationSingularity, UnknownNameError
from jacokin.kernels.configurations.arm import LANES, PLACE, Arm, Block
from jacokin.kernels.configurations.kinematics import FrameWork, Reference, place_frames
from jacokin.kernels.library import Call
from jacokin.model import checks
from jacokin.model.poses import quaternion

# By name, what Pinocchio and the kernels call it.
REFERENCES = {
    "local_world_aligned": (pin.ReferenceFrame.LOCAL_WORLD_ALIGNED, Reference.ALIGNED),
    "local": (pin.ReferenceFrame.LOCAL, Reference.LOCAL),
    "world": (pin.ReferenceFrame.WORLD, Reference.WORLD),
}

# Closer than this to its singularity [rad] a representation's rate is lost to rounding (gain above 1e6).
SINGULARITY_TOLERANCE = 1e-6


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


def about_z(model: pin.Model, joint: int) -> pin.SE3:
    """T_joint_own of axes whose z is that of a joint; the identity for the base, by number 0."""
    return pin.SE3(frame_with_z(axis_of(model, joint).direction), np.zeros(3)) if joint else pin.SE3.Identity()


def frame_with_z(z: Array) -> Array:
    """A rotation (3, 3) whose third column is a unit vector: the identity for z itself, quarter turns for x and y."""
    a, b, c = z.tolist()
    if c == 1.0:
        return np.eye(3)
    across = [(0.0, c, -b), (-c, 0.0, a), (b, -a, 0.0)][int(np.argmin(np.abs(z)))]
    size = math.hypot(*across)
    x = [value / size for value in across]
    y = [b * x[2] - c * x[1], c * x[0] - a * x[2], a * x[1] - b * x[0]]
    return np.array(list(zip(x, y, (a, b, c), strict=True)))


def reference_frame(name: str) -> pin.ReferenceFrame:
    """Pinocchio's reference frame of a name.

    Raises:
        UnknownNameError: not one of the three.
    """
    try:
        return REFERENCES[name][0]
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
    checks.choice("representation", representation, ("rpy", "rotation_vector", "quaternion"))
    linear, angular = jacobian[:3], jacobian[3:]
    if representation == "rpy":
        return np.vstack((linear, _rpy_rate(rotation) @ angular))
    if representation == "rotation_vector":
        return np.vstack((linear, _rotation_vector_rate(rotation) @ angular))
    w, x, y, z = quaternion(rotation)
    rate = 0.5 * np.array([[-x, -y, -z], [w, z, -y], [-z, w, x], [y, -x, w]])
    return np.vstack((linear, rate @ angular))


def _rpy_rate(rotation: Array) -> Array:
    """Matrix from angular velocity in base axes to the rates of roll, pitch and yaw."""
    rpy = pin.rpy.matrixToRpy(np.ascontiguousarray(rotation))
    if math.hypot(rotation[0, 0], rotation[1, 0]) < SINGULARITY_TOLERANCE:  # the cosine of the pitch
        raise RepresentationSingularity("rpy", "pitch", float(rpy[1]))
    rate: Array = pin.rpy.computeRpyJacobianInverse(rpy, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
    return rate


def _rotation_vector_rate(rotation: Array) -> Array:
    """Matrix from angular velocity in base axes to the rate of the rotation vector (inverse left Jacobian)."""
    vector = pin.log3(rotation)
    angle = float(np.linalg.norm(vector))
    if angle > math.pi - SINGULARITY_TOLERANCE:
        raise RepresentationSingularity("rotation_vector", "rotation angle", angle)
    rate: Array = pin.Jlog3(rotation) @ rotation.T
    return rate


def arm_of(model: pin.Model, frame_id: int | None = None, tool: pin.SE3 | None = None) -> Arm:
    """The joints of a model up to a frame and a tool after it, in axes of their own: z is that of the movement.

    Without a frame, all joints.
    """
    joints, tip = model.nv, pin.SE3.Identity()
    if frame_id is not None:
        frame = model.frames[frame_id]
        joints, tip = int(frame.parentJoint), frame.placement
    T_joint_own, placements, sliding = pin.SE3.Identity(), list[Array](), np.zeros(joints)
    for j in range(joints):
        before = T_joint_own.inverse() * model.jointPlacements[j + 1]
        direction, sliding[j] = axis_of(model, j + 1)
        T_joint_own = pin.SE3(frame_with_z(direction), np.zeros(3))
        placements.append((before * T_joint_own).homogeneous[:3])
    placements.append((T_joint_own.inverse() * (tip if tool is None else tip * tool)).homogeneous[:3])
    return Arm(np.array(placements), sliding, np.array([model.nv], dtype=np.int64))


def turning_arm(chain: Array) -> Arm:
    """The joints of a chain (n + 1, 3, 4) of placements between joints that all turn about z, and of a frame."""
    count = len(chain) - 1
    return Arm(np.ascontiguousarray(chain), np.zeros(count), np.array([count], dtype=np.int64))


def own_axes(model: pin.Model) -> list[pin.SE3]:
    """T_joint_own of the base and of each joint."""
    return [about_z(model, joint) for joint in range(model.njoints)]


def poses(arm: Arm, q: Array) -> Array:
    """Poses (n, 4, 4) of the frame in the base at configurations (n, dof)."""
    return _frames(arm, q, Reference.ALIGNED, np.empty(0))


def frames(arm: Arm, q: Array, reference: str = "local_world_aligned") -> tuple[Array, Array]:
    """Poses (n, 4, 4) of the frame in the base, and its Jacobians (n, 6, dof), at configurations (n, dof)."""
    written = np.zeros((len(q), 6, q.shape[1]))
    return _frames(arm, q, REFERENCES[reference][1], written.reshape(-1)), written


def jacobians(arm: Arm, q: Array, reference: str) -> Array:
    """Jacobians (n, 6, dof) of the frame at configurations (n, dof)."""
    return frames(arm, q, reference)[1]


def _frames(arm: Arm, q: Array, reference: int, written: Array) -> Array:
    T = np.empty((len(q), 4, 4))
    work = FrameWork(
        arm,
        q.reshape(-1),
        block_of(arm),
        T,
        np.empty((6, LANES)),
        np.array([reference], dtype=np.int64),
        written,
    )
    Call(place_frames, work)()
    return T


def block_of(arm: Arm) -> Block:
    """Working memory for the joints of an arm."""
    return Block(np.empty((3, LANES)), np.empty((len(arm.sliding) + 2, PLACE, LANES)))
