"""All real roots of a trigonometric polynomial of degree 8, none lost, however close together.

The circle is cut into eight sectors. With t = tan(theta / 2) the polynomial on a sector is an ordinary one of degree
16; its Bernstein coefficients enclose its values, and the number of their sign changes bounds the number of roots:
none means no root, one means exactly one. Sectors with more are halved. What is still undecided at ``MIN_WIDTH``, or
wholly within rounding noise, is kept as a candidate.
"""

from __future__ import annotations

import math
from math import comb
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.ik.closed_form.kernels.resultant import DEGREE, value_and_slope
from jacokin.ik.closed_form.kernels.tolerances import MAX_NOISE_WIDTH, MIN_WIDTH, ROOT_STEP

SECTORS = 8
SIZE = 2 * DEGREE + 1  # Bernstein coefficients of a sector
HALF = math.pi / SECTORS  # [rad]
TAU = math.tan(0.5 * HALF)
#: [rad] so that the sector bounds miss the round angles that people use.
OFFSET = 0.1234567
ROOT_ITERATIONS = 40
MAX_ROOTS = 256
STACK = 32  # deeper than log2(2 HALF / MIN_WIDTH) + 2


class RootWork(NamedTuple):
    """Coefficients in, roots out, and what is needed in between."""

    cosine: NDArray[np.float64]  # (9,) coefficients of cos(k q)
    sine: NDArray[np.float64]  # (9,) coefficients of sin(k q)
    roots: NDArray[np.float64]  # (256, 2) root [rad] and half-width of its interval, 0 where it is single and sure
    stack: NDArray[np.float64]  # (32, 17)
    place: NDArray[np.float64]  # (32, 2)


