"""Why a target is not reached: the one place that chooses UNREACHABLE, OUTSIDE_LIMITS, IN_COLLISION and the others."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from jacokin.arrays import Array
from jacokin.ik.results import Status

if TYPE_CHECKING:
    from jacokin.ik.options import SolverOptions
    from jacokin.ik.solutions.points import Points

NEARLY = 1e-3  # [m] or [rad] of a target in few digits: those of 1.571 leave 2e-4
NAMED_PAIRS = 3  # in a message; the result's `touching` has all


class Outcome(NamedTuple):
    """A status and the sentence with the numbers of this solve."""

    status: Status
    message: str


class LimitExcess(NamedTuple):
    """A configuration that reaches a target, and by how much it is beyond the limits."""

    q: Array
    """(dof,) moved onto the limits it breaks [rad]."""
    excess: Array
    """(dof,) beyond the limits [rad], 0 within them."""
    parameter: float
    """Value of the free parameter [rad]."""


def explain_branches(rows: Points, joint_names: Sequence[str]) -> Outcome:
    """When no branch of the closed form is a success: there is none, or each breaks a limit, or some may be missing."""
    if rows.dropped:
        return Outcome(
            Status.NO_CONVERGENCE,
            f"none of the {len(rows)} branches found is within the limits, and some may be missing",
        )
    if not len(rows):
        return Outcome(Status.UNREACHABLE, "no configuration reaches this pose, whatever the limits")
    within = rows.within_limits
    if within.any():
        return Outcome(
            Status.NO_CONVERGENCE,
            f"a branch within the limits misses the target by {rows.position_error[within].min():.3g} m and "
            f"{rows.orientation_error[within].min():.3g} rad, which is rounding and more than the tolerances allow",
        )
    excess = np.maximum(-rows.margin, 0.0)
    exceeded = _exceeded(joint_names, excess[np.argmin(excess.max(axis=1))])
    return Outcome(
        Status.OUTSIDE_LIMITS,
        f"each of the {len(rows)} branches is outside the limits; the closest one exceeds {exceeded}",
    )


def explain_curves(complete: bool, branches: int, least: LimitExcess | None, joint_names: Sequence[str]) -> Outcome:
    """When no member of a curve is a success: nothing reaches the target, or every branch breaks a limit throughout.

    Args:
        complete: whether no curve is missing.
        branches: how many there are.
        least: where they come nearest to the limits; None without branches.
        joint_names: (dof,).
    """
    if not complete:
        return Outcome(
            Status.NO_CONVERGENCE,
            f"none of the {branches} branches found is within the limits, and some curves were lost",
        )
    if least is None:
        return Outcome(Status.UNREACHABLE, "no configuration reaches the target, whatever the parameter and the limits")
    exceeded = _exceeded(joint_names, least.excess)
    return Outcome(
        Status.OUTSIDE_LIMITS,
        f"each of the {branches} branches is outside the limits for every value of the parameter; the closest one "
        f"exceeds {exceeded}, at parameter {least.parameter:.6g} rad",
    )


def _exceeded(joint_names: Sequence[str], excess: Array) -> str:
    """Which joints are beyond their limits, and by how much."""
    return "the limits of " + ", ".join(
        f"{name} by {by:.6g} rad" for name, by in zip(joint_names, excess.tolist(), strict=True) if by > 0.0
    )


def explain_descents(starts: int, best: tuple[float, float], options: SolverOptions, *, failed: bool) -> Outcome:
    """When no descent of the QP reaches the target: it may be reachable all the same, or the solver itself failed.

    Args:
        starts: how many there were.
        best: position [m] and orientation error [rad] of the end that came nearest.
        options: the solver's, with its tolerances.
        failed: whether no QP solver solved the step.
    """
    if failed:
        return Outcome(Status.SOLVER_ERROR, "no QP solver solved the step")
    missed = explain_near_miss(best, options)
    if not missed:
        return Outcome(Status.NO_CONVERGENCE, f"{starts} starts ended in local minima")
    what = f"what comes nearest after {starts} start{'s' if starts > 1 else ''}"
    return Outcome(Status.NO_CONVERGENCE, f"{what} {missed}")


def explain_near_miss(errors: tuple[float, float], options: SolverOptions) -> str:
    """By how much a target in few digits is missed, and which tolerances accept it; "" for one that is far off.

    Args:
        errors: of position [m] and orientation [rad].
        options: the solver's, with its tolerances.
    """
    tolerances = ("position_tolerance", "m"), ("orientation_tolerance", "rad")
    missed = [(*each, by) for each, by in zip(tolerances, errors, strict=True) if by > getattr(options, each[0])]
    if max(errors) > NEARLY or not missed:
        return ""
    by_how_much = " and ".join(f"{_short(by)} {unit}" for _, unit, by in missed)
    accepting = ", ".join(f"{name}=1e{math.ceil(math.log10(by))}" for name, _, by in missed)
    return f"misses by {by_how_much}: {accepting} accept{'s' if len(missed) == 1 else ''} it"


def _short(value: float) -> str:
    """A small number in two digits, such as 7.3e-6."""
    return f"{value:.1e}".replace("e-0", "e-")


def explain_contact(what: str, nearest: Sequence[tuple[str, str]]) -> str:
    """When every configuration that reaches the target is in contact: the message that goes with IN_COLLISION.

    Args:
        what: which configurations those are, and which one is named.
        nearest: the pairs of shapes that touch at that one.
    """
    named = ", ".join(f"{a} and {b}" for a, b in nearest[:NAMED_PAIRS])
    more = len(nearest) - NAMED_PAIRS
    return f"{what} at {named} and {more} more pair{'s' if more > 1 else ''}" if more > 0 else f"{what} at {named}"


def diagnose_posture(within_limits: bool, touching: Sequence[tuple[str, str]]) -> Status:
    """What keeps a configuration that somebody chose by hand, and that is at its target, from counting as reached."""
    if not within_limits:
        return Status.OUTSIDE_LIMITS
    return Status.IN_COLLISION if touching else Status.OK
