"""Curves that lie between two slices wholly, in windows of joint 3 or told by complex roots of F: they get a slice."""

from __future__ import annotations

import cmath
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.closed_form.arm import pose_of, unpack_arm
from jacokin.kernels.closed_form.resultant import DEGREE, fourier_of_F
from jacokin.kernels.limits import TURN
from jacokin.kernels.self_motion.seven_joints import discriminants, elbow_discriminant, wrist_from_shoulder
from jacokin.kernels.self_motion.slices import (
    EDGES,
    SAMPLES,
    SLICES,
    WINDOWS,
    SevenJoints,
    SixJoints,
    Slices,
    turn_target,
    wrapped,
)
from jacokin.kernels.vector import Vec

#: Steps towards a maximum; each takes a third off the bracket.
MAXIMUM_STEPS = 24
#: A minimum that the parabola through three samples puts above this share of the middle one is not looked at.
HIGH_MINIMUM = 0.2
#: [m^4] and [m^2]; a discriminant no more than this below zero leaves points on the chord across that close to 1e-11.
SHALLOW = 1e-13
#: [rad] values nearer to each other are one.
SAME_SLICE = 1e-9


def lower_discriminant(chain: Array, arm7: Array, D0: Vec, q3: float, sign: float) -> float:
    """The discriminant that decides: for joint 4 where that is negative, else for joint 2."""
    first, plus, minus = discriminants(chain, arm7, D0, q3)
    return first if first < 0.0 else plus if sign > 0.0 else minus


def find_maximum(chain: Array, arm7: Array, D0: Vec, low: float, high: float, sign: float) -> tuple[float, float]:
    """Where the discriminant is largest between low and high, and its value; given up where it is positive."""
    best, value = 0.5 * (low + high), -math.inf
    for _ in range(MAXIMUM_STEPS):
        a, b = low + (high - low) / 3.0, high - (high - low) / 3.0
        at_a, at_b = (
            lower_discriminant(chain, arm7, D0, a, sign),
            lower_discriminant(chain, arm7, D0, b, sign),
        )
        if at_a >= at_b:
            best, value, high = a, at_a, b
        else:
            best, value, low = b, at_b, a
        if value > 0.0:
            break
    return best, value


def insert_slice(slices: Slices, n: int, p: float) -> int:
    """Insert a value among the first n, in order; returns how many there are then."""
    if n == SLICES:
        return n
    i = n
    while i > 0 and slices.p[i - 1] > p:
        slices.p[i], slices.crossed[i] = slices.p[i - 1], slices.crossed[i - 1]
        i -= 1
    slices.p[i], slices.crossed[i] = p, slices.crossed[i - 1] if i > 0 else 0  # on both sides now
    return n + 1


def add_windows(chain: Array, seven: SevenJoints, T: Array, n: int, slices: Slices) -> int:
    """Add a slice in each window that none of the first n slices lies in, and in each gap between two.

    Returns how many slices there are then.
    """
    arm7 = seven.arm
    D0 = wrist_from_shoulder(chain, arm7, T)
    windows = find_elbow_windows(chain, D0, seven)
    if windows >= 0:
        total = n
        for i in range(windows):
            total = insert_new(slices, total, seven.windows[i, 0])
        return total
    first, step = slices.p[0], TURN / SAMPLES
    for i in range(SAMPLES + 3):
        at_4, plus, minus = discriminants(chain, arm7, D0, first + (i - 1) * step)
        seven.samples[i, 0], seven.samples[i, 1], seven.samples[i, 2] = at_4, plus, minus
    total = n
    for k in range(1, 3):
        sign = 1.0 if k == 1 else -1.0
        begin, peak, peak_at = 0.0, -math.inf, 0.0  # of the window at hand
        before, here = lower_sample(seven.samples[0], k), lower_sample(seven.samples[1], k)
        for i in range(SAMPLES + 1):
            p = first + i * step
            after = lower_sample(seven.samples[i + 2], k)
            if here > 0.0:
                if i == 0 or not before > 0.0:
                    begin, peak = p, -math.inf
                if here > peak:
                    peak, peak_at = here, p
                if not after > 0.0 and not has_slice(slices, total, begin, p):
                    total = insert_new(slices, total, peak_at)
            elif here >= before and here >= after and i < SAMPLES:
                at, value = find_maximum(chain, arm7, D0, p - step, p + step, sign)
                if value > 0.0:
                    total = insert_new(slices, total, at)
            before, here = here, after
    return add_dips(chain, seven, D0, first, step, total, slices)


