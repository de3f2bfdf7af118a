"""`jacokin plan` and `jacokin track`: a joint trajectory along a path of poses."""

from __future__ import annotations

import contextlib
import importlib.util
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import click

from jacokin import files, ik, model, motion
from jacokin.cli import display, options
from jacokin.cli.command import Command, NumberList, option_group
from jacokin.cli.display import number, progress_bar, show_facts, show_table, small
from jacokin.cli.options import keep_apart
from jacokin.cli.process import NOT_SOLVED
from jacokin.cli.units import Units, warn_of_degrees
from jacokin.errors import InvalidInputError, MissingExtraError

if TYPE_CHECKING:
    import pinocchio as pin

    from jacokin.arrays import Array

SHOWN = 6  # values of the parameter in a line


@dataclass(frozen=True, slots=True)
class Written:
    """A file that a trajectory is to be written to, and how."""

    output: Path | None
    ros: int
    joint_prefix: str
    first_time: float
    """[s]"""
    failed: bool

    def keeps(self, result: motion.Trajectory) -> bool:
        """Whether a trajectory is written."""
        return self.output is not None and (result.success or self.failed)


@dataclass(frozen=True, slots=True)
class PathOptions:
    """What `plan` and `track` have in common; they take these options as one parameter."""

    waypoints: Path
    dt: float
    output: Path | None
    ros: str
    joint_prefix: str
    first_time: float
    save_failed: bool
    plot: Path | None
    speed: float
    angular_speed: float | None
    velocity_limit: list[float] | None
    acceleration_limit: list[float] | None
    scene: Path | None
    clearance: float | None
    frame: str | None
    tool: pin.SE3 | None
    seed: list[float] | None
    start: list[float] | None
    units: Units
    json: bool

    @property
    def written(self) -> Written:
        """What is written, and how."""
        return Written(self.output, int(self.ros), self.joint_prefix, self.first_time, self.save_failed)

    def in_si(self, arm: model.Robot) -> PathNumbers:
        """What is typed in the user's unit of angles, with a note where it looks like another one.

        Raises:
            InvalidInputError: a wrong number of values, or options that do not go together.
        """
        if self.seed is not None and self.start is not None:
            raise InvalidInputError("give at most one of --seed and --start")
        from jacokin.motion.track import ANGULAR_SPEED

        joints = self.units.for_joints(arm)
        speed = ANGULAR_SPEED
        if self.angular_speed is not None:
            warn_of_degrees("--angular-speed", [self.angular_speed], self.units, "rad/s")
            speed = self.units.to_si([self.angular_speed])[0]
        return PathNumbers(
            angular_speed=speed,
            seed=joints.seed("--seed", self.seed),
            start=joints.seed("--start", self.start),
            velocity_limit=joints.limits("--velocity-limit", self.velocity_limit, "rad/s"),
            acceleration_limit=joints.limits("--acceleration-limit", self.acceleration_limit, "rad/s^2"),
        )


@dataclass(frozen=True, slots=True)
class PathNumbers:
    """What `plan` and `track` hand to the library, in SI units."""

    angular_speed: float
    """[rad/s]"""
    seed: list[float] | None
    """(dof,) [rad]"""
    start: list[float] | None
    """(dof,) [rad]"""
    velocity_limit: list[float] | None
    """(dof,) [rad/s]"""
    acceleration_limit: list[float] | None
    """(dof,) [rad/s^2]"""


