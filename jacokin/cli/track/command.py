"""`jacokin track`: a joint trajectory that follows a path of poses."""

from __future__ import annotations

import contextlib
import importlib.util
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from jacokin.cli.arguments import options
from jacokin.cli.arguments.options import (
    DEFAULT_ROBOT,
    BaseOption,
    FrameOption,
    JsonOption,
    RobotOption,
    SeedOption,
    TipOption,
)
from jacokin.cli.arguments.outputs import keep_apart
from jacokin.cli.arguments.units import Angles
from jacokin.cli.display.progress import progress_bar
from jacokin.cli.exit_codes import NOT_SOLVED
from jacokin.errors import InvalidInputError, MissingExtraError

if TYPE_CHECKING:
    from jacokin.arrays import Array


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
    from jacokin import files
    from jacokin.cli.track import report
    from jacokin.ik.paths import track as paths
    from jacokin.ik.paths.result import FORMATS

    poses = _poses(path)
    _check_files(output, FORMATS, plot)
    keep_apart({"--output": output, "--plot": plot}, {"--path": path, "--robot": robot})
    arm = options.load(robot, base, tip)
    with contextlib.ExitStack() as stack:
        writable = None if output is None else stack.enter_context(files.replacing(output))
        drawable = None if plot is None else stack.enter_context(files.replacing(plot))
        with progress_bar("tracking") as progress:
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
        report.print_json(arm, result, output, plot)
    else:
        report.show(result, output, plot)
    if not result.success:
        raise typer.Exit(NOT_SOLVED)


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


def _poses(path: Path) -> Array:
    """The poses of a path file (n, 4, 4).

    Raises:
        InvalidInputError: as `read_targets`, or the file has no orientations.
    """
    from jacokin.ik.files.columns import QUATERNION, RPY
    from jacokin.ik.files.targets_csv import read_targets

    targets = read_targets(path).targets
    if targets.ndim != 3:
        raise InvalidInputError(
            f"{path}: a path needs orientations, columns {', '.join(QUATERNION)} or {', '.join(RPY)}"
        )
    return targets
