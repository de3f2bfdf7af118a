"""`jacokin track`: a joint trajectory that follows a path of poses."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

from jacokin.cli.arguments import options
from jacokin.cli.arguments.declared import Option
from jacokin.cli.arguments.units import Units
from jacokin.cli.display.progress import progress_bar

if TYPE_CHECKING:
    from jacokin.ik.paths.result import PathResult


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
    clearance: Annotated[
        float | None,
        Option("--clearance", metavar="D", help="Distance kept between shapes [m]; 0.01 with obstacles."),
    ] = None,
    box: Annotated[
        list[str] | None,
        Option("--box", metavar="X Y Z A B C", help="An obstacle: centre and edge lengths [m]. Repeatable."),
    ] = None,
    sphere: Annotated[
        list[str] | None,
        Option("--sphere", metavar="X Y Z R", help="An obstacle: centre and radius [m]. Repeatable."),
    ] = None,
    floor: Annotated[
        float | None, Option("--floor", metavar="Z", help="An obstacle: everything below this height [m].")
    ] = None,
    scene: options.SceneOption = None,
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
      jacokin track --path path.csv --floor 0 --box 0.5 -0.5 0.1 0.6 0.6 0.05 --clearance 0.02
    """
    from jacokin.cli.paths import clearances, inputs, report
    from jacokin.ik.paths.track import ANGULAR_SPEED, track_path

    poses = inputs.poses(path)
    report.check_files(output, plot, {"--path": path, "--robot": source.robot, "--scene": scene}, source.package_dir)
    obstacles = clearances.read(clearance, box, sphere, floor, scene)
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
                seed=inputs.of_joints("--seed", seed, joints),
                start=inputs.of_joints("--start", start, joints),
                velocity_limit=inputs.of_joints("--velocity-limit", velocity_limit, joints),
                acceleration_limit=inputs.of_joints("--acceleration-limit", acceleration_limit, joints),
                collision=obstacles,
                progress=progress,
            )

    report.deliver(follow, arm, units, output, plot, as_json=json)
