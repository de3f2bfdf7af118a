"""`jacokin plan` and `track`: a joint trajectory along a path of poses; `jacokin move`: to a pose or joint angles."""

from __future__ import annotations

import contextlib
import importlib.util
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from jacokin import files, ik, model, motion
from jacokin.cli import display, options
from jacokin.cli.command import command, option, switch
from jacokin.cli.display import number, progress_bar, show_facts, show_table, small
from jacokin.cli.groups import (
    FormOptions,
    RobotOptions,
    SceneOptions,
    ToolOptions,
    free_about,
    load_generator,
    load_scene,
)
from jacokin.cli.ik import TargetOptions
from jacokin.cli.options import keep_degrees
from jacokin.cli.process import NOT_SOLVED
from jacokin.cli.units import Units, warn_of_degrees
from jacokin.errors import InvalidInputError, MissingExtraError

if TYPE_CHECKING:
    from jacokin import model
    from jacokin.arrays import Array


SHOWN = 6  # values of the parameter in a line


@dataclass(frozen=True, slots=True)
class TrajectoryFile:
    """Where a trajectory is written and drawn."""

    output: Path | None = option(
        "--output", help="Write the trajectory here, .csv, .npz, .json (ROS), .kinova.csv or .kinova.json (kinova-ros)."
    )
    ros: str = option("--ros", type=click.Choice(["1", "2"]), default="2", help="The version of ROS a .json is for.")
    joint_prefix: str = option(
        "--joint-prefix", default="", metavar="P", help="Before the names of joints in a .json, such as j2n6s300_."
    )
    first_time: float = option("--first-time", default=0.0, metavar="T", help="Of the first point in a .json [s].")
    save_failed: bool = switch("--save-failed", help="Write a trajectory that failed, too, .csv or .npz, to look at.")
    plot: Path | None = option(
        "--plot", metavar="FILE.png", help="Draw joints, limits, errors and distances over time."
    )

    def check(self, source: RobotOptions, inputs: Mapping[str, Path | None]) -> None:
        """Check both files before anything is computed.

        Args:
            source: the robot, whose files are read.
            inputs: option and other file that is read.

        Raises:
            InvalidInputError: a file of another kind, options of one kind with another, or an output that is read.
            MissingExtraError: matplotlib is needed and not installed.
        """
        from jacokin.motion.plot import FORMATS as PICTURES
        from jacokin.motion.trajectory import FORMATS, TO_SEND

        output = self.output
        for flag, file, endings in (("--output", output, FORMATS), ("--plot", self.plot, PICTURES)):
            if file is not None and file.suffix not in endings:
                raise InvalidInputError(f"{flag} must end in {' or '.join(endings)}, got {str(file)!r}")
        of_ros = self.ros != "2" or self.joint_prefix or self.first_time
        if of_ros and (output is None or output.suffix != ".json"):
            raise InvalidInputError("--ros, --joint-prefix and --first-time go with --output FILE.json")
        if self.save_failed and (output is None or output.name.endswith(TO_SEND)):
            raise InvalidInputError("--save-failed goes with --output FILE.csv or FILE.npz")
        if self.plot is not None and importlib.util.find_spec("matplotlib") is None:
            raise MissingExtraError("matplotlib", "plot")
        source.keep_apart({"--output": output, "--plot": self.plot}, inputs)

    def keeps(self, result: motion.Trajectory) -> bool:
        """Whether a trajectory is written."""
        return self.output is not None and (result.success or self.save_failed)

    def fill(self, compute: Callable[[], motion.Trajectory]) -> motion.Trajectory:
        """Compute a trajectory, write it unless it failed, and draw it; both files are known to be writable before.

        Raises:
            InvalidInputError: a file cannot be written, or holds what it does not take.
        """
        with contextlib.ExitStack() as stack:
            drawable = None if self.plot is None else stack.enter_context(files.replacing(self.plot))
            with contextlib.suppress(_NotWrittenError), contextlib.ExitStack() as output:
                writable = None if self.output is None else output.enter_context(files.replacing(self.output))
                result = compute()
                if writable is not None and not self.keeps(result):
                    raise _NotWrittenError
                if writable is not None:
                    result.save(
                        writable,
                        ros=int(self.ros),
                        joint_prefix=self.joint_prefix,
                        first_time=self.first_time,
                        failed=self.save_failed,
                    )
            if drawable is not None:
                motion.plot_path(result, drawable)
        return result

    def facts(self, result: motion.Trajectory) -> list[tuple[str, str]]:
        """Lines that name the files."""
        lines = [("drawn in", str(self.plot))] if self.plot is not None else []
        if self.keeps(result):
            return [("written to", str(self.output)), *lines]
        if self.output is not None:
            is_sent = self.output.name.endswith((".json", ".kinova.csv"))
            advice = "" if is_sent else "; --save-failed writes it all the same"
            return [("not written", f"{self.output}, because it failed{advice}"), *lines]
        return lines


