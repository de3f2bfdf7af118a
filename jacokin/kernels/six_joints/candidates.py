"""What the forms for common structures share: angles of one labelling, two at a time, and branches from them.

Both forms solve for one angle after the other, each from a cos(theta) + b sin(theta) = c, which has two solutions,
middle - half and middle + half. Where they nearly meet, so do two branches: then the middle leads to both of a fold.
Angles go from one equation to the next as cosine and sine.
"""

from __future__ import annotations

import math
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.branches import (
    ABREAST,
    FAMILY,
    FOUND,
    FRAME,
    BranchWork,
    PoseQuery,
    add_fold,
    add_verified,
    collect,
    take_candidate,
    take_nearest,
    verify,
)
from jacokin.kernels.six_joints.equations import turned_back_by
from jacokin.kernels.six_joints.loop import SixArm, joint_of
from jacokin.kernels.tolerances import (
    ALIGNED_SINE,
    EDGE_SLACK,
    EDGE_SLACK_AFTER_FOLD,
    EXACT_STRUCTURE,
    FREE_ANGLE,
    NEARLY,
    SMALL_SINE,
)
from jacokin.kernels.trigonometry import angle_of, sin_cos
from jacokin.kernels.vector import Vec

#: What `Candidates.state` counts: angles that nothing determines, folds among the angles so far; and where not 0, that
#: the form does not settle this target, and that branches may be missing.
FormState = IntEnum("FormState", "FREE FOLDS UNSETTLED DOUBTFUL", start=0)
#: Marks of what is collected: the middle of a fold, a candidate that must be a branch for the form to settle, another.
CandidateMark = IntEnum("CandidateMark", "FOLD NEEDED POSSIBLE", start=0)
#: Rows of `branches.Lanes` until candidates are verified, each for six joints.
COSINES, SINES = FRAME, FRAME + 6
#: Signs of half in the order to try, for a fold the middle first.
SIGNS = (0.0, 1.0, -1.0)


class Candidates(NamedTuple):
    """The angles at hand, and what became of those before."""

    links: Array  # (6, 3, 4)
    theta: Array  # (6,) theta_1 .. theta_6 [rad], NaN for that of the direction (cosine, sine)
    cosine: Array  # (6,) of them; of one of the last joints, the direction's coordinates of any size
    sine: Array  # (6,)
    rotation: Array  # (3, 3) what the last joints must make together
    state: NDArray[np.int64]  # (4,)
    slack: Array  # (1,) how far beyond its edge the equation of the last angles may be, see `slack_after`


def make_candidates() -> Candidates:
    """Fresh work arrays."""
    return Candidates(
        np.zeros((6, 3, 4)),
        np.zeros(6),
        np.zeros(6),
        np.zeros(6),
        np.zeros((3, 3)),
        np.zeros(4, np.int64),
        np.zeros(1),
    )


#: Cosine and sine of an angle.
Unit = tuple[float, float]


def unit_of(x: float, y: float) -> Unit:
    """The direction of (x, y); that of the angle 0 for none."""
    size = math.sqrt(x * x + y * y)
    return (x / size, y / size) if size > 0.0 else (1.0, 0.0)


def unit_from_to(ax: float, ay: float, bx: float, by: float) -> Unit:
    """The turn that takes the direction (ax, ay) to (bx, by)."""
    return unit_of(ax * bx + ay * by, ax * by - ay * bx)


def turn_from_to(ax: float, ay: float, bx: float, by: float) -> Unit:
    """The turn that takes the vector (ax, ay) to the direction of (bx, by), as a vector of any length."""
    return ax * bx + ay * by, ax * by - ay * bx


def angle_from_to(ax: float, ay: float, bx: float, by: float) -> float:
    """The angle [rad] from the vector (ax, ay) to (bx, by), of any length."""
    return angle_of(ax * by - ay * bx, ax * bx + ay * by)


class Pair(NamedTuple):
    """Two solutions for an angle, middle - half and middle + half, or fewer."""

    middle: Unit
    half: Unit
    there: int  # 0 for no solution
    fold: int  # 1 where they nearly meet, or would nearly be there, 0 otherwise
    free: int  # 1 where any angle solves it: the one at hand is the middle, half is 0
    angle: float  # [rad] the middle where it is free


def no_pair(beyond: float) -> Pair:
    """No solution, by so much beyond where one would be."""
    return Pair((1.0, 0.0), (1.0, 0.0), 0, int(beyond < NEARLY), 0, 0.0)


def is_open(pair: Pair, free: int) -> bool:
    """Whether there may be a solution where there is none: for what the structure misses, or as others are free."""
    return pair.there == 0 and pair.fold + free > 0


