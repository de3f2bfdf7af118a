"""Measure, on a Pinocchio model, whether the closed form applies, and the few numbers it needs.

The letters are those of ``docs/closed_form.md``: axes ``w1 .. w6``, the points ``O`` (axes 1 and 2), ``C``
(axes 3 and 4), ``B`` (axes 4 and 5), ``A`` (axes 5 and 6), all at q = 0 in the base frame.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from jacokin.ik.closed_form.kernels.tolerances import SPHERICAL_TOLERANCE
from jacokin.ik.closed_form.structure import StructureCheck, axes_at_zero, chain_of


@dataclass(frozen=True, slots=True, eq=False)
class Geometry:
    """What the kernels know about an arm, as flat read-only arrays.

    Attributes:
        chain: (7, 3, 4) [-, m]; pose = chain[0] Rz(q1) chain[1] Rz(q2) ... Rz(q6) chain[6], exactly the model's.
        arm: (39,) the constants of the closed form, in the order of ``kernels.arm.unpack_arm``.
        spherical: axes 4, 5 and 6 meet in one point.
        misfit: the largest deviation from the structure found [m or rad].
    """

    chain: NDArray[np.float64]
    arm: NDArray[np.float64]
    spherical: bool
    misfit: float


def measure(model: pin.Model, frame_id: int, tool: pin.SE3 | None = None) -> Geometry:
    """Measure the structure of a six-joint arm.

    Args:
        model: Pinocchio model with six revolute joints in one chain, nq == nv == 6.
        frame_id: index of the frame to solve for; it must be fixed to the last link.
        tool: T_frame_tool, a constant pose after that frame, or None.

    Raises:
        StructureError: The model is no such chain, or a pair of axes does not meet, is not parallel or not
            perpendicular where the closed form needs it; names the joints and the misfit.
    """
    chain = chain_of(model, frame_id, tool, 6)
    names = [str(name) for name in list(model.names)[1:]]
    w, points, home = axes_at_zero(chain)
    check = StructureCheck(names, w, points)

    check.angle(0, 1, 90.0)
    origin = check.meet(0, 1)
    side = check.parallel(1, 2)
    check.angle(2, 3, 90.0)
    C = check.meet(2, 3)
    check.twist(3, 4)
    check.twist(4, 5)
    B = check.meet(3, 4)
    A = check.meet(4, 5)
    c4 = float((C - B) @ w[3])
    e3 = float((C - origin) @ w[2])
    upper_arm = math.sqrt(max(float((C - origin) @ (C - origin)) - e3**2, 0.0))
    check.long_enough(2, 3, upper_arm, "the distance from axis 2 to axis 3")
    check.long_enough(3, 4, abs(c4), "the distance from axis 3 to axis 5 along axis 4")
    check.long_enough(0, 2, abs(e3), "the lateral offset of the shoulder")

    # Shoulder frame: x = w3 x w1, y = w3, z = w1. Wrist frame: x = e, y = f, z = w5 with w4 in the x, z plane.
    S = _orthonormal(w[0], w[2])
    E = _orthonormal(w[4], np.cross(w[4], w[3]))
    R_home, p_home = home[:, :3], home[:, 3]
    cos_a = float(np.clip(w[3] @ w[4], -1.0, 1.0))
    C_s, w4_s, w3_w = S @ (C - origin), S @ w[3], E @ w[2]
    w4_w = E @ w[3]
    g_w = np.cross(w4_w, (0.0, 1.0, 0.0))
    b5 = float((B - A) @ w[4])
    spherical = abs(b5) < SPHERICAL_TOLERANCE
    arm = np.concatenate(
        [
            (E @ R_home).ravel(),  # 0:9 N
            S.ravel(),  # 9:18
            origin,  # 18:21 O
            E @ (A - p_home),  # 21:24
            E @ w[5],  # 24:27
            [cos_a, np.sqrt(1.0 - cos_a**2), b5, c4, e3, float((C - origin) @ (C - origin))],  # 27:33
            [side],  # 33
            [
                np.arctan2(C_s[0], C_s[2]),
                np.arctan2(w4_s[0], w4_s[2]),
                np.arctan2(w3_w @ g_w, w3_w[1]),
            ],  # 34:37
            [float(spherical), check.worst],  # 37:39
        ]
    ).astype(np.float64)
    chain.flags.writeable = False
    arm.flags.writeable = False
    return Geometry(chain=chain, arm=arm, spherical=spherical, misfit=check.worst)


def _orthonormal(z: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rotation into the frame with the given z and, as nearly as possible, the given y axis (rows are axes)."""
    y = y - (y @ z) * z
    y = y / np.linalg.norm(y)
    return np.vstack([np.cross(y, z), y, z])
