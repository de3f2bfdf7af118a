"""`jacokin track`: a joint trajectory that follows a path of poses."""

from __future__ import annotations

import contextlib
import importlib.util
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from jacokin.cli import arguments
from jacokin.cli.arguments import (
    DEFAULT_ROBOT,
    Angles,
    BaseOption,
    FrameOption,
    JsonOption,
    RobotOption,
    SeedOption,
    TipOption,
)
from jacokin.errors import InvalidInputError, MissingExtraError

if TYPE_CHECKING:
    import pinocchio as pin

    from jacokin.ik.paths.result import PathResult
    from jacokin.model.robot import Robot

OFF_THE_PATH = 1  # exit code
PLOT_FORMATS = (".png", ".svg", ".pdf")


def track(
    path: Annotated[
        Path, typer.Option("--path", metavar="FILE.csv", help="Poses to pass through: columns x,y,z,qw,qx,qy,qz.")
    ],
    dt: Annotated[float, typer.Option("--dt", metavar="T", help="Control step [s].")] = 0.01,
    output: Annotated[
        Path | None,
        typer.Option("--output", metavar="FILE", help="Write the trajectory here, .csv or .npz, in radians."),
    ] = None,
    plot: Annotated[
        Path | None, typer.Option("--plot", metavar="FILE.png", help="Draw joints, limits and errors over time.")
    ] = None,
    speed: Annotated[float, typer.Option("--speed", metavar="V", help="Speed along the path [m/s].")] = 0.05,
    angular_speed: Annotated[
        float, typer.Option("--angular-speed", metavar="W", help="Speed of turning [rad/s].")
    ] = 0.5,
    frame: FrameOption = None,
    seed: SeedOption = None,
    json: JsonOption = False,
    robot: RobotOption = DEFAULT_ROBOT,
    base: BaseOption = None,
    tip: TipOption = None,
) -> None:
    """Follow a path of poses at control rate.

    The tool moves on straight lines from pose to pose, inside position and velocity limits. Every branch of the first
    pose is tried until one stays on the path throughout.
    Exit code: 0 on the path throughout, 1 not, 2 wrong input.

    Examples:
      jacokin track --path path.csv --output trajectory.csv
      jacokin track --path path.csv --dt 0.005 --speed 0.1 --output trajectory.npz --plot trajectory.png
    """
    from jacokin.cli import output_file
    from jacokin.ik.paths import track as paths
    from jacokin.ik.paths.result import FORMATS

    poses = _poses(path)
    _check_files(output, FORMATS, plot)
    arm = arguments.load(robot, base, tip)
    with contextlib.ExitStack() as stack:
        writable = None if output is None else stack.enter_context(output_file.replacing(output))
        drawable = None if plot is None else stack.enter_context(output_file.replacing(plot))
        with _progress() as progress:
            result = paths.track_path(
                arm,
                poses,
                dt=dt,
                speed=speed,
                angular_speed=angular_speed,
                frame=frame,
                seed=Angles(degrees=False).seed(seed),
                progress=progress,
            )
        if writable is not None:
            result.save(writable)
        if drawable is not None:
            from jacokin.ik.paths.plot import plot_path

            plot_path(result, drawable)
    if json:
        _print_json(arm, result, output, plot)
    else:
        _show(result, output, plot)
    if not result.success:
        raise typer.Exit(OFF_THE_PATH)


def _check_files(output: Path | None, formats: tuple[str, ...], plot: Path | None) -> None:
    """Find out before the work what would fail after it.

    Raises:
        InvalidInputError: a file of another kind.
        MissingExtraError: matplotlib is needed and not installed.
    """
    for option, file, endings in (("--output", output, formats), ("--plot", plot, PLOT_FORMATS)):
        if file is not None and file.suffix not in endings:
            raise InvalidInputError(f"{option} must end in {' or '.join(endings)}, got {str(file)!r}")
    if plot is not None and importlib.util.find_spec("matplotlib") is None:
        raise MissingExtraError("matplotlib", "plot")


def _poses(path: Path) -> list[pin.SE3]:
    """The poses of a path file.

    Raises:
        InvalidInputError: as `targets_csv.read`, or the file has no orientations.
    """
    from jacokin.cli import targets_csv

    file = targets_csv.read(path)
    if not isinstance(file.targets, list):
        raise InvalidInputError(f"{path}: a path needs orientations, columns {', '.join(targets_csv.QUATERNION)}")
    return file.targets


@contextlib.contextmanager
def _progress() -> Iterator[Callable[[int, int], None]]:
    """A progress bar on stderr, driven by ticks done and ticks in all."""
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    from jacokin.cli.output import console

    columns = (TextColumn("tracking"), BarColumn(), TextColumn("{task.percentage:3.0f} %"), TimeRemainingColumn())
    with Progress(*columns, console=console(stderr=True), transient=True) as bar:
        task = bar.add_task("tracking", total=None)
        yield lambda done, total: bar.update(task, completed=done, total=total)


def _print_json(arm: Robot, result: PathResult, output: Path | None, plot: Path | None) -> None:
    from jacokin.cli.output import print_json

    print_json(
        {
            "robot": arm.name,
            "joint_names": result.joint_names,
            "angle_unit": "rad",
            "success": result.success,
            "message": result.message,
            "duration": result.t[-1],
            "rows": len(result),
            "max_position_error": result.position_error.max(),
            "max_orientation_error": result.orientation_error.max(),
            "time_off_the_path": result.time_limited,
            "failed_segments": result.failed_segments,
            "limit_margin": result.limit_margin.min(axis=0),
            "branches": [
                {
                    "q_start": branch.q_start,
                    "failed_segments": branch.failed_segments,
                    "position_error": branch.position_error,
                    "orientation_error": branch.orientation_error,
                }
                for branch in result.branches
            ],
            "output": None if output is None else str(output),
            "plot": None if plot is None else str(plot),
        }
    )


def _show(result: PathResult, output: Path | None, plot: Path | None) -> None:
    from jacokin.cli.output import console, facts, number, small, table

    margin = result.limit_margin
    nearest = int(margin.min(axis=0).argmin())
    at = int(margin[:, nearest].argmin())
    lines = [
        ("result", "on the path throughout" if result.success else "NOT on the path throughout"),
        ("note", result.message),
        ("duration", f"{result.t[-1]:.3f} s, {len(result)} rows"),
        ("largest position error", small(float(result.position_error.max()), "m")),
        ("largest orientation error", small(float(result.orientation_error.max()), "rad")),
        ("time off the path", f"{result.time_limited:.3f} s"),
        (
            "nearest to a limit",
            f"{result.joint_names[nearest]}, {number(margin[at, nearest])} rad away at {result.t[at]:.3f} s",
        ),
    ]
    lines += [(name, str(file)) for name, file in (("written to", output), ("drawn in", plot)) if file is not None]
    screen = console()
    screen.print(facts(lines))
    if not result.success:
        rows = [
            (
                str(index),
                ", ".join(str(segment) for segment in branch.failed_segments) or "none",
                small(branch.position_error, "m"),
                small(branch.orientation_error, "rad"),
            )
            for index, branch in enumerate(result.branches, start=1)
        ]
        columns = ("start branch", "off the path on segments", "position error", "orientation error")
        screen.print(table("Every start that was tried", columns, rows, text=2))
