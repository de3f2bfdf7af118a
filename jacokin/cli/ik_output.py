"""How `jacokin ik` shows one answer and every branch."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from jacokin.cli import output
from jacokin.cli.arguments import Angles

if TYPE_CHECKING:
    from jacokin.ik.results import Branches, IKResult
    from jacokin.ik.solver import IKSolver


def show_result(solver: IKSolver, result: IKResult, angles: Angles, *, as_json: bool) -> bool:
    """Print one answer; returns whether the pose is reached."""
    robot = solver.robot
    margin = np.minimum(result.q - robot.lower, robot.upper - result.q)
    if as_json:
        output.print_json(
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
        (name, *(output.number(value) for value in angles.shown(values)))
        for name, *values in zip(robot.joint_names, result.q, robot.lower, robot.upper, margin, strict=True)
    ]
    ran = result.method
    if result.qp_solver is not None:
        ran += f" ({result.qp_solver}, {result.iterations} iterations, {result.restarts} restarts)"
    screen = output.console()
    title = f"{robot.name}: {solver.frame} reaches the target" if result.success else "the closest legal configuration"
    if not result.success:
        screen.print(f"{result.status.name}: {result.message}.\n{result.status.value}.", markup=False)
    screen.print(output.table(title, columns, rows))
    lines = [
        ("position error", output.small(result.position_error, "m")),
        ("orientation error", output.small(angles.one(result.orientation_error), angles.unit)),
        ("method", ran),
    ]
    if result.success and result.message:
        lines.append(("note", result.message))
    if result.touching:
        lines.append(("touching", ", ".join(f"{a} and {b}" for a, b in result.touching)))
    screen.print(output.facts(lines))
    return result.success


def show_branches(solver: IKSolver, branches: Branches, angles: Angles, *, reject_contact: bool, as_json: bool) -> bool:
    """Print every branch; returns whether one is inside the limits and, if asked for, free of self-contact."""
    robot = solver.robot
    acceptable = branches.within_limits.copy()
    if branches.touching is not None and reject_contact:
        acceptable &= np.array([not pairs for pairs in branches.touching], dtype=bool)
    if as_json:
        output.print_json(
            {
                "robot": robot.name,
                "frame": solver.frame,
                "joint_names": robot.joint_names,
                "angle_unit": angles.unit,
                "complete": branches.complete,
                "branches": [
                    {
                        "q": angles.shown(branches.q[row]),
                        "within_limits": bool(branches.within_limits[row]),
                        "limit_margin": angles.shown(branches.margin[row]),
                        "distance": angles.one(branches.distance[row]),
                        "position_error": branches.position_error[row],
                        "orientation_error": angles.one(branches.orientation_error[row]),
                        "touching": None if branches.touching is None else branches.touching[row],
                    }
                    for row in range(len(branches))
                ],
            }
        )
        return bool(acceptable.any())
    screen = output.console()
    if not len(branches):
        screen.print("UNREACHABLE: no joint angles reach this pose, with or without limits.")
        return False
    columns = ["", "limits", *robot.joint_names, "margin", "distance"]
    rows = []
    for row in range(len(branches)):
        joint = int(np.argmin(branches.margin[row]))
        cells = [str(row + 1), "kept" if branches.within_limits[row] else f"broken: {robot.joint_names[joint]}"]
        cells += [output.number(value, 4) for value in angles.shown(branches.q[row])]
        cells += [
            output.number(angles.one(value), 4) for value in (branches.margin[row, joint], branches.distance[row])
        ]
        if branches.touching is not None:
            cells.append(", ".join(f"{a} and {b}" for a, b in branches.touching[row]) or "nothing")
        rows.append(cells)
    if branches.touching is not None:
        columns.append("touches")
    title = f"{robot.name}: {len(branches)} branches, {int(acceptable.sum())} usable; angles in {angles.unit}"
    screen.print(output.table(title, columns, rows, text=2))
    worst = float(branches.position_error.max()), angles.one(float(branches.orientation_error.max()))
    lines = [
        ("margin", "distance of the joint nearest to its limit; negative outside"),
        ("distance", "to the seed"),
        ("worst error", f"{output.small(worst[0], 'm')}, {output.small(worst[1], angles.unit)}"),
    ]
    if not branches.complete:
        lines.append(("note", "this pose has a one-parameter family of solutions; the rows are members of it"))
    screen.print(output.facts(lines))
    return bool(acceptable.any())