def lower_sample(sample: Array, kind: int) -> float:
    """As `lower_discriminant`, from a row of seven.samples; the sign of joint 4 by its column."""
    return float(sample[0] if sample[0] < 0.0 else sample[kind])


def one_discriminant(chain: Array, arm7: Array, D0: Vec, q3: float, kind: int) -> float:
    """The discriminant of joint 4 for kind 0, of joint 2 with either sign of joint 4 for kinds 1 and 2."""
    if kind == 0:
        return elbow_discriminant(chain, arm7, D0, q3)
    _, plus, minus = discriminants(chain, arm7, D0, q3)
    return plus if kind == 1 else minus


def find_dip(chain: Array, arm7: Array, D0: Vec, low: float, high: float, kind: int, flip: float) -> float:
    """Where flip times a discriminant is negative, near its minimum between low and high; nan if it is not."""
    for _ in range(MAXIMUM_STEPS):
        a, b = low + (high - low) / 3.0, high - (high - low) / 3.0
        at_a = flip * one_discriminant(chain, arm7, D0, a, kind)
        at_b = flip * one_discriminant(chain, arm7, D0, b, kind)
        if min(at_a, at_b) < -SHALLOW:
            return a if at_a <= at_b else b
        if at_a <= at_b:
            high = b
        else:
            low = a
    return math.nan


def has_slice(slices: Slices, n: int, low: float, high: float) -> bool:
    """Whether one of the first n slices, which close a circle, lies between two values of joint 3."""
    for i in range(n):
        on = slices.p[i] - TURN * math.floor((slices.p[i] - low + SAME_SLICE) / TURN)
        if on <= high + SAME_SLICE:
            return True
    return False


def insert_new(slices: Slices, n: int, p: float) -> int:
    """As `insert_slice`, in the copy that is among the values on the circle, unless that is there."""
    p -= TURN * math.floor((p - slices.p[0]) / TURN)
    return n if has_slice(slices, n, p, p) else insert_slice(slices, n, p)


def add_dips(chain: Array, seven: SevenJoints, D0: Vec, first: float, step: float, total: int, slices: Slices) -> int:
    """Add a slice where two configurations meet and part again, so that between there are none and no slice sees it.

    The slopes at the slices on both sides do not tell of it.

    Args:
        chain: (8, 3, 4).
        seven: the arm, and its samples.
        D0: what `wrist_from_shoulder` returned.
        first: first sample of joint 3, at a slice [rad].
        step: from sample to sample [rad].
        total: how many slices there are.
        slices: what they are added to.

    Returns:
        How many slices there are then.
    """
    for kind in range(3):
        begin, lowest = 0.0, 0.0  # of the run of samples that are not positive
        before, here = seven.samples[0, kind], seven.samples[1, kind]
        for i in range(SAMPLES):
            p = first + i * step
            after = seven.samples[i + 2, kind]
            if not here > 0.0:
                if i == 0 or before > 0.0:
                    begin, lowest = p, 0.0
                lowest = min(lowest, here)
                if after > 0.0 and lowest < -SHALLOW and not has_slice(slices, total, begin, p):
                    total = insert_new(slices, total, 0.5 * (begin + p))
            elif here <= before and here <= after:
                bend = after + before - 2.0 * here
                if (after - before) * (after - before) > 8.0 * (1.0 - HIGH_MINIMUM) * here * bend:
                    at = find_dip(chain, seven.arm, D0, p - step, p + step, kind, 1.0)
                    if at == at:
                        total = insert_new(slices, total, at)
            before, here = here, after
    return total


# --- Seven joints, nearly stretched: joint 3 has edges, where both values of joint 4 are one ---

