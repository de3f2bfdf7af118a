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

from jacokin.arrays import Array
from jacokin.kernels.closed_form.resultant import DEGREE, slope_and_curvature, value_and_slope
from jacokin.kernels.tolerances import (
    EXTREMUM_STEP,
    MAX_NOISE_WIDTH,
    MIN_WIDTH,
    ROOT_ERROR,
    ROOT_STEP,
    SMALLEST_HALF_WIDTH,
    SMALLEST_PART,
)
from jacokin.kernels.trigonometry import arctangent, sin_cos, sines_cosines

SECTORS = 8
SIZE = 2 * DEGREE + 1  # Bernstein coefficients of a sector
HALF = math.pi / SECTORS  # [rad]
_half_sin, _half_cos = sin_cos(0.5 * HALF)
TAU = _half_sin / _half_cos
#: [rad] Angles change by at most this with a place in a sector.
WIDEST = 4.0 * TAU
#: [rad] so that the sector bounds miss the round angles that people use.
OFFSET = 0.1234567
ROOT_ITERATIONS = 40
MAX_ROOTS = 256
STACK = 64  # deeper than log2(2 HALF / MIN_WIDTH) + 2, and some splits elsewhere than in the middle
MAX_KNOWN = 48
EXTREMUM_ITERATIONS = 8


class RootWork(NamedTuple):
    """Coefficients in, roots out, and what is needed in between."""

    cosine: Array  # (9,) coefficients of cos(k q)
    sine: Array  # (9,) coefficients of sin(k q)
    roots: Array  # (256, 3) root [rad], half-width of its interval or 0 where it is single, 1 if F touches 0
    stack: Array  # (64, 17)
    place: Array  # (64, 2)
    known: Array  # (48, 2) what F is divided by, see `resultant.fourier_of_divided_F`
    known_count: NDArray[np.int64]  # (2,) single roots, and pairs after them


def make_roots() -> RootWork:
    """Fresh work arrays."""
    return RootWork(
        np.empty(9),
        np.empty(9),
        np.empty((MAX_ROOTS, 3)),
        np.empty((STACK, SIZE)),
        np.empty((STACK, 2)),
        np.empty((MAX_KNOWN, 2)),
        np.zeros(2, np.int64),
    )


def _sector_tables() -> tuple[Array, Array]:
    """(9, 17) Bernstein coefficients of cos(k theta) and sin(k theta) on one sector, scaled by cos(HALF / 2)^16.

    exp(i k theta) is ((1 + i tau t) / (1 - i tau t))^k; both factors are convex mixtures of mu = exp(i HALF / 2) and
    its conjugate, so no coefficient exceeds 1 in size.
    """
    table = np.zeros((DEGREE + 1, SIZE), dtype=np.complex128)
    top = 2 * DEGREE
    sine, cosine = sines_cosines(0.5 * HALF * np.arange(-2 * top, 2 * top + 1))
    for k in range(DEGREE + 1):
        for j in range(SIZE):
            for i in range(max(0, j - DEGREE + k), min(DEGREE + k, j) + 1):
                phase = 2 * (2 * i - j) - 2 * k + 2 * top  # in steps of HALF / 2, the first one at 0
                weight = comb(DEGREE + k, i) * comb(DEGREE - k, j - i) / comb(top, j)
                table[k, j] += weight * complex(cosine[phase], sine[phase])
    return np.ascontiguousarray(table.real), np.ascontiguousarray(table.imag)


BERNSTEIN_COS, BERNSTEIN_SIN = _sector_tables()
_centres = OFFSET + 2.0 * HALF * np.arange(SECTORS)
#: Of the coefficients, as factors of x^j (1 - x)^(16 - j).
BINOMIALS = np.array([float(comb(2 * DEGREE, j)) for j in range(2 * DEGREE + 1)])
SECTOR_SIN, SECTOR_COS = sines_cosines(np.outer(_centres, np.arange(DEGREE + 1)))


def sector_coefficients(cosine: Array, sine: Array, sector: int, b: Array, terms: Array) -> None:
    """Fill b (17,) with the Bernstein coefficients on a sector; ``terms`` is a (17,) workspace.

    About the sector's centre cosines are even and sines odd, so one half gives the other.
    """
    for n in range(1, DEGREE + 1):
        c, s = SECTOR_COS[sector, n], SECTOR_SIN[sector, n]
        terms[n] = c * cosine[n] + s * sine[n]
        terms[DEGREE + n] = c * sine[n] - s * cosine[n]
    for j in range(DEGREE + 1):
        even, odd = cosine[0] * BERNSTEIN_COS[0, j], 0.0
        for n in range(1, DEGREE + 1):
            even += terms[n] * BERNSTEIN_COS[n, j]
            odd += terms[DEGREE + n] * BERNSTEIN_SIN[n, j]
        b[j] = even + odd
        b[SIZE - 1 - j] = even - odd


