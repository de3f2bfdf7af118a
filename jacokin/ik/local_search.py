"""`LocalSearch`: inverse kinematics by descents from many starts, for what the closed form does not cover.

A descent is a local minimum about once in four random starts, so starts go on until one succeeds: from the seed, from
home, from configurations that reach a position in closed form, at random. Where all end elsewhere, `ik.closest` looks.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator
from typing import NamedTuple, Protocol

import daqp
import numpy as np
import pinocchio as pin

from jacokin.arrays import Array
from jacokin.ik import diagnosis, seeds, targets
from jacokin.ik.closest import ClosestSearch
from jacokin.ik.diagnosis import Outcome
from jacokin.ik.results import IKResult, Status
from jacokin.ik.targets import RADIAN_IN_METRES, Request, TargetPose
from jacokin.ik.verification import Candidate, Effort, Verifier
from jacokin.model import angles

#: Orientations that are tried where only a position is given, one after another until there are enough members.
ORIENTATIONS = 200
#: Members that are enough.
ENOUGH = 5
#: Where poses have curves, whose members take longer to find, so many starts come before: on the way from the seed to
#: random configurations, farther and farther away.
ASIDE = 16
SHARES = np.arange(1, ASIDE + 1) / (ASIDE + 1)

#: Numbers of a pose, and of one that may turn about an axis, which fewer joints cannot all meet.
POSE_NUMBERS, AXIS_NUMBERS = 6, 5

#: Steps of a descent; one that converges needs 4 near its answer, 10 to 20 far from it.
MAX_ITERATIONS = 60

CONVERGED = 1e-3  # of the tolerance, so that measuring anew cannot fail
LONGEST_STEP = 0.7  # [rad] of one joint; linearised kinematics says little beyond
KEPT = 1e-2  # [m^2/rad^2] the most that staying near the start counts against the position
SOLVED = (1, 2)  # of DAQP: optimal

#: The configuration (dof,) within the limits nearest to a seed (dof,) that reaches a pose; None for none.
Nearest = Callable[[TargetPose, Array], Array | None]
#: Gives the configuration (dof,) after a step, within the limits; None where no QP solver solves the step.
Step = Callable[[], Array | None]


class Descent(NamedTuple):
    """Where a descent ended."""

    q: Array
    """(dof,) within the limits [rad]."""
    iterations: int
    """Steps it took."""
    failed: bool
    """Whether no QP solver solved the last one."""


def descend(start: Array, look: Callable[[Array], tuple[float, Step]], converged: float) -> Descent:
    """Steps from a start (dof,) within the limits until converged or stalled.

    Args:
        start: where it begins.
        look: at a configuration: the size of its error, and the step from there.
        converged: the size that is small enough.
    """
    q, best, waited = start, np.inf, 0
    for iteration in range(MAX_ITERATIONS):
        size, step = look(q)
        best, waited = (size, 0) if size < 0.5 * best else (best, waited + 1)
        # After so many steps without halving the error it is at a local minimum, or too slow to wait for.
        if size <= converged or waited > 8:
            return Descent(q, iteration, False)
        after = step()
        if after is None:
            return Descent(q, iteration, True)
        q = after
    return Descent(q, MAX_ITERATIONS, False)


class Descents(Protocol):
    """What moves the joints towards a target: `PositionDescents`, and those of `ik.qp`."""

    @property
    def name(self) -> str:
        """The QP solver asked for."""

    @property
    def used(self) -> str:
        """What ran since `reset`."""

    def reset(self) -> None:
        """Forget what ran."""

    def descend(self, target: TargetPose, start: Array) -> Descent:
        """Steps from a start (dof,) within the limits until converged or stalled."""


class LocalSearch:
    """Descents on one robot, frame and tool; for one thread at a time."""

    def __init__(self, verifier: Verifier, descents: Descents, nearest: Nearest | None = None) -> None:
        """Take what descends.

        Args:
            verifier: the robot, frame and tool, and what a success is.
            descents: on the same ones.
            nearest: solves a pose in closed form, near a seed; None where there is no closed form.
        """
        self._verifier, self._robot, self._descents = verifier, verifier.robot, descents
        self._about = PositionDescents(verifier)
        self._closest, self._nearest = ClosestSearch(verifier), nearest
        self._circular = self._robot.unlimited & ~self._robot.sliding

    def solve(self, request: Request) -> IKResult:
        """Start after start until one reaches the target, free of contact if that matters."""
        verifier, target, seed = self._verifier, request.target, request.seed
        home = self._robot.home
        first = [seed] if np.array_equal(seed, home) else [seed, home]
        out_of_reach = self._closest.reach.exceeded(target)
        if out_of_reach is not None:
            if request.closest:
                return self._closest_to(request, out_of_reach, first)
            unmoved = self._candidate(seed, target, "", Effort(0, 1, self._descents.name))
            message = request.message(out_of_reach.message)
            return verifier.result(unmoved, out_of_reach.status, message, touching=verifier.touching(seed))
        best, least, effort = Descent(seed, 0, False), np.inf, Effort(0, 0)

        nearly = 0  # ends that miss a pose by little: fewer than six joints do not meet one that is rounded
        numbers = POSE_NUMBERS if target.free_axis is None else AXIS_NUMBERS
        # Ends that miss a pose by little on an arm of fewer joints, after which nothing better is expected.
        enough = 2 if self._robot.dof < numbers and not target.position_only else 1 + request.restarts

        def ends() -> Iterator[Candidate]:
            nonlocal best, least, effort, nearly
            for start in self._starts(request, first):
                end, solver = self._descend(target, start)
                effort = Effort(effort.iterations + end.iterations, effort.starts + 1, solver)
                errors = verifier.measure(end.q, self._pose_at(end.q, target))
                if targets.combined_error(*errors) < least:
                    best, least = end, targets.combined_error(*errors)
                if verifier.reached(end.q, errors):
                    message = f"start {effort.starts}, {effort.iterations} iterations"
                    for q in (angles.nearest_copy(end.q, seed, self._circular), end.q):  # which differ by rounding
                        yield self._candidate(q, target, message, effort)
                nearly += max(errors) <= diagnosis.NEARLY
                if nearly >= enough:
                    return

        self._descents.reset()
        result = verifier.select(ends(), request, "every configuration found is in contact; the first")
        if result is not None:
            return result
        missed = verifier.measure(best.q, self._pose_at(best.q, target))
        failure = diagnosis.explain_descents(effort.starts, missed, verifier.options, failed=best.failed)
        if failure.status is not Status.SOLVER_ERROR:
            result = self._closest_to(request, failure, [best.q], effort)
            if result.success:
                return result
            if request.closest:
                errors = result.position_error, result.orientation_error
                outcome = diagnosis.explain_descents(effort.starts, errors, verifier.options, failed=False)
                return dataclasses.replace(result, message=request.message(outcome.message))
        q = angles.nearest_copy(best.q, seed, self._circular)
        end = self._candidate(q, target, "", effort)
        return verifier.result(end, failure.status, request.message(failure.message), touching=verifier.touching(q))

    def _descend(self, target: TargetPose, start: Array) -> tuple[Descent, str]:
        """Where a descent ends, and the QP solver that ran; about a free axis, to the end of its range if need be."""
        if target.free_axis is None:
            return self._descents.descend(target, start), self._descents.used
        end, solver = self._about.descend(target, start), self._about.used
        if not self._verifier.reached(end.q, self._verifier.measure(end.q, self._pose_at(end.q, target))):
            after = self._descents.descend(self._pose_at(end.q, target), end.q)
            end, solver = after._replace(iterations=end.iterations + after.iterations), self._descents.used
        return end, solver

    def _pose_at(self, q: Array, target: TargetPose) -> TargetPose:
        """A target, where the angle about its free axis, if it has one, is nearest to a configuration (dof,)."""
        return target if target.free_axis is None else target.at(target.angle_of(self._verifier.tool_pose(q)))

    def _candidate(self, q: Array, target: TargetPose, message: str, effort: Effort) -> Candidate:
        """A configuration (dof,), with its angle about the free axis of the target, if it has one, as parameter."""
        p = None if target.free_axis is None else target.angle_of(self._verifier.tool_pose(q))
        return Candidate(q, target if p is None else target.at(p), message, p, effort)

    def _closest_to(
        self, request: Request, outcome: Outcome, nearby: list[Array], before: Effort | None = None
    ) -> IKResult:
        """The closest configuration, see `ClosestSearch.solve`."""
        target = request.target
        if target.free_axis is None:
            return self._closest.solve(request, outcome, nearby, before)
        angle = target.angle_of(self._verifier.tool_pose(nearby[0]))
        return self._closest.solve_about(request, outcome, nearby, angle, before)

    def reach(self, target: TargetPose, start: Array) -> Array | None:
        """Where the descent from one start (dof,) ends, within the limits [rad]; None where it misses the target."""
        self._descents.reset()
        q = self._descents.descend(target, start).q
        return q if self._verifier.reached(q, self._verifier.measure(q, target)) else None

    def _starts(self, request: Request, first: list[Array]) -> Iterator[Array]:
        """First ones, then beside the seed, then configurations that reach a position somehow, then random ones."""
        yield from first[: 1 + request.restarts]
        left = 1 + request.restarts - len(first)
        rng = request.generator()
        if left > 0 and request.target.position_only and self._nearest is not None:
            if self._robot.dof > POSE_NUMBERS:
                for q, share in zip(seeds.random_configurations(self._robot, ASIDE, rng), SHARES, strict=True):
                    yield request.seed + share * (q - request.seed)
            rotation = self._verifier.tool_pose(request.seed).rotation
            yield from members(self._nearest, request.target.position, rotation, request.seed)
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


class PositionDescents:
    """Descents to positions, and to poses that may turn about an axis, on one robot, frame and tool, without MuJoCo.

    A step solves one small QP: the joints go to where linearised kinematics meets the target, as near to where the
    descent started as that allows, inside the limits. As the target comes nearer, less counts how far the joints went.
    """

    name = used = "daqp"

    def __init__(self, verifier: Verifier) -> None:
        """Take the arm."""
        self._robot, self._verifier = verifier.robot, verifier
        self._converged = CONVERGED * verifier.options.position_tolerance
        self._turned = CONVERGED * RADIAN_IN_METRES * verifier.options.orientation_tolerance
        tool = pin.SE3.Identity() if verifier.tool is None else verifier.tool
        self._lever, self._rotation = tool.translation, tool.rotation

    def reset(self) -> None:
        """Nothing to forget."""

    def descend(self, target: TargetPose, start: Array) -> Descent:
        """Steps from a start (dof,) until converged or stalled."""
        robot, frame, turning = self._robot, self._verifier.frame, target.free_axis
        origin = np.clip(start, robot.lower, robot.upper)

        def look(q: Array) -> tuple[float, Step]:
            T = robot.placement(q, self._verifier.frame_id)
            lever = T.rotation @ self._lever
            error = target.position - T.translation - lever
            if turning is not None:
                axis = T.rotation @ self._rotation @ turning.axis
                error = np.concatenate([error, RADIAN_IN_METRES * _turn_between(axis, target.rotation @ turning.axis)])
            size = float(error @ error) ** 0.5

            def step() -> Array | None:
                J = robot.jacobian(q, frame)
                linear = J[:3] - pin.skew(lever) @ J[3:]
                if turning is not None:
                    linear = np.vstack([linear, RADIAN_IN_METRES * (J[3:] - np.outer(axis, axis @ J[3:]))])
                kept = min(KEPT, size * size) + 1e-14  # [m^2/rad^2] keeps the QP strictly convex at singular poses
                hessian = linear.T @ linear
                hessian.flat[:: robot.dof + 1] += kept
                gradient = kept * (q - origin) - linear.T @ error
                high = np.minimum(robot.upper - q, LONGEST_STEP)
                low = np.maximum(robot.lower - q, -LONGEST_STEP)
                free = np.zeros(robot.dof, dtype=np.int32)
                found, _, flag, _ = daqp.solve(hessian, gradient, hessian[:0], high, low, free)
                return np.minimum(np.maximum(q + found, robot.lower), robot.upper) if flag in SOLVED else None

            return size, step

        return descend(origin, look, self._converged if turning is None else min(self._converged, self._turned))


def _turn_between(axis: Array, wanted: Array) -> Array:
    """The shortest turn (3,) that takes one unit vector (3,) to another [rad]; zero where they are opposite."""
    turn = np.cross(axis, wanted)
    sine = float(turn @ turn) ** 0.5
    return turn * (np.arctan2(sine, float(axis @ wanted)) / sine) if sine > 0.0 else turn