#: Values of joint 3 at which edges are looked for, and of the angle round the loop between two of them.
EDGE_SAMPLES, LOOP_SAMPLES = 96, 192
EDGE_HALVINGS = 60
#: Where the samples begin [rad]: at no structured angle.
FIRST_SAMPLE = 0.1234


def add_edge(chain: Array, arm7: Array, D0: Vec, low: float, high: float, seven: SevenJoints, count: int) -> int:
    """Add the edge between two values of joint 3; returns how many there are then."""
    if count == EDGES:
        return count
    rises = elbow_discriminant(chain, arm7, D0, high) > 0.0
    for _ in range(EDGE_HALVINGS):
        middle = 0.5 * (low + high)
        if (elbow_discriminant(chain, arm7, D0, middle) > 0.0) == rises:
            high = middle
        else:
            low = middle
    seven.edges[count] = high if rises else low  # where there are configurations
    return count + 1


def find_edges(chain: Array, D0: Vec, seven: SevenJoints) -> int:
    """Fill seven.edges with where the discriminant of joint 4 changes its sign, the first one where it rises."""
    arm7, step, count = seven.arm, TURN / EDGE_SAMPLES, 0
    before = elbow_discriminant(chain, arm7, D0, FIRST_SAMPLE - step)
    here = elbow_discriminant(chain, arm7, D0, FIRST_SAMPLE)
    begins_inside = here > 0.0
    for i in range(EDGE_SAMPLES):
        p = FIRST_SAMPLE + i * step
        after = elbow_discriminant(chain, arm7, D0, p + step)
        at = math.nan
        if here > 0.0 and before > here and after >= here:
            at = find_dip(chain, arm7, D0, p - step, p + step, 0, 1.0)
        elif not here > 0.0 and here > before and here >= after and not after > 0.0:
            at = find_dip(chain, arm7, D0, p - step, p + step, 0, -1.0)
        if at == at:
            count = add_edge(chain, arm7, D0, p - step, at, seven, count)
            count = add_edge(chain, arm7, D0, at, p + step, seven, count)
        if (here > 0.0) != (after > 0.0):
            count = add_edge(chain, arm7, D0, p, p + step, seven, count)
        before, here = here, after
    if begins_inside and count > 0:
        first = seven.edges[0]
        for i in range(count - 1):
            seven.edges[i] = seven.edges[i + 1]
        seven.edges[count - 1] = first + TURN
    return count - count % 2


def loop_place(low: float, high: float, angle: float) -> tuple[float, float]:
    """Joint 3 [rad] and the sign of joint 4 at an angle round the loop that both values of joint 4 make."""
    q3 = 0.5 * (low + high) - 0.5 * (high - low) * math.cos(angle)
    return q3, 1.0 if math.sin(angle) > 0.0 else -1.0


def loop_discriminant(chain: Array, arm7: Array, D0: Vec, low: float, high: float, angle: float) -> float:
    """The discriminant of joint 2 at an angle round the loop, in which it is smooth."""
    q3, sign = loop_place(low, high, angle)
    _, plus, minus = discriminants(chain, arm7, D0, q3)
    return plus if sign > 0.0 else minus


def add_extremum(
    chain: Array, D0: Vec, low: float, high: float, angle: float, flip: float, seven: SevenJoints, count: int
) -> int:
    """Add the place near an angle where flip times the discriminant is largest, if it is positive there."""
    step = TURN / LOOP_SAMPLES
    a, b = angle - step, angle + step
    for _ in range(MAXIMUM_STEPS):
        if flip * loop_discriminant(chain, seven.arm, D0, low, high, angle) > (0.0 if flip > 0.0 else SHALLOW):
            if count < WINDOWS:
                seven.windows[count, 0], sign = loop_place(low, high, angle)
                seven.windows[count, 1] = sign if flip > 0.0 else 0.0
                return count + 1
            return count
        c, d = a + (b - a) / 3.0, b - (b - a) / 3.0
        at_c = flip * loop_discriminant(chain, seven.arm, D0, low, high, c)
        at_d = flip * loop_discriminant(chain, seven.arm, D0, low, high, d)
        if at_c >= at_d:
            b, angle = d, c
        else:
            a, angle = c, d
    return count


