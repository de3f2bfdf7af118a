"""Axes 1 and 4 of a labelling stay in the plane that joints 2 and 3 move in, 4 and 5 meet: theta_6, theta_5, the plane.

Axes 2 and 3 are parallel and at right angles to axes 1 and 4, which they meet in O and C: so the plane through O across
axis 2 holds axis 1, C, and all of axis 4. Where joint 6 is known, everything is seen from link 5: axis 1 along m, and
the way D from O to B, where axes 4 and 5 meet. The direction z of axis 4, which joint 5 turns, is in their plane, and C
is on axis 4 at c from B, and at R, the length of the upper arm, from O:

    z . (D x m) = 0,    2 c z . D = R^2 - D . D - c^2.

D, m, D x m and D . D are linear in cosine and sine of theta_6, and z is in those of theta_5: two linear equations in
these, whose solution is on the unit circle. That is a polynomial of degree 4 in theta_6. Each root has two theta_1, on
either side of the plane. Where both equations are one, at a double root, it has two theta_5 as well.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from jacokin.arrays import Array
from jacokin.kernels.branches import FOUND, BranchWork, PoseQuery, is_apart
from jacokin.kernels.closed_form.roots import RootWork, find_roots
from jacokin.kernels.six_joints.candidates import (
    SIGNS,
    Candidates,
    FormState,
    add_candidate,
    add_candidates,
    add_last_candidates,
    fill_angles,
    pair_of,
    skips,
    slack_after,
    take,
    take_angle,
    take_unit,
    unit_from_to,
    unturned_about_z,
)
from jacokin.kernels.six_joints.equations import turned_back_by, turned_by
from jacokin.kernels.six_joints.loop import SixArm, column_of, fill_links
from jacokin.kernels.tolerances import FREE_ANGLE, SMALLEST_NOISE, TIMES_NOISE
from jacokin.kernels.trigonometry import fourier_samples
from jacokin.kernels.vector import Vec, cross, dot, mix

#: Of the polynomial in theta_6.
DEGREE = 4
#: At which it is sampled.
ANGLES = 2 * DEGREE + 1
ANGLE_SIN, ANGLE_COS, SHARE_SIN, SHARE_COS = fourier_samples(ANGLES, DEGREE)


class PlanarArm(NamedTuple):
    """The constants of one target, lengths scaled; D and m by 1, cosine and sine of theta_6."""

    k: Vec  # axis 4 before joint 5 turns, seen from link 5
    c: float
    square: float  # of R
    D0: Vec
    Dc: Vec
    Ds: Vec
    m0: Vec
    mc: Vec
    ms: Vec


class Lines(NamedTuple):
    """What z must be where theta_6 is known: its products with D and w = D x m."""

    D: Vec
    m: Vec
    w: Vec
    along: float  # z . D, without the part that joint 5 does not turn
    across: float  # z . w, likewise


def branches_of_planar_arm(
    arm: SixArm, query: PoseQuery, work: Candidates, roots: RootWork, branches: BranchWork
) -> bool:
    """Add every branch; False where the general way must look after what is left open."""
    links, state, count = work.links, work.state, 0
    for i in range(len(state)):
        state[i] = 0
    fill_links(query.chain, query.T, arm.scale, arm.form_labelling, links)
    planar = planar_arm_of(links)
    size = fill_polynomial(planar, roots.cosine, roots.sine)
    for i in range(find_roots(noise_of_polynomial(arm, size), 0.0, roots)):
        take_angle(work, 5, roots.roots[i, 0])
        if roots.roots[i, 1] == 0.0:
            turn_five(arm, planar, query, work, branches)
            count += 2
        elif roots.roots[i, 2] > 0.0:
            turn_five_twice(arm, planar, query, work, branches)
            count += 4
        else:
            state[FormState.UNSETTLED] = 1
    if are_apart(branches) and add_last_candidates(query, work, branches):
        return True
    add_candidates(query, work, branches)
    # Where two lead to one branch, another may be near one of them.
    return bool(state[FormState.UNSETTLED] == 0 and branches.filled[0] == count)


def are_apart(branches: BranchWork) -> bool:
    """Whether the candidates that were collected are different branches, whatever verification moves them by."""
    rows = branches.lanes.rows
    fill_angles(rows)
    for i in range(branches.lanes.filled[0]):
        for n in range(i):
            same = True
            for j in range(FOUND, FOUND + 6):
                same = same and not is_apart(rows[j, i] - rows[j, n])
            if same:
                return False
    return True


def planar_arm_of(links: Array) -> PlanarArm:
    """The constants of one target."""
    first, fourth, fifth, last = links[0], links[3], links[4], links[5]
    height, B = first[2, 3] + meeting(first) * first[2, 2], meeting(fourth)
    # O and axis 1, seen before joint 6.
    a = column_of(last, 2)
    p = (last[0, 3] + height * a[0], last[1, 3] + height * a[1], last[2, 3] + height * a[2])
    up, t = turned_by(fifth, (0.0, 0.0, p[2])), column_of(fifth, 3)
    return PlanarArm(
        (fourth[2, 0], fourth[2, 1], fourth[2, 2]),
        meeting(links[2]) - fourth[2, 3] - B * fourth[2, 2],
        links[1, 0, 3] * links[1, 0, 3] + links[1, 1, 3] * links[1, 1, 3],
        (-t[0] - up[0], -t[1] - up[1], B - t[2] - up[2]),
        turned_by(fifth, (-p[0], -p[1], 0.0)),
        turned_by(fifth, (p[1], -p[0], 0.0)),
        turned_by(fifth, (0.0, 0.0, a[2])),
        turned_by(fifth, (a[0], a[1], 0.0)),
        turned_by(fifth, (-a[1], a[0], 0.0)),
    )


def meeting(link: Array) -> float:
    """Where the axis behind a link meets the one before it, along itself."""
    x, y = link[0, 2], link[1, 2]
    return float(-(link[0, 3] * x + link[1, 3] * y) / (x * x + y * y))


def lines_at(planar: PlanarArm, c: float, s: float) -> Lines:
    """Both linear equations where theta_6 has this cosine and sine."""
    D = mix(planar.D0, 1.0, planar.Dc, c, planar.Ds, s)
    m = mix(planar.m0, 1.0, planar.mc, c, planar.ms, s)
    w, height = cross(D, m), planar.k[2]
    along = 0.5 * (planar.square - dot(D, D) - planar.c * planar.c) / planar.c - height * D[2]
    return Lines(D, m, w, along, -height * w[2])


def fill_polynomial(planar: PlanarArm, cosine: Array, sine: Array) -> float:
    """Fill the coefficients of the polynomial in theta_6; returns the size of its largest parts."""
    turned, largest = planar.k[0] * planar.k[0] + planar.k[1] * planar.k[1], 0.0
    for n in range(len(cosine)):
        cosine[n], sine[n] = 0.0, 0.0
    for j in range(ANGLES):
        at = lines_at(planar, ANGLE_COS[j], ANGLE_SIN[j])
        x, y, determinant = solution_of(at)
        a, b = x * x + y * y, turned * determinant * determinant
        largest = max(largest, a + b)
        for n in range(DEGREE + 1):
            cosine[n] += SHARE_COS[j, n] * (a - b)
            sine[n] += SHARE_SIN[j, n] * (a - b)
    return largest


def solution_of(at: Lines) -> tuple[float, float, float]:
    """By Cramer's rule: x and y of z times the determinant, and that."""
    D, w = at.D, at.w
    return (
        at.along * w[1] - at.across * D[1],
        D[0] * at.across - w[0] * at.along,
        D[0] * w[1] - D[1] * w[0],
    )


