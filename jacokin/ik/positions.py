"""`PositionDescents`: from one start to a position, the orientation free; without MuJoCo, which takes long to load.

A step solves one small QP: the joints go to where linearised kinematics has the position, as near to where the descent
started as that allows, inside the limits. As the position comes nearer, less counts how far the joints went.
"""

from __future__ import annotations

import daqp
import numpy as np
import pinocchio as pin

from jacokin.arrays import Array
from jacokin.ik.local_search import MAX_ITERATIONS, STALL_ITERATIONS, Descent
from jacokin.ik.targets import TargetPose
from jacokin.ik.verification import Verifier

CONVERGED = 1e-3  # of the tolerance, so that measuring anew cannot fail
LONGEST_STEP = 0.7  # [rad] of one joint; linearised kinematics says little beyond
KEPT = 1e-2  # [m^2/rad^2] the most that staying near the start counts against the position
LEAST_KEPT = 1e-14  # [m^2/rad^2] keeps the QP strictly convex at singular poses
SOLVED = (1, 2)  # of DAQP: optimal


class PositionDescents:
    """Descents to positions on one robot, frame and tool; for one thread at a time."""

    name = used = "daqp"

    def __init__(self, verifier: Verifier) -> None:
        """Take the arm."""
        self._robot, self._verifier = verifier.robot, verifier
        self._converged = CONVERGED * verifier.options.position_tolerance
        self._lever = np.zeros(3) if verifier.tool is None else verifier.tool.translation

    def reset(self) -> None:
        """Nothing to forget."""

    def descend(self, target: TargetPose, start: Array) -> Descent:
        """Steps from a start (dof,) until converged or stalled."""
        robot, frame = self._robot, self._verifier.frame
        q = origin = np.clip(start, robot.lower, robot.upper)
        best, waited = np.inf, 0
        for iteration in range(MAX_ITERATIONS):
            T = robot.placement(q, self._verifier.frame_id)
            lever = T.rotation @ self._lever
            error = target.position - T.translation - lever
            size = float(error @ error) ** 0.5
            if size <= self._converged:
                return Descent(q, iteration, False)
            if size < 0.5 * best:
                best, waited = size, 0
            else:
                waited += 1
                if waited > STALL_ITERATIONS:
                    return Descent(q, iteration, False)
            J = robot.jacobian(q, frame)
            linear = J[:3] - pin.skew(lever) @ J[3:]
            kept = min(KEPT, size * size) + LEAST_KEPT
            hessian = linear.T @ linear
            hessian.flat[:: robot.dof + 1] += kept
            gradient = kept * (q - origin) - linear.T @ error
            high = np.minimum(robot.upper - q, LONGEST_STEP)
            low = np.maximum(robot.lower - q, -LONGEST_STEP)
            free = np.zeros(robot.dof, dtype=np.int32)
            found, _, flag, _ = daqp.solve(hessian, gradient, hessian[:0], high, low, free)
            if flag not in SOLVED:
                return Descent(q, iteration, True)
            q = np.minimum(np.maximum(q + found, robot.lower), robot.upper)
        return Descent(q, MAX_ITERATIONS, False)
