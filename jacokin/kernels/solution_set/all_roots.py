"""All roots of F at one value of the parameter, and what F tells of each.

They are side by side in rows of one array, because compilers know that these do not overlap and make vector
instructions of what all roots have in common.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from jacokin.arrays import Array
from jacokin.kernels.closed_form.resultant import DEGREE
from jacokin.kernels.limits import TURN

#: Roots of z^n F, for n the degree of F.
ROOTS = 2 * DEGREE
#: Steps to all roots at once; a root is found when its step is this part of the distance to the nearest other one: each
#: step squares what is missing at least, and a step of Newton's method follows.
ABERTH_STEPS, LAST_STEP = 40, 1e-2
#: Share of all coefficients of F that is rounding of its value: nothing is nearer to a root. Stands for the square of
#: such a root's last step.
ROUNDING, SETTLED = 1e-15, 1e-300
#: A root is below the real axis if it is so by more than this share of how far another one is above.
SHARE_BELOW = 0.5
#: Rows: real and imaginary parts of z; of z^n F there, its slope and bend; of its derivative by the parameter and the
#: slope of that, and of the second one; of where the real axis is nearest, and of F there.
X, Y, VALUE, VALUE_I, SLOPE, SLOPE_I, BEND, BEND_I, MOVES, MOVES_I, MIXED, MIXED_I, CURVES, CURVES_I = range(14)
AXIS, AXIS_I, ON_AXIS, ON_AXIS_I = range(14, 18)
#: And the square of its last step for each that is found, else 0; of one root to all others, 1 / (z - other) and the
#: square of the distance.
LAST, INVERSE, INVERSE_I, SQUARE, ROWS = range(18, 23)


class Root(NamedTuple):
    """A root z = exp(i x) of F at one value of the parameter."""

    x: complex  # z itself
    slope: complex  # the derivative of z^n F there; 0 where nothing can be told
    bend: complex  # and its second one
    turns: complex  # the derivative of z by the parameter
    bends: complex  # and its second one
    d: float  # of x from the real axis, of one of each pair positive
    on_axis: float  # the size of F where the real axis is nearest: noise of that size may bring the root there


def make_lanes() -> Array:
    """Rows for all roots."""
    return np.zeros((ROWS, ROOTS))


def find_all_roots(powers: Array, degree: int, z: Array, lanes: Array) -> None:
    """Bring z (16, 2) to all roots of z^(degree / 2) F at once, from wherever it is (Aberth, 1973).

    A root that has settled moves on when another one comes near: of two that all but meet, the first one is no nearer
    to them than half of its last step before.

    Args:
        powers: (17, 2) coefficients in z of z^8 F.
        degree: of the polynomial that is looked at, the middle of that one.
        z: the first ones are changed in place, so many as the degree.
        lanes: work array.
    """
    rounding = 0.0
    for m in range(2 * DEGREE + 1):
        rounding += abs(powers[m, 0]) + abs(powers[m, 1])
    rounding *= ROUNDING
    for i in range(degree):
        lanes[X, i], lanes[Y, i], lanes[LAST, i] = z[i, 0], z[i, 1], 0.0
    for _ in range(ABERTH_STEPS):
        moving = 0
        for i in range(degree):
            if lanes[LAST, i] > 0.0:
                continue
            x, y = lanes[X, i], lanes[Y, i]
            value, slope = value_and_slope_at(powers, degree, complex(x, y))
            moving += look_around(x, y, degree, lanes)
            others, nearest = others_around(degree, lanes)
            slope -= value * others
            square = slope.real * slope.real + slope.imag * slope.imag
            if square == 0.0:
                continue
            a = (value.real * slope.real + value.imag * slope.imag) / square
            b = (value.imag * slope.real - value.real * slope.imag) / square
            lanes[X, i], lanes[Y, i] = x - a, y - b
            square = a * a + b * b
            if abs(value.real) + abs(value.imag) <= rounding:
                lanes[LAST, i] = SETTLED
            elif square <= LAST_STEP * LAST_STEP * nearest:
                lanes[LAST, i] = square
            else:
                moving += 1
        if moving == 0:
            break
    for i in range(degree):
        z[i, 0], z[i, 1] = lanes[X, i], lanes[Y, i]


def value_and_slope_at(powers: Array, degree: int, x: complex) -> tuple[complex, complex]:
    """Value and slope of z^(degree / 2) F, whose degree is even.

    Even and odd powers are summed side by side, in half the time.
    """
    first, w = DEGREE - degree // 2, x * x
    even, odd = complex(powers[first + degree, 0], powers[first + degree, 1]), 0.0j
    even_rate, odd_rate = 0.0j, 0.0j
    for m in range(first + degree - 2, first - 1, -2):
        odd_rate = odd_rate * w + odd
        odd = odd * w + complex(powers[m + 1, 0], powers[m + 1, 1])
        even_rate = even_rate * w + even
        even = even * w + complex(powers[m, 0], powers[m, 1])
    return even + x * odd, odd + 2.0 * x * (even_rate + x * odd_rate)


def look_around(x: float, y: float, degree: int, lanes: Array) -> int:
    """Fill what a root is to all others; how many of those that had settled move on."""
    moving = 0
    for j in range(degree):
        a, b = x - lanes[X, j], y - lanes[Y, j]
        square = a * a + b * b
        inverse = 1.0 / square if square != 0.0 else 0.0
        lanes[INVERSE, j], lanes[INVERSE_I, j] = a * inverse, -b * inverse
        lanes[SQUARE, j] = square if square != 0.0 else math.inf
        is_near = square != 0.0 and lanes[LAST, j] > LAST_STEP * LAST_STEP * square
        lanes[LAST, j] = 0.0 if is_near else lanes[LAST, j]
        moving += 1 if is_near else 0
    return moving


def others_around(degree: int, lanes: Array) -> tuple[complex, float]:
    """The sum over 1 / (z - others), and the square of the distance to the nearest one, that `look_around` leaves."""
    a, b, c, d = 0.0, 0.0, 0.0, 0.0
    first, second = math.inf, math.inf
    for j in range(0, degree, 2):
        a, b = a + lanes[INVERSE, j], b + lanes[INVERSE_I, j]
        c, d = c + lanes[INVERSE, j + 1], d + lanes[INVERSE_I, j + 1]
        first, second = min(first, lanes[SQUARE, j]), min(second, lanes[SQUARE, j + 1])
    return complex(a + c, b + d), min(first, second)


def tell_roots(powers: Array, degree: int, z: Array, lanes: Array) -> None:
    """Fill lanes with what F tells of all roots, and bring them and z nearer by a step of Newton's method.

    Args:
        powers: (3, 17, 2) coefficients of z^8 F, and of its first and second derivative by the parameter.
        degree: as for `find_all_roots`.
        z: (16, 2) its roots.
        lanes: filled.
    """
    for i in range(degree):
        lanes[X, i], lanes[Y, i] = z[i, 0], z[i, 1]
    fill_bends(powers[0], degree, lanes)
    fill_moves(powers[1], powers[2], degree, lanes)
    for i in range(degree):
        s, t, v, w = lanes[SLOPE, i], lanes[SLOPE_I, i], lanes[VALUE, i], lanes[VALUE_I, i]
        square = s * s + t * t
        if square > 0.0:
            lanes[X, i] -= (v * s + w * t) / square
            lanes[Y, i] -= (w * s - v * t) / square
        x, y = lanes[X, i], lanes[Y, i]
        z[i, 0], z[i, 1] = x, y
        inverse = 1.0 / math.sqrt(x * x + y * y)
        lanes[AXIS, i], lanes[AXIS_I, i] = x * inverse, y * inverse
    fill_on_axis(powers[0], degree, lanes)


def fill_bends(powers: Array, degree: int, lanes: Array) -> None:
    """Fill value, slope and bend of z^(degree / 2) F at all places."""
    first = DEGREE - degree // 2
    for i in range(degree):
        lanes[VALUE, i], lanes[VALUE_I, i] = powers[first + degree, 0], powers[first + degree, 1]
        lanes[SLOPE, i], lanes[SLOPE_I, i], lanes[BEND, i], lanes[BEND_I, i] = 0.0, 0.0, 0.0, 0.0
    for m in range(first + degree - 1, first - 1, -1):
        p, q = powers[m, 0], powers[m, 1]
        for i in range(degree):
            x, y, v, w = lanes[X, i], lanes[Y, i], lanes[VALUE, i], lanes[VALUE_I, i]
            s, t, b, c = lanes[SLOPE, i], lanes[SLOPE_I, i], lanes[BEND, i], lanes[BEND_I, i]
            lanes[BEND, i], lanes[BEND_I, i] = b * x - c * y + 2.0 * s, b * y + c * x + 2.0 * t
            lanes[SLOPE, i], lanes[SLOPE_I, i] = s * x - t * y + v, s * y + t * x + w
            lanes[VALUE, i], lanes[VALUE_I, i] = v * x - w * y + p, v * y + w * x + q


def fill_moves(rates: Array, bends: Array, degree: int, lanes: Array) -> None:
    """Fill the first derivative by the parameter with its slope, and the second one, at all places."""
    first = DEGREE - degree // 2
    for i in range(degree):
        lanes[MOVES, i], lanes[MOVES_I, i] = rates[first + degree, 0], rates[first + degree, 1]
        lanes[MIXED, i], lanes[MIXED_I, i] = 0.0, 0.0
        lanes[CURVES, i], lanes[CURVES_I, i] = bends[first + degree, 0], bends[first + degree, 1]
    for m in range(first + degree - 1, first - 1, -1):
        p, q, f, g = rates[m, 0], rates[m, 1], bends[m, 0], bends[m, 1]
        for i in range(degree):
            x, y, v, w = lanes[X, i], lanes[Y, i], lanes[MOVES, i], lanes[MOVES_I, i]
            s, t, b, c = lanes[MIXED, i], lanes[MIXED_I, i], lanes[CURVES, i], lanes[CURVES_I, i]
            lanes[MIXED, i], lanes[MIXED_I, i] = s * x - t * y + v, s * y + t * x + w
            lanes[MOVES, i], lanes[MOVES_I, i] = v * x - w * y + p, v * y + w * x + q
            lanes[CURVES, i], lanes[CURVES_I, i] = b * x - c * y + f, b * y + c * x + g


def fill_on_axis(powers: Array, degree: int, lanes: Array) -> None:
    """Fill the value of z^(degree / 2) F where the real axis is nearest to all places."""
    first = DEGREE - degree // 2
    for i in range(degree):
        lanes[ON_AXIS, i], lanes[ON_AXIS_I, i] = powers[first + degree, 0], powers[first + degree, 1]
    for m in range(first + degree - 1, first - 1, -1):
        p, q = powers[m, 0], powers[m, 1]
        for i in range(degree):
            x, y, v, w = lanes[AXIS, i], lanes[AXIS_I, i], lanes[ON_AXIS, i], lanes[ON_AXIS_I, i]
            lanes[ON_AXIS, i], lanes[ON_AXIS_I, i] = v * x - w * y + p, v * y + w * x + q


def root_of(lanes: Array, i: int) -> Root:
    """What F tells of root i."""
    x, slope = complex(lanes[X, i], lanes[Y, i]), complex(lanes[SLOPE, i], lanes[SLOPE_I, i])
    bend, mixed = complex(lanes[BEND, i], lanes[BEND_I, i]), complex(lanes[MIXED, i], lanes[MIXED_I, i])
    curves, moves = complex(lanes[CURVES, i], lanes[CURVES_I, i]), complex(lanes[MOVES, i], lanes[MOVES_I, i])
    square = x.real * x.real + x.imag * x.imag
    if slope == 0.0 or not square > 0.0:
        return Root(x, 0.0j, bend, 0.0j, 0.0j, -math.inf, 0.0)
    turns = -moves / slope
    bends = -(curves + (2.0 * mixed + bend * turns) * turns) / slope
    on_axis = length_of(complex(lanes[ON_AXIS, i], lanes[ON_AXIS_I, i]))
    return Root(x, slope, bend, turns, bends, -0.5 * math.log(square), on_axis)


def distance_to_next(lanes: Array, i: int, degree: int) -> float:
    """From root i to the next one."""
    x, y, nearest = lanes[X, i], lanes[Y, i], math.inf
    for j in range(degree):
        a, b = lanes[X, j] - x, lanes[Y, j] - y
        nearest = min(nearest, a * a + b * b if j != i else math.inf)
    return math.sqrt(nearest)


def until_meeting(lanes: Array, i: int, degree: int) -> tuple[float, float]:
    """After how much a root with d > 0 may meet another that is not below the real axis, ahead and behind.

    Their distance is the root of how far off that is: it would be twice as far at their speed.
    """
    root, ahead, behind = root_of(lanes, i), math.inf, math.inf
    for j in range(degree):
        other = root_of(lanes, j)
        if j == i or other.d < -root.d * SHARE_BELOW:
            continue
        between, moves = root.x - other.x, root.turns - other.turns
        square, rate = between.real**2 + between.imag**2, between.real * moves.real + between.imag * moves.imag
        if rate < 0.0:
            ahead = min(ahead, -0.5 * square / rate)
        elif rate > 0.0:
            behind = min(behind, 0.5 * square / rate)
    return ahead, behind


def length_of(z: complex) -> float:
    """The size of a number that is far from the largest and the smallest ones, as `abs` need not assume."""
    return math.sqrt(z.real * z.real + z.imag * z.imag)


def spread_roots(z: Array) -> None:
    """Places to start from."""
    for i in range(len(z)):
        angle = 0.4 + TURN * i / len(z)
        size = 0.6 if i % 2 == 0 else 1.7
        z[i, 0], z[i, 1] = size * math.cos(angle), size * math.sin(angle)
