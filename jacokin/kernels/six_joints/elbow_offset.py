"""A planar arm whose axis 4 passes joint 3 at a distance, as of an xArm 6: theta_6, theta_5, the side of the plane.

As of a `planar_arm`, axes 2 and 3 are parallel, axis 1 meets axis 2 at a right angle in O, axis 4 lies in the plane
through O across axis 2, and axes 4 and 5 meet in B. But C, where axis 3 passes that plane, is beside axis 4: with u at
right angles to z, the direction of axis 4, in the plane,

    C - O = D + c z - f u,    z . (D x m) = 0,    |C - O| = R,

where f is the offset and D, m, c and R are those of a planar arm. With k = z . D and v = u . D, k^2 + v^2 = D . D, the
last one is 2 c k - 2 f v = K = R^2 - D . D - c^2 - f^2, so that k is one of two values: y0 + d and y0 - d, less a part
that joint 5 does not turn. Each makes two linear equations in cosine and sine of theta_5, whose solution is on the unit
circle where P = a y^2 - 2 b y + g is zero. The product of both P, in which d has even powers only, is a polynomial of
degree 8 in theta_6. Axis 3 is on that side of the plane to which v belongs: each root has one branch.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from jacokin.arrays import Array
from jacokin.kernels.branches import BranchWork, PoseQuery
from jacokin.kernels.closed_form.resultant import DEGREE, square_root
from jacokin.kernels.closed_form.roots import RootWork, find_roots
from jacokin.kernels.six_joints.candidates import (
    Candidates,
    FormState,
    add_candidate,
    add_candidates,
    add_last_candidates,
    take_angle,
    take_unit,
    unit_from_to,
    unturned_about_z,
)
from jacokin.kernels.six_joints.loop import SixArm, fill_links
from jacokin.kernels.six_joints.planar_arm import (
    PlanarArm,
    are_apart,
    before_one,
    noise_of_polynomial,
    place_arm,
    planar_arm_of,
)
from jacokin.kernels.tolerances import FREE_ANGLE
from jacokin.kernels.trigonometry import fourier_samples
from jacokin.kernels.vector import Vec, cross, dot, mix

#: At which the polynomial in theta_6 is sampled.
ANGLES = 2 * DEGREE + 1
ANGLE_SIN, ANGLE_COS, SHARE_SIN, SHARE_COS = fourier_samples(ANGLES, DEGREE)
#: In units of the arm's length; where v is smaller, rounding of a root leaves open which side it is.
EITHER_SIDE = 1e-4


class OffsetArm(NamedTuple):
    """The constants of one target, lengths scaled."""

    planar: PlanarArm
    offset: float  # of axis 4 from axis 3, along u = axis 3 x axis 4
    square: float  # c^2 + f^2
    side: float  # 1 where axes 2 and 3 point the same way, -1 where not


class Terms(NamedTuple):
    """What is known where theta_6 is."""

    D: Vec
    m: Vec
    w: Vec  # D x m
    along: float  # y0
    square: float  # d^2
    across: float  # z . w, less the part that joint 5 does not turn
    even: float  # P for both values of k are even + odd d
    odd: float  # and even - odd d
    size: float  # of the parts of P


def offset_arm_of(links: Array) -> OffsetArm:
    """The constants of one target."""
    planar, offset = planar_arm_of(links), offset_of(links[2])
    side = 1.0 if links[1, 2, 2] > 0.0 else -1.0
    return OffsetArm(planar, offset, planar.c * planar.c + offset * offset, side)


def offset_of(link: Array) -> float:
    """How far the axis behind a link passes the one before it, at right angles to both."""
    x, y = link[0, 2], link[1, 2]
    return float((link[1, 3] * x - link[0, 3] * y) / math.sqrt(x * x + y * y))


def terms_at(arm: OffsetArm, c: float, s: float) -> Terms:
    """All that where theta_6 has this cosine and sine."""
    planar, f = arm.planar, arm.offset
    D = mix(planar.D0, 1.0, planar.Dc, c, planar.Ds, s)
    m = mix(planar.m0, 1.0, planar.mc, c, planar.ms, s)
    w, height, long = cross(D, m), planar.k[2], dot(D, D)
    half = 0.5 * (planar.square - long - arm.square) / arm.square  # K / 2 (c^2 + f^2)
    y, across = planar.c * half - height * D[2], -height * w[2]
    square = f * f * (long / arm.square - half * half)
    determinant = D[0] * w[1] - D[1] * w[0]
    a, b = w[0] * w[0] + w[1] * w[1], across * (D[0] * w[0] + D[1] * w[1])
    in_circle = (planar.k[0] * planar.k[0] + planar.k[1] * planar.k[1]) * determinant * determinant
    g = across * across * (D[0] * D[0] + D[1] * D[1])
    even = a * (y * y + square) - 2.0 * b * y + g - in_circle
    size = a * (y * y + abs(square)) + 2.0 * abs(b * y) + g + in_circle
    return Terms(D, m, w, y, square, across, even, 2.0 * (a * y - b), size)


def fill_product(arm: OffsetArm, cosine: Array, sine: Array) -> float:
    """Fill the coefficients of the polynomial in theta_6; returns the size of its largest parts."""
    largest = 0.0
    for n in range(DEGREE + 1):
        cosine[n], sine[n] = 0.0, 0.0
    for j in range(ANGLES):
        at = terms_at(arm, ANGLE_COS[j], ANGLE_SIN[j])
        value = at.even * at.even - at.odd * at.odd * at.square
        largest = max(largest, at.size * at.size)
        for n in range(DEGREE + 1):
            cosine[n] += SHARE_COS[j, n] * value
            sine[n] += SHARE_SIN[j, n] * value
    return largest


def theta_5_apart_of(arm: OffsetArm, z: complex) -> float:
    """How far theta_5 is from the real axis where z = exp(i theta_6) is a root [rad]: where it is real, all are."""
    planar, f = arm.planar, arm.offset
    c, s = 0.5 * (z + 1.0 / z), -0.5j * (z - 1.0 / z)
    D0 = planar.D0[0] + c * planar.Dc[0] + s * planar.Ds[0]
    D1 = planar.D0[1] + c * planar.Dc[1] + s * planar.Ds[1]
    D2 = planar.D0[2] + c * planar.Dc[2] + s * planar.Ds[2]
    m0 = planar.m0[0] + c * planar.mc[0] + s * planar.ms[0]
    m1 = planar.m0[1] + c * planar.mc[1] + s * planar.ms[1]
    m2 = planar.m0[2] + c * planar.mc[2] + s * planar.ms[2]
    w0, w1, w2 = D1 * m2 - D2 * m1, D2 * m0 - D0 * m2, D0 * m1 - D1 * m0
    long = D0 * D0 + D1 * D1 + D2 * D2
    half = 0.5 * (planar.square - long - arm.square) / arm.square
    y, across = planar.c * half - planar.k[2] * D2, -planar.k[2] * w2
    apart = square_root(f * f * (long / arm.square - half * half))
    turned = planar.k[0] * planar.k[0] + planar.k[1] * planar.k[1]
    found, least = 0.0, math.inf
    for sign in (1.0, -1.0):
        along = y + sign * apart
        a, b = along * w1 - across * D1, D0 * across - w0 * along
        determinant = D0 * w1 - D1 * w0
        missing = abs(a * a + b * b - turned * determinant * determinant)
        ahead, behind = abs(a + 1.0j * b), abs(a - 1.0j * b)
        if missing < least and ahead > 0.0 and behind > 0.0:
            found, least = 0.5 * abs(math.log(ahead / behind)), missing
    return found


def branches_of_elbow_offset(
    arm: SixArm, query: PoseQuery, work: Candidates, roots: RootWork, branches: BranchWork
) -> bool:
    """Add every branch; False where the general way must look after what is left open."""
    links, state = work.links, work.state
    for i in range(len(state)):
        state[i] = 0
    fill_links(query.chain, query.T, arm.scale, arm.form_labelling, links)
    offset_arm = offset_arm_of(links)
    size = fill_product(offset_arm, roots.cosine, roots.sine)
    count = find_roots(noise_of_polynomial(arm, size), 0.0, roots)
    for i in range(count):
        if roots.roots[i, 1] == 0.0:
            take_angle(work, 5, roots.roots[i, 0])
            turn_five(arm, offset_arm, query, work, branches)
        else:
            state[FormState.UNSETTLED] = 1  # roots nearly meet
    if are_apart(branches) and add_last_candidates(query, work, branches):
        return True
    add_candidates(query, work, branches)
    # Where two lead to one branch, another may be near one of them.
    return bool(state[FormState.UNSETTLED] == 0 and branches.filled[0] == count)


def turn_five(arm: SixArm, offset_arm: OffsetArm, query: PoseQuery, work: Candidates, branches: BranchWork) -> None:
    """From theta_6: theta_5, the side of the plane, and the branch there."""
    planar, f = offset_arm.planar, offset_arm.offset
    at = terms_at(offset_arm, work.cosine[5], work.sine[5])
    apart = math.sqrt(max(at.square, 0.0))
    if at.even * at.odd > 0.0:
        apart = -apart
    along, D, w = at.along + apart, at.D, at.w
    x, y = along * w[1] - at.across * D[1], D[0] * at.across - w[0] * along
    if D[0] * w[1] - D[1] * w[0] < 0.0:
        x, y = -x, -y
    take_unit(work, 4, unit_from_to(x, y, planar.k[0], planar.k[1]))
    z = unturned_about_z((work.cosine[4], work.sine[4]), planar.k)
    normal, other = cross(at.m, z), cross(z, D)
    towards = dot(normal, other)
    if dot(other, other) > dot(normal, normal):
        normal, towards = other, dot(other, other)
    size = dot(normal, normal)
    if size < FREE_ANGLE * FREE_ANGLE:
        work.state[FormState.UNSETTLED] = 1  # nothing determines theta_1
        return
    # Axis 3 is where (z x D) along it is v.
    half = 0.5 * (planar.square - dot(D, D) - offset_arm.square) / offset_arm.square
    v = planar.c * apart / f - f * half
    sign = 1.0 if towards * v > 0.0 else -1.0
    five = before_one(work, (0.0, 0.0, 1.0))
    for _ in range(1 if abs(v) > EITHER_SIDE else 2):
        length = sign / math.sqrt(size)
        axis_3 = (length * normal[0], length * normal[1], length * normal[2])
        C = mix(D, 1.0, z, planar.c, cross(axis_3, z), -f)
        side = offset_arm.side
        axis_2 = before_one(work, (side * axis_3[0], side * axis_3[1], side * axis_3[2]))
        place_arm(work, axis_2, before_one(work, C), before_one(work, z), five)
        add_candidate(arm, query, work, branches, False)
        sign = -sign