def find_elbow_windows(chain: Array, D0: Vec, seven: SevenJoints) -> int:
    """Fill seven.windows between the edges of joint 3; returns how many there are, -1 where there are no edges.

    Where both values of joint 4 are nearly one, the discriminant of joint 2 changes as the root of the way to the edge,
    and windows of it are narrow there; round the loop it is smooth.
    """
    edges, count = find_edges(chain, D0, seven), 0
    if edges == 0:
        return -1
    step = TURN / LOOP_SAMPLES
    for i in range(0, edges, 2):
        low, high = seven.edges[i], seven.edges[i + 1]
        before = loop_discriminant(chain, seven.arm, D0, low, high, -0.5 * step)
        here = loop_discriminant(chain, seven.arm, D0, low, high, 0.5 * step)
        for n in range(LOOP_SAMPLES):
            angle = (n + 0.5) * step
            after = loop_discriminant(chain, seven.arm, D0, low, high, angle + step)
            if here > before and here >= after:
                count = add_extremum(chain, D0, low, high, angle, 1.0, seven, count)
            elif here < before and here <= after:
                count = add_extremum(chain, D0, low, high, angle, -1.0, seven, count)
            before, here = here, after
    return count


# --- Six joints and a free axis ---

ALL_ROOTS = 2 * DEGREE
#: [rad] of the parameter, for derivatives.
NUDGE = 2e-5
#: [rad] a root this near to the real axis is real.
REAL = 1e-6
#: [rad] one that is looked at closely and is nearer is certainly real.
REAL_HERE = 1e-8
#: [rad] roots farther from the real axis do not reach it within a gap.
FARTHEST = 0.7
#: Steps of all roots at a slice at most, and at the first one.
ALL_ROOTS_STEPS, FIRST_STEPS = 12, 100
ALL_ROOTS_ACCURACY = 1e-8
#: Or a share of the distance to the nearest root: convergence is cubic, so that a millionth of it is left at most.
ALL_ROOTS_SHARE = 1e-3
#: Leading coefficients below this share of the largest one are rounding: with a spherical wrist the degree is 4.
NO_COEFFICIENT = 1e-11
#: A minimum of y^2 that the cubic puts above this share of the values at the slices stays above zero.
HIGH = 0.6
#: The same share of the larger value, where y^2 has a flat minimum that a cubic cannot follow.
FLAT = 0.05
#: [rad] by which a root is expected to move from slice to slice at most.
LONGEST_MOVE = 0.3
MINIMUM_STEPS, ONE_ROOT_STEPS = 12, 12
ONE_ROOT_ACCURACY = 1e-13
#: Share of a bracket that a step leaves at either end.
CLOSEST = 0.01
#: Where the lanes of all roots begin, real parts and then imaginary ones: the roots, values and slopes of the
#: polynomial there, sums over the other roots, and the squared distance to the nearest.
REAL_PART, IMAGINARY, VALUE, SLOPE, OTHERS, NEAREST, LANES = (n * ALL_ROOTS for n in (0, 1, 2, 4, 6, 8, 9))


class Loops(NamedTuple):
    """Roots at two slices, and what they are computed with."""

    fourier: Array  # (3, 2, 9) coefficients of F at a parameter, NUDGE on and NUDGE before: cosines, sines
    polynomial: Array  # (2, 17, 2) z^8 F and its derivative by the parameter, z = exp(i q6); real and imaginary parts
    roots: Array  # (2, 16, 2) z at the last slice and at this one
    height: Array  # (2, 16, 4) y^2 there, -1 where it is not looked at, and its derivative; dz/dp / z
    rate: Array  # (16, 2) dz/dp / z at the slice before the last one
    moving: NDArray[np.int64]  # (16,) 1 for roots that are still improved
    lanes: Array  # (LANES,) to work in: what is computed of all roots at once
    found: Array  # (SLICES,) values of the parameter to add


