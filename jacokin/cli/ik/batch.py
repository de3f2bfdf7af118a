"""`jacokin ik --targets FILE.csv`: a file of poses in, a file of joint angles out."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

import numpy as np

from jacokin import files
from jacokin.cli.arguments.units import Units, warn_of_degrees
from jacokin.cli.display import json_output, tables
from jacokin.cli.display.progress import progress_bar
from jacokin.cli.ik.tally import Tally
from jacokin.ik.files.answers_csv import write_answers, write_header
from jacokin.ik.files.columns import RPY
from jacokin.ik.files.targets_csv import read_targets, target_blocks

if TYPE_CHECKING:
    from jacokin.ik.files.targets_csv import TargetFile
    from jacokin.ik.solver import IKSolver


def run(
    solver: IKSolver, targets: Path, out: Path | None, seed: list[float] | None, *, workers: int, as_json: bool
) -> bool:
    """Solve every row of a file; returns whether all of them are solved.

    Raises:
        InvalidInputError: the targets cannot be read or the output not written; nothing is solved then.
    """
    blocks, count = _checked(targets)
    tally = Tally()
    started = time.perf_counter()
    with contextlib.ExitStack() as stack:
        stream = None
        if out is not None:
            writable = stack.enter_context(files.replacing(out))
            stream = stack.enter_context(writable.open("w", encoding="utf-8", newline=""))
        _solve(solver, blocks, count, seed, workers, tally, stream, keep=as_json and out is None)
    seconds = time.perf_counter() - started
    if as_json:
        json_output.print_json(_document(solver, tally, seconds, out))
    else:
        _show(tally, seconds, out)
    return tally.solved == tally.count


def _checked(targets: Path) -> tuple[Iterable[TargetFile], int]:
    """The blocks of a file and its number of rows, after everything in it has been read once.

    Raises:
        InvalidInputError: as `read_targets`.
    """
    if not targets.is_file():  # a pipe can be read once only
        whole = read_targets(targets)
        return [whole], len(whole)
    count, widest = 0, 0.0
    for block in target_blocks(targets):
        count += len(block)
        if block.columns[3:] == RPY:
            widest = max(widest, float(np.abs(block.values[:, 3:]).max()))
    warn_of_degrees(f"{targets}: roll, pitch, yaw", [widest], Units(degrees=False))
    return target_blocks(targets), count


def _solve(
    solver: IKSolver,
    blocks: Iterable[TargetFile],
    count: int,
    seed: list[float] | None,
    workers: int,
    tally: Tally,
    stream: TextIO | None,
    *,
    keep: bool,
) -> None:
    """Solve block by block, with a progress bar on stderr."""
    done = 0

    def advance(rows: int) -> None:
        nonlocal done
        done += rows
        show(done, count)

    with progress_bar("solving") as show:
        for block in blocks:
            batch = solver.solve_batch(block.targets, seed, workers=workers, progress=advance)
            if stream is not None:
                if not tally.count:
                    write_header(stream, block.columns, solver.robot.dof)
                write_answers(stream, block, batch)
            tally.add(block, batch, keep=keep)


def _document(solver: IKSolver, tally: Tally, seconds: float, out: Path | None) -> dict[str, object]:
    """The summary; the answers too when no file holds them."""
    summary: dict[str, object] = {
        "robot": solver.robot.name,
        "frame": solver.frame,
        "joint_names": solver.robot.joint_names,
        "angle_unit": "rad",
        "targets": tally.count,
        "solved": tally.solved,
        "seconds": seconds,
        "statuses": {status.name: count for status, count in tally.statuses.items()},
        "worst_position_error": tally.worst_position_error,
        "worst_orientation_error": tally.worst_orientation_error,
        "output": None if out is None else str(out),
    }
    if out is None:
        summary["results"] = tally.results
    return summary


def _show(tally: Tally, seconds: float, out: Path | None) -> None:
    lines = [
        ("solved", f"{tally.solved} of {tally.count} ({100.0 * tally.solved / tally.count:.1f} %)"),
        ("time", f"{seconds:.3f} s, {tally.count / seconds:.0f} poses/s"),
    ]
    for name, unit, worst in (
        ("worst position error", "m", tally.worst_position_error),
        ("worst orientation error", "rad", tally.worst_orientation_error),
    ):
        if worst is not None:
            lines.append((name, tables.small(worst, unit)))
    lines += [
        (status.name, f"{count}: {status.value}") for status, count in tally.statuses.items() if status.name != "OK"
    ]
    if out is not None:
        lines.append(("written to", str(out)))
    tables.say(tables.facts(lines))
    if tally.failures:
        failed = tally.count - tally.solved
        rows = [(str(line), status.name, message) for line, status, message in tally.failures]
        more = f", the first {len(rows)} of {failed}" if failed > len(rows) else ""
        tables.say(tables.table(f"Not solved{more}", ("line", "status", "why"), rows, text=3))
