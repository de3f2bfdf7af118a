"""The constants of an arm and of one target, in the frames that make the closed form short.

Shoulder frame: origin O, z = axis 1, y = axis 3 at q1 = 0. Wrist frame: z = axis 5, axis 4 in the x, z plane at
q5 = 0. All vectors of a pose are wrist-frame vectors, seen after joint 6.
"""

from __future__ import annotations

from typing import NamedTuple

from jacokin.arrays import Array
from jacokin.kernels.six_joints.loop import SixArm
from jacokin.kernels.vector import Vec, cross, dot, mix, norm

#: Numbers that `unpack_arm` reads.
ARM_CONSTANTS = 46


class ArmConstants(NamedTuple):
    """Constants of the mechanism [m], [rad]; the letters of docs/closed_form.md."""

    w6: Vec  # axis 6 in the wrist frame at q = 0
    cos_a: float  # a: the angle between axes 4 and 5
    sin_a: float
    b5: float  # B - A along axis 5
    c4: float  # C - B along axis 4
    e3: float  # lateral offset of the shoulder
    R2: float  # |C - O| squared
    side: float  # +1 if axes 2 and 3 point the same way, -1 if opposite
    psi_c: float  # angle of C - O about axis 3 at q = 0
    psi_4: float  # angle of axis 4 about axis 3 at q = 0
    chi_3: float  # angle of axis 3 about axis 4 at q = 0
    misfit: float  # largest deviation of the model from this structure
    six: SixArm  # with a scale above 0, the arm has another structure, and all the above is 0


class Pose(NamedTuple):
    """One target: D(q6) = D0 + cos q6 Dc + sin q6 Ds, m(q6) likewise, and the shoulder frame's axes x, y, z."""

    D0: Vec
    Dc: Vec
    Ds: Vec
    m0: Vec
    mc: Vec
    ms: Vec
    x: Vec
    y: Vec
    z: Vec
    distance: float  # |A - O|


def unpack_arm(arm: Array) -> ArmConstants:
    """Read the constants that ``geometry.measure`` packed."""
    return ArmConstants(
        (arm[24], arm[25], arm[26]),
        arm[27],
        arm[28],
        arm[29],
        arm[30],
        arm[31],
        arm[32],
        arm[33],
        arm[34],
        arm[35],
        arm[36],
        arm[38],
        SixArm(arm[39], int(arm[40]), int(arm[41]), int(arm[42]), int(arm[43]), arm[44], arm[45]),
    )


def to_wrist_frame(arm: Array, T: Array, v: Vec) -> Vec:
    """N R_T^T v: a base-frame vector in the wrist frame, turned with the target."""
    x = T[0, 0] * v[0] + T[1, 0] * v[1] + T[2, 0] * v[2]
    y = T[0, 1] * v[0] + T[1, 1] * v[1] + T[2, 1] * v[2]
    z = T[0, 2] * v[0] + T[1, 2] * v[1] + T[2, 2] * v[2]
    return (
        arm[0] * x + arm[1] * y + arm[2] * z,
        arm[3] * x + arm[4] * y + arm[5] * z,
        arm[6] * x + arm[7] * y + arm[8] * z,
    )


def pose_of(arm: Array, k: ArmConstants, T: Array) -> Pose:
    """Everything the equations need to know about a (4, 4) target."""
    x = to_wrist_frame(arm, T, (arm[9], arm[10], arm[11]))
    y = to_wrist_frame(arm, T, (arm[12], arm[13], arm[14]))
    z = to_wrist_frame(arm, T, (arm[15], arm[16], arm[17]))
    p = to_wrist_frame(arm, T, (arm[18] - T[0, 3], arm[19] - T[1, 3], arm[20] - T[2, 3]))
    o = (p[0] - arm[21], p[1] - arm[22], p[2] - arm[23])
    along_o = dot(k.w6, o)
    along_z = dot(k.w6, z)
    axis5 = (0.0, 0.0, 1.0)
    return Pose(
        mix(axis5, k.b5, k.w6, -along_o, o, 0.0),
        mix(k.w6, along_o, o, -1.0, o, 0.0),
        cross(o, k.w6),
        mix(k.w6, along_z, z, 0.0, z, 0.0),
        mix(z, 1.0, k.w6, -along_z, z, 0.0),
        cross(k.w6, z),
        x,
        y,
        z,
        norm(o),
    )
