"""F(q6): the one equation in one unknown, a trigonometric polynomial of degree 8, from 17 samples.

The sphere condition is Re(conj(W) zeta) = k and the axis-3 condition g(zeta) = 0, with zeta = exp(i q5). F is their
resultant, evaluated without a division, so that nothing is lost where |W| is small.
"""

from __future__ import annotations

import math

import numpy as np

from jacokin.arrays import Array
from jacokin.kernels.closed_form.arm import ArmConstants, Pose
from jacokin.kernels.tolerances import DIVIDED_NOISE, MAX_REST, NOISE, SAME_PLACE
from jacokin.kernels.trigonometry import fourier_samples, sin_cos
from jacokin.kernels.vector import Vec, cross, mix

DEGREE = 8
SAMPLES = 2 * DEGREE + 1
SPACING = 2.0 * math.pi / SAMPLES  # [rad] of the samples
#: Of the samples, and (17, 9) what each adds to the coefficients of sin(k q6) and cos(k q6).
SAMPLE_SIN, SAMPLE_COS, TO_SINE, TO_COSINE = fourier_samples(SAMPLES, DEGREE)
#: (2, 16) cosines and sines of the samples but the one at 0: eight, and those at minus their angles.
AROUND = np.array(
    [np.tile(SAMPLE_COS[1 : DEGREE + 1], 2), np.append(SAMPLE_SIN[1 : DEGREE + 1], -SAMPLE_SIN[1 : DEGREE + 1])]
)


def sphere_terms(k: ArmConstants, D: Vec) -> tuple[complex, float]:
    """W and k of the sphere condition Re(conj(W) zeta) = k: C is at its distance from O."""
    W = complex(D[0], -D[1])
    square = D[0] * D[0] + D[1] * D[1] + D[2] * D[2]
    right = ((k.R2 - square - k.c4 * k.c4) / (2.0 * k.c4) - k.cos_a * D[2]) / k.sin_a
    return W, right


def axis_terms(k: ArmConstants, D: Vec, m: Vec) -> tuple[complex, complex, float]:
    """G2, G1, G0 of g = (n.D)^2 - e3^2 |n|^2 = 2 Re(G2 zeta^2 + G1 zeta) + G0, with n = m x z4.

    n.D = z4.(D x m) and |n|^2 = 1 - (m.z4)^2, both linear in zeta.
    """
    p = cross(D, m)
    l0 = k.cos_a * p[2]
    j0 = k.e3 * k.cos_a * m[2]
    l1 = k.sin_a * complex(p[0], p[1])  # conjugate of the coefficient of zeta^-1, twice
    j1 = k.e3 * k.sin_a * complex(m[0], m[1])
    G2 = 0.25 * (l1 * l1 + j1 * j1)
    G1 = l0 * l1 + j0 * j1
    size = l1.real * l1.real + l1.imag * l1.imag + j1.real * j1.real + j1.imag * j1.imag
    G0 = l0 * l0 + j0 * j0 + 0.5 * size - k.e3 * k.e3
    return G2, G1, G0


def square_root(x: complex) -> complex:
    """One of both."""
    size = abs(x)
    if size == 0.0:
        return 0.0j
    long = math.sqrt(0.5 * (size + abs(x.real)))
    short = 0.5 * x.imag / long
    return complex(long, short) if x.real >= 0.0 else complex(short, long)


