"""Which labellings suit an arm: those that find what is known, on poses made from configurations."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.branches import COLUMNS, MAX_BRANCHES, BranchWork, PoseQuery, make_branches
from jacokin.kernels.chain import forward
from jacokin.kernels.limits import same_configuration
from jacokin.kernels.six_joints.loop import LABELLINGS
from jacokin.kernels.six_joints.pose import Doubt, SixWork, branches_of_labelling, make_six
from jacokin.kernels.tolerances import SAME_THETA

#: Columns of a score: configurations not found, branches found, poses in doubt, the effort for what was undecided.
Score = IntEnum("Score", "MISSED BRANCHES_FOUND IN_DOUBT EFFORT COUNT", start=0)
#: What an interval without branches takes, which is tried from every start, in units of a stretch looked at.
FRUITLESS = 20.0
#: A labelling that misses as many configurations as this at the start is not tried further.
HOPELESS = 4


class RankWork(NamedTuple):
    """What a ranking reads and writes."""

    chain: Array  # (7, 3, 4)
    scale: Array  # (1,) [1/m]
    limits: Array  # (3, 6)
    q: Array  # (n, 6) configurations [rad]
    tried: NDArray[np.int64]  # (2, 12) 1 for the labellings that are
    T: Array  # (4, 4)
    six: SixWork
    branches: BranchWork
    scores: Array  # (2, 12, 4) of the arm itself, and of its first neighbour, in each labelling; added to


def make_rank_work() -> RankWork:
    """Fresh arrays, for no configuration and all labellings."""
    return RankWork(
        np.zeros((7, 3, 4)),
        np.zeros(1),
        np.zeros((3, 6)),
        np.empty((0, 6)),
        np.ones((2, LABELLINGS), np.int64),
        np.eye(4),
        make_six(),
        make_branches(np.empty((MAX_BRANCHES, COLUMNS))),
        np.zeros((2, LABELLINGS, Score.COUNT)),
    )


def rank_labellings(work: RankWork) -> int:
    """Add to scores; returns how many configurations were solved for."""
    branches, scores = work.branches, work.scores
    for labelling in range(LABELLINGS):
        for kind in range(2):
            if work.tried[kind, labelling] == 0:
                continue
            for i in range(work.q.shape[0]):
                if scores[kind, labelling, Score.MISSED] >= HOPELESS:
                    scores[kind, labelling, Score.MISSED] += 1.0
                    continue
                fill_target(work.chain, work.q[i], work.T)
                query = PoseQuery(work.chain, work.limits, work.T, work.q[i])
                branches.filled[0], branches.filled[1], branches.fold.filled[0] = 0, 0, 0
                doubt = branches_of_labelling(work.scale[0], labelling, kind - 1, query, work.six, branches)
                found = False
                for n in range(branches.filled[0]):
                    found = found or same_configuration(branches.rows[n], work.q[i], SAME_THETA)
                scores[kind, labelling, Score.MISSED] += not found
                scores[kind, labelling, Score.BRANCHES_FOUND] += branches.filled[0]
                scores[kind, labelling, Score.IN_DOUBT] += doubt != Doubt.NONE
                scores[kind, labelling, Score.EFFORT] += work.six.roots.filled[1] + FRUITLESS * work.six.roots.filled[2]
    return int(work.q.shape[0])


def fill_target(chain: Array, q: Array, T: Array) -> None:
    """Fill T (4, 4) with forward kinematics."""
    x, y, z, p = forward(chain, q)
    for i in range(3):
        T[i, 0], T[i, 1], T[i, 2], T[i, 3] = x[i], y[i], z[i], p[i]
