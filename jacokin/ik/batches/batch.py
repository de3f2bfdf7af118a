"""`solve`: many targets at once, by a compiled loop for poses and single solves for the rest; arrays out.

The solver hands over both ways to solve; nothing here knows which method they use.
"""

from __future__ import annotations

import os
import pickle
import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from jacokin.arrays import Array
from jacokin.chunks.execution import worker_processes
from jacokin.errors import InvalidInputError, JacokinError
from jacokin.ik.results import BatchResult, IKResult, Status
from jacokin.ik.seeds import seed_within_limits
from jacokin.ik.targets import Target, checked_batch
from jacokin.model import checks
from jacokin.model.angles import FARTHEST_SEED
from jacokin.model.poses import FreeAxis
from jacokin.model.robot import Robot

if TYPE_CHECKING:
    from jacokin.ik.solutions.points import BranchTable

CHUNK = 32768  # targets in one compiled call: a quarter of a second, after which workers wait for each other


#: Solves one target as `IKSolver.solve` does; can be pickled, and runs in other processes.
Single = Callable[..., IKResult]


class CompiledAnswers(NamedTuple):
    """What compiled code says about n poses."""

    found: BranchTable
    good: NDArray[np.bool_]
    """(n,) which of the branches are answers; the other poses are left to single solves."""
    touching: NDArray[np.bool_]
    """(n,) which answers are in contact."""
    said: dict[int, tuple[Status, str]]
    """Status and message of answers that have another than success, and none."""


#: Solves poses (n, 4, 4) from seeds (n, dof) on so many threads.
Compiled = Callable[[Array, Array, int], CompiledAnswers]


class Ways(NamedTuple):
    """How targets are solved for."""

    single: Single
    """Whatever is not compiled."""
    compiled: Compiled | None
    """Poses; None for arms without compiled code."""
    note: str
    """That each message has, such as why contact is not looked for; "" for none."""


_Job = tuple[int, Array | FreeAxis, Array, bool]
_single_in_process: list[Single] = []


def solve(
    robot: Robot,
    frame: str,
    ways: Ways,
    targets: Sequence[Target] | ArrayLike,
    seeds: ArrayLike | None,
    *,
    workers: int,
    progress: Callable[[int], None] | None,
    closest: bool,
) -> BatchResult:
    """Solve many targets, as `IKSolver.solve_batch` says; without compiled code, all of them one by one."""
    workers = checks.whole_number("workers", workers, lowest=1)
    closest = checks.flag("closest", closest)
    matrices, position_only, free = checked_batch(targets, frame)
    checks.optional(checks.function, "progress", progress)
    starts, notes = _seeds_within_limits(robot, seeds, len(matrices))
    out = AnswerColumns(len(matrices), robot.dof, notes)
    if ways.note:
        out.message = [f"{each}; {ways.note}" if each else ways.note for each in notes]
    rest = list(range(len(matrices)))
    if ways.compiled is not None:
        apart = position_only.copy()
        apart[list(free)] = True
        rest = _compiled(ways.compiled, matrices, apart, starts, out, workers, progress)

    def target(index: int) -> Array | FreeAxis:
        return free[index] if index in free else matrices[index, :3, 3] if position_only[index] else matrices[index]

    jobs = [(index, target(index), starts[index], closest) for index in rest]
    for index, result in _one_by_one(ways.single, jobs, workers):
        out.put(index, result)
        if progress is not None:
            progress(1)
    return out.result()


def check_picklable(name: str, value: object) -> None:
    """A function that worker processes are to call.

    Raises:
        InvalidInputError: it cannot be pickled.
    """
    try:
        pickle.dumps(value)
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        raise InvalidInputError(
            f"{name} must be picklable for several workers, such as a named function: {error}"
        ) from error