def q5_apart(k: ArmConstants, pose: Pose, z: complex) -> float:
    """How far q5 is from the real axis where z = exp(i q6) is a root of F [rad]: where it is real, all joints are.

    Of both zeta of the sphere condition, A zeta^2 - 2 k zeta + B = 0, it is the one with g = 0. Where that says nothing
    of zeta, q5 may be real.
    """
    c, s = 0.5 * (z + 1.0 / z), -0.5j * (z - 1.0 / z)
    D0 = pose.D0[0] + c * pose.Dc[0] + s * pose.Ds[0]
    D1 = pose.D0[1] + c * pose.Dc[1] + s * pose.Ds[1]
    D2 = pose.D0[2] + c * pose.Dc[2] + s * pose.Ds[2]
    m0 = pose.m0[0] + c * pose.mc[0] + s * pose.ms[0]
    m1 = pose.m0[1] + c * pose.mc[1] + s * pose.ms[1]
    m2 = pose.m0[2] + c * pose.mc[2] + s * pose.ms[2]
    right = ((k.R2 - D0 * D0 - D1 * D1 - D2 * D2 - k.c4 * k.c4) / (2.0 * k.c4) - k.cos_a * D2) / k.sin_a
    A, B = D0 + 1.0j * D1, D0 - 1.0j * D1
    root = square_root(right * right - A * B)
    found, least = 0.0, math.inf
    for sign in (1.0, -1.0):
        # (k + root) / A, or B / (k - root): their product is B / A.
        over, under = right + sign * root, right - sign * root
        if abs(over) >= abs(under):
            under = A
        else:
            over = B
        if over == 0.0 or under == 0.0:
            continue
        zeta = over / under
        x, y = 0.5 * k.sin_a * (zeta + 1.0 / zeta), 0.5j * k.sin_a * (zeta - 1.0 / zeta)
        along = x * (D1 * m2 - D2 * m1) + y * (D2 * m0 - D0 * m2) + k.cos_a * (D0 * m1 - D1 * m0)
        cosine = x * m0 + y * m1 + k.cos_a * m2
        g = abs(along * along - k.e3 * k.e3 * (1.0 - cosine * cosine))
        if g < least:
            found, least = abs(math.log(abs(zeta))), g
    return found


def resultant(k: ArmConstants, D: Vec, m: Vec) -> tuple[float, float]:
    """r^4 g(zeta1) g(zeta2) over the two zeta of the sphere condition, a polynomial in W, k and G; and its noise scale.

    The second value is the sum of the sizes of its terms: rounding errors are in proportion to it.
    """
    W, right = sphere_terms(k, D)
    G2, G1, G0 = axis_terms(k, D, m)
    r2 = W.real * W.real + W.imag * W.imag
    k2 = right * right
    # t_n = r^n (zeta1^n + zeta2^n) turned by the phase of W^n: real.
    t1 = 2.0 * right
    t2 = 4.0 * k2 - 2.0 * r2
    t3 = t1 * (4.0 * k2 - 3.0 * r2)
    t4 = t2 * t2 - 2.0 * r2 * r2
    u1 = G1 * W
    u2 = G2 * W * W
    a = 2.0 * (u2 * u2).real
    b = 2.0 * r2 * (u1 * u1).real
    c = G0 * G0 * r2 * r2
    d = 2.0 * t1 * (u2 * u1).real
    e = 2.0 * G0 * t2 * u2.real
    f = 2.0 * t3 * (G2 * W * G1.conjugate()).real
    g = (G2.real * G2.real + G2.imag * G2.imag) * t4
    h = 2.0 * G0 * r2 * t1 * u1.real
    i = (G1.real * G1.real + G1.imag * G1.imag) * r2 * t2
    size = abs(a) + abs(b) + abs(c) + abs(d) + abs(e) + abs(f) + abs(g) + abs(h) + abs(i)
    return a + b + c + d + e + f + g + h + i, size


def fourier_of_F(k: ArmConstants, pose: Pose, cosine: Array, sine: Array, values: Array) -> float:
    """Fill cosine and sine, (9,) each, with the Fourier coefficients of F(q6); returns a bound on their noise.

    Args:
        k: the arm.
        pose: the target.
        cosine: filled.
        sine: filled.
        values: (2, 16) workspace, or larger.
    """
    D, m = mix(pose.D0, 1.0, pose.Dc, 1.0, pose.Ds, 0.0), mix(pose.m0, 1.0, pose.mc, 1.0, pose.ms, 0.0)
    middle, largest = resultant(k, D, m)
    for i in range(2 * DEGREE):
        c, s = AROUND[0, i], AROUND[1, i]
        D = mix(pose.D0, 1.0, pose.Dc, c, pose.Ds, s)
        m = mix(pose.m0, 1.0, pose.mc, c, pose.ms, s)
        values[0, i], values[1, i] = resultant(k, D, m)
    for n in range(DEGREE + 1):
        cosine[n] = TO_COSINE[0, n] * middle
        sine[n] = 0.0
    for j in range(1, DEGREE + 1):
        F, other = values[0, j - 1], values[0, DEGREE + j - 1]  # the latter at minus the angle
        largest = max(largest, values[1, j - 1], values[1, DEGREE + j - 1])
        even, odd = F + other, F - other
        for n in range(DEGREE + 1):
            cosine[n] += TO_COSINE[j, n] * even
            sine[n] += TO_SINE[j, n] * odd
    return NOISE * largest