path_options = option_group(
    "given",
    PathOptions,
    click.option(
        "--path",
        "waypoints",
        type=options.FILE,
        required=True,
        metavar="FILE.csv",
        help="Poses to pass through: columns x,y,z,qw,qx,qy,qz.",
    ),
    click.option("--dt", default=0.01, metavar="T", help="Control step [s]."),
    click.option(
        "--output",
        type=options.FILE,
        metavar="FILE",
        help="Write the trajectory here, .csv, .npz, .json (ROS), .kinova.csv or .kinova.json (kinova-ros).",
    ),
    click.option("--ros", type=click.Choice(["1", "2"]), default="2", help="The version of ROS a .json is for."),
    click.option(
        "--joint-prefix", default="", metavar="P", help="Before the names of joints in a .json, such as j2n6s300_."
    ),
    click.option("--first-time", default=0.0, metavar="T", help="Of the first point in a .json [s]."),
    click.option("--save-failed", is_flag=True, help="Write a trajectory that failed, too, .csv or .npz, to look at."),
    click.option("--plot", type=options.FILE, metavar="FILE.png", help="Draw joints, limits and errors over time."),
    click.option("--speed", default=0.05, metavar="V", help="Speed along the path [m/s]."),
    click.option("--angular-speed", type=float, metavar="W", help="Speed of turning [rad/s]; 0.5 if not given."),
    options.velocity_limit,
    click.option(
        "--acceleration-limit",
        cls=NumberList,
        metavar="A ..",
        help="Of the joints [rad/s^2]; none if not given. `plan` needs --timing slow with it.",
    ),
    options.scene,
    click.option(
        "--clearance",
        type=float,
        metavar="D",
        help="Distance to keep between shapes [m]; if not given, 0 for `plan`, and 0.01 for `track` with a scene.",
    ),
    options.frame,
    options.tool,
    options.seed,
    click.option(
        "--start",
        cls=NumberList,
        metavar="Q1 .. Q6",
        help="Joint angles the arm is at, instead of --seed: no other start is tried.",
    ),
    options.degrees,
    options.json,
)


@click.command(cls=Command, no_args_is_help=True)
@path_options
@click.option(
    "--timing", default="keep", metavar="NAME", help="keep the speed, or slow down where joints cannot follow."
)
@options.free_axis
@options.free_range
@options.robot()
def plan(
    given: PathOptions,
    timing: str,
    free_axis: list[float] | None,
    free_range: tuple[float, float] | None,
    source: options.RobotOptions,
) -> None:
    """Plan a path of poses over all branches, before anything moves.

    The tool moves on straight lines from pose to pose, without jumps, inside position and velocity limits, clear of
    the scene and of itself.
    Exit code: 0 on the path throughout, 1 not, 2 wrong input.

    Examples:
      jacokin plan --path path.csv --output trajectory.csv
      jacokin plan --path path.csv --free-axis x --scene scene.yaml --output trajectory.npz
      jacokin plan --path path.csv --speed 0.2 --timing slow --acceleration-limit 2 --output arm.kinova.csv
      jacokin plan --path path.csv --degrees --free-axis z --free-range -30 30
    """
    check_files(given, source)
    poses = read_poses(given.waypoints)
    if free_axis is None and free_range is not None:
        raise InvalidInputError("--free-range needs --free-axis")
    units = given.units
    if free_range is not None:
        warn_of_degrees("--free-range", free_range, units)
    targets = [pose if free_axis is None else options.free_about(pose, free_axis, free_range, units) for pose in poses]
    arm = source.load()
    numbers = given.in_si(arm)
    solver = ik.IKSolver(
        arm,
        given.frame,
        tool=given.tool,
        collision="reject",
        scene=options.load_scene(given.scene),
        clearance=given.clearance or 0.0,
    )

    def compute() -> motion.Trajectory:
        return motion.plan_path(
            solver,
            targets,
            dt=given.dt,
            speed=given.speed,
            angular_speed=numbers.angular_speed,
            timing=timing,
            seed=numbers.seed,
            start=numbers.start,
            velocity_limit=numbers.velocity_limit,
            acceleration_limit=numbers.acceleration_limit,
        )

    deliver(compute, arm, given)


@click.command(cls=Command, no_args_is_help=True)
@path_options
@options.robot()
def track(given: PathOptions, source: options.RobotOptions) -> None:
    """Follow a path of poses at control rate.

    The tool moves on straight lines from pose to pose, inside position and velocity limits. Every branch of the first
    pose is tried until one stays on the path throughout.
    Exit code: 0 on the path throughout, 1 not, 2 wrong input.

    Examples:
      jacokin track --path path.csv --output trajectory.csv
      jacokin track --path path.csv --dt 0.005 --speed 0.1 --output trajectory.npz --plot trajectory.png
      jacokin track --path path.csv --degrees --velocity-limit 20 --acceleration-limit 60
      jacokin track --path path.csv --scene scene.yaml --clearance 0.02
    """
    check_files(given, source)
    poses = read_poses(given.waypoints)
    scene = options.load_scene(given.scene)
    arm = source.load()
    numbers = given.in_si(arm)

    def compute() -> motion.Trajectory:
        with progress_bar("tracking") as progress:
            return motion.track_path(
                arm,
                poses,
                dt=given.dt,
                speed=given.speed,
                angular_speed=numbers.angular_speed,
                frame=given.frame,
                tool=given.tool,
                seed=numbers.seed,
                start=numbers.start,
                velocity_limit=numbers.velocity_limit,
                acceleration_limit=numbers.acceleration_limit,
                scene=scene,
                clearance=given.clearance,
                progress=progress,
            )

    deliver(compute, arm, given)


