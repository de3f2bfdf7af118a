"""Solving by the QP: from the seed, from home, from members of families where there are any, from random starts."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import chain

import numpy as np

from jacokin.arrays import Array
from jacokin.ik import diagnosis, seeds
from jacokin.ik.closest.search import ClosestSearch
from jacokin.ik.diagnosis import Outcome
from jacokin.ik.families import positions
from jacokin.ik.qp.multistart import Attempt, MultiStartQP
from jacokin.ik.request import Request, joined
from jacokin.ik.results import IKResult, Status
from jacokin.ik.targets import TargetPose
from jacokin.ik.verification import Verifier
from jacokin.model import angles


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
        failure = diagnosis.of_descents(attempt)
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
        yield from positions.members(self._nearest, request.target.position, rotation, request.seed)

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
