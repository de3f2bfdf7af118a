"""`TurnedSearch`: one configuration at a pose that may turn about an axis, on arms whose poses have curves themselves.

All configurations that reach such a target are a surface. A descent leads from the seed to one nearby. Where it does
not, or a preference chooses among all, the curves of the poses at some angles about the axis are looked at.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from jacokin.ik.closest import ClosestSearch
from jacokin.ik.diagnosis import Outcome
from jacokin.ik.local_search import PositionDescents
from jacokin.ik.preferences import with_ties
from jacokin.ik.results import IKResult, Status
from jacokin.ik.solutions.members import Members
from jacokin.ik.solutions.search import SetSearch
from jacokin.ik.targets import Request, TargetPose
from jacokin.ik.verification import Effort, Verifier
from jacokin.model.angles import TURN, nearest_copy

#: [rad] between the angles that are looked at, at most.
SPACING = 0.3


class TurnedSearch:
    """Configurations of one arm at poses that may turn about an axis."""

    __slots__ = ("_at_poses", "_closest", "_descents", "_verifier")

    def __init__(self, verifier: Verifier, at_poses: SetSearch) -> None:
        """Take what finds the curves of a pose."""
        self._verifier, self._at_poses = verifier, at_poses
        self._closest, self._descents = ClosestSearch(verifier), PositionDescents(verifier)

    def solve(self, request: Request) -> IKResult:
        """A configuration of little cost, or why none was found; its parameter is the angle about the axis."""
        target, seed = request.target, request.seed
        members = Members(self._verifier, None, target, seed)
        beyond = self._closest.reach.exceeded(target)
        if beyond is not None:
            return self._at_poses.closest_to(request, members, None, beyond)
        found = self._descend(request, members) if request.cost is None else None
        if found is not None and not self._is_unwanted(found):
            return found
        first = target.nearest_angle(members.parameter(seed))
        angles, reached = _angles(target, first), list[IKResult]()
        for look in ([] if request.cost else [self._nearest_at]) + [self._at]:  # the former takes much less time
            tried = [look(request, angle) for angle in angles]
            reached = [result for result in tried if result is not None]
            clear = [result for result in reached if not self._is_unwanted(result)]
            if clear:
                costs = with_ties(request.cost, seed)(np.array([result.q for result in clear]))
                return clear[int(np.argmin(costs))]
        if found is not None or reached:
            return found or reached[0]
        outcome = Outcome(Status.NO_CONVERGENCE, f"reached at none of {len(angles)} angles about the axis")
        return self._at_poses.closest_to(request, members, None, outcome)

    def _descend(self, request: Request, members: Members) -> IKResult | None:
        """What a descent from the seed reaches; None for nothing."""
        verifier, robot = self._verifier, self._verifier.robot
        end = self._descents.descend(request.target, request.seed)
        effort = Effort(end.iterations, 1, self._descents.used)
        q = nearest_copy(end.q, request.seed, robot.unlimited & ~robot.sliding)
        candidates = (members.candidate(each, members.parameter(each))._replace(effort=effort) for each in (q, end.q))
        return verifier.select(candidates, request, "the configuration that was found is in contact")

    def _nearest_at(self, request: Request, angle: float) -> IKResult | None:
        """The member that is nearest to the seed of the curves at an angle; None where only all of them can tell."""
        turned = request.target.at(angle)
        member = self._at_poses.nearest(turned, request.seed)
        if member is None:
            return None
        candidates = iter([self._at_poses.members(turned, request.seed).candidate(*member)])
        return self._told(
            self._verifier.select(candidates, request, "the nearest member is in contact"), request, angle
        )

    def _at(self, request: Request, angle: float) -> IKResult | None:
        """The member of the least cost of the curves at an angle; None for none."""
        target = request.target
        found = self._at_poses.find(target.at(angle), request.seed)
        if not found.curves.intervals:
            return None
        candidates = found.candidates(request.cost, several=self._verifier.avoids_contact)
        result = self._verifier.select(candidates, request, "every member that was tried is in contact; the best one")
        return self._told(result, request, angle)

    def _told(self, result: IKResult | None, request: Request, angle: float) -> IKResult | None:
        """What was found at an angle about the axis, with that."""
        if result is None:
            return None
        angle = request.target.nearest_angle(angle)
        return replace(result, parameter=angle, message=f"at {angle:.6g} rad about the axis, {result.message}")

    def _is_unwanted(self, result: IKResult) -> bool:
        return bool(result.touching) and self._verifier.avoids_contact


def _angles(target: TargetPose, first: float) -> list[float]:
    """Angles all along the range of a free axis [rad], a first one before the others."""
    assert target.free_axis is not None
    low, high = target.free_axis.range
    if target.free_axis.full_turn:
        return [*np.linspace(first, first + TURN, math.ceil(TURN / SPACING), endpoint=False).tolist()]
    below, above = (np.linspace(first, end, 1 + math.ceil(abs(end - first) / SPACING)) for end in (low, high))
    return [*below.tolist(), *above[1:].tolist()]