def free_pair(angle: float) -> Pair:
    """Any angle solves it, and this one [rad] is taken."""
    s, c = sin_cos(angle)
    return Pair((c, s), (1.0, 0.0), 1, 0, 1, angle)


def slack_after(folds: int) -> float:
    """How far beyond its edge an equation may be: angles at a fold before it are exact to a square root only."""
    return EDGE_SLACK_AFTER_FOLD if folds > 0 else EDGE_SLACK


def pair_of(a: float, b: float, c: float, seed: float, slack: float) -> Pair:
    """The angles with a cos(theta) + b sin(theta) = c; lengths in units of the arm's."""
    square = a * a + b * b
    if square < FREE_ANGLE * FREE_ANGLE:
        return free_pair(seed) if abs(c) < FREE_ANGLE else no_pair(abs(c))
    size = math.sqrt(square)
    inside = (size - c) * (size + c)
    if not inside >= -slack * square:
        return no_pair(min(-inside / square, abs(c)))
    middle, root = (a / size, b / size), math.sqrt(max(inside, 0.0))
    if inside < slack * square:
        return fold_at(middle, c, root)
    return Pair(middle, (c / size, root / size), 1, 0, 0, 0.0)


def fold_at(middle: Unit, x: float, y: float) -> Pair:
    """Two solutions that nearly meet, middle + and - the angle of (x, y), y not negative: there or half a turn away."""
    if x > 0.0:
        return Pair(middle, unit_of(x, y), 1, 1, 0, 0.0)
    return Pair((-middle[0], -middle[1]), unit_of(-x, y), 1, 1, 0, 0.0)


def skips(pair: Pair, sign: float) -> bool:
    """Whether a sign of half gives nothing of its own."""
    if pair.there == 0:
        return True
    return sign != 0.0 if pair.free > 0 else sign == 0.0 and pair.fold == 0


def take(work: Candidates, i: int, pair: Pair, sign: float) -> None:
    """Let theta_(i + 1) be middle + sign half."""
    (c, s), (hc, hs) = pair.middle, pair.half
    hs *= sign
    if sign != 0.0:
        c, s = c * hc - s * hs, s * hc + c * hs
    take_unit(work, i, (c, s))
    if pair.free > 0:
        work.theta[i] = pair.angle


def take_unit(work: Candidates, i: int, unit: Unit) -> None:
    """Let theta_(i + 1) be the angle with this cosine and sine, which is worked out with those of other candidates."""
    work.theta[i], work.cosine[i], work.sine[i] = math.nan, unit[0], unit[1]


def take_angle(work: Candidates, i: int, angle: float) -> None:
    """Let theta_(i + 1) be this angle [rad]."""
    work.theta[i] = angle
    work.sine[i], work.cosine[i] = sin_cos(angle)


class Triangle(NamedTuple):
    """Where a joint turns axis h until it encloses an angle with axis k: two sides of a spherical triangle."""

    k: Vec
    h: Vec
    middle: Unit  # of the angle at which they are nearest
    near: Unit  # of half the difference of both sides: from the joint's own axis to k, and to h
    far: Unit  # of half their sum
    alike: bool  # whether k and h may come to lie on one line


def triangle_of(k: Vec, h: Vec) -> Triangle:
    """The triangle of two unit vectors, seen from a joint that turns about z."""
    a = angle_of(math.sqrt(k[0] * k[0] + k[1] * k[1]), k[2])
    b = angle_of(math.sqrt(h[0] * h[0] + h[1] * h[1]), h[2])
    alike = abs(a - b) < EXACT_STRUCTURE or abs(a + b - math.pi) < EXACT_STRUCTURE
    (near_s, near_c), (far_s, far_c) = sin_cos(0.5 * (a - b)), sin_cos(0.5 * (a + b))
    return Triangle(k, h, unit_from_to(h[0], h[1], k[0], k[1]), (near_c, near_s), (far_c, far_s), alike)


def half_of(sine: float, cosine: float) -> Unit:
    """Of half an angle that is not negative, exact near 0 and near pi as well."""
    if cosine >= 0.0:
        c = math.sqrt(0.5 + 0.5 * cosine)
        return (c, 0.5 * sine / c)
    s = math.sqrt(0.5 - 0.5 * cosine)
    return (0.5 * sine / s, s)


