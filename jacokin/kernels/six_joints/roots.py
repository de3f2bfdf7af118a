"""All real roots of F(theta_3): from its Fourier coefficients, and where rounding hides them, from close by.

F may be a million million times larger on one side of the circle than on the other, and its coefficients are as exact
as its largest values. Stretches where the polynomial is all rounding are looked at again with determinants at 17 places
of their own: with t = tan((theta_3 - middle) / 2) F is a polynomial of degree 16 times a known factor, so that they
determine it there, as exactly as F is there.
"""

from __future__ import annotations

import math
from math import comb
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.closed_form.resultant import value_and_slope
from jacokin.kernels.closed_form.roots import SIZE, RootWork, count_roots, find_roots, make_roots, split
from jacokin.kernels.six_joints.characteristic import (
    Determinant,
    determinant,
    fourier_of_determinant,
    make_determinant,
)
from jacokin.kernels.six_joints.equations import Equations, area_of_columns
from jacokin.kernels.tolerances import (
    CLOSE_NOISE,
    MIN_WIDTH,
    NARROW_NOISE,
    NOISE_OF_M,
    NOISE_OF_TOUCH,
    POSE_NOISE,
    UNCERTAIN,
)
from jacokin.kernels.trigonometry import sines_cosines

MAX_STRETCHES = 128
MAX_SIX_ROOTS = 96
#: How often a stretch is looked at closer, and the largest part of one that is worth it.
LEVELS, LARGEST_PART = 8, 0.6
#: Parts of a stretch that are all noise are kept from this size, and any from the second.
NOISE_PART, LEAST_PART = 1.0 / 8.0, 1.0 / 256.0
BRACKETED_STEPS = 60
#: [rad], and part of the interval: a root is known after a step this small. Newton's method on the arm goes on from it.
FOUND_ROOT, FOUND_PART = 1e-9, 1e-4
#: The square of the sine between two columns that are on one line but for rounding.
ON_ONE_LINE = 1e-13
#: [rad]; F is still noise so far from a root where others are beside it, which rounding hides.
BESIDE = 2e-6
#: Where F touches zero its extremum may be as far on the other side of zero as the noise: its roots are then the square
#: root of two as far apart as from zero, and cubic terms move them.
TOUCHING = 1.5

NODES = 0.5 - 0.5 * sines_cosines(np.pi * (np.arange(SIZE) + 0.5) / SIZE)[1]


def _to_bernstein() -> Array:
    """(17, 17) Bernstein coefficients from values at the nodes: those of Lagrange's polynomials.

    Each is a product of (x - node) = (1 - node) x - node (1 - x) by the other nodes, divided by its value at its own.
    """
    table = np.zeros((SIZE, SIZE))
    for k in range(SIZE):
        factor = np.eye(1, SIZE)[0]  # of x^j (1 - x)^(n - j), of the product of n so far
        for node in np.delete(NODES, k).tolist():
            factor = (1.0 - node) * np.append(0.0, factor[:-1]) - node * factor
            factor /= NODES[k] - node
        table[:, k] = factor
    binomials: Array = np.array([[float(comb(SIZE - 1, j))] for j in range(SIZE)])
    return np.divide(table, binomials)


TO_BERNSTEIN = _to_bernstein()


class SixRoots(NamedTuple):
    """Roots out, and what is needed in between."""

    fourier: RootWork
    determinant: Determinant
    found: Array  # (96, 2) root or middle [rad], uncertainty of a single root, or minus half the width of an interval
    stretches: Array  # (128, 3) middle and half-width to look at [rad], level
    filled: NDArray[np.int64]  # (4,) found, stretches, intervals without two branches, stretches that are not settled
    values: Array  # (17,)


def make_six_roots() -> SixRoots:
    """Fresh work arrays."""
    return SixRoots(
        make_roots(),
        make_determinant(),
        np.empty((MAX_SIX_ROOTS, 2)),
        np.empty((MAX_STRETCHES, 3)),
        np.zeros(4, np.int64),
        np.empty(SIZE),
    )


