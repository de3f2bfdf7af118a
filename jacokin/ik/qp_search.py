"""Answers by the QP alone: from the seed, from home, from random starts; and the closest pose when none reaches."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from jacokin.ik import seeds, targets
from jacokin.ik.judge import Judge, joined, pair_names
from jacokin.ik.qp import Attempt, MultiStartQP
from jacokin.ik.results import IKResult, Status
from jacokin.ik.targets import Target

Array = NDArray[np.float64]

CLOSEST_STARTS = 20  # descents while looking for the closest configuration


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

    def solve(
        self, target: Target, start: Array, note: str, rng: np.random.Generator, restarts: int, closest: bool
    ) -> IKResult:
        """Start after start until one reaches the target free of contact, if that matters."""
        first = [start] if start is self._robot.home else [start, self._robot.home]
        starts = seeds.starts(self._robot, first, restarts, rng)
        touched: IKResult | None = None
        if self._judge.rejects_contact:
            attempt, touched = self._clear_of_contact(target, start, list(starts), note)
        else:
            attempt = self.qp.solve(target, starts)
        if touched is not None:
            return touched
        if attempt.reached:
            return self._result(attempt, Status.OK, target, start, note)
        if attempt.failed:
            return self._result(
                attempt, Status.SOLVER_ERROR, target, start, joined("no QP solver solved the step", note)
            )
        message = joined(f"{attempt.starts} starts ended in local minima", note)
        if not closest:
            return self._result(attempt, Status.NO_CONVERGENCE, target, start, message)
        return self.closest(target, [attempt.q], start, Status.NO_CONVERGENCE, message, rng, before=attempt)

    def closest(
        self,
        target: Target,
        nearby: list[Array],
        start: Array,
        status: Status,
        message: str,
        rng: np.random.Generator,
        before: Attempt | None = None,
    ) -> IKResult:
        """The closest legal configuration; a success after all if it meets the tolerances."""
        starts = seeds.starts(self._robot, [*nearby, start], max(CLOSEST_STARTS - 1, len(nearby)), rng)
        attempt = self.qp.closest(target, starts, before)
        result = self._result(attempt, status, target, start, message)
        errors = (result.position_error, result.orientation_error)
        if self._judge.reached(result.q, errors) and not (result.touching and self._judge.rejects_contact):
            return self._result(attempt, Status.OK, target, start, "found by the QP at the edge of reach")
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
        q = targets.nearest_copy(attempt.q, start, self._robot.free)
        errors = self._judge.measure(q, target)
        if status is Status.OK and not self._judge.reached(q, errors):
            q, errors = attempt.q, (attempt.position_error, attempt.orientation_error)
        return self._judge.result(q, status, errors, message, attempt=attempt, touching=self._judge.touching(q))
