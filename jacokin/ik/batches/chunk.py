"""One chunk of a file of targets: solved, counted and written as bytes, in whatever process."""

from __future__ import annotations

import functools
import pickle
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import orjson

import jacokin
from jacokin.arrays import Array
from jacokin.errors import JacokinError
from jacokin.ik.batches.summary import Tally
from jacokin.ik.files import formats
from jacokin.ik.files.target_rows import TargetFile
from jacokin.ik.results import BatchResult, Status
from jacokin.ik.solver import IKSolver
from jacokin.model import checks


@dataclass(frozen=True, slots=True)
class ChunkJob:
    """All that a chunk depends on; can be sent to other machines.

    Attributes:
        version: of jacokin, which has to be that of the worker.
        solver: an `IKSolver`, pickled.
        seed: (dof,) [rad], or None for home.
        closest: see `IKSolver.solve`.
        suffix: format of the answers.
        targets: the rows.
    """

    version: str
    solver: bytes
    seed: Array | None
    closest: bool
    suffix: str
    targets: TargetFile


def make(job: ChunkJob) -> bytes:
    """Counts of the rows on one line of JSON, and then their answers in the format.

    Raises:
        JacokinError: this process has another version of jacokin.
    """
    if job.version != jacokin.__version__:
        raise JacokinError(f"the worker has jacokin {jacokin.__version__}, and the batch needs {job.version}")
    batch = solve_rows(unpickled_solver(job.solver), job.targets, job.seed, closest=job.closest)
    tally = orjson.dumps(Tally.of_rows(job.targets, batch).document())
    return tally + b"\n" + formats.answers(Path(f"_{job.suffix}")).encoded(job.targets, batch)


def read_tally(path: Path) -> tuple[Tally, int]:
    """The counts at the beginning of a finished chunk, and where its answers begin."""
    with path.open("rb") as file:
        line = file.readline()
    return Tally.of_document(orjson.loads(line)), len(line)


def solve_rows(
    solver: IKSolver, targets: TargetFile, seed: Array | None, *, closest: bool = True, workers: int = 1
) -> BatchResult:
    """Answers to the rows that are targets; the status of the others says that they are not."""
    if not targets.problems:
        return solver.solve_batch(targets.targets, seed, workers=workers, closest=closest)
    size, dof = len(targets), solver.robot.dof
    good = np.ones(size, dtype=np.bool_)
    good[list(targets.problems)] = False
    q, errors = np.full((size, dof), np.nan), np.full((size, 2), np.nan)
    status, method, message = [Status.INVALID_TARGET] * size, [""] * size, [""] * size
    for row, problem in targets.problems.items():
        message[row] = problem
    if good.any():
        found = solver.solve_batch(targets.targets[good], seed, workers=workers, closest=closest)
        q[good] = found.q
        errors[good] = np.column_stack([found.position_error, found.orientation_error])
        for index, row in enumerate(np.flatnonzero(good).tolist()):
            status[row], method[row], message[row] = found.status[index], found.method[index], found.message[index]
    success = np.array([each is Status.OK for each in status])
    success.setflags(write=False)
    return BatchResult(
        q=checks.read_only(q),
        status=tuple(status),
        success=success,
        position_error=checks.read_only(errors[:, 0]),
        orientation_error=checks.read_only(errors[:, 1]),
        method=tuple(method),
        message=tuple(message),
    )


@functools.lru_cache(maxsize=4)
def unpickled_solver(pickled: bytes) -> IKSolver:
    """The solver of a job, built once in each process."""
    solver = pickle.loads(pickled)
    assert isinstance(solver, IKSolver)
    return solver
