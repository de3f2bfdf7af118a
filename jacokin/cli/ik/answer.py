"""How `jacokin ik` shows the answer to one pose."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from jacokin.cli.arguments.units import Units
from jacokin.cli.display import json_output, tables

if TYPE_CHECKING:
    from jacokin.ik.results import IKResult
    from jacokin.ik.solver import IKSolver


def show_result(solver: IKSolver, result: IKResult, units: Units, *, as_json: bool) -> bool:
    """Print one answer; returns whether the pose is reached."""
    robot = solver.robot
    joints = units.of_joints(robot)
    margin = np.minimum(result.q - robot.lower, robot.upper - result.q)
    if as_json:
        json_output.print_json(
            {
                **json_output.head(robot, units, solver.frame),
                "success": result.success,
                "status": result.status,
                "message": result.message,
                "advice": None if result.success else result.status.value,
                "q": joints.shown(result.q),
                "limit_margin": joints.shown(margin),
                "position_error": result.position_error,
                "orientation_error": units.shown(result.orientation_error),
                "method": result.method,
                "qp_solver": result.qp_solver,
                "iterations": result.iterations,
                "restarts": result.restarts,
                "touching": result.touching,
                "parameter": None if result.parameter is None else units.shown(result.parameter),
            }
        )
        return result.success
    columns = ("joint", joints.heading("angle"), "lower", "upper", "to the limit")
    values = [map(tables.number, joints.shown(row)) for row in (result.q, robot.lower, robot.upper, margin)]
    rows = list(zip(joints.labels(robot.joint_names), *values, strict=True))
    ran = result.method
    if result.qp_solver is not None:
        ran += f" ({result.qp_solver}, {result.iterations} iterations, {result.restarts} restarts)"
    title = f"{robot.name}: {solver.frame} reaches the target"
    if not result.success:
        title = "the closest configuration within the limits"
        tables.say(f"{result.status.name}: {result.message}.\n{result.status.value}.")
    tables.say(tables.table(title, columns, rows))
    lines = [
        ("position error", tables.small(result.position_error, "m")),
        ("orientation error", tables.small(units.shown(result.orientation_error), units.angle)),
        ("method", ran),
    ]
    if result.success and result.message:
        lines.append(("note", result.message))
    if result.touching:
        lines.append(("touching", ", ".join(f"{a} and {b}" for a, b in result.touching)))
    tables.say(tables.facts(lines))
    return result.success
