"""Sine, cosine and arctangent of plain arithmetic, against the C library's."""

from __future__ import annotations

import hashlib
import importlib
import math

import numpy as np
import pytest

from jacokin.kernels.trigonometry import (
    EIGHTH_SLOPE,
    LARGEST_ANGLE,
    angle_of,
    arctangent,
    sin_cos,
    sines_cosines,
    whole_below,
)

#: Constants of kernels by module, hashed: those of x86-64 and of AArch64, whose NumPy inverts a matrix to other bits.
CONSTANTS = {
    "closed_form.resultant": "d6d89f2ff885b28e",
    "closed_form.roots": "1747752049cfae62",
    "six_joints.characteristic": "50efba95b84a67dd",
    "six_joints.loop": "4ea2894b45c7d887",
    "six_joints.near_continua": "c708662eb80af397",
    "six_joints.planar_arm": "51cd317e540dc860",
    "six_joints.roots": "027e6b69bfba968b",
}


@pytest.mark.parametrize("size", [1e-9, 1.0, 7.0, 1e3, 1e6])
def test_sine_and_cosine_are_within_an_ulp(size: float) -> None:
    """Of any angle that a joint may have, and exactly so where the sine is small."""
    rng = np.random.default_rng(1)
    for angle in rng.uniform(-size, size, 2000).tolist():
        for found, true in zip(sin_cos(angle), (math.sin(angle), math.cos(angle)), strict=True):
            assert abs(found - true) <= 1.3 * math.ulp(true) + 1e-25  # the C library itself is up to half an ulp off


def test_sine_and_cosine_at_quarter_turns() -> None:
    """The nearest doubles to multiples of pi / 2: as small as the angle's own rounding makes them."""
    for quarters in range(-40, 41):
        angle = 0.5 * math.pi * quarters
        s, c = sin_cos(angle)
        assert s == pytest.approx(math.sin(angle), abs=1e-24)
        assert c == pytest.approx(math.cos(angle), abs=1e-24)
        assert s * s + c * c == pytest.approx(1.0, abs=3e-16)


@pytest.mark.parametrize("angle", [LARGEST_ANGLE, -2e6, 1e22])
def test_angles_too_large_are_left_to_the_library(angle: float) -> None:
    """Where a number of quarter turns would lose digits."""
    assert sin_cos(angle) == (math.sin(angle), math.cos(angle))


def test_not_a_number_stays_one() -> None:
    """No angle is made of it."""
    assert all(math.isnan(value) for value in sin_cos(math.nan))


def test_angle_of_a_direction() -> None:
    """In all octants and for all slopes."""
    rng = np.random.default_rng(2)
    rows = rng.normal(size=(5000, 2)) * 10.0 ** rng.uniform(-9.0, 3.0, (5000, 2))
    for y, x in rows.tolist():
        true = math.atan2(y, x)
        assert abs(angle_of(y, x) - true) <= 3.0 * math.ulp(true)


@pytest.mark.parametrize("y", [0.0, -0.0, 1.0, -1.0])
@pytest.mark.parametrize("x", [1.0, -1.0, 1e-300])
def test_angle_of_round_directions(y: float, x: float) -> None:
    """Exactly as the C library says, signs of zero included."""
    assert math.copysign(1.0, angle_of(y, x)) == math.copysign(1.0, y)
    assert angle_of(y, x) == math.atan2(y, x)


def test_no_direction_has_angle_zero() -> None:
    """As for the C library."""
    assert angle_of(0.0, 0.0) == 0.0


def test_arctangent_of_small_slopes() -> None:
    """Over all that it is for."""
    for slope in np.linspace(-EIGHTH_SLOPE, EIGHTH_SLOPE, 2001).tolist():
        assert abs(arctangent(slope) - math.atan(slope)) <= 1.2 * math.ulp(slope)


@pytest.mark.parametrize("number", [-2.5, -1.0, -0.5, -1e-9, 0.0, 0.5, 0.9999999, 1.0, 1.5, 2.5, 1e6 + 0.5])
def test_whole_below_is_the_floor(number: float) -> None:
    """Halves included, which rounding takes to the even neighbour."""
    assert whole_below(number) == math.floor(number)


@pytest.mark.parametrize("module", CONSTANTS)
def test_constants_have_the_same_bits_on_every_processor(module: str) -> None:
    """Machine code has those of the machine that compiled it, plain Python those of the one that runs it."""
    arrays = vars(importlib.import_module(f"jacokin.kernels.{module}"))
    constants = (value for _, value in sorted(arrays.items()) if isinstance(value, np.ndarray))
    assert hashlib.sha256(b"".join(value.tobytes() for value in constants)).hexdigest()[:16] == CONSTANTS[module]


def test_several_sines_and_cosines() -> None:
    """Of an array of any shape."""
    s, c = sines_cosines(np.array([[0.3, -2.0, 40.0], [0.0, 1e-9, 1e3]]))
    assert (s[0, 1], c[0, 1]) == sin_cos(-2.0)
    assert (s[1, 2], c[1, 2]) == sin_cos(1e3)
