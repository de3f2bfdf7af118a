"""What the forms for common structures share: angles of one labelling, two at a time, and branches from them.

Both forms solve for one angle after the other, each from a cos(theta) + b sin(theta) = c, which has two solutions,
middle - half and middle + half. Where they nearly meet, so do two branches: then the middle leads to both of a fold.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.branches import BranchWork, PoseQuery, add_branch, add_fold
from jacokin.kernels.six_joints.equations import turned_back_by
from jacokin.kernels.six_joints.loop import SixArm, joint_of
from jacokin.kernels.tolerances import (
    ALIGNED_SINE,
    EDGE_SLACK,
    EDGE_SLACK_AFTER_FOLD,
    EXACT_STRUCTURE,
    FREE_ANGLE,
    SMALL_SINE,
)
from jacokin.kernels.vector import Vec

#: What `Candidates.state` counts: angles that nothing determines, folds among the angles so far, branches added; and
#: where not 0, that the form does not settle this target, and that branches may be missing.
FREE, FOLDS, ADDED, UNSETTLED, DOUBTFUL = 0, 1, 2, 3, 4
#: Signs of half in the order to try, for a fold the middle first.
SIGNS = (0.0, 1.0, -1.0)


class Candidates(NamedTuple):
    """The angles at hand, and what became of those before."""

    links: Array  # (6, 3, 4)
    theta: Array  # (6,) theta_1 .. theta_6 [rad]
    rotation: Array  # (3, 3) what the last joints must make together
    state: NDArray[np.int64]  # (5,)


def make_candidates() -> Candidates:
    """Fresh work arrays."""
    return Candidates(np.zeros((6, 3, 4)), np.zeros(6), np.zeros((3, 3)), np.zeros(5, np.int64))


class Pair(NamedTuple):
    """Two solutions for an angle, or fewer."""

    middle: float  # [rad]
    half: float  # [rad]; negative for no solution
    fold: int  # 1 where they nearly meet, 0 otherwise
    free: int  # 1 where any angle solves it: middle is the seed's, half is 0


def slack_after(folds: int) -> float:
    """How far beyond its edge an equation may be: angles at a fold before it are exact to a square root only."""
    return EDGE_SLACK_AFTER_FOLD if folds > 0 else EDGE_SLACK


def pair_of(a: float, b: float, c: float, seed: float, slack: float) -> Pair:
    """The angles with a cos(theta) + b sin(theta) = c; lengths in units of the arm's."""
    square = a * a + b * b
    if square < FREE_ANGLE * FREE_ANGLE:
        return Pair(seed, 0.0 if abs(c) < FREE_ANGLE else -1.0, 0, 1)
    size = math.sqrt(square)
    inside = (size - c) * (size + c)
    if not inside >= -slack * square:
        return Pair(0.0, -1.0, 0, 0)
    root = math.sqrt(max(inside, 0.0))
    if inside < slack * square:
        return fold_at(math.atan2(b, a), root, c)
    return Pair(math.atan2(b, a), math.atan2(root, c), 0, 0)


def fold_at(middle: float, y: float, x: float) -> Pair:
    """Two solutions that nearly meet, middle + and - the angle of (x, y), y not negative: there or half a turn away."""
    return Pair(middle, math.atan2(y, x), 1, 0) if x > 0.0 else Pair(middle + math.pi, math.atan2(y, -x), 1, 0)


def angle_from_to(ax: float, ay: float, bx: float, by: float) -> float:
    """The angle that turns (ax, ay) into (bx, by)."""
    return math.atan2(ax * by - ay * bx, ax * bx + ay * by)


def skips(pair: Pair, sign: float) -> bool:
    """Whether a sign of half gives nothing of its own."""
    if pair.half < 0.0:
        return True
    return sign != 0.0 if pair.free > 0 else sign == 0.0 and pair.fold == 0


class Triangle(NamedTuple):
    """Where a joint turns axis h until it encloses an angle with axis k: two sides of a spherical triangle."""

    k: Vec
    h: Vec
    a: float  # from the joint's own axis to k [rad]
    b: float  # to h
    middle: float  # [rad], the angle at which they are nearest
    alike: bool  # whether k and h may come to lie on one line


def triangle_of(k: Vec, h: Vec) -> Triangle:
    """The triangle of two unit vectors, seen from a joint that turns about z."""
    a = math.atan2(math.hypot(k[0], k[1]), k[2])
    b = math.atan2(math.hypot(h[0], h[1]), h[2])
    alike = abs(a - b) < EXACT_STRUCTURE or abs(a + b - math.pi) < EXACT_STRUCTURE
    return Triangle(k, h, a, b, angle_from_to(h[0], h[1], k[0], k[1]), alike)


def pair_of_triangle(triangle: Triangle, sine: float, cosine: float, slack: float) -> Pair:
    """The angles at which k and h enclose a given angle; half angles are exact at its flat ends, too.

    Free where k and h are on one line: what turns about both is not determined.
    """
    a, b, theta = triangle.a, triangle.b, math.atan2(sine, cosine)
    top = math.sin(0.5 * (theta + a - b)) * math.sin(0.5 * (theta - a + b))
    bottom = math.sin(0.5 * (a + b + theta)) * math.sin(0.5 * (a + b - theta))
    least = min(top, bottom)
    if not least >= -slack:
        return Pair(0.0, -1.0, 0, 0)
    y, x = math.sqrt(max(top, 0.0)), math.sqrt(max(bottom, 0.0))
    half = 2.0 * math.atan2(y, x)
    if triangle.alike and sine < ALIGNED_SINE:
        return Pair(triangle.middle + half, 0.0, 0, 1)
    # Axes that may align do so without a fold: both angles meet, but the joints beside turn the opposite way.
    if least < slack and not (triangle.alike and sine < SMALL_SINE):
        return fold_at(triangle.middle, 2.0 * x * y, x * x - y * y)
    return Pair(triangle.middle, half, 0, 0)


def turned_about_z(angle: float, v: Vec) -> Vec:
    """Rz(angle) v."""
    c, s = math.cos(angle), math.sin(angle)
    return (c * v[0] - s * v[1], s * v[0] + c * v[1], v[2])


def fill_rest(work: Candidates, known: int) -> None:
    """Fill rotation with what the other joints must make: (L_6 Rz(theta_1) L_1 .. Rz(theta_known) L_known)^T."""
    links, rotation = work.links, work.rotation
    for column in range(3):
        for row in range(3):
            rotation[row, column] = links[5, column, row]
    for i in range(known):
        c, s = math.cos(work.theta[i]), math.sin(work.theta[i])
        for column in range(3):
            x, y = rotation[0, column], rotation[1, column]
            v = turned_back_by(links[i], (c * x + s * y, c * y - s * x, rotation[2, column]))
            for row in range(3):
                rotation[row, column] = v[row]


def add_candidate(arm: SixArm, query: PoseQuery, work: Candidates, branches: BranchWork, middle: bool) -> None:
    """Add what the angles theta lead to: a branch, or both of the fold that they are the middle of."""
    state, q = work.state, branches.newton.q
    for i in range(6):
        q[joint_of(arm.form_labelling, i)] = work.theta[i]
    if state[FOLDS] > 1:
        state[DOUBTFUL] = 1
    if middle and state[FREE] == 0:
        state[ADDED] += add_fold(query, branches)
        return
    added = add_branch(query, branches, 1.0 if state[FREE] > 0 else 0.0)
    state[ADDED] += added
    if not added and (state[FOLDS] == 0 or state[FREE] > 0):
        state[UNSETTLED] = 1
