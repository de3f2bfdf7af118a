"""`jacokin info`: what a robot is: joints, limits with their source, frames."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from jacokin.cli import display, options
from jacokin.cli.command import Argument, Command
from jacokin.cli.options import RobotOptions
from jacokin.cli.units import JointUnits, Units

if TYPE_CHECKING:
    from jacokin.model.robot import Robot


@click.command(cls=Command)
@click.argument("robot", cls=Argument, default=options.DEFAULT_ROBOT, metavar="[NAME|FILE]", text=options.NAME_OR_FILE)
@options.degrees
@options.json
@options.base
@options.tip
@options.package_dir
def info(robot: str, units: Units, json: bool, base: str | None, tip: str | None, package_dirs: Sequence[Path]) -> None:
    """Show joints, limits with their source, home and frames.

    Bundled robots: j2n6s300 (the default), j2n6s200, j2s6s300, j2s6s200, m1n6s300, m1n6s200;
    with seven joints j2s7s300, j2s7s200.

    Examples:
      jacokin info
      jacokin info j2s6s200 --degrees
      jacokin info urdf/j2n6s300.urdf --json
    """
    arm = RobotOptions(robot, base, tip, package_dirs).load()
    in_units = units.of_joints(arm)
    joints = [_joint(arm, index, in_units) for index in range(arm.dof)]
    sources = _sources(arm)
    frames = _frames(arm)
    if json:
        display.print_json(
            {
                "robot": arm.name,
                "file": str(arm.source.path),
                "base": arm.base,
                "default_frame": arm.default_frame,
                "angle_unit": units.angle,
                "joints": joints,
                "sources": sources,
                "home": in_units.shown(arm.home),
                "home_source": arm.home_source,
                "frames": [{"name": name, "moved_by": joint} for name, joint in frames],
            }
        )
        return
    _show(arm, in_units, joints, sources, frames)


def _joint(arm: Robot, index: int, units: JointUnits) -> dict[str, object]:
    """Limits of a joint; the datasheet's torque where the robot is a bundled one."""
    row: dict[str, object] = {
        "name": arm.joint_names[index],
        "unlimited": bool(arm.unlimited[index]),
        "unit": units.names[index],
        "lower": units.shown(arm.lower)[index],
        "upper": units.shown(arm.upper)[index],
        "velocity": units.shown(arm.velocity_limit)[index],
        "effort": float(arm.effort_limit[index]),
        "datasheet_torque": None,
        "source": "file",
        "datasheet_source": None,
    }
    if arm.source.bundled is not None:
        from jacokin.model.descriptions import bundled

        numbers = bundled.arm_joints(arm.source.bundled)[arm.joint_names[index]]
        actuator = bundled.actuator(numbers["group"])
        row["datasheet_torque"] = max(actuator["force_range"])
        row["source"] = numbers.get("source", _arm_source(arm.source.bundled))
        row["datasheet_source"] = actuator["source"]
    return row


def _arm_source(name: str) -> str:
    """Letter of the source of an arm's chain."""
    from jacokin.model.descriptions import bundled

    return str(bundled.arm(name)["source"])


def _sources(arm: Robot) -> dict[str, str]:
    """What the letters in the joint table stand for."""
    if arm.source.bundled is None:
        return {"file": str(arm.source.path)}
    from jacokin.model.descriptions import bundled

    return {key: bundled.source_text(key) for key in (_arm_source(arm.source.bundled), "S")}


def _frames(arm: Robot) -> list[tuple[str, str]]:
    """Every frame with the joint that moves it."""
    model = arm.pin_model
    return [
        (name, str(model.names[joint]) if (joint := model.frames[arm.frame_id(name)].parentJoint) else "nothing")
        for name in arm.frames
    ]


def _home(arm: Robot, units: JointUnits) -> str:
    shown = [display.number(value) for value in units.shown(arm.home)]
    if arm.sliding.any():
        shown = [f"{value} {unit}" for value, unit in zip(shown, units.names, strict=True)]
    return "  ".join(shown)


def _show(
    arm: Robot,
    units: JointUnits,
    joints: list[dict[str, object]],
    sources: dict[str, str],
    frames: list[tuple[str, str]],
) -> None:
    display.say(
        display.facts(
            [
                ("file", str(arm.source.path)),
                ("base", arm.base),
                ("default frame", arm.default_frame),
                (units.heading("home"), _home(arm, units)),
                ("home from", arm.home_source),
            ],
            arm.name,
        )
    )
    columns = (
        "joint",
        units.heading("lower"),
        units.heading("upper"),
        "speed [unit/s]" if arm.sliding.any() else f"speed [{units.units.angle}/s]",
        "source",
        "effort [N or N m]" if arm.sliding.any() else "effort [N m]",
        "datasheet",
    )
    rows = []
    for index, joint in enumerate(joints):
        torque, letter = joint["datasheet_torque"], joint["datasheet_source"]
        rows.append(
            (
                units.labels(arm.joint_names)[index],
                display.number(units.shown(arm.lower)[index]),
                display.number(units.shown(arm.upper)[index]),
                display.number(units.shown(arm.velocity_limit)[index], missing="not given"),
                str(joint["source"]),
                display.number(arm.effort_limit[index], 1, missing="not given"),
                "unknown" if torque is None else f"{torque} ({letter})",
            )
        )
    display.say(display.table("Joints", columns, rows))
    notes = [(f"source {key}", text) for key, text in sources.items()]
    notes.append(("effort", "the limit the file states, same source as the angles"))
    if arm.source.bundled is not None:
        notes.append(("datasheet", "peak torque [N m]; it differs from the file's effort"))
    display.say(display.facts(notes))
    display.say(display.table("Frames", ("frame", "moved by"), frames, text=2))
