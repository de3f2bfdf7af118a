"""`solve_file`: a file of targets of any length in, a file of answers out. Read this file first.

The targets are solved in chunks (`chunk`) by workers that read the rows of the file themselves and keep the answers in
a folder beside the output; all that is handed out are small jobs. Meanwhile the finished chunks are put together in
their order (`write_answers`), and the whole takes the name of the output in one step. A run that was killed is
continued from the folder.
"""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import pickle
import shutil
import tempfile
import time
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from numpy.typing import ArrayLike

import jacokin
from jacokin import files
from jacokin.arrays import Array
from jacokin.chunks.execution import (
    Progress,
    checked_executor,
    count_workers,
    heed,
    reporter,
    run_jobs,
    usable_cores,
    worker_processes,
)
from jacokin.chunks.folder import ChunkFolder, Keeper, clear, file_digest, sync, temporary
from jacokin.errors import InvalidInputError, JacokinError
from jacokin.ik.batches.chunk import (
    EMPTY,
    ChunkJob,
    FileSummary,
    RowsInFile,
    Tally,
    make,
    read_stamp,
    read_tally,
)
from jacokin.ik.files.formats import FilePiece, Format, answers_format, targets_format
from jacokin.ik.files.targets import POSITION, FilePart
from jacokin.ik.seeds import seed_within_limits
from jacokin.ik.solver import IKSolver
from jacokin.model import checks
from jacokin.model.robot import fingerprint

ROWS = 8192  # rows of a chunk that the compiled loop solves: about a tenth of a second
CLOSEST_ROWS = 1024  # the same where what is out of reach takes milliseconds: seconds at most
SINGLE_ROWS = 256  # rows of a chunk that is solved row by row: a few seconds
TOGETHER = 16  # consecutive chunks in one job, at most: some seconds of work that is handed out at once
SHARE = 4  # a job has at most this part of what is left for each worker: towards the end, none waits long for another
FOLDER_SUFFIX, SUFFIX = ".chunks", ".chunk"  # of the folder beside the output, and of each chunk in it


