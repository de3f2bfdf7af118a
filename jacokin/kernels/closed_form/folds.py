"""Folds: singular configurations where two branches merge, and Newton's method converges slowly or not at all.

One joint that moves along the singular direction is held, and the others are solved for in the least-squares sense,
which is regular. What remains of the closure is a smooth function of the held joint, nearly a parabola: its two zeros
are the two branches.
"""

from __future__ import annotations

import math
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.chain import Newton, deviation, forward, least_squares, linearise, normal_equations, solve_normal
from jacokin.kernels.limits import same_configuration
from jacokin.kernels.tolerances import (
    CLOSURE,
    FOLD_SAMPLE,
    MAX_FOLD_DISTANCE,
    MAX_FOLD_WIDTH,
    SAME_FOLD,
    SMALLEST_FOLD_SAMPLE,
)

MAX_FOLDS = 16
STEPS = 3
#: What `solve_fold` found.
FoldFound = IntEnum("FoldFound", "NONE NEW KNOWN", start=0)
#: The sample in the middle comes first: it shows whether the fold is known.
ORDER = (1, 0, 2)
ROUNDS = 3


class FoldWork(NamedTuple):
    """The folds of one target, and the one at hand."""

    known: Array  # (16, 6) the configuration at each fold [rad]
    pairs: Array  # (16, 2) mean of q6 over its two branches [rad], half their difference squared [rad^2]
    filled: NDArray[np.int64]  # (1,)
    branches: Array  # (2, 6) of the fold at hand
    direction: Array  # (6,) of the remaining deviation
    samples: Array  # (3, 7) deviations, and q6 [rad]


def make_folds() -> FoldWork:
    """Fresh work arrays."""
    return FoldWork(
        np.empty((MAX_FOLDS, 6)),
        np.empty((MAX_FOLDS, 2)),
        np.zeros(1, np.int64),
        np.empty((2, 6)),
        np.empty(6),
        np.empty((3, 7)),
    )


def solve_fold(chain: Array, T: Array, work: Newton, fold: FoldWork) -> FoldFound:
    """Fill fold.branches with the two branches near work.q, and append the fold to the known ones, if it is new."""
    q = work.q
    joint = most_singular_joint(chain, T, work)
    if joint < 0:
        return FoldFound.NONE
    for j in range(6):
        work.held[j] = 1.0 if j == joint else 0.0
    middle, step = q[joint], FOLD_SAMPLE
    origin, gap, curvature, mean, half_square = middle, 0.0, 0.0, 0.0, 0.0
    for turn in range(ROUNDS):
        for n in range(3):
            i = ORDER[n]
            q[joint] = middle + (i - 1) * step
            if not sample(chain, T, work, fold.samples[i]):
                return FoldFound.NONE
            fold.samples[i, 6] = q[5]
            if n == 0 and turn > 0 and is_known_fold(fold, q):
                return FoldFound.KNOWN
        below, here, above = project(fold)
        curvature = (above + below - 2.0 * here) / (2.0 * step * step)
        slope = (above - below) / (2.0 * step)
        if curvature == 0.0:
            return FoldFound.NONE
        shift = -0.5 * slope / curvature
        if not abs(middle + shift - origin) < MAX_FOLD_DISTANCE:
            return FoldFound.NONE
        middle += shift
        gap = here + 0.5 * slope * shift
        mean, half_square = q6_of_both(fold, step, shift, -gap / curvature)
        step = max(math.sqrt(max(-gap / curvature, 0.0)), SMALLEST_FOLD_SAMPLE)
    apart = 0.0
    if gap * curvature < 0.0:
        apart = math.sqrt(-gap / curvature)
    elif abs(gap) > CLOSURE:
        q[joint] = middle
        if least_squares(chain, T, work, STEPS):
            note_fold(fold, q, mean, half_square)
        return FoldFound.NONE
    if apart > MAX_FOLD_WIDTH:
        return FoldFound.NONE
    for i in range(2):
        q[joint] = middle + (2 * i - 1) * apart
        if not least_squares(chain, T, work, STEPS):
            return FoldFound.NONE
        for j in range(6):
            fold.branches[i, j] = q[j]
    for j in range(6):
        q[j] = 0.5 * (fold.branches[0, j] + fold.branches[1, j])
    note_fold(fold, q, mean, half_square)
    return FoldFound.NEW


