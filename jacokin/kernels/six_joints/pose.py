"""All branches of a chain of six turning joints at one target. Read this first, then `equations`."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.branches import BranchWork, PoseQuery, add_branch, add_fold
from jacokin.kernels.limits import circular_distance
from jacokin.kernels.six_joints.candidates import Candidates, make_candidates
from jacokin.kernels.six_joints.continua import settle_continua
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
from jacokin.kernels.tolerances import SAME_THETA

#: More undecided intervals than this are no places but a continuum, which its neighbours show.
MAX_INTERVALS = 16
#: [rad]; roots nearer than this, twice `SAME_THETA`, may share a branch, or be one that rounding splits.
ROOTS_APART = 4e-6
#: [rad]; a branch of a neighbour that Newton's method moves farther may have left a branch of the arm behind.
FARTHEST_MOVE = 0.05
#: Whether branches may be missing: none, some, or those of a curve of solutions along which F vanishes.
Doubt = IntEnum("Doubt", "NONE SOME VANISHING", start=0)


class SixWork(NamedTuple):
    """Arrays the solver writes to."""

    equations: Equations
    roots: SixRoots
    null: NullSpace
    candidates: Candidates
    near_continua: NearContinua
    vanishes: NDArray[np.int64]  # (1,) 1 where F vanishes for every angle


def make_six() -> SixWork:
    """Fresh work arrays."""
    return SixWork(
        make_equations(),
        make_six_roots(),
        make_null_space(),
        make_candidates(),
        make_near_continua(),
        np.zeros(1, np.int64),
    )


def solve_six_joints(arm: SixArm, query: PoseQuery, work: SixWork, branches: BranchWork) -> None:
    """Fill branches.rows with every branch of one target, in no particular order.

    An arm with a form of its own is solved by that. Others are, and what such a form leaves open, in the general way:
    the arm itself first. Where F has more than single roots that stand apart, by the arm's structure or the target's,
    branches may hide behind each other: there a neighbour is solved as well, an arm with each link moved by so little
    that Newton's method leads from its branches to those of the arm. One that is not in doubt itself and adds no branch
    to those that are there, as the one that is moved the opposite way, settles the matter; where none of three does,
    branches.filled says that some may be missing.
    Singular branches that no neighbour has are found from others, see `near_continua`. Where F vanishes there may be a
    continuum of which a neighbour has none: those are for who asks to find, see `continua`.
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
    doubt = branches_of_labelling(arm.scale, arm.own, -1, query, work, branches)
    work.vanishes[0] = doubt == Doubt.VANISHING
    if doubt != Doubt.NONE:
        settled = settled_by_neighbours(arm, query, work, branches)
        settle_continua(query, branches)
        followed = follow_near_continua(arm, query, work, branches)
        settle_continua(query, branches)
        if not settled and followed > 0:  # they may be where no branch was before
            settled = settled_by_neighbours(arm, query, work, branches)
            settle_continua(query, branches)
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
            doubt = branches_of_labelling(arm.scale, arm.neighbours, 2 * n + sure, query, work, branches)
            if doubt != Doubt.NONE or not 0 < branches.filled[0] == before:
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
) -> int:
    """Add the branches that one labelling finds.

    Args:
        scale: what lengths are multiplied by [1/m].
        labelling: see `loop`.
        neighbour: which neighbour of the arm is solved, -1 for the arm itself.
        query: the target.
        work: work arrays.
        branches: appended to.

    Returns:
        The doubt that is left: of a root without a branch nearby, of a place that may hold several, or of all.
    """
    e, null, found = work.equations, work.null, work.roots.found
    fill_links(query.chain, query.T, scale, labelling, e.links)
    if neighbour >= 0:
        move_links(e.links, neighbour)
    write_equations(e)
    count = find_six_roots(e, work.roots)
    if count < 0:
        return Doubt.VANISHING
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
    in_doubt = in_doubt or intervals > 0 or (neighbour < 0 and count % 2 > 0)
    return Doubt.SOME if in_doubt else Doubt.NONE


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
