"""`jacokin.jax.solve`: values as the solver's, gradients as finite differences', under every transformation."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import jacokin.jax
from jacokin import IKSolver, Robot
from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from tests.ik.regular import reached_singular_and_out_of_reach, regular, solver_with_tool

jax = pytest.importorskip("jax", reason="the extra jax is not installed")
jnp = jax.numpy


@pytest.fixture(autouse=True)
def _exact() -> Iterator[None]:
    """Numbers of 64 bits."""
    before = jax.config.jax_enable_x64
    jax.config.update("jax_enable_x64", True)
    yield
    jax.config.update("jax_enable_x64", before)


@pytest.fixture(scope="module")
def solver(robot: Robot) -> IKSolver:
    return solver_with_tool(robot)


def moved(pose: Array, twist: Any) -> Any:
    """A pose (4, 4) after a twist (6,), local_world_aligned, to first order: it is differentiated at 0."""
    x, y, z = twist[3:]
    S = jnp.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    R = pose[:3, :3] + S @ pose[:3, :3]
    return jnp.vstack([jnp.column_stack([R, pose[:3, 3] + twist[:3]]), pose[3]])


def loss(solver: IKSolver, poses: Any, seeds: Any) -> Any:
    q, _ = jacokin.jax.solve(solver, poses, seeds)
    return jnp.sum(jnp.sin(q) + 0.1 * q**2)


def test_values_are_the_solvers(solver: IKSolver, rng: np.random.Generator) -> None:
    seeds, poses = regular(solver, rng, 20)
    poses[3, :3, 3] += 5.0
    expected = solver.solve_batch(poses, seeds)
    for q, success in (
        jacokin.jax.solve(solver, poses, seeds),
        jax.jit(lambda T: jacokin.jax.solve(solver, T, seeds))(poses),
        jax.vmap(lambda T, s: jacokin.jax.solve(solver, T, s))(poses, seeds),
    ):
        np.testing.assert_array_equal(q, expected.q)
        np.testing.assert_array_equal(success, expected.success)
    assert not expected.success[3]
    np.testing.assert_array_equal(jacokin.jax.solve(solver, poses[0])[0], solver.solve(poses[0]).q)


def test_gradients_are_those_of_the_solver_under_jit_and_vmap(solver: IKSolver, rng: np.random.Generator) -> None:
    seeds, poses = regular(solver, rng, 4)
    expected = solver.pull_back(seeds, np.cos(seeds) + 0.2 * seeds)
    plain = jax.grad(loss, argnums=1)
    one = jax.vmap(lambda T, s: plain(solver, T, s))
    for gradient in (
        plain(solver, jnp.asarray(poses), seeds),
        jax.jit(lambda T: plain(solver, T, seeds))(poses),
        one(poses, seeds),
        jax.jit(one)(poses, seeds),
    ):
        np.testing.assert_allclose(gradient, expected, rtol=1e-6, atol=1e-6 * np.abs(expected).max())


@pytest.mark.slow
@pytest.mark.parametrize("name", ["j2n6s300", pytest.param("m1n6s200", marks=pytest.mark.slow)])
def test_gradients_agree_with_finite_differences_along_motions(name: str, rng: np.random.Generator) -> None:
    solver = IKSolver(jacokin.load_robot(name), collision="ignore")
    seeds, poses = regular(solver, rng, 4)

    def of_twist(twist: Any, pose: Any, q: Any) -> Any:
        return loss(solver, moved(pose, twist), q)

    gradients = jax.vmap(jax.grad(of_twist))(jnp.zeros((4, 6)), poses, seeds)
    for q, pose, gradient in zip(seeds, poses, np.asarray(gradients), strict=True):
        T = pin.SE3(pose[:3, :3], pose[:3, 3])
        for slope, step in zip(gradient, 1e-6 * np.eye(6), strict=True):
            ends = [
                solver.solve(pin.SE3(pin.exp3(sign * step[3:]) @ T.rotation, T.translation + sign * step[:3]), q).q
                for sign in (1.0, -1.0)
            ]
            values = [np.sum(np.sin(end) + 0.1 * end**2) for end in ends]
            assert slope == pytest.approx((values[0] - values[1]) / 2e-6, rel=1e-4, abs=1e-4)


@pytest.mark.slow
def test_seven_joints_hold_the_parameter(rng: np.random.Generator) -> None:
    robot = jacokin.load_robot("j2s7s300")
    solver = IKSolver(robot, collision="ignore")
    pose, q = robot.forward_kinematics(robot.home), robot.home
    rows = jax.jacrev(lambda twist: jacokin.jax.solve(solver, moved(pose.homogeneous, twist), q)[0])(jnp.zeros(6))
    np.testing.assert_allclose(rows, solver.gradient(solver.solve(pose, q)), atol=1e-6)
    assert not rows[2].any()


@pytest.mark.slow
def test_failed_and_singular_answers(bundled: Any) -> None:
    robot = bundled("j2s6s300")
    solver = IKSolver(robot, collision="ignore")
    seeds, poses = reached_singular_and_out_of_reach(robot)
    gradient = jax.grad(loss, argnums=1)(solver, jnp.asarray(poses), seeds)
    assert np.isfinite(gradient[0]).all()
    assert np.isnan(gradient[1, :3]).all()
    assert not gradient[2].any()
    first = jax.grad(lambda T: jacokin.jax.solve(solver, T, seeds)[0][0].sum())(jnp.asarray(poses))
    assert np.isfinite(first).all()  # nothing depends on the singular answer


def test_malformed_poses_are_refused_or_no_successes(solver: IKSolver, rng: np.random.Generator) -> None:
    seeds, poses = regular(solver, rng, 3)
    poses[1, 0, 0] = np.nan
    with pytest.raises(InvalidInputError, match=r"poses\[1\] must be finite"):
        jacokin.jax.solve(solver, poses, seeds)
    q, success = jax.jit(lambda T: jacokin.jax.solve(solver, T, seeds))(poses)
    assert success.tolist() == [True, False, True]
    assert np.isnan(q[1]).all()
    assert np.isfinite(np.delete(q, 1, 0)).all()
    gradient = jax.grad(lambda T: jnp.nansum(jacokin.jax.solve(solver, T, seeds)[0]))(jnp.asarray(poses))
    assert not gradient[1].any()
    seeds[2, 0] = 1e7  # [rad], farther than seeds are taken from
    q, success = jax.jit(lambda seeds: jacokin.jax.solve(solver, poses[[0, 2]], seeds))(seeds[[0, 2]])
    assert success.tolist() == [True, False]
    assert np.isnan(q[1]).all()


def test_arguments_are_checked(solver: IKSolver, rng: np.random.Generator) -> None:
    seeds, poses = regular(solver, rng, 3)
    with pytest.raises(InvalidInputError, match="solver must be an IKSolver"):
        jacokin.jax.solve(solver.robot, poses)  # type: ignore[arg-type]  # that is the test
    with pytest.raises(InvalidInputError, match=r"poses must have shape \(\.\.\., 4, 4\), got shape \(3, 3, 4\)"):
        jacokin.jax.solve(solver, poses[:, :3])
    for wrong in (None, "here", [[1.0], [1.0, 2.0]]):
        with pytest.raises(InvalidInputError, match=r"poses must be an array of shape \(\.\.\., 4, 4\), got"):
            jacokin.jax.solve(solver, wrong)
    for given in (jnp.asarray(poses, jnp.float32), np.eye(4, dtype=int)):  # numbers of double precision are there
        with pytest.raises(InvalidInputError, match=r"poses must be float64, got (float32|int64): use poses.astype"):
            jacokin.jax.solve(solver, given)
    jax.config.update("jax_enable_x64", False)
    try:
        with pytest.raises(InvalidInputError, match=r"poses must be float64, got float32: call jax.config.update"):
            jacokin.jax.solve(solver, poses)
    finally:
        jax.config.update("jax_enable_x64", True)
    with pytest.raises(
        InvalidInputError, match=r"seeds must have a shape that broadcasts to \(3, 6\), got shape \(5,\)"
    ):
        jacokin.jax.solve(solver, poses, np.zeros(5))
    with pytest.raises(InvalidInputError, match=r"seeds must be numbers \(3, 6\) \[rad\], got \[\[0.0\]"):
        jacokin.jax.solve(solver, poses, [[0.0], [0.0, 1.0]])
    with pytest.raises(InvalidInputError, match=r"poses is empty, of shape \(0, 4, 4\)"):
        jacokin.jax.solve(solver, poses[:0])
    with pytest.raises(InvalidInputError, match="closest must be True or False"):
        jacokin.jax.solve(solver, poses, seeds, closest="no")  # type: ignore[arg-type]  # that is the test
    seven = IKSolver(jacokin.load_robot("j2s7s300"), method="qp", collision="ignore")
    with pytest.raises(InvalidInputError, match="a pose leaves 1 of the 7 joints"):
        jacokin.jax.solve(seven, poses)


def test_seeds_are_checked_within_a_transformation(solver: IKSolver, rng: np.random.Generator) -> None:
    seeds, poses = regular(solver, rng, 3)
    solve = jax.jit(lambda T, q: jacokin.jax.solve(solver, T, q))
    for wrong in (seeds[:2], seeds[:, :5], np.zeros((2, 3, 6))):
        with pytest.raises(InvalidInputError, match=r"^seeds must have a shape that broadcasts to \(3, 6\), got shape"):
            solve(poses, wrong)
    for strange, kind in ((seeds + 1j, "complex128"), (seeds > 0.0, "bool")):
        with pytest.raises(InvalidInputError, match=rf"^seeds must be numbers \(3, 6\) \[rad\], got {kind}"):
            solve(poses, strange)


def test_second_derivatives_are_refused(solver: IKSolver, rng: np.random.Generator) -> None:
    seeds, poses = (jnp.asarray(each) for each in regular(solver, rng, 2))
    first = jax.grad(loss, argnums=1)
    with pytest.raises(InvalidInputError, match="jacokin.jax.solve has no second derivative"):
        jax.grad(lambda T: jnp.sum(first(solver, T, seeds) ** 2))(poses)
