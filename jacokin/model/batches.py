"""Poses, Jacobians, torques and mass matrices of many configurations at once, by `jacokin.kernels.configurations`.

For `Robot`, which checks the arguments. Results are those of Pinocchio to rounding.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from jacokin.arrays import Array
from jacokin.kernels.configurations import dynamics, kinematics
from jacokin.kernels.configurations.arm import LANES, PLACE, Arm, Block
from jacokin.kernels.configurations.dynamics import Bodies
from jacokin.kernels.library import Call
from jacokin.model.joint_axes import axis_of, turn_of

REFERENCES = {
    "local_world_aligned": kinematics.ALIGNED,
    "local": kinematics.LOCAL,
    "world": kinematics.WORLD,
}


def arm_of(model: pin.Model, frame_id: int | None = None, tool: pin.SE3 | None = None) -> Arm:
    """The joints of a model up to a frame and a tool after it, in axes of their own: z is that of the movement.

    Without a frame, all joints.
    """
    joints, tip = model.nv, pin.SE3.Identity()
    if frame_id is not None:
        frame = model.frames[frame_id]
        joints, tip = int(frame.parentJoint), frame.placement
    T_joint_own = _own_axes(model)
    placements = [T_joint_own[j].inverse() * model.jointPlacements[j + 1] * T_joint_own[j + 1] for j in range(joints)]
    placements.append(T_joint_own[joints].inverse() * (tip if tool is None else tip * tool))
    sliding = [axis_of(model, j + 1).slides for j in range(joints)]
    return Arm(
        np.array([T.homogeneous[:3] for T in placements]),
        np.array(sliding, dtype=np.float64),
        np.array([model.nv], dtype=np.int64),
    )


def turning_arm(chain: Array) -> Arm:
    """The joints of a chain (n + 1, 3, 4) of placements between joints that all turn about z, and of a frame."""
    count = len(chain) - 1
    return Arm(np.ascontiguousarray(chain), np.zeros(count), np.array([count], dtype=np.int64))


def bodies_of(model: pin.Model) -> Bodies:
    """What the joints of a model move, in the axes of `arm_of`."""
    own = _own_axes(model)
    rows = [own[j].inverse().act(model.inertias[j]).toDynamicParameters() for j in range(1, model.njoints)]
    return Bodies(np.array(rows).reshape(model.nv, 10), np.array(model.armature, dtype=np.float64))


def _own_axes(model: pin.Model) -> list[pin.SE3]:
    """T_joint_own of the base and of each joint."""
    turns = [np.eye(3), *(turn_of(model, index) for index in range(1, model.njoints))]
    return [pin.SE3(turn, np.zeros(3)) for turn in turns]


def poses(arm: Arm, q: Array) -> Array:
    """Poses (n, 4, 4) of the frame in the base at configurations (n, dof)."""
    return _frames(arm, q, kinematics.ALIGNED, np.empty(0))


def frames(arm: Arm, q: Array, reference: str = "local_world_aligned") -> tuple[Array, Array]:
    """Poses (n, 4, 4) of the frame in the base, and its Jacobians (n, 6, dof), at configurations (n, dof)."""
    written = np.zeros((len(q), 6, q.shape[1]))
    return _frames(arm, q, REFERENCES[reference], written.reshape(-1)), written


def jacobians(arm: Arm, q: Array, reference: str) -> Array:
    """Jacobians (n, 6, dof) of the frame at configurations (n, dof)."""
    return frames(arm, q, reference)[1]


def _frames(arm: Arm, q: Array, reference: int, written: Array) -> Array:
    T = np.empty((len(q), 4, 4))
    work = kinematics.FrameWork(
        arm,
        q.reshape(-1),
        _block(arm),
        np.empty((PLACE, LANES)),
        T,
        np.empty((6, LANES)),
        np.array([reference], dtype=np.int64),
        written,
    )
    Call(kinematics.place_frames, work)()
    return T


def torques(arm: Arm, bodies: Bodies, q: Array, v: Array, a: Array, gravity: Array) -> Array:
    """Joint torques (n, dof) of motions (n, dof), under a gravity (3,) in the base [m/s^2]."""
    written = np.empty(q.shape)
    work = dynamics.TorqueWork(
        arm,
        bodies,
        q.reshape(-1),
        v.reshape(-1),
        a.reshape(-1),
        np.array(gravity, dtype=np.float64),
        _block(arm),
        np.empty((2, LANES)),
        np.empty((9, LANES)),
        np.empty((len(arm.sliding), 6, LANES)),
        written.reshape(-1),
    )
    Call(dynamics.find_torques, work)()
    return written


def mass_matrices(arm: Arm, bodies: Bodies, q: Array) -> Array:
    """Mass matrices (n, dof, dof) at configurations (n, dof)."""
    written = np.empty((*q.shape, q.shape[1]))
    work = dynamics.MassWork(
        arm,
        bodies,
        q.reshape(-1),
        _block(arm),
        np.empty((10, LANES)),
        np.empty((6, LANES)),
        np.empty(LANES),
        written.reshape(-1),
    )
    Call(dynamics.find_mass_matrices, work)()
    return written


def _block(arm: Arm) -> Block:
    return Block(np.empty((3, LANES)), np.empty((len(arm.sliding) + 1, PLACE, LANES)))