def solve_file(
    solver: IKSolver,
    targets: str | Path,
    output: str | Path,
    executor: Executor | None = None,
    resume: bool = True,
    *,
    seed: ArrayLike | None = None,
    closest: bool = True,
    workers: int | None = None,
    progress: Callable[[Progress], None] | None = None,
) -> FileSummary:
    """Solve every target of a file, in any number of runs.

    Columns that are not understood as a part of the target are carried through to the output unchanged, behind the
    answers; orientations under other names are refused. Memory does not grow with the number of targets. Until all
    are solved, chunks are kept in a folder beside the output, named as the output with ".chunks" at its end; a run
    that is killed continues from there when the same is asked for again. Answers do not depend on the chunks, the
    workers, or the order in which they finish.

    Args:
        solver: solves each target; sent to workers pickled.
        targets: a file of targets by the ending of its name: .npz, .npy, .parquet, or else CSV; see `read_targets` for
            the columns.
        output: .csv, .npz or .parquet; replaced in one step when everything is solved.
        executor: any executor; None for threads of this process, or processes where targets go to the QP and workers
            are asked for.
        resume: continue an unfinished run; False starts again.
        seed: (dof,) configuration [rad] that answers stay near to; None for home.
        closest: see `IKSolver.solve`.
        workers: how many threads or processes; None for one for each core (one process for targets without compiled
            code). Not with an executor.
        progress: called when a chunk is finished.

    Returns:
        How many targets have which status; a row that is not finite, or whose quaternion is wrong, is INVALID_TARGET.

    Raises:
        InvalidInputError: a file cannot be read or written, both are the same, columns are missing or cannot be
            carried through (an .npz has names of its own, and takes no Python objects), or the unfinished run was
            about other targets, another robot, other options, or of another version (says which).
        MissingExtraError: Parquet needs pyarrow.
        JacokinError: a worker failed or the disk is full; what is finished is kept.
    """
    checks.instance("solver", solver, IKSolver, "an IKSolver")
    start = None if seed is None else seed_within_limits(solver.robot, seed)[0]
    checks.flag("closest", closest)
    checks.flag("resume", resume)
    checks.optional(checks.function, "progress", progress)
    workers = checks.optional(checks.whole_number, "workers", workers, 1)
    if workers is not None and executor is not None:
        raise InvalidInputError("workers does not go with executor, which has its own")
    checked_executor(executor)
    began = time.perf_counter()
    out = checks.path("output", output)
    with _readable(checks.path("targets", targets)) as source:
        batch = _Batch.of(solver, source, out, start, closest=closest)
        with (
            _folder(out, batch.recipe(), len(batch.parts), resume=resume) as (final, folder),
            _working(executor, workers, batch.compiled) as ready,
        ):
            finished = folder.finished()
            resumed = sum(batch.parts[index].rows for index in finished)
            missing = [index for index in range(len(batch.parts)) if index not in finished]
            show = reporter(progress, batch.total, resumed)

            def chunks() -> Generator[tuple[int, Path], None, None]:
                yield from finished.items()
                for index, kept in batch.solve(missing, folder.keeper, ready):
                    path = folder.put(index, kept)
                    show(batch.parts[index].rows)
                    yield index, path

            with contextlib.closing(chunks()) as found:
                tally = write_answers(batch, folder, final, found)
    return tally.summary(time.perf_counter() - began, batch.carried, resumed=resumed, output=out)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Batch:
    """What is to be solved, and in which chunks.

    Attributes:
        solver: solves each target.
        source: the file of targets.
        suffix: of the file of answers.
        answers: its format.
        columns: names of the columns of a target.
        carried: names of the columns that are carried through.
        seed: (dof,) [rad], or None for home.
        closest: see `IKSolver.solve`.
        compiled: whether a compiled loop solves them.
        size: rows of a chunk.
        parts: the rows, chunk by chunk.
    """

    solver: IKSolver
    source: Path
    suffix: str
    answers: Format
    columns: tuple[str, ...]
    carried: tuple[str, ...]
    seed: Array | None
    closest: bool
    compiled: bool
    size: int
    parts: Sequence[FilePart]

    @classmethod
    def of(cls, solver: IKSolver, source: Path, output: Path, seed: Array | None, *, closest: bool) -> Self:
        """The batch of a file of targets, which is read to its end; errors of files as `solve_file`."""
        form = targets_format(source)
        first = next(form.blocks(source, 1))
        carried = tuple(first.carried)
        answers = answers_format(output, carried)
        final = None if files.is_device(output) else files.writable(output)
        if source.is_file() and final is not None and final.exists() and final.samefile(source):
            raise InvalidInputError(f"output {output} is the file of targets: they would be lost")
        compiled = solver.is_compiled and first.columns != POSITION
        size = (CLOSEST_ROWS if closest else ROWS) if compiled else SINGLE_ROWS
        return cls(
            solver=solver,
            source=source,
            suffix=output.suffix or ".csv",
            answers=answers,
            columns=first.columns,
            carried=carried,
            seed=seed,
            closest=closest,
            compiled=compiled,
            size=size,
            parts=form.parts(source, size),
        )

    @property
    def total(self) -> int:
        """How many targets there are."""
        return sum(part.rows for part in self.parts)

    @property
    def names(self) -> list[str]:
        """Of the columns of the targets and q1, q2, ..."""
        return [*self.columns, *(f"q{joint + 1}" for joint in range(self.solver.robot.dof))]

    def recipe(self) -> dict[str, object]:
        """All that the answers depend on."""
        solver, tool, chosen = self.solver, self.solver.tool, self.solver.verifier.options
        options = {field.name: getattr(chosen, field.name) for field in dataclasses.fields(chosen)}
        options |= {
            "scene": None if chosen.scene is None else chosen.scene.surroundings.fingerprint,
            "frame": solver.frame,
            "tool": None if tool is None else tool.homogeneous.tolist(),
            "seed": None if self.seed is None else self.seed.tolist(),
            "closest": self.closest,
            "format": self.suffix,
            "rows of a chunk": self.size,
        }
        same = fingerprint(solver.robot, shapes=solver.verifier.looks_for_contact)
        return {
            "version": jacokin.__version__,
            "targets": {"rows": self.total, "sha256": file_digest(self.source)},
            "robot": {"name": solver.robot.name, "sha256": same},
            "options": options,
        }

    def solve(self, missing: Sequence[int], keeper: Keeper, executor: Executor) -> Iterator[tuple[int, str | bytes]]:
        """Number and what was kept of every missing chunk; errors as `solve_chunks`."""
        job = functools.partial(
            ChunkJob,
            version=jacokin.__version__,
            solver=pickle.dumps(self.solver),
            seed=self.seed,
            closest=self.closest,
            suffix=self.suffix,
            keeper=keeper,
        )
        return solve_chunks(job, self.source, self.parts, self.size, missing, executor, several=self.compiled)


def solve_chunks(
    job: Callable[..., ChunkJob],
    source: Path,
    parts: Sequence[FilePart],
    size: int,
    missing: Sequence[int],
    executor: Executor,
    *,
    several: bool,
) -> Iterator[tuple[int, str | bytes]]:
    """Number and what was kept of every missing chunk, in the order in which they finish.

    Args:
        job: makes a job of the number of its `first` chunk and its `rows`.
        source: the file of targets.
        parts: its rows, chunk by chunk.
        size: rows of a chunk.
        missing: numbers of chunks, rising.
        executor: makes them.
        several: whether a job may have several chunks.

    Raises:
        InvalidInputError: the file has changed, or cannot be read.
        JacokinError: a job failed, or the executor did.
    """
    stamp = read_stamp(source.absolute())
    if stamp is not None and parts[0].can_be_read:
        runs = list(_runs(missing, SHARE * count_workers(executor) if several else len(missing)))
        jobs = (
            (number, job(first=run[0], rows=RowsInFile(stamp, size, tuple(parts[i] for i in run))))
            for number, run in enumerate(runs)
        )
        unseen = []
        for number, kept in run_jobs(make, jobs, executor):
            if kept is None:
                unseen += runs[number]
            else:
                yield from zip(runs[number], kept, strict=True)
        missing = sorted(unseen)
    if missing:
        if read_stamp(source.absolute()) != stamp:
            raise InvalidInputError(f"{source}: has changed since the batch began")
        wanted = frozenset(missing)
        blocks = enumerate(targets_format(source).blocks(source, size))
        jobs = ((index, job(first=index, rows=block)) for index, block in blocks if index in wanted)
        for number, kept in run_jobs(make, jobs, executor):
            assert kept is not None  # the rows come with the job
            yield number, kept[0]


