"""From a root q6 to candidates (q1, q5, q6), and the three smooth equations that make them exact.

With z3, z4 the axes 3 and 4 and D = B - O, all seen after joint 6:
    z3.z4 = 0,    z3.D = e3,    z4.D + (|D|^2 + c4^2 - R^2) / (2 c4) = 0.
They stay regular where the elimination degenerates: axis 4 parallel to axis 1 (n = 0), or O on axis 5 (r = 0).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.branches import ABREAST, FOUND, FRAME
from jacokin.kernels.closed_form.arm import ArmConstants, Pose
from jacokin.kernels.closed_form.resultant import DEGREE, axis_terms, sphere_terms
from jacokin.kernels.closed_form.roots import RootWork, find_roots
from jacokin.kernels.configurations.arm import turn_sines
from jacokin.kernels.tolerances import (
    G_NOISE,
    MAX_FOLD_ERROR,
    MAX_REFINE_STEP,
    MIN_WIDTH,
    NEAR_AXIS_1,
    NEAR_AXIS_5,
    REFINED_STEP,
    SMALL_G,
    SMALL_N,
    SMALL_R,
    SMALLEST_PIVOT,
)
from jacokin.kernels.trigonometry import angle_of, sin_cos
from jacokin.kernels.vector import Vec, cross, dot, mix, norm

REFINE_ITERATIONS = 12
MAX_STARTS = 128
#: Rows of `branches.Lanes` until candidates are verified: joints 1, 5 and 6, each angle, sine and cosine; then 1 where
#: there is a start, and where it is still being refined.
Q1, Q5, Q6, STARTED, GOING = FRAME, FRAME + 3, FRAME + 6, FRAME + 9, FRAME + 10


class Starts(NamedTuple):
    """Candidates (q1, q5, q6) and a mark for members of a family, and how many there are."""

    rows: Array  # (128, 4)
    filled: NDArray[np.int64]  # (1,)


class AfterJoint6(NamedTuple):
    """What is seen after joint 6 at one q6: D = B - O, m = axis 1, and the shoulder's axes x and y."""

    q6: float
    D: Vec
    m: Vec
    x: Vec
    y: Vec


def seen_after_joint_6(k: ArmConstants, pose: Pose, q6: float) -> AfterJoint6:
    """Turn the pose by joint 6."""
    s, c = sin_cos(q6)
    return turned_by_joint_6(k, pose, q6, s, c)


def turned_by_joint_6(k: ArmConstants, pose: Pose, q6: float, s: float, c: float) -> AfterJoint6:
    """Turn the pose by joint 6, of which sine and cosine are known."""
    m = mix(pose.m0, 1.0, pose.mc, c, pose.ms, s)
    x = mix(pose.x, c, cross(k.w6, pose.x), s, k.w6, (1.0 - c) * dot(k.w6, pose.x))
    return AfterJoint6(q6, mix(pose.D0, 1.0, pose.Dc, c, pose.Ds, s), m, x, cross(m, x))


def starts_at_q6(k: ArmConstants, pose: Pose, q6: float, half_width: float, starts: Starts, work: RootWork) -> None:
    """Add all candidates for one q6: the two q5 of the sphere condition, and those of g where r is small.

    Args:
        k: the arm.
        pose: the target.
        q6: a root of F, or the middle of an undecided interval [rad].
        half_width: of that interval, 0 for a single root [rad]; unless it is 0, both q5 and both signs of axis 3 are
            kept.
        starts: appended to.
        work: workspace for the roots of g.
    """
    view = seen_after_joint_6(k, pose, q6)
    r2, best, other, g_other = on_sphere(k, view)
    if r2 > 0.0:
        starts_at_q5(k, pose, view, best, half_width, starts)
        if half_width > 0.0 or g_other < SMALL_G:
            starts_at_q5(k, pose, view, other, half_width, starts)
    if r2 < SMALL_R * SMALL_R:
        starts_of_g(k, pose, view, starts, work)


