"""How `jacokin ik --all` shows every branch of a pose."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from jacokin.cli.arguments.units import Units
from jacokin.cli.display import json_output, tables

if TYPE_CHECKING:
    from jacokin.ik.results import Branches
    from jacokin.ik.solver import IKSolver


def show_branches(solver: IKSolver, branches: Branches, units: Units, *, reject_contact: bool, as_json: bool) -> bool:
    """Print every branch; returns whether one is inside the limits and, if asked for, free of self-contact."""
    robot = solver.robot
    joints = units.of_joints(robot)
    acceptable = branches.within_limits.copy()
    if branches.touching is not None and reject_contact:
        acceptable &= np.array([not pairs for pairs in branches.touching], dtype=bool)
    if as_json:
        json_output.print_json(
            {
                **json_output.head(robot, units, solver.frame),
                "complete": branches.complete,
                "branches": [
                    {
                        "q": joints.shown(branches.q[row]),
                        "within_limits": bool(branches.within_limits[row]),
                        "limit_margin": joints.shown(branches.margin[row]),
                        "distance": joints.distance(branches.distance[row]),
                        "position_error": branches.position_error[row],
                        "orientation_error": units.shown(branches.orientation_error[row]),
                        "touching": None if branches.touching is None else branches.touching[row],
                    }
                    for row in range(len(branches))
                ],
            }
        )
        return bool(acceptable.any())
    if not len(branches):
        tables.say("UNREACHABLE: no joint angles reach this pose, with or without limits.")
        return False
    columns = ["", "limits", *joints.labels(robot.joint_names), "margin", "distance"]
    rows = []
    for row in range(len(branches)):
        joint = int(np.argmin(branches.margin[row]))
        cells = [str(row + 1), "kept" if branches.within_limits[row] else f"broken: {robot.joint_names[joint]}"]
        cells += [tables.number(value, 4) for value in joints.shown(branches.q[row])]
        cells += [
            tables.number(joints.shown(branches.margin[row])[joint], 4),
            tables.number(joints.distance(branches.distance[row]), 4),
        ]
        if branches.touching is not None:
            cells.append(", ".join(f"{a} and {b}" for a, b in branches.touching[row]) or "nothing")
        rows.append(cells)
    if branches.touching is not None:
        columns.append("touches")
    title = f"{robot.name}: {len(branches)} branches, {int(acceptable.sum())} usable; angles in {units.angle}"
    tables.say(tables.table(title, columns, rows, text=2))
    worst = float(branches.position_error.max()), units.shown(float(branches.orientation_error.max()))
    lines = [
        ("margin", "distance of the joint nearest to its limit; negative outside"),
        ("distance", "to the seed"),
        ("worst error", f"{tables.small(worst[0], 'm')}, {tables.small(worst[1], units.angle)}"),
    ]
    if not branches.complete:
        lines.append(("note", "this pose has a one-parameter family of solutions; the rows are members of it"))
    tables.say(tables.facts(lines))
    return bool(acceptable.any())