def find_six_roots(e: Equations, work: SixRoots) -> int:
    """Fill work.found with single roots and undecided intervals; returns how many, -1 where F is all noise.

    So it is, too, where the rows of its determinant are.
    """
    cosine, sine, rough, filled = work.fourier.cosine, work.fourier.sine, work.fourier.roots, work.filled
    filled[0], filled[1], filled[2], filled[3] = 0, 0, 0, 0
    most, area = area_of_columns(e)
    if not area > ON_ONE_LINE * most:
        return -1
    noise, minor = fourier_of_determinant(e, work.determinant, cosine, sine)
    noise = max(NOISE_OF_TOUCH * noise, NOISE_OF_M * minor)
    total = 0.0
    for n in range(cosine.shape[0]):
        total += abs(cosine[n]) + abs(sine[n])
    if not total > UNCERTAIN * noise:
        return -1
    count = find_roots(max(noise, POSE_NOISE * total), 0.0, work.fourier)
    for i in range(count):
        if rough[i, 1] > 0.0:
            add_stretch(work, rough[i, 0], rough[i, 1] * (TOUCHING if rough[i, 2] > 0.0 else 1.0), 0)
            continue
        _, slope = value_and_slope(cosine, sine, rough[i, 0])
        add_root(work, rough[i, 0], noise / abs(slope) if slope != 0.0 else 0.0)
    i = 0
    while i < filled[1]:
        before, stretches = filled[0], filled[1]
        look_closer(e, work, i)
        if filled[0] == before and filled[1] == stretches:  # F may touch zero there: from so near it is seen to miss it
            add_root(work, work.stretches[i, 0], -work.stretches[i, 1])
        # One look that shows roots settles a stretch. Where it takes more, or shows none, many roots may be together,
        # of which rounding says little.
        filled[3] += work.stretches[i, 2] > 0.0 or filled[0] == before
        i += 1
    return int(filled[0])


def add_root(work: SixRoots, theta: float, width: float) -> None:
    """Append a single root with its uncertainty, or an interval by its negative half-width."""
    i = work.filled[0]
    if i < MAX_SIX_ROOTS:
        work.found[i, 0], work.found[i, 1] = theta, width
        work.filled[0] = i + 1


def add_stretch(work: SixRoots, middle: float, half: float, level: int) -> None:
    """Append a stretch to look at, or extend the last one if it touches that."""
    i = work.filled[1]
    if i > 0 and work.stretches[i - 1, 2] == level:
        low, high = (
            work.stretches[i - 1, 0] - work.stretches[i - 1, 1],
            work.stretches[i - 1, 0] + work.stretches[i - 1, 1],
        )
        if abs(middle - half - high) <= MIN_WIDTH:
            work.stretches[i - 1, 0] = 0.5 * (low + middle + half)
            work.stretches[i - 1, 1] = 0.5 * (middle + half - low)
            return
    if i < MAX_STRETCHES:
        work.stretches[i, 0], work.stretches[i, 1], work.stretches[i, 2] = middle, half, level
        work.filled[1] = i + 1


