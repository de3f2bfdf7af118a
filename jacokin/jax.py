"""`solve`: inverse kinematics as a differentiable function of JAX arrays. Needs the extra `jax`."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np

from jacokin.errors import InvalidInputError, needed
from jacokin.ik import differentiable
from jacokin.ik.solver import IKSolver
from jacokin.model import checks

__all__ = ["solve"]

ADVICE = 'call jax.config.update("jax_enable_x64", True) before arrays are made'
CONVERT = "use poses.astype(float)"  # where numbers of double precision are there already


def solve(  # Any: arrays of a package that need not be installed
    solver: IKSolver, poses: Any, seeds: Any = None, *, closest: bool = True
) -> tuple[Any, Any]:
    """Joint angles that bring the tool to poses, with gradients by the poses; under `jit`, `vmap` and `grad`, too.

    The gradient by a pose is that of `IKSolver.pull_back`: its part along motions of the pose, for poses that are
    computed as rotations and positions. On seven joints the parameter is constant, as in `IKSolver.gradient`. It is of
    reverse mode (`grad`, `vjp`, `jacrev`), there is no second derivative, and none by the seeds.

    Args:
        solver: of six joints, or of seven whose poses have curves of answers.
        poses: (..., 4, 4) array, float64, T_base_tool; the work is done by the CPU.
        seeds: array that broadcasts to (..., dof), to stay near to [rad]; None for the robot's home.
        closest: as in `IKSolver.solve`, where a pose is not reached.

    Returns:
        Joint angles (..., dof) [rad], and success (...) of booleans. Where it is False the angles are the closest that
        were found, and their gradient is zero. Where an answer is singular its gradient is NaN, unless nothing that is
        differentiated depends on it. Under a transformation malformed poses and seeds are not refused: their angles are
        NaN, without success.

    Raises:
        MissingExtraError: JAX is not installed.
        InvalidInputError: malformed arguments, or an arm whose answers to poses have no gradients.
    """
    with needed("jax", "jax"):
        import jax
        import jax.numpy as jnp
    try:
        poses = jnp.asarray(poses)
    except (TypeError, ValueError) as error:
        raise checks.refusal("poses", "an array of shape (..., 4, 4)", poses) from error
    shape = tuple(poses.shape)
    advice = CONVERT if jax.config.jax_enable_x64 else ADVICE
    made = differentiable.check_arguments(solver, shape, str(poses.dtype), closest, advice)
    start = made.robot.home if seeds is None else seeds
    wanted = (*shape[:-2], made.robot.dof)
    if not isinstance(start, jax.core.Tracer):
        start = differentiable.seeds_of_poses(made, start, shape)
    elif not jnp.isrealobj(start) or start.dtype == jnp.bool_:
        raise InvalidInputError(f"seeds must be numbers {wanted} [rad], got {start.dtype}")
    differentiable.check_seed_shape(start.shape, wanted)
    start = jnp.broadcast_to(jnp.asarray(start, poses.dtype), wanted)
    if not isinstance(poses, jax.core.Tracer) and not isinstance(start, jax.core.Tracer):
        q, success = differentiable.solve_poses(made, np.asarray(poses), np.asarray(start), closest)
        return jnp.asarray(q), jnp.asarray(success)
    found = _answers()(made, closest, poses, start)
    return found[0], found[1]


@functools.cache
def _answers() -> Any:  # Any: a function of a package that need not be installed
    import jax

    @functools.partial(jax.custom_vjp, nondiff_argnums=(0, 1))
    def answers(solver: IKSolver, closest: bool, poses: Any, seeds: Any) -> Any:
        def host(matrices: Any, starts: Any) -> Any:
            return differentiable.solve_what_is_a_pose(solver, np.asarray(matrices), np.asarray(starts), closest)

        shapes = _of(seeds.shape, poses.dtype), _of(poses.shape[:-2], np.bool_)
        return jax.pure_callback(host, shapes, poses, seeds, vmap_method="broadcast_all")

    def forward(solver: IKSolver, closest: bool, poses: Any, seeds: Any) -> Any:
        found = answers(solver, closest, poses, seeds)
        return found, found

    def backward(solver: IKSolver, _closest: bool, found: Any, cotangents: Any) -> Any:
        return gradients(solver, *found, cotangents[0]), jax.numpy.zeros_like(found[0])

    @functools.partial(jax.custom_jvp, nondiff_argnums=(0,))
    def gradients(solver: IKSolver, q: Any, success: Any, cotangents: Any) -> Any:
        def host(*arrays: Any) -> Any:
            return differentiable.pull_back(solver, *map(np.asarray, arrays))

        poses = _of((*success.shape, 4, 4), q.dtype)
        return jax.pure_callback(host, poses, q, success, cotangents, vmap_method="broadcast_all")

    def refused(*_: Any) -> Any:
        raise InvalidInputError("jacokin.jax.solve has no second derivative")

    def _of(shape: tuple[int, ...], dtype: Any) -> Any:
        return jax.ShapeDtypeStruct(shape, dtype)

    answers.defvjp(forward, backward)
    gradients.defjvp(refused)
    return answers