def on_sphere(k: ArmConstants, view: AfterJoint6) -> tuple[float, complex, complex, float]:
    """The zeta = exp(i q5) of the sphere condition Re(conj(W) zeta) = k.

    Returns:
        The square of |W|, there is none where it is 0; the zeta where g is smaller, the other one, and the size of g
        there.
    """
    W, right = sphere_terms(k, view.D)
    G2, G1, G0 = axis_terms(k, view.D, view.m)
    r2 = W.real * W.real + W.imag * W.imag
    # The root of a negative s^2 is taken as 0.
    clipped = min(max(right, -math.sqrt(r2)), math.sqrt(r2))
    s = math.sqrt(max(r2 - clipped * clipped, 0.0))
    divisor = r2 if r2 > 0.0 else 1.0
    unit = complex(W.real / divisor, W.imag / divisor)
    first, second = complex(clipped, s) * unit, complex(clipped, -s) * unit
    g_first, g_second = g_at(G2, G1, G0, first), g_at(G2, G1, G0, second)
    if g_second < g_first:
        return r2, second, first, g_first
    return r2, first, second, g_second


def fill_starts(k: ArmConstants, pose: Pose, rows: Array) -> None:
    """Fill in joints 1 and 5 for values of joint 6 side by side: the first start that `starts_at_q6` adds for each."""
    turn_sines(rows[Q6 : Q6 + 3])
    for i in range(ABREAST):
        view = turned_by_joint_6(k, pose, rows[Q6, i], rows[Q6 + 1, i], rows[Q6 + 2, i])
        r2, zeta, _, _ = on_sphere(k, view)
        n, along, length = across_both(k, view, zeta)
        rows[Q1, i] = joint_1_of(view, mix(n, along, n, 0.0, n, 0.0))
        rows[Q5, i] = angle_of(zeta.imag, zeta.real)
        rows[STARTED, i] = 1.0 if min(r2, length) > 0.0 else 0.0


def starts_of_g(k: ArmConstants, pose: Pose, view: AfterJoint6, starts: Starts, work: RootWork) -> None:
    """Add candidates for one q6 that are roots q5 of g alone."""
    G2, G1, G0 = axis_terms(k, view.D, view.m)
    for n in range(3, DEGREE + 1):
        work.cosine[n] = 0.0
        work.sine[n] = 0.0
    work.cosine[0], work.sine[0] = G0, 0.0
    work.cosine[1], work.sine[1] = 2.0 * G1.real, -2.0 * G1.imag
    work.cosine[2], work.sine[2] = 2.0 * G2.real, -2.0 * G2.imag
    for i in range(find_roots(G_NOISE, 0.0, work)):
        s, c = sin_cos(work.roots[i, 0])
        starts_at_q5(k, pose, view, complex(c, s), MIN_WIDTH, starts)


def starts_on_axis_5(k: ArmConstants, pose: Pose, starts: Starts, work: RootWork) -> None:
    """Add the candidates where axis 5 passes O, or nearly: at one q6, up to four roots of g.

    W is linear in (cos q6, sin q6): it vanishes where two linear equations have a solution of length 1.
    """
    det = pose.Dc[0] * pose.Ds[1] - pose.Ds[0] * pose.Dc[1]
    if abs(det) < SMALLEST_PIVOT:
        return
    c = (pose.Ds[0] * pose.D0[1] - pose.D0[0] * pose.Ds[1]) / det
    s = (pose.D0[0] * pose.Dc[1] - pose.Dc[0] * pose.D0[1]) / det
    if not abs(math.hypot(c, s) - 1.0) < NEAR_AXIS_5:
        return
    view = seen_after_joint_6(k, pose, angle_of(s, c))
    W, right = sphere_terms(k, view.D)
    if max(abs(W.real), abs(W.imag), abs(right)) < NEAR_AXIS_5:
        starts_of_g(k, pose, view, starts, work)


