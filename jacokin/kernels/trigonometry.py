"""Sine, cosine and arctangent of plain arithmetic: the same bits on every processor.

The C library takes another code path on each kind of processor, and saves and restores the rounding mode in each call,
which was an eighth of the closed form's time. These functions call nothing, and become part of the loops that use them.
Sine and cosine are within an ulp of the true value, or within 1e-26 of it near a zero, and the angle of a direction
within two: all that an angle of a joint can tell.

The polynomials are those of least relative error, found by Remez' algorithm with 60 digits.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array

#: pi / 2 in two parts: the first has 33 bits, so that its products with numbers of quarter turns are exact.
QUARTER, QUARTER_REST = 1.5707963267341256, 6.077100506506192e-11
QUARTERS_PER_RADIAN = 2.0 / math.pi
#: [rad] Beyond this, numbers of quarter turns have more than the 20 bits that are left.
LARGEST_ANGLE = 1.5e6
#: Adding and subtracting it rounds to the nearest whole number, an even one of two.
TO_WHOLE = 1.5 * 2.0**52
#: tan(pi / 8): slopes above this are turned back by pi / 4.
EIGHTH_SLOPE = math.sqrt(2.0) - 1.0


def sin_cos(angle: float) -> tuple[float, float]:
    """Sine and cosine of an angle [rad]."""
    if not abs(angle) < LARGEST_ANGLE:
        return math.sin(angle), math.cos(angle)
    quarters = angle * QUARTERS_PER_RADIAN + TO_WHOLE - TO_WHOLE
    s, c = sin_cos_within_quarter(angle, quarters)
    place = int(quarters) & 3
    odd = place & 1
    turn_c, turn_s = float((1 - place) * (1 - odd)), float((2 - place) * odd)  # of the quarters: 0, 1 or -1
    return s * turn_c + c * turn_s, c * turn_c - s * turn_s


def sin_cos_within_quarter(angle: float, quarters: float) -> tuple[float, float]:
    """Sine and cosine of what is left of an angle [rad] after its nearest whole number of quarter turns."""
    most, rest = angle - quarters * QUARTER, quarters * QUARTER_REST
    x = most - rest
    tail = (most - x) - rest  # x + tail is the angle within the quarter turn
    z = x * x
    w = z * z
    r = 0.008333333333322418 + z * (-0.00019841269829812353 + z * 2.755731369357077e-06)
    r += z * w * (-2.5050758384834086e-08 + z * 1.5896811858059738e-10)
    v = z * x
    s = x - ((z * (0.5 * tail - v * r) - tail) + v * 0.16666666666666632)
    r = z * (0.0416666666666666 + z * (-0.0013888888888874131 + z * 2.480158728948717e-05))
    r += w * w * (-2.7557314353829943e-07 + z * (2.08757234842009e-09 + z * -1.1359659099382371e-11))
    half = 0.5 * z
    c = 1.0 - half
    c += ((1.0 - c) - half) + (z * r - x * tail)
    return s, c


def sines_cosines(angles: NDArray[np.floating]) -> tuple[Array, Array]:
    """Sines and cosines of angles (any shape) [rad], for constants, which the machine that compiles works out."""
    s, c = (np.array(each).reshape(angles.shape) for each in zip(*map(sin_cos, angles.ravel().tolist()), strict=True))
    return s, c


def fourier_samples(count: int, degree: int) -> tuple[Array, Array, Array, Array]:
    """Angles that a trigonometric polynomial is sampled at, evenly around a turn, and how to tell its coefficients.

    Returns:
        Sines and cosines (count,) of the angles; what each sample adds to the coefficients (count, degree + 1) of
        sin(k theta) and cos(k theta).
    """
    angles = 2.0 * np.pi / count * np.arange(count)
    weight = np.where(np.arange(degree + 1) == 0, 1.0, 2.0) / count
    to_sine, to_cosine = sines_cosines(np.outer(angles, np.arange(degree + 1)))
    return *sines_cosines(angles), weight * to_sine, weight * to_cosine


def arctangent(slope: float) -> float:
    """The angle of a slope of at most tan(pi / 8) [rad]."""
    z = slope * slope
    w = z * z
    low = -0.333333333333332 + z * 0.19999999999953597
    low += w * (-0.14285714280197048 + z * 0.11111110783450566)
    high = -0.09090897756221897 + z * 0.07692060162332744
    high += w * (-0.06663103122887078 + z * 0.05847879978723007)
    high += w * w * (-0.050392505279893675 + z * (0.03806287102266037 + z * -0.0179050167019763))
    return slope + slope * (z * (low + w * w * high))


def angle_of(y: float, x: float) -> float:
    """The angle of the direction (x, y), in [-pi, pi] [rad]; 0 for no direction. Finite numbers.

    Octants are numbers and choices of them, not branches, which processors guess wrong half of the time.
    """
    across, along = abs(y), abs(x)
    small, large = min(across, along), max(across, along)
    eighths, sign = 1.0 if small > EIGHTH_SLOPE * large else 0.0, 1.0
    small, large = small - eighths * large, large + eighths * small
    if across > along:
        eighths, sign = 2.0 - eighths, -1.0
    if x < 0.0:
        eighths, sign = 4.0 - eighths, -sign
    slope = small / (large if large > 0.0 else 1.0)
    turned = eighths * (0.5 * QUARTER) + (sign * arctangent(slope) + eighths * (0.5 * QUARTER_REST))
    return math.copysign(turned, y)


def whole_below(number: float) -> float:
    """The largest whole number that is not above a number of at most 2^51 in size."""
    whole = number + TO_WHOLE - TO_WHOLE
    return whole - 1.0 if whole > number else whole
