"""Branches of an arm that nearly has a continuum of them, such as a wrist whose axes miss each other by a hair.

Where the axes of a straight wrist meet, joints 4 and 6 may turn against each other. Where they nearly do, what remains
of the closure along that way is small, and has zeros: those are branches, singular ones, and neighbours of the arm do
not have them. From each branch that is nearly singular the way is followed while so little remains, and from those of a
target beside this one, which has branches where this one may have none on a way. One joint is moved, and the others
follow by least squares: what remains is then a length with a sign, whose changes are found.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.branches import (
    COLUMNS,
    FAMILY,
    MAX_BRANCHES,
    BranchWork,
    PoseQuery,
    add_branch,
    add_fold,
    jacobian_determinant,
    make_branches,
)
from jacokin.kernels.closed_form.folds import sample
from jacokin.kernels.limits import TURN, circular_distance
from jacokin.kernels.six_joints.loop import rotation_about
from jacokin.kernels.tolerances import CLOSURE, NEAR_CONTINUUM, NEARLY_SINGULAR_DETERMINANT

#: Steps of a turn, and how near the way passes by another branch that is on it, part of a step.
STEPS_OF_TURN, ON_THE_WAY = 48, 0.6
STEP = TURN / STEPS_OF_TURN
#: Turns a target to one beside it [rad].
BESIDE = rotation_about((0.48, 0.6, 0.64), 5e-3)
#: Where what remains is larger than this part of its change by a step, there is no zero.
TOUCHING = 1e-3
BRACKETED_STEPS = 40


class NearContinua(NamedTuple):
    """The branches to begin from, and where one way is."""

    T: Array  # (4, 4) the target beside
    beside: BranchWork  # its branches
    begun: Array  # (48, 6) [rad] nearly singular branches that are not yet on a way
    filled: NDArray[np.int64]  # (1,) how many
    begin: Array  # (6,) where the way at hand begins
    q: Array  # (3, 6) two, one and no steps ago [rad]
    rest: Array  # (3, 7) deviations there
    spare: Array  # (7,)


def make_near_continua() -> NearContinua:
    """Fresh work arrays."""
    return NearContinua(
        np.eye(4),
        make_branches(np.empty((MAX_BRANCHES, COLUMNS))),
        np.empty((2 * MAX_BRANCHES, 6)),
        np.zeros(1, np.int64),
        np.empty(6),
        np.empty((3, 6)),
        np.empty((3, 7)),
        np.empty(7),
    )


def target_beside(query: PoseQuery, work: NearContinua) -> PoseQuery:
    """The target turned a little about an axis that is none of its own; its branches are begun anew."""
    for row in range(3):
        x, y, z = query.T[row, 0], query.T[row, 1], query.T[row, 2]
        for column in range(3):
            work.T[row, column] = x * BESIDE[0, column] + y * BESIDE[1, column] + z * BESIDE[2, column]
        work.T[row, 3] = query.T[row, 3]
    beside = work.beside
    beside.filled[0], beside.filled[1], beside.fold.filled[0], beside.lanes.filled[0] = 0, 0, 0, 0
    return PoseQuery(query.chain, query.limits, work.T, query.seed)


def begin_from(query: PoseQuery, work: NearContinua, branches: BranchWork) -> None:
    """Take down the branches of a target that are nearly singular."""
    for i in range(branches.filled[0]):
        for j in range(6):
            branches.newton.q[j] = branches.rows[i, j]
        size = abs(jacobian_determinant(query.chain, query.T, branches.newton))
        if branches.rows[i, FAMILY] == 0.0 and size < NEARLY_SINGULAR_DETERMINANT:
            for j in range(6):
                work.begun[work.filled[0], j] = branches.rows[i, j]
            work.filled[0] += 1


def add_along_near_continua(query: PoseQuery, work: NearContinua, branches: BranchWork) -> int:
    """Add the branches along all ways that nearly are continua.

    Returns:
        How many ways there are, -1 where a zero on one leads to no branch.
    """
    followed, settled = 0, True
    while work.filled[0] > 0:
        work.filled[0] -= 1
        for j in range(6):
            work.q[2, j] = work.begun[work.filled[0], j]
        joint = joint_along(query, work, branches)
        if joint >= 0:
            followed += 1
            settled = follow(query, work, branches, joint) and settled
    return followed if settled else -1


def follow(query: PoseQuery, work: NearContinua, branches: BranchWork, joint: int) -> bool:
    """Follow the way from q to both sides, or once around; False where a zero on it leads to no branch."""
    settled = True
    for j in range(6):
        work.begin[j] = work.q[2, j]
    for side in range(2):
        steps, zeros = steps_to_side(query, work, branches, joint, STEP if side == 0 else -STEP)
        settled = settled and zeros
        if steps > STEPS_OF_TURN:
            break
    return settled


def joint_along(query: PoseQuery, work: NearContinua, branches: BranchWork) -> int:
    """The joint whose step from q leaves least of the closure, once the others follow; -1 where much remains."""
    best, least = -1, NEAR_CONTINUUM**2
    for joint in range(6):
        for j in range(6):
            branches.newton.q[j] = work.q[2, j]
            branches.newton.held[j] = 1.0 if j == joint else 0.0
        branches.newton.q[joint] += STEP
        if sample(query.chain, query.T, branches.newton, work.spare):
            square = product_of(work.spare, work.spare)
            if square < least:
                best, least = joint, square
    return best


def steps_to_side(
    query: PoseQuery, work: NearContinua, branches: BranchWork, joint: int, step: float
) -> tuple[int, bool]:
    """Follow the way to one side; returns the number of steps, and whether each zero has its branch."""
    settled, newton = True, branches.newton
    for j in range(6):
        work.q[2, j] = work.begin[j]
    for n in range(STEPS_OF_TURN + 1):
        for j in range(6):
            work.q[0, j], work.q[1, j] = work.q[1, j], work.q[2, j]
            work.rest[0, j], work.rest[1, j] = work.rest[1, j], work.rest[2, j]
            newton.q[j] = work.q[2, j]
            newton.held[j] = 1.0 if j == joint else 0.0
        if n > 0:
            newton.q[joint] += step
        if not sample(query.chain, query.T, newton, work.rest[2]):
            return n, settled
        for j in range(6):
            work.q[2, j] = newton.q[j]
        if product_of(work.rest[2], work.rest[2]) > NEAR_CONTINUUM**2:
            return n, settled
        note_passed(work)
        if n > 0:
            settled = add_between(query, work, branches, joint, n > 1) and settled
    return STEPS_OF_TURN + 1, settled


def note_passed(work: NearContinua) -> None:
    """Those to begin from that are on this way need not be begun from."""
    kept = 0
    for k in range(work.filled[0]):
        farthest = 0.0
        for j in range(6):
            farthest = max(farthest, circular_distance(work.q[2, j] - work.begun[k, j]))
        if farthest > ON_THE_WAY * STEP:
            for j in range(6):
                work.begun[kept, j] = work.begun[k, j]
            kept += 1
    work.filled[0] = kept


def add_between(query: PoseQuery, work: NearContinua, branches: BranchWork, joint: int, third: bool) -> bool:
    """Add the branch between the last two places, or both beside the last but one; False for a zero without one."""
    now, before, earlier = along(work, 2), along(work, 1), along(work, 0)
    if now < 0.0:
        return add_in_bracket(query, work, branches, joint, 0.0, before, 1.0, now)
    if not (third and before < min(now, earlier)):
        return True
    # Where the least remains there may be two zeros: a parabola tells.
    bend, slope = 0.5 * (earlier - 2.0 * before + now), 0.5 * (now - earlier)
    least = -0.5 * slope / bend
    remains = sample_at(query, work, branches, joint, least)
    if remains < 0.0:
        first = add_in_bracket(query, work, branches, joint, -1.0, earlier, least, remains)
        return add_in_bracket(query, work, branches, joint, least, remains, 1.0, now) and first
    if remains < TOUCHING * bend:
        add_fold(query, branches)
    return True


def sample_at(query: PoseQuery, work: NearContinua, branches: BranchWork, joint: int, share: float) -> float:
    """What remains at a share of a step behind the last place but one; infinite where that cannot be said."""
    q, held, to = branches.newton.q, branches.newton.held, 2 if share > 0.0 else 0
    for j in range(6):
        q[j] = work.q[1, j] + abs(share) * (work.q[to, j] - work.q[1, j])
        held[j] = 1.0 if j == joint else 0.0
    if not sample(query.chain, query.T, branches.newton, work.spare):
        return math.inf
    return product_of(work.spare, work.rest[1]) / math.sqrt(product_of(work.rest[1], work.rest[1]))


def add_in_bracket(
    query: PoseQuery,
    work: NearContinua,
    branches: BranchWork,
    joint: int,
    low: float,
    at_low: float,
    high: float,
    at_high: float,
) -> bool:
    """Add the branch where what remains changes its sign, by the secant method, kept within the bracket.

    Args:
        query: the target.
        work: the last places.
        branches: appended to.
        joint: the one that is moved.
        low: one end, a share of a step behind the last place but one.
        at_low: what remains there.
        high: the other end.
        at_high: what remains there, of the other sign.
    """
    side = 0
    for _ in range(BRACKETED_STEPS):
        share = (low * at_high - high * at_low) / (at_high - at_low)
        value = sample_at(query, work, branches, joint, share)
        if abs(value) < CLOSURE:
            return add_branch(query, branches, 0.0)
        if (value > 0.0) == (at_high > 0.0):
            high, at_high, at_low = share, value, 0.5 * at_low if side == 1 else at_low
            side = 1
        else:
            low, at_low, at_high = share, value, 0.5 * at_high if side == -1 else at_high
            side = -1
    return False


def along(work: NearContinua, n: int) -> float:
    """What remains at one of the last places, along what remains at the last but one."""
    square = product_of(work.rest[1], work.rest[1])
    return product_of(work.rest[n], work.rest[1]) / math.sqrt(square) if square > 0.0 else 0.0


def product_of(a: Array, b: Array) -> float:
    """The scalar product of two deviations."""
    total = 0.0
    for j in range(6):
        total += a[j] * b[j]
    return total
