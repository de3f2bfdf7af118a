"""`jacokin plan`: a joint trajectory along a path of poses, planned over all branches."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

from jacokin.cli.arguments import options
from jacokin.cli.arguments.declared import Option
from jacokin.cli.arguments.free_axis import free_about
from jacokin.cli.arguments.units import Units
from jacokin.errors import InvalidInputError

if TYPE_CHECKING:
    from jacokin.ik.paths.result import PathResult


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
    from jacokin.cli.paths import inputs, report
    from jacokin.ik.paths.plan import plan_path
    from jacokin.ik.paths.track import ANGULAR_SPEED
    from jacokin.ik.solver import IKSolver

    report.check_files(output, plot, {"--path": path, "--robot": source.robot, "--scene": scene}, source.package_dir)
    units = Units(degrees)
    poses = inputs.poses(path)
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
            seed=inputs.of_joints("--seed", seed, joints),
            start=inputs.of_joints("--start", start, joints),
            velocity_limit=inputs.of_joints("--velocity-limit", velocity_limit, joints),
            acceleration_limit=inputs.of_joints("--acceleration-limit", acceleration_limit, joints),
        )

    report.deliver(planned, arm, units, output, plot, as_json=json)