def count_roots(b: Array, noise: float) -> int:
    """The largest number of roots in an interval, each as often as it is multiple; 1 means exactly one.

    Coefficients within the noise may have either sign. ``SIZE`` means that all are within it.
    """
    above, below, changes = 0, 0, 0
    for j in range(SIZE):
        above += b[j] > noise
        below += b[j] < -noise
    if above == SIZE or below == SIZE:
        return 0
    if above + below == SIZE:
        for j in range(SIZE - 1):
            changes += (b[j] > 0.0) != (b[j + 1] > 0.0)
        return changes
    if above + below == 0:
        return SIZE
    last, gap, ends = 0, 0, 0  # gap: coefficients within the noise since the last sign
    for j in range(SIZE):
        sign = 1 if b[j] > noise else (-1 if b[j] < -noise else 0)
        if sign == 0:
            gap += 1
            continue
        if last == 0:
            ends = gap
        elif (gap % 2 == 0) == (sign == last):
            changes += gap
        else:
            changes += gap + 1
        last, gap = sign, 0
    ends += gap
    return changes if ends == 0 else max(changes + ends, 2)


def split(b: Array, left: Array, part: float) -> None:
    """De Casteljau: left gets the coefficients of the left part, b becomes those of the rest."""
    for level in range(SIZE):
        left[level] = b[0]
        for j in range(SIZE - 1 - level):
            b[j] += part * (b[j + 1] - b[j])


def angle_at(sector: int, x: float) -> float:
    """The angle at the place x in [0, 1] of a sector."""
    return OFFSET + 2.0 * HALF * sector + 2.0 * arctangent(TAU * (2.0 * x - 1.0))


def weigh(b: Array, mirrored: bool, weighted: Array) -> None:
    """Fill weighted (17,) for `value_and_slopes`: with the places x, or mirrored with 1 - x."""
    for j in range(SIZE):
        weighted[j] = b[SIZE - 1 - j if mirrored else j] * BINOMIALS[j]


def value_and_slope_at(weighted: Array, x: float) -> tuple[float, float]:
    """P and dp/dx at a place x in [0, 1), both divided by (1 - x)^14.

    With s = x / (1 - x) it is (1 - x)^16 H(s), H an ordinary polynomial: its even and its odd part, by Horner's rule.
    """
    u = 1.0 - x
    s = x / u
    z = s * s
    even, even_slope, odd, odd_slope = weighted[SIZE - 1], 0.0, weighted[SIZE - 2], 0.0
    for i in range(1, DEGREE):
        even_slope = even_slope * z + even
        even = even * z + weighted[SIZE - 1 - 2 * i]
        odd_slope = odd_slope * z + odd
        odd = odd * z + weighted[SIZE - 2 - 2 * i]
    even_slope = even_slope * z + even
    even = even * z + weighted[0]
    value = even + s * odd
    slope = 2.0 * s * (even_slope + s * odd_slope) + odd
    return u * u * value, slope - 2 * DEGREE * u * value


def value_and_slopes_at(weighted: Array, x: float) -> tuple[float, float, float]:
    """p, dp/dx and its derivative at a place x in [0, 1), all divided by (1 - x)^12; see `value_and_slope_at`."""
    u = 1.0 - x
    s = x / u
    z = s * s
    even, even_slope, even_bend = weighted[SIZE - 1], 0.0, 0.0
    odd, odd_slope, odd_bend = weighted[SIZE - 2], 0.0, 0.0
    for i in range(1, DEGREE):
        even_bend = even_bend * z + even_slope
        even_slope = even_slope * z + even
        even = even * z + weighted[SIZE - 1 - 2 * i]
        odd_bend = odd_bend * z + odd_slope
        odd_slope = odd_slope * z + odd
        odd = odd * z + weighted[SIZE - 2 - 2 * i]
    even_bend = even_bend * z + even_slope
    even_slope = even_slope * z + even
    even = even * z + weighted[0]
    value = even + s * odd
    slope = 2.0 * s * (even_slope + s * odd_slope) + odd
    bend = 2.0 * even_slope + 8.0 * z * even_bend + s * (6.0 * odd_slope + 8.0 * z * odd_bend)
    u2, top = u * u, 2.0 * DEGREE
    change = slope - top * u * value
    return u2 * u2 * value, u2 * change, bend - 2.0 * (top - 1.0) * u * change - top * (top - 1.0) * u2 * value