def make_loops() -> Loops:
    """Fresh arrays."""
    return Loops(
        np.empty((3, 2, DEGREE + 1)),
        np.empty((2, ALL_ROOTS + 1, 2)),
        np.empty((2, ALL_ROOTS, 2)),
        np.empty((2, ALL_ROOTS, 4)),
        np.empty((ALL_ROOTS, 2)),
        np.zeros(ALL_ROOTS, np.int64),
        np.empty(LANES),
        np.empty(SLICES),
    )


def fill_polynomial(T: Array, p: float, six: SixJoints, loops: Loops) -> None:
    """Fill loops.polynomial for the target turned by p [rad]."""
    k = unpack_arm(six.arm)
    for n in range(3):
        turn_target(T, six.axis, p + (n if n < 2 else -1) * NUDGE, six.T)
        fourier_of_F(k, pose_of(six.arm, k, six.T), loops.fourier[n, 0], loops.fourier[n, 1])
    for n in range(2):
        for m in range(DEGREE + 1):
            a, b = loops.fourier[0, 0, m], loops.fourier[0, 1, m]
            if n == 1:
                a = 0.5 * (loops.fourier[1, 0, m] - loops.fourier[2, 0, m]) / NUDGE
                b = 0.5 * (loops.fourier[1, 1, m] - loops.fourier[2, 1, m]) / NUDGE
            share = 1.0 if m == 0 else 0.5
            loops.polynomial[n, DEGREE + m, 0], loops.polynomial[n, DEGREE + m, 1] = share * a, -share * b
            loops.polynomial[n, DEGREE - m, 0], loops.polynomial[n, DEGREE - m, 1] = share * a, share * b


def degree_of(polynomial: Array) -> int:
    """How many coefficients on either side of the middle one are more than rounding."""
    largest = 0.0
    for n in range(DEGREE + 1):
        largest = max(largest, squared_size(polynomial, n))
    degree = DEGREE
    while degree > 0 and squared_size(polynomial, degree) <= NO_COEFFICIENT * NO_COEFFICIENT * largest:
        degree -= 1
    return degree


def squared_size(polynomial: Array, n: int) -> float:
    """The squared size of coefficient n after the middle one."""
    a, b = polynomial[0, DEGREE + n, 0], polynomial[0, DEGREE + n, 1]
    return float(a * a + b * b)


def value_at(polynomial: Array, n: int, degree: int, z: complex) -> complex:
    """Polynomial n, without what is rounding."""
    value = complex(0.0, 0.0)
    for m in range(DEGREE + degree, DEGREE - degree - 1, -1):
        value = value * z + complex(polynomial[n, m, 0], polynomial[n, m, 1])
    return value


def slope_at(polynomial: Array, degree: int, z: complex) -> complex:
    """Derivative of polynomial 0 by z."""
    slope = complex(0.0, 0.0)
    for m in range(2 * degree, 0, -1):
        c = DEGREE - degree + m
        slope = slope * z + m * complex(polynomial[0, c, 0], polynomial[0, c, 1])
    return slope


def take_roots(degree: int, roots: Array, lanes: Array) -> None:
    """Fill the lanes with the first 2 degree roots, the others with zero."""
    for i in range(ALL_ROOTS):
        lanes[REAL_PART + i] = roots[i, 0] if i < 2 * degree else 0.0
        lanes[IMAGINARY + i] = roots[i, 1] if i < 2 * degree else 0.0


def evaluate(polynomial: Array, n: int, degree: int, lanes: Array, at: int) -> None:
    """Fill the lanes from `at` on with the values of polynomial n at the roots, by Horner's rule for all at once."""
    for i in range(ALL_ROOTS):
        lanes[at + i], lanes[at + ALL_ROOTS + i] = 0.0, 0.0
    for m in range(DEGREE + degree, DEGREE - degree - 1, -1):
        real, imaginary = polynomial[n, m, 0], polynomial[n, m, 1]
        for i in range(ALL_ROOTS):
            x, y, a, b = lanes[REAL_PART + i], lanes[IMAGINARY + i], lanes[at + i], lanes[at + ALL_ROOTS + i]
            lanes[at + i] = a * x - b * y + real
            lanes[at + ALL_ROOTS + i] = a * y + b * x + imaginary


