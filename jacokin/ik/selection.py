"""From everything that reaches a target to the one configuration that is wanted, or why there is none."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from jacokin.arrays import Array
from jacokin.ik import diagnosis, targets
from jacokin.ik.preferences import Cost
from jacokin.ik.request import Request
from jacokin.ik.results import IKResult, Status
from jacokin.ik.targets import TargetPose
from jacokin.ik.verification import Verifier
from jacokin.model import angles
from jacokin.model.angles import TURN
from jacokin.model.poses import FreeAxis

if TYPE_CHECKING:
    from jacokin.ik.closed_form import Branches
    from jacokin.ik.closest import ClosestSearch
    from jacokin.ik.families.search import Findings


def of_branches(
    rows: Branches,
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
        q = rows.q[index]
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


def _order(rows: Branches, cost: Cost | None) -> Iterable[int]:
    """Indices of the branches within the limits, best first; equal ones nearest to the seed first."""
    if cost is None:
        return rows.each_within_limits()
    indices = list(rows.each_within_limits())
    if not indices:
        return indices
    order: list[int] = np.array(indices)[np.argsort(cost(rows.q[indices]), kind="stable")].tolist()
    return order


#: Members of each interval that are looked at where the best one is in contact.
TRIED = 16
#: Times that a search for the closest configuration turns the target to where it has come.
AIMS = 4
#: [rad] a target turned by less than this is the same.
SAME_AIM = 1e-3


def nearest_member(
    member: tuple[Array, float] | None, target: FreeAxis | TargetPose, verifier: Verifier, request: Request
) -> IKResult | None:
    """The result of a member that a search for the nearest one found; None where it is no success.

    Args:
        member: joints (dof,) and parameter [rad], or None.
        target: what has the family.
        verifier: measures the result, and looks for contact.
        request: the note about its seed.
    """
    if member is None:
        return None
    q, p = member
    pose = target
    if isinstance(target, FreeAxis):
        p = float(angles.wrap_to_pi(p)) if target.full_turn else _inside(target, p)
        pose = TargetPose(target.matrix_at(p), position_only=False)
    assert isinstance(pose, TargetPose)
    errors = verifier.measure(q, pose)
    if not verifier.reached(q, errors):
        return None
    message = request.message(f"parameter {p:.6g} rad")
    return verifier.result(q, Status.OK, errors, message, touching=verifier.touching(q), parameter=p)


def of_findings(
    found: Findings, verifier: Verifier, request: Request, cost: Cost, closest: Callable[[], ClosestSearch]
) -> IKResult:
    """The member of the least cost, or the status that says why there is none.

    Args:
        found: everything that reaches the target.
        verifier: measures the result, and looks for contact.
        request: seed, and how hard to try; its target is not used.
        cost: of configurations, see `choosing`.
        closest: makes what looks for the closest configuration where there is no member.
    """
    touched: IKResult | None = None
    for q, p in _candidates(found, request.seed, cost, several=verifier.rejects_contact):
        if not isinstance(found.members.target, FreeAxis):
            p = found.members.parameter(q)  # joint 3 itself, in its copy
        elif found.members.target.full_turn:
            p = float(angles.wrap_to_pi(p))
        errors = verifier.measure(q, found.members.pose_at(p))
        if not verifier.reached(q, errors):
            continue
        pairs = verifier.touching(q)
        message = request.message(f"parameter {p:.6g} rad")
        if not (pairs and verifier.rejects_contact):
            return verifier.result(q, Status.OK, errors, message, touching=pairs, parameter=p)
        if touched is None:
            status, why = diagnosis.of_contact("every member that was tried is in contact; the best one", pairs)
            touched = verifier.result(q, status, errors, request.message(why), touching=pairs, parameter=p)
    return _failure(found, verifier, request, closest) if touched is None else touched


def _candidates(found: Findings, seed: Array, cost: Cost, *, several: bool) -> Iterator[tuple[Array, float]]:
    """Members and their parameters, the best one first; one, or several of each interval."""
    best = found.family.choose(cost, seed)
    if best is None:
        return
    yield best
    if not several:
        return
    rows: list[Array] = []
    parameters: list[float] = []
    for interval in found.family:
        for p, q in zip(*interval.sample(TRIED), strict=True):
            rows.append(found.members.copies(q, seed))
            parameters.append(float(p))
    for index in np.argsort(cost(np.array(rows)), kind="stable").tolist():
        yield rows[index], parameters[index]


def _failure(found: Findings, verifier: Verifier, request: Request, closest: Callable[[], ClosestSearch]) -> IKResult:
    """Why there is no member; with the closest configuration, if it is wanted."""
    mildest = found.mildest()
    if mildest is not None and not mildest.excess.any():
        q, p = found.members.copies(mildest.q, request.seed), mildest.parameter
        errors, pairs = verifier.measure(q, found.members.pose_at(p)), verifier.touching(q)
        if verifier.reached(q, errors) and not (pairs and verifier.rejects_contact):
            p = p if isinstance(found.members.target, FreeAxis) else found.members.parameter(q)
            message = request.message(f"parameter {p:.6g} rad")
            return replace(verifier.result(q, Status.OK, errors, message, touching=pairs), parameter=p)
    outcome = diagnosis.of_family(found.family.complete, found.family.branches, mildest, verifier.robot.joint_names)
    target = found.members.target
    p = _inside(target, 0.0 if mildest is None else mildest.parameter)
    if not request.closest:
        errors = verifier.measure(request.seed, found.members.pose_at(p))
        message = request.message(outcome.message)
        return verifier.result(request.seed.copy(), outcome.status, errors, message, parameter=p)
    nearby = [] if mildest is None else [mildest.q]
    best: IKResult | None = None
    for _ in range(AIMS if isinstance(target, FreeAxis) else 1):
        result = closest().result(request._replace(target=found.members.pose_at(p)), outcome, nearby)
        if best is None or result.success or _error(result) < _error(best):
            best = replace(result, parameter=p if isinstance(target, FreeAxis) else float(result.q[2]))
        if best.success:
            break
        last, p, nearby = p, _inside(target, found.members.parameter(result.q)), [result.q]
        if abs(p - last) < SAME_AIM:
            break
    assert best is not None  # there is always a first aim
    return best


def _error(result: IKResult) -> float:
    return targets.combined_error(result.position_error, result.orientation_error)


def _inside(target: object, p: float) -> float:
    """The parameter in the range of a target that is nearest to a value, up to whole turns."""
    if not isinstance(target, FreeAxis):
        return p
    low, high = target.range
    moved = p + TURN * round((0.5 * (low + high) - p) / TURN)
    return min(max(moved, low), high)