def polygon_root(b: Array) -> float:
    """The place where the control polygon crosses zero, in [0, 1]."""
    rising = b[SIZE - 1] > b[0]
    j = 0
    while j < SIZE - 2 and (b[j + 1] < 0.0) == rising:
        j += 1
    difference = b[j] - b[j + 1]
    part = b[j] / difference if difference != 0.0 else 0.5
    return (j + part) / (SIZE - 1)


def single_root(b: Array, low: float, high: float, x: float, width: float, weighted: Array) -> float:
    """The one root between two places: bracketed Newton.

    Args:
        b: (17,) Bernstein coefficients.
        low: a place below the root.
        high: one above it.
        x: where to begin, between them.
        width: of the interval, in sectors.
        weighted: (17,) workspace.
    """
    mirrored = x > 0.5
    rising = (b[0] > 0.0) == (low > 0.0)
    if mirrored:
        low, high, x, rising = 1.0 - high, 1.0 - low, 1.0 - x, not rising
    weigh(b, mirrored, weighted)
    radians = WIDEST * width
    before = high - low
    for _ in range(ROOT_ITERATIONS):
        value, slope = value_and_slope_at(weighted, x)
        if (value > 0.0) == rising:
            high = x
        else:
            low = x
        new = x - value / slope if slope != 0.0 else high + 1.0
        if not low <= new <= high or new == 1.0:
            new = 0.5 * (low + high)
        step = abs(new - x)
        x = new
        if radians * step < ROOT_STEP and radians * step * step * step < ROOT_ERROR * before * before:
            break
        before = step
    return 1.0 - x if mirrored else x


def lowest_of(b: Array, side: float) -> float:
    """The place between the ends, in steps of the coefficients, where a parabola through the least ones is lowest."""
    lowest = 1
    for j in range(2, SIZE - 1):
        if side * b[j] < side * b[lowest]:
            lowest = j
    bend = b[lowest - 1] + b[lowest + 1] - 2.0 * b[lowest]
    shift = 0.5 * (b[lowest - 1] - b[lowest + 1]) / bend if bend != 0.0 else 0.0
    return lowest + min(max(shift, -1.0), 1.0)


def between_roots(b: Array, noise: float, weighted: Array) -> tuple[float, float]:
    """A place where p is past zero for certain, between ends of the same sign, and about how far its roots are from it.

    Returns:
        The place, and a distance; 0 where none is found.
    """
    side = 1.0 if b[0] > 0.0 else -1.0
    x = lowest_of(b, side) / (SIZE - 1)
    mirrored = x > 0.5
    if mirrored:
        x = 1.0 - x
    weigh(b, mirrored, weighted)
    for _ in range(EXTREMUM_ITERATIONS):
        if not 0.0 < x < 1.0:
            return x, 0.0
        value, slope, curvature = value_and_slopes_at(weighted, x)
        if side * curvature <= 0.0:
            return x, 0.0
        u = 1.0 - x
        u4 = u * u * u * u
        step = slope / curvature
        lowest_value = side * (value - 0.5 * slope * step)
        if side * value * u4 * u4 * u4 < -noise and step * step * side * curvature < -lowest_value:
            apart = math.sqrt(-2.0 * side * value / (side * curvature))
            return (1.0 - x if mirrored else x), apart
        x -= step
    return x, 0.0


def extremum(cosine: Array, sine: Array, b: Array, sector: int, x: float, width: float) -> float:
    """Where F comes closest to zero, or farthest past it, between ends of the same sign; NaN if it is not found."""
    side = 1.0 if b[0] > 0.0 else -1.0
    if side * b[SIZE - 1] <= 0.0:
        return math.nan
    low, high = angle_at(sector, x), angle_at(sector, x + width)
    q = angle_at(sector, x + width * lowest_of(b, side) / (SIZE - 1))
    for _ in range(EXTREMUM_ITERATIONS):
        slope, curvature = slope_and_curvature(cosine, sine, q)
        if side * curvature <= 0.0:
            return math.nan
        step = slope / curvature
        q -= step
        if not low < q < high:
            return math.nan
        if abs(step) < EXTREMUM_STEP:
            return q
    return math.nan


def place_of(q: float) -> tuple[int, float]:
    """The sector of an angle, and its place in [0, 1] there: the inverse of `angle_at`."""
    turned = q - OFFSET + HALF
    turned -= 2.0 * math.pi * math.floor(turned / (2.0 * math.pi))
    sector = min(int(turned / (2.0 * HALF)), SECTORS - 1)
    return sector, 0.5 * (math.tan(0.5 * (turned - HALF * (2 * sector + 1))) / TAU + 1.0)