def q6_of_both(fold: FoldWork, step: float, shift: float, square: float) -> tuple[float, float]:
    """Mean of q6 over both branches of a fold, and the square of half their difference, which may be negative.

    Args:
        fold: its samples.
        step: of the samples, in the joint that is held [rad].
        shift: from the sample in the middle to the fold [rad].
        square: of the distance from the fold to its branches, in that joint [rad^2].
    """
    below, here, above = fold.samples[0, 6], fold.samples[1, 6], fold.samples[2, 6]
    slope, bend = (above - below) / (2.0 * step), (above + below - 2.0 * here) / (2.0 * step * step)
    at_fold = slope + 2.0 * bend * shift
    return here + slope * shift + bend * (shift * shift + square), at_fold * at_fold * square


def note_fold(fold: FoldWork, q: Array, mean: float, half_square: float) -> None:
    """Append a fold to the known ones."""
    count = fold.filled[0]
    if count < MAX_FOLDS:
        for j in range(6):
            fold.known[count, j] = q[j]
        fold.pairs[count, 0], fold.pairs[count, 1] = mean, half_square
        fold.filled[0] = count + 1


def is_known_fold(fold: FoldWork, q: Array) -> bool:
    """Whether a configuration leads to a fold that is known."""
    for i in range(fold.filled[0]):  # noqa: SIM110  # numba compiles no generator expressions
        if same_configuration(fold.known[i], q, SAME_FOLD):
            return True
    return False


def most_singular_joint(chain: Array, T: Array, work: Newton) -> int:
    """The joint that moves most along the singular direction, by inverse iteration; -1 if that fails."""
    direction = work.held
    best = -1
    for turn in range(2):
        linearise(chain, T, work.q, work.system)
        largest = 0.0
        for j in range(6):
            largest = max(largest, abs(work.normal[j, 6])) if turn > 0 else 1.0
        scale = 1.0 / largest if largest > 0.0 else 0.0
        for j in range(6):
            direction[j] = work.normal[j, 6] * scale if turn > 0 else 1.0 - 0.1 * j
        right = (direction[0], direction[1], direction[2], direction[3], direction[4], direction[5])
        for j in range(6):
            direction[j] = 0.0
        normal_equations(work.system, direction, work.normal)
        for j in range(6):
            work.normal[j, 6] = right[j]
        if not solve_normal(work.normal):
            return -1
    for j in range(6):
        if best < 0 or abs(work.normal[j, 6]) > abs(work.normal[best, 6]):
            best = j
    return best


def sample(chain: Array, T: Array, work: Newton, remaining: Array) -> bool:
    """Solve for the joints that are not held, and fill remaining (6,) with the deviation that is left."""
    if not least_squares(chain, T, work, STEPS):
        return False
    x, y, z, p = forward(chain, work.q)
    position, turn, _ = deviation(T, x, y, z, p)
    for i in range(3):
        remaining[i] = position[i]
        remaining[i + 3] = turn[i]
    return True


def project(fold: FoldWork) -> tuple[float, float, float]:
    """The three sampled deviations along the longest of them: signed lengths."""
    best, longest = 0, -1.0
    for i in range(3):
        square = 0.0
        for j in range(6):
            square += fold.samples[i, j] * fold.samples[i, j]
        if square > longest:
            best, longest = i, square
    scale = 1.0 / math.sqrt(longest) if longest > 0.0 else 0.0
    for j in range(6):
        fold.direction[j] = fold.samples[best, j] * scale
    return along(fold, 0), along(fold, 1), along(fold, 2)


def along(fold: FoldWork, i: int) -> float:
    """Sample i along the direction."""
    length = 0.0
    for j in range(6):
        length += fold.samples[i, j] * fold.direction[j]
    return length