def evaluate_slopes(polynomial: Array, degree: int, lanes: Array) -> None:
    """The same of polynomial 0, and its derivative by z."""
    for i in range(4 * ALL_ROOTS):
        lanes[VALUE + i] = 0.0
    for m in range(DEGREE + degree, DEGREE - degree - 1, -1):
        real, imaginary = polynomial[0, m, 0], polynomial[0, m, 1]
        for i in range(ALL_ROOTS):
            x, y = lanes[i], lanes[IMAGINARY + i]
            a, b = lanes[VALUE + i], lanes[VALUE + ALL_ROOTS + i]
            c, d = lanes[SLOPE + i], lanes[SLOPE + ALL_ROOTS + i]
            lanes[SLOPE + i] = c * x - d * y + a
            lanes[SLOPE + ALL_ROOTS + i] = c * y + d * x + b
            lanes[VALUE + i] = a * x - b * y + real
            lanes[VALUE + ALL_ROOTS + i] = a * y + b * x + imaginary


def separate(count: int, lanes: Array) -> None:
    """Fill the lanes with the sums of 1 / (z - other) over so many roots, and squared distances to the nearest one."""
    for i in range(ALL_ROOTS):
        lanes[OTHERS + i], lanes[OTHERS + ALL_ROOTS + i], lanes[NEAREST + i] = 0.0, 0.0, math.inf
    for j in range(count):
        x, y = lanes[j], lanes[IMAGINARY + j]
        for i in range(ALL_ROOTS):
            u, v = lanes[i] - x, lanes[IMAGINARY + i] - y
            square = u * u + v * v
            inverse = 1.0 / square if square > 0.0 else 0.0
            lanes[OTHERS + i] += u * inverse
            lanes[OTHERS + ALL_ROOTS + i] -= v * inverse
            lanes[NEAREST + i] = min(lanes[NEAREST + i], square if square > 0.0 else math.inf)


def improve_roots(polynomial: Array, degree: int, roots: Array, steps: int, loops: Loops) -> None:
    """Improve the first 2 degree roots all at once, each kept apart from the others (Aberth, 1973)."""
    lanes, moving = loops.lanes, loops.moving
    take_roots(degree, roots, lanes)
    for i in range(2 * degree):
        moving[i] = 1
    for _ in range(steps):
        settled = True
        evaluate_slopes(polynomial, degree, lanes)
        separate(2 * degree, lanes)
        for i in range(2 * degree):
            a, b = lanes[VALUE + i], lanes[VALUE + ALL_ROOTS + i]
            if moving[i] == 0 or (a == 0.0 and b == 0.0):
                continue
            # The step is value / (slope - value * sum).
            e, f = lanes[OTHERS + i], lanes[OTHERS + ALL_ROOTS + i]
            c = lanes[SLOPE + i] - (a * e - b * f)
            d = lanes[SLOPE + ALL_ROOTS + i] - (a * f + b * e)
            square = c * c + d * d
            if square == 0.0:
                continue
            u, v = (a * c + b * d) / square, (b * c - a * d) / square
            x, y = lanes[i], lanes[IMAGINARY + i]
            lanes[i], lanes[IMAGINARY + i] = x - u, y - v
            square = u * u + v * v
            settles = square <= ALL_ROOTS_ACCURACY * ALL_ROOTS_ACCURACY * (x * x + y * y)
            if settles or square <= ALL_ROOTS_SHARE * ALL_ROOTS_SHARE * lanes[NEAREST + i]:
                moving[i] = 0
            else:
                settled = False
        if settled:
            break
    for i in range(2 * degree):
        roots[i, 0], roots[i, 1] = lanes[i], lanes[IMAGINARY + i]


