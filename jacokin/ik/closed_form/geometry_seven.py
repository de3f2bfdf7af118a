"""Measure, on a Pinocchio model, whether the closed form of seven joints applies, and the few numbers it needs."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from jacokin.ik.closed_form.structure import StructureCheck, axes_at_zero, chain_of


class SevenJointGeometry(NamedTuple):
    """What the kernels know about an arm, as flat read-only arrays."""

    chain: NDArray[np.float64]
    """(8, 3, 4) [-, m]; pose = chain[0] Rz(q1) chain[1] Rz(q2) ... Rz(q7) chain[7], exactly the model's."""
    arm: NDArray[np.float64]
    """(12,) W in the tool frame, O in the base, O after joint 2, W after joint 4, see `curves.seven` [m]."""
    misfit: float
    """The largest deviation from the structure found [m or rad]."""


def measure_seven(model: pin.Model, frame_id: int, tool: pin.SE3 | None = None) -> SevenJointGeometry:
    """Measure the structure of a seven-joint arm: axes 1 and 2 meet in O, axes 5, 6 and 7 in W.

    Args:
        model: Pinocchio model with seven revolute joints in one chain, nq == nv == 7.
        frame_id: index of the frame to solve for; it must be fixed to the last link.
        tool: T_frame_tool, a constant pose after that frame, or None.

    Raises:
        StructureError: The model is no such chain, or a pair of axes does not meet; names the joints and the misfit.
    """
    chain = chain_of(model, frame_id, tool, 7)
    names = [str(name) for name in list(model.names)[1:]]
    axes, points, home = axes_at_zero(chain)
    check = StructureCheck(names, axes, points)
    for i in range(6):
        check.twist(i, i + 1)
    S = check.meet(0, 1)
    W = check.meet(4, 5)
    check.same_point(5, 6, W, check.meet(5, 6))
    R2, p2 = _after(chain, 2)
    R4, p4 = _after(chain, 4)
    lever = float(np.linalg.norm(np.cross(axes[3], W - points[3])))
    check.long_enough(3, 4, lever, "the distance from axis 4 to the wrist")
    arm = np.concatenate([home[:, :3].T @ (W - home[:, 3]), S, R2.T @ (S - p2), R4.T @ (W - p4)])
    chain.flags.writeable = False
    arm.flags.writeable = False
    return SevenJointGeometry(chain, arm, check.worst)


def _after(chain: NDArray[np.float64], joints: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Rotation and origin of the frame after so many joints at q = 0."""
    rotation, position = np.eye(3), np.zeros(3)
    for i in range(joints):
        position = position + rotation @ chain[i, :, 3]
        rotation = rotation @ chain[i, :, :3]
    return rotation, position
