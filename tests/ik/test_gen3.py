"""Inverse kinematics of Kinova's Gen3 arms: own answers, all branches, curves."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from jacokin import FreeAxis, IKSolver, Robot
from jacokin.ik import structure
from jacokin.model.angles import wrap_to_pi

NEAR = 1e-6  # [rad] of an own configuration
ON_CURVE = 1e-5  # [rad] of a point of a curve


def apart(a: np.ndarray, b: np.ndarray) -> float:
    """Largest difference of two configurations, or of the nearest of many [rad]."""
    return float(np.abs(wrap_to_pi(a - b)).max(axis=-1).min())


def test_structures(bundled: Callable[[str], Robot]) -> None:
    lite, six, seven = (structure(bundled(name)) for name in ("gen3_lite", "gen3_6dof", "gen3"))
    assert lite.name == "jaco"
    assert six.name == "jaco"  # the lateral offset of its shoulder is 1 mm
    assert seven.name == "seven joints"
    assert [IKSolver(bundled(name)).dimension(bundled(name).forward_kinematics(bundled(name).home))
            for name in ("gen3_lite", "gen3_6dof", "gen3")] == [0, 0, 1]  # fmt: skip


def test_own_configurations_and_curves_of_seven_joints(
    bundled: Callable[[str], Robot], rng: np.random.Generator
) -> None:
    robot = bundled("gen3")
    solver = IKSolver(robot, collision="ignore")
    for q in robot.sample(rng, 200):
        assert apart(solver.solve(robot.forward_kinematics(q), seed=q).q, q) < NEAR
    for q in robot.sample(rng, 30):
        target = robot.forward_kinematics(q)
        found = solver.solve_all(target)
        assert found.dimension == 1
        nearest = found.nearest(q)
        assert nearest is not None
        assert apart(nearest, q) < ON_CURVE
        for row in found.sample(20):
            reached = robot.forward_kinematics(row)
            np.testing.assert_allclose(reached.homogeneous, target.homogeneous, atol=1e-6)
            assert robot.within_limits(row)


def test_two_complex_solutions_with_one_angle_in_common_leave_no_doubt(bundled: Callable[[str], Robot]) -> None:
    """F has a double root there, as where a curve begins; their other angles tell that none does."""
    robot, rng = bundled("gen3"), np.random.default_rng(0)
    solver, rows = IKSolver(robot, collision="ignore"), robot.sample(rng, 100)
    for q in rows[[34, 62]]:
        assert solver.solve_all(robot.forward_kinematics(q)).complete


@pytest.mark.slow
def test_nearly_all_sets_of_seven_joints_are_complete(bundled: Callable[[str], Robot]) -> None:
    robot, rng = bundled("gen3"), np.random.default_rng(1)
    solver, targets = IKSolver(robot, collision="ignore"), 300
    complete = [solver.solve_all(robot.forward_kinematics(q)).complete for q in robot.sample(rng, targets)]
    assert sum(complete) >= 0.97 * targets


@pytest.mark.parametrize("count", [3, pytest.param(10, marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", ["gen3_6dof", "gen3_lite"])
def test_a_free_axis_gives_curves(
    name: str, count: int, bundled: Callable[[str], Robot], rng: np.random.Generator
) -> None:
    robot = bundled(name)
    solver = IKSolver(robot, collision="ignore")
    for q in robot.sample(rng, count):
        target = FreeAxis(robot.forward_kinematics(q), axis=(0.0, 0.0, 1.0))
        found = solver.solve_all(target)
        assert found.dimension == 1
        nearest = found.nearest(q)
        assert nearest is not None
        assert apart(nearest, q) < ON_CURVE


@pytest.mark.parametrize("name", ["gen3", "gen3_6dof", "gen3_lite"])
def test_answers_from_home_are_free_of_contact(
    name: str, bundled: Callable[[str], Robot], rng: np.random.Generator
) -> None:
    robot = bundled(name)
    solver = IKSolver(robot)
    clear = [q for q in robot.sample(rng, 40) if not solver.solve(robot.forward_kinematics(q), seed=q).touching]
    assert len(clear) > 30
    for q in clear:
        result = solver.solve(robot.forward_kinematics(q), seed=robot.home)
        assert result.success, str(result)
        assert not result.touching
