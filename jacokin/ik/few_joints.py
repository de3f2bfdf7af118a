"""`FewJoints`: arms of three, four and five turning joints, whose answers are sets of points.

``virtual_joints`` finds the points; here is what a solver makes of them: the best within the limits, or why none is.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Iterator

import numpy as np

from jacokin.arrays import Array
from jacokin.errors import StructureError
from jacokin.ik import diagnosis, forms, near_misses
from jacokin.ik.closest import ClosestSearch
from jacokin.ik.diagnosis import Outcome
from jacokin.ik.fixed_joints import SIX
from jacokin.ik.near_misses import NearMisses
from jacokin.ik.results import IKResult
from jacokin.ik.targets import Request, TargetPose
from jacokin.ik.verification import Candidate, Verifier
from jacokin.ik.virtual_joints import PointsOfFew, VirtualJoints
from jacokin.kernels.branches import COLUMNS, DISTANCE, ORIENTATION_ERROR, POSITION_ERROR, WITHIN_LIMITS
from jacokin.kernels.tolerances import LIMIT_SNAP
from jacokin.model import angles
from jacokin.model.kinematics import axis_of
from jacokin.model.poses import FreeAxis

KEPT = 16  # free axes whose chains are at hand
PARALLEL = 1e-4  # sine of two axes that may be parallel within tolerances; what is reached at two angles decides
AROUND = 8  # angles at which a curve is looked at, beginning with that of the seed
BESIDE = 0.02  # [rad] from an angle to the next one, at which a curve goes on and a point does not
EXACT = 1e-6  # [m] and [rad] errors of what meets a target exactly
TURNED = 2.0  # times the orientation tolerance: a turn about the best of three axes is at most sqrt(3) times as long
ALIKE = 0.02  # [rad] configurations within the tolerances that are nearer than that are one


class FewJoints:
    """An arm of three to five turning joints, with frame and tool."""

    def __init__(self, verifier: Verifier, closest: ClosestSearch, nearly: NearMisses) -> None:
        """Take the arm; chains are built for the kinds of target that are asked for."""
        self._verifier, self._closest, self._near_misses = verifier, closest, nearly
        self._chain = functools.lru_cache(maxsize=KEPT)(functools.partial(forms.virtual_joints, verifier))

    def chain(self, target: TargetPose) -> VirtualJoints:
        """What solves targets of one kind.

        Raises:
            StructureError: such a target leaves more than points, or the joints are not independent.
        """
        axis = None if target.free_axis is None else tuple(target.free_axis.axis.tolist())
        found = self._chain(axis, target.position_only)
        if isinstance(found, StructureError):
            raise found.with_traceback(None)  # one object, raised again and again
        return found

    def covers(self, target: TargetPose) -> bool:
        """Whether the configurations of a target are points that are found exactly."""
        try:
            self.chain(target)
        except StructureError:
            return False
        return True

    def solve_all(self, target: TargetPose, seed: Array) -> PointsOfFew:
        """Every configuration, nearest to the seed (dof,) first; some where they are a curve.

        A tool that points along the axis of the first joint, straight down, is such a target where the last joint is
        parallel to the free axis, if only within the tolerances: the angle about the axis is free.

        Raises:
            StructureError: as `chain`.
        """
        chain = self.chain(target)
        along = None if chain.free_joint or not self._along_first(target) else self._along_curve(target, seed)
        found = chain.solve_all(target, seed) if along is None else along
        if not self._is_missed(target, found):
            return found
        tight = self._near_misses.tolerance <= diagnosis.NEARLY  # what is near has then been found
        if target.free_axis is None and not (tight and found.within_limits.any()):
            return self._within_tolerances(target, seed, found)
        return PointsOfFew(found.rows, found.dropped, seed, self._verifier, found.angle, chain.free_joint, nearly=True)

    def _is_missed(self, target: TargetPose, found: PointsOfFew) -> bool:
        """Whether no point meets a target exactly, though tolerances may be met."""
        if target.position_only or self._near_misses.tolerance <= EXACT:
            return False
        errors = found.rows[:, [POSITION_ERROR, ORIENTATION_ERROR]].max(axis=1)
        return not (errors <= EXACT).any() and self._closest.reach.exceeded(target) is None

    def _within_tolerances(self, target: TargetPose, seed: Array, found: PointsOfFew) -> PointsOfFew:
        """Points within the tolerances of a pose that nothing meets exactly.

        Each is where the errors, in tolerances, are least nearby. Least squares lead there from what meets the position
        and misses the orientation by a small angle about an axis of the tool, and from the closest configuration.
        """
        request = Request(target, seed, "", None, 0, False)
        closest, _ = self._closest.find(target, [seed], request.generator(), position_first=True)
        starts = np.vstack([found.q, *self._at_position(target, seed), closest[np.newaxis]])
        rows: list[Array] = []
        for q in self._near_misses.find(request, starts):
            errors = self._verifier.measure(q, target)
            if self._verifier.reached(q, errors) and not any(_alike(q, row) for row in rows):
                rows.append(self._row(q, errors, seed))
        table = np.array(rows).reshape(-1, COLUMNS)
        order = np.argsort(table[:, DISTANCE], kind="stable")
        return PointsOfFew(table[order], found.dropped, seed, self._verifier, None, "", nearly=True)

    def _at_position(self, target: TargetPose, seed: Array) -> Iterator[Array]:
        """Configurations (k, dof) that meet the position; of five joints, turned by little about an axis of the tool.

        Whatever axis a small turn away from the target is about, one of three at right angles is within 55 degrees of
        it, and the turn about that one is hardly longer.
        """
        wide = TURNED * self._verifier.options.orientation_tolerance
        free = [TargetPose(target.matrix, free_axis=FreeAxis(target.matrix, axis=axis)) for axis in np.eye(3)]
        for each in [*free, TargetPose(target.matrix, position_only=True)]:
            if self.covers(each):
                found = self.chain(each).solve_all(each, seed)
                turned = np.zeros(len(found)) if found.angle is None else angles.wrap_to_pi(found.angle)
                yield found.q[np.abs(turned) <= wide]

    def _row(self, q: Array, errors: tuple[float, float], seed: Array) -> Array:
        """A configuration (dof,) within the limits as a row of `PointsOfFew`."""
        robot, row = self._verifier.robot, np.zeros(COLUMNS)
        row[: robot.dof], row[SIX : SIX + robot.dof] = q, np.minimum(q - robot.lower, robot.upper - q)
        row[POSITION_ERROR], row[ORIENTATION_ERROR] = errors
        row[DISTANCE], row[WITHIN_LIMITS] = np.linalg.norm(q - seed), 1.0
        return row

    def _along_curve(self, target: TargetPose, seed: Array) -> PointsOfFew | None:
        """Points at some angles about the free axis; None where they do not go on beside any of these."""
        poses = self._chain(None, False)
        if isinstance(poses, StructureError):
            return None

        def at(angle: float) -> PointsOfFew:
            return poses.solve_all(target.at(angle), seed)

        reached = [(angle, points) for angle in self._angles(target, seed) if len(points := at(angle))]
        if not any(len(at(beside)) for angle, _ in reached for beside in _beside(target, angle)):
            return None
        rows = np.vstack([points.rows for _, points in reached])
        angle = np.concatenate([np.full(len(points), angle) for angle, points in reached])
        order = np.argsort(rows[:, DISTANCE], kind="stable")
        dropped = any(points.dropped for _, points in reached)
        return PointsOfFew(rows[order], dropped, seed, self._verifier, angle[order], "", on_curve=True)

    def _along_first(self, target: TargetPose) -> bool:
        """Whether the free axis of a target is parallel to the axis of the first of five joints, about."""
        if target.free_axis is None or self._verifier.robot.dof != 5:
            return False
        x, y, z = self._first_axis
        u, v, w = (target.rotation @ target.free_axis.axis).tolist()
        return math.hypot(y * w - z * v, z * u - x * w, x * v - y * u) < PARALLEL

    @functools.cached_property
    def _first_axis(self) -> list[float]:
        """The axis of the first joint in the base, a unit vector: plain floats are faster here than NumPy."""
        model = self._verifier.robot.pin_model
        direction: list[float] = (model.jointPlacements[1].rotation @ axis_of(model, 1).direction).tolist()
        return direction

    def _angles(self, target: TargetPose, seed: Array) -> list[float]:
        """Angles about the free axis, that of the seed (dof,) first, those within its range."""
        free = target.free_axis
        turned = 0.0 if free is None else free.parameter_of(self._verifier.tool_pose(seed).rotation)
        start = target.nearest_angle(turned)
        around = [start + math.tau * k / AROUND for k in range(1, AROUND)]
        return [start, *(target.nearest_angle(each) for each in around if _in_range(target, each))]

    def solve(self, request: Request) -> IKResult:
        """The configuration within the limits of the least cost, or why there is none."""
        target, verifier = request.target, self._verifier
        beyond = self._closest.reach.exceeded(target)
        if beyond is not None:
            return self._closest_to(request, beyond, [])
        branches = self.solve_all(target, request.seed)
        result = verifier.select(self._candidates(branches, request), request, "every branch is in contact; the best")
        if result is not None:
            return result
        outcome = diagnosis.explain_branches(branches, verifier.robot.joint_names)
        inside = [np.clip(q, verifier.robot.lower, verifier.robot.upper) for q in branches.q]
        return self._closest_to(request, outcome, inside)

    def _candidates(self, branches: PointsOfFew, request: Request) -> Iterator[Candidate]:
        """Branches within the limits, best first."""
        said = f"; {branches.free_joint} is free" if branches.free_joint else ""
        said = "; the angle about the axis is free" if branches.on_curve else said
        said = f"; {near_misses.MESSAGE}" if branches.nearly else said
        for index, q in branches.in_order(request.cost):
            parameter = None if branches.angle is None else float(branches.angle[index])
            at = request.target if parameter is None else request.target.at(parameter)
            yield Candidate(q, at, f"branch {index + 1} of {len(branches)}{said}", parameter)

    def _closest_to(self, request: Request, outcome: Outcome, nearby: list[Array]) -> IKResult:
        """Why there is no answer, with the closest configuration, of a pose at its position if it can be."""
        target = request.target
        if target.free_axis is None:
            result = self._closest.solve(request, outcome, nearby)
            if target.position_only or result.success or not request.closest:
                return result
            return self._position_first(request, outcome, result)
        best = self._closest.solve_about(request, outcome, nearby, target.nearest_angle(0.0))
        missed = diagnosis.explain_near_miss((best.position_error, best.orientation_error), self._verifier.options)
        if best.success or not request.closest or not missed:
            return best
        return dataclasses.replace(best, message=f"{best.message}; the closest one within the limits {missed}")

    def _position_first(self, request: Request, outcome: Outcome, result: IKResult) -> IKResult:
        """The configuration of the least orientation error among those at the position; the given one without any."""
        verifier, target = self._verifier, request.target
        if self._closest.reach.exceeded(target) is not None:
            return result
        found, effort = self._closest.find(target, [result.q, request.seed], request.generator(), position_first=True)
        q = angles.nearest_copy(found, request.seed, verifier.robot.unlimited)
        closest = Candidate(q, target, "found while looking for the closest configuration", effort=effort)
        reached = verifier.select([closest], request, "")
        if reached is not None and reached.success:
            return reached
        errors = verifier.measure(q, target)
        if errors[0] > verifier.options.position_tolerance:
            return result
        sentence = f"{outcome.message}; the position is reached, {math.degrees(errors[1]):.3g} deg from the orientation"
        outcome = outcome._replace(message=sentence)
        if errors[1] <= diagnosis.NEARLY:  # a pose in few digits: the tolerances that accept it
            outcome = diagnosis.explain_descents(effort.starts, errors, verifier.options, failed=False)
        return verifier.result(closest, outcome.status, request.message(outcome.message), errors, verifier.touching(q))


def _beside(target: TargetPose, angle: float) -> list[float]:
    """Angles about the free axis next to one [rad], within the range."""
    return [each for each in (angle - BESIDE, angle + BESIDE) if _in_range(target, each)]


def _alike(q: Array, row: Array) -> bool:
    """Whether a configuration (dof,) is about that of a row, turned round or not."""
    return bool(np.abs(angles.wrap_to_pi(row[: len(q)] - q)).max() < ALIKE)


def _in_range(target: TargetPose, angle: float) -> bool:
    """Whether an angle is in the range of the free axis of a target [rad], up to whole turns."""
    return abs(math.remainder(target.nearest_angle(angle) - angle, math.tau)) < LIMIT_SNAP
