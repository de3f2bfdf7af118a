"""What automatic differentiation needs of a solver, as plain arrays: `jacokin.torch` and `jacokin.jax` stand on it."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.ik.solver import IKSolver
from jacokin.ik.targets import checked_target
from jacokin.model import checks
from jacokin.model.angles import FARTHEST_SEED
from jacokin.model.poses import checked_matrices

#: The type of numbers that answers are exact in; float32 knows a pose to 1e-7 only.
NUMBERS = "float64"


def check_arguments(solver: object, shape: tuple[int, ...], dtype: str, closest: bool, advice: str) -> IKSolver:
    """Arguments that frameworks have in common.

    Args:
        solver: must be an `IKSolver` whose answers to poses have gradients.
        shape: of the poses, must be (..., 4, 4).
        dtype: of the poses, must be float64.
        closest: must be a flag.
        advice: how to get numbers of that type.

    Raises:
        InvalidInputError: one of them is not so.
    """
    made = checks.instance("solver", solver, IKSolver, "an IKSolver")
    made.pull_back(np.zeros((1, made.robot.dof)), np.zeros((1, made.robot.dof)))  # refuses arms without gradients
    if shape[-2:] != (4, 4):
        raise InvalidInputError(f"poses must have shape (..., 4, 4), got shape {shape}")
    if not np.prod(shape):
        raise InvalidInputError(f"poses is empty, of shape {shape}")
    if dtype != NUMBERS:
        raise InvalidInputError(f"poses must be {NUMBERS}, got {dtype}: {advice}")
    checks.flag("closest", closest)
    return made


def seeds_of_poses(solver: IKSolver, seeds: ArrayLike | None, shape: tuple[int, ...]) -> Array:
    """Seeds (..., dof) for poses of a shape (..., 4, 4), from seeds that broadcast to that; None for home.

    Raises:
        InvalidInputError: malformed.
    """
    wanted = (*shape[:-2], solver.robot.dof)
    given = solver.robot.home if seeds is None else checks.array("seeds", seeds, f"numbers {wanted}", "rad")
    check_seed_shape(given.shape, wanted)
    return np.broadcast_to(given, wanted)


def check_seed_shape(given: tuple[int, ...], wanted: tuple[int, ...]) -> None:
    """Refuse seeds whose shape does not broadcast to the wanted one.

    Raises:
        InvalidInputError: names both.
    """
    try:
        fits = np.broadcast_shapes(given, wanted) == wanted
    except ValueError:
        fits = False
    if not fits:
        raise InvalidInputError(f"seeds must have a shape that broadcasts to {wanted}, got shape {given}")


def solve_poses(solver: IKSolver, poses: Array, seeds: Array, closest: bool) -> tuple[Array, NDArray[np.bool_]]:
    """Answers (..., dof) to poses (..., 4, 4) from seeds (..., dof) [rad], and which are successes (...).

    Raises:
        InvalidInputError: poses or seeds malformed; the row is named.
    """
    matrices, starts = checked_matrices("poses", poses.reshape(-1, 4, 4).copy()), seeds.reshape(-1, seeds.shape[-1])
    found = solver.solve_batch(matrices, starts, closest=closest)
    return found.q.reshape(seeds.shape), found.success.reshape(poses.shape[:-2])


def solve_what_is_a_pose(
    solver: IKSolver, poses: Array, seeds: Array, closest: bool
) -> tuple[Array, NDArray[np.bool_]]:
    """Answers (..., dof) and successes (...), where nothing can be raised: malformed rows get NaN, and no success."""
    matrices, starts = poses.reshape(-1, 4, 4), seeds.reshape(-1, seeds.shape[-1])
    q, success = np.full(starts.shape, np.nan), np.zeros(len(matrices), dtype=np.bool_)
    good = (np.abs(starts) <= FARTHEST_SEED).all(axis=1) & np.array([_is_pose(matrix) for matrix in matrices])
    if good.any():
        q[good], success[good] = solve_poses(solver, matrices[good], starts[good], closest)
    return q.reshape(seeds.shape), success.reshape(poses.shape[:-2])


def pull_back(solver: IKSolver, q: Array, success: NDArray[np.bool_], cotangents: Array) -> Array:
    """Cotangents (..., 4, 4) of poses from those of their answers (..., dof); zero where there was no success."""
    rows, mask = cotangents.reshape(-1, cotangents.shape[-1]), success.ravel()
    found = np.zeros((len(rows), 4, 4))
    if mask.any():
        found[mask] = solver.pull_back(q.reshape(rows.shape)[mask], rows[mask])
    return found.reshape(*cotangents.shape[:-1], 4, 4)


def _is_pose(matrix: Array) -> bool:
    try:
        checked_target(matrix)
    except InvalidInputError:
        return False
    return True
