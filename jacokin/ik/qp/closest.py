"""The last stretch to the closest pose: descends the very measure it is judged by, inside the limits.

The QP minimises squares and slows down where the error cannot vanish. This starts at its end and follows the gradient
of position error + 0.1 m/rad x orientation error, by L-BFGS-B (Byrd, Lu, Nocedal, Zhu, 1995).
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pinocchio as pin
from scipy.optimize import minimize

from jacokin.arrays import Array
from jacokin.ik.pose_error import RADIAN_IN_METRES
from jacokin.ik.targets import TargetPose
from jacokin.model.robot import Robot

MAX_ITERATIONS = 200
TINY = 1e-12  # an error below this has no direction


def refine(robot: Robot, frame: str, tool: pin.SE3 | None, target: TargetPose, q: Array) -> Array:
    """A configuration within the limits near `q` (dof,) [rad] whose measure is least around there."""
    bounds = [
        (low if math.isfinite(low) else None, high if math.isfinite(high) else None)
        for low, high in zip(robot.lower, robot.upper, strict=True)
    ]
    found = minimize(
        _measure_and_gradient(robot, frame, tool, target),
        q,
        jac=True,
        method="L-BFGS-B",
        bounds=bounds,
        options={"maxiter": MAX_ITERATIONS},
    )
    return np.clip(np.asarray(found.x, dtype=np.float64), robot.lower, robot.upper)


def _measure_and_gradient(
    robot: Robot, frame: str, tool: pin.SE3 | None, target: TargetPose
) -> Callable[[Array], tuple[float, Array]]:
    def measure(q: Array) -> tuple[float, Array]:
        jacobian = robot.jacobian(q, frame)
        T_base_tool = robot.forward_kinematics(q, frame)
        linear, angular = jacobian[:3], jacobian[3:]
        if tool is not None:
            arm = T_base_tool.rotation @ tool.translation
            linear = linear - pin.skew(arm) @ angular
            T_base_tool = T_base_tool * tool
        miss = T_base_tool.translation - target.position
        distance = math.sqrt(miss.dot(miss))
        gradient = linear.T @ (miss / max(distance, TINY))
        if target.position_only:
            return distance, gradient
        turn = pin.log3(target.rotation.T @ T_base_tool.rotation)
        angle = math.sqrt(turn.dot(turn))
        axis = target.rotation @ (turn / max(angle, TINY))
        return distance + RADIAN_IN_METRES * angle, gradient + RADIAN_IN_METRES * (angular.T @ axis)

    return measure
