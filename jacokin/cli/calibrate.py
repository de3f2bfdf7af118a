"""`jacokin calibrate FILE`: the arm behind some measurements; `jacokin calibrate plan`: what to measure."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from operator import lt
from pathlib import Path
from typing import Any

import click

from jacokin import calibration, logs, model
from jacokin.cli import display, options
from jacokin.cli.command import FILE, command, option, switch
from jacokin.cli.groups import FormOptions, RobotOptions, load_scene
from jacokin.cli.options import Vector3
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


@dataclass(frozen=True, slots=True)
class InstrumentOptions:
    """What measures, how well, and what of its place is known."""

    sigma: float | None = option("--sigma", metavar="M", help="Error of the instrument [m]; of a plan 0.0003.")
    sigma_angle: float | None = option(
        "--sigma-angle", needs=("--sigma",), metavar="A", help="Of poses: its error in angles [rad]."
    )
    unknown_base: bool = switch("--unknown-base", help="The instrument does not measure in the arm's base.")
    unknown_tool: bool = switch("--unknown-tool", help="The measured point is not the origin of --frame.")
    frame: str | None = options.frame()

    @property
    def error(self) -> float | tuple[float, float] | None:
        """Of a position [m], or of a pose [m] and [rad]; None where it is not given."""
        return self.sigma if self.sigma is None or self.sigma_angle is None else (self.sigma, self.sigma_angle)

    @property
    def placed(self) -> dict[str, Any]:
        """The frame, and whether base and tool are known, as `jacokin.calibration` takes them."""
        return {
            "frame": self.frame,
            "base": "unknown" if self.unknown_base else "known",
            "tool": "unknown" if self.unknown_tool else "known",
        }


@dataclass(frozen=True, slots=True)
class RestOptions:
    """What is read from a recording of ROS."""

    joints_topic: str | None = options.joints_topic()
    pose_topic: str | None = option(
        "--pose-topic", metavar="NAME", help="Of a log: what measures the hand; the only one is found."
    )
    joint_prefix: str | None = options.joint_prefix()
    still: tuple[float, float] | None = option(
        "--still",
        metavar="V S",
        help="Of a log: the arm stands still where no joint is quicker than V rad/s for S seconds; 0.01 1 by default.",
    )

    @property
    def is_given(self) -> bool:
        """Whether one of them is."""
        return bool(self.joints_topic or self.pose_topic or self.joint_prefix or self.still)

    def load(self, path: Path, arm: model.Robot, instrument: InstrumentOptions) -> calibration.Measurements:
        """The measurements in a recording.

        Raises:
            InvalidInputError: as `Measurements.from_log`, or the error of the instrument is not given.
        """
        error = instrument.error
        if error is None:
            raise InvalidInputError(f"--sigma is needed: {path} does not say how good the instrument is")
        return calibration.Measurements.from_log(
            logs.Log(path, arm, prefix=self.joint_prefix),
            sigma=error,
            rule=None if self.still is None else logs.StandstillRule(speed=self.still[0], duration=self.still[1]),
            joints=self.joints_topic,
            poses=self.pose_topic,
            **instrument.placed,
        )


@dataclass(frozen=True, slots=True)
class FitOptions:
    """What is measured, what may be off, and what is written."""

    files: Sequence[Path] = option(
        nargs=-1,
        type=FILE,
        metavar="FILE...",
        text="Measurements: .csv, .npz or .parquet; or recordings of ROS: .bag, .mcap or .db3.",
    )
    output: Path | None = option("--output", metavar="FILE.toml", help="What --calibration takes.")
    report: Path | None = option("--report", metavar="FILE.html", help="A page with pictures.")
    urdf: Path | None = option("--urdf", help="The arm for other programs.")
    mjcf: Path | None = option("--mjcf", help="The arm for MuJoCo.")
    contact: str | None = option(
        "--contact", metavar="plane|point", help="The point touched one plane, or one point, every time."
    )
    kinova: bool = switch("--kinova", help="The files have millimetres and degrees, as Kinova's software.")
    estimate: Sequence[str] = option(
        "--estimate",
        multiple=True,
        metavar="WHAT",
        help="What may be off: geometry, offset (these two by default), scale, compliance; or none: only base and tool "
        "are looked for. Repeatable.",
    )
    prior: Vector3 | None = option(
        "--prior",
        type=(click.FloatRange(0.0, min_open=True),) * 3,
        metavar="M RAD RAD",
        help="How far arms are from their description, in place, axis and zero of a joint; "
        "0.001 0.003 0.0175 by default.",
    )

    @property
    def outputs(self) -> dict[str, Path | None]:
        """Option and file of all that is written."""
        return {"--output": self.output, "--report": self.report, "--urdf": self.urdf, "--mjcf": self.mjcf}

    def check(self, source: RobotOptions, recorded: RestOptions, units: Units) -> None:
        """Refuse options that do not go together.

        Raises:
            InvalidInputError: names them.
        """
        if not self.files:
            raise InvalidInputError("give a file of measurements")
        source.keep_apart(self.outputs, {f"FILE {path}": path for path in self.files})
        first = next((path for path in self.files if path.suffix in ENDINGS), None)
        if first is not None and (self.contact is not None or self.kinova or units.degrees):
            raise InvalidInputError(f"--contact, --kinova and --degrees are not for a recording of ROS: {first}")
        if first is None and recorded.is_given:
            raise InvalidInputError(
                "--joints-topic, --pose-topic, --joint-prefix and --still are for a recording of ROS: .bag, .mcap, .db3"
            )
        if NOTHING in self.estimate and len(set(self.estimate)) > 1:
            raise InvalidInputError("--estimate none goes with no other --estimate")

    def write(self, found: calibration.Calibration) -> None:
        """Write what is asked for: all of it, or nothing where one cannot be written."""
        writers = (found.save, found.report, found.write_urdf, found.write_mjcf)
        with ExitStack() as stack:
            for path, write in zip(self.outputs.values(), writers, strict=True):
                if path is not None:
                    write(stack.enter_context(replacing(path)))


@command(FIT, group=calibrate, no_args_is_help=True)
def fit(
    given: FitOptions, instrument: InstrumentOptions, recorded: RestOptions, form: FormOptions, source: RobotOptions
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
    given.check(source, recorded, form.units)
    arm = source.load()
    sets = [
        recorded.load(path, arm, instrument)
        if path.suffix in ENDINGS
        else calibration.Measurements.load(
            path,
            sigma=instrument.error,
            contact=given.contact,
            degrees=form.units.degrees,
            kinova=given.kinova,
            **instrument.placed,
        )
        for path in given.files
    ]
    groups = [] if NOTHING in given.estimate else given.estimate or "auto"
    found = calibration.calibrate(
        arm, sets, groups, prior=None if given.prior is None else calibration.Prior(*given.prior)
    )
    given.write(found)
    if form.json:
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
        for path in given.outputs.values():
            if path is not None:
                display.say(f"written to {path}")


@dataclass(frozen=True, slots=True)
class DesignOptions:
    """How many configurations, and where."""

    points: int = option(
        "--points", type=click.IntRange(1, 1000), default=30, metavar="N", help="How many configurations, at most 1000."
    )
    output: Path | None = option("--output", metavar="FILE.csv", help="The configurations, with x, y, z to fill in.")
    poses: bool = switch("--poses", help="Poses are measured, not positions.")
    lower: Vector3 | None = options.lower_corner(help="Lower corner of what is seen [m].")
    upper: Vector3 | None = options.upper_corner(help="Upper corner of what is seen [m].")
    scene: Path | None = options.scene()
    clearance: float = option("--clearance", default=0.02, metavar="D", help="The arm stays this far from contact [m].")


@command(group=calibrate)
def plan(given: DesignOptions, instrument: InstrumentOptions, form: FormOptions, source: RobotOptions) -> None:
    """Say which configurations to measure, and how good the result will be.

    They are clear of contact, those that say most come first.

    Examples:
      jacokin calibrate plan --points 30 --output m.csv
      jacokin calibrate plan --points 40 --poses --unknown-base --unknown-tool --degrees
      jacokin calibrate plan --scene table.yaml --lower -0.8 -0.8 0 --upper 0.8 0 1
    """
    if given.lower is not None and given.upper is not None and not all(map(lt, given.lower, given.upper)):
        raise InvalidInputError(f"--lower must be below --upper [m], got {given.lower} and {given.upper}")
    source.keep_apart({"--output": given.output}, {"--scene": given.scene})
    arm = source.load()
    error = instrument.error
    if given.poses and instrument.sigma is not None and instrument.sigma_angle is None:
        error = (instrument.sigma, 1e-3)  # [rad] where none is given
    elif not given.poses:
        error = instrument.sigma
    measured = "pose" if given.poses else "position"
    q = calibration.plan_measurements(
        arm,
        given.points,
        measured=measured,
        sigma=error,
        **instrument.placed,
        scene=load_scene(given.scene),
        within=None if given.lower is None or given.upper is None else (given.lower, given.upper),
        clearance=given.clearance,
    )
    promised = calibration.predict_accuracy(arm, q, measured=measured, sigma=error, **instrument.placed)
    rows = [form.units.for_joints(arm).from_si(row) for row in q]
    if given.output is not None:
        columns = [
            *(f"joint_{number + 1}" for number in range(arm.dof)),
            "x",
            "y",
            "z",
            *(("qw", "qx", "qy", "qz") if given.poses else ()),
        ]
        empty = "," * (len(columns) - arm.dof)
        lines = [",".join(columns), *(",".join(map(repr, row)) + empty for row in rows)]
        with replacing(given.output) as temporary:
            temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")
    if form.json:
        display.print_json({"q": rows, "angle_unit": form.units.angle, "accuracy": asdict(promised)})
    else:
        heading = form.units.for_joints(arm).labels(arm.joint_names)
        display.show_table(None, heading, [[display.number(value) for value in row] for row in rows], text=0)
        display.echo(str(promised))
        if given.output is not None:
            display.say(f"written to {given.output}")
