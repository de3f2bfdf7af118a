"""All branches of a chain of six turning joints at one target. Read this first, then `equations`."""

from __future__ import annotations

import math
from typing import NamedTuple

from jacokin.arrays import Array
from jacokin.kernels.branches import FAMILY, BranchWork, PoseQuery, add_branch, add_fold, copy_row, jacobian_determinant
from jacokin.kernels.chain import errors, least_squares
from jacokin.kernels.closed_form.folds import most_singular_joint
from jacokin.kernels.limits import TURN, circular_distance
from jacokin.kernels.six_joints.candidates import Candidates, make_candidates
from jacokin.kernels.six_joints.elbow_offset import branches_of_elbow_offset
from jacokin.kernels.six_joints.equations import Equations, make_equations, write_equations
from jacokin.kernels.six_joints.loop import NEIGHBOURS, Form, SixArm, fill_links, joint_of, move_links
from jacokin.kernels.six_joints.near_continua import (
    NearContinua,
    add_along_near_continua,
    begin_from,
    make_near_continua,
    target_beside,
)
from jacokin.kernels.six_joints.parallel_axes import branches_of_parallel_axes
from jacokin.kernels.six_joints.planar_arm import branches_of_planar_arm
from jacokin.kernels.six_joints.roots import SixRoots, find_six_roots, make_six_roots
from jacokin.kernels.six_joints.spherical_wrist import branches_of_spherical_wrist
from jacokin.kernels.six_joints.starts import (
    NullSpace,
    decompose,
    fill_null_space,
    fill_null_vector,
    fill_starts,
    make_null_space,
    start_from,
)
from jacokin.kernels.tolerances import CONTINUUM_CLOSURE, SAME_THETA, SINGULAR_DETERMINANT

#: More undecided intervals than this are no places but a continuum, which its neighbours show.
MAX_INTERVALS = 16
#: [rad]; roots nearer than this, twice `SAME_THETA`, may share a branch, or be one that rounding splits.
ROOTS_APART = 4e-6
#: [rad]; a branch of a neighbour that Newton's method moves farther may have left a branch of the arm behind.
FARTHEST_MOVE = 0.05
#: Steps from a member of a continuum to the seed's angle, of least squares in each, the shortest [rad].
WALK, WALK_STEPS, SHORTEST_WALK = 16, 3, 0.02


class SixWork(NamedTuple):
    """Arrays the solver writes to."""

    equations: Equations
    roots: SixRoots
    null: NullSpace
    candidates: Candidates
    near_continua: NearContinua


def make_six() -> SixWork:
    """Fresh work arrays."""
    return SixWork(make_equations(), make_six_roots(), make_null_space(), make_candidates(), make_near_continua())


def solve_six_joints(arm: SixArm, query: PoseQuery, work: SixWork, branches: BranchWork) -> None:
    """Fill branches.rows with every branch of one target, in no particular order.

    An arm with a form of its own is solved by that. Others are, and what such a form leaves open, in the general way:
    the arm itself first. Where F has more than single roots that stand apart, by the arm's structure or the target's,
    branches may hide behind each other: there a neighbour is solved as well, an arm with each link moved by so little
    that Newton's method leads from its branches to those of the arm. One that is not in doubt itself and adds no branch
    to those that are there, as the one that is moved the opposite way, settles the matter; where none of three does,
    branches.filled says that some may be missing.
    Singular branches that no neighbour has are found from others, see `near_continua`.
    Where no branch is there, it may be that two which meet in one are none of the neighbours'.
    """
    branches.fold.filled[0], branches.lanes.filled[0] = 0, 0
    if arm.form == Form.SPHERICAL_WRIST:
        if branches_of_spherical_wrist(arm, query, work.candidates, work.roots.fourier, branches):
            return
    elif arm.form == Form.PARALLEL_AXES:
        if branches_of_parallel_axes(arm, query, work.candidates, branches):
            return
    elif arm.form == Form.PLANAR_ARM:
        if branches_of_planar_arm(arm, query, work.candidates, work.roots.fourier, branches):
            return
    elif arm.form == Form.ELBOW_OFFSET and branches_of_elbow_offset(
        arm, query, work.candidates, work.roots.fourier, branches
    ):
        return
    if branches_of_labelling(arm.scale, arm.own, -1, query, work, branches):
        settled = settled_by_neighbours(arm, query, work, branches)
        settle_continua(query, branches)
        followed = follow_near_continua(arm, query, work, branches)
        if not settled and followed > 0:
            settle_continua(query, branches)  # they may be on one on which no branch was before
            settled = settled_by_neighbours(arm, query, work, branches)
        if not settled or followed < 0:
            branches.filled[1] = 1