def _runs(numbers: Sequence[int], shares: int) -> Iterator[list[int]]:
    """Consecutive numbers, in each run at most one of so many shares of those that are left."""
    first = 0
    while first < len(numbers):
        most = min(TOGETHER, max(1, (len(numbers) - first) // shares))
        stop = first + 1
        while stop < min(first + most, len(numbers)) and numbers[stop] == numbers[stop - 1] + 1:
            stop += 1
        yield list(numbers[first:stop])
        first = stop


def write_answers(batch: _Batch, folder: ChunkFolder, final: Path, chunks: Iterator[tuple[int, Path]]) -> Tally:
    """Write the file of answers, beside it and in one step; returns the counts of all rows.

    Args:
        batch: what is solved.
        folder: of the chunks.
        final: the file; where it is a device, nothing is written before all chunks are there.
        chunks: number and file of each, in any order; they are made as they are asked for.

    Raises:
        JacokinError: it cannot be written; and whatever making a chunk raises.
    """
    tally, waiting = EMPTY, dict[int, Path]()

    def pieces() -> Iterator[FilePiece]:
        nonlocal tally
        for number in range(folder.count):
            while number not in waiting:
                index, made = next(chunks)
                waiting[index] = made
            path = waiting.pop(number)
            counts, offset = read_tally(path)
            tally += counts
            yield path, offset

    write = functools.partial(batch.answers.write_joined, columns=batch.names, carried=batch.carried)
    try:
        if files.is_device(final):
            ready = list(pieces())
            with files.replacing(final) as stream:
                write(stream, ready)
            return tally
        with temporary(folder.path) as whole:
            write(whole, pieces())
            sync(whole)
            if final.exists():
                shutil.copymode(final, whole)
            whole.replace(final)
    except OSError as error:
        raise JacokinError(
            f"{final}: cannot be written: {error.strerror or error}; what is solved is kept, run it again"
        ) from error
    return tally


@contextlib.contextmanager
def _readable(targets: Path) -> Iterator[Path]:
    """A file that can be read several times: a copy of what comes from a pipe."""
    if not files.is_pipe(targets):
        yield targets
        return
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / f"targets{targets.suffix}"
        try:
            with copy.open("wb") as file:
                file.writelines(files.pieces(targets, files.PIPED))
        except OSError as error:
            raise InvalidInputError(f"{targets}: cannot be copied to {folder}: {error.strerror}") from error
        yield copy


def folder_of(final: Path) -> Path:
    """Where the finished chunks of an output are."""
    return final.with_name(f"{final.name}{FOLDER_SUFFIX}")


@contextlib.contextmanager
def _folder(out: Path, recipe: dict[str, object], count: int, *, resume: bool) -> Iterator[tuple[Path, ChunkFolder]]:
    """The path of the output, links followed, and the folder of its chunks, which is this process's own.

    The folder is removed in the end; where the block fails, only if it holds no finished chunk.
    """
    if files.is_device(out):
        with tempfile.TemporaryDirectory() as temporary_folder:
            yield out, ChunkFolder(Path(temporary_folder), recipe, count, SUFFIX)
        return
    final = files.writable(out)
    if not final.parent.is_dir():
        raise InvalidInputError(f"{out}: cannot be written: there is no folder {final.parent}")
    path = folder_of(final)
    if not resume:
        clear(path)
    is_new = not path.exists()
    try:
        folder = ChunkFolder(path, recipe, count, SUFFIX)
        with folder.locked():
            yield final, folder
            folder.remove()
    except (KeyboardInterrupt, SystemExit):  # a signal, perhaps while the folder was made
        if is_new and not any(path.glob(f"*{SUFFIX}")):
            shutil.rmtree(path, ignore_errors=True)
        raise


@contextlib.contextmanager
def _working(executor: Executor | None, workers: int | None, compiled: bool) -> Iterator[Executor]:
    """The executor, or one of this process that ends with the block."""
    if executor is not None:
        yield executor
        return
    if compiled or workers in (None, 1):
        with ThreadPoolExecutor(workers or (usable_cores() if compiled else 1)) as own:
            yield own
        return
    import multiprocessing  # not for who solves in this process

    stop = multiprocessing.get_context("spawn").Event()
    processes = worker_processes(workers or 1, heed, stop)
    try:
        yield processes
    finally:
        stop.set()  # where the block failed, nobody waits for what has begun
        processes.shutdown(cancel_futures=True)