class AnswerColumns:
    """The columns of a batch result while they fill: of `size` targets, with a note on each."""

    def __init__(self, size: int, dof: int, notes: list[str]) -> None:
        """Begin with successes of the closed form at q = 0."""
        self.q = np.zeros((size, dof))
        self.errors = np.zeros((size, 2))
        self.parameter = np.full(size, np.nan)
        self.status: list[Status] = [Status.OK] * size
        self.success = np.ones(size, dtype=np.bool_)
        self.touching = np.zeros(size, dtype=np.bool_)
        self.method = ["closed_form"] * size
        self.message = list(notes)
        self._notes = notes

    def put(self, index: int, result: IKResult) -> None:
        """Take the answer to one target."""
        self.q[index] = result.q
        self.errors[index] = result.position_error, result.orientation_error
        self.method[index], self.touching[index] = result.method, bool(result.touching)
        self.say(index, result.status, result.message)
        if result.parameter is not None:
            self.parameter[index] = result.parameter

    def say(self, index: int, status: Status, message: str) -> None:
        """Set the status of one target, and its message with the note."""
        self.status[index], self.success[index] = status, status is Status.OK
        self.message[index] = f"{message}; {self._notes[index]}" if self._notes[index] else message

    def result(self) -> BatchResult:
        """All of them, read-only."""
        return BatchResult(
            q=checks.read_only(self.q),
            status=tuple(self.status),
            success=checks.sealed(self.success),
            position_error=checks.read_only(self.errors[:, 0]),
            orientation_error=checks.read_only(self.errors[:, 1]),
            method=tuple(self.method),
            message=tuple(self.message),
            parameter=checks.read_only(self.parameter),
            touching=checks.sealed(self.touching),
        )


def _seeds_within_limits(robot: Robot, seeds: ArrayLike | None, size: int) -> tuple[Array, list[str]]:
    """One seed within the limits for each target, and what had to be done to it."""
    given = (
        None if seeds is None else checks.array("seeds", seeds, f"({robot.dof},) or (n, {robot.dof}) numbers", "rad")
    )
    if given is None or given.ndim == 1:
        seed, note = seed_within_limits(robot, given, "seeds")
        return np.tile(seed, (size, 1)), [note] * size
    rows = checks.matrix("seeds", given, robot.dof, "rad")
    if len(rows) != size:
        raise InvalidInputError(f"seeds must have one row for each of the {size} targets, got {len(rows)}")
    within = (rows >= robot.lower).all(axis=1) & (rows <= robot.upper).all(axis=1)
    rows = rows.copy()
    notes = [""] * size
    for index in np.flatnonzero(~within | (np.abs(rows) > FARTHEST_SEED).any(axis=1)):
        rows[index], notes[index] = seed_within_limits(robot, rows[index], f"seeds[{index}]")
    return rows, notes


def _compiled(
    run: Compiled,
    matrices: Array,
    apart: NDArray[np.bool_],
    starts: Array,
    out: AnswerColumns,
    workers: int,
    progress: Callable[[int], None] | None,
) -> list[int]:
    """Poses through the compiled loop; returns the rows it did not settle."""
    rows = np.flatnonzero(~apart)
    left: list[int] = np.flatnonzero(apart).tolist()
    threads = min(workers, os.cpu_count() or 1)
    for first in range(0, len(rows), CHUNK):
        chunk = rows[first : first + CHUNK]
        # A slice, unlike a list of rows, is not copied.
        where = slice(first, first + CHUNK) if len(rows) == len(matrices) else chunk
        found, good, touching, said = run(matrices[where], starts[where], threads)
        settled = chunk[good]
        out.q[settled], out.touching[settled] = found.q[good], touching[good]
        out.errors[settled] = np.column_stack((found.position_error[good], found.orientation_error[good]))
        for row, (status, message) in said.items():
            out.say(int(chunk[row]), status, message)
        left.extend(chunk[~good].tolist())
        if progress is not None and len(settled):
            progress(len(settled))
    return left


def _one_by_one(single: Single, jobs: list[_Job], workers: int) -> Iterator[tuple[int, IKResult]]:
    """What the compiled loop left, one at a time: in this process, or in several."""
    if workers == 1 or len(jobs) < 2 * workers:
        for job in jobs:
            yield _job(single, job)
        return
    pool = worker_processes(min(workers, len(jobs)), _prepare_process, single)
    try:
        # The processes start here and inherit the mask: Ctrl-C is for this process, which then stops them.
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            # At most 4 targets at once for a process: an interrupted batch waits for no more.
            results = pool.map(_job_in_process, jobs, chunksize=min(4, max(1, len(jobs) // (8 * workers))))
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
        yield from results
    except BrokenExecutor as error:
        raise JacokinError(
            "the worker processes did not start: a script that uses workers > 1 must do so under "
            "`if __name__ == '__main__':`, because each worker imports it"
        ) from error
    finally:  # also when the caller is interrupted: only jobs that have begun are waited for
        pool.shutdown(cancel_futures=True)


def _prepare_process(single: Single) -> None:
    _single_in_process[:] = [single]


def _job_in_process(job: _Job) -> tuple[int, IKResult]:
    return _job(_single_in_process[0], job)


def _job(single: Single, job: _Job) -> tuple[int, IKResult]:
    index, target, seed, closest = job
    return index, single(target, seed, closest=closest)
