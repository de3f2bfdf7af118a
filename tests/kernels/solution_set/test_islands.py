"""All roots of F at once, from wherever the search for them begins."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from jacokin.arrays import Array
from jacokin.kernels.solution_set.all_roots import find_all_roots, make_lanes, spread_roots
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
