"""Many targets at once: the compiled loop for poses, the QP for the rest, arrays out."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from jacokin.errors import InvalidInputError
from jacokin.ik import seeds, targets
from jacokin.ik.results import BatchResult, IKResult, Status
from jacokin.ik.targets import Target
from jacokin.model import checks

if TYPE_CHECKING:
    from jacokin.ik.solver import IKSolver

Array = NDArray[np.float64]

CHUNK = 4096  # targets in one compiled call: progress is seen, and the call's cost is spread


def solve(
    solver: IKSolver,
    wanted: Sequence[pin.SE3] | ArrayLike,
    start: ArrayLike | None,
    *,
    workers: int,
    progress: Callable[[int], None] | None,
    closest: bool,
) -> BatchResult:
    """See `IKSolver.solve_batch`."""
    if isinstance(workers, bool) or not isinstance(workers, int | np.integer) or workers < 1:
        raise InvalidInputError(f"workers must be a whole number >= 1, got {workers!r}")
    matrices, position_only = targets.checked_batch(wanted)
    starts = _starts(solver, start, len(matrices))
    out = _Columns(len(matrices), solver.robot.dof)
    rest = list(range(len(matrices)))
    if solver.batches_compiled():
        rest = _compiled(solver, matrices, position_only, starts, out, workers, progress)
    jobs = [(index, Target(matrices[index], bool(position_only[index])), starts[index], closest) for index in rest]
    for index, result in _one_by_one(solver, jobs, workers):
        out.put(index, result)
        if progress is not None:
            progress(1)
    return out.result()


class _Columns:
    """The columns of a batch result while they fill."""

    def __init__(self, size: int, dof: int) -> None:
        self.q = np.zeros((size, dof))
        self.errors = np.zeros((size, 2))
        self.status: list[Status] = [Status.OK] * size
        self.method = ["closed_form"] * size
        self.message = [""] * size

    def put(self, index: int, result: IKResult) -> None:
        self.q[index] = result.q
        self.errors[index] = result.position_error, result.orientation_error
        self.status[index], self.method[index], self.message[index] = result.status, result.method, result.message

    def result(self) -> BatchResult:
        success = np.array([status is Status.OK for status in self.status])
        success.setflags(write=False)
        return BatchResult(
            q=checks.read_only(self.q),
            status=tuple(self.status),
            success=success,
            position_error=checks.read_only(self.errors[:, 0]),
            orientation_error=checks.read_only(self.errors[:, 1]),
            method=tuple(self.method),
            message=tuple(self.message),
        )


def _starts(solver: IKSolver, start: ArrayLike | None, size: int) -> Array:
    """One legal seed for each target."""
    robot = solver.robot
    if start is None or np.ndim(start) == 1:
        return np.tile(seeds.legal_seed(robot, start)[0], (size, 1))
    rows = checks.matrix("seeds", start, robot.dof, "rad")
    if len(rows) != size:
        raise InvalidInputError(f"seeds must have one row for each of the {size} targets, got {len(rows)}")
    legal = (rows >= robot.lower).all(axis=1) & (rows <= robot.upper).all(axis=1)
    rows = rows.copy()
    for index in np.flatnonzero(~legal):
        rows[index] = seeds.legal_seed(robot, rows[index])[0]
    return rows


def _compiled(
    solver: IKSolver,
    matrices: Array,
    position_only: NDArray[np.bool_],
    starts: Array,
    out: _Columns,
    workers: int,
    progress: Callable[[int], None] | None,
) -> list[int]:
    """Poses through the compiled loop; returns the rows it did not settle."""
    form = solver.closed_form()
    rows = np.flatnonzero(~position_only)
    left: list[int] = np.flatnonzero(position_only).tolist()
    for first in range(0, len(rows), CHUNK):
        chunk = rows[first : first + CHUNK]
        raw = form.solve_batch(matrices[chunk], starts[chunk], workers)
        good = (
            raw.within_limits
            & (raw.position_error <= solver.tolerances[0])
            & (raw.orientation_error <= solver.tolerances[1])
        )
        good &= (raw.q >= solver.robot.lower).all(axis=1) & (raw.q <= solver.robot.upper).all(axis=1)
        settled = chunk[good]
        out.q[settled] = raw.q[good]
        out.errors[settled] = np.column_stack((raw.position_error[good], raw.orientation_error[good]))
        left.extend(chunk[~good].tolist())
        if progress is not None and len(settled):
            progress(len(settled))
    return left


_Job = tuple[int, Target, Array, bool]
_process_solver: list[IKSolver] = []


def _one_by_one(solver: IKSolver, jobs: list[_Job], workers: int) -> Iterator[tuple[int, IKResult]]:
    """What the compiled loop left, through `solve`: in this process, or in several."""
    if workers == 1 or len(jobs) < 2 * workers:
        for job in jobs:
            yield _job(solver, job)
        return
    import multiprocessing
    from concurrent.futures import ProcessPoolExecutor

    context = multiprocessing.get_context("spawn")  # threads of numba and BLAS do not survive a fork
    with ProcessPoolExecutor(workers, mp_context=context, initializer=_set_solver, initargs=(solver,)) as pool:
        yield from pool.map(_job_in_process, jobs, chunksize=max(1, len(jobs) // (8 * workers)))


def _set_solver(solver: IKSolver) -> None:
    _process_solver[:] = [solver]


def _job_in_process(job: _Job) -> tuple[int, IKResult]:
    return _job(_process_solver[0], job)


def _job(solver: IKSolver, job: _Job) -> tuple[int, IKResult]:
    index, target, start, closest = job
    return index, solver.solve(target.position if target.position_only else target.matrix, start, closest=closest)
