"""From a root q6 to candidates (q1, q5, q6), and the three smooth equations that make them exact.

With z3, z4 the axes 3 and 4 and D = B - O, all seen after joint 6:
    z3.z4 = 0,    z3.D = e3,    z4.D + (|D|^2 + c4^2 - R^2) / (2 c4) = 0.
They stay regular where the elimination degenerates: axis 4 parallel to axis 1 (n = 0), or O on axis 5 (r = 0).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from jacokin.ik.kernels_arm import Arm, Pose, back_6
from jacokin.ik.kernels_resultant import DEGREE, axis_terms, sphere_terms
from jacokin.ik.kernels_roots import find_roots
from jacokin.ik.kernels_vector import Vec, cross, dot, mix, norm

#: |n| below this: axis 4 is nearly parallel to axis 1, axis 3 may point anywhere that meets its distance from O.
SMALL_N = 1e-3
#: [m]; r below this: O is nearly on axis 5, the sphere condition hardly says anything about q5.
SMALL_R = 3e-3
#: |g| [m^2] below which the second q5 of a root is tried too.
SMALL_G = 1e-5
#: [rad] Newton stops after a step this small: the step is quadratically smaller than the error before it.
REFINED = 1e-9
REFINE_ITERATIONS = 12
#: [rad] Newton steps are cut to this size.
LONGEST_STEP = 0.3
MAX_STARTS = 64


def seen_after_6(pose: Pose, q6: float) -> tuple[Vec, Vec]:
    """D and m at q6."""
    c, s = math.cos(q6), math.sin(q6)
    return mix(pose.D0, 1.0, pose.Dc, c, pose.Ds, s), mix(pose.m0, 1.0, pose.mc, c, pose.ms, s)


def axis_4(k: Arm, q5: float) -> Vec:
    """z4(q5) = R5^T w4."""
    return (k.sin_a * math.cos(q5), -k.sin_a * math.sin(q5), k.cos_a)


def add_start(
    starts: NDArray[np.float64], count: int, k: Arm, pose: Pose, q5: float, q6: float, z3: Vec
) -> int:
    """Append (q1, q5, q6), with q1 from axis 3."""
    if count < MAX_STARTS:
        before = back_6(k, q6, z3)
        starts[count, 0] = math.atan2(-dot(before, pose.x), dot(before, pose.y))
        starts[count, 1] = q5
        starts[count, 2] = q6
        count += 1
    return count


def starts_at_q5(
    k: Arm, pose: Pose, q5: float, q6: float, thorough: bool, starts: NDArray[np.float64], count: int
) -> int:
    """Directions of axis 3 for one (q5, q6): n / |n| with the sign of e3, and both ways round where |n| is small."""
    D, m = seen_after_6(pose, q6)
    z4 = axis_4(k, q5)
    n = cross(m, z4)
    length = norm(n)
    if length > 0.0:
        sign = 1.0 if dot(n, D) * k.e3 > 0.0 else -1.0
        count = add_start(starts, count, k, pose, q5, q6, mix(n, sign / length, n, 0.0, n, 0.0))
        if thorough:
            count = add_start(starts, count, k, pose, q5, q6, mix(n, -sign / length, n, 0.0, n, 0.0))
    if length < SMALL_N:
        arm = mix(D, 1.0, z4, k.c4, m, 0.0)  # C - O
        flat = mix(arm, 1.0, m, -dot(arm, m), m, 0.0)
        rho = norm(flat)
        if rho > 0.0:
            u = mix(flat, 1.0 / rho, flat, 0.0, flat, 0.0)
            side = math.sqrt(max(rho * rho - k.e3 * k.e3, 0.0)) / rho
            v = cross(m, u)
            for sign in (1.0, -1.0):
                count = add_start(starts, count, k, pose, q5, q6, mix(u, k.e3 / rho, v, sign * side, v, 0.0))
    return count


def starts_at_q6(
    k: Arm,
    pose: Pose,
    q6: float,
    thorough: bool,
    starts: NDArray[np.float64],
    count: int,
    stack: NDArray[np.float64],
    place: NDArray[np.float64],
    fourier: NDArray[np.float64],
    roots: NDArray[np.float64],
) -> int:
    """All candidates for one q6: the two q5 of the sphere condition, and those of g where r is small.

    ``thorough`` keeps both q5 and both signs of axis 3, for roots that may be double.
    """
    D, m = seen_after_6(pose, q6)
    W, right = sphere_terms(k, D)
    G2, G1, G0 = axis_terms(k, D, m)
    r = abs(W)
    if r > 0.0:
        middle = math.atan2(W.imag, W.real)
        half = math.acos(min(max(right / r, -1.0), 1.0))
        best, other = middle + half, middle - half
        g_best, g_other = abs(g_at(G2, G1, G0, best)), abs(g_at(G2, G1, G0, other))
        if g_other < g_best:
            best, other, g_other = other, best, g_best
        count = starts_at_q5(k, pose, best, q6, thorough, starts, count)
        if thorough or g_other < SMALL_G:
            count = starts_at_q5(k, pose, other, q6, thorough, starts, count)
    if r < SMALL_R:
        for n in range(DEGREE + 1):
            fourier[0, n] = 0.0
            fourier[1, n] = 0.0
        fourier[0, 0] = G0
        fourier[0, 1], fourier[1, 1] = 2.0 * G1.real, -2.0 * G1.imag
        fourier[0, 2], fourier[1, 2] = 2.0 * G2.real, -2.0 * G2.imag
        for i in range(find_roots(fourier[0], fourier[1], 0.0, stack, place, roots)):
            count = starts_at_q5(k, pose, roots[i, 0], q6, True, starts, count)
    return count


def g_at(G2: complex, G1: complex, G0: float, q5: float) -> float:
    """G = 2 Re(G2 zeta^2 + G1 zeta) + G0 at zeta = exp(i q5)."""
    zeta = complex(math.cos(q5), math.sin(q5))
    return 2.0 * ((G2 * zeta + G1) * zeta).real + G0


def refine(k: Arm, pose: Pose, q1: float, q5: float, q6: float) -> tuple[float, float, float, bool]:
    """Newton on the three equations; the flag says whether it settled."""
    for _ in range(REFINE_ITERATIONS):
        c1, s1, c5, s5 = math.cos(q1), math.sin(q1), math.cos(q5), math.sin(q5)
        c6, s6 = math.cos(q6), math.sin(q6)
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
        if det == 0.0:
            return q1, q5, q6, False
        d1 = (-f1 * a23 * a32 - f2 * (a12 * a33 - a13 * a32) + f3 * a12 * a23) / det
        d5 = (a11 * (f2 * a33 - a23 * f3) - a21 * (f1 * a33 - a13 * f3)) / det
        d6 = (-a11 * a32 * f2 - a21 * (a12 * f3 - f1 * a32)) / det
        size = max(abs(d1), abs(d5), abs(d6))
        if size > LONGEST_STEP:
            scale = LONGEST_STEP / size
            d1, d5, d6 = d1 * scale, d5 * scale, d6 * scale
        q1, q5, q6 = q1 - d1, q5 - d5, q6 - d6
        if size < REFINED:
            return q1, q5, q6, True
    return q1, q5, q6, False


def complete(arm: Arm, pose: Pose, q1: float, q5: float, q6: float, q: NDArray[np.float64]) -> None:
    """Fill q (6,) from q1, q5 and q6: the remaining three angles are each an angle in a plane."""
    D, _ = seen_after_6(pose, q6)
    z4 = axis_4(arm, q5)
    c1, s1 = math.cos(q1), math.sin(q1)
    C = back_6(arm, q6, mix(D, 1.0, z4, arm.c4, z4, 0.0))
    axis = back_6(arm, q6, z4)
    forward = mix(pose.x, c1, pose.y, s1, pose.x, 0.0)  # the shoulder's x axis after joint 1
    q2 = arm.side * (math.atan2(dot(C, forward), dot(C, pose.z)) - arm.psi_C)
    q3 = math.atan2(dot(axis, forward), dot(axis, pose.z)) - arm.psi_4 - arm.side * q2
    before = mix(pose.y, c1, pose.x, -s1, pose.x, 0.0)
    c6, s6 = math.cos(q6), math.sin(q6)
    z3 = mix(before, c6, cross(arm.w6, before), s6, arm.w6, (1.0 - c6) * dot(arm.w6, before))
    c5, s5 = math.cos(q5), math.sin(q5)
    x, y = c5 * z3[0] - s5 * z3[1], s5 * z3[0] + c5 * z3[1]  # axis 3 seen after joint 4
    q4 = arm.chi_3 - math.atan2(arm.sin_a * z3[2] - arm.cos_a * x, y)
    q[0], q[1], q[2], q[3], q[4], q[5] = q1, q2, q3, q4, q5, q6
