"""One answer out of the branches of a pose: the branch that is wanted, or why there is none."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING

import numpy as np

from jacokin.ik import diagnosis
from jacokin.ik.answers.choosing import Cost
from jacokin.ik.request import Request
from jacokin.ik.results import IKResult, Status
from jacokin.ik.verification import Verifier

if TYPE_CHECKING:
    from jacokin.ik.closed_form import BranchTable
    from jacokin.ik.closest.search import ClosestSearch


def of_branches(
    rows: BranchTable,
    verifier: Verifier,
    request: Request,
    cost: Cost | None,
    closest: Callable[[], ClosestSearch],
) -> IKResult:
    """The branch within the limits of the least cost, or the status that says why there is none.

    Args:
        rows: every branch, nearest to the seed first.
        verifier: measures the result, and looks for contact.
        request: what was asked for.
        cost: what makes a branch better than another, see `choosing`; None for the distance to the seed.
        closest: makes what looks for the closest configuration where there is no branch.
    """
    target = request.target
    touched: IKResult | None = None
    for index in _order(rows, cost):
        q = rows.configuration(index)
        errors = verifier.measure(q, target)
        if not verifier.reached(q, errors):
            continue
        pairs = verifier.touching(q)
        if not (pairs and verifier.rejects_contact):
            message = request.message(f"branch {index + 1} of {len(rows)}")
            return verifier.result(q, Status.OK, errors, message, touching=pairs)
        if touched is None:
            status, why = diagnosis.of_contact("every branch within the limits is in contact; the best", pairs)
            touched = verifier.result(q, status, errors, request.message(why), touching=pairs)
    if touched is not None:
        return touched
    outcome = diagnosis.of_branches(rows, verifier.robot.joint_names)
    if request.closest:
        nearby = [np.clip(q, verifier.robot.lower, verifier.robot.upper) for q in rows.q]
        return closest().result(request, outcome, nearby)
    errors = verifier.measure(request.seed, target)
    return verifier.result(request.seed.copy(), outcome.status, errors, request.message(outcome.message))


def _order(rows: BranchTable, cost: Cost | None) -> Iterable[int]:
    """Indices of the branches within the limits, best first; equal ones nearest to the seed first."""
    if cost is None:
        return rows.each_within_limits()
    indices = list(rows.each_within_limits())
    if not indices:
        return indices
    order: list[int] = np.array(indices)[np.argsort(cost(rows.q[indices]), kind="stable")].tolist()
    return order
