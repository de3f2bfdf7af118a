"""`jacokin ik --targets FILE.csv`: a file of poses in, a file of joint angles out."""

from __future__ import annotations

import contextlib
import csv
import time
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from jacokin import files
from jacokin.cli import json_output, tables
from jacokin.errors import InvalidInputError

if TYPE_CHECKING:
    from jacokin.ik.files.targets_csv import TargetFile
    from jacokin.ik.results import BatchResult
    from jacokin.ik.solver import IKSolver

SHOWN_FAILURES = 20  # rows listed for people; the output file has them all


def run(
    solver: IKSolver, targets: Path, out: Path | None, seed: list[float] | None, *, workers: int, as_json: bool
) -> bool:
    """Solve every row of a file; returns whether all of them are solved.

    Raises:
        InvalidInputError: the targets cannot be read or the output not written; nothing is solved then.
    """
    if out is not None and out.exists() and targets.exists() and out.samefile(targets):
        raise InvalidInputError(f"--output {out} is the file of targets itself")
    from jacokin.ik.files.targets_csv import read_targets

    file = read_targets(targets)
    with contextlib.ExitStack() as stack:
        writable = None if out is None else stack.enter_context(files.replacing(out))
        started = time.perf_counter()
        batch = _solve(solver, file, seed, workers)
        seconds = time.perf_counter() - started
        if writable is not None:
            _write(writable, solver.robot.joint_names, file, batch)
    if as_json:
        json_output.print_json(_document(solver, file, batch, seconds, out))
    else:
        _show(file, batch, seconds, out)
    return bool(batch.success.all())


def _solve(solver: IKSolver, file: TargetFile, seed: list[float] | None, workers: int) -> BatchResult:
    """Solve with a progress bar on stderr."""
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("solving"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=tables.console(stderr=True), transient=True) as progress:
        task = progress.add_task("solving", total=len(file))
        return solver.solve_batch(
            file.targets, seed, workers=workers, progress=lambda count: progress.advance(task, count)
        )


def _write(path: Path, joint_names: tuple[str, ...], file: TargetFile, batch: BatchResult) -> None:
    """One row for each target; 17 significant digits, which read back as the same number."""
    with path.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        joints = [f"q{index + 1}" for index in range(len(joint_names))]
        writer.writerow([*file.columns, *joints, "status", "position_error", "orientation_error", "method", "message"])
        for row in range(len(file)):
            numbers = [*file.values[row], *batch.q[row]]
            errors = (batch.position_error[row], batch.orientation_error[row])
            writer.writerow(
                [
                    *(f"{value:.17g}" for value in numbers),
                    batch.status[row].name,
                    *(f"{value:.17g}" for value in errors),
                    batch.method[row],
                    batch.message[row],
                ]
            )


def _document(
    solver: IKSolver, file: TargetFile, batch: BatchResult, seconds: float, out: Path | None
) -> dict[str, object]:
    """The summary; the answers too when no file holds them."""
    summary: dict[str, object] = {
        "robot": solver.robot.name,
        "frame": solver.frame,
        "joint_names": solver.robot.joint_names,
        "angle_unit": "rad",
        "targets": len(file),
        "solved": int(batch.success.sum()),
        "seconds": seconds,
        "statuses": dict(Counter(status.name for status in batch.status)),
        "worst_position_error": _worst(batch.position_error, batch),
        "worst_orientation_error": _worst(batch.orientation_error, batch),
        "output": None if out is None else str(out),
    }
    if out is None:
        summary["results"] = [
            {
                "line": file.lines[row],
                "status": batch.status[row],
                "q": batch.q[row],
                "position_error": batch.position_error[row],
                "orientation_error": batch.orientation_error[row],
                "method": batch.method[row],
                "message": batch.message[row],
            }
            for row in range(len(file))
        ]
    return summary


def _worst(errors: np.ndarray[tuple[int, ...], np.dtype[np.float64]], batch: BatchResult) -> float | None:
    """The largest error among the solved rows."""
    return float(errors[batch.success].max()) if batch.success.any() else None


def _show(file: TargetFile, batch: BatchResult, seconds: float, out: Path | None) -> None:
    screen = tables.console()
    solved = int(batch.success.sum())
    lines = [
        ("solved", f"{solved} of {len(file)} ({100.0 * solved / len(file):.1f} %)"),
        ("time", f"{seconds:.3f} s, {len(file) / seconds:.0f} poses/s"),
    ]
    for name, unit, errors in (
        ("worst position error", "m", batch.position_error),
        ("worst orientation error", "rad", batch.orientation_error),
    ):
        worst = _worst(errors, batch)
        if worst is not None:
            lines.append((name, tables.small(worst, unit)))
    lines += [
        (status.name, f"{count}: {status.value}")
        for status, count in Counter(batch.status).items()
        if status.name != "OK"
    ]
    if out is not None:
        lines.append(("written to", str(out)))
    screen.print(tables.facts(lines))
    failed = np.flatnonzero(~batch.success)
    if len(failed):
        rows = [(str(file.lines[row]), batch.status[row].name, batch.message[row]) for row in failed[:SHOWN_FAILURES]]
        more = f", the first {SHOWN_FAILURES} of {len(failed)}" if len(failed) > SHOWN_FAILURES else ""
        screen.print(tables.table(f"Not solved{more}", ("line", "status", "why"), rows, text=3))
