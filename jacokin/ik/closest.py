"""`ClosestSearch`: the configuration within the limits that comes closest to a target that is not reached.

Random configurations are drawn, and the nearest of them descend, together with those that the caller has. After each
stage the worse ones are dropped, and those that have met. Most minima are reached from many starts, so that the least
one is seldom missed; `python -m benchmarks.closest` counts how often. The kernel `kernels.closest` does it.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from jacokin.arrays import Array
from jacokin.ik import seeds
from jacokin.ik.diagnosis import Outcome, explain_near_miss
from jacokin.ik.results import IKResult, Status
from jacokin.ik.targets import RADIAN_IN_METRES, Request, TargetPose, combined_error
from jacokin.ik.verification import Candidate, Effort, Verifier
from jacokin.kernels.closest import ClosestWork, find_closest, make_closest_work
from jacokin.kernels.library import Call
from jacokin.model import angles
from jacokin.model.kinematics import axis_of

REACH_SLACK = 1e-3  # [m] beyond the tolerance: a bound that can be trusted
FARTHEST = 10.0  # arm lengths: from there on only the direction to the target matters
AIMS = 4  # times that a target with a free axis is turned to where the search has come


class ClosestSearch:
    """The search for one robot, frame and tool; immutable, and may be shared between threads."""

    def __init__(self, verifier: Verifier) -> None:
        """Take the arm."""
        self._verifier = verifier
        self._robot = verifier.robot
        self._circular = verifier.robot.unlimited & ~verifier.robot.sliding

    @functools.cached_property
    def reach(self) -> ReachBound:
        """What the tool cannot leave."""
        return ReachBound(self._verifier)

    def solve(
        self, request: Request, outcome: Outcome, nearby: Sequence[Array], before: Effort | None = None
    ) -> IKResult:
        """The closest configuration, or the seed where none is asked for; a success after all if it is one.

        Where it is not known whether the target is reached, it is looked for in any case: the status does not depend on
        what is asked for.

        Args:
            request: what was asked for, with a pose or a position as its target.
            outcome: why it is not reached.
            nearby: configurations (dof,) within the limits to descend from, besides the seed and random ones.
            before: what was tried already; its counts go on.
        """
        verifier, target, seed = self._verifier, request.target, request.seed
        message = request.message(outcome.message)
        if not request.closest and outcome.status is not Status.NO_CONVERGENCE:
            return verifier.result(Candidate(seed, target, ""), outcome.status, message)
        found, effort = self.find(self.reach.pulled_in(target), [*nearby, seed], request.generator())
        if before is not None:
            effort = Effort(effort.iterations + before.iterations, effort.starts + before.starts, before.qp_solver)
        q = angles.nearest_copy(found, seed, self._circular)
        closest = Candidate(q, target, "found while looking for the closest configuration", effort=effort)
        result = verifier.select([closest], request, "")
        if result is not None and result.success:
            return result
        if not request.closest:
            return verifier.result(Candidate(seed, target, ""), outcome.status, message)
        errors = verifier.measure(q, target)
        if outcome.status is Status.UNREACHABLE and (missed := explain_near_miss(errors, verifier.options)):
            message = request.message(f"{outcome.message}; the closest one {missed}")
        return verifier.result(closest, outcome.status, message, errors, verifier.touching(q))

    def solve_about(
        self,
        request: Request,
        outcome: Outcome,
        nearby: Sequence[Array],
        angle: float,
        before: Effort | None = None,
    ) -> IKResult:
        """`solve` for a target with a free axis, beginning at an angle [rad] that follows where the closest one is."""
        target, results = request.target, list[IKResult]()
        for _ in range(AIMS if request.closest else 1):
            result = self.solve(request._replace(target=target.at(angle)), outcome, nearby, before)
            results.append(replace(result, parameter=angle))
            last, angle, nearby = angle, target.angle_of(self._verifier.tool_pose(result.q)), [result.q]
            if result.success or abs(angle - last) < 1e-3:  # [rad] a target turned by less than this is the same
                break
        return min(results, key=lambda each: (not each.success, _error(each)))

    def beyond_reach(self, request: Request) -> IKResult | None:
        """The answer to a pose or a position that is provably out of reach; None for others."""
        outcome = self.reach.exceeded(request.target)
        return None if outcome is None else self.solve(request, outcome, ())

    def find(
        self, target: TargetPose, first: Sequence[Array], rng: np.random.Generator, *, position_first: bool = False
    ) -> tuple[Array, Effort]:
        """The configuration (dof,) within the limits of the least measure that descents end in, and what they took.

        Args:
            target: what to come close to.
            first: configurations (dof,) within the limits to descend from in any case.
            rng: draws the others.
            position_first: whether the position goes before everything: of what reaches it, the least turned is taken.
        """
        starts = np.vstack([*first, seeds.random_configurations(self._robot, 1000, rng)])
        work = self.work(target, len(starts))
        if position_first:
            work.weight[0] = 1e-3  # [m/rad] too little for an orientation to be worth a position that is missed
        work.starts[:], work.counts[0] = starts.ravel(), len(first)
        descended = Call(find_closest, work)()
        return work.starts[: self._robot.dof].copy(), Effort(int(work.counts[1]), descended)

    def work(self, target: TargetPose, starts: int) -> ClosestWork:
        """What the kernel works on: the arm, the target, and room for so many starts."""
        robot, weight = self._robot, 0.0 if target.position_only else RADIAN_IN_METRES
        return make_closest_work(robot.dof, starts)._replace(
            weight=np.array([weight]),
            arm=self._verifier.chain.arm,
            circular=self._circular.astype(np.int64),
            lower=robot.lower,
            upper=robot.upper,
            T=np.array(target.matrix),
        )


def _error(result: IKResult) -> float:
    return combined_error(result.position_error, result.orientation_error)


class ReachBound:
    """A ball around a point of joint 1 that the tool cannot leave, whatever the joint angles."""

    def __init__(self, verifier: Verifier) -> None:
        """Add up the links; the radius is infinite when a sliding joint has no limits."""
        model, robot = verifier.robot.pin_model, verifier.robot
        placed = model.frames[verifier.frame_id].placement
        tip = placed if verifier.tool is None else placed * verifier.tool
        count = int(model.frames[verifier.frame_id].parentJoint)
        places = [model.jointPlacements[joint] for joint in range(1, count + 1)] + [tip]
        links = [place.translation for place in places[1:]]  # from each joint to the next, in its own axes
        centre = np.zeros(3)
        axes = [None if axis.slides else axis.direction for axis in (axis_of(model, k + 1) for k in range(count))]
        if axes[0] is not None:  # any point of its axis stays where it is: the one that is nearest to joint 2
            centre = axes[0] * float(axes[0] @ links[0])
            links[0] = links[0] - centre
        self._shoulder: Array = places[0].act(centre)
        self._centre = tuple(self._shoulder.tolist())
        self._slack = REACH_SLACK + verifier.options.position_tolerance
        travel = np.where(robot.sliding, np.maximum(np.abs(robot.lower), np.abs(robot.upper)), 0.0)[:count]
        self._radius = _longest(links, [place.rotation for place in places], axes) + float(travel.sum())

    def exceeded(self, target: TargetPose) -> Outcome | None:
        """When the target is provably out of reach, whatever the joint angles."""
        _, _, _, x, _, _, _, y, _, _, _, z, *_ = target.matrix.ravel().tolist()
        if math.dist((x, y, z), self._centre) <= self._radius + self._slack:
            return None
        return Outcome(Status.UNREACHABLE, "the target is farther away than the arm is long")

    def pulled_in(self, target: TargetPose) -> TargetPose:
        """A target very far away, moved along the line of sight to where its errors are still exact to a micrometre."""
        away = target.position - self._shoulder
        distance = math.hypot(*away.tolist())
        if not distance > FARTHEST * self._radius:
            return target
        return target.moved_to(self._shoulder + away / distance * (FARTHEST * self._radius))


def _longest(links: Sequence[Array], rotations: Sequence[Array], axes: Sequence[Array | None]) -> float:
    """A length [m] that a chain of links cannot exceed: that of links, or of pairs about the joint between, end to end.

    Args:
        links: (3,) from each joint to the next, in its own axes [m].
        rotations: (3, 3) of each joint in the one before, at zero.
        axes: (3,) of each joint, a unit vector; None for one that slides.
    """
    lengths = [float(np.linalg.norm(link)) for link in links]
    least = [0.0, 0.0]  # of the rest of the chain: from the next link on, and from the one after
    for k in reversed(range(len(links))):
        whole = lengths[k] + least[0]
        axis = axes[k + 1] if k + 1 < len(links) else None
        if axis is not None:
            before, after = rotations[k + 1].T @ links[k], links[k + 1]
            along = float(axis @ (before + after))
            across = sum(float(np.linalg.norm(each - axis * (axis @ each))) for each in (before, after))
            whole = min(whole, math.hypot(along, across) + least[1])
        least = [whole, least[0]]
    return least[0]
