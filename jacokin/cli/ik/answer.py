"""How `jacokin ik` shows the answer to one pose."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from jacokin.cli.arguments.units import Angles
from jacokin.cli.display import json_output, tables

if TYPE_CHECKING:
    from jacokin.ik.results import IKResult
    from jacokin.ik.solver import IKSolver


def show_result(solver: IKSolver, result: IKResult, angles: Angles, *, as_json: bool) -> bool:
    """Print one answer; returns whether the pose is reached."""
    robot = solver.robot
    margin = np.minimum(result.q - robot.lower, robot.upper - result.q)
    if as_json:
        json_output.print_json(
            {
                "robot": robot.name,
                "frame": solver.frame,
                "joint_names": robot.joint_names,
                "angle_unit": angles.unit,
                "success": result.success,
                "status": result.status,
                "message": result.message,
                "advice": None if result.success else result.status.value,
                "q": angles.shown(result.q),
                "limit_margin": angles.shown(margin),
                "position_error": result.position_error,
                "orientation_error": angles.one(result.orientation_error),
                "method": result.method,
                "qp_solver": result.qp_solver,
                "iterations": result.iterations,
                "restarts": result.restarts,
                "touching": result.touching,
            }
        )
        return result.success
    columns = ("joint", f"angle [{angles.unit}]", "lower", "upper", "to the limit")
    rows = [
        (name, *(tables.number(value) for value in angles.shown(values)))
        for name, *values in zip(robot.joint_names, result.q, robot.lower, robot.upper, margin, strict=True)
    ]
    ran = result.method
    if result.qp_solver is not None:
        ran += f" ({result.qp_solver}, {result.iterations} iterations, {result.restarts} restarts)"
    screen = tables.console()
    title = f"{robot.name}: {solver.frame} reaches the target" if result.success else "the closest legal configuration"
    if not result.success:
        tables.say(screen, f"{result.status.name}: {result.message}.\n{result.status.value}.")
    screen.print(tables.table(title, columns, rows))
    lines = [
        ("position error", tables.small(result.position_error, "m")),
        ("orientation error", tables.small(angles.one(result.orientation_error), angles.unit)),
        ("method", ran),
    ]
    if result.success and result.message:
        lines.append(("note", result.message))
    if result.touching:
        lines.append(("touching", ", ".join(f"{a} and {b}" for a, b in result.touching)))
    screen.print(tables.facts(lines))
    return result.success
