"""One configuration where two parameters are free: seven joints at a pose that may turn about an axis."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import jacokin
from jacokin import FreeAxis, IKSolver, Robot, Status
from jacokin.errors import InvalidInputError
from jacokin.model import Floor, Scene
from jacokin.motion import AxisTarget, PositionTarget
from tests.seven_joint_arms import load_arm

ARMS = ("j2s7s300", "gen3", "panda")


def make(name: str, folder: Path) -> Robot:
    return load_arm(name, folder) if name == "panda" else jacokin.load_robot(name)


def about(rng: np.random.Generator, solver: IKSolver, q: np.ndarray, **options: tuple[float, float]) -> FreeAxis:
    axis = rng.normal(size=3)
    return FreeAxis(solver.verifier.tool_pose(q), axis=axis / np.linalg.norm(axis), **options)


@pytest.mark.parametrize("name", ARMS)
def test_the_tool_is_at_the_position_and_turned_about_the_axis_alone(
    tmp_path: Path, rng: np.random.Generator, name: str
) -> None:
    robot = make(name, tmp_path)
    solver = IKSolver(robot, tool=jacokin.pose([0.02, -0.03, 0.1], rpy=[0.3, 0.2, 0.1]), collision="ignore")
    for q in robot.sample(rng, 8):
        target = about(rng, solver, q)
        result = solver.solve(target, np.clip(q + rng.normal(0.0, 0.2, robot.dof), robot.lower, robot.upper))
        result.raise_for_status()
        assert robot.within_limits(result.q)
        T = solver.verifier.tool_pose(result.q)
        np.testing.assert_allclose(T.translation, target.pose.translation, atol=1e-6)
        np.testing.assert_allclose(T.rotation @ target.axis, target.pose.rotation @ target.axis, atol=1e-6)
        assert result.parameter is not None
        assert -math.pi <= result.parameter <= math.pi
        np.testing.assert_allclose(target.at(result.parameter).homogeneous, T.homogeneous, atol=1e-6)
        with pytest.raises(InvalidInputError, match="leaves 2 of the 7 joints"):
            solver.gradient(result)


@pytest.mark.parametrize("name", ARMS)
def test_a_seed_at_the_target_is_the_answer(tmp_path: Path, rng: np.random.Generator, name: str) -> None:
    solver = IKSolver(make(name, tmp_path), collision="ignore")
    for q in solver.robot.sample(rng, 10):
        np.testing.assert_allclose(solver.solve(about(rng, solver, q), q).q, q, atol=1e-9)


@pytest.mark.slow
def test_no_pose_about_the_axis_is_much_nearer(rng: np.random.Generator) -> None:
    robot = jacokin.load_robot("j2s7s300")
    solver, farther = IKSolver(robot, collision="ignore"), []
    for q, turn in zip(robot.sample(rng, 20), rng.normal(0.0, 0.3, (20, robot.dof)), strict=True):
        seed = np.clip(q + turn, robot.lower, robot.upper)
        target = about(rng, solver, q)
        result = solver.solve(target, seed)
        sets = (solver.solve_all(target.at(angle), seed) for angle in np.linspace(-math.pi, math.pi, 60))
        nearest = min(float(np.linalg.norm(found.nearest() - seed)) for found in sets if found.intervals)
        farther.append(float(np.linalg.norm(result.q - seed)) / nearest)
    assert np.median(farther) < 1.02
    assert max(farther) < 2.0


def test_the_range_is_kept_and_a_narrow_one_reached(rng: np.random.Generator) -> None:
    robot = jacokin.load_robot("gen3")
    solver = IKSolver(robot, collision="ignore")
    for q in robot.sample(rng, 4):
        target = about(rng, solver, q, range=(-0.01, 0.02))
        result = solver.solve(target, robot.sample(rng)).raise_for_status()
        assert result.parameter is not None
        assert -0.01 <= result.parameter <= 0.02


def test_contact_is_avoided_where_another_angle_allows_it() -> None:
    robot = jacokin.load_robot("gen3")
    floor = Scene([Floor(0.0)])
    target = FreeAxis(jacokin.pose([0.45, 0.1, 0.25], down=True), axis=(0.0, 0.0, 1.0))
    solver = IKSolver(robot, scene=floor)
    result = solver.solve(target, robot.home).raise_for_status()
    assert robot.clearance(result.q, floor) > 0.0


@pytest.mark.slow
def test_a_preference_chooses_among_angles() -> None:
    robot = jacokin.load_robot("j2s7s300")
    solver = IKSolver(robot)
    target = FreeAxis(jacokin.pose([0.4, 0.1, 0.3], down=True), axis=(0.0, 0.0, 1.0))

    def margin(q: np.ndarray) -> float:
        return float(np.minimum(q - robot.lower, robot.upper - q).min())

    wide = solver.solve(target, prefer="margin").raise_for_status()
    assert margin(wide.q) >= max(
        margin(solver.solve(target.at(angle), prefer="margin").raise_for_status().q) for angle in (-2.0, 0.0, 2.0)
    ) - math.radians(10.0)
    assert margin(wide.q) > margin(solver.solve(target).q)


def test_a_position_and_a_direction_of_the_tool(bundled: Callable[[str], Robot]) -> None:
    solver = IKSolver(bundled("gen3"))
    target = [PositionTarget([0.4, 0.1, 0.3]), AxisTarget((0.0, 0.0, 1.0), (0.0, 0.0, -1.0))]
    T = solver.verifier.tool_pose(solver.solve(target).raise_for_status().q)
    np.testing.assert_allclose(T.translation, [0.4, 0.1, 0.3], atol=1e-6)
    np.testing.assert_allclose(T.rotation[:, 2], [0.0, 0.0, -1.0], atol=1e-6)


def test_failures_say_why() -> None:
    robot = jacokin.load_robot("j2s7s300")
    solver = IKSolver(robot)
    far = solver.solve(FreeAxis(jacokin.pose([3.0, 0.0, 0.3], down=True), axis=(0.0, 0.0, 1.0)))
    assert far.status is Status.UNREACHABLE
    assert far.position_error > 1.5
    inside = FreeAxis(jacokin.pose([0.05, 0.0, 0.1], down=True), axis=(0.0, 0.0, 1.0))
    close = solver.solve(inside)
    assert close.status is Status.NO_CONVERGENCE
    assert "reached at none of 21 angles about the axis" in close.message
    assert robot.within_limits(close.q)
    quick = solver.solve(inside, closest=False)
    assert quick.status is close.status
    with pytest.raises(InvalidInputError, match="solve gives one configuration, solve_all those of the pose"):
        solver.solve_all(inside)


def test_rows_of_a_batch(rng: np.random.Generator) -> None:
    solver = IKSolver(jacokin.load_robot("j2s7s300"), collision="ignore")
    targets = [about(rng, solver, q) for q in solver.robot.sample(rng, 3)]
    batch = solver.solve_batch(targets)
    assert batch.success.all()
    assert batch.parameter is not None
    for q, parameter, target in zip(batch.q, batch.parameter, targets, strict=True):
        np.testing.assert_allclose(
            solver.verifier.tool_pose(q).homogeneous, target.at(parameter).homogeneous, atol=1e-6
        )
