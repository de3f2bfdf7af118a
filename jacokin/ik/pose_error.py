"""How far a pose is from its target: distance, angle, and one measure of both."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import pinocchio as pin

from jacokin.model import poses

if TYPE_CHECKING:
    from jacokin.ik.targets import TargetPose

#: [m/rad] An orientation error of one radian counts as much as this position error. It is the order of the distance
#: from the arm's tool frame to its fingertips; there is no source for the figure.
RADIAN_IN_METRES = 0.1
SQRT_8 = math.sqrt(8.0)


def errors(T_base_tool: pin.SE3, target: TargetPose) -> tuple[float, float]:
    """Distance [m] and angle [rad] between the tool and the target; the angle is 0 when the orientation is free."""
    difference = T_base_tool.homogeneous - target.matrix
    (a, b, c, x), (d, e, f, y), (g, h, k, z), _ = difference.tolist()
    position = math.hypot(x, y, z)
    if target.position_only:
        return position, 0.0
    chord = math.hypot(a, b, c, d, e, f, g, h, k)  # |R - R_target|_F = sqrt(8) sin(angle / 2)
    if chord < 1.0:
        return position, 2.0 * math.asin(chord / SQRT_8)
    return position, poses.rotation_angle(T_base_tool.rotation.T @ target.rotation)  # accurate near half a turn


def combined(position: float, orientation: float) -> float:
    """One measure [m] of a position error [m] and an orientation error [rad]."""
    return position + RADIAN_IN_METRES * orientation
