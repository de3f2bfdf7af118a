"""`jacokin ik --targets FILE`: a file of poses in, a file of joint angles out."""

from __future__ import annotations

import contextlib
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import click
import numpy as np

from jacokin import files, ik
from jacokin.chunks.execution import dask_executor
from jacokin.cli import display
from jacokin.cli.display import progress_bar
from jacokin.cli.groups import BatchOptions
from jacokin.cli.units import Units, warn_of_degrees
from jacokin.ik.batches.chunk import EMPTY, count_rows, solve_rows
from jacokin.ik.batches.solve_file import folder_of, solve_file
from jacokin.ik.files.formats import targets_format
from jacokin.ik.files.targets import RPY, as_objects, left_behind


def run(
    solver: ik.IKSolver,
    targets: Path,
    given: BatchOptions,
    seed: list[float] | None,
    *,
    closest: bool,
    as_json: bool,
) -> bool:
    """Solve every row of a file, the targets of the options; returns whether all of them are solved.

    Raises:
        InvalidInputError: the targets cannot be read or the output not written; nothing is solved then.
    """
    results: list[dict[str, object]] = []
    if targets.is_file():
        form = targets_format(targets)
        first = next(form.blocks(targets, 1000))
        if first.columns[3:] == RPY:
            widest = float(np.nanmax(np.abs(first.values[:, 3:]), initial=0.0))
            what = display.printable(f"{targets}: roll, pitch, yaw")
            warn_of_degrees(what, [widest], Units(degrees=False), advice="files hold no degrees")
        lost = left_behind(form.read_names(targets))
        if lost:
            text = display.printable(f"{targets}: columns not carried through: {', '.join(lost)}")
            click.echo(f"jacokin: note: {text}", err=True)
    out = given.output
    if out is None:
        if not as_json:
            click.echo("jacokin: note: the answers are counted, not saved: --output FILE keeps them", err=True)
        summary = _solve_for_display(
            solver, targets, seed, given.workers, results if as_json else None, closest=closest
        )
    else:
        cluster = contextlib.nullcontext() if given.dask is None else dask_executor(given.dask)
        with _told_to_go_on(out), progress_bar("solving") as show, cluster as executor:
            summary = solve_file(
                solver,
                targets,
                out,
                executor,
                given.resume is not False,
                seed=seed,
                closest=closest,
                workers=given.workers if executor is None else None,
                progress=lambda so_far: show(so_far.done, so_far.total),
            )
    # Where the answers go to stdout, they are alone there.
    is_taken = out is not None and files.open_file(out) == 1  # the descriptor of stdout
    with contextlib.redirect_stdout(sys.stderr if is_taken else sys.stdout):
        if as_json:
            display.print_json(_document(solver, summary, results))
        else:
            _show(solver, summary, closest=closest)
    return summary.solved == summary.targets


@contextlib.contextmanager
def _told_to_go_on(out: Path) -> Iterator[None]:
    """Say after Ctrl-C what is kept."""
    try:
        yield
    except KeyboardInterrupt:
        kept = folder_of(out.resolve())
        if kept.is_dir():
            click.echo(f"jacokin: {kept} has what is solved: the same command goes on from there", err=True)
        raise


def _solve_for_display(
    solver: ik.IKSolver,
    targets: Path,
    seed: list[float] | None,
    workers: int,
    results: list[dict[str, object]] | None,
    *,
    closest: bool,
) -> ik.FileSummary:
    """Solve without a file of answers; keep the rows in `results` if they are wanted."""
    started = time.perf_counter()
    tally = EMPTY
    start = None if seed is None else np.array(seed)
    with progress_bar("solving") as show:
        for block in targets_format(targets).blocks(targets, 4096):  # solved at a time where no file is written
            batch = solve_rows(solver, block, start, closest=closest, workers=workers)
            tally += count_rows(block, batch)
            if results is not None:
                results += _documents(block, batch)
            show(tally.count, None)
    return tally.summary(time.perf_counter() - started, tuple(block.carried))


def _documents(targets: ik.TargetFile, batch: ik.BatchResult) -> Iterator[dict[str, object]]:
    others = {name: as_objects(column) for name, column in targets.carried.items()}
    for row in range(len(targets)):
        yield {
            "line": int(targets.lines[row]),
            "status": batch.status[row],
            "q": batch.q[row],
            "position_error": batch.position_error[row],
            "orientation_error": batch.orientation_error[row],
            "method": batch.method[row],
            "message": batch.message[row],
            "carried": {name: values[row] for name, values in others.items()},
        }


def _document(solver: ik.IKSolver, found: ik.FileSummary, results: list[dict[str, object]]) -> dict[str, object]:
    """The summary; the answers too when no file holds them."""
    summary: dict[str, object] = {
        **display.identity(solver.robot),
        "frame": solver.frame,
        "joint_names": solver.robot.joint_names,
        "angle_unit": "rad",
        "targets": found.targets,
        "solved": found.solved,
        "resumed": found.resumed,
        "seconds": found.seconds,
        "statuses": {status.name: count for status, count in found.statuses.items()},
        "worst_position_error": found.worst_position_error,
        "worst_orientation_error": found.worst_orientation_error,
        "output": None if found.output is None else str(found.output),
        "carried": found.carried,
    }
    if found.output is None:
        summary["results"] = results
    return summary


def _show(solver: ik.IKSolver, found: ik.FileSummary, *, closest: bool) -> None:
    lines = [
        ("solved", f"{found.solved} of {found.targets} ({100.0 * found.solved / found.targets:.1f} %)"),
        ("time", f"{found.seconds:.3f} s, {(found.targets - found.resumed) / found.seconds:.0f} poses/s"),
    ]
    for name, unit, worst in (
        ("worst position error", "m", found.worst_position_error),
        ("worst orientation error", "rad", found.worst_orientation_error),
    ):
        if worst is not None:
            lines.append((name, display.small(worst, unit)))
    lines += [
        (status.name, f"{count}: {status.value}") for status, count in found.statuses.items() if status.name != "OK"
    ]
    if found.solved < found.targets and not closest:
        lines.append(("not reached", "no closest configuration was looked for: --closest does, and takes long"))
    if found.resumed:
        lines.append(("solved before", f"{found.resumed}, in a run that did not end"))
    if found.output is not None:
        lines.append(("written to", str(found.output)))
        if found.carried:
            lines.append(("carried through", ", ".join(found.carried)))
    display.show_facts(lines, solver.robot.label)
    if found.failures:
        failed = found.targets - found.solved
        rows = [(str(line), status.name, message) for line, status, message in found.failures]
        more = f", the first {len(rows)} of {failed}" if failed > len(rows) else ""
        display.show_table(f"Not solved{more}", ("line", "status", "why"), rows, text=3)
