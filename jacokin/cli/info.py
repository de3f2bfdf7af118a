"""`jacokin info`: what a robot is and can do: joints, limits with their source, home, frames, structure, shapes."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path

from jacokin import ik, model
from jacokin.cli import display
from jacokin.cli.command import command
from jacokin.cli.groups import FormOptions, NamedRobotOptions
from jacokin.cli.units import JointUnits, Units
from jacokin.errors import ModelError, ShapeError
from jacokin.model.descriptions import bundled


@command()
def info(given: NamedRobotOptions, form: FormOptions) -> None:
    """Show what a robot is: joints, limits with their source, home, frames, structure, shapes, and what is missing.

    Bundled robots: j2n6s300 (the default), j2n6s200, j2s6s300, j2s6s200, m1n6s300, m1n6s200, gen3_6dof, gen3_lite;
    with seven joints j2s7s300, j2s7s200, gen3.

    Examples:
      jacokin info
      jacokin info j2s6s200 --degrees
      jacokin info urdf/j2n6s300.urdf --json
    """
    arm = given.load()
    if form.json:
        display.print_json(_document(arm, form.units))
    else:
        _show_arm(arm, form.units, given.calibration)
        _show_joints(arm, form.units)
        display.show_table("Frames", ("frame", "moved by"), list_frames(arm), text=2)


def _document(arm: model.Robot, units: Units) -> dict[str, object]:
    joints = units.for_joints(arm)
    placed, shapes = ik.structure(arm), count_shapes(arm)
    return {
        "robot": arm.name,
        "file": str(arm.source.path),
        "calibration": None if arm.calibration is None else describe_calibration(arm.calibration),
        "base": arm.base,
        "default_frame": arm.default_frame,
        "other_tool_frames": list_tools(arm),
        "angle_unit": units.angle,
        "joints": [asdict(row) for row in list_joints(arm, joints)],
        "sources": list_sources(arm),
        "home": joints.from_si(arm.home),
        "home_source": arm.home_source,
        "structure": {**asdict(placed), "gives": placed.gives},
        "shapes": None if shapes is None else asdict(shapes),
        "masses": describe_masses(arm),
        "gripper": measure_gripper(arm)[0],
        "frames": [{"name": name, "moved_by": joint} for name, joint in list_frames(arm)],
        "notes": list(arm.notes),
    }


def _show_arm(arm: model.Robot, units: Units, calibration: Path | None) -> None:
    joints = units.for_joints(arm)
    placed, shapes, tools = ik.structure(arm), count_shapes(arm), list_tools(arm)
    home = [display.number(value) for value in joints.from_si(arm.home)]
    if arm.sliding.any():
        home = [f"{value} {unit}" for value, unit in zip(home, joints.names, strict=True)]
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
        ("masses", describe_masses(arm)),
        ("gripper", measure_gripper(arm)[1]),
        *(("note", text) for text in arm.notes),
    ]
    display.show_facts(facts, arm.label)


def _show_joints(arm: model.Robot, units: Units) -> None:
    joints = units.for_joints(arm)
    slides = bool(arm.sliding.any())
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
        for label, row in zip(joints.labels(arm.joint_names), list_joints(arm, joints), strict=True)
    ]
    display.show_table("Joints", columns, lines)
    notes = [(f"source {key}", text) for key, text in list_sources(arm).items()]
    notes.append(("effort", "the limit the file states, same source as the angles"))
    if arm.source.bundled is not None:
        notes.append(("datasheet", "peak torque [N m]; it differs from the file's effort"))
    display.show_facts(notes)


def list_tools(arm: model.Robot) -> list[str]:
    """Frames of tools other than the one that is taken where none is named."""
    return [name for name in arm.tool_frames if name != arm.default_frame]


def list_frames(arm: model.Robot) -> list[tuple[str, str]]:
    """Each frame, and the joint that moves it."""
    chain = arm.pin_model
    parents = [chain.frames[arm.frame_id(name)].parentJoint for name in arm.frames]
    names = [str(chain.names[joint]) if joint else "nothing" for joint in parents]
    return list(zip(arm.frames, names, strict=True))


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
