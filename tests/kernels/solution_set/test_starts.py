"""Descents from a point beside a curve: they reach it, and end soon where nothing is reached."""

from __future__ import annotations

import numpy as np
import pytest

import jacokin
from jacokin.arrays import Array
from jacokin.kernels.chain import linearise7, make_newton
from jacokin.kernels.solution_set import starts
from jacokin.kernels.solution_set.curve import RESIDUAL
from tests.kernels.solution_set.known_curves import curve_through, walk_on

#: The arm is 1.2 m long.
OUT_OF_REACH = 1.5


def test_descents_end_where_what_is_missing_is_least(monkeypatch: pytest.MonkeyPatch, rng: np.random.Generator) -> None:
    steps = 0

    def counting(chain: Array, T: Array, x: Array, system: Array) -> float:
        nonlocal steps
        steps += 1
        return linearise7(chain, T, x, system)

    monkeypatch.setattr(starts, "linearise7", counting)
    robot, missing = jacokin.load_robot("j2s7s300"), list[float]()
    for q in robot.sample(rng, 20):
        walk = walk_on(curve_through(robot, q))
        walk.T[:3, 3] *= OUT_OF_REACH / np.linalg.norm(walk.T[:3, 3])
        walk.z[:] = q
        missing.append(starts.descend(make_newton(), walk))
    assert min(missing) > 0.1
    assert steps < 20 * 60


def test_descents_from_beside_a_curve_reach_it(rng: np.random.Generator) -> None:
    robot = jacokin.load_robot("j2s7s300")
    for q in robot.sample(rng, 20):
        walk = walk_on(curve_through(robot, q))
        walk.z[:] = q + rng.normal(scale=0.02, size=7)
        assert starts.descend(make_newton(), walk) <= RESIDUAL
