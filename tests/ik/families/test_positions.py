"""Positions without orientation: configurations that reach them, and solves that start there."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

import jacokin
from jacokin import IKSolver, Robot
from jacokin.ik import qp
from jacokin.ik.qp import MultiStartQP


@pytest.mark.parametrize("name", ["j2n6s300", "j2s7s300"])
def test_members_reach_the_position(bundled: Callable[[str], Robot], rng: np.random.Generator, name: str) -> None:
    jacokin.warmup()
    robot = bundled(name)
    exact = IKSolver(robot)._finder.exact
    assert exact is not None
    for q in robot.sample(rng, 10):
        position = robot.forward_kinematics(q).translation
        rows = qp.members(exact, position, robot.forward_kinematics(robot.home).rotation, robot.home)
        assert 1 <= len(rows) <= qp.ENOUGH
        for row in rows:
            np.testing.assert_allclose(robot.forward_kinematics(row).translation, position, atol=1e-9)
            assert robot.within_limits(row)
        apart = [float(np.linalg.norm(row - robot.home)) for row in rows]
        assert apart == sorted(apart)


@pytest.mark.parametrize("name", ["j2n6s300", "j2s7s300"])
def test_a_position_is_solved_from_a_member(
    bundled: Callable[[str], Robot], rng: np.random.Generator, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where descents go nowhere, the first start that is a member is the answer."""
    robot, stuck = bundled(name), lambda _self, _task, start, _position_only: (start, 0, False)
    monkeypatch.setattr(MultiStartQP, "_descend", stuck)
    for q in robot.sample(rng, 5):
        target = robot.forward_kinematics(q).translation
        result = IKSolver(robot).solve(target).raise_for_status()
        np.testing.assert_allclose(robot.forward_kinematics(result.q).translation, target, atol=1e-9)
        assert not IKSolver(robot, method="qp").solve(target, max_restarts=5, closest=False).success