def noise_of_polynomial(arm: SixArm, size: float) -> float:
    """What rounding, and what an arm misses the structure by, change of its values, from the size of its parts."""
    return (SMALLEST_NOISE + TIMES_NOISE * arm.first) * size


def theta_5_apart(planar: PlanarArm, z: complex) -> float:
    """How far theta_5 is from the real axis where z = exp(i theta_6) is a root [rad]."""
    c, s = 0.5 * (z + 1.0 / z), -0.5j * (z - 1.0 / z)
    D = planar.D0[0] + c * planar.Dc[0] + s * planar.Ds[0], planar.D0[1] + c * planar.Dc[1] + s * planar.Ds[1]
    m = planar.m0[0] + c * planar.mc[0] + s * planar.ms[0], planar.m0[1] + c * planar.mc[1] + s * planar.ms[1]
    D2, m2 = planar.D0[2] + c * planar.Dc[2] + s * planar.Ds[2], planar.m0[2] + c * planar.mc[2] + s * planar.ms[2]
    w = D[1] * m2 - D2 * m[1], D2 * m[0] - D[0] * m2
    along = 0.5 * (planar.square - D[0] * D[0] - D[1] * D[1] - D2 * D2 - planar.c * planar.c) / planar.c
    along -= planar.k[2] * D2
    across = -planar.k[2] * (D[0] * m[1] - D[1] * m[0])
    x, y = along * w[1] - across * D[1], D[0] * across - w[0] * along
    ahead, behind = x + 1.0j * y, x - 1.0j * y
    a, b = ahead.real**2 + ahead.imag**2, behind.real**2 + behind.imag**2
    return 0.25 * abs(math.log(a / b)) if a > 0.0 and b > 0.0 else math.inf


