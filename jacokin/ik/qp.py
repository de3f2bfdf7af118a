"""Inverse kinematics by mink's QP, made global: many starts, limits held at every step, answers measured anew."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import chain

import mink
import numpy as np
import pinocchio as pin

from jacokin.arrays import Array
from jacokin.ik import diagnosis, seeds, targets
from jacokin.ik.closest import ClosestSearch
from jacokin.ik.diagnosis import Outcome
from jacokin.ik.qp_backend import Backend, QPFailed
from jacokin.ik.request import Request, joined
from jacokin.ik.results import IKResult, Status
from jacokin.ik.targets import TargetPose
from jacokin.ik.verification import Verifier
from jacokin.model import angles, poses
from jacokin.model.mujoco_twin import body_of_joint, to_spec

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
        return targets.combined_error(self.position_error, self.orientation_error)


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


#: Orientations that are tried, one after another until there are enough members.
ORIENTATIONS = 200
#: Members that are enough.
ENOUGH = 5

#: The configuration (dof,) within the limits nearest to a seed (dof,) that reaches a pose; None for none.
Nearest = Callable[[TargetPose, Array], Array | None]


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


class QPSearch:
    """mink's QP on one robot, frame and tool, and what its attempts mean."""

    def __init__(
        self, verifier: Verifier, closest: ClosestSearch, nearest: Callable[[TargetPose, Array], Array | None] | None
    ) -> None:
        """Build the QP.

        Args:
            verifier: the robot, frame and tool, and what a success is.
            closest: looks for the closest configuration when no start reaches the target.
            nearest: solves a pose in closed form, near a seed; None where there is no closed form.

        Raises:
            UnknownNameError: the QP solver is not installed.
        """
        self._verifier = verifier
        self._robot = verifier.robot
        self._qp = MultiStartQP(verifier)
        self._closest = closest
        self._nearest = nearest

    def solve(self, request: Request) -> IKResult:
        """Start after start until one reaches the target, free of contact if that matters."""
        seed, home = request.seed, self._robot.home
        first = [seed] if np.array_equal(seed, home) else [seed, home]
        out_of_reach = self._closest.reach.exceeded(request.target)
        if out_of_reach is not None:
            if request.closest:
                return self._closest.result(request, out_of_reach, first)
            errors = self._verifier.measure(seed, request.target)
            return self._result(request, out_of_reach, Attempt(seed, *errors, False, 0, 1, self._qp.backend.name))
        starts = self._starts(request, first)
        contact: Outcome | None = None
        if self._verifier.rejects_contact:
            attempt, contact = self._clear_of_contact(request, list(starts))
        else:
            attempt = self._qp.solve(request.target, starts)
        if contact is not None:
            return self._result(request, contact, attempt)
        if attempt.reached:
            solved = Outcome(Status.OK, f"start {attempt.starts}, {attempt.iterations} iterations")
            return self._result(request, solved, attempt)
        failure = diagnosis.of_descents(attempt.starts, failed=attempt.failed)
        if failure.status is Status.SOLVER_ERROR or not request.closest:
            return self._result(request, failure, attempt)
        return self._closest.result(request, failure, [attempt.q], attempt)

    def _starts(self, request: Request, first: list[Array]) -> Iterator[Array]:
        """First ones, then configurations that reach a position with some orientation, then random ones."""
        starts = seeds.starts(self._robot, first, request.restarts, request.generator())
        if not request.target.position_only or self._nearest is None or request.restarts < len(first):
            return starts
        given = [next(starts) for _ in first]
        return chain(given, self._members(request), starts)

    def _members(self, request: Request) -> Iterator[Array]:
        assert self._nearest is not None
        rotation = self._verifier.tool_pose(request.seed).rotation
        yield from members(self._nearest, request.target.position, rotation, request.seed)

    def _clear_of_contact(self, request: Request, starts: list[Array]) -> tuple[Attempt, Outcome | None]:
        """The first attempt that reaches without self-contact; else the first that reaches, and its contact."""
        touched: tuple[Attempt, Outcome] | None = None
        total: Attempt | None = None
        for q in starts:
            attempt = self._qp.solve(request.target, [q], total)
            total = attempt
            if not attempt.reached:
                continue
            # Contact is the same in every 2 pi copy of an unlimited joint.
            pairs = self._verifier.touching(attempt.q)
            if not pairs:
                return attempt, None
            failure = diagnosis.of_contact("every configuration found is in contact; the first", pairs)
            touched = touched or (attempt, failure)
        assert total is not None  # there is always a first start
        return touched or (total, None)

    def _result(self, request: Request, outcome: Outcome, attempt: Attempt) -> IKResult:
        """An attempt in the 2 pi copies nearest to the seed, measured again there."""
        verifier = self._verifier
        q = angles.nearest_copy(attempt.q, request.seed, self._robot.unlimited & ~self._robot.sliding)
        errors = verifier.measure(q, request.target)
        if attempt.reached and not verifier.reached(q, errors):
            q, errors = attempt.q, (attempt.position_error, attempt.orientation_error)
        message = joined(outcome.message, request.note)
        return verifier.result(q, outcome.status, errors, message, effort=attempt, touching=verifier.touching(q))
