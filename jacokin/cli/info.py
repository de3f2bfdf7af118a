"""`jacokin info`: what a robot is and can do: joints, limits with their source, home, frames, structure, shapes."""

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
from jacokin.errors import InvalidInputError, ModelError, ShapeError
from jacokin.model.descriptions import bundled


@click.command(cls=Command)
@click.argument("name", cls=Argument, required=False, metavar="[NAME|FILE]", text=options.NAME_OR_FILE)
@click.option("--robot", metavar="NAME|FILE", help="As NAME|FILE, for who is used to it from the other commands.")
@options.degrees
@options.json
@options.base
@options.tip
@options.package_dir
@options.lock
@options.srdf
@options.calibration
def info(
    name: str | None,
    robot: str | None,
    units: Units,
    json: bool,
    base: str | None,
    tip: str | None,
    package_dirs: Sequence[Path],
    locked: dict[str, float] | None,
    srdf: Path | None,
    calibration: Path | None,
) -> None:
    """Show what a robot is: joints, limits with their source, home, frames, structure, shapes, and what is missing.

    Bundled robots: j2n6s300 (the default), j2n6s200, j2s6s300, j2s6s200, m1n6s300, m1n6s200, gen3_6dof, gen3_lite;
    with seven joints j2s7s300, j2s7s200, gen3.

    Examples:
      jacokin info
      jacokin info j2s6s200 --degrees
      jacokin info urdf/j2n6s300.urdf --json
    """
    if name is not None and robot is not None:
        raise InvalidInputError("give the robot once: as an argument, or with --robot")
    named = robot or name or model.DEFAULT_ROBOT
    arm = RobotOptions(named, base, tip, package_dirs, calibration=calibration, locked=locked, srdf=srdf).load()
    joints = units.for_joints(arm)
    rows = list_joints(arm, joints)
    sources = list_sources(arm)
    placed = ik.structure(arm)
    tools = [name for name in arm.tool_frames if name != arm.default_frame]
    shapes, masses = count_shapes(arm), describe_masses(arm)
    gripper, fingers = measure_gripper(arm)
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
                "other_tool_frames": tools,
                "angle_unit": units.angle,
                "joints": [asdict(row) for row in rows],
                "sources": sources,
                "home": joints.from_si(arm.home),
                "home_source": arm.home_source,
                "structure": {**asdict(placed), "gives": placed.gives},
                "shapes": None if shapes is None else asdict(shapes),
                "masses": masses,
                "gripper": gripper,
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
        *((("other tools", ", ".join(tools)),) if tools else ()),
        (joints.heading("home"), "  ".join(home)),
        ("home from", arm.home_source),
        ("structure", placed.name),
        ("solved by", placed.method),
        ("gives", placed.gives),
        *(("misses", str(residual)) for residual in placed.residuals),
        ("shapes", "cannot be loaded" if shapes is None else str(shapes)),
        ("masses", masses),
        ("gripper", fingers),
        *(("note", text) for text in arm.notes),
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
    display.show_facts(notes)
    display.show_table("Frames", ("frame", "moved by"), frames, text=2)


@dataclass(frozen=True, slots=True)
class ShapeCount:
    """What contact is looked for on."""

    shapes: int
    pairs: int
    """Of shapes, which count when they touch."""

    def __str__(self) -> str:
        """In words."""
        return (
            f"{self.shapes}, of which {self.pairs} pairs may touch"
            if self.shapes
            else "none: contact is not looked for"
        )


def count_shapes(arm: model.Robot) -> ShapeCount | None:
    """How many collision shapes an arm has; None where they cannot be loaded, which a note explains."""
    try:
        contact = model.SelfContact(arm)
    except ShapeError:
        return None
    return ShapeCount(len(contact.arm_shapes), contact.pairs)


def measure_gripper(arm: model.Robot) -> tuple[dict[str, object] | None, str]:
    """What opens the gripper and how wide, for programs and in words; None where it has none that can be measured."""
    try:
        hand = model.Gripper.of(arm)
    except ModelError as error:
        return None, str(error)
    shut, opened = float(hand.openings[0]), float(hand.openings[-1])
    facts: dict[str, object] = {"open": opened, "shut": shut, "width": float(hand.widths[-1]), "span": hand.span}
    return (
        facts,
        f"opens by {1e3 * hand.widths[-1]:.3g} mm from {shut:.4g} to {opened:.4g}, for {1e3 * hand.span:.3g} mm",
    )


def describe_masses(arm: model.Robot) -> str:
    """How much the joints move, or that it is not known."""
    moved = sum(body.mass for body in list(arm.pin_model.inertias)[1:])
    return f"{moved:.3g} kg that joints move" if moved > 0.0 else "not given: no torques"


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