def fill_heights(polynomial: Array, degree: int, roots: Array, height: Array, lanes: Array) -> None:
    """Fill height with y^2 of each root and its derivative by the parameter, -1 where it is real or far from it."""
    take_roots(degree, roots, lanes)
    evaluate_slopes(polynomial, degree, lanes)
    evaluate(polynomial, 1, degree, lanes, OTHERS)
    for i in range(ALL_ROOTS):
        height[i, 0], height[i, 2], height[i, 3] = -1.0, 0.0, 0.0
        if i >= 2 * degree:
            continue
        u, v, c, d = lanes[i], lanes[IMAGINARY + i], lanes[SLOPE + i], lanes[SLOPE + ALL_ROOTS + i]
        e, f = lanes[OTHERS + i], lanes[OTHERS + ALL_ROOTS + i]
        c, d = c * u - d * v, c * v + d * u
        square = c * c + d * d
        if square == 0.0:
            continue
        y = -0.5 * math.log(u * u + v * v)
        height[i, 2], height[i, 3] = -(e * c + f * d) / square, (e * d - f * c) / square
        if REAL < abs(y) < FARTHEST:
            height[i, 0], height[i, 1] = y * y, -2.0 * y * height[i, 2]


def lowest(a: float, da: float, b: float, db: float, h: float) -> float:
    """Where the cubic with these values and slopes, h apart, has a minimum between, as a share of h; -1 for none."""
    c3, c2 = 2.0 * (a - b) + h * (da + db), 3.0 * (b - a) - h * (2.0 * da + db)
    square = c2 * c2 - 3.0 * c3 * h * da
    if square < 0.0:
        return -1.0
    bottom = c2 + math.sqrt(square)
    if bottom == 0.0:
        return -1.0
    share = -h * da / bottom
    return share if 0.0 < share < 1.0 else -1.0


def cubic_at(a: float, da: float, b: float, db: float, h: float, u: float) -> float:
    """Value of that cubic at a share u."""
    c3, c2 = 2.0 * (a - b) + h * (da + db), 3.0 * (b - a) - h * (2.0 * da + db)
    return a + u * (h * da + u * (c2 + u * c3))


def near_root(polynomial: Array, degree: int, z: complex) -> complex:
    """The root near z, from parabolas: of two that meet, each is as easy to find as a single one."""
    for _ in range(ONE_ROOT_STEPS):
        value, slope, bend = complex(0.0, 0.0), complex(0.0, 0.0), complex(0.0, 0.0)
        for m in range(DEGREE + degree, DEGREE - degree - 1, -1):
            bend = bend * z + slope
            slope = slope * z + value
            value = value * z + complex(polynomial[0, m, 0], polynomial[0, m, 1])
        root = cmath.sqrt(slope * slope - 4.0 * value * bend)
        bottom = slope + root if abs(slope + root) > abs(slope - root) else slope - root
        if bottom == 0.0:
            break
        step = 2.0 * value / bottom
        z -= step
        if abs(step) < ONE_ROOT_ACCURACY:
            break
    return z


def becomes_real(T: Array, low: float, high: float, i: int, six: SixJoints, loops: Loops) -> float:
    """A parameter between two slices where root i is real, nan if it seems to stay complex."""
    x_low = cmath.phase(complex(loops.roots[0, i, 0], loops.roots[0, i, 1]))
    x_high = x_low + wrapped(cmath.phase(complex(loops.roots[1, i, 0], loops.roots[1, i, 1])) - x_low)
    # y^2, x and their derivatives at both ends of a bracket that narrows.
    a, da, xa, dxa = loops.height[0, i, 0], loops.height[0, i, 1], x_low, loops.height[0, i, 3]
    b, db, xb, dxb = loops.height[1, i, 0], loops.height[1, i, 1], x_high, loops.height[1, i, 3]
    perhaps = math.nan
    for _ in range(MINIMUM_STEPS):
        h = high - low
        share = lowest(a, da, b, db, h)
        if share < 0.0 or h < NUDGE:
            break
        share = min(max(share, CLOSEST), 1.0 - CLOSEST)
        p = low + share * h
        fill_polynomial(T, p, six, loops)
        degree = degree_of(loops.polynomial)
        y = math.sqrt(max(cubic_at(a, da, b, db, h, share), 0.0))
        x = cubic_at(xa, dxa, xb, dxb, h, share)
        z = near_root(loops.polynomial, degree, cmath.exp(complex(-y, x)))
        if z == 0.0:
            break
        y = -math.log(abs(z))
        if abs(y) < REAL_HERE:
            return p
        if abs(y) < REAL:
            perhaps = p
        slope = slope_at(loops.polynomial, degree, z)
        if not abs(y) < FARTHEST or slope == 0.0:
            break
        rate = -value_at(loops.polynomial, 1, degree, z) / slope / z
        x += wrapped(cmath.phase(z) - x)
        if rate.real * y > 0.0:
            low, a, da, xa, dxa = p, y * y, -2.0 * y * rate.real, x, rate.imag
        else:
            high, b, db, xb, dxb = p, y * y, -2.0 * y * rate.real, x, rate.imag
    return perhaps


