"""What `jacokin track` and `jacokin plan` do with a trajectory: write it, draw it and show it."""

from __future__ import annotations

import contextlib
import importlib.util
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from jacokin import files
from jacokin.cli import display
from jacokin.cli.display import facts, number, say, small, table
from jacokin.cli.exit_codes import NOT_SOLVED
from jacokin.cli.outputs import keep_apart
from jacokin.errors import InvalidInputError, MissingExtraError

if TYPE_CHECKING:
    from jacokin.cli.units import Units
    from jacokin.model.robot import Robot
    from jacokin.motion.trajectory import PathResult

SHOWN = 6  # values of the parameter in a line


def check_files(
    output: Path | None,
    plot: Path | None,
    inputs: Mapping[str, str | Path | None],
    packages: Sequence[Path] | None,
) -> None:
    """Find out before the work what would fail after it.

    Args:
        output: the trajectory, if it is to be written.
        plot: its picture.
        inputs: option and file that is read.
        packages: where packages of robots are looked for.

    Raises:
        InvalidInputError: a file of another kind, or one that is read.
        MissingExtraError: matplotlib is needed and not installed.
    """
    from jacokin.motion.plot import FORMATS as PICTURES
    from jacokin.motion.trajectory import FORMATS

    for option, file, endings in (("--output", output, FORMATS), ("--plot", plot, PICTURES)):
        if file is not None and file.suffix not in endings:
            raise InvalidInputError(f"{option} must end in {' or '.join(endings)}, got {str(file)!r}")
    if plot is not None and importlib.util.find_spec("matplotlib") is None:
        raise MissingExtraError("matplotlib", "plot")
    keep_apart({"--output": output, "--plot": plot}, inputs, packages or ())


def deliver(
    compute: Callable[[], PathResult],
    arm: Robot,
    units: Units,
    output: Path | None,
    plot: Path | None,
    *,
    as_json: bool,
) -> None:
    """Compute a trajectory, write and draw it where that is asked for, and show it.

    Raises:
        SystemExit: it is not on the path throughout.
    """
    with contextlib.ExitStack() as stack:
        writable = None if output is None else stack.enter_context(files.replacing(output))
        drawable = None if plot is None else stack.enter_context(files.replacing(plot))
        result = compute()
        if writable is not None:
            result.save(writable)
        if drawable is not None:
            from jacokin.motion.plot import plot_path

            plot_path(result, drawable)
    if as_json:
        print_json(arm, result, units, output, plot)
    else:
        show(arm, result, units, output, plot)
    if not result.success:
        raise SystemExit(NOT_SOLVED)


def print_json(arm: Robot, result: PathResult, units: Units, output: Path | None, plot: Path | None) -> None:
    """Print the errors, the margins and every start that was tried as one JSON document."""
    joints = units.of_joints(arm)
    display.print_json(
        {
            **display.head(arm, units),
            "success": result.success,
            "message": result.message,
            "duration": result.t[-1],
            "rows": len(result),
            "max_position_error": result.position_error.max(),
            "max_orientation_error": units.shown(result.orientation_error.max()),
            "time_off_the_path": result.time_limited,
            "failed_segments": result.failed_segments,
            "limit_margin": joints.shown(result.limit_margin.min(axis=0)),
            "least_clearance": result.clearance.min(),
            "parameter": [units.shown(value) for value in result.parameter],
            "branches": [
                {
                    "q_start": joints.shown(branch.q_start),
                    "failed_segments": branch.failed_segments,
                    "position_error": branch.position_error,
                    "orientation_error": units.shown(branch.orientation_error),
                }
                for branch in result.branches
            ],
            "output": None if output is None else str(output),
            "plot": None if plot is None else str(plot),
        }
    )


def show(arm: Robot, result: PathResult, units: Units, output: Path | None, plot: Path | None) -> None:
    """Print a summary; when the tool left the path, where it did from every start."""
    margin = result.limit_margin
    nearest = int(margin.min(axis=0).argmin())
    at = int(margin[:, nearest].argmin())
    joints = units.of_joints(arm)
    away = joints.shown(margin[at])[nearest]
    lines = [
        ("result", "on the path throughout" if result.success else "NOT on the path throughout"),
        ("note", result.message),
        ("duration", f"{result.t[-1]:.3f} s, {len(result)} rows"),
        ("largest position error", small(float(result.position_error.max()), "m")),
        ("largest orientation error", small(units.shown(result.orientation_error.max()), units.angle)),
        ("time off the path", f"{result.time_limited:.3f} s"),
        (
            "nearest to a limit",
            f"{result.joint_names[nearest]}, {number(away)} {joints.names[nearest]} away at {result.t[at]:.3f} s",
        ),
    ]
    if not np.isnan(result.clearance).all():
        lines.append(("least clearance", f"{number(result.clearance.min())} m"))
    if not np.isnan(result.parameter).all():
        name = result.joint_names[2] if arm.dof == 7 else "free angle"  # joint 3 is the parameter of seven joints
        shown = [number(units.shown(value), 3).replace("nan", "none") for value in result.parameter[:SHOWN]]
        more = "" if len(result.parameter) <= SHOWN else f" and {len(result.parameter) - SHOWN} more"
        lines.append((f"{name} at the poses", f"{', '.join(shown)}{more} {units.angle}"))
    lines += [(name, str(file)) for name, file in (("written to", output), ("drawn in", plot)) if file is not None]
    say(facts(lines))
    if not result.success and result.branches:
        from jacokin.motion.trajectory import list_segments

        rows = [
            (
                str(index),
                list_segments(branch.failed_segments) or "none",
                small(branch.position_error, "m"),
                small(units.shown(branch.orientation_error), units.angle),
            )
            for index, branch in enumerate(result.branches, start=1)
        ]
        columns = ("start branch", "off the path on segments", "position error", "orientation error")
        say(table("Every start that was tried", columns, rows, text=2))