def _sector_tables() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(9, 17) Bernstein coefficients of cos(k theta) and sin(k theta) on one sector, scaled by cos(HALF / 2)^16.

    exp(i k theta) is ((1 + i tau t) / (1 - i tau t))^k; both factors are convex mixtures of mu = exp(i HALF / 2) and
    its conjugate, so no coefficient exceeds 1 in size.
    """
    table = np.zeros((DEGREE + 1, SIZE), dtype=np.complex128)
    top = 2 * DEGREE
    for k in range(DEGREE + 1):
        for j in range(SIZE):
            for i in range(max(0, j - DEGREE + k), min(DEGREE + k, j) + 1):
                phase = 0.5 * HALF * (2 * (2 * i - j) - 2 * k)
                weight = comb(DEGREE + k, i) * comb(DEGREE - k, j - i) / comb(top, j)
                table[k, j] += weight * complex(math.cos(phase), math.sin(phase))
    return np.ascontiguousarray(table.real), np.ascontiguousarray(table.imag)


BERNSTEIN_COS, BERNSTEIN_SIN = _sector_tables()
_centres = OFFSET + 2.0 * HALF * np.arange(SECTORS)
SECTOR_COS = np.cos(np.outer(_centres, np.arange(DEGREE + 1)))
SECTOR_SIN = np.sin(np.outer(_centres, np.arange(DEGREE + 1)))


def sector_coefficients(
    cosine: NDArray[np.float64],
    sine: NDArray[np.float64],
    sector: int,
    b: NDArray[np.float64],
    odd: NDArray[np.float64],
) -> None:
    """Fill b (17,) with the Bernstein coefficients on a sector; ``odd`` is a (17,) workspace.

    About the sector's centre cosines are even and sines odd, so one half gives the other.
    """
    for j in range(DEGREE + 1):
        b[j] = cosine[0] * BERNSTEIN_COS[0, j]
        odd[j] = 0.0
    for n in range(1, DEGREE + 1):
        c, s = SECTOR_COS[sector, n], SECTOR_SIN[sector, n]
        u, v = c * cosine[n] + s * sine[n], c * sine[n] - s * cosine[n]
        for j in range(DEGREE + 1):
            b[j] += u * BERNSTEIN_COS[n, j]
            odd[j] += v * BERNSTEIN_SIN[n, j]
    for j in range(DEGREE):
        b[SIZE - 1 - j] = b[j] - odd[j]
        b[j] += odd[j]


def count_roots(b: NDArray[np.float64], noise: float) -> int:
    """0: no root, 1: exactly one, 2: perhaps more, or not to be told within the noise, 3: all noise."""
    above, below, changes = 0, 0, 0
    for j in range(SIZE):
        above += b[j] > noise
        below += b[j] < -noise
    if above == SIZE or below == SIZE:
        return 0
    if above + below == SIZE:
        for j in range(SIZE - 1):
            changes += (b[j] > 0.0) != (b[j + 1] > 0.0)
        return min(changes, 2)
    if above + below == 0:
        return 3
    # A single coefficient within the noise does no harm between two of opposite sign: one change either way.
    last, gap = 0, 0
    for j in range(SIZE):
        sign = 1 if b[j] > noise else (-1 if b[j] < -noise else 0)
        if sign == 0:
            gap += 1
            continue
        if gap > 1 or (gap == 1 and sign != -last):
            return 2
        changes += sign == -last
        last, gap = sign, 0
    return 2 if gap > 0 else min(changes, 2)


def split(b: NDArray[np.float64], left: NDArray[np.float64]) -> None:
    """De Casteljau at the middle: left gets the left half's coefficients, b becomes the right half's."""
    for level in range(SIZE):
        left[level] = b[0]
        for j in range(SIZE - 1 - level):
            b[j] = 0.5 * (b[j] + b[j + 1])


def angle_at(sector: int, x: float) -> float:
    """The angle at the place x in [0, 1] of a sector."""
    return OFFSET + 2.0 * HALF * sector + 2.0 * math.atan(TAU * (2.0 * x - 1.0))


def single_root(
    cosine: NDArray[np.float64],
    sine: NDArray[np.float64],
    b: NDArray[np.float64],
    sector: int,
    x: float,
    width: float,
) -> float:
    """The one root in an interval: bracketed Newton, from where the control polygon crosses zero."""
    low, high = angle_at(sector, x), angle_at(sector, x + width)
    rising = b[SIZE - 1] > b[0]
    j = 0
    while j < SIZE - 2 and (b[j + 1] < 0.0) == rising:
        j += 1
    difference = b[j] - b[j + 1]
    part = b[j] / difference if difference != 0.0 else 0.5
    q = angle_at(sector, x + width * (j + part) / (SIZE - 1))
    for _ in range(ROOT_ITERATIONS):
        value, slope = value_and_slope(cosine, sine, q)
        if (value > 0.0) == rising:
            high = q
        else:
            low = q
        new = q - value / slope if slope != 0.0 else high + 1.0
        if not low <= new <= high:
            new = 0.5 * (low + high)
        step = abs(new - q)
        q = new
        if step < ROOT_STEP:
            break
    return q


def find_roots(noise: float, tolerance: float, work: RootWork) -> int:
    """Real roots of the trigonometric polynomial with the coefficients ``work.cosine`` and ``work.sine``.

    Args:
        noise: values this close to zero may be zero.
        tolerance: more of that, relative to the coefficients' sizes, for an inexact model; 0 for an exact one.
        work: coefficients in; ``work.roots`` out.

    Returns:
        How many roots and undecided candidates were written.
    """
    stack, place, roots = work.stack, work.place, work.roots
    if tolerance > 0.0:
        for n in range(DEGREE + 1):
            noise += tolerance * (abs(work.cosine[n]) + abs(work.sine[n]))
    min_width = max(MIN_WIDTH, math.sqrt(tolerance)) / (2.0 * HALF)
    # The second search, with a tolerance, is for near-double roots; its wide stretches were searched before.
    max_width = MAX_NOISE_WIDTH / (2.0 * HALF) if tolerance == 0.0 else 1.0
    found = 0
    for sector in range(SECTORS):
        sector_coefficients(work.cosine, work.sine, sector, stack[0], stack[1])
        place[0, 0], place[0, 1] = 0.0, 1.0
        top = 0
        while top >= 0:
            b = stack[top]
            x, width = place[top, 0], place[top, 1]
            roots_here = count_roots(b, noise)
            if (roots_here == 2 and width > min_width) or (roots_here == 3 and width > max_width):
                split(b, stack[top + 1])
                place[top, 0], place[top, 1] = x + 0.5 * width, 0.5 * width
                place[top + 1, 0], place[top + 1, 1] = x, 0.5 * width
                top += 1
                continue
            top -= 1
            if roots_here == 0 or found == MAX_ROOTS:
                continue
            if roots_here == 1:
                roots[found, 0] = single_root(work.cosine, work.sine, b, sector, x, width)
                roots[found, 1] = 0.0
            else:
                low, high = angle_at(sector, x), angle_at(sector, x + width)
                roots[found, 0] = 0.5 * (low + high)
                roots[found, 1] = 0.5 * (high - low)
            found += 1
    return found
