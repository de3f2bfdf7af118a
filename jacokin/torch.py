"""`solve`: inverse kinematics as a differentiable function of PyTorch tensors. Needs the extra `torch`."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, needed
from jacokin.ik import differentiable
from jacokin.ik.solver import IKSolver

__all__ = ["solve"]


def solve(  # Any: tensors, of a package that need not be installed
    solver: IKSolver, poses: Any, seeds: Any = None, *, closest: bool = True
) -> tuple[Any, Any]:
    """Joint angles that bring the tool to poses, with gradients by the poses.

    The gradient by a pose is that of `IKSolver.pull_back`: its part along motions of the pose, for poses that are
    computed as rotations and positions. On seven joints the parameter is constant, as in `IKSolver.gradient`. There is
    no second derivative, and none by the seeds. `torch.func` and `torch.vmap` are refused, which many poses do not
    need; `torch.compile` breaks its graph here.

    Args:
        solver: of six joints, or of seven whose poses have curves of answers.
        poses: (..., 4, 4) tensor, float64, T_base_tool; on any device, though the work is done by the CPU.
        seeds: tensor that broadcasts to (..., dof), to stay near to [rad]; None for the robot's home.
        closest: as in `IKSolver.solve`, where a pose is not reached.

    Returns:
        Joint angles (..., dof) [rad], and success (...) of booleans. Where it is False the angles are the closest that
        were found, and their gradient is zero. Where an answer is singular its gradient is NaN, unless nothing that is
        differentiated depends on it.

    Raises:
        MissingExtraError: PyTorch is not installed.
        InvalidInputError: malformed arguments, or an arm whose answers to poses have no gradients.
    """
    with needed("torch", "torch"):
        import torch
    # Only while it is traced: `disable` loads the whole compiler.
    untraced = torch.compiler.disable(_solve) if torch.compiler.is_compiling() else _solve
    found: tuple[Any, Any] = untraced(solver, poses, seeds, closest)
    return found


def _solve(solver: IKSolver, poses: Any, seeds: Any, closest: bool) -> tuple[Any, Any]:
    """`solve`, as PyTorch's compiler must not trace it."""
    import torch

    for name, value in (("poses", poses), ("seeds", seeds)):
        if not isinstance(value, torch.Tensor) and (name == "poses" or value is not None):
            raise InvalidInputError(f"{name} must be a torch.Tensor, got {type(value).__name__}")
    dtype, shape = str(poses.dtype).removeprefix("torch."), _numbers("poses", poses).shape
    made = differentiable.check_arguments(solver, shape, dtype, closest, "use poses.double()")
    start = None if seeds is None else _numbers("seeds", seeds)
    found = _answers().apply(poses, made, differentiable.seeds_of_poses(made, start, shape), closest)
    return found[0], found[1]


def _numbers(name: str, tensor: Any) -> Array:  # Any: a tensor
    """The numbers in a tensor, wherever it is.

    Raises:
        InvalidInputError: NumPy has no such array: a sparse, nested or meta tensor, or one within `torch.func`.
    """
    try:
        return np.asarray(tensor.numpy(force=True))
    except (TypeError, RuntimeError) as error:
        raise InvalidInputError(
            f"{name} must be a dense tensor with data of a type that NumPy has, outside torch.func and torch.vmap, "
            f"which poses (..., 4, 4) need not: {error}"
        ) from error


@functools.cache
def _answers() -> Any:  # Any: a class of a package that need not be installed
    import torch

    class Gradients(torch.autograd.Function):  # type: ignore[misc]  # PyTorch may be missing
        """Gradients by poses, which depend on q: to differentiate them is an error, and gives no zeros."""

        @staticmethod
        def forward(_: Any, q: Any, success: Any, cotangents: Any, solver: IKSolver) -> Any:
            given = _numbers("gradients by the joint angles", cotangents)
            found = differentiable.pull_back(solver, q.numpy(force=True), success.numpy(force=True), given)
            return torch.tensor(found, device=cotangents.device)

        @staticmethod
        def backward(*_: Any) -> Any:
            raise InvalidInputError("jacokin.torch.solve has no second derivative")

    class Answers(torch.autograd.Function):  # type: ignore[misc]  # PyTorch may be missing
        """q and success of poses."""

        @staticmethod
        def forward(ctx: Any, poses: Any, solver: IKSolver, seeds: Any, closest: bool) -> tuple[Any, Any]:
            q, success = differentiable.solve_poses(solver, _numbers("poses", poses), seeds, closest)
            answers = torch.tensor(q, device=poses.device), torch.tensor(success, device=poses.device)
            ctx.solver = solver
            ctx.save_for_backward(*answers)
            ctx.mark_non_differentiable(answers[1])
            return answers

        @staticmethod
        def backward(ctx: Any, cotangents: Any, _: Any) -> tuple[Any, None, None, None]:
            return Gradients.apply(*ctx.saved_tensors, cotangents, ctx.solver), None, None, None

        @staticmethod
        def jvp(*_: Any) -> Any:
            raise InvalidInputError("jacokin.torch.solve has gradients of reverse mode only")

    return Answers
