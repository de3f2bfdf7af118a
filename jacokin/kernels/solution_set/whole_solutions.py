"""Complex solutions of six joints in two angles at once, where roots of F in one of them are too near to each other.

Four roots together are known to the fourth root of rounding only. But solutions that share one angle, or nearly do,
differ in the next one, and are as regular as any: from each root, and each other angle that goes with it, Newton's
method on both conditions leads to one. F has a root for each solution. Where as many different solutions as roots are
found near the real axis, these are all, and tell how many are real and when others become so.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from jacokin.arrays import Array
from jacokin.kernels.closed_form.arm import ArmConstants, pose_of
from jacokin.kernels.closed_form.resultant import DEGREE, square_root
from jacokin.kernels.six_joints.elbow_offset import offset_of
from jacokin.kernels.six_joints.loop import Form, fill_links
from jacokin.kernels.six_joints.planar_arm import planar_arm_of
from jacokin.kernels.solution_set.slices import SixJoints, turn_target
from jacokin.kernels.vector import Vec

#: All solutions, and steps of Newton's method to each: the last one is this long at most.
ALL, STEPS, LAST_STEP = 2 * DEGREE, 12, 1e-9
#: Of exp(i angle): solutions farther apart than this are two, and what is off the real axis by less is real.
DIFFERENT, REAL_ANGLE = 1e-6, 1e-8
#: [rad] How far from the real axis roots are near enough to be looked at; those beyond are no less certain there.
NEAR = 1.0
#: How far a solution may be from the root that it belongs to.
FARTHEST = 0.1


class TwoAngles(NamedTuple):
    """Both conditions on the last two angles, see `planar_arm`: D and m by 1, cosine and sine of the last one."""

    D0: Vec
    Dc: Vec
    Ds: Vec
    m0: Vec
    mc: Vec
    ms: Vec
    axis: Vec  # z where the angle before is 0
    c: float
    square: float  # the distance of C from O
    f: float  # of axis 4 from C
    e: float  # of O and C along axis 3


class Step(NamedTuple):
    """Both angles' step to where the conditions hold; how long it is."""

    last: complex
    other: complex
    length: float


def has_two_angles(k: ArmConstants) -> bool:
    """Whether both conditions of an arm are known here: of a Jaco, and of a planar arm with an offset at the elbow."""
    return bool(k.six.scale == 0.0 or k.six.form == Form.ELBOW_OFFSET)


def conditions_of(k: ArmConstants, six: SixJoints, p: float, links: Array) -> TwoAngles:
    """Both conditions at a value of the parameter."""
    turn_target(six.T, six.axis, p, six.turned)
    if k.six.scale == 0.0:
        pose = pose_of(six.arm, k, six.turned)
        axis = (k.sin_a, 0.0, k.cos_a)
        return TwoAngles(pose.D0, pose.Dc, pose.Ds, pose.m0, pose.mc, pose.ms, axis, k.c4, k.R2, 0.0, k.e3)
    fill_links(six.chain, six.turned, k.six.scale, k.six.form_labelling, links)
    a, f = planar_arm_of(links), offset_of(links[2])
    return TwoAngles(a.D0, a.Dc, a.Ds, a.m0, a.mc, a.ms, a.k, a.c, a.square, f, 0.0)


def step_from(t: TwoAngles, z: complex, zeta: complex) -> Step:
    """A step of Newton's method, from exp(i angle) of the last angle and of the one before."""
    c, s = 0.5 * (z + 1.0 / z), -0.5j * (z - 1.0 / z)
    D0, E0 = t.D0[0] + c * t.Dc[0] + s * t.Ds[0], c * t.Ds[0] - s * t.Dc[0]  # D, and its derivative E
    D1, E1 = t.D0[1] + c * t.Dc[1] + s * t.Ds[1], c * t.Ds[1] - s * t.Dc[1]
    D2, E2 = t.D0[2] + c * t.Dc[2] + s * t.Ds[2], c * t.Ds[2] - s * t.Dc[2]
    m0, n0 = t.m0[0] + c * t.mc[0] + s * t.ms[0], c * t.ms[0] - s * t.mc[0]  # the same of m
    m1, n1 = t.m0[1] + c * t.mc[1] + s * t.ms[1], c * t.ms[1] - s * t.mc[1]
    m2, n2 = t.m0[2] + c * t.mc[2] + s * t.ms[2], c * t.ms[2] - s * t.mc[2]
    c5, s5 = 0.5 * (zeta + 1.0 / zeta), -0.5j * (zeta - 1.0 / zeta)
    x, y, h = c5 * t.axis[0] + s5 * t.axis[1], c5 * t.axis[1] - s5 * t.axis[0], t.axis[2]  # z; by the angle: (y, -x, 0)
    w0, w1, w2 = D1 * m2 - D2 * m1, D2 * m0 - D0 * m2, D0 * m1 - D1 * m0
    v0 = E1 * m2 - E2 * m1 + D1 * n2 - D2 * n1
    v1 = E2 * m0 - E0 * m2 + D2 * n0 - D0 * n2
    v2 = E0 * m1 - E1 * m0 + D0 * n1 - D1 * n0
    long, long_z = D0 * D0 + D1 * D1 + D2 * D2, 2.0 * (D0 * E0 + D1 * E1 + D2 * E2)
    k, k_z, k_5 = x * D0 + y * D1 + h * D2, x * E0 + y * E1 + h * E2, y * D0 - x * D1
    # The sphere.
    a, a_z, a_5 = 2.0 * t.c * k + long + t.c * t.c + t.f * t.f - t.square, 2.0 * t.c * k_z + long_z, 2.0 * t.c * k_5
    if t.f != 0.0:
        four = 4.0 * t.f * t.f
        a_z = 2.0 * a * a_z + four * (2.0 * k * k_z - long_z)
        a_5 = 2.0 * a * a_5 + 2.0 * four * k * k_5
        a = a * a + four * (k * k - long)
    # The plane.
    b, b_z, b_5 = x * w0 + y * w1 + h * w2, x * v0 + y * v1 + h * v2, y * w0 - x * w1
    if t.e != 0.0:
        u, u_z, u_5 = x * m0 + y * m1 + h * m2, x * n0 + y * n1 + h * n2, y * m0 - x * m1
        b_z = 2.0 * b * b_z + 2.0 * t.e * t.e * u * u_z
        b_5 = 2.0 * b * b_5 + 2.0 * t.e * t.e * u * u_5
        b = b * b - t.e * t.e * (1.0 - u * u)
    det = a_z * b_5 - a_5 * b_z
    if det == 0.0:
        return Step(0.0j, 0.0j, math.inf)
    last, other = (a_5 * b - b_5 * a) / det, (b_z * a - a_z * b) / det
    return Step(last, other, abs(last) + abs(other))


