"""F(theta_3), the one equation in one unknown: a determinant, and a trigonometric polynomial of degree 8.

The six equations are forms of degree two in (C, S) = (cos, sin) of theta_4 / 2 and of theta_5 / 2. Times C and times S
of theta_4 they are twelve linear equations in the twelve products of cubic forms of one and quadratic forms of the
other: M(theta_3) v = 0, and F = det M. By counting F has degree 12; the four highest fall away (Raghavan and Roth).
More samples than a polynomial of degree 8 needs show what rounding does to them.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from jacokin.arrays import Array
from jacokin.kernels.chain import triangulate
from jacokin.kernels.closed_form.resultant import DEGREE
from jacokin.kernels.six_joints.equations import Equations
from jacokin.kernels.tolerances import SMALLEST_NOISE, TIMES_NOISE
from jacokin.kernels.trigonometry import fourier_samples

#: Two coefficients beyond the degree are known, four numbers.
ANGLES = 2 * DEGREE + 5
ANGLE_SIN, ANGLE_COS, SHARE_SIN, SHARE_COS = fourier_samples(ANGLES, DEGREE + 2)


class Determinant(NamedTuple):
    """What a determinant needs."""

    upper: Array  # (6, 9) the equations times C
    lower: Array  # (6, 9) the equations times S, last three columns first
    core: Array  # (6, 6) what is left of both


def make_determinant() -> Determinant:
    """Fresh work arrays."""
    return Determinant(np.empty((6, 9)), np.empty((6, 9)), np.empty((6, 6)))


def determinant(e: Equations, c: float, s: float, work: Determinant) -> float:
    """Det M where theta_3 has this cosine and sine.

    M is [A B C 0; 0 A B C] with blocks (6, 3): A is eliminated from the upper half and C from the lower one.
    """
    upper, lower, core, parts = work.upper, work.lower, work.core, e.parts
    for i in range(6):
        for j in range(9):
            value = c * parts[0, i, j] + s * parts[1, i, j] + parts[2, i, j]
            upper[i, j] = value
            lower[i, j + 3 if j < 6 else j - 6] = value
    product = triangulate(upper, 3, 9, 1.0)
    product *= triangulate(lower, 3, 9, 1.0)
    for i in range(3):
        for j in range(6):
            core[i, j] = upper[i + 3, j + 3]
            core[i + 3, j] = lower[i + 3, j + 3]
    return triangulate(core, 6, 6, product)


def least_pivot(work: Determinant) -> float:
    """The least pivot of the determinant at hand: about the least singular value of M."""
    least = math.inf
    for i in range(6):
        least = min(least, abs(work.core[i, i]))
    for i in range(3):
        least = min(least, abs(work.upper[i, i]), abs(work.lower[i, i]))
    return least


def fourier_of_determinant(e: Equations, work: Determinant, cosine: Array, sine: Array) -> tuple[float, float]:
    """Fill cosine and sine, (9,) each, with the coefficients of F.

    Returns:
        A bound on the noise of its values, and how far F moves with the entries of M: its largest minors, about F by
        its least pivot. Rounding of M moves all values together, and no coefficient shows that.
    """
    c9, s9, c10, s10, largest, minor = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for n in range(DEGREE + 1):
        cosine[n] = 0.0
        sine[n] = 0.0
    for j in range(ANGLES):
        F = determinant(e, ANGLE_COS[j], ANGLE_SIN[j], work)
        largest = max(largest, abs(F))
        minor = max(minor, abs(F / least_pivot(work)) if F != 0.0 else 0.0)
        for n in range(DEGREE + 1):
            cosine[n] += SHARE_COS[j, n] * F
            sine[n] += SHARE_SIN[j, n] * F
        c9 += SHARE_COS[j, DEGREE + 1] * F
        s9 += SHARE_SIN[j, DEGREE + 1] * F
        c10 += SHARE_COS[j, DEGREE + 2] * F
        s10 += SHARE_SIN[j, DEGREE + 2] * F
    beyond = math.sqrt(c9 * c9 + s9 * s9 + c10 * c10 + s10 * s10)
    return max(TIMES_NOISE * beyond, SMALLEST_NOISE * largest), minor