def check_files(given: PathOptions, source: options.RobotOptions) -> None:
    """Check the files that are written before anything is computed.

    Raises:
        InvalidInputError: an output of another kind, or one that is read.
        MissingExtraError: matplotlib is needed and not installed.
    """
    check_trajectory_files(given.written, given.plot)
    inputs = {"--path": given.waypoints, "--robot": source.robot, "--scene": given.scene}
    keep_apart({"--output": given.output, "--plot": given.plot}, inputs, source.package_dirs)


def check_trajectory_files(written: Written, plot: Path | None) -> None:
    """Check what a trajectory is to be written to.

    Raises:
        InvalidInputError: a file of another kind, or options of one kind with another.
        MissingExtraError: matplotlib is needed and not installed.
    """
    from jacokin.motion.plot import FORMATS as PICTURES
    from jacokin.motion.trajectory import FORMATS, TO_SEND

    output = written.output
    for option, file, endings in (("--output", output, FORMATS), ("--plot", plot, PICTURES)):
        if file is not None and file.suffix not in endings:
            raise InvalidInputError(f"{option} must end in {' or '.join(endings)}, got {str(file)!r}")
    of_ros = written.ros != 2 or written.joint_prefix or written.first_time
    if of_ros and (output is None or output.suffix != ".json"):
        raise InvalidInputError("--ros, --joint-prefix and --first-time go with --output FILE.json")
    if written.failed and (output is None or output.name.endswith(TO_SEND)):
        raise InvalidInputError("--save-failed goes with --output FILE.csv or FILE.npz")
    if plot is not None and importlib.util.find_spec("matplotlib") is None:
        raise MissingExtraError("matplotlib", "plot")


class _NotWrittenError(Exception):
    """A trajectory failed."""


def compute_into(written: Written, plot: Path | None, compute: Callable[[], motion.Trajectory]) -> motion.Trajectory:
    """Compute a trajectory, write it unless it failed, and draw it; both files are known to be writable before.

    Raises:
        InvalidInputError: a file cannot be written, or holds what it does not take.
    """
    with contextlib.ExitStack() as stack:
        drawable = None if plot is None else stack.enter_context(files.replacing(plot))
        with contextlib.suppress(_NotWrittenError), contextlib.ExitStack() as output:
            writable = None if written.output is None else output.enter_context(files.replacing(written.output))
            result = compute()
            if writable is not None and not written.keeps(result):
                raise _NotWrittenError
            if writable is not None:
                result.save(
                    writable,
                    ros=written.ros,
                    joint_prefix=written.joint_prefix,
                    first_time=written.first_time,
                    failed=written.failed,
                )
        if drawable is not None:
            motion.plot_path(result, drawable)
    return result


def files_written(written: Written, plot: Path | None, result: motion.Trajectory) -> list[tuple[str, str]]:
    """Lines that name the files."""
    lines = [("drawn in", str(plot))] if plot is not None else []
    if written.keeps(result):
        return [("written to", str(written.output)), *lines]
    if written.output is not None:
        kinds = (
            "" if written.output.name.endswith((".json", ".kinova.csv")) else "; --save-failed writes it all the same"
        )
        return [("not written", f"{written.output}, because it failed{kinds}"), *lines]
    return lines


