"""Jacobians against finite differences, and where a representation is singular."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest

import jacokin
from jacokin import Robot
from jacokin.arrays import Array
from jacokin.errors import RepresentationSingularity
from jacokin.model import poses

STEP = 1e-6  # [rad] central differences: truncation and rounding both near 1e-10


def central_difference(function: Callable[[Array], Array], q: Array) -> Array:
    columns = [(function(q + STEP * e) - function(q - STEP * e)) / (2.0 * STEP) for e in np.eye(q.size)]
    return np.stack(columns, axis=-1)


@pytest.mark.parametrize("reference", ["local", "world", "local_world_aligned"])
def test_jacobian_derivatives(robot: Robot, rng: np.random.Generator, reference: str) -> None:
    for q in robot.sample(rng, 20):
        v = rng.normal(size=robot.dof)

        def jacobian(at: Array) -> Array:
            return robot.jacobian(at, "gripsite", reference)

        hessian = robot.jacobian_derivative(q, "gripsite", reference)
        np.testing.assert_allclose(hessian, central_difference(jacobian, q), atol=1e-6)
        rate = robot.jacobian_time_derivative(q, v, "gripsite", reference)
        along = (jacobian(q + STEP * v) - jacobian(q - STEP * v)) / (2.0 * STEP)
        np.testing.assert_allclose(rate, along, atol=1e-6)
        np.testing.assert_allclose(hessian @ v, rate, atol=1e-12)


def test_jacobian_references_are_one_motion(robot: Robot, rng: np.random.Generator) -> None:
    q, v = robot.sample(rng), rng.normal(size=6)
    placement = robot.forward_kinematics(q)
    local, world = robot.jacobian(q, reference="local") @ v, robot.jacobian(q, reference="world") @ v
    aligned = robot.jacobian(q) @ v
    np.testing.assert_allclose(placement.action @ local, world, atol=1e-13)
    np.testing.assert_allclose(
        np.concatenate((placement.rotation @ local[:3], placement.rotation @ local[3:])), aligned
    )
    moved = (
        robot.forward_kinematics(q + STEP * v).translation - robot.forward_kinematics(q - STEP * v).translation
    ) / (2.0 * STEP)
    np.testing.assert_allclose(aligned[:3], moved, atol=1e-9)


def representation(robot: Robot, q: Array, kind: str) -> Array:
    placement = robot.forward_kinematics(q)
    if kind == "rpy":
        orientation = pin.rpy.matrixToRpy(placement.rotation)
    elif kind == "rotation_vector":
        orientation = pin.log3(placement.rotation)
    else:
        orientation = poses.quat_wxyz(placement.rotation)
    return np.concatenate((placement.translation, orientation))


@pytest.mark.parametrize("kind", ["rpy", "rotation_vector", "quaternion"])
def test_analytical_jacobians(robot: Robot, rng: np.random.Generator, kind: str) -> None:
    checked = 0
    for q in robot.sample(rng, 40):
        rotation = robot.forward_kinematics(q).rotation
        if kind == "rpy" and math.hypot(rotation[0, 0], rotation[1, 0]) < 0.05:
            continue
        if kind != "rpy" and np.linalg.norm(pin.log3(rotation)) > math.pi - 0.05:
            continue
        numeric = central_difference(lambda at: representation(robot, at, kind), q)
        np.testing.assert_allclose(robot.analytical_jacobian(q, representation=kind), numeric, atol=1e-6)
        checked += 1
    assert checked > 30


def test_analytical_jacobian_at_its_singularity(robot: Robot) -> None:
    solver = jacokin.IKSolver(robot)
    upright = solver.solve(jacokin.pose([0.3, 0.2, 0.5], rpy=[0.3, math.pi / 2, 0.0])).raise_for_status()
    with pytest.raises(RepresentationSingularity, match="pitch") as error:
        robot.analytical_jacobian(upright.q, representation="rpy")
    assert error.value.angle == pytest.approx(math.pi / 2, abs=1e-6)
    flipped = solver.solve(jacokin.pose([0.3, 0.2, 0.3], down=True)).raise_for_status()
    with pytest.raises(RepresentationSingularity, match="rotation angle"):
        robot.analytical_jacobian(flipped.q, representation="rotation_vector")
    assert np.isfinite(robot.analytical_jacobian(flipped.q, representation="quaternion")).all()


def test_manipulability_vanishes_with_the_smallest_singular_value(robot: Robot, rng: np.random.Generator) -> None:
    q = robot.sample(rng)
    jacobian = robot.jacobian(q)
    assert robot.manipulability(q) == pytest.approx(math.sqrt(np.linalg.det(jacobian @ jacobian.T)), rel=1e-9)
    straight = np.array([0.0, math.pi, math.pi, 0.0, 0.0, 0.0])  # the arm stretched straight up
    assert robot.singular_values(straight)[-1] < 1e-12
    assert robot.manipulability(straight) < 1e-12


def test_a_single_joint_has_derivatives_of_one_column() -> None:
    robot = jacokin.load_robot(base="link_1", tip="link_2")
    q, v = robot.home, np.array([0.7])
    H = robot.jacobian_derivative(q)
    assert H.shape == (6, 1, 1)
    np.testing.assert_allclose(robot.jacobian_time_derivative(q, v), H @ v, atol=1e-12)


def test_a_single_joint_has_a_jacobian_of_one_column() -> None:
    one = jacokin.load_robot(tip="link_1", base="link_base")
    assert one.jacobian(one.home).shape == (6, 1)
    assert one.singular_values(one.home).shape == (1,)
    assert one.manipulability(one.home) == pytest.approx(np.linalg.norm(one.jacobian(one.home)))
    assert jacokin.crosscheck(one, jacokin.load_robot(tip="link_1"), samples=5).within()
