"""`solve_file`: a file of targets of any length in, a file of answers out. Read this file first.

The targets are solved in chunks (`chunk`) by workers that read the rows of the file themselves and keep the answers in
a folder beside the output; all that is handed out are recipes (`jobs`). Meanwhile the finished chunks are put together
in their order (`joining`), and the whole takes the name of the output in one step. Whoever is killed goes on from the
folder.
"""

from __future__ import annotations

import contextlib
import dataclasses
import fcntl
import functools
import pickle
import shutil
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import Executor, ThreadPoolExecutor
from functools import partial
from pathlib import Path

from numpy.typing import ArrayLike

import jacokin
from jacokin import files
from jacokin.arrays import Array
from jacokin.chunks.execution import checked_executor, usable_cores
from jacokin.chunks.folder import ChunkFolder, file_digest
from jacokin.chunks.keeping import RECIPE, digest
from jacokin.chunks.processes import worker_processes
from jacokin.errors import InvalidInputError
from jacokin.ik.batches import joining
from jacokin.ik.batches.jobs import Batch
from jacokin.ik.batches.progress import Progress, reporter
from jacokin.ik.batches.summary import FileSummary
from jacokin.ik.files import formats
from jacokin.ik.files.columns import POSITION
from jacokin.ik.seeds import seed_within_limits
from jacokin.ik.solver import IKSolver
from jacokin.model import checks
from jacokin.model.fingerprint import fingerprint

