"""Kinematics of six and seven joints in the kernels: the poses and Jacobians of Pinocchio, and Newton on them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest

from jacokin import Robot
from jacokin.arrays import Array
from jacokin.ik.geometry import measure, measure_seven
from jacokin.kernels import chain

NAMES = ("j2n6s300", "j2s6s300", "m1n6s300")
TOOL = pin.SE3(pin.exp3(np.array([0.3, -0.8, 1.1])), np.array([0.03, -0.02, 0.15]))


@pytest.mark.parametrize(
    "number", [pytest.param(300, id="hundreds"), pytest.param(10_000, id="thousands", marks=pytest.mark.slow)]
)
@pytest.mark.parametrize("name", NAMES)
def test_poses_are_those_of_pinocchio(
    name: str, number: int, bundled: Callable[[str], Robot], rng: np.random.Generator
) -> None:
    robot = bundled(name)
    placements = measure(robot.pin_model, robot.frame_id(), TOOL).chain
    for q in robot.sample(rng, number):
        x, y, z, p = chain.forward(placements, q)
        reached = robot.forward_kinematics(q) * TOOL
        assert np.abs(np.column_stack([x, y, z]) - reached.rotation).max() < 1e-13
        assert np.abs(p - reached.translation).max() < 1e-13


@pytest.mark.parametrize("name", ["j2n6s300", "j2s7s300"])
def test_the_system_is_the_jacobian_and_the_deviation(
    name: str, bundled: Callable[[str], Robot], rng: np.random.Generator
) -> None:
    robot = bundled(name)
    joints = robot.dof
    geometry = (measure if joints == 6 else measure_seven)(robot.pin_model, robot.frame_id(), None)
    for q in robot.sample(rng, 50):
        T = robot.forward_kinematics(q) * pin.exp6(1e-3 * rng.normal(size=6))
        system = np.full((joints, joints + 1), np.nan)
        if joints == 6:
            chain.linearise(geometry.chain, T.homogeneous, q, system)
        else:
            worst = chain.linearise7(geometry.chain, T.homogeneous, q, system)
        here = robot.forward_kinematics(q)
        turn = pin.log3(T.rotation @ here.rotation.T)
        np.testing.assert_allclose(system[:6, :joints], robot.jacobian(q), atol=1e-13)
        np.testing.assert_allclose(system[:3, joints], T.translation - here.translation, atol=1e-13)
        np.testing.assert_allclose(system[3:6, joints], turn, atol=1e-8)  # its sine, which is as much to third order
        if joints == 7:
            assert np.isnan(system[6]).all()  # the condition is the caller's
            away = np.linalg.norm(T.translation - here.translation)
            assert worst == pytest.approx(max(away, np.linalg.norm(turn)), abs=1e-12)


@pytest.mark.parametrize("size", [6, 7])
def test_systems_are_solved(size: int, rng: np.random.Generator) -> None:
    for _ in range(100):
        system = rng.normal(size=(size, size + 1))
        system[0, 0] = 0.0  # a pivot that must be looked for
        wanted = np.linalg.solve(system[:, :size], system[:, size])
        determinant = np.linalg.det(system[:, :size])
        found = chain.eliminate(system) if size == 6 else chain.eliminate7(system)
        assert found == (True if size == 6 else pytest.approx(determinant, rel=1e-8))
        np.testing.assert_allclose(system[:, size], wanted, rtol=1e-8)


@pytest.mark.parametrize("size", [6, 7])
def test_a_singular_system_is_told(size: int, rng: np.random.Generator) -> None:
    system = rng.normal(size=(size, size + 1))
    system[3] = 2.0 * system[1]
    assert not (chain.eliminate(system) if size == 6 else chain.eliminate7(system))


def test_newton_comes_back_to_a_configuration(robot: Robot, rng: np.random.Generator) -> None:
    placements = measure(robot.pin_model, robot.frame_id(), None).chain
    work = chain.make_newton()
    checked = 0
    for q in robot.sample(rng, 100):
        if robot.singular_values(q)[-1] < 0.05:
            continue
        T = robot.forward_kinematics(q).homogeneous
        work.q[:] = q + 1e-3 * rng.normal(size=6)
        for _ in range(5):
            assert chain.newton_step(placements, T, work)
        assert np.abs(work.q - q).max() < 1e-11
        held = int(rng.integers(6))
        work.q[:], work.held[:] = q + 1e-3 * (np.arange(6) != held), np.arange(6) == held
        assert chain.least_squares(placements, T, work, 10)
        assert work.q[held] == q[held]
        assert np.abs(work.q - q).max() < 1e-9
        checked += 1
    assert checked > 50


def test_newton_on_seven_joints_meets_the_condition(bundled: Callable[[str], Robot], rng: np.random.Generator) -> None:
    robot = bundled("j2s7s300")
    placements = measure_seven(robot.pin_model, robot.frame_id(), None).chain
    system, border, tangent = np.empty((7, 8)), np.zeros(7), np.empty(7)
    checked = 0
    for q in robot.sample(rng, 100):
        T = robot.forward_kinematics(q).homogeneous
        border[:] = np.arange(7) == 2
        chain.linearise7(placements, T, q, system)
        volume = chain.null_tangent(border, tangent, system)
        assert abs(volume) == pytest.approx(np.prod(robot.singular_values(q)), rel=1e-6)
        assert np.linalg.norm(tangent) == pytest.approx(1.0)
        assert tangent[2] > 0.0
        assert np.abs(robot.jacobian(q) @ tangent).max() < 1e-12
        if tangent[2] < 0.2 or robot.singular_values(q)[-1] < 0.05:
            continue
        x: Array = q + 1e-3 * rng.normal(size=7)
        assert chain.bordered_newton(placements, T, x, border, q[2] + 0.01, system, 10, 1e-13) < 1e-12
        assert x[2] == pytest.approx(q[2] + 0.01, abs=1e-12)
        assert (robot.forward_kinematics(x).inverse() * pin.SE3(T)).isIdentity(1e-11)
        checked += 1
    assert checked > 20


def test_two_half_turns_about_one_axis_leave_the_tool_where_it_is() -> None:
    placements = np.tile(np.eye(3, 4), (7, 1, 1))
    placements[6, 0, 3] = 0.5
    x, y, z, p = chain.forward(placements, np.array([np.pi, np.pi, 0.0, 0.0, 0.0, 0.0]))
    np.testing.assert_allclose([x, y, z, p], [*np.eye(3), [0.5, 0.0, 0.0]], atol=1e-15)
