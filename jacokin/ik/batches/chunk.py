"""One chunk of a file of targets: solved, counted and written as bytes, in whatever process."""

from __future__ import annotations

import functools
import pickle
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import CancelledError, Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
import orjson

import jacokin
from jacokin.arrays import Array
from jacokin.chunks.execution import is_stopped
from jacokin.chunks.folder import Keeper
from jacokin.errors import JacokinError
from jacokin.ik.batches.batch import AnswerColumns
from jacokin.ik.files.formats import answers_format, targets_format
from jacokin.ik.files.targets import FilePart, TargetFile
from jacokin.ik.results import BatchResult, Frozen, Status
from jacokin.ik.solver import IKSolver

KEPT_FAILURES = 20  # rows whose message is in the summary; the file of answers has them all


class FileStamp(NamedTuple):
    """What tells a file from another one, or from itself after a change."""

    path: Path
    size: int
    """[bytes]"""
    modified: int
    """[s] since 1970; file systems of other machines may not know it any better."""


def read_stamp(path: Path) -> FileStamp | None:
    """The stamp of a file; None if it is not there."""
    try:
        stat = path.stat()
    except OSError:
        return None
    return FileStamp(path, stat.st_size, int(stat.st_mtime))


class RowsInFile(NamedTuple):
    """Rows that the worker reads, where it sees the file."""

    stamp: FileStamp
    size: int
    """Rows of a chunk."""
    parts: tuple[FilePart, ...]
    """One for each chunk, consecutive."""


@dataclass(frozen=True, slots=True)
class ChunkJob:
    """All that some consecutive chunks depend on; can be sent to other machines.

    Attributes:
        version: of jacokin, which has to be that of the worker.
        solver: an `IKSolver`, pickled.
        seed: (dof,) [rad], or None for home.
        closest: see `IKSolver.solve`.
        suffix: format of the answers.
        keeper: where the chunks are kept.
        first: number of the first chunk.
        rows: the targets; those of one chunk themselves where the worker does not see the file, or cannot read it from
            the middle.
    """

    version: str
    solver: bytes
    seed: Array | None
    closest: bool
    suffix: str
    keeper: Keeper
    first: int
    rows: RowsInFile | TargetFile


def make(job: ChunkJob) -> list[str | bytes] | None:
    """Solve and keep the chunks: counts of the rows on one line of JSON, and then their answers in the format.

    Returns:
        What `Keeper.keep` returned for each; None where this machine does not see the file of targets.

    Raises:
        JacokinError: this process has another version of jacokin, or the disk is full.
        InvalidInputError: the file cannot be read.
        CancelledError: who waits for it has stopped, see `is_stopped`; chunks before are kept.
    """
    if job.version != jacokin.__version__:
        raise JacokinError(f"the worker has jacokin {jacokin.__version__}, and the batch needs {job.version}")
    rows = job.rows
    if not _is_there(rows):
        return None
    blocks: Iterable[TargetFile] = (rows,) if isinstance(rows, TargetFile) else _blocks_of(rows)
    solver, answers = unpickled_solver(job.solver), answers_format(Path(f"_{job.suffix}"))
    kept: list[Future[str | bytes]] = []
    with ThreadPoolExecutor(1) as writer:  # the disk is waited for while the next chunk is solved
        for index, targets in enumerate(blocks, job.first):
            batch = solve_rows(solver, targets, job.seed, closest=job.closest, progress=_go_on)
            content = orjson.dumps(count_rows(targets, batch).document()) + b"\n" + answers.encode(targets, batch)
            if kept:
                kept[-1].result()
            if not _is_there(rows):  # changed while it was read
                return None
            kept.append(writer.submit(job.keeper.keep, index, content))
        return [each.result() for each in kept]


def _go_on(rows: int) -> None:
    """Go on after some rows.

    Raises:
        CancelledError: the work is to stop.
    """
    if is_stopped():
        raise CancelledError


def _blocks_of(rows: RowsInFile) -> Iterator[TargetFile]:
    path = rows.stamp.path
    return targets_format(path).blocks(path, rows.size, rows.parts)


def _is_there(rows: RowsInFile | TargetFile) -> bool:
    return isinstance(rows, TargetFile) or read_stamp(rows.stamp.path) == rows.stamp