def read_poses(path: Path) -> Array:
    """The poses of a path file (n, 4, 4).

    Raises:
        InvalidInputError: as `read_targets`, or the file has no orientations.
    """
    from jacokin.ik.files.targets import QUATERNION, RPY

    targets = ik.read_targets(path).targets
    if targets.ndim != 3:
        raise InvalidInputError(
            f"{path}: a path needs orientations, columns {', '.join(QUATERNION)} or {', '.join(RPY)}"
        )
    return targets


def deliver(compute: Callable[[], motion.Trajectory], arm: model.Robot, given: PathOptions) -> None:
    """Compute a trajectory, write and draw it where that is asked for, and show it.

    Raises:
        SystemExit: it is not on the path throughout.
    """
    result = compute_into(given.written, given.plot, compute)
    if given.json:
        print_json(arm, result, given)
    else:
        show(arm, result, given)
    if not result.success:
        raise SystemExit(NOT_SOLVED)


def print_json(arm: model.Robot, result: motion.Trajectory, given: PathOptions) -> None:
    """Print the errors, the margins and every start that was tried as one JSON document."""
    units = given.units
    joints = units.for_joints(arm)
    display.print_json(
        {
            **display.head(arm, units),
            "success": result.success,
            "message": units.in_words(result.message),
            "duration": result.t[-1],
            "rows": len(result),
            "max_position_error": result.largest_errors[0],
            "max_orientation_error": units.from_si(result.largest_errors[1]),
            "time_off_the_path": result.time_limited,
            "failed_segments": result.failed_segments,
            "limit_margin": joints.from_si(result.limit_margin.min(axis=0)),
            "least_clearance": result.clearance.min(),
            "parameter": [units.from_si(value) for value in result.parameter],
            "branches": [
                {
                    "q_start": joints.from_si(branch.q_start),
                    "failed_segments": branch.failed_segments,
                    "position_error": branch.position_error,
                    "orientation_error": units.from_si(branch.orientation_error),
                }
                for branch in result.branches
            ],
            "output": str(given.output) if given.written.keeps(result) else None,
            "plot": None if given.plot is None else str(given.plot),
        }
    )


def show(arm: model.Robot, result: motion.Trajectory, given: PathOptions) -> None:
    """Print a summary; when the tool left the path, where it did from every start."""
    import numpy as np

    units = given.units
    margin = result.limit_margin
    nearest = int(margin.min(axis=0).argmin())
    at = int(margin[:, nearest].argmin())
    joints = units.for_joints(arm)
    away = joints.from_si(margin[at])[nearest]
    lines = [
        ("result", "on the path throughout" if result.success else "NOT on the path throughout"),
        ("note", units.in_words(result.message)),
        ("duration", f"{result.t[-1]:.3f} s, {len(result)} rows"),
        ("largest position error", small(result.largest_errors[0], "m")),
        ("largest orientation error", small(units.from_si(result.largest_errors[1]), units.angle)),
        ("time off the path", f"{result.time_limited:.3f} s"),
        (
            "nearest to a limit",
            f"{result.joint_names[nearest]}, {number(away)} {joints.names[nearest]} away at {result.t[at]:.3f} s",
        ),
    ]
    if not np.isnan(result.clearance).all():
        lines.append(("least clearance", f"{number(result.clearance.min())} m"))
    if not np.isnan(result.parameter).all():
        solver = ik.IKSolver(arm, given.frame, tool=given.tool, collision="ignore")
        name = solver.parameter or "free angle"
        shown = [number(units.from_si(value), 3).replace("nan", "none") for value in result.parameter[:SHOWN]]
        more = "" if len(result.parameter) <= SHOWN else f" and {len(result.parameter) - SHOWN} more"
        lines.append((f"{name} at the poses", f"{', '.join(shown)}{more} {units.angle}"))
    lines += files_written(given.written, given.plot, result)
    show_facts(lines, arm.label)
    if not result.success and result.branches:
        from jacokin.motion.trajectory import list_segments

        rows = [
            (
                str(index),
                list_segments(branch.failed_segments) or "none",
                small(branch.position_error, "m"),
                small(units.from_si(branch.orientation_error), units.angle),
            )
            for index, branch in enumerate(result.branches, start=1)
        ]
        columns = ("start branch", "off the path on segments", "position error", "orientation error")
        show_table("Every start that was tried", columns, rows, text=2)