def look_closer(e: Equations, work: SixRoots, index: int) -> None:
    """Find the roots on one stretch; parts that stay undecided become stretches or, at last, intervals."""
    middle, half, level = work.stretches[index, 0], work.stretches[index, 1], int(work.stretches[index, 2])
    half = 1.02 * half + 0.25 * MIN_WIDTH
    tau = math.tan(0.5 * half)
    stack, place, values, filled = work.fourier.stack, work.fourier.place, work.values, work.filled
    largest = 0.0
    for k in range(SIZE):
        theta = middle + 2.0 * math.atan(tau * (2.0 * NODES[k] - 1.0))
        values[k] = determinant(e, math.cos(theta), math.sin(theta), work.determinant) * factor_of(tau, NODES[k])
        largest = max(largest, abs(values[k]))
    for j in range(SIZE):
        stack[0, j] = 0.0
        for k in range(SIZE):
            stack[0, j] += TO_BERNSTEIN[j, k] * values[k]
    noise = (CLOSE_NOISE + NARROW_NOISE / half) * largest
    place[0, 0], place[0, 1] = 0.0, 1.0
    top, before = 0, work.filled[1]
    while top >= 0:
        b, x, width = stack[top], place[top, 0], place[top, 1]
        possible = count_roots(b, noise)
        if possible == 0:
            top -= 1
            continue
        low, high = (
            middle + 2.0 * math.atan(tau * (2.0 * x - 1.0)),
            middle + 2.0 * math.atan(tau * (2.0 * (x + width) - 1.0)),
        )
        if possible == 1:
            j = 0
            while (b[j + 1] > 0.0) == (b[0] > 0.0):
                j += 1
            guess = x + width * (j + b[j] / (b[j] - b[j + 1])) / (SIZE - 1)
            guess = middle + 2.0 * math.atan(tau * (2.0 * guess - 1.0))
            at_low, at_high = b[0] / factor_of(tau, x), b[SIZE - 1] / factor_of(tau, x + width)
            root = bracketed_root(e, work.determinant, low, high, at_low, at_high, guess)
            beside = root + BESIDE
            filled[3] += not abs(determinant(e, math.cos(beside), math.sin(beside), work.determinant)) > noise
            add_root(work, root, 0.0)
            top -= 1
            continue
        if width <= (NOISE_PART if possible == SIZE else LEAST_PART) or high - low <= 0.5 * MIN_WIDTH:
            add_stretch(work, 0.5 * (low + high), 0.5 * (high - low), level + 1)
            top -= 1
            continue
        split(b, stack[top + 1], 0.5)
        place[top, 0], place[top, 1] = x + 0.5 * width, 0.5 * width
        place[top + 1, 0], place[top + 1, 1] = x, 0.5 * width
        top += 1
    # What is not much smaller than before, or small enough, stays undecided.
    kept = before
    for i in range(before, work.filled[1]):
        size = work.stretches[i, 1]
        if size <= 0.5 * MIN_WIDTH or size > LARGEST_PART * half or level == LEVELS:
            add_root(work, work.stretches[i, 0], -size)
        else:
            for j in range(3):
                work.stretches[kept, j] = work.stretches[i, j]
            kept += 1
    work.filled[1] = kept


def factor_of(tau: float, x: float) -> float:
    """What makes F a polynomial on a stretch, at its place x in [0, 1]."""
    t = tau * (2.0 * x - 1.0)
    square = (1.0 + t * t) * (1.0 + t * t)
    return square * square * square * square


def bracketed_root(
    e: Equations, work: Determinant, low: float, high: float, at_low: float, at_high: float, theta: float
) -> float:
    """The one root in an interval, from determinants: the secant method, kept within the bracket.

    Args:
        e: the equations.
        work: work arrays.
        low: one end [rad].
        high: the other end [rad].
        at_low: about F there, of the sign that F has.
        at_high: the same at the other end.
        theta: a first guess [rad].
    """
    enough = min(FOUND_ROOT, FOUND_PART * (high - low))
    side = 0
    for _ in range(BRACKETED_STEPS):
        value = determinant(e, math.cos(theta), math.sin(theta), work)
        if value == 0.0:
            break
        if (value > 0.0) == (at_high > 0.0):
            high, at_high = theta, value
            at_low = 0.5 * at_low if side == 1 else at_low
            side = 1
        else:
            low, at_low = theta, value
            at_high = 0.5 * at_high if side == -1 else at_high
            side = -1
        before = theta
        theta = (low * at_high - high * at_low) / (at_high - at_low)
        if not low < theta < high:
            theta = 0.5 * (low + high)
        if abs(theta - before) < enough:
            break
    return theta
