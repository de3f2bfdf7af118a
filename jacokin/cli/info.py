"""`jacokin info`: joints, limits with their source, home and frames of a robot."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import click

from jacokin import ik, model
from jacokin.cli import display, options
from jacokin.cli.command import Argument, Command
from jacokin.cli.options import RobotOptions
from jacokin.cli.units import JointUnits, Units
from jacokin.errors import InvalidInputError
from jacokin.model.descriptions import bundled


@click.command(cls=Command)
@click.argument("name", cls=Argument, required=False, metavar="[NAME|FILE]", text=options.NAME_OR_FILE)
@click.option("--robot", metavar="NAME|FILE", help="As NAME|FILE, for who is used to it from the other commands.")
@options.degrees
@options.json
@options.base
@options.tip
@options.package_dir
@options.calibration
def info(
    name: str | None,
    robot: str | None,
    units: Units,
    json: bool,
    base: str | None,
    tip: str | None,
    package_dirs: Sequence[Path],
    calibration: Path | None,
) -> None:
    """Show joints, limits with their source, home and frames.

    Bundled robots: j2n6s300 (the default), j2n6s200, j2s6s300, j2s6s200, m1n6s300, m1n6s200, gen3_6dof, gen3_lite;
    with seven joints j2s7s300, j2s7s200, gen3.

    Examples:
      jacokin info
      jacokin info j2s6s200 --degrees
      jacokin info urdf/j2n6s300.urdf --json
    """
    if name is not None and robot is not None:
        raise InvalidInputError("give the robot once: as an argument, or with --robot")
    arm = RobotOptions(robot or name or model.DEFAULT_ROBOT, base, tip, package_dirs, calibration=calibration).load()
    joints = units.for_joints(arm)
    rows = list_joints(arm, joints)
    sources = list_sources(arm)
    placed = ik.structure(arm)
    chain = arm.pin_model
    parents = [chain.frames[arm.frame_id(name)].parentJoint for name in arm.frames]
    frames = [
        (name, str(chain.names[joint]) if joint else "nothing") for name, joint in zip(arm.frames, parents, strict=True)
    ]
    if json:
        display.print_json(
            {
                "robot": arm.name,
                "file": str(arm.source.path),
                "calibration": None if arm.calibration is None else describe_calibration(arm.calibration),
                "base": arm.base,
                "default_frame": arm.default_frame,
                "angle_unit": units.angle,
                "joints": [asdict(row) for row in rows],
                "sources": sources,
                "home": joints.from_si(arm.home),
                "home_source": arm.home_source,
                "structure": asdict(placed),
                "frames": [{"name": name, "moved_by": joint} for name, joint in frames],
                "notes": list(arm.notes),
            }
        )
        return
    slides = bool(arm.sliding.any())
    home = [
        f"{display.number(value)} {row.unit}" if slides else display.number(value)
        for value, row in zip(joints.from_si(arm.home), rows, strict=True)
    ]
    facts = [
        ("file", str(arm.source.path)),
        *(() if arm.calibration is None else (("calibrated", f"{calibration}: {arm.calibration}"),)),
        ("base", arm.base),
        ("default frame", arm.default_frame),
        (joints.heading("home"), "  ".join(home)),
        ("home from", arm.home_source),
        ("structure", placed.name),
        ("solved by", placed.method),
        *(("misses", str(residual)) for residual in placed.residuals),
    ]
    display.show_facts(facts, arm.label)
    columns = (
        "joint",
        joints.heading("lower"),
        joints.heading("upper"),
        "speed [unit/s]" if slides else f"speed [{units.angle}/s]",
        "source",
        "effort [N or N m]" if slides else "effort [N m]",
        "datasheet",
    )
    lines = [
        (
            label,
            display.number(row.lower),
            display.number(row.upper),
            display.number(row.velocity, missing="not given"),
            row.source,
            display.number(row.effort, 1, missing="not given"),
            "unknown" if row.datasheet_torque is None else f"{row.datasheet_torque} ({row.datasheet_source})",
        )
        for label, row in zip(joints.labels(arm.joint_names), rows, strict=True)
    ]
    display.show_table("Joints", columns, lines)
    notes = [(f"source {key}", text) for key, text in sources.items()]
    notes.append(("effort", "the limit the file states, same source as the angles"))
    if arm.source.bundled is not None:
        notes.append(("datasheet", "peak torque [N m]; it differs from the file's effort"))
    notes += [("note", text) for text in arm.notes]
    display.show_facts(notes)
    display.show_table("Frames", ("frame", "moved by"), frames, text=2)


def describe_calibration(measured: model.MeasuredArm) -> dict[str, object]:
    """What the file of a calibration holds."""
    return {"file": str(measured.path), "facts": dict(measured.facts)} | {
        "joints": {name: asdict(joint) for name, joint in measured.joints}
    }


@dataclass(frozen=True, slots=True)
class JointRow:
    """Limits of a joint in the units of the user, and the datasheet's torque where the robot is a bundled one."""

    name: str
    unlimited: bool
    unit: str
    lower: float
    upper: float
    velocity: float
    effort: float
    datasheet_torque: float | None
    source: str
    datasheet_source: str | None


def list_joints(arm: model.Robot, units: JointUnits) -> list[JointRow]:
    """A row for each joint."""
    lower, upper, velocity = (units.from_si(row) for row in (arm.lower, arm.upper, arm.velocity_limit))
    robot = arm.source.bundled
    rows = []
    for k, name in enumerate(arm.joint_names):
        torque, source, letter = None, "file", None
        if robot is not None:
            numbers = bundled.arm_joints(robot)[name]
            actuator = bundled.actuator(numbers["group"])
            if actuator:
                torque, letter = max(actuator["force_range"]), actuator["source"]
            source = numbers.get("source", bundled.arm(robot)["source"])
        limits = (lower[k], upper[k], velocity[k], float(arm.effort_limit[k]))
        rows.append(JointRow(name, bool(arm.unlimited[k]), units.names[k], *limits, torque, source, letter))
    return rows


def list_sources(arm: model.Robot) -> dict[str, str]:
    """What the letters in the joint table stand for."""
    if arm.source.bundled is None:
        return {"file": str(arm.source.path)}
    groups = {row["group"] for row in bundled.arm_joints(arm.source.bundled).values()}
    letters = {row["source"] for group in groups if (row := bundled.actuator(group))}
    return {key: bundled.source_text(key) for key in (bundled.arm(arm.source.bundled)["source"], *sorted(letters))}
