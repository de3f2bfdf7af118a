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
from jacokin.ik import diagnosis, forms
from jacokin.ik.closest import ClosestSearch
from jacokin.ik.diagnosis import Outcome
from jacokin.ik.results import IKResult
from jacokin.ik.targets import Request, TargetPose
from jacokin.ik.verification import Candidate, Verifier
from jacokin.ik.virtual_joints import PointsOfFew, VirtualJoints
from jacokin.model import angles

KEPT = 16  # free axes whose chains are at hand
AIMS = 3  # angles about a free axis that the closest configuration is looked for at


class FewJoints:
    """An arm of three to five turning joints, with frame and tool."""

    def __init__(self, verifier: Verifier, closest: ClosestSearch) -> None:
        """Take the arm; chains are built for the kinds of target that are asked for."""
        self._verifier, self._closest = verifier, closest
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
        """Every configuration, nearest to the seed (dof,) first.

        Raises:
            StructureError: as `chain`.
        """
        return self.chain(target).solve_all(target, seed)

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
        results, p = [], target.nearest_angle(0.0)
        for _ in range(AIMS if request.closest else 1):
            result = self._closest.solve(request._replace(target=target.at(p)), outcome, nearby)
            results.append(dataclasses.replace(result, parameter=p))
            turned = target.free_axis.parameter_of(self._verifier.tool_pose(result.q).rotation)
            last, p, nearby = p, target.nearest_angle(turned), [result.q]
            if result.success or abs(p - last) < self._verifier.options.orientation_tolerance:
                break
        return min(results, key=lambda each: (not each.success, each.position_error + each.orientation_error))

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
