"""Six joints with a spherical wrist at an end of their chain, where the target turns: at most eight configurations.

Numbered as in `six_joints.spherical_wrist`, the wrist is joints 4, 5 and 6, and the link that carries the target is the
last one, which alone changes with the parameter. Where axes 1 and 2 meet and the wrist's are square, theta_3, theta_2
and theta_5 have two solutions each, and the others follow: rows that are smooth between folds, as in `seven_joints`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from jacokin.arrays import Array
from jacokin.kernels.closed_form.arm import unpack_arm
from jacokin.kernels.closed_form.resultant import SAMPLES, SPACING
from jacokin.kernels.closed_form.roots import RootWork
from jacokin.kernels.six_joints.candidates import angle_from_to
from jacokin.kernels.six_joints.equations import turned_back_by, turned_by
from jacokin.kernels.six_joints.loop import LABELLINGS, Form, SixArm, fill_link, fill_links, joint_of, turn_round
from jacokin.kernels.six_joints.spherical_wrist import (
    Reach,
    at,
    at_turn,
    combined,
    direction_of,
    parts_of,
    reach_of,
    wave_of,
)
from jacokin.kernels.solution_set.seven_joints import (
    LAST_STEPS,
    ROUNDING,
    about_z,
    add_folds,
    add_sample,
    half_between,
    row_of,
    solve_wrist,
    sort_folds,
)
from jacokin.kernels.solution_set.slices import AFTER, SixJoints, turn_target
from jacokin.kernels.tolerances import DISTINCT, STRUCTURE_TOLERANCE
from jacokin.kernels.trigonometry import angle_of, sin_cos
from jacokin.kernels.vector import Vec


def begin_end_wrist(six: SixJoints) -> bool:
    """Fill the links for a target; whether six joints are of this kind."""
    arm, links = unpack_arm(six.arm).six, six.links
    if arm.form != Form.SPHERICAL_WRIST or 0 < arm.form_labelling < LABELLINGS - 1:
        return False
    fill_links(six.chain, six.T, arm.scale, arm.form_labelling, links)
    is_square = max(abs(links[3, 2, 2]), abs(links[4, 2, 2])) <= STRUCTURE_TOLERANCE
    return bool(is_square and abs(reach_of(arm, links).cross) < DISTINCT)


def reach_at(arm: SixArm, six: SixJoints, p: float) -> Reach:
    """What brings the wrist to its place at a value of the parameter, for which the last link is filled."""
    turn_target(six.T, six.axis, p, six.turned)
    fill_link(six.chain, six.turned, arm.scale, 5, six.links[5])
    if arm.form_labelling > 0:
        turn_round(six.links[5])
    return reach_of(arm, six.links)


class FoldEquations(NamedTuple):
    """Functions of a target that vanish where configurations meet, and the sizes of their terms."""

    three: float  # the discriminant of theta_3: as the target turns, a trigonometric polynomial of degree 2
    even: float  # that of theta_2 is even + odd times a root of the former, and minus: of degrees 2 and 1
    odd: float
    size_of_three: float
    size_of_two: float


def fold_equations(reach: Reach) -> FoldEquations:
    """What vanishes where configurations meet."""
    ex, ey, along_u, along_v, square = direction_of(reach)
    rest = combined(reach.distance, along_v, reach.height, -along_u)
    h = rest[1] * rest[1] + rest[2] * rest[2]
    r2 = h - rest[0] * rest[0]
    # h times a wave is its first number plus r times its second, for both signs of the root r.
    a0, a1 = parts_of(combined(wave_of(reach, 0), ex, wave_of(reach, 1), ey), rest, h)
    b0, b1 = parts_of(combined(wave_of(reach, 0), ey, wave_of(reach, 1), -ex), rest, h)
    c0, c1 = parts_of(combined(reach.distance, along_u / square, reach.height, along_v / square), rest, h)
    even = a0 * a0 + b0 * b0 - c0 * c0 + r2 * (a1 * a1 + b1 * b1 - c1 * c1)
    size = a0 * a0 + b0 * b0 + c0 * c0 + abs(r2) * (a1 * a1 + b1 * b1 + c1 * c1)
    return FoldEquations(r2, even, 2.0 * (a0 * a1 + b0 * b1 - c0 * c1), h + rest[0] * rest[0], size)


def find_wrist_folds(six: SixJoints, rounding: float, waves: Array, roots: RootWork, folds: Array) -> tuple[int, bool]:
    """Fill folds with the values of the parameter where configurations meet; see `seven_joints.find_folds`.

    Rounding is what may change of equations, relative to their largest terms.


    Theta_2 is at a fold where the product of its discriminants for both theta_3 vanishes, or where the one that they
    have in common does: arms have that whose elbow has no offset.
    """
    arm = unpack_arm(six.arm).six
    waves[:] = 0.0
    three, two, odd = 0.0, 0.0, 0.0
    for j in range(SAMPLES):
        e = fold_equations(reach_at(arm, six, SPACING * j))
        three, two = max(three, e.size_of_three), max(two, e.size_of_two)
        odd = max(odd, abs(e.odd) * math.sqrt(abs(e.three)))
        add_sample(j, e.three, 2, waves[0])
        add_sample(j, e.even, 2, waves[1])
        add_sample(j, e.even * e.even - e.three * e.odd * e.odd, 4, waves[2])
    count, single = add_folds(rounding * three, waves[0], LAST_STEPS, 0, roots, folds)
    if odd <= ROUNDING * two:
        count, alone = add_folds(rounding * two, waves[1], LAST_STEPS, count, roots, folds)
    else:
        count, alone = add_folds(2.0 * rounding * two * two, waves[2], LAST_STEPS, count, roots, folds)
    sort_folds(count, folds)
    return count, single and alone and three > 0.0 and two > 0.0


def solve_wrist_rows(six: SixJoints, kind: int, p: float, low: int, high: int, rows: Array, missed: float) -> None:
    """Fill rows low to high - 1 with the configurations at a value of the parameter.

    Args:
        six: the joints, and their target.
        kind: which joint is the parameter, see `slices`.
        p: its value [rad].
        low: first row, of 4 a + 2 b + c with signs a, b, c.
        high: row after the last one.
        rows: (8, 7) filled; NaN in the first column where there is none.
        missed: share of its reach by which a joint may miss its equation, to stand where it misses it least.
    """
    for i in range(low, high):
        rows[i, 0] = math.nan
    arm, links = unpack_arm(six.arm).six, six.links
    reach = reach_at(arm, six, p)
    ex, ey, along_u, along_v, square = direction_of(reach)
    rest = combined(reach.distance, along_v, reach.height, -along_u)
    coordinate = combined(reach.distance, along_u / square, reach.height, along_v / square)
    r3 = math.sqrt(rest[1] * rest[1] + rest[2] * rest[2])
    if not abs(rest[0]) <= r3 * (1.0 + missed) or r3 == 0.0:
        return
    middle3, half3 = angle_of(rest[2], rest[1]), half_between(-rest[0], r3)
    for i in range(2):
        if 4 * i >= high or 4 * i + 4 <= low:
            continue
        theta3 = middle3 + (half3 if i == 0 else -half3)
        s3, c3 = sin_cos(theta3)
        f = (at_turn(reach, 0, c3, s3), at_turn(reach, 1, c3, s3), at_turn(reach, 2, c3, s3))
        a, b, c = f[0] * ex + f[1] * ey, f[0] * ey - f[1] * ex, at(coordinate, c3, s3)
        r2 = math.sqrt(a * a + b * b)
        if not abs(c) <= r2 * (1.0 + missed) or r2 == 0.0:
            continue
        middle2, half2 = angle_of(b, a), half_between(c, r2)
        for k in range(2):
            n = 4 * i + 2 * k
            if n >= high or n + 2 <= low:
                continue
            theta2 = middle2 + (half2 if k == 0 else -half2)
            s2, c2 = sin_cos(theta2)
            g = turned_by(links[0], about_z(c2, s2, f))
            theta1 = angle_from_to(g[0] + links[0, 0, 3], g[1] + links[0, 1, 3], reach.W[0], reach.W[1])
            s1, c1 = sin_cos(theta1)
            turns = ((c1, s1), (c2, s2), (c3, s3))
            first, last = max(n, low), min(n + 2, high)
            for m in range(first, last):
                rows[m, column_of(arm, kind, 0)] = theta1
                rows[m, column_of(arm, kind, 1)] = theta2
                rows[m, column_of(arm, kind, 2)] = theta3
                rows[m, 6 if kind == AFTER else 0] = p
            solve_wrist(
                (links[3], links[4]),
                before_wrist(links, turns, row_of(links[5], 0)),
                before_wrist(links, turns, row_of(links[5], 1)),
                before_wrist(links, turns, row_of(links[5], 2)),
                (column_of(arm, kind, 3), column_of(arm, kind, 4), column_of(arm, kind, 5)),
                rows,
                first,
                last,
            )


def column_of(arm: SixArm, kind: int, i: int) -> int:
    """Index among seven angles of theta_(i + 1)."""
    j = joint_of(arm.form_labelling, i)
    return j if kind == AFTER else 6 - j


def before_wrist(links: Array, turns: tuple[tuple[float, float], ...], v: Vec) -> Vec:
    """A vector seen before joint 1, turned into the axes before joint 4, by cosine and sine of each joint between."""
    for i in range(3):
        c, s = turns[i]
        v = turned_back_by(links[i], about_z(c, -s, v))
    return v