def pair_of_triangle(triangle: Triangle, sine: float, cosine: float, slack: float) -> Pair:
    """The angles at which k and h enclose a given angle; half angles are exact at its flat ends, too.

    Free where k and h are on one line: what turns about both is not determined.
    """
    (c, s), (near_c, near_s), (far_c, far_s) = half_of(sine, cosine), triangle.near, triangle.far
    # Sines of half of angle + near, angle - near, far + angle, far - angle.
    top = (s * near_c + c * near_s) * (s * near_c - c * near_s)
    bottom = (far_s * c + far_c * s) * (far_s * c - far_c * s)
    least = min(top, bottom)
    if not least >= -slack:
        return no_pair(-least)
    top, bottom = max(top, 0.0), max(bottom, 0.0)
    x, y = bottom - top, 2.0 * math.sqrt(top * bottom)
    if triangle.alike and sine < ALIGNED_SINE:
        (mc, ms), (hc, hs) = triangle.middle, unit_of(x, y)
        mc, ms = mc * hc - ms * hs, ms * hc + mc * hs
        return Pair((mc, ms), (1.0, 0.0), 1, 0, 1, angle_of(ms, mc))
    # Axes that may align do so without a fold: both angles meet, but the joints beside turn the opposite way.
    if least < slack and not (triangle.alike and sine < SMALL_SINE):
        return fold_at(triangle.middle, x, y)
    return Pair(triangle.middle, unit_of(x, y), 1, 0, 0, 0.0)


def unturned_about_z(unit: Unit, v: Vec) -> Vec:
    """Rz^T v."""
    c, s = unit
    return (c * v[0] + s * v[1], c * v[1] - s * v[0], v[2])


def fill_rest(work: Candidates, known: int) -> None:
    """Fill rotation with what the other joints must make: (L_6 Rz(theta_1) L_1 .. Rz(theta_known) L_known)^T."""
    links, rotation = work.links, work.rotation
    for column in range(3):
        for row in range(3):
            rotation[row, column] = links[5, column, row]
    for i in range(known):
        c, s = work.cosine[i], work.sine[i]
        for column in range(3):
            x, y = rotation[0, column], rotation[1, column]
            v = turned_back_by(links[i], (c * x + s * y, c * y - s * x, rotation[2, column]))
            for row in range(3):
                rotation[row, column] = v[row]


def add_candidate(arm: SixArm, query: PoseQuery, work: Candidates, branches: BranchWork, middle: bool) -> None:
    """Collect what the angles theta lead to: a branch, or both of the fold that they are the middle of."""
    state, lanes = work.state, branches.lanes
    if lanes.filled[0] == ABREAST:
        add_candidates(query, work, branches)
    n = lanes.filled[0]
    for i in range(6):
        j = joint_of(arm.form_labelling, i)
        lanes.rows[FOUND + j, n] = work.theta[i]
        lanes.rows[COSINES + j, n], lanes.rows[SINES + j, n] = work.cosine[i], work.sine[i]
    is_free, folds = state[FormState.FREE] > 0, state[FormState.FOLDS]
    if folds > 1:
        state[FormState.DOUBTFUL] = 1
    needed = CandidateMark.NEEDED if folds == 0 or is_free else CandidateMark.POSSIBLE
    collect(branches, n, CandidateMark.FOLD if middle and not is_free else needed, 1.0 if is_free else 0.0)


def fill_angles(rows: Array) -> None:
    """Work out the angles of the candidates that are there as directions, side by side."""
    for j in range(6):
        for i in range(ABREAST):
            given, angle = rows[FOUND + j, i], angle_of(rows[SINES + j, i], rows[COSINES + j, i])
            rows[FOUND + j, i] = angle if given != given else given  # NaN for none


def add_last_candidates(query: PoseQuery, work: Candidates, branches: BranchWork) -> bool:
    """Add the branches that the collected candidates lead to: all, or one where the nearest is wanted and in no doubt.

    Returns:
        Whether it is that one.
    """
    state, lanes = work.state, branches.lanes
    sure = (
        branches.wanted[0] > 0
        and branches.filled[0] == 0
        and state[FormState.UNSETTLED] == 0
        and state[FormState.DOUBTFUL] == 0
    )
    for i in range(lanes.filled[0]):
        sure = sure and lanes.mark[i] == CandidateMark.NEEDED and lanes.rows[FAMILY, i] == 0.0
    fill_angles(lanes.rows)
    if sure and take_nearest(query, branches):
        return True
    add_candidates(query, work, branches)
    return False


def add_candidates(query: PoseQuery, work: Candidates, branches: BranchWork) -> None:
    """Add the branches that the collected candidates lead to."""
    fill_angles(branches.lanes.rows)
    for i in range(verify(query, branches)):
        mark = branches.lanes.mark[i]
        if mark == CandidateMark.FOLD:
            take_candidate(branches, i)
            add_fold(query, branches)
        elif not add_verified(query, branches, i) and mark == CandidateMark.NEEDED:
            work.state[FormState.UNSETTLED] = 1
