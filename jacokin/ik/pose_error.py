"""How far a pose is from its target: distance, angle, and one measure of both."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import pinocchio as pin

if TYPE_CHECKING:
    from jacokin.ik.targets import TargetPose

#: [m/rad] An orientation error of one radian counts as much as this position error. It is the order of the distance
#: from the arm's tool frame to its fingertips; there is no source for the figure.
RADIAN_IN_METRES = 0.1


def errors(T_base_tool: pin.SE3, target: TargetPose) -> tuple[float, float]:
    """Distance [m] and angle [rad] between the tool and the target; the angle is 0 when the orientation is free."""
    # Plain floats: the same twelve numbers through NumPy take twice as long.
    (a, b, c, x), (d, e, f, y), (g, h, k, z), _ = T_base_tool.homogeneous.tolist()
    (A, B, C, X), (D, E, F, Y), (G, H, K, Z), _ = target.matrix.tolist()
    position = math.dist((x, y, z), (X, Y, Z))
    if target.position_only:
        return position, 0.0
    # Skew part and trace of R^T R_target.
    sine = math.hypot(
        c * B + f * E + k * H - b * C - e * F - h * K,
        a * C + d * F + g * K - c * A - f * D - k * G,
        b * A + e * D + h * G - a * B - d * E - g * H,
    )
    return position, math.atan2(sine, a * A + b * B + c * C + d * D + e * E + f * F + g * G + h * H + k * K - 1.0)


def combined(position: float, orientation: float) -> float:
    """One measure [m] of a position error [m] and an orientation error [rad]."""
    return position + RADIAN_IN_METRES * orientation