def starts_along_axis_1(k: ArmConstants, pose: Pose, starts: Starts) -> None:
    """Add the candidates where axis 4 is along axis 1, or nearly: two for each of up to four q6.

    With z4 = m or z4 = -m the sphere condition is linear in (cos q6, sin q6).
    """
    m = mix(pose.m0, 1.0, pose.mc, 1.0, pose.mc, 0.0)
    D = mix(pose.D0, 1.0, pose.Dc, 1.0, pose.Dc, 0.0)
    lift = dot(m, D) - k.b5 * m[2]  # z4.D = lift + b5 m_z for z4 = m, at every q6
    square = dot(D, D) - 2.0 * k.b5 * D[2]  # |D|^2 = square + 2 b5 D_z
    for i in range(2):
        side = 1.0 - 2.0 * i
        scale = k.b5 / k.c4
        f0 = side * (lift + k.b5 * pose.m0[2]) + 0.5 * (square + k.c4 * k.c4 - k.R2) / k.c4 + scale * pose.D0[2]
        fc = side * k.b5 * pose.mc[2] + scale * pose.Dc[2]
        fs = side * k.b5 * pose.ms[2] + scale * pose.Ds[2]
        size = math.hypot(fc, fs)
        if not abs(f0) <= size:
            continue
        middle, half = angle_of(fs, fc), math.acos(-f0 / size)
        for j in range(2):
            view = seen_after_joint_6(k, pose, middle + (half if j == 0 else -half))
            if abs(side * view.m[2] - k.cos_a) < NEAR_AXIS_1:
                flat = math.hypot(view.m[0], view.m[1])
                starts_across_axis_1(k, pose, view, complex(side * view.m[0] / flat, -side * view.m[1] / flat), starts)


def g_at(G2: complex, G1: complex, G0: float, zeta: complex) -> float:
    """The size of g = 2 Re(G2 zeta^2 + G1 zeta) + G0."""
    return abs(2.0 * ((G2 * zeta + G1) * zeta).real + G0)


def starts_at_q5(
    k: ArmConstants, pose: Pose, view: AfterJoint6, zeta: complex, half_width: float, starts: Starts
) -> None:
    """Directions of axis 3 for one (q5, q6): n / |n| with the sign of e3, and both ways round where |n| is small."""
    n, along, length = across_both(k, view, zeta)
    if length > 0.0:
        add_start(starts, pose, view, zeta, mix(n, along, n, 0.0, n, 0.0))
        if half_width > 0.0:
            add_start(starts, pose, view, zeta, mix(n, -along, n, 0.0, n, 0.0))
    if length < SMALL_N:
        starts_across_axis_1(k, pose, view, zeta, starts)


def across_both(k: ArmConstants, view: AfterJoint6, zeta: complex) -> tuple[Vec, float, float]:
    """What is across axes 1 and 4, with the sign that makes it axis 3, and its length."""
    n = cross(view.m, (k.sin_a * zeta.real, -k.sin_a * zeta.imag, k.cos_a))
    return n, 1.0 if dot(n, view.D) * k.e3 > 0.0 else -1.0, norm(n)


def starts_across_axis_1(k: ArmConstants, pose: Pose, view: AfterJoint6, zeta: complex, starts: Starts) -> None:
    """The two directions of axis 3 across axis 1 and at its distance from O: right where axis 4 is along axis 1."""
    z4 = (k.sin_a * zeta.real, -k.sin_a * zeta.imag, k.cos_a)
    arm = mix(view.D, 1.0, z4, k.c4, z4, 0.0)  # C - O
    flat = mix(arm, 1.0, view.m, -dot(arm, view.m), arm, 0.0)  # its part across axis 1, of length rho
    v = cross(view.m, flat)
    side = math.sqrt(max(dot(flat, flat) - k.e3 * k.e3, 0.0))
    add_start(starts, pose, view, zeta, mix(flat, k.e3, v, side, v, 0.0))
    add_start(starts, pose, view, zeta, mix(flat, k.e3, v, -side, v, 0.0))


