"""Roots of F that are known beforehand are taken out of it: what is left has the other roots, and is soon searched."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from benchmarks import targets
from jacokin import Robot
from jacokin.arrays import Array
from jacokin.kernels import branches
from jacokin.kernels.closed_form import pose, roots
from jacokin.kernels.closed_form.arm import pose_of, unpack_arm
from jacokin.kernels.closed_form.resultant import fourier_of_divided_F, fourier_of_F, value_and_slope
from tests.kernels.closed_form.tools import closed_form, target


def divided(robot: Robot, T: Array, known: Array) -> tuple[Array, Array, float]:
    """Coefficients of F divided by roots, and their noise."""
    _, arm, _ = closed_form(robot).constants
    k = unpack_arm(arm)
    cosine, sine = np.empty(9), np.empty(9)
    rows = np.column_stack((known, known))
    return cosine, sine, fourier_of_divided_F(k, pose_of(arm, k, T), rows, len(known), 0, cosine, sine)


def test_F_without_some_roots_times_their_factors_is_F(robot: Robot, rng: np.random.Generator) -> None:
    form = closed_form(robot)
    _, arm, _ = form.constants
    k = unpack_arm(arm)
    cosine, sine = np.empty(9), np.empty(9)
    for q in robot.sample(rng, 20):
        T = target(robot, q)
        all_roots = form.solve_all(T, q).q[:, 5]
        fourier_of_F(k, pose_of(arm, k, T), cosine, sine, np.empty((2, 16)))
        known = np.array(all_roots[: len(all_roots) // 4 * 2])
        H_cosine, H_sine, noise = divided(robot, T, known)
        for x in rng.uniform(-math.pi, math.pi, 20):
            factors = float(np.prod(np.sin(0.5 * (x - known))))
            F = value_and_slope(cosine, sine, x)[0]
            H = value_and_slope(H_cosine, H_sine, x)[0]
            scale = np.abs(cosine).sum() + np.abs(sine).sum()
            assert pytest.approx(H * factors, abs=1e-12 * scale + noise) == F


def test_a_root_that_is_not_exact_shows_as_noise_or_is_refused(robot: Robot, rng: np.random.Generator) -> None:
    refused = 0
    for q in robot.sample(rng, 20):
        T = target(robot, q)
        found = closed_form(robot).solve_all(T, q).q[:2, 5]
        noise = divided(robot, T, found)[2]
        wrong = divided(robot, T, found + np.array([0.0, 1e-3]))[2]
        assert noise < math.inf
        assert wrong > 1e4 * noise
        refused += wrong == math.inf
    assert refused > 10


@pytest.mark.one_quick
@pytest.mark.parametrize("tilt", [0.0, 1e-9, 1e-6])  # [rad]
@pytest.mark.parametrize("name", ["j2n6s300", "m1n6s300"])
def test_no_pose_takes_many_times_the_work_of_others(
    name: str, tilt: float, bundled: Callable[[str], Robot], rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Tool vertical, the shoulder on axis 5, and both at once, or nearly: that took 60 times the usual work."""
    robot = bundled(name)
    counts = 0

    def count(b: Array, noise: float, plain: Callable[[Array, float], int] = roots.count_roots) -> int:
        nonlocal counts
        counts += 1
        return plain(b, noise)

    monkeypatch.setattr(roots, "count_roots", count)
    chain, arm, limits = closed_form(robot).constants
    work = pose.make_work(np.empty((branches.MAX_BRANCHES, branches.COLUMNS)))
    for q in targets.structured(robot, rng, 15).generating:
        counts = 0
        T = target(robot, q + tilt * rng.normal(size=6))
        pose.solve_pose(arm, unpack_arm(arm), branches.PoseQuery(chain, limits, T, robot.home), work)
        assert counts < 80
