"""How `jacokin track` and `jacokin plan` show what they did."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from jacokin.cli.display import json_output
from jacokin.cli.display.tables import facts, number, say, small, table

if TYPE_CHECKING:
    from jacokin.cli.arguments.units import Units
    from jacokin.ik.paths.result import PathResult
    from jacokin.model.robot import Robot

SHOWN = 6  # values of the parameter in a line


def print_json(arm: Robot, result: PathResult, units: Units, output: Path | None, plot: Path | None) -> None:
    """Print the errors, the margins and every start that was tried as one JSON document."""
    joints = units.of_joints(arm)
    json_output.print_json(
        {
            "robot": arm.name,
            "joint_names": result.joint_names,
            "angle_unit": units.angle,
            "joint_units": joints.names,
            "success": result.success,
            "message": result.message,
            "duration": result.t[-1],
            "rows": len(result),
            "max_position_error": result.position_error.max(),
            "max_orientation_error": units.shown(result.orientation_error.max()),
            "time_off_the_path": result.time_limited,
            "failed_segments": result.failed_segments,
            "limit_margin": joints.shown(result.limit_margin.min(axis=0)),
            "least_clearance": result.clearance.min(),
            "parameter": [units.shown(value) for value in result.parameter],
            "branches": [
                {
                    "q_start": joints.shown(branch.q_start),
                    "failed_segments": branch.failed_segments,
                    "position_error": branch.position_error,
                    "orientation_error": units.shown(branch.orientation_error),
                }
                for branch in result.branches
            ],
            "output": None if output is None else str(output),
            "plot": None if plot is None else str(plot),
        }
    )


def show(arm: Robot, result: PathResult, units: Units, output: Path | None, plot: Path | None) -> None:
    """Print a summary; when the tool left the path, where it did from every start."""
    margin = result.limit_margin
    nearest = int(margin.min(axis=0).argmin())
    at = int(margin[:, nearest].argmin())
    joints = units.of_joints(arm)
    away = joints.shown(margin[at])[nearest]
    lines = [
        ("result", "on the path throughout" if result.success else "NOT on the path throughout"),
        ("note", result.message),
        ("duration", f"{result.t[-1]:.3f} s, {len(result)} rows"),
        ("largest position error", small(float(result.position_error.max()), "m")),
        ("largest orientation error", small(units.shown(result.orientation_error.max()), units.angle)),
        ("time off the path", f"{result.time_limited:.3f} s"),
        (
            "nearest to a limit",
            f"{result.joint_names[nearest]}, {number(away)} {joints.names[nearest]} away at {result.t[at]:.3f} s",
        ),
    ]
    if not np.isnan(result.clearance).all():
        lines.append(("least clearance", f"{number(result.clearance.min())} m"))
    if not np.isnan(result.parameter).all():
        name = result.joint_names[2] if arm.dof > 6 else "free angle"  # joint 3 is the parameter of seven joints
        shown = [number(units.shown(value), 3).replace("nan", "none") for value in result.parameter[:SHOWN]]
        more = "" if len(result.parameter) <= SHOWN else f" and {len(result.parameter) - SHOWN} more"
        lines.append((f"{name} at the poses", f"{', '.join(shown)}{more} {units.angle}"))
    lines += [(name, str(file)) for name, file in (("written to", output), ("drawn in", plot)) if file is not None]
    say(facts(lines))
    if not result.success and result.branches:
        rows = [
            (
                str(index),
                ", ".join(str(segment) for segment in branch.failed_segments) or "none",
                small(branch.position_error, "m"),
                small(units.shown(branch.orientation_error), units.angle),
            )
            for index, branch in enumerate(result.branches, start=1)
        ]
        columns = ("start branch", "off the path on segments", "position error", "orientation error")
        say(table("Every start that was tried", columns, rows, text=2))
