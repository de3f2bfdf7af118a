"""All roots of F at once, from wherever the search for them begins."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from jacokin.arrays import Array
from jacokin.kernels.solution_set.all_roots import (
    find_all_roots,
    make_lanes,
    root_of,
    spread_roots,
    tell_roots,
    until_meeting,
)
from jacokin.kernels.solution_set.surface import make_surface

DEGREE = 16


def known_roots(rng: np.random.Generator, apart: float) -> Array:
    """Roots (16,) in pairs z and 1 / conj(z), or on the unit circle; two of these are that near to each other."""
    angles, sizes = rng.uniform(-np.pi, np.pi, 4), rng.uniform(0.02, 1.5, 4)
    pairs = np.exp(1j * angles - sizes), np.exp(1j * angles + sizes)
    on_circle = np.exp(1j * rng.uniform(-np.pi, np.pi, 7))
    return np.concatenate([*pairs, on_circle, [on_circle[-1] * np.exp(1j * apart)]])


@pytest.mark.one_quick
@pytest.mark.parametrize("apart", [1e-2, 1e-4, 1e-6])
def test_two_roots_that_all_but_meet_are_both_found(rng: np.random.Generator, apart: float) -> None:
    """The first one that comes near has small steps while the other is far away, though it has not arrived."""
    powers, z, lanes = make_surface().powers[0], np.empty((DEGREE, 2)), make_lanes()
    for _ in range(30):
        roots = known_roots(rng, apart)
        coefficients = np.poly(roots)[::-1]
        powers[:, 0], powers[:, 1] = coefficients.real, coefficients.imag
        spread_roots(z)
        z += rng.normal(scale=0.3, size=z.shape)
        find_all_roots(powers, DEGREE, z, lanes)
        found = z[:, 0] + 1j * z[:, 1]
        others = min(abs(a - b) for a, b in itertools.combinations(roots[: DEGREE - 1], 2))
        if others < 0.02:  # other roots that meet, too
            continue
        near = np.sort(np.abs(found[:, None] - roots[-2:]).min(axis=1))[:2]  # both of the two
        assert near.max() < 0.01 * apart + 1e-5  # to the root of rounding in the coefficients


@pytest.mark.parametrize("away", [1e-3, -1e-3, 1e-5])
def test_when_roots_meet_is_told_from_where_they_are(away: float) -> None:
    """Two roots 0.5 +- sqrt(away - p), and others that stand still: the two meet after that much, or before it."""
    powers, z, lanes = make_surface().powers, np.empty((DEGREE, 2)), make_lanes()
    others = np.exp(1j * np.linspace(1.0, 5.0, DEGREE - 2) + 0.3)
    rest = np.poly(others)
    value = np.polymul(np.poly([0.5, 0.5]) - [0.0, 0.0, away], rest)[::-1]
    rate = np.append(rest[::-1], [0.0, 0.0])
    for row, coefficients in zip(powers, (value, rate, 0.0 * rate), strict=True):
        row[:, 0], row[:, 1] = coefficients.real, coefficients.imag
    spread_roots(z)
    find_all_roots(powers[0], DEGREE, z, lanes)
    tell_roots(powers, DEGREE, z, lanes)
    nearest = [i for i in range(DEGREE) if abs(root_of(lanes, i).x - 0.5) < 0.1]
    assert len(nearest) == 2
    for i in nearest:
        ahead, behind = until_meeting(lanes, i, DEGREE)
        assert (ahead if away > 0.0 else -behind) == pytest.approx(away, rel=1e-3)