class _NotWrittenError(Exception):
    """A trajectory failed."""


@dataclass(frozen=True, slots=True)
class PathOptions:
    """A path, and how it is followed."""

    waypoints: Path = option(
        "--path", required=True, metavar="FILE.csv", help="Poses to pass through: columns x,y,z,qw,qx,qy,qz."
    )
    dt: float = options.dt()
    speed: float = option("--speed", default=0.05, metavar="V", help="Speed along the path [m/s].")
    angular_speed: float | None = option(
        "--angular-speed", metavar="W", help="Speed of turning [rad/s]; 0.5 if not given."
    )
    velocity_limit: list[float] | None = options.velocity_limit()
    acceleration_limit: list[float] | None = options.acceleration_limit(
        help="Of the joints [rad/s^2]; for `track` the robot's own if not given. `plan` needs --timing slow with it."
    )
    seed: list[float] | None = options.seed()
    start: list[float] | None = option(
        "--start",
        without=("--seed",),
        metavar="Q1 .. Q6",
        help="Joint angles the arm is at, instead of --seed: no other start is tried.",
    )

    def in_si(self, arm: model.Robot, units: Units) -> dict[str, Any]:
        """What `plan_path` and `track_path` both take, with a note where a number looks like one of another unit.

        Raises:
            InvalidInputError: a wrong number of values.
        """
        joints = units.for_joints(arm)
        taken: dict[str, Any] = {
            "dt": self.dt,
            "speed": self.speed,
            "seed": joints.seed("--seed", self.seed),
            "start": joints.seed("--start", self.start),
            "velocity_limit": joints.limits("--velocity-limit", self.velocity_limit, "rad/s"),
            "acceleration_limit": joints.limits("--acceleration-limit", self.acceleration_limit, "rad/s^2"),
        }
        if self.angular_speed is not None:
            warn_of_degrees("--angular-speed", [self.angular_speed], units, "rad/s")
            taken["angular_speed"] = units.to_si([self.angular_speed])[0]
        return taken


@dataclass(frozen=True, slots=True)
class PathSceneOptions:
    """What a path keeps clear of, and how far."""

    scene: Path | None = options.scene()
    clearance: float | None = options.clearance(
        default=None,
        help="Distance to keep between shapes [m]; if not given, 0 for `plan`, and 0.01 for `track` with a scene.",
    )


@dataclass(frozen=True, slots=True)
class PlanOptions:
    """What `plan` decides itself."""

    timing: str = option(
        "--timing", default="keep", metavar="NAME", help="keep the speed, or slow down where joints cannot follow."
    )
    free_axis: list[float] | None = options.free_axis()
    free_range: tuple[float, float] | None = options.free_range(needs=("--free-axis",))


