"""`prefer=` for poses and families, batches with free axes, and targets in the tracker's words."""

from __future__ import annotations

import math

import numpy as np
import pytest

import jacokin
from jacokin import FreeAxis, IKSolver
from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.motion import AxisTarget, OrientationTarget, PoseTarget, PositionTarget


@pytest.fixture(scope="module")
def solver() -> IKSolver:
    return IKSolver(jacokin.load_robot())


def margin(solver: IKSolver, q: Array) -> float:
    return float(np.minimum(q - solver.robot.lower, solver.robot.upper - q).min())


def test_the_best_branch_of_a_pose(solver: IKSolver, rng: np.random.Generator) -> None:
    robot = solver.robot
    for q in robot.sample(rng, 20):
        target = robot.forward_kinematics(q)
        within = solver.solve_all(target).q_within_limits
        assert margin(solver, solver.solve(target, prefer="margin").q) == max(margin(solver, row) for row in within)
        best = solver.solve(target, prefer="manipulability").q
        assert robot.manipulability(best) >= max(robot.manipulability(row) for row in within) - 1e-12
        own = solver.solve(target, prefer=lambda row: float(row[1])).q
        assert own[1] == min(row[1] for row in within)


def test_equal_branches_are_taken_by_distance(solver: IKSolver, rng: np.random.Generator) -> None:
    for q in solver.robot.sample(rng, 5):
        target = solver.robot.forward_kinematics(q)
        np.testing.assert_array_equal(solver.solve(target, prefer=lambda _: 1.0).q, solver.solve(target).q)


def test_the_best_member_of_a_family(solver: IKSolver, rng: np.random.Generator) -> None:
    robot = solver.robot
    for q in robot.sample(rng, 3):
        target = FreeAxis(robot.forward_kinematics(q), axis=(1.0, 0.0, 0.0))
        rows = solver.family(target).sample(500)
        assert (
            margin(solver, solver.solve(target, prefer="margin").q) >= max(margin(solver, row) for row in rows) - 1e-8
        )
        best = robot.manipulability(solver.solve(target, prefer="manipulability").q)
        assert best >= max(robot.manipulability(row) for row in rows) - 1e-8


def test_members_of_equal_margin_are_taken_by_distance(solver: IKSolver) -> None:
    """About the last axis, joint 6 alone turns, which has no limits."""
    robot = solver.robot
    target = FreeAxis(robot.forward_kinematics(robot.home), axis=(0.0, 0.0, 1.0))
    result = solver.solve(target, prefer="margin", seed=robot.home)
    assert abs(math.remainder(result.q[5] - robot.home[5], 2.0 * math.pi)) < 1e-4 or result.q[0] != robot.home[0]


def test_batches_prefer_too(solver: IKSolver, rng: np.random.Generator) -> None:
    targets = [solver.robot.forward_kinematics(q) for q in solver.robot.sample(rng, 4)]
    batch = solver.solve_batch(targets, prefer="margin")
    for row, target in zip(batch.q, targets, strict=True):
        np.testing.assert_array_equal(row, solver.solve(target, prefer="margin").q)
    with pytest.raises(InvalidInputError, match="prefer must be picklable"):
        solver.solve_batch(targets, prefer=lambda q: float(q[0]), workers=2)


def test_batches_take_free_axes_among_poses(solver: IKSolver, rng: np.random.Generator) -> None:
    robot = solver.robot
    poses = [robot.forward_kinematics(q) for q in robot.sample(rng, 3)]
    free = FreeAxis(poses[1], axis=(1.0, 0.0, 0.0))
    batch = solver.solve_batch([poses[0], free, poses[2].translation])
    assert batch.success.all()
    assert batch.parameter is not None
    assert np.isnan(batch.parameter).tolist() == [True, False, True]
    np.testing.assert_array_equal(batch.q[1], solver.solve(free).q)
    np.testing.assert_array_equal(batch.q[0], solver.solve(poses[0]).q)


def test_a_position_and_an_axis_are_a_free_axis(solver: IKSolver) -> None:
    robot = solver.robot
    parts = [PositionTarget((0.3, 0.2, 0.3)), AxisTarget((0.0, 0.0, -1.0))]
    result = solver.solve(parts).raise_for_status()
    reached = robot.forward_kinematics(result.q)
    np.testing.assert_allclose(reached.translation, (0.3, 0.2, 0.3), atol=1e-9)
    np.testing.assert_allclose(reached.rotation[:, 2], (0.0, 0.0, -1.0), atol=1e-9)
    np.testing.assert_allclose(result.q, solver.solve(jacokin.pose((0.3, 0.2, 0.3), approach=(0, 0, -1))).q, atol=1e-6)
    across = solver.solve([PositionTarget((0.3, 0.2, 0.3)), AxisTarget((0.0, 0.0, 1.0), (1.0, 0.0, 0.0))])
    np.testing.assert_allclose(robot.forward_kinematics(across.q).rotation[:, 0], (0.0, 0.0, 1.0), atol=1e-9)


def test_poses_in_the_words_of_the_tracker(solver: IKSolver) -> None:
    target = solver.robot.forward_kinematics(solver.robot.home)
    expected = solver.solve(target).q
    np.testing.assert_array_equal(solver.solve(PoseTarget(target)).q, expected)
    both = [PositionTarget(target.translation), OrientationTarget(target.rotation)]
    np.testing.assert_allclose(solver.solve(both).q, expected, atol=1e-12)