def fourier_of_divided_F(
    k: ArmConstants, pose: Pose, known: Array, singles: int, pairs: int, cosine: Array, sine: Array
) -> float:
    """Fill the Fourier coefficients of F divided by sin((q6 - root) / 2) for each of an even number of its roots.

    That is a polynomial of a lower degree: what its coefficients above that degree are instead of zero tells how well
    the roots were known.

    Args:
        k: the arm.
        pose: the target.
        known: (n, 2) roots of F, as often as they are multiple [rad]; then pairs, which may be complex: their mean
            [rad] and half their difference squared [rad^2].
        singles: how many single roots there are, an even number.
        pairs: how many pairs.
        cosine: filled.
        sine: filled.

    Returns:
        A bound on the noise of the values; inf where the roots are not known well enough to divide by them.
    """
    count = singles + pairs
    shift = away_from(known, count)
    s0, c0 = sin_cos(shift)
    largest, rest, total = 0.0, 0.0, 0.0
    for n in range(DEGREE + 1):
        cosine[n] = 0.0
        sine[n] = 0.0
    for j in range(SAMPLES):
        c, s = c0 * SAMPLE_COS[j] - s0 * SAMPLE_SIN[j], s0 * SAMPLE_COS[j] + c0 * SAMPLE_SIN[j]
        D = mix(pose.D0, 1.0, pose.Dc, c, pose.Ds, s)
        m = mix(pose.m0, 1.0, pose.mc, c, pose.ms, s)
        F, size = resultant(k, D, m)
        divisor = 1.0
        for i in range(count):
            factor, _ = sin_cos(0.5 * (shift + j * SPACING - known[i, 0]))
            divisor *= factor if i < singles else factor * factor - 0.25 * known[i, 1]
        F /= divisor
        largest = max(largest, size / abs(divisor))
        for n in range(DEGREE + 1):
            cosine[n] += TO_COSINE[j, n] * F
            sine[n] += TO_SINE[j, n] * F
    for n in range(DEGREE + 1):
        size = abs(cosine[n]) + abs(sine[n])
        total += size
        if n > DEGREE - singles // 2 - pairs:
            rest += size
            cosine[n], sine[n] = 0.0, 0.0
        s, c = sin_cos(n * shift)
        cosine[n], sine[n] = c * cosine[n] - s * sine[n], s * cosine[n] + c * sine[n]
    return DIVIDED_NOISE * max(NOISE * largest, rest) if rest < MAX_REST * total else math.inf


def away_from(known: Array, count: int) -> float:
    """How far to shift evenly spaced samples so that they keep away from known roots [rad]."""
    largest, shift = -1.0, 0.0
    for i in range(count):
        gap = SPACING
        for j in range(count):
            ahead = known[j, 0] - known[i, 0]
            ahead -= SPACING * math.floor(ahead / SPACING)
            if ahead > SAME_PLACE:
                gap = min(gap, ahead)
        if gap > largest:
            largest, shift = gap, known[i, 0] + 0.5 * gap
    return shift


def value_and_slope(cosine: Array, sine: Array, q: float) -> tuple[float, float]:
    """F and dF/dq at q, by Horner's rule in z = exp(i q)."""
    s, c = sin_cos(q)
    z = complex(c, s)
    value = complex(cosine[DEGREE], -sine[DEGREE])
    slope = DEGREE * value
    for j in range(1, DEGREE):
        n = DEGREE - j
        coefficient = complex(cosine[n], -sine[n])
        value = value * z + coefficient
        slope = slope * z + n * coefficient
    return cosine[0] + (value * z).real, -(slope * z).imag


def slope_and_curvature(cosine: Array, sine: Array, q: float) -> tuple[float, float]:
    """dF/dq and its derivative at q, by Horner's rule in z = exp(i q)."""
    s, c = sin_cos(q)
    z = complex(c, s)
    slope = DEGREE * complex(cosine[DEGREE], -sine[DEGREE])
    curvature = DEGREE * slope
    for j in range(1, DEGREE):
        n = DEGREE - j
        term = n * complex(cosine[n], -sine[n])
        slope = slope * z + term
        curvature = curvature * z + n * term
    return -(slope * z).imag, -(curvature * z).real