@command(no_args_is_help=True)
def plan(
    given: PathOptions,
    chosen: PlanOptions,
    around: PathSceneOptions,
    written: TrajectoryFile,
    tool: ToolOptions,
    form: FormOptions,
    source: RobotOptions,
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
    written.check(source, {"--path": given.waypoints, "--scene": around.scene})
    poses = read_poses(given.waypoints)
    axis, turns, units = chosen.free_axis, chosen.free_range, form.units
    if turns is not None:
        warn_of_degrees("--free-range", turns, units)
    targets = poses if axis is None else [free_about(pose, axis, turns, units) for pose in poses]
    arm = source.load()
    keep_degrees(written.output, arm)
    numbers = given.in_si(arm, units)
    scene, clearance = load_scene(around.scene), around.clearance or 0.0
    solver = ik.IKSolver(arm, tool.frame, tool=tool.tool, collision="reject", scene=scene, clearance=clearance)

    def compute() -> motion.Trajectory:
        return motion.plan_path(solver, targets, timing=chosen.timing, **numbers)

    deliver(compute, arm, written, tool, form)


@command(no_args_is_help=True)
def track(
    given: PathOptions,
    around: PathSceneOptions,
    written: TrajectoryFile,
    tool: ToolOptions,
    form: FormOptions,
    source: RobotOptions,
) -> None:
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
    written.check(source, {"--path": given.waypoints, "--scene": around.scene})
    poses = read_poses(given.waypoints)
    scene = load_scene(around.scene)
    arm = source.load()
    keep_degrees(written.output, arm)
    numbers = given.in_si(arm, form.units)

    def compute() -> motion.Trajectory:
        with progress_bar("tracking") as progress:
            return motion.track_path(
                arm,
                poses,
                frame=tool.frame,
                tool=tool.tool,
                scene=scene,
                clearance=around.clearance,
                progress=progress,
                **numbers,
            )

    deliver(compute, arm, written, tool, form)


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


def deliver(
    compute: Callable[[], motion.Trajectory],
    arm: model.Robot,
    written: TrajectoryFile,
    tool: ToolOptions,
    form: FormOptions,
) -> None:
    """Compute a trajectory, write and draw it where that is asked for, and show it.

    Raises:
        SystemExit: it is not on the path throughout.
    """
    result = written.fill(compute)
    if form.json:
        print_json(arm, result, written, form.units)
    else:
        show(arm, result, written, tool, form.units)
    if not result.success:
        raise SystemExit(NOT_SOLVED)


def print_json(arm: model.Robot, result: motion.Trajectory, written: TrajectoryFile, units: Units) -> None:
    """Print the errors, the margins and every start that was tried as one JSON document."""
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
            "output": str(written.output) if written.keeps(result) else None,
            "plot": None if written.plot is None else str(written.plot),
        }
    )


def show(arm: model.Robot, result: motion.Trajectory, written: TrajectoryFile, tool: ToolOptions, units: Units) -> None:
    """Print a summary; when the tool left the path, where it did from every start."""
    import numpy as np

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
        solver = ik.IKSolver(arm, tool.frame, tool=tool.tool, collision="ignore")
        name = solver.parameter or "free angle"
        shown = [number(units.from_si(value), 3).replace("nan", "none") for value in result.parameter[:SHOWN]]
        more = "" if len(result.parameter) <= SHOWN else f" and {len(result.parameter) - SHOWN} more"
        lines.append((f"{name} at the poses", f"{', '.join(shown)}{more} {units.angle}"))
    lines += written.facts(result)
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


@dataclass(frozen=True, slots=True)
class MoveOptions:
    """From where to where, how long the search may take, and how fast the arm moves."""

    start: list[float] | None = option("--from", metavar="Q1 .. Q6", help="Joint angles now; home if not given.")
    goal: list[float] | None = option("--to", metavar="Q1 .. Q6", help="Joint angles to go to, in place of a pose.")
    time_limit: float = option("--time-limit", default=2.0, metavar="T", help="For the search [s].")
    random_seed: int | None = options.random_seed()
    dt: float = options.dt()
    velocity_limit: list[float] | None = options.velocity_limit()
    acceleration_limit: list[float] | None = options.acceleration_limit()
    torque_limit: list[float] | None = option(
        "--torque-limit",
        metavar="N ..",
        help="Of the joints [N m], one for all or one for each: the motion is slowed down until none needs more.",
    )
    rated_torque: bool = switch(
        "--rated-torque", without=("--torque-limit",), help="The same, with the limits of the robot's description."
    )


