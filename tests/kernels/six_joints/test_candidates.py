"""Pairs of angles that solve one equation: both solve it, and folds, free angles and none are told apart."""

from __future__ import annotations

import math

import numpy as np
import pytest

from jacokin.kernels.six_joints.candidates import (
    SIGNS,
    make_candidates,
    pair_of,
    pair_of_triangle,
    skips,
    slack_after,
    take,
    triangle_of,
    unturned_about_z,
)
from jacokin.kernels.six_joints.candidates import Pair as AnglePair
from jacokin.kernels.trigonometry import angle_of

SEED = 0.7  # [rad]
SLACK = slack_after(0)


def angles_of(pair: AnglePair) -> list[float]:
    """What a pair gives, in the order in which it is tried; cosine and sine go with each angle."""
    work, found = make_candidates(), []
    for sign in SIGNS:
        if not skips(pair, sign):
            take(work, 2, pair, sign)
            angle, cosine, sine = float(work.theta[2]), work.cosine[2], work.sine[2]
            found.append(angle_of(sine, cosine) if math.isnan(angle) else angle)
            np.testing.assert_allclose([cosine, sine], [math.cos(found[-1]), math.sin(found[-1])], atol=1e-15)
    return found


def test_both_angles_solve_a_linear_equation_of_cosine_and_sine(rng: np.random.Generator) -> None:
    for a, b, part in rng.uniform(-1.0, 1.0, (200, 3)):
        c = part * math.hypot(a, b)
        angles = angles_of(pair_of(a, b, c, SEED, SLACK))
        assert len(angles) == 2
        for angle in angles:
            assert a * math.cos(angle) + b * math.sin(angle) == pytest.approx(c, abs=2e-15)


def test_an_equation_beyond_its_edge_has_no_angle_and_one_without_coefficients_any() -> None:
    assert angles_of(pair_of(0.3, 0.4, 0.51, SEED, SLACK)) == []
    assert angles_of(pair_of(0.0, 0.0, 0.1, SEED, SLACK)) == []
    assert angles_of(pair_of(0.0, 0.0, 0.0, SEED, SLACK)) == [SEED]


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("beyond", [0.0, 1e-12, -1e-12])
def test_angles_that_nearly_meet_are_a_fold_whose_middle_comes_first(side: float, beyond: float) -> None:
    pair = pair_of(0.3, 0.4, side * 0.5 * (1.0 + beyond), SEED, SLACK)
    angles = angles_of(pair)
    middle = math.atan2(side * 0.4, side * 0.3)
    assert pair.fold == 1
    assert angles[0] == pytest.approx(middle, abs=1e-15)
    np.testing.assert_allclose(angles[1:], middle, atol=2e-6)


def test_both_angles_turn_an_axis_until_it_encloses_the_angle_with_another(rng: np.random.Generator) -> None:
    for _ in range(200):
        k, h = rng.normal(size=(2, 3))
        k, h = k / np.linalg.norm(k), h / np.linalg.norm(h)
        wanted = float(np.dot(h, turned_back(rng.uniform(-3.0, 3.0), k)))
        triangle = triangle_of(tuple(k.tolist()), tuple(h.tolist()))
        angles = angles_of(pair_of_triangle(triangle, math.sqrt(1.0 - wanted * wanted), wanted, SLACK))
        assert len(angles) >= 2
        for angle in angles[-2:]:
            assert np.dot(h, turned_back(angle, k)) == pytest.approx(wanted, abs=2e-15)


def turned_back(angle: float, k: np.ndarray) -> tuple[float, float, float]:
    """Rz(angle)^T k."""
    c, s = math.cos(angle), math.sin(angle)
    back = unturned_about_z((c, s), tuple(k.tolist()))
    np.testing.assert_allclose(back, [[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]] @ k, atol=1e-15)
    return back


def test_axes_on_one_line_leave_the_angle_free() -> None:
    x, z = (1.0, 0.0, 0.0), (math.cos(0.3), math.sin(0.3), 0.0)
    pair = pair_of_triangle(triangle_of(x, z), 0.0, 1.0, SLACK)
    assert pair.free == 1
    assert angles_of(pair) == [pytest.approx(-0.3, abs=1e-15)]