ROWS = 8192  # rows of a chunk that the compiled loop solves: about a tenth of a second
SINGLE_ROWS = 256  # rows of a chunk that is solved row by row: a few seconds
FOLDER_SUFFIX = ".chunks"


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

    Memory does not grow with the number of targets. Until all are solved, chunks are kept in a folder beside the
    output, named as the output with ".chunks" at its end; a run that is killed continues from there when the same is
    asked for again. Answers do not depend on the chunks, the workers, or the order in which they finish.

    Args:
        solver: solves each target; sent to workers pickled.
        targets: a file of targets by the ending of its name: .npz, .parquet, or else CSV; see `read_targets` for the
            columns.
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
        InvalidInputError: a file cannot be read or written, both are the same, columns are missing, or the unfinished
            run was about other targets, another robot, other options, or of another version (says which).
        MissingExtraError: Parquet needs pyarrow.
        JacokinError: a worker failed or the disk is full; what is finished is kept.
    """
    if not isinstance(solver, IKSolver):
        raise InvalidInputError(f"solver must be an IKSolver, got {checks.shown(solver)}")
    start = None if seed is None else seed_within_limits(solver.robot, seed)[0]
    checks.flag("closest", closest)
    checks.flag("resume", resume)
    if progress is not None and not callable(progress):
        raise InvalidInputError(f"progress must be callable, got {checks.shown(progress)}")
    if workers is not None:
        workers = checks.whole_number("workers", workers, lowest=1)
        if executor is not None:
            raise InvalidInputError("workers does not go with executor, which has its own")
    checked_executor(executor)
    own: Executor | None = None
    began = time.perf_counter()
    with contextlib.ExitStack() as stack:
        source = _source(stack, _path("targets", targets))
        out = _path("output", output)
        layout = formats.answers(out)
        if source.is_file() and out.is_file() and out.samefile(source):
            raise InvalidInputError(f"output {out} is the file of targets: they would be lost")
        columns = next(formats.blocks(source, 1)).columns
        compiled = solver.has_closed_form and solver.verifier.options.collision == "ignore" and columns != POSITION
        rows = ROWS if compiled else SINGLE_ROWS
        parts = formats.parts(source, rows)
        total = sum(part.rows for part in parts)
        recipe = _recipe(solver, source, total, rows, start, closest, out.suffix)
        final, folder = _folder(stack, out, recipe, len(parts), resume=resume)
        finished = folder.finished()
        resumed = sum(parts[index].rows for index in finished)
        missing = [index for index in range(len(parts)) if index not in finished]
        if executor is None and missing:
            executor = own = _executor(workers, compiled)
        names = [*columns, *(f"q{joint + 1}" for joint in range(solver.robot.dof))]
        write = functools.partial(joining.write, layout, folder, final, names)
        try:
            with joining.Joining(write, len(parts), at_once=files.is_device(final)) as joined:
                for index, path in finished.items():
                    joined.add(index, path)
                if executor is not None:
                    batch = Batch(solver, source, parts, rows, start, closest, out.suffix)
                    show = reporter(progress, total, resumed)
                    for index, kept in batch.solved(missing, folder.keeper, executor, several=compiled):
                        joined.add(index, folder.put(index, kept))
                        show(parts[index].rows)
                tally = joined.finish()
        except BaseException:
            if own is not None:
                own.shutdown(cancel_futures=True)  # what has begun may still be kept
            if folder.is_empty():
                folder.remove()
            raise
        finally:
            if own is not None:
                own.shutdown()
        folder.remove()
    seconds = time.perf_counter() - began
    return FileSummary(tally.count, dict(tally.statuses), *tally.worst, tally.failures, resumed, seconds, out)


def unfinished(output: Path) -> Path | None:
    """The folder of a run that was to write `output` and did not end; None without one."""
    folder = _folder_of(files.writable(output))
    return folder if folder.is_dir() else None


def _path(name: str, value: str | Path) -> Path:
    if not isinstance(value, str | Path) or not str(value):
        raise InvalidInputError(f"{name} must be a str or a Path, got {checks.shown(value)}")
    return Path(value)


def _source(stack: contextlib.ExitStack, targets: Path) -> Path:
    """A file that can be read several times: a copy of what comes from a pipe."""
    if not files.is_device(targets):
        return targets
    copy = Path(stack.enter_context(tempfile.TemporaryDirectory())) / f"targets{targets.suffix}"
    try:
        with targets.open("rb") as source, copy.open("wb") as file:
            shutil.copyfileobj(source, file)
    except OSError as error:
        raise InvalidInputError(f"{targets}: cannot be read: {error.strerror}") from error
    return copy


def _recipe(
    solver: IKSolver, targets: Path, count: int, rows: int, seed: Array | None, closest: bool, suffix: str
) -> dict[str, object]:
    """All that the answers depend on."""
    tool, chosen = solver.tool, solver.verifier.options
    options = {field.name: getattr(chosen, field.name) for field in dataclasses.fields(chosen)}
    options |= {
        "scene": None if chosen.scene is None else digest(pickle.dumps(chosen.scene)),
        "frame": solver.frame,
        "tool": None if tool is None else tool.homogeneous.tolist(),
        "seed": None if seed is None else seed.tolist(),
        "closest": closest,
        "format": suffix,
        "rows of a chunk": rows,
    }
    same = fingerprint(solver.robot, shapes=chosen.collision != "ignore")
    return {
        "version": jacokin.__version__,
        "targets": {"rows": count, "sha256": file_digest(targets)},
        "robot": {"name": solver.robot.name, "sha256": same},
        "options": options,
    }


def _folder_of(final: Path) -> Path:
    return final.with_name(f"{final.name}{FOLDER_SUFFIX}")


def _folder(
    stack: contextlib.ExitStack, out: Path, recipe: dict[str, object], count: int, *, resume: bool
) -> tuple[Path, ChunkFolder]:
    """The path of the output, links followed, and the folder of its chunks, which is this process's own."""
    if files.is_device(out):
        return out, ChunkFolder(Path(stack.enter_context(tempfile.TemporaryDirectory())), recipe, count, ".chunk")
    final = files.writable(out)
    if not final.parent.is_dir():
        raise InvalidInputError(f"{out}: cannot be written: there is no folder {final.parent}")
    path = _folder_of(final)
    if not resume and (path / RECIPE).exists():
        shutil.rmtree(path)
    if not path.exists():
        stack.push(partial(_remove_new, path))
    folder = ChunkFolder(path, recipe, count, ".chunk")
    lock = stack.enter_context((path / RECIPE).open("rb"))
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        raise InvalidInputError(f"{path}: another process is working on it") from error
    return final, folder


def _remove_new(path: Path, kind: type[BaseException] | None, *_: object) -> None:
    """A signal while the folder is made, or before its first chunk is there, leaves nothing."""
    if kind is not None and not issubclass(kind, Exception) and not any(path.glob("*.chunk")):
        shutil.rmtree(path, ignore_errors=True)


def _executor(workers: int | None, compiled: bool) -> Executor:
    if compiled:
        return ThreadPoolExecutor(usable_cores() if workers is None else workers)
    return ThreadPoolExecutor(1) if workers in (None, 1) else worker_processes(workers or 1)
