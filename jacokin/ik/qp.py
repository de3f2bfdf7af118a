"""`QPDescents`: inverse kinematics by mink's QP from one start; `ik.local_search` makes it global by many.

A descent is a sequence of QPs: each moves the joints towards the target as far as linearised kinematics and the joint
limits allow, and the end is measured anew.
"""

from __future__ import annotations

import mink
import numpy as np

from jacokin.arrays import Array
from jacokin.ik.forms import TOOL_SITE, twin_with_tool
from jacokin.ik.local_search import Descent, Step, descend
from jacokin.ik.qp_backend import Backend, QPFailed
from jacokin.ik.targets import TargetPose
from jacokin.ik.verification import Verifier
from jacokin.model import poses

CONVERGED = 0.01  # of the tolerances: one quadratic step past them, so that measuring anew cannot fail


class QPDescents:
    """mink's QP on one robot, frame and tool, everything built once; for one thread at a time.

    Attributes:
        name: the QP solver asked for.
    """

    def __init__(self, verifier: Verifier) -> None:
        """Build the arm in MuJoCo, the task and the limits.

        Args:
            verifier: the robot, frame and tool, and what a success is.

        Raises:
            UnknownNameError: a QP solver that is not installed.
        """
        options = verifier.options
        self._backend = Backend(options.qp_solver)
        self.name, self._robot = options.qp_solver, verifier.robot
        self._tolerance = options.position_tolerance, options.orientation_tolerance
        model = twin_with_tool(verifier)
        self._configuration = mink.Configuration(model)
        self._limits = [mink.ConfigurationLimit(model, gain=1.0)]
        self._pose_task = mink.FrameTask(TOOL_SITE, "site", position_cost=1.0, orientation_cost=1.0)
        self._position_task = mink.FrameTask(TOOL_SITE, "site", position_cost=1.0, orientation_cost=0.0)
        for task in (self._pose_task, self._position_task):
            task.lm_damping = 1e-3  # relative to the squared error; keeps steps finite near singular poses

    @property
    def used(self) -> str:
        """The QP solver that ran since `reset`; names the fallback when one was needed."""
        return self._backend.used

    def reset(self) -> None:
        """Forget the fallbacks of earlier solves."""
        self._backend.reset()

    def descend(self, target: TargetPose, start: Array) -> Descent:
        """Undamped steps from a start (dof,) until converged or stalled."""
        task = self._position_task if target.position_only else self._pose_task
        quaternion = mink.SO3(poses.quaternion(target.rotation))
        task.set_target(mink.SE3.from_rotation_and_translation(quaternion, target.position))
        configuration, lower, upper = self._configuration, self._robot.lower, self._robot.upper
        angular = 0.0 if target.position_only else 1.0

        def look(q: Array) -> tuple[float, Step]:
            configuration.update(q)
            error = task.compute_error(configuration)
            linear = error[:3].dot(error[:3]) ** 0.5 / self._tolerance[0]

            def step() -> Array | None:
                try:
                    return np.clip(q + self._backend.step(configuration, [task], self._limits), lower, upper)
                except QPFailed:
                    return None

            return max(linear, angular * error[3:].dot(error[3:]) ** 0.5 / self._tolerance[1]), step

        return descend(np.clip(start, lower, upper), look, CONVERGED)