def add_loops(T: Array, n: int, closed: bool, slices: Slices, six: SixJoints, loops: Loops) -> int:
    """Add a slice in each gap between the first n slices that a curve is closed in; returns how many there are then."""
    count = 0
    steps = FIRST_STEPS
    before, known = 0, 0  # degree at the last slice, and how many slices in a row have had it
    for i in range(n + 1 if closed else n):
        p = slices.p[i] if i < n else slices.p[0] + TURN
        fill_polynomial(T, p, six, loops)
        degree = degree_of(loops.polynomial)
        if i == 0 or degree != before:
            steps, known = FIRST_STEPS, 0
            for k in range(ALL_ROOTS):
                z = cmath.rect(1.0 + 0.1 * math.cos(3.0 * k), 0.4 + TURN * k / max(2 * degree, 1))
                loops.roots[1, k, 0], loops.roots[1, k, 1] = z.real, z.imag
        else:
            h = p - slices.p[i - 1]
            for k in range(2 * degree):
                rate = complex(loops.height[0, k, 2], loops.height[0, k, 3])
                move = h * rate
                if known > 1:  # as the rate changed before, unless a root turns just there
                    change = rate - complex(loops.rate[k, 0], loops.rate[k, 1])
                    if abs(change) < abs(rate):
                        move += 0.5 * h * h / (slices.p[i - 1] - slices.p[i - 2]) * change
                move /= max(1.0, abs(move) / LONGEST_MOVE)
                growth = 1.0 + move * (1.0 + move * (0.5 + move / 6.0))  # nearly its exponential
                z = complex(loops.roots[0, k, 0], loops.roots[0, k, 1]) * growth
                loops.roots[1, k, 0], loops.roots[1, k, 1] = z.real, z.imag
        known += 1
        improve_roots(loops.polynomial, degree, loops.roots[1], steps, loops)
        fill_heights(loops.polynomial, degree, loops.roots[1], loops.height[1], loops.lanes)
        if i > 0 and degree == before:
            low = slices.p[i - 1]
            h = p - low
            for k in range(2 * degree):
                a, da = loops.height[0, k, 0], loops.height[0, k, 1]
                b, db = loops.height[1, k, 0], loops.height[1, k, 1]
                above = math.hypot(loops.roots[0, k, 0], loops.roots[0, k, 1]) < 1.0  # of the two conjugates
                if not above or a <= 0.0 or b <= 0.0 or count == SLICES:
                    continue
                share = lowest(a, da, b, db, h)
                if share < 0.0 or cubic_at(a, da, b, db, h, share) > max(HIGH * min(a, b), FLAT * max(a, b)):
                    continue
                at = becomes_real(T, low, p, k, six, loops)
                if at == at:
                    loops.found[count] = at
                    count += 1
        steps, before = ALL_ROOTS_STEPS, degree
        for k in range(ALL_ROOTS):
            loops.rate[k, 0], loops.rate[k, 1] = loops.height[0, k, 2], loops.height[0, k, 3]
            loops.roots[0, k, 0], loops.roots[0, k, 1] = loops.roots[1, k, 0], loops.roots[1, k, 1]
            for m in range(4):
                loops.height[0, k, m] = loops.height[1, k, m]
    total = n
    for k in range(count):
        total = insert_slice(slices, total, loops.found[k])
    return total
