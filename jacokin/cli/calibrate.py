"""`jacokin calibrate FILE`: the arm behind some measurements; `jacokin calibrate plan`: what to measure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import click

from jacokin import calibration, logs
from jacokin.cli import display, options
from jacokin.cli.command import Argument, Command
from jacokin.cli.options import RobotOptions, Vector3, keep_apart
from jacokin.cli.units import Units
from jacokin.errors import InvalidInputError
from jacokin.files import replacing
from jacokin.logs.bag import ENDINGS

FIT, NOTHING = "fit", "none"


class FitUnlessNamed(click.Group):
    """A group whose first command needs no name: `jacokin calibrate m.csv`."""

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """The command that is named, or the first one."""
        return super().resolve_command(ctx, args if args[0] in self.commands else [FIT, *args])


@click.group(cls=FitUnlessNamed, context_settings={"ignore_unknown_options": True}, no_args_is_help=True)
def calibrate() -> None:
    """Find your arm from measured points.

    `jacokin calibrate FILE` is `jacokin calibrate fit FILE`.
    """


unknown_base = click.option("--unknown-base", is_flag=True, help="The instrument does not measure in the arm's base.")
unknown_tool = click.option("--unknown-tool", is_flag=True, help="The measured point is not the origin of --frame.")
sigma = click.option("--sigma", type=float, metavar="M", help="Error of the instrument [m]; of a plan 0.0003.")
sigma_angle = click.option("--sigma-angle", type=float, metavar="A", help="Of poses: its error in angles [rad].")


@calibrate.command(FIT, cls=Command, no_args_is_help=True)
@click.argument(
    "files",
    cls=Argument,
    nargs=-1,
    type=options.FILE,
    metavar="FILE...",
    text="Measurements: .csv, .npz or .parquet; or recordings of ROS: .bag, .mcap or .db3.",
)
@click.option("--output", type=options.FILE, metavar="FILE.toml", help="What --calibration takes.")
@click.option("--report", type=options.FILE, metavar="FILE.html", help="A page with pictures.")
@click.option("--urdf", type=options.FILE, metavar="FILE", help="The arm for other programs.")
@click.option("--mjcf", type=options.FILE, metavar="FILE", help="The arm for MuJoCo.")
@sigma
@sigma_angle
@unknown_base
@unknown_tool
@click.option("--contact", metavar="plane|point", help="The point touched one plane, or one point, every time.")
@click.option("--kinova", is_flag=True, help="The files have millimetres and degrees, as Kinova's software.")
@click.option(
    "--estimate",
    multiple=True,
    metavar="WHAT",
    help="What may be off: geometry, offset (these two by default), scale, compliance; or none: only base and tool "
    "are looked for. Repeatable.",
)
@click.option(
    "--prior",
    type=(float, float, float),
    metavar="M RAD RAD",
    help="How far arms are from their description, in place, axis and zero of a joint; 0.001 0.003 0.0175 by default.",
)
@options.joints_topic
@click.option("--pose-topic", metavar="NAME", help="Of a log: what measures the hand; the only one is found.")
@options.joint_prefix
@click.option(
    "--still",
    type=(float, float),
    metavar="V S",
    help="Of a log: the arm stands still where no joint is quicker than V rad/s for S seconds; 0.01 1 by default.",
)
@options.frame
@options.degrees
@options.json
@options.robot()
def fit(
    files: Sequence[Path],
    output: Path | None,
    report: Path | None,
    urdf: Path | None,
    mjcf: Path | None,
    sigma: float | None,
    sigma_angle: float | None,
    unknown_base: bool,
    unknown_tool: bool,
    contact: str | None,
    kinova: bool,
    estimate: Sequence[str],
    prior: tuple[float, float, float] | None,
    joints_topic: str | None,
    pose_topic: str | None,
    joint_prefix: str | None,
    still: tuple[float, float] | None,
    frame: str | None,
    units: Units,
    json: bool,
    source: RobotOptions,
) -> None:
    """Find the arm behind some measurements.

    Columns of the files: joint_1, joint_2, ... as the arm reports them, x, y, z [m], for poses also qw, qx, qy, qz or
    roll, pitch, yaw; for distances `distance`, px, py, pz. Rows that are grossly off are left out and named. Of a
    recording of ROS, rows are where the arm stands still and its hand is measured.

    Examples:
      jacokin calibrate m.csv --sigma 0.0003 --output my_arm.toml --report report.html
      jacokin calibrate poses.csv --sigma 0.001 --sigma-angle 0.002 --unknown-base --unknown-tool
      jacokin calibrate camera.csv --sigma 0.001 --sigma-angle 0.002 --unknown-base --unknown-tool --estimate none
      jacokin calibrate run.mcap --sigma 0.001 --sigma-angle 0.002 --unknown-base --unknown-tool --still 0.01 1
      jacokin calibrate touched.csv --contact plane --sigma 0.0005 --output my_arm.toml
      jacokin ik --calibration my_arm.toml --position 0.3 -0.2 0.5 --down
    """
    if not files:
        raise InvalidInputError("give a file of measurements")
    outputs = {"--output": output, "--report": report, "--urdf": urdf, "--mjcf": mjcf}
    keep_apart(outputs, {f"FILE {path}": path for path in files} | {"--robot": source.robot}, source.package_dirs)
    if sigma_angle is not None and sigma is None:
        raise InvalidInputError("--sigma-angle needs --sigma")
    given = None if sigma is None else sigma if sigma_angle is None else (sigma, sigma_angle)
    placed: dict[str, Any] = {
        "frame": frame,
        "base": "unknown" if unknown_base else "known",
        "tool": "unknown" if unknown_tool else "known",
    }
    recorded = [path for path in files if path.suffix in ENDINGS]
    if recorded and (contact is not None or kinova or units.degrees):
        raise InvalidInputError(f"--contact, --kinova and --degrees are not for a recording of ROS: {recorded[0]}")
    if not recorded and (joints_topic or pose_topic or joint_prefix or still):
        raise InvalidInputError(
            "--joints-topic, --pose-topic, --joint-prefix and --still are for a recording of ROS: .bag, .mcap, .db3"
        )
    if recorded and given is None:
        raise InvalidInputError(f"--sigma is needed: {recorded[0]} does not say how good the instrument is")
    arm = source.load()
    rule = None if still is None else logs.StandstillRule(speed=still[0], duration=still[1])
    sets = [
        calibration.Measurements.from_log(
            logs.Log(path, arm, prefix=joint_prefix),
            sigma=given,
            rule=rule,
            joints=joints_topic,
            poses=pose_topic,
            **placed,
        )
        if path in recorded and given is not None
        else calibration.Measurements.load(
            path, sigma=given, contact=contact, degrees=units.degrees, kinova=kinova, **placed
        )
        for path in files
    ]
    if NOTHING in estimate and len(set(estimate)) > 1:
        raise InvalidInputError("--estimate none goes with no other --estimate")
    groups = [] if NOTHING in estimate else estimate or "auto"
    known = None if prior is None else calibration.Prior(*prior)
    found = calibration.calibrate(arm, sets, groups, prior=known)
    if output is not None:
        found.save(output)
    if report is not None:
        found.report(report)
    if urdf is not None:
        found.write_urdf(urdf)
    if mjcf is not None:
        found.write_mjcf(mjcf)
    if json:
        display.print_json(
            {
                "facts": dict(found.measured_arm.facts),
                "noise": found.noise,
                "p_value": found.p_value,
                "base": None if found.base is None else found.base.homogeneous,
                "tools": [{"frame": name, "pose": pose.homogeneous} for name, pose in found.tools.items()],
                "parameters": {name: asdict(each) for name, each in found.parameters.items()},
                "rejected": [asdict(each) for each in found.rejected],
                "unidentified": found.unidentified,
                "residuals": found.residuals,
                "trends": [asdict(each) for each in found.trends],
            }
        )
    else:
        display.echo(str(found))
    for path in outputs.values():
        if path is not None:
            display.say(f"written to {path}")


@calibrate.command(cls=Command)
@click.option("--points", type=click.IntRange(min=1), default=30, metavar="N", help="How many configurations.")
@click.option("--output", type=options.FILE, metavar="FILE.csv", help="The configurations, with x, y, z to fill in.")
@click.option("--poses", is_flag=True, help="Poses are measured, not positions.")
@sigma
@sigma_angle
@unknown_base
@unknown_tool
@click.option("--lower", type=options.VECTOR, metavar="X Y Z", help="Lower corner of what is seen [m].")
@click.option("--upper", type=options.VECTOR, metavar="X Y Z", help="Upper corner of what is seen [m].")
@options.scene
@click.option("--clearance", default=0.02, metavar="D", help="The arm stays this far from contact [m].")
@options.frame
@options.degrees
@options.json
@options.robot()
def plan(
    points: int,
    output: Path | None,
    poses: bool,
    sigma: float | None,
    sigma_angle: float | None,
    unknown_base: bool,
    unknown_tool: bool,
    lower: Vector3 | None,
    upper: Vector3 | None,
    scene: Path | None,
    clearance: float,
    frame: str | None,
    units: Units,
    json: bool,
    source: RobotOptions,
) -> None:
    """Say which configurations to measure, and how good the result will be.

    They are clear of contact, those that say most come first.

    Examples:
      jacokin calibrate plan --points 30 --output m.csv
      jacokin calibrate plan --points 40 --poses --unknown-base --unknown-tool --degrees
      jacokin calibrate plan --scene table.yaml --lower -0.8 -0.8 0 --upper 0.8 0 1
    """
    if (lower is None) != (upper is None):
        raise InvalidInputError("--lower and --upper go together")
    if sigma_angle is not None and sigma is None:
        raise InvalidInputError("--sigma-angle needs --sigma")
    keep_apart({"--output": output}, {"--scene": scene, "--robot": source.robot}, source.package_dirs)
    arm = source.load()
    error = None if sigma is None else (sigma, 1e-3 if sigma_angle is None else sigma_angle) if poses else sigma
    base, tool = "unknown" if unknown_base else "known", "unknown" if unknown_tool else "known"
    measured = "pose" if poses else "position"
    q = calibration.plan_measurements(
        arm,
        points,
        measured=measured,
        sigma=error,
        frame=frame,
        base=base,
        tool=tool,
        scene=options.load_scene(scene),
        within=None if lower is None or upper is None else (lower, upper),
        clearance=clearance,
    )
    promised = calibration.predict_accuracy(arm, q, measured=measured, sigma=error, frame=frame, base=base, tool=tool)
    rows = [units.for_joints(arm).from_si(row) for row in q]
    if output is not None:
        columns = [*arm.joint_names, "x", "y", "z", *(("qw", "qx", "qy", "qz") if poses else ())]
        empty = "," * (len(columns) - arm.dof)
        lines = [",".join(columns), *(",".join(map(repr, row)) + empty for row in rows)]
        with replacing(output) as temporary:
            temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")
    if json:
        display.print_json({"q": rows, "angle_unit": units.angle, "accuracy": asdict(promised)})
    else:
        heading = units.for_joints(arm).labels(arm.joint_names)
        display.show_table(None, heading, [[display.number(value) for value in row] for row in rows], text=0)
        display.echo(str(promised))
    if output is not None:
        display.say(f"written to {output}")