def add_start(starts: Starts, pose: Pose, view: AfterJoint6, zeta: complex, z3: Vec) -> None:
    """Append (q1, q5, q6), with q1 from the direction of axis 3 (of any length)."""
    i = starts.filled[0]
    if i < MAX_STARTS:
        starts.rows[i, 0] = joint_1_of(view, z3)
        starts.rows[i, 1] = angle_of(zeta.imag, zeta.real)
        starts.rows[i, 2] = view.q6
        starts.rows[i, 3] = 0.0
        starts.filled[0] = i + 1


def joint_1_of(view: AfterJoint6, z3: Vec) -> float:
    """Its angle from the direction of axis 3 (of any length) [rad]."""
    return angle_of(-dot(z3, view.x), dot(z3, view.y))


def refine(
    k: ArmConstants, pose: Pose, q1: float, q5: float, q6: float, smallest_det: float
) -> tuple[float, float, float, bool]:
    """Newton on the three equations, to the last digit or to the iteration limit.

    Returns:
        The angles, and whether it stopped at a fold, where the determinant is below ``smallest_det`` [m^2].
    """
    for _ in range(REFINE_ITERATIONS):
        step = refining_step(k, pose, sin_cos(q1), sin_cos(q5), sin_cos(q6))
        if abs(step.determinant) < smallest_det and step.error < MAX_FOLD_ERROR:
            return q1, q5, q6, True
        if step.determinant == 0.0:
            break
        q1, q5, q6 = q1 - step.q1, q5 - step.q5, q6 - step.q6
        if step.size < REFINED_STEP:
            break
    return q1, q5, q6, False


class RefiningStep(NamedTuple):
    """One of Newton's method on the three equations, none too long; and what it came from."""

    q1: float  # [rad], to be taken off
    q5: float
    q6: float
    size: float  # of the longest of them before they were shortened
    error: float  # of the equations [m and -]
    determinant: float  # [m^2]; where it is 0 there is no step


def refining_step(
    k: ArmConstants, pose: Pose, one: tuple[float, float], five: tuple[float, float], six: tuple[float, float]
) -> RefiningStep:
    """Newton's step from sines and cosines of joints 1, 5 and 6."""
    (s1, c1), (s5, c5), (s6, c6) = one, five, six
    D = mix(pose.D0, 1.0, pose.Dc, c6, pose.Ds, s6)
    dD = mix(pose.Ds, c6, pose.Dc, -s6, pose.D0, 0.0)
    m = mix(pose.m0, 1.0, pose.mc, c6, pose.ms, s6)
    before = mix(pose.y, c1, pose.x, -s1, pose.x, 0.0)
    z3 = mix(before, c6, cross(k.w6, before), s6, k.w6, (1.0 - c6) * dot(k.w6, before))
    z3_1 = cross(m, z3)
    z3_6 = cross(k.w6, z3)
    z4 = (k.sin_a * c5, -k.sin_a * s5, k.cos_a)
    z4_5 = (-k.sin_a * s5, -k.sin_a * c5, 0.0)

    f1 = dot(z3, z4)
    f2 = dot(z3, D) - k.e3
    f3 = dot(z4, D) + (dot(D, D) + k.c4 * k.c4 - k.R2) / (2.0 * k.c4)
    a11, a12, a13 = dot(z3_1, z4), dot(z3, z4_5), dot(z3_6, z4)
    a21, a23 = dot(z3_1, D), dot(z3_6, D) + dot(z3, dD)
    a32, a33 = dot(z4_5, D), dot(z4, dD) + dot(D, dD) / k.c4
    det = -a11 * a23 * a32 - a21 * (a12 * a33 - a13 * a32)
    divisor = det if det != 0.0 else 1.0
    d1 = (-f1 * a23 * a32 - f2 * (a12 * a33 - a13 * a32) + f3 * a12 * a23) / divisor
    d5 = (a11 * (f2 * a33 - a23 * f3) - a21 * (f1 * a33 - a13 * f3)) / divisor
    d6 = (-a11 * a32 * f2 - a21 * (a12 * f3 - f1 * a32)) / divisor
    size = max(abs(d1), abs(d5), abs(d6))
    scale = MAX_REFINE_STEP / size if size > MAX_REFINE_STEP else 1.0
    return RefiningStep(d1 * scale, d5 * scale, d6 * scale, size, max(abs(f1), abs(f2), abs(f3)), det)