def turn_five(arm: SixArm, planar: PlanarArm, query: PoseQuery, work: Candidates, branches: BranchWork) -> None:
    """From theta_6: theta_5, and the branches on both sides of the plane."""
    at = lines_at(planar, work.cosine[5], work.sine[5])
    x, y, determinant = solution_of(at)
    if determinant < 0.0:
        x, y = -x, -y
    take_unit(work, 4, unit_from_to(x, y, planar.k[0], planar.k[1]))
    in_the_plane(arm, planar, at, query, work, branches)


def turn_five_twice(arm: SixArm, planar: PlanarArm, query: PoseQuery, work: Candidates, branches: BranchWork) -> None:
    """From a theta_6 at which both equations are one: both theta_5, from the one with the longer sides."""
    k, at = planar.k, lines_at(planar, work.cosine[5], work.sine[5])
    a, b, c = at.w[0], at.w[1], at.across
    if a * a + b * b < at.D[0] * at.D[0] + at.D[1] * at.D[1]:
        a, b, c = at.D[0], at.D[1], at.along
    # z is k turned back.
    fives = pair_of(a * k[0] + b * k[1], a * k[1] - b * k[0], c, 0.0, slack_after(1))
    for i in range(3):
        if not skips(fives, SIGNS[i]):
            take(work, 4, fives, SIGNS[i])
            in_the_plane(arm, planar, at, query, work, branches)


def in_the_plane(
    arm: SixArm, planar: PlanarArm, at: Lines, query: PoseQuery, work: Candidates, branches: BranchWork
) -> None:
    """From theta_6 and theta_5: the branches on both sides of the plane."""
    z = unturned_about_z((work.cosine[4], work.sine[4]), planar.k)
    normal, other = cross(at.m, z), cross(at.m, at.D)
    if dot(other, other) > dot(normal, normal):
        normal = other
    if dot(normal, normal) < FREE_ANGLE * FREE_ANGLE:
        work.state[FormState.UNSETTLED] = 1  # nothing determines theta_1
        return
    # Seen before joint 1: axis 2 on one side, the way from O to C, axes 4 and 5.
    normal = before_one(work, normal)
    C = before_one(work, mix(at.D, 1.0, z, planar.c, z, 0.0))
    z, five = before_one(work, z), before_one(work, (0.0, 0.0, 1.0))
    for side in range(2):
        sign = 1.0 if side == 0 else -1.0
        place_arm(work, (sign * normal[0], sign * normal[1], sign * normal[2]), C, z, five)
        add_candidate(arm, query, work, branches, False)


def place_arm(work: Candidates, axis_2: Vec, C: Vec, z: Vec, five: Vec) -> None:
    """From axis 2, the way from O to C, and axes 4 and 5, all seen before joint 1: theta_1 to theta_4."""
    links = work.links
    take_unit(work, 0, unit_from_to(links[0, 0, 2], links[0, 1, 2], axis_2[0], axis_2[1]))
    a = behind(work, 0, C)
    take_unit(work, 1, unit_from_to(links[1, 0, 3], links[1, 1, 3], a[0], a[1]))
    b = behind(work, 1, behind(work, 0, z))
    take_unit(work, 2, unit_from_to(links[2, 0, 2], links[2, 1, 2], b[0], b[1]))
    b = behind(work, 2, behind(work, 1, behind(work, 0, five)))
    take_unit(work, 3, unit_from_to(links[3, 0, 2], links[3, 1, 2], b[0], b[1]))


def before_one(work: Candidates, v: Vec) -> Vec:
    """A vector of link 5 before joint 1: (L_5 Rz(theta_6) L_6)^T v."""
    v = unturned_about_z((work.cosine[5], work.sine[5]), turned_back_by(work.links[4], v))
    return turned_back_by(work.links[5], v)


def behind(work: Candidates, i: int, v: Vec) -> Vec:
    """A vector seen behind joint i + 1 and its link: (Rz(theta_(i + 1)) L_(i + 1))^T v."""
    return turned_back_by(work.links[i], unturned_about_z((work.cosine[i], work.sine[i]), v))
