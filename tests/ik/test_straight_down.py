"""Five joints that point straight down, with a tool beside the axis of the last joint: the angle about it is free."""

from __future__ import annotations

import math
import pickle
from pathlib import Path

import numpy as np
import pytest

import jacokin
from jacokin import FreeAxis, IKSolver
from jacokin.arrays import Array
from jacokin.ik.virtual_joints import PointsOfFew
from tests.gripper_arms import so101_text
from tests.robot_files import load_text

PLACES = ((0.2, 0.05, 0.02), (0.2, 0.1, 0.05), (0.25, 0.0, 0.03), (0.16, -0.1, 0.02))
DOWN = (0.0, 0.0, -1.0)


@pytest.fixture(params=["digits of the file", "exact"])
def solver(request: pytest.FixtureRequest, tmp_path: Path) -> IKSolver:
    """An SO-101 as its maker's file has it, with angles of five digits, and with those that are meant."""
    text = so101_text()
    if request.param == "exact":
        text = text.replace("3.14159 ", f"{math.pi!r} ").replace("1.5708", repr(0.5 * math.pi))
        text = text.replace('3.14159"', f'{math.pi!r}"')
    return IKSolver(load_text(tmp_path / "so101.urdf", text), collision="ignore", orientation_tolerance=1e-5)


def points(solver: IKSolver, target: FreeAxis, seed: Array) -> PointsOfFew:
    found = solver.solve_all(target, seed)
    assert isinstance(found, PointsOfFew)
    return found


def angles_of(found: PointsOfFew) -> Array:
    assert found.angle is not None
    return found.angle


@pytest.mark.one_quick
@pytest.mark.parametrize("place", PLACES)
def test_own_configurations_are_among_the_points_of_the_curve(
    solver: IKSolver, place: tuple[float, ...], rng: np.random.Generator
) -> None:
    target = jacokin.pose(place, approach=DOWN)
    assert isinstance(target, FreeAxis)
    for seed in solver.robot.sample(rng, 2):
        result = solver.solve(target, seed)
        assert result.success
        assert "the angle about the axis is free" in result.message
        found = points(solver, target, result.q)
        assert found.on_curve
        assert not found.complete
        assert np.abs(found.q[0] - result.q).max() < 1e-6
        assert solver.solve(target, result.q).q == pytest.approx(result.q, abs=1e-6)


def test_every_point_reaches_the_target_at_its_angle(solver: IKSolver) -> None:
    target = jacokin.pose(PLACES[0], approach=DOWN)
    assert isinstance(target, FreeAxis)
    found = points(solver, target, solver.robot.home)
    assert len(set(np.round(angles_of(found), 3))) >= 8
    assert found.within_limits.sum() >= 4
    for q, angle in zip(found.q, angles_of(found), strict=True):
        there = solver.robot.forward_kinematics(q)
        wanted = target.at(float(angle))
        np.testing.assert_allclose(there.translation, wanted.translation, atol=1e-6)
        np.testing.assert_allclose(there.rotation, wanted.rotation, atol=2e-5)
    distances = np.linalg.norm(found.q - solver.robot.home, axis=1)
    assert (np.diff(distances) >= -1e-9).all()


def test_angles_are_within_the_range_of_the_axis(solver: IKSolver) -> None:
    whole = jacokin.pose(PLACES[0], approach=DOWN)
    assert isinstance(whole, FreeAxis)
    target = FreeAxis(whole.pose, axis=whole.axis, range=(0.3, 1.4))
    found = points(solver, target, solver.robot.home)
    inside = found.within_limits
    assert inside.any()
    assert ((angles_of(found)[inside] >= 0.3) & (angles_of(found)[inside] <= 1.4)).all()
    assert solver.solve(target).success


def test_a_tilted_tool_has_points(solver: IKSolver, rng: np.random.Generator) -> None:
    robot = solver.robot
    for q in robot.sample(rng, 10):
        T = robot.forward_kinematics(q)
        if math.hypot(*T.rotation[:2, 2]) < 0.1:
            continue
        found = points(solver, FreeAxis(T, axis=[0, 0, 1]), q)
        assert found.complete
        assert not found.on_curve
        assert np.abs(found.q[0] - q).max() < 1e-6


def test_tolerances_decide_whether_the_direction_is_met(tmp_path: Path) -> None:
    """The last joint of the file is 4e-6 rad off: no curve within 1e-9 rad, and the message names the cure."""
    exact = IKSolver(load_text(tmp_path / "so101.urdf", so101_text()), collision="ignore", orientation_tolerance=1e-9)
    target = jacokin.pose(PLACES[0], approach=DOWN)
    assert isinstance(target, FreeAxis)
    assert not points(exact, target, exact.robot.home).on_curve
    result = exact.solve(target)
    assert not result.success
    assert "orientation_tolerance=1e-5 accepts it" in result.message


def test_points_of_a_curve_are_pickled(solver: IKSolver) -> None:
    target = jacokin.pose(PLACES[0], approach=DOWN)
    assert isinstance(target, FreeAxis)
    found = points(solver, target, solver.robot.home)
    again = pickle.loads(pickle.dumps(found))
    assert again.on_curve
    np.testing.assert_array_equal(again.q, found.q)
    np.testing.assert_array_equal(angles_of(again), angles_of(found))