def refine_abreast(k: ArmConstants, pose: Pose, rows: Array) -> None:
    """`refine` of starts side by side, past folds as well; then fill in the six angles, as `complete`."""
    for i in range(ABREAST):
        rows[GOING, i] = 1.0
    for _ in range(REFINE_ITERATIONS):
        turn_three(rows)
        for i in range(ABREAST):
            step = refining_step(
                k,
                pose,
                (rows[Q1 + 1, i], rows[Q1 + 2, i]),
                (rows[Q5 + 1, i], rows[Q5 + 2, i]),
                (rows[Q6 + 1, i], rows[Q6 + 2, i]),
            )
            going = rows[GOING, i] if step.determinant != 0.0 else 0.0
            rows[Q1, i] = rows[Q1, i] - step.q1 if going > 0.0 else rows[Q1, i]
            rows[Q5, i] = rows[Q5, i] - step.q5 if going > 0.0 else rows[Q5, i]
            rows[Q6, i] = rows[Q6, i] - step.q6 if going > 0.0 else rows[Q6, i]
            rows[GOING, i] = 0.0 if step.size < REFINED_STEP else going
        left = 0
        for i in range(ABREAST):
            left += rows[GOING, i] > 0.0
        if left == 0:
            break
    turn_three(rows)
    for i in range(ABREAST):
        view = turned_by_joint_6(k, pose, rows[Q6, i], rows[Q6 + 1, i], rows[Q6 + 2, i])
        one, five = (rows[Q1 + 1, i], rows[Q1 + 2, i]), (rows[Q5 + 1, i], rows[Q5 + 2, i])
        rows[FOUND + 1, i], rows[FOUND + 2, i], rows[FOUND + 3, i] = rest_of(k, view, one, five)
        rows[FOUND, i], rows[FOUND + 4, i], rows[FOUND + 5, i] = rows[Q1, i], rows[Q5, i], rows[Q6, i]


def turn_three(rows: Array) -> None:
    """Fill in sines and cosines of joints 1, 5 and 6."""
    turn_sines(rows[Q1 : Q1 + 3])
    turn_sines(rows[Q5 : Q5 + 3])
    turn_sines(rows[Q6 : Q6 + 3])


def complete(arm: ArmConstants, pose: Pose, q1: float, q5: float, q6: float, q: Array) -> None:
    """Fill q (6,) from q1, q5 and q6."""
    q[1], q[2], q[3] = rest_of(arm, seen_after_joint_6(arm, pose, q6), sin_cos(q1), sin_cos(q5))
    q[0], q[4], q[5] = q1, q5, q6


def rest_of(
    arm: ArmConstants, view: AfterJoint6, one: tuple[float, float], five: tuple[float, float]
) -> tuple[float, float, float]:
    """q2, q3 and q4 [rad] from sines and cosines of q1 and q5: each is an angle in a plane."""
    (s1, c1), (s5, c5) = one, five
    forward = mix(view.x, c1, view.y, s1, view.x, 0.0)  # the shoulder's x axis after joint 1
    z3 = mix(view.y, c1, view.x, -s1, view.x, 0.0)
    z4 = (arm.sin_a * c5, -arm.sin_a * s5, arm.cos_a)
    C = mix(view.D, 1.0, z4, arm.c4, z4, 0.0)  # C - O
    q2 = arm.side * (angle_of(dot(C, forward), dot(C, view.m)) - arm.psi_c)
    q3 = angle_of(dot(z4, forward), dot(z4, view.m)) - arm.psi_4 - arm.side * q2
    x, y = c5 * z3[0] - s5 * z3[1], s5 * z3[0] + c5 * z3[1]  # axis 3 seen after joint 4
    return q2, q3, arm.chi_3 - angle_of(arm.sin_a * z3[2] - arm.cos_a * x, y)
