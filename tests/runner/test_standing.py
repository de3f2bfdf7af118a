"""`Standing`: an arm that stands, creeps, sways or turns its count over, measured with noise."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from jacokin.model import Robot
from jacokin.runner.measuring import Standing


def judged(
    robot: Robot, moves: Callable[[float], float], *, noise: float, period: float, seconds: float = 4.0, seed: int = 0
) -> Standing:
    """What is thought of an arm whose third joint moves from home so far [deg], measured each period [s]."""
    standing, rng = Standing(robot), np.random.default_rng(seed)
    for time in np.arange(0.0, seconds, period):
        q = robot.home + np.radians(moves(float(time))) * np.eye(6)[2]
        standing.hear(float(time), q + np.radians(rng.normal(0.0, noise, 6) if noise else 0.0))
    return standing


@pytest.mark.parametrize("period", [0.1, 0.01])
@pytest.mark.parametrize("noise", [0.0, 0.05, 0.1, 0.3])
def test_where_an_arm_stands(robot: Robot, period: float, noise: float) -> None:
    for seed in range(10):
        place = judged(robot, lambda time: 0.0, noise=noise, period=period, seed=seed).place
        assert place is not None
        assert np.degrees(np.abs(place - robot.home).max()) < (max(0.15, 0.9 * noise) if noise else 1e-9)


@pytest.mark.parametrize("period", [0.1, 0.01])
@pytest.mark.parametrize("noise", [0.0, 0.05, 0.1])
def test_an_arm_that_creeps_does_not_stand(robot: Robot, period: float, noise: float) -> None:
    """By 0.13 degrees in 0.3 s."""
    for seed in range(10):
        assert judged(robot, lambda time: 0.45 * time, noise=noise, period=period, seed=seed).place is None


def test_an_arm_that_sways_does_not_stand(robot: Robot) -> None:
    assert judged(robot, lambda time: 2.0 * np.sin(8.0 * time), noise=0.05, period=0.01).place is None


def test_an_arm_without_noise_stands_after_a_moment(robot: Robot) -> None:
    assert judged(robot, lambda time: 0.0, noise=0.0, period=0.1, seconds=0.25).place is None
    assert judged(robot, lambda time: 0.0, noise=0.0, period=0.1, seconds=0.45).place is not None


def test_a_joint_without_limits_stands_where_its_count_turns_over(robot: Robot) -> None:
    standing, rng = Standing(robot), np.random.default_rng(1)
    for tick in range(100):
        q = robot.home + rng.normal(0.0, np.radians(0.05), 6)
        q[5] = np.remainder(np.pi + (q - robot.home)[5] + np.pi, 2.0 * np.pi) - np.pi
        standing.hear(0.01 * tick, q)
    assert standing.place is not None
    assert np.remainder(standing.place[5], 2.0 * np.pi) == pytest.approx(np.pi, abs=np.radians(0.05))
