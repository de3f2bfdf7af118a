"""`find_beside_seed`: the member of a family beside a seed that nearly is one.

Next to configurations that are singular in several ways, many far apart reach the target but for rounding, and curves
that pass there are found in part. What makes the square of the deviation and a weight times that of the way from the
seed least is no farther from the seed than any member, and the smaller the weight, the nearer it is to the target:
`kernels.branches` does the same for a pose of six joints.
"""

from __future__ import annotations

import numpy as np

from jacokin.arrays import Array
from jacokin.ik.families.curves import CurveProblem
from jacokin.kernels.chain import linearise7
from jacokin.kernels.tolerances import (
    CLOSURE,
    FIRST_SEED_WEIGHT,
    LEAST_SEED_WEIGHT,
    NEAR_SEED,
    POLISHED_CLOSURE,
    SAME_AS_SEED,
    SEED_STEP,
    SEED_WEIGHT_FACTOR,
)

#: Gauss-Newton steps with each weight, at most; and without one, where each may halve no more than the way left.
STEPS, LAST_STEPS = 4, 8


def find_beside_seed(problem: CurveProblem, seed: Array, limits: Array, nearest: float) -> Array | None:
    """The point (7,) that reaches the target beside one that nearly does, if no member known is as near.

    Args:
        problem: the target.
        seed: (7,) the point that nearly does, within the limits [rad].
        limits: (2, 7) lower and upper ones, and the range of the parameter [rad].
        nearest: the distance from the seed to the nearest member that is known [rad].
    """
    system, x = np.empty((7, 8)), seed.copy()
    miss = linearise7(problem.chain, problem.T, x, system)
    if miss > NEAR_SEED or nearest <= SAME_AS_SEED:
        return None
    counts = np.ones(7)
    if problem.free_axis is not None:
        counts[problem.arm.parameter] = 0.0  # the turn about a free axis is no joint
    weight = FIRST_SEED_WEIGHT
    while miss > POLISHED_CLOSURE and weight >= LEAST_SEED_WEIGHT:
        descended, deviation = _descended(problem, x, seed, np.sqrt(weight) * counts, limits, STEPS)
        if miss <= CLOSURE < deviation:
            break  # rounding: no weight brings it nearer
        x, miss = descended, deviation
        if nearest <= np.linalg.norm(counts * (x - seed)) + SAME_AS_SEED:
            return None
        weight *= SEED_WEIGHT_FACTOR
    if miss > CLOSURE:
        x, miss = _descended(problem, x, seed, 0.0 * counts, limits, LAST_STEPS)
    return x if miss <= CLOSURE and np.linalg.norm(counts * (x - seed)) < nearest else None


def _descended(
    problem: CurveProblem, x: Array, seed: Array, root: Array, limits: Array, steps: int
) -> tuple[Array, float]:
    """A point (7,) after Gauss-Newton steps, as far as limits let it, and its deviation; roots (7,) of weights."""
    system, free = np.empty((7, 8)), np.ones(7, dtype=np.bool_)
    miss = linearise7(problem.chain, problem.T, x, system)
    for _ in range(steps):
        rows, rest = np.vstack([system[:6, :7], np.diag(root)]), np.append(system[:6, 7], root * (seed - x))
        moved = x.copy()
        moved[free] += np.linalg.lstsq(rows[:, free], rest, rcond=None)[0]
        last, x = x, np.clip(moved, *limits)
        free &= x == moved
        miss = linearise7(problem.chain, problem.T, x, system)
        if np.linalg.norm(x - last) < SEED_STEP or (not root.any() and miss <= CLOSURE):
            break
    return x, miss
