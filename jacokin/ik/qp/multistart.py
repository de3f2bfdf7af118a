"""Inverse kinematics by mink's QP, made global: many starts, limits held at every step, answers measured anew.

One start is a sequence of QPs: each moves the joints towards the target as far as linearised kinematics and the joint
limits allow. That ends in a local minimum about once in four random starts, so starts go on until one succeeds.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace

import mink
import numpy as np

from jacokin.arrays import Array
from jacokin.ik import pose_error
from jacokin.ik.qp.backend import Backend, QPFailed
from jacokin.ik.targets import TargetPose
from jacokin.ik.verification import Verifier
from jacokin.model import poses
from jacokin.model.mujoco_twin.export import body_of_joint, to_spec

TOOL_SITE = "jacokin_tool"
MAX_ITERATIONS = 60  # per start; a start that converges needs 4 near its answer, 10 to 20 far from it
STALL_ITERATIONS = 8  # without halving the error: a local minimum, or too slow to wait for
CONVERGED = 0.01  # of the tolerances: one quadratic step past them, so that measuring anew cannot fail
LM_DAMPING = 1e-3  # relative to the squared error; keeps steps finite near singular poses


@dataclass(frozen=True, slots=True)
class Attempt:
    """What the QP came to; `q` is inside the limits, errors are measured by Pinocchio."""

    q: Array
    position_error: float
    orientation_error: float
    reached: bool
    iterations: int
    starts: int
    qp_solver: str
    failed: bool = False

    @property
    def cost(self) -> float:
        """Position error [m] + 0.1 x orientation error [rad]."""
        return pose_error.combined(self.position_error, self.orientation_error)


class MultiStartQP:
    """mink's QP on one robot, frame and tool, everything built once.

    Attributes:
        backend: the QP solver, which records what ran.
    """

    def __init__(self, verifier: Verifier) -> None:
        """Build the arm in MuJoCo, the task and the limits.

        Args:
            verifier: the robot, the frame, the tool and the tolerances.

        Raises:
            UnknownNameError: a QP solver that is not installed.
        """
        options, robot, tool = verifier.options, verifier.robot, verifier.tool
        self.backend = Backend(options.qp_solver)
        self._verifier = verifier
        self._robot = robot
        self._tolerance = options.position_tolerance, options.orientation_tolerance
        spec = to_spec(robot)
        placed = robot.pin_model.frames[verifier.frame_id]
        T_joint_tool = placed.placement if tool is None else placed.placement * tool
        joint = placed.parentJoint
        body = spec.body(body_of_joint(robot, joint))
        body.add_site(name=TOOL_SITE, pos=T_joint_tool.translation, quat=poses.quaternion(T_joint_tool.rotation))
        model = spec.compile()
        self._configuration = mink.Configuration(model)
        self._limits = [mink.ConfigurationLimit(model, gain=1.0)]
        self._pose_task = mink.FrameTask(TOOL_SITE, "site", position_cost=1.0, orientation_cost=1.0)
        self._position_task = mink.FrameTask(TOOL_SITE, "site", position_cost=1.0, orientation_cost=0.0)

    def solve(self, target: TargetPose, starts: Iterable[Array], before: Attempt | None = None) -> Attempt:
        """Descend from each start until one reaches the target; the best attempt when none does.

        The counts of the attempt go on from those of `before`.
        """
        task = self._aim(self._position_task if target.position_only else self._pose_task, target)
        task.lm_damping = LM_DAMPING
        best: Attempt | None = None
        for attempt in self._ends(target, starts, before, lambda q: self._descend(task, q, target.position_only)):
            if best is None or attempt.cost < best.cost or attempt.reached:
                best = attempt
            if attempt.reached:
                break
        assert best is not None  # callers pass at least one start
        return replace(best, iterations=attempt.iterations, starts=attempt.starts)

    def _ends(
        self,
        target: TargetPose,
        starts: Iterable[Array],
        before: Attempt | None,
        descend: Callable[[Array], tuple[Array, int, bool]],
    ) -> Iterator[Attempt]:
        """Where each descent ends, measured, with the counts so far."""
        self.backend.reset()
        iterations, count = (before.iterations, before.starts) if before is not None else (0, 0)
        for start in starts:
            q, spent, failed = descend(start)
            iterations, count = iterations + spent, count + 1
            yield self._verified(Attempt(q, 0.0, 0.0, False, iterations, count, self.backend.used, failed), target)

    def _verified(self, attempt: Attempt, target: TargetPose) -> Attempt:
        """The attempt with its errors measured, and whether it reaches the target inside the limits."""
        errors = self._verifier.measure(attempt.q, target)
        reached = self._verifier.reached(attempt.q, errors)
        return replace(attempt, position_error=errors[0], orientation_error=errors[1], reached=reached)

    def _aim(self, task: mink.FrameTask, target: TargetPose) -> mink.FrameTask:
        task.set_target(
            mink.SE3.from_rotation_and_translation(mink.SO3(poses.quaternion(target.rotation)), target.position)
        )
        return task

    def _descend(self, task: mink.FrameTask, start: Array, position_only: bool) -> tuple[Array, int, bool]:
        """Undamped steps until converged or stalled; the joints, iterations, and whether every QP solver failed."""
        configuration, lower, upper = self._configuration, self._robot.lower, self._robot.upper
        angular = 0.0 if position_only else 1.0
        q = np.clip(start, lower, upper)
        configuration.update(q)
        best, waited = np.inf, 0
        for iteration in range(MAX_ITERATIONS):
            error = task.compute_error(configuration)
            linear = error[:3].dot(error[:3]) ** 0.5 / self._tolerance[0]
            size = max(linear, angular * error[3:].dot(error[3:]) ** 0.5 / self._tolerance[1])
            if size <= CONVERGED:
                return q, iteration, False
            if size < 0.5 * best:
                best, waited = size, 0
            else:
                waited += 1
                if waited > STALL_ITERATIONS:
                    return q, iteration, False
            try:
                q = np.clip(q + self.backend.step(configuration, [task], self._limits), lower, upper)
            except QPFailed:
                return q, iteration, True
            configuration.update(q)
        return q, MAX_ITERATIONS, False