@command(no_args_is_help=True)
def move(
    given: MoveOptions,
    wanted: TargetOptions,
    around: SceneOptions,
    written: TrajectoryFile,
    tool: ToolOptions,
    form: FormOptions,
    source: RobotOptions,
) -> None:
    """Plan a motion to a pose or to joint angles that touches nothing on its way.

    Exit code: 0 there is one, 1 not, 2 wrong input.

    Examples:
      jacokin move --position 0.3 -0.2 0.5 --down --output motion.csv
      jacokin move --position 0.4 0.3 0.3 --approach 1 0 0 --scene scene.yaml --clearance 0.01
      jacokin move --from 275 167 57 241 83 76 --to 200 180 90 240 80 70 --degrees --output arm.kinova.csv
    """
    import numpy as np

    has_pose = wanted.position is not None or wanted.kinova is not None
    if has_pose == (given.goal is not None):
        raise InvalidInputError("exactly one of --to and a pose (--position or --kinova) is needed")
    written.check(source, {"--scene": around.scene})
    arm = source.load()
    options.keep_degrees(written.output, arm)
    joints = form.units.for_joints(arm)
    scene, clearance = around.load(), around.clearance
    solver = ik.IKSolver(arm, tool.frame, tool=tool.tool, collision="reject", scene=scene, clearance=clearance)
    target = wanted.build(form.units) if given.goal is None else np.array(joints.configuration("--to", given.goal))
    limits = joints.limits("--acceleration-limit", given.acceleration_limit, "rad/s^2")
    acceleration: dict[str, Any] = {} if limits is None else {"acceleration_limit": limits}

    def compute() -> motion.Trajectory:
        return motion.plan_motion(
            solver,
            arm.home if given.start is None else joints.configuration("--from", given.start),
            target,
            time_limit=given.time_limit,
            rng=load_generator(given.random_seed),
            dt=given.dt,
            velocity_limit=joints.limits("--velocity-limit", given.velocity_limit, "rad/s"),
            torque_limit=given.rated_torque
            or (given.torque_limit[0] if given.torque_limit and len(given.torque_limit) == 1 else given.torque_limit),
            **acceleration,
        )

    result = written.fill(compute)
    if form.json:
        _print_json(arm, result, form.units)
    else:
        _show(arm, result, form.units, written.facts(result))
    if not result.success:
        raise SystemExit(NOT_SOLVED)


def _print_json(arm: model.Robot, result: motion.Trajectory, units: Units) -> None:
    joints = units.for_joints(arm)
    display.print_json(
        {
            **display.identity(arm),
            "success": result.success,
            "outcome": result.outcome,
            "message": result.message,
            "duration": result.duration,
            "joint_names": arm.joint_names,
            "q_start": joints.from_si(result.q[0]),
            "q_end": joints.from_si(result.q[-1]),
            "min_clearance": _least(result),
            "angle_unit": units.angle,
        }
    )


def _show(arm: model.Robot, result: motion.Trajectory, units: Units, written: list[tuple[str, str]]) -> None:
    joints = units.for_joints(arm)
    ends = zip(joints.from_si(result.q[-1]), joints.names, strict=True)
    lines = [
        ("result", "there is a way" if result.success else "no way"),
        ("note", units.in_words(result.message)),
    ]
    if result.success:
        lines += [
            ("duration", f"{result.duration:.3f} s, {len(result)} rows"),
            ("ends at", ", ".join(f"{number(value)} {unit}" for value, unit in ends)),
        ]
    else:
        lines.append(("advice", motion.MotionStatus[result.outcome].value))
    least = _least(result)
    if least is not None:
        lines.append(("least clearance", f"{number(least)} m"))
    show_facts([*lines, *written], arm.label)


def _least(result: motion.Trajectory) -> float | None:
    """The smallest distance along a motion [m]; None where none was measured."""
    known = [each for each in result.clearance.tolist() if math.isfinite(each)]
    return min(known, default=None)
