"""`QPSearch`: inverse kinematics by mink's QP, made global by many starts, for what the closed form does not cover.

One start is a sequence of QPs: each moves the joints towards the target as far as linearised kinematics and the joint
limits allow, and the end is measured anew. That is a local minimum about once in four random starts, so starts go on
until one succeeds: from the seed, from home, from configurations that reach a position in closed form, at random.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import mink
import numpy as np
import pinocchio as pin

from jacokin.arrays import Array
from jacokin.ik import diagnosis, seeds, targets
from jacokin.ik.closest import ClosestSearch
from jacokin.ik.qp_backend import Backend, QPFailed
from jacokin.ik.results import IKResult, Status
from jacokin.ik.targets import Request, TargetPose
from jacokin.ik.verification import Candidate, Effort, Verifier
from jacokin.model import angles, poses
from jacokin.model.mujoco_twin import body_of_joint, to_spec

TOOL_SITE = "jacokin_tool"
MAX_ITERATIONS = 60  # per start; a start that converges needs 4 near its answer, 10 to 20 far from it
STALL_ITERATIONS = 8  # without halving the error: a local minimum, or too slow to wait for
CONVERGED = 0.01  # of the tolerances: one quadratic step past them, so that measuring anew cannot fail
LM_DAMPING = 1e-3  # relative to the squared error; keeps steps finite near singular poses
#: Orientations that are tried where only a position is given, one after another until there are enough members.
ORIENTATIONS = 200
#: Members that are enough.
ENOUGH = 5

#: The configuration (dof,) within the limits nearest to a seed (dof,) that reaches a pose; None for none.
Nearest = Callable[[TargetPose, Array], Array | None]


class Descent(NamedTuple):
    """Where a descent ended."""

    q: Array
    """(dof,) within the limits [rad]."""
    iterations: int
    """Steps it took."""
    failed: bool
    """Whether no QP solver solved the last one."""


class QPSearch:
    """mink's QP on one robot, frame and tool, everything built once; for one thread at a time."""

    def __init__(self, verifier: Verifier, nearest: Nearest | None = None) -> None:
        """Build the arm in MuJoCo, the task and the limits.

        Args:
            verifier: the robot, frame and tool, and what a success is.
            nearest: solves a pose in closed form, near a seed; None where there is no closed form.

        Raises:
            UnknownNameError: a QP solver that is not installed.
        """
        options, robot, tool = verifier.options, verifier.robot, verifier.tool
        self._backend = Backend(options.qp_solver)
        self._verifier, self._robot = verifier, robot
        self._closest, self._nearest = ClosestSearch(verifier), nearest
        self._tolerance = options.position_tolerance, options.orientation_tolerance
        self._circular = robot.unlimited & ~robot.sliding
        spec = to_spec(robot)
        placed = robot.pin_model.frames[verifier.frame_id]
        T_joint_tool = placed.placement if tool is None else placed.placement * tool
        body = spec.body(body_of_joint(robot, placed.parentJoint))
        body.add_site(name=TOOL_SITE, pos=T_joint_tool.translation, quat=poses.quaternion(T_joint_tool.rotation))
        model = spec.compile()
        self._configuration = mink.Configuration(model)
        self._limits = [mink.ConfigurationLimit(model, gain=1.0)]
        self._pose_task = mink.FrameTask(TOOL_SITE, "site", position_cost=1.0, orientation_cost=1.0)
        self._position_task = mink.FrameTask(TOOL_SITE, "site", position_cost=1.0, orientation_cost=0.0)
        for task in (self._pose_task, self._position_task):
            task.lm_damping = LM_DAMPING

    def solve(self, request: Request) -> IKResult:
        """Start after start until one reaches the target, free of contact if that matters."""
        verifier, target, seed = self._verifier, request.target, request.seed
        home = self._robot.home
        first = [seed] if np.array_equal(seed, home) else [seed, home]
        out_of_reach = self._closest.reach.exceeded(target)
        if out_of_reach is not None:
            if request.closest:
                return self._closest.solve(request, out_of_reach, first)
            unmoved = Candidate(seed, target, "", effort=Effort(0, 1, self._backend.name))
            message = request.message(out_of_reach.message)
            return verifier.result(unmoved, out_of_reach.status, message, touching=verifier.touching(seed))
        best, least, effort = Descent(seed, 0, False), np.inf, Effort(0, 0)

        def ends() -> Iterator[Candidate]:
            nonlocal best, least, effort
            for start in self._starts(request, first):
                end = self.descend(target, start)
                effort = Effort(effort.iterations + end.iterations, effort.starts + 1, self._backend.used)
                errors = verifier.measure(end.q, target)
                if targets.combined_error(*errors) < least:
                    best, least = end, targets.combined_error(*errors)
                if verifier.reached(end.q, errors):
                    message = f"start {effort.starts}, {effort.iterations} iterations"
                    for q in (angles.nearest_copy(end.q, seed, self._circular), end.q):  # which differ by rounding
                        yield Candidate(q, target, message, effort=effort)

        self._backend.reset()
        result = verifier.select(ends(), request, "every configuration found is in contact; the first")
        if result is not None:
            return result
        failure = diagnosis.explain_descents(effort.starts, failed=best.failed)
        if failure.status is not Status.SOLVER_ERROR:
            result = self._closest.solve(request, failure, [best.q], effort)
            if request.closest or result.success:
                return result
        q = angles.nearest_copy(best.q, seed, self._circular)
        end = Candidate(q, target, "", effort=effort)
        return verifier.result(end, failure.status, request.message(failure.message), touching=verifier.touching(q))

    def reach(self, target: TargetPose, start: Array) -> Array | None:
        """Where the descent from one start (dof,) ends, within the limits [rad]; None where it misses the target."""
        self._backend.reset()
        q = self.descend(target, start).q
        return q if self._verifier.reached(q, self._verifier.measure(q, target)) else None

    def descend(self, target: TargetPose, start: Array) -> Descent:
        """Undamped steps from a start (dof,) until converged or stalled."""
        task = self._position_task if target.position_only else self._pose_task
        quaternion = mink.SO3(poses.quaternion(target.rotation))
        task.set_target(mink.SE3.from_rotation_and_translation(quaternion, target.position))
        configuration, lower, upper = self._configuration, self._robot.lower, self._robot.upper
        angular = 0.0 if target.position_only else 1.0
        q = np.clip(start, lower, upper)
        configuration.update(q)
        best, waited = np.inf, 0
        for iteration in range(MAX_ITERATIONS):
            error = task.compute_error(configuration)
            linear = error[:3].dot(error[:3]) ** 0.5 / self._tolerance[0]
            size = max(linear, angular * error[3:].dot(error[3:]) ** 0.5 / self._tolerance[1])
            if size <= CONVERGED:
                return Descent(q, iteration, False)
            if size < 0.5 * best:
                best, waited = size, 0
            else:
                waited += 1
                if waited > STALL_ITERATIONS:
                    return Descent(q, iteration, False)
            try:
                q = np.clip(q + self._backend.step(configuration, [task], self._limits), lower, upper)
            except QPFailed:
                return Descent(q, iteration, True)
            configuration.update(q)
        return Descent(q, MAX_ITERATIONS, False)

    def _starts(self, request: Request, first: list[Array]) -> Iterator[Array]:
        """First ones, then configurations that reach a position with some orientation, then random ones."""
        yield from first[: 1 + request.restarts]
        left = 1 + request.restarts - len(first)
        if left > 0 and request.target.position_only and self._nearest is not None:
            rotation = self._verifier.tool_pose(request.seed).rotation
            yield from members(self._nearest, request.target.position, rotation, request.seed)
        rng = request.generator()
        for _ in range(left):
            yield seeds.random_configurations(self._robot, 1, rng)[0]


def members(nearest: Nearest, position: Array, rotation: Array, seed: Array) -> list[Array]:
    """Configurations (dof,) that reach a position, nearest to the seed first; the same ones every time.

    Args:
        nearest: solves for one orientation.
        position: (3,) [m].
        rotation: (3, 3) of the tool at the seed, tried first, then turned by larger and larger angles.
        seed: (dof,) [rad].
    """
    rng = np.random.default_rng(seeds.DEFAULT_RANDOM_SEED)
    found: list[Array] = []
    for number in range(ORIENTATIONS):
        axis = rng.normal(size=3)
        turn = np.pi * number / ORIENTATIONS * axis / np.linalg.norm(axis)
        T = pin.SE3(rotation @ pin.exp3(turn), position)
        q = nearest(TargetPose(T.homogeneous, position_only=False), seed)
        if q is not None:
            found.append(q)
            if len(found) == ENOUGH:
                break
    return sorted(found, key=lambda q: float(np.linalg.norm(q - seed)))