def add_known(work: RootWork, q: float) -> None:
    """Add a single root of F that is known; a double root counts as two."""
    count = work.known_count[0]
    if count < MAX_KNOWN:
        work.known[count, 0] = q
        work.known_count[0] = count + 1


def add_known_pair(work: RootWork, mean: float, half_square: float) -> None:
    """Add two roots of F by their mean and the square of half their difference; no single root may follow."""
    i = work.known_count[0] + work.known_count[1]
    if i < MAX_KNOWN:
        work.known[i, 0], work.known[i, 1] = mean, half_square
        work.known_count[1] += 1


def find_roots(noise: float, tolerance: float, work: RootWork) -> int:
    """Real roots of the trigonometric polynomial with the coefficients ``work.cosine`` and ``work.sine``.

    Args:
        noise: values this close to zero may be zero.
        tolerance: more of that, relative to the coefficients' sizes, for an inexact model; 0 for an exact one.
        work: coefficients in, ``work.roots`` out.

    Returns:
        How many roots and undecided candidates were written.
    """
    stack, place, roots, cosine, sine = work.stack, work.place, work.roots, work.cosine, work.sine
    if tolerance > 0.0:
        for n in range(DEGREE + 1):
            noise += tolerance * (abs(cosine[n]) + abs(sine[n]))
    min_width = max(MIN_WIDTH, math.sqrt(tolerance)) / (2.0 * HALF)
    # The second search, with a tolerance, is for near-double roots; its wide stretches were searched before.
    max_width = MAX_NOISE_WIDTH / (2.0 * HALF) if tolerance == 0.0 else 1.0
    found = 0
    for sector in range(SECTORS):
        sector_coefficients(cosine, sine, sector, stack[0], stack[1])
        place[0, 0], place[0, 1] = 0.0, 1.0
        top = 0
        while top >= 0:
            b = stack[top]
            x, width = place[top, 0], place[top, 1]
            possible = count_roots(b, noise)
            if possible == 0 or found == MAX_ROOTS:
                top -= 1
                continue
            roots[found, 2] = 0.0
            # With the sign at both ends certain, roots of the exact F are on the side where they seem to be.
            sure_ends = abs(b[0]) > noise and abs(b[SIZE - 1]) > noise
            if possible == 1:
                root = single_root(b, 0.0, 1.0, polygon_root(b), width, stack[top + 1])
                roots[found, 0], roots[found, 1] = angle_at(sector, x + width * root), 0.0
                found += 1
                top -= 1
                continue
            part = 0.5
            if possible == 2 and sure_ends and tolerance == 0.0 and width > min_width:
                middle, apart = between_roots(b, noise, stack[top + 1])
                if WIDEST * width * apart > ROOT_STEP and found + 2 <= MAX_ROOTS:
                    below = single_root(b, 0.0, middle, max(middle - apart, 0.5 * middle), width, stack[top + 1])
                    above = single_root(
                        b, middle, 1.0, min(middle + apart, 0.5 * (1.0 + middle)), width, stack[top + 1]
                    )
                    for root in (below, above):
                        roots[found, 0], roots[found, 1] = angle_at(sector, x + width * root), 0.0
                        roots[found, 2] = 0.0
                        found += 1
                    top -= 1
                    continue
                q = extremum(cosine, sine, b, sector, x, width)
                if q == q:
                    value, _ = value_and_slope(cosine, sine, q)
                    if abs(value) <= noise:
                        _, curvature = slope_and_curvature(cosine, sine, q)
                        roots[found, 0] = q
                        roots[found, 1] = max(math.sqrt(2.0 * noise / abs(curvature)), SMALLEST_HALF_WIDTH)
                        roots[found, 2] = 1.0
                        found += 1
                        top -= 1
                        continue
                    part = min(max((place_of(q)[1] - x) / width, SMALLEST_PART), 1.0 - SMALLEST_PART)
            if width > (max_width if possible == SIZE else min_width):
                split(b, stack[top + 1], part)
                place[top, 0], place[top, 1] = x + part * width, (1.0 - part) * width
                place[top + 1, 0], place[top + 1, 1] = x, part * width
                top += 1
                continue
            low, high = angle_at(sector, x), angle_at(sector, x + width)
            roots[found, 0], roots[found, 1] = 0.5 * (low + high), 0.5 * (high - low)
            found += 1
            top -= 1
    return found