def solve_rows(
    solver: IKSolver,
    targets: TargetFile,
    seed: Array | None,
    *,
    closest: bool = True,
    workers: int = 1,
    progress: Callable[[int], None] | None = None,
) -> BatchResult:
    """Answers to the rows that are targets; the status of the others says that they are not."""
    solve = functools.partial(solver.solve_batch, workers=workers, closest=closest, progress=progress)
    problems = targets.problems
    if not problems:
        return solve(targets.targets, seed)
    out = AnswerColumns(len(targets), solver.robot.dof, [problems.get(row, "") for row in range(len(targets))])
    for row in problems:
        out.q[row] = out.errors[row] = np.nan
        out.status[row], out.method[row], out.success[row] = Status.INVALID_TARGET, "", False
    good = np.setdiff1d(np.arange(len(targets)), list(problems))
    if len(good):
        found = solve(targets.targets[good], seed)
        out.q[good], out.success[good], out.touching[good] = found.q, found.success, found.touching
        out.errors[good] = np.column_stack([found.position_error, found.orientation_error])
        for index, row in enumerate(good.tolist()):
            out.status[row], out.method[row] = found.status[index], found.method[index]
            out.message[row] = found.message[index]
    return out.result()


@functools.lru_cache(maxsize=4)
def unpickled_solver(pickled: bytes) -> IKSolver:
    """The solver of a job, built once in each process."""
    solver = pickle.loads(pickled)
    assert isinstance(solver, IKSolver)
    return solver


@dataclass(frozen=True, slots=True)
class Tally:
    """Counts of some rows."""

    statuses: Counter[Status]
    worst: tuple[float | None, float | None]
    """Largest position [m] and orientation error [rad] among the solved rows; None without any."""
    failures: tuple[tuple[int, Status, str], ...]

    @property
    def count(self) -> int:
        """Rows in all."""
        return sum(self.statuses.values())

    def __add__(self, other: Tally) -> Tally:
        """These rows, and then the others."""
        return Tally(
            self.statuses + other.statuses,
            (_larger(self.worst[0], other.worst[0]), _larger(self.worst[1], other.worst[1])),
            (*self.failures, *other.failures)[:KEPT_FAILURES],
        )

    def summary(
        self, seconds: float, carried: tuple[str, ...], *, resumed: int = 0, output: Path | None = None
    ) -> FileSummary:
        """The outcome of a file of these rows; the arguments are fields of it."""
        statuses = MappingProxyType(dict(self.statuses))
        return FileSummary(self.count, statuses, *self.worst, self.failures, resumed, seconds, output, carried)

    def document(self) -> dict[str, object]:
        """The counts in the types of JSON, which `read_tally` reads."""
        return {
            "statuses": {status.name: count for status, count in self.statuses.items()},
            "worst": self.worst,
            "failures": [(line, status.name, message) for line, status, message in self.failures],
        }


EMPTY = Tally(Counter(), (None, None), ())


def count_rows(targets: TargetFile, batch: BatchResult) -> Tally:
    """The counts of some targets and their answers."""
    position, orientation = batch.position_error[batch.success], batch.orientation_error[batch.success]
    worst = (float(position.max()), float(orientation.max())) if len(position) else (None, None)
    failed = np.flatnonzero(~batch.success)[:KEPT_FAILURES]
    failures = tuple((int(targets.lines[row]), batch.status[row], batch.message[row]) for row in failed)
    counts = {status: batch.status.count(status) for status in Status}
    return Tally(+Counter(counts), worst, failures)


def _larger(*errors: float | None) -> float | None:
    return max((error for error in errors if error is not None), default=None)


def read_tally(path: Path) -> tuple[Tally, int]:
    """The counts at the beginning of a finished chunk, and where its answers begin."""
    with path.open("rb") as file:
        line = file.readline()
    document: dict[str, Any] = orjson.loads(line)  # Any: JSON
    tally = Tally(
        Counter({Status[name]: count for name, count in document["statuses"].items()}),
        (document["worst"][0], document["worst"][1]),
        tuple((line, Status[name], message) for line, name, message in document["failures"]),
    )
    return tally, len(line)


@dataclass(frozen=True, slots=True, repr=False)
class FileSummary(Frozen):
    """The outcome of a file of targets."""

    targets: int
    """How many there are."""
    statuses: Mapping[Status, int] = field(hash=False)
    """How many have each status."""
    worst_position_error: float | None
    """The largest among the solved ones [m]; None if there are none."""
    worst_orientation_error: float | None
    """The largest orientation error among the solved ones [rad]; None if there are none."""
    failures: tuple[tuple[int, Status, str], ...]
    """Line (of a CSV file) or row, status and message of the first ones that are not solved."""
    resumed: int
    """How many of the targets had been solved before, in a run that did not end."""
    seconds: float
    """Time that the rest took [s]."""
    output: Path | None
    """The file of answers."""
    carried: tuple[str, ...]
    """Names of the columns that are carried through."""

    def __repr__(self) -> str:
        """How many targets have which status, and where the answers are."""
        counts = ", ".join(f"{count} {status.name}" for status, count in self.statuses.items())
        return f"FileSummary({self.targets} targets: {counts}; {self.seconds:.3g} s, output {str(self.output)!r})"

    @property
    def solved(self) -> int:
        """How many reach their target."""
        return self.statuses.get(Status.OK, 0)