def turned(z: complex, angle: complex) -> complex:
    """Z times exp(i angle), to second order."""
    return z * (1.0 + 1.0j * angle - 0.5 * angle * angle)


def settle(t: TwoAngles, z: complex, zeta: complex) -> tuple[complex, complex, bool]:
    """The solution that Newton's method leads to, and whether it does."""
    for _ in range(STEPS):
        step = step_from(t, z, zeta)
        if not step.length < 1.0:
            return z, zeta, False
        z, zeta = turned(z, step.last), turned(zeta, step.other)
        if step.length <= LAST_STEP:
            return z, zeta, True
    return z, zeta, False


def others_at(t: TwoAngles, z: complex, n: int) -> complex:
    """Exp(i angle) number n of four that the sphere leaves for the angle before, 0 for none."""
    c, s = 0.5 * (z + 1.0 / z), -0.5j * (z - 1.0 / z)
    D0 = t.D0[0] + c * t.Dc[0] + s * t.Ds[0]
    D1 = t.D0[1] + c * t.Dc[1] + s * t.Ds[1]
    D2 = t.D0[2] + c * t.Dc[2] + s * t.Ds[2]
    long, both = D0 * D0 + D1 * D1 + D2 * D2, t.c * t.c + t.f * t.f
    half = 0.5 * (t.square - long - both) / both
    k = t.c * half
    if t.f == 0.0 and n >= 2:
        return 0.0j
    if t.f != 0.0:
        k += (1.0 if n < 2 else -1.0) * t.f * square_root(long / both - half * half)
    right = k - t.axis[2] * D2
    a, b = t.axis[0] * D0 + t.axis[1] * D1, t.axis[1] * D0 - t.axis[0] * D1
    A, B = a - 1.0j * b, a + 1.0j * b
    root = square_root(right * right - A * B) * (1.0 if n % 2 == 0 else -1.0)
    over, under = right + root, right - root
    if abs(over) >= abs(under):
        under = A
    else:
        over = B
    return over / under if under != 0.0 else 0.0j


def find_solutions(t: TwoAngles, roots: Array, degree: int, found: Array) -> int:
    """Fill found (16, 4) with exp(i angle) of both angles of the solutions of all roots near the axis.

    Returns:
        How many there are; -1 where they are not as many as the roots.
    """
    count, near = 0, 0
    for i in range(degree):
        start = complex(roots[i, 0], roots[i, 1])
        if start == 0.0 or abs(off_axis(start)) >= NEAR:
            continue
        near += 1
        for n in range(4):
            other = others_at(t, start, n)
            if other == 0.0:
                continue
            z, zeta, settled = settle(t, start, other)
            if not settled or abs(z - start) > FARTHEST * abs(start) or z == 0.0 or zeta == 0.0:
                continue
            is_new = True
            for j in range(count):
                away = abs(z / complex(found[j, 0], found[j, 1]) - 1.0)
                away += abs(zeta / complex(found[j, 2], found[j, 3]) - 1.0)
                is_new = is_new and away > DIFFERENT
            if is_new and abs(off_axis(z)) < NEAR:
                if count == ALL:
                    return -1
                found[count, 0], found[count, 1], found[count, 2], found[count, 3] = (
                    z.real,
                    z.imag,
                    zeta.real,
                    zeta.imag,
                )
                count += 1
    return count if count == near else -1


def off_axis(z: complex) -> float:
    """How far the angle of exp(i angle) is from the real axis."""
    return math.log(abs(z))
