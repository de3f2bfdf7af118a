"""Answers by the QP alone: from the seed, from home, from random starts; and the closest pose when none reaches."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from jacokin.ik import seeds, targets
from jacokin.ik.qp.multistart import Attempt, MultiStartQP
from jacokin.ik.results import IKResult, Status
from jacokin.ik.targets import Target
from jacokin.ik.verification import Judge, joined, pair_names

Array = NDArray[np.float64]

CLOSEST_STARTS = 20  # descents besides those from the branches while looking for the closest configuration
FARTHEST = 10.0  # arm lengths: from there on only the direction to the target matters
REACH_SLACK = 1e-3  # [m] more than any tolerance: a bound that can be trusted


class QPSearch:
    """mink's QP on one robot, frame and tool, and what its attempts mean.

    Attributes:
        qp: the QP, built once.
    """

    def __init__(self, judge: Judge) -> None:
        """Build the QP.

        Raises:
            UnknownNameError: the QP solver is not installed.
        """
        settings = judge.settings
        self._judge = judge
        self._robot = judge.robot
        self.qp = MultiStartQP(
            judge.robot,
            judge.frame,
            judge.tool,
            settings.qp_solver,
            settings.position_tolerance,
            settings.orientation_tolerance,
        )
        self._shoulder, self._length = _reach(judge)

    def solve(
        self, target: Target, start: Array, note: str, rng: np.random.Generator, restarts: int, closest: bool
    ) -> IKResult:
        """Start after start until one reaches the target free of contact, if that matters."""
        first = [start] if start is self._robot.home else [start, self._robot.home]
        if self.beyond_reach(target):
            message = "the target is farther away than the arm is long"
            if closest:
                return self.closest(target, first, start, Status.UNREACHABLE, message, note, rng)
            untried = Attempt(start, *self._judge.measure(start, target), False, 0, 1, self.qp.backend.name)
            return self._result(untried, Status.UNREACHABLE, target, start, joined(message, note))
        starts = seeds.starts(self._robot, first, restarts, rng)
        touched: IKResult | None = None
        if self._judge.rejects_contact:
            attempt, touched = self._clear_of_contact(target, start, list(starts), note)
        else:
            attempt = self.qp.solve(target, starts)
        if touched is not None:
            return touched
        if attempt.reached:
            message = joined(f"start {attempt.starts}, {attempt.iterations} iterations", note)
            return self._result(attempt, Status.OK, target, start, message)
        if attempt.failed:
            return self._result(
                attempt, Status.SOLVER_ERROR, target, start, joined("no QP solver solved the step", note)
            )
        message = f"{attempt.starts} starts ended in local minima"
        if not closest:
            return self._result(attempt, Status.NO_CONVERGENCE, target, start, joined(message, note))
        return self.closest(target, [attempt.q], start, Status.NO_CONVERGENCE, message, note, rng, before=attempt)

    def beyond_reach(self, target: Target) -> bool:
        """Whether the target is provably out of reach: farther from joint 1 than the links laid end to end."""
        return math.hypot(*(target.position - self._shoulder).tolist()) > self._length + REACH_SLACK

    def _pulled_in(self, target: Target) -> Target:
        """A target very far away, moved along the line of sight to where arithmetic still means something."""
        away = target.position - self._shoulder
        distance = math.hypot(*away.tolist())
        if not distance > FARTHEST * self._length:
            return target
        matrix = target.matrix.copy()
        matrix[:3, 3] = self._shoulder + away / distance * (FARTHEST * self._length)
        return Target(matrix, target.position_only)

    def closest(
        self,
        target: Target,
        nearby: list[Array],
        start: Array,
        status: Status,
        message: str,
        note: str,
        rng: np.random.Generator,
        before: Attempt | None = None,
    ) -> IKResult:
        """The closest legal configuration; a success after all if it meets the tolerances."""
        starts = seeds.starts(self._robot, [*nearby, start], len(nearby) + CLOSEST_STARTS - 1, rng)
        attempt = self.qp.closest(self._pulled_in(target), starts, before)
        result = self._result(attempt, status, target, start, joined(message, note))
        errors = (result.position_error, result.orientation_error)
        if self._judge.reached(result.q, errors) and not (result.touching and self._judge.rejects_contact):
            message = joined("found by the QP while looking for the closest pose", note)
            return self._result(attempt, Status.OK, target, start, message)
        return result

    def _clear_of_contact(
        self, target: Target, start: Array, starts: list[Array], note: str
    ) -> tuple[Attempt, IKResult | None]:
        """The first attempt that reaches without self-contact; else the first that reaches, as IN_COLLISION."""
        touched: tuple[Attempt, str] | None = None
        total: Attempt | None = None
        for q in starts:
            attempt = self.qp.solve(target, [q], total)
            total = attempt
            if not attempt.reached:
                continue
            # Contact is the same in every 2 pi copy of a free joint.
            pairs = self._judge.touching(attempt.q)
            if not pairs:
                return attempt, None
            touched = touched or (attempt, pair_names(pairs))
        assert total is not None  # there is always a first start
        if touched is None:
            return total, None
        message = joined(f"every configuration found touches itself; the first at {touched[1]}", note)
        return total, self._result(touched[0], Status.IN_COLLISION, target, start, message)

    def _result(self, attempt: Attempt, status: Status, target: Target, start: Array, message: str) -> IKResult:
        """An attempt in the 2 pi copies nearest to the start, measured again there."""
        q = targets.nearest_copy(attempt.q, start, self._robot.unlimited)
        errors = self._judge.measure(q, target)
        if status is Status.OK and not self._judge.reached(q, errors):
            q, errors = attempt.q, (attempt.position_error, attempt.orientation_error)
        return self._judge.result(q, status, errors, message, attempt=attempt, touching=self._judge.touching(q))


def _reach(judge: Judge) -> tuple[Array, float]:
    """Origin of joint 1 in the base, and the links laid end to end from there [m]; inf when a slide has no limits."""
    model = judge.robot.pin_model
    lengths = [float(np.linalg.norm(model.jointPlacements[joint].translation)) for joint in range(2, model.njoints)]
    placed = model.frames[judge.robot.frame_id(judge.frame)].placement
    tip = placed if judge.tool is None else placed * judge.tool
    lengths.append(float(np.linalg.norm(tip.translation)))
    slides = [joint for joint in range(1, model.njoints) if "Prismatic" in model.joints[joint].shortname()]
    lengths.extend(float(max(abs(judge.robot.lower[j - 1]), abs(judge.robot.upper[j - 1]))) for j in slides)
    return np.array(model.jointPlacements[1].translation), sum(lengths)
