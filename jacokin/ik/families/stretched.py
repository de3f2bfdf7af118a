"""`walk_to_folds`: curves of an arm of seven joints that is nearly stretched, where following them step by step fails.

Both bends of the elbow are then so nearly one that a curve turns from the one to the other within 1e-7 rad: for the
steps a corner, while joint 3 alone tells the closed form exactly how far each of them goes.
"""

from __future__ import annotations

import math

import numpy as np

from jacokin.arrays import Array
from jacokin.ik.families.curves import JOINT_3, CurveProblem, FoundCurves
from jacokin.kernels.chain import linearise7
from jacokin.kernels.self_motion.arcs import FOLD_END, LOST_END
from jacokin.kernels.self_motion.seven_joints import MOST_AT_Q3, solve_at_q3
from jacokin.model import angles

#: [rad] a row of the closed form this near to a node is it.
SAME_ROW = 1e-5
#: [rad] the first step of joint 3, how far a fold is looked for, and the longest way of another joint on such a step.
FIRST_STEP, FARTHEST, LONGEST_WAY = 1e-7, 0.5, 0.6
HALVINGS = 60
#: Nodes on the way.
NODES = 16


def walk_to_folds(found: FoundCurves, problem: CurveProblem) -> FoundCurves:
    """The same, but that lost curves go on to their folds, where the closed form leads there."""
    arcs, ends, pieces = list(found.arcs), list(found.ends), list(found.pieces)
    for i, both in enumerate(found.ends):
        for side, end in enumerate(both):
            nodes = _walk(arcs[i][-side, :7], 2 * side - 1, problem) if end == LOST_END else None
            if nodes is None:
                continue
            arcs[i] = np.vstack([arcs[i], nodes] if side else [nodes, arcs[i]])
            ends[i] = (ends[i][0], FOLD_END) if side else (FOLD_END, ends[i][1])
            pieces = [piece.extended(nodes, side) if piece.is_lost(i, side) else piece for piece in pieces]
    complete = not found.full and not any(LOST_END in both for both in ends)
    return found._replace(arcs=arcs, ends=ends, pieces=pieces, complete=complete)


def _walk(x: Array, sign: int, problem: CurveProblem) -> Array | None:
    """Nodes (m, 14) from a point (7,) of a curve, rising in joint 3, to the fold before it or after it; or None."""
    p, rows = float(x[JOINT_3]), np.empty((MOST_AT_Q3, 7))

    def all_at(q3: float) -> Array:
        solve_at_q3(problem.chain, problem.arm.constants, problem.T, q3, rows)
        return rows

    ways = np.abs(angles.wrap_to_pi(all_at(p) - x)).max(axis=1)
    if np.isnan(ways).all() or not np.nanmin(ways) < SAME_ROW:
        return None
    label = int(np.nanargmin(ways))
    near, far, last = 0.0, FIRST_STEP, x
    while True:
        row = all_at(p + sign * far)[label]
        if math.isnan(row[0]):
            break
        if far > FARTHEST or np.abs(angles.wrap_to_pi(row - last)).max() > LONGEST_WAY:
            return None
        near, far, last = far, 2.0 * far, row.copy()
    for _ in range(HALVINGS):
        middle = 0.5 * (near + far)
        near, far = (near, middle) if math.isnan(all_at(p + sign * middle)[label, 0]) else (middle, far)
    if near == 0.0:
        return None
    points, last = [], x
    for left in (1.0 - np.arange(1, NODES + 1) / NODES) ** 2:  # near a fold, joints change as the root of what is left
        row = all_at(p + sign * near * (1.0 - left))[label]
        if math.isnan(row[0]):  # a gap on the way
            return None
        last = last + angles.wrap_to_pi(row - last)
        points.append(np.concatenate([last, _tangent(last, problem)]))
    return np.array(points if sign > 0 else points[::-1])


def _tangent(x: Array, problem: CurveProblem) -> Array:
    """The unit tangent (7,) of a curve at a point (7,), rising in joint 3."""
    system = np.empty((7, 8))
    linearise7(problem.chain, problem.T, x, system)
    tangent: Array = np.linalg.svd(system[:6, :7])[2][-1]
    return tangent if tangent[JOINT_3] >= 0.0 else -tangent