def settled_by_neighbours(arm: SixArm, query: PoseQuery, work: SixWork, branches: BranchWork) -> bool:
    """Add the branches that neighbours of an arm lead to; whether two opposite ones are sure and have none that is new.

    Where branches meet in one, they are apart of the one neighbour and not there of the other.
    """
    for n in range(NEIGHBOURS):
        sure = 0
        while sure < 2:
            before = branches.filled[0]
            in_doubt = branches_of_labelling(arm.scale, arm.neighbours, 2 * n + sure, query, work, branches)
            if in_doubt or not 0 < branches.filled[0] == before:
                break
            sure += 1
        if sure == 2:
            return True
    return False


def follow_near_continua(arm: SixArm, query: PoseQuery, work: SixWork, branches: BranchWork) -> int:
    """Add the branches along ways that nearly are continua; returns what `add_along_near_continua` does."""
    near = work.near_continua
    near.filled[0] = 0
    begin_from(query, near, branches)
    if near.filled[0] > 0:
        beside = target_beside(query, near)
        branches_of_labelling(arm.scale, arm.own, -1, beside, work, near.beside)
        branches_of_labelling(arm.scale, arm.neighbours, 0, beside, work, near.beside)
        begin_from(beside, near, near.beside)
    return add_along_near_continua(query, near, branches)


def branches_of_labelling(
    scale: float, labelling: int, neighbour: int, query: PoseQuery, work: SixWork, branches: BranchWork
) -> bool:
    """Add the branches that one labelling finds.

    Args:
        scale: what lengths are multiplied by [1/m].
        labelling: see `loop`.
        neighbour: which neighbour of the arm is solved, -1 for the arm itself.
        query: the target.
        work: work arrays.
        branches: appended to.

    Returns:
        Whether anything is in doubt: a root without a branch nearby, or a place that may hold several.
    """
    e, null, found = work.equations, work.null, work.roots.found
    fill_links(query.chain, query.T, scale, labelling, e.links)
    if neighbour >= 0:
        move_links(e.links, neighbour)
    write_equations(e)
    count = find_six_roots(e, work.roots)
    if count < 0:
        return True
    joint, intervals, in_doubt = joint_of(labelling, 2), 0, False
    for i in range(count):
        theta, width = found[i, 0], found[i, 1]
        if width < 0.0:
            intervals += 1
            continue
        decompose(e, theta, null)
        fill_null_vector(null)
        start_from(e, labelling, theta, null.vectors[0], null, null.starts[0])
        if not branch_from(null.starts[0], query, branches):
            in_doubt = True
        if circular_distance(branches.newton.q[joint] - theta) > FARTHEST_MOVE:
            in_doubt = True
        if neighbour < 0 and count_at(branches, joint, theta, SAME_THETA + 4.0 * width) == 0:
            in_doubt = True
    for i in range(count):
        if found[i, 1] < 0.0 and intervals <= MAX_INTERVALS:
            both = branches_in_stretch(labelling, joint, found[i, 0], -found[i, 1], query, work, branches)
            work.roots.filled[2] += not both
    if neighbour < 0 and branches.filled[0] < count:
        in_doubt = True  # two roots led to one branch: another is near one of them
    if neighbour < 0 and work.roots.filled[1] > 0:
        # The arm itself had to be looked at closely: its structure may make roots coincide.
        in_doubt = in_doubt or work.roots.filled[3] > 0 or branches.fold.filled[0] > 0
        in_doubt = in_doubt or branches.filled[0] != count or not stand_apart(found, count)
    return in_doubt or intervals > 0 or (neighbour < 0 and count % 2 > 0)


