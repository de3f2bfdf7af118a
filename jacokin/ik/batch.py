"""Many targets at once: the compiled loop for poses, the QP for the rest, arrays out."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from jacokin.errors import InvalidInputError, JacokinError
from jacokin.ik import seeds, targets
from jacokin.ik.results import BatchResult, IKResult, Status
from jacokin.ik.targets import Target
from jacokin.ik.verification import joined
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
    if progress is not None and not callable(progress):
        raise InvalidInputError(f"progress must be callable, got {progress!r}")
    starts, notes = _starts(solver, start, len(matrices))
    out = _Columns(len(matrices), solver.robot.dof, notes)
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

    def __init__(self, size: int, dof: int, notes: list[str]) -> None:
        self.q = np.zeros((size, dof))
        self.errors = np.zeros((size, 2))
        self.status: list[Status] = [Status.OK] * size
        self.method = ["closed_form"] * size
        self.message = list(notes)
        self._notes = notes

    def put(self, index: int, result: IKResult) -> None:
        self.q[index] = result.q
        self.errors[index] = result.position_error, result.orientation_error
        self.status[index], self.method[index] = result.status, result.method
        self.message[index] = joined(result.message, self._notes[index])

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


def _starts(solver: IKSolver, start: ArrayLike | None, size: int) -> tuple[Array, list[str]]:
    """One legal seed for each target, and what had to be done to it."""
    robot = solver.robot
    if start is None or np.ndim(start) == 1:
        seed, note = seeds.legal_seed(robot, start)
        return np.tile(seed, (size, 1)), [note] * size
    rows = checks.matrix("seeds", start, robot.dof, "rad")
    if len(rows) != size:
        raise InvalidInputError(f"seeds must have one row for each of the {size} targets, got {len(rows)}")
    legal = (rows >= robot.lower).all(axis=1) & (rows <= robot.upper).all(axis=1)
    rows = rows.copy()
    notes = [""] * size
    for index in np.flatnonzero(~legal | (np.abs(rows) > seeds.FARTHEST_SEED).any(axis=1)):
        rows[index], notes[index] = seeds.legal_seed(robot, rows[index])
    return rows, notes


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
    from concurrent.futures.process import BrokenProcessPool

    context = multiprocessing.get_context("spawn")  # threads of numba and BLAS do not survive a fork
    try:
        with ProcessPoolExecutor(workers, mp_context=context, initializer=_set_solver, initargs=(solver,)) as pool:
            yield from pool.map(_job_in_process, jobs, chunksize=max(1, len(jobs) // (8 * workers)))
    except BrokenProcessPool as error:
        raise JacokinError(
            "the worker processes did not start: a script that uses workers > 1 must do so under "
            "`if __name__ == '__main__':`, because each worker imports it"
        ) from error


def _set_solver(solver: IKSolver) -> None:
    _process_solver[:] = [solver]


def _job_in_process(job: _Job) -> tuple[int, IKResult]:
    return _job(_process_solver[0], job)


def _job(solver: IKSolver, job: _Job) -> tuple[int, IKResult]:
    index, target, start, closest = job
    return index, solver.solve(target.position if target.position_only else target.matrix, start, closest=closest)
