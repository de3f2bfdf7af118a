"""`jacokin plan`: a joint trajectory along a path of poses, planned over all branches."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from jacokin.cli import options
from jacokin.cli.declared import Option
from jacokin.cli.display import progress_bar
from jacokin.cli.options import free_about
from jacokin.cli.units import JointUnits, Units, numbers
from jacokin.errors import InvalidInputError

if TYPE_CHECKING:
    from jacokin.arrays import Array
    from jacokin.motion.trajectory import PathResult


def plan(
    path: options.PathOption,
    dt: options.TimeStepOption = 0.01,
    output: options.TrajectoryOption = None,
    plot: options.PlotOption = None,
    speed: options.SpeedOption = 0.05,
    angular_speed: options.AngularSpeedOption = None,
    timing: Annotated[
        str, Option("--timing", metavar="NAME", help="keep the speed, or slow down where joints cannot follow.")
    ] = "keep",
    free_axis: options.FreeAxisOption = None,
    free_range: options.FreeRangeOption = None,
    velocity_limit: options.VelocityLimitOption = None,
    acceleration_limit: Annotated[
        str | None,
        Option("--acceleration-limit", metavar="A ..", help="Of the joints [rad/s^2]; needs --timing slow."),
    ] = None,
    scene: options.SceneOption = None,
    clearance: options.ClearanceOption = None,
    frame: options.FrameOption = None,
    tool: options.ToolOption = None,
    seed: options.SeedOption = None,
    start: Annotated[
        str | None, Option("--start", metavar="Q1 .. Q6", help="Joint angles the arm is at, instead of --seed.")
    ] = None,
    degrees: options.DegreesOption = False,
    json: options.JsonOption = False,
    *,
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
    from jacokin.cli import trajectory_report
    from jacokin.ik.solver import IKSolver
    from jacokin.motion.planning.plan import plan_path
    from jacokin.motion.track import ANGULAR_SPEED

    trajectory_report.check_files(
        output, plot, {"--path": path, "--robot": source.robot, "--scene": scene}, source.package_dir
    )
    units = Units(degrees)
    poses = read_poses(path)
    if free_axis is None and free_range is not None:
        raise InvalidInputError("--free-range needs --free-axis")
    targets = poses if free_axis is None else [free_about(pose, free_axis, free_range, units) for pose in poses]
    around, distance = options.surroundings(scene, clearance)
    arm = source.load()
    joints = units.of_joints(arm)
    solver = IKSolver(arm, frame, tool=options.tool_pose(tool), collision="reject", scene=around, clearance=distance)

    def planned() -> PathResult:
        return plan_path(
            solver,
            targets,
            dt=dt,
            speed=speed,
            angular_speed=ANGULAR_SPEED if angular_speed is None else units.read([angular_speed])[0],
            timing=timing,
            seed=of_joints("--seed", seed, joints),
            start=of_joints("--start", start, joints),
            velocity_limit=of_joints("--velocity-limit", velocity_limit, joints),
            acceleration_limit=of_joints("--acceleration-limit", acceleration_limit, joints),
        )

    trajectory_report.deliver(planned, arm, units, output, plot, as_json=json)


def track(
    path: options.PathOption,
    dt: options.TimeStepOption = 0.01,
    output: options.TrajectoryOption = None,
    plot: options.PlotOption = None,
    speed: options.SpeedOption = 0.05,
    angular_speed: options.AngularSpeedOption = None,
    velocity_limit: options.VelocityLimitOption = None,
    acceleration_limit: Annotated[
        str | None,
        Option("--acceleration-limit", metavar="A ..", help="Of the joints [rad/s^2]; none if not given."),
    ] = None,
    scene: options.SceneOption = None,
    clearance: Annotated[
        float | None,
        Option("--clearance", metavar="D", help="Distance kept between shapes [m]; 0.01 with a scene."),
    ] = None,
    frame: options.FrameOption = None,
    tool: options.ToolOption = None,
    seed: options.SeedOption = None,
    start: Annotated[
        str | None,
        Option("--start", metavar="Q1 .. Q6", help="Joint angles the arm is at: no other branch is tried."),
    ] = None,
    degrees: options.DegreesOption = False,
    json: options.JsonOption = False,
    *,
    source: options.RobotOptions,
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
    from jacokin.cli import trajectory_report
    from jacokin.motion.track import ANGULAR_SPEED, track_path

    poses = read_poses(path)
    trajectory_report.check_files(
        output, plot, {"--path": path, "--robot": source.robot, "--scene": scene}, source.package_dir
    )
    around = options.surroundings(scene, clearance)[0]
    arm = source.load()
    units = Units(degrees)
    joints = units.of_joints(arm)

    def follow() -> PathResult:
        with progress_bar("tracking") as progress:
            return track_path(
                arm,
                poses,
                dt=dt,
                speed=speed,
                angular_speed=ANGULAR_SPEED if angular_speed is None else units.read([angular_speed])[0],
                frame=frame,
                tool=options.tool_pose(tool),
                seed=of_joints("--seed", seed, joints),
                start=of_joints("--start", start, joints),
                velocity_limit=of_joints("--velocity-limit", velocity_limit, joints),
                acceleration_limit=of_joints("--acceleration-limit", acceleration_limit, joints),
                scene=around,
                clearance=clearance,
                progress=progress,
            )

    trajectory_report.deliver(follow, arm, units, output, plot, as_json=json)


def of_joints(option: str, text: str | None, joints: JointUnits) -> list[float] | None:
    """Numbers for the joints, in [rad] and [m]; one number stands for all.

    Raises:
        InvalidInputError: not numbers.
    """
    values = numbers(option, text)
    if values is not None and len(values) == 1 and option.endswith("-limit"):
        values *= len(joints.sliding)
    return None if values is None else joints.read(values)


def read_poses(path: Path) -> Array:
    """The poses of a path file (n, 4, 4).

    Raises:
        InvalidInputError: as `read_targets`, or the file has no orientations.
    """
    from jacokin.ik.files.csv_files import read_targets
    from jacokin.ik.files.targets import QUATERNION, RPY

    targets = read_targets(path).targets
    if targets.ndim != 3:
        raise InvalidInputError(
            f"{path}: a path needs orientations, columns {', '.join(QUATERNION)} or {', '.join(RPY)}"
        )
    return targets