def stand_apart(found: Array, count: int) -> bool:
    """Whether roots are so far from each other that each has its own branch nearby."""
    for i in range(count):
        for j in range(i):
            if circular_distance(found[i, 0] - found[j, 0]) < ROOTS_APART + 4.0 * (found[i, 1] + found[j, 1]):
                return False
    return True


def branch_from(start: Array, query: PoseQuery, branches: BranchWork) -> bool:
    """Add the branch that Newton's method leads to from a start (6,), or both of a fold; False for neither."""
    for j in range(6):
        branches.newton.q[j] = start[j]
    if add_branch(query, branches, 0.0):
        return True
    for j in range(6):
        branches.newton.q[j] = start[j]
    return add_fold(query, branches)


def branches_in_stretch(
    labelling: int, joint: int, theta: float, half: float, query: PoseQuery, work: SixWork, branches: BranchWork
) -> bool:
    """Add the branches of an undecided interval; whether there are two, from its starts or of a fold."""
    null, starts = work.null, work.null.starts
    width = SAME_THETA + half
    decompose(work.equations, theta, null)
    fill_null_space(null)
    count = fill_starts(work.equations, labelling, theta, null)
    for n in range(count):
        for j in range(6):
            branches.newton.q[j] = starts[n, j]
        add_branch(query, branches, 0.0)
        if count_at(branches, joint, theta, width) > 1:
            return True
    for n in range(count):
        for j in range(6):
            branches.newton.q[j] = starts[n, j]
        if add_fold(query, branches) and count_at(branches, joint, theta, width) > 1:
            return True
    return False


def count_at(branches: BranchWork, joint: int, theta: float, width: float) -> int:
    """How many branches have this angle in one joint, more or less."""
    count = 0
    for i in range(branches.filled[0]):
        count += circular_distance(branches.rows[i, joint] - theta) < width
    return count


def settle_continua(query: PoseQuery, branches: BranchWork) -> None:
    """Of each continuum of branches, where joints may turn against each other, keep the member at the seed's angle."""
    rows = branches.rows
    i = 0
    while i < branches.filled[0]:
        if rows[i, FAMILY] > 0.0 or not move_along(query, branches, i):
            i += 1
            continue
        branches.filled[0] -= 1
        copy_row(rows[branches.filled[0]], rows[i])
        add_branch(query, branches, 1.0)
        i = 0


def move_along(query: PoseQuery, branches: BranchWork, i: int) -> bool:
    """Whether branch i is a member of a continuum; branches.newton.q is then the one at the seed's angle, or nearby.

    The joint that moves most along the singular direction is moved on its own, and the others follow.
    """
    newton, row = branches.newton, branches.rows[i]
    q = newton.q
    for j in range(6):
        q[j] = row[j]
    if abs(jacobian_determinant(query.chain, query.T, newton)) > SINGULAR_DETERMINANT:
        return False
    joint = most_singular_joint(query.chain, query.T, newton)
    if joint < 0:
        return False
    for j in range(6):
        newton.held[j] = 1.0 if j == joint else 0.0
    away = query.seed[joint] - row[joint]
    away -= TURN * math.floor(away / TURN + 0.5)
    step = away / WALK if abs(away) > SHORTEST_WALK else SHORTEST_WALK
    for n in range(WALK):
        q[joint] = row[joint] + (n + 1) * step
        closed = least_squares(query.chain, query.T, newton, WALK_STEPS)
        position, orientation = errors(query.chain, query.T, q)
        if not closed or max(position, orientation) > CONTINUUM_CLOSURE:
            if n == 0:
                return False
            for j in range(6):
                q[j] = row[j]
            return True
    return True
