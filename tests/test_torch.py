"""`jacokin.torch.solve`: values as the solver's, gradients as finite differences'."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import jacokin.torch
from jacokin import IKSolver, Robot
from jacokin.errors import InvalidInputError
from tests.ik.regular import reached_singular_and_out_of_reach, regular, solver_with_tool

torch = pytest.importorskip("torch", reason="the extra torch is not installed")


@pytest.fixture(scope="module")
def solver(robot: Robot) -> IKSolver:
    return solver_with_tool(robot)


def moved(poses: Any, twists: Any) -> Any:
    """Poses (n, 4, 4) after twists (n, 6), local_world_aligned."""
    x, y, z = twists[:, 3:].T
    o = torch.zeros_like(x)
    S = torch.stack([o, -z, y, z, o, -x, -y, x, o], dim=1).reshape(-1, 3, 3)
    R = torch.linalg.matrix_exp(S) @ poses[:, :3, :3]
    top = torch.cat([R, (poses[:, :3, 3] + twists[:, :3])[:, :, None]], dim=2)
    return torch.cat([top, poses[:, 3:]], dim=1)


def test_values_are_the_solvers(solver: IKSolver, rng: np.random.Generator) -> None:
    seeds, poses = regular(solver, rng, 20)
    poses[3, :3, 3] += 5.0
    expected = solver.solve_batch(poses, seeds)
    q, success = jacokin.torch.solve(solver, torch.tensor(poses), torch.tensor(seeds))
    np.testing.assert_array_equal(q.numpy(), expected.q)
    np.testing.assert_array_equal(success.numpy(), expected.success)
    q, success = jacokin.torch.solve(solver, torch.tensor(poses[0]))
    np.testing.assert_array_equal(q.numpy(), solver.solve(poses[0]).q)
    assert success.shape == ()


def test_gradients_agree_with_finite_differences_along_motions(solver: IKSolver, rng: np.random.Generator) -> None:
    seeds, poses = (torch.tensor(each) for each in regular(solver, rng, 6))
    twists = torch.zeros(6, 6, dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(
        lambda twists: jacokin.torch.solve(solver, moved(poses, twists), seeds)[0], twists, atol=1e-4, rtol=1e-4
    )


def test_compiled_functions_leave_the_solver_alone(solver: IKSolver, rng: np.random.Generator) -> None:
    seeds, poses = (torch.tensor(each) for each in regular(solver, rng, 3))
    found = []
    for change in (torch.compile(backend="eager"), lambda function: function):
        given = poses.clone().requires_grad_()
        q, success = change(lambda poses: jacokin.torch.solve(solver, poses, seeds))(given)
        (q**2).sum().backward()
        found.append((q.detach(), success, given.grad))
    for compiled, plain in zip(*found, strict=True):
        np.testing.assert_array_equal(compiled.numpy(), plain.numpy())


def test_gradients_are_those_of_the_solver(solver: IKSolver, rng: np.random.Generator) -> None:
    seeds, poses = regular(solver, rng, 6)
    given = torch.tensor(poses.reshape(2, 3, 4, 4), requires_grad=True)
    q, success = jacokin.torch.solve(solver, given, torch.tensor(seeds.reshape(2, 3, 6)))
    assert success.all()
    assert not success.requires_grad
    (torch.sin(q) + 0.1 * q**2).sum().backward()
    expected = solver.pull_back(seeds, np.cos(seeds) + 0.2 * seeds)
    np.testing.assert_allclose(given.grad.reshape(6, 4, 4), expected, rtol=1e-6, atol=1e-6 * np.abs(expected).max())


def test_seven_joints_hold_the_parameter() -> None:
    robot = jacokin.load_robot("j2s7s300")
    solver = IKSolver(robot, collision="ignore")
    pose, seed = robot.forward_kinematics(robot.home), torch.tensor(robot.home)
    given = torch.tensor(pose.homogeneous[np.newaxis])
    rows = torch.autograd.functional.jacobian(
        lambda twist: jacokin.torch.solve(solver, moved(given, twist[None]), seed)[0][0],
        torch.zeros(6, dtype=torch.float64),
    )
    np.testing.assert_allclose(rows, solver.gradient(solver.solve(pose, robot.home)), atol=1e-6)


def test_failed_and_singular_answers(bundled: Any) -> None:
    robot = bundled("j2s6s300")
    solver = IKSolver(robot, collision="ignore")
    seeds, poses = reached_singular_and_out_of_reach(robot)
    for rows, singular in ((slice(None), True), (slice(0, 1), False)):
        given = torch.tensor(poses, requires_grad=True)
        q, success = jacokin.torch.solve(solver, given, torch.tensor(seeds))
        assert success.tolist() == [True, True, False]
        q[rows].sum().backward()
        assert torch.isfinite(given.grad[0]).all()
        assert bool(torch.isnan(given.grad[1, :3]).all()) is singular  # unless nothing depends on it
        assert not given.grad[2].any()


def test_arguments_are_checked(solver: IKSolver, rng: np.random.Generator) -> None:
    seeds, poses = (torch.tensor(each) for each in regular(solver, rng, 3))
    with pytest.raises(InvalidInputError, match=r"poses must be a torch.Tensor, got ndarray"):
        jacokin.torch.solve(solver, poses.numpy())
    with pytest.raises(InvalidInputError, match=r"seeds must be a torch.Tensor, got list"):
        jacokin.torch.solve(solver, poses, [0.0] * 6)
    with pytest.raises(InvalidInputError, match=r"poses must be float64, got float32: use poses.double\(\)"):
        jacokin.torch.solve(solver, poses.float())
    with pytest.raises(InvalidInputError, match=r"poses is empty, of shape \(0, 4, 4\)"):
        jacokin.torch.solve(solver, poses[:0])
    with pytest.raises(InvalidInputError, match=r"poses\[2\] is not a rotation"):
        jacokin.torch.solve(solver, torch.cat([poses[:2], 2.0 * poses[2:] - torch.eye(4, dtype=torch.float64)]), seeds)


def test_tensors_that_are_no_arrays_are_refused_by_name(solver: IKSolver, rng: np.random.Generator) -> None:
    seeds, poses = (torch.tensor(each) for each in regular(solver, rng, 3))
    dense = "must be a dense tensor with data of a type that NumPy has, outside torch.func and torch.vmap"
    for strange in (poses.to_sparse(), poses.to("meta"), poses.bfloat16()):
        with pytest.raises(InvalidInputError, match=f"^poses {dense}"):
            jacokin.torch.solve(solver, strange, seeds)
    for strange in (seeds.to_sparse(), seeds.to("meta"), seeds.bfloat16()):
        with pytest.raises(InvalidInputError, match=f"^seeds {dense}"):
            jacokin.torch.solve(solver, poses, strange)
    with pytest.raises(InvalidInputError, match=f"^poses {dense}"):
        torch.vmap(lambda pose: jacokin.torch.solve(solver, pose))(poses)


def test_views_are_read(solver: IKSolver, rng: np.random.Generator) -> None:
    seeds, poses = (torch.tensor(each) for each in regular(solver, rng, 3))
    negative = torch.complex(poses, -poses).conj().imag  # which NumPy cannot read as it lies
    assert negative.is_neg()
    expected = jacokin.torch.solve(solver, poses, seeds)
    for given in (negative, poses.mT.contiguous().mT):
        for found, wanted in zip(jacokin.torch.solve(solver, given, seeds), expected, strict=True):
            np.testing.assert_array_equal(found.numpy(), wanted.numpy())


def test_second_derivatives_are_refused_and_not_zero(solver: IKSolver, rng: np.random.Generator) -> None:
    seeds, poses = (torch.tensor(each) for each in regular(solver, rng, 2))
    for loss in (torch.sum, lambda q: (q**2).sum()):  # with gradients by q that are constant, and that are not
        given = poses.clone().requires_grad_()
        q, _ = jacokin.torch.solve(solver, given, seeds)
        first = torch.autograd.grad(loss(q), given, create_graph=True)[0]
        assert first.abs().max() > 0.1
        with pytest.raises(InvalidInputError, match="jacokin.torch.solve has no second derivative"):
            (first.pow(2).sum() + q.sum()).backward()


@pytest.mark.filterwarnings("ignore:`torch.jit.script` is deprecated")  # which PyTorch itself calls there
def test_gradients_of_forward_mode_are_refused(solver: IKSolver, rng: np.random.Generator) -> None:
    seeds, poses = (torch.tensor(each) for each in regular(solver, rng, 2))
    with torch.autograd.forward_ad.dual_level():
        dual = torch.autograd.forward_ad.make_dual(poses, torch.ones_like(poses))
        with pytest.raises(InvalidInputError, match="jacokin.torch.solve has gradients of reverse mode only"):
            jacokin.torch.solve(solver, dual, seeds)


def test_gradients_by_the_answers_are_read_as_poses_are(solver: IKSolver, rng: np.random.Generator) -> None:
    seeds, poses = (torch.tensor(each) for each in regular(solver, rng, 2))
    ones = torch.ones(2, 6, dtype=torch.float64)
    negative = torch.complex(ones, -ones).conj().imag  # which NumPy cannot read as it lies
    found = []
    for cotangents in (ones, negative):
        given = poses.clone().requires_grad_()
        jacokin.torch.solve(solver, given, seeds)[0].backward(cotangents)
        found.append(given.grad)
    np.testing.assert_array_equal(found[0], found[1])
    given = poses.clone().requires_grad_()
    q, _ = jacokin.torch.solve(solver, given, seeds)
    with pytest.raises(InvalidInputError, match="^gradients by the joint angles must be a dense tensor"):
        torch.autograd.grad(q, given, torch.stack([ones, ones]), is_grads_batched=True)
