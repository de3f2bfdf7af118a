"""How `jacokin ik` shows the answer to one pose."""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import ArrayLike

from jacokin import ik
from jacokin.cli import display
from jacokin.cli.units import Units
from jacokin.ik.targets import Target
from jacokin.ik.virtual_joints import PointsOfFew


def show_result(solver: ik.IKSolver, result: ik.IKResult, units: Units, *, closest: bool, as_json: bool) -> bool:
    """Print one answer; returns whether the pose is reached."""
    robot = solver.robot
    joints = units.for_joints(robot)
    margin = np.minimum(result.q - robot.lower, robot.upper - result.q)
    if as_json:
        display.print_json(
            {
                **display.head(robot, units, solver.frame),
                "success": result.success,
                "status": result.status,
                "message": in_options(result.message, units),
                "advice": None if result.success else result.status.value,
                "q": joints.from_si(result.q),
                "limit_margin": joints.from_si(margin),
                "position_error": result.position_error,
                "orientation_error": units.from_si(result.orientation_error),
                "method": result.method,
                "qp_solver": result.qp_solver,
                "iterations": result.iterations,
                "restarts": result.restarts,
                "touching": result.touching,
                "parameter": None if result.parameter is None else units.from_si(result.parameter),
            }
        )
        return result.success
    columns = ("joint", joints.heading("angle"), "lower", "upper", "to the limit")
    values = [map(display.number, joints.from_si(row)) for row in (result.q, robot.lower, robot.upper, margin)]
    rows = list(zip(joints.labels(robot.joint_names), *values, strict=True))
    ran = result.method
    if result.qp_solver is not None:
        ran += f" ({result.qp_solver}, {result.iterations} iterations, {result.restarts} restarts)"
    title = f"{robot.label}: {solver.frame} reaches the target"
    if not result.success:
        title = "the closest configuration within the limits" if closest else "where the search began or ended"
        display.say(f"{result.status.name}: {in_options(result.message, units)}.\n{result.status.value}.")
    display.show_table(title, columns, rows)
    lines = [
        ("position error", display.small(result.position_error, "m")),
        ("orientation error", display.small(units.from_si(result.orientation_error), units.angle)),
        ("method", ran),
    ]
    if result.success and result.message:
        lines.append(("note", in_options(result.message, units)))
    if result.touching:
        lines.append(("touching", ", ".join(f"{a} and {b}" for a, b in result.touching)))
    display.show_facts(lines)
    return result.success


def in_options(message: str, units: Units) -> str:
    """A message of a result with the command's options in place of the solver's, in the user's unit of angles."""
    return units.in_words(re.sub(r"\b(position|orientation)_tolerance=", r"--\1-tolerance ", message))


def show_none(solver: ik.IKSolver, target: Target, seed: ArrayLike | None, units: Units, *, held: bool) -> None:
    """Say why a pose has no branch; of some joints that are held, only that it has none."""
    if held:
        display.say("No joint angles reach this pose with these joints held, with or without limits.")
        return
    result = solver.solve(target, seed)
    if result.success:  # it tolerates more
        display.say("No joint angles reach this pose exactly, but some within the tolerances: leave out --all.")
    else:
        display.say(f"{result.status.name}: {in_options(result.message, units)}.\n{result.status.value}.")


def show_points(solver: ik.IKSolver, branches: ik.SolutionSet, units: Units, *, as_json: bool) -> bool:
    """Print every branch; returns whether one is inside the limits and, where contact is rejected, free of it."""
    robot = solver.robot
    joints = units.for_joints(robot)
    acceptable = branches.within_limits.copy()
    if branches.touching is not None and solver.verifier.options.collision == "reject":
        acceptable &= np.array([not pairs for pairs in branches.touching], dtype=bool)
    if as_json:
        display.print_json(
            {
                **display.head(robot, units, solver.frame),
                "complete": branches.complete,
                "branches": [
                    {
                        "q": joints.from_si(branches.q[row]),
                        "within_limits": bool(branches.within_limits[row]),
                        "limit_margin": joints.from_si(branches.margin[row]),
                        "distance": joints.distance(branches.distance[row]),
                        "position_error": branches.position_error[row],
                        "orientation_error": units.from_si(branches.orientation_error[row]),
                        "touching": None if branches.touching is None else branches.touching[row],
                    }
                    for row in range(len(branches))
                ],
            }
        )
        return bool(acceptable.any())
    columns = ["", "limits", *joints.labels(robot.joint_names), "margin", "distance"]
    rows = []
    for row in range(len(branches)):
        joint = int(np.argmin(branches.margin[row]))
        cells = [str(row + 1), "kept" if branches.within_limits[row] else f"broken: {robot.joint_names[joint]}"]
        cells += [display.number(value, 4) for value in joints.from_si(branches.q[row])]
        cells += [
            display.number(joints.from_si(branches.margin[row])[joint], 4),
            display.number(joints.distance(branches.distance[row]), 4),
        ]
        if branches.touching is not None:
            cells.append(", ".join(f"{a} and {b}" for a, b in branches.touching[row]) or "nothing")
        rows.append(cells)
    if branches.touching is not None:
        columns.append("touches")
    title = f"{robot.label}: {len(branches)} branches, {int(acceptable.sum())} usable; angles in {units.angle}"
    display.show_table(title, columns, rows, text=2)
    worst = float(branches.position_error.max()), units.from_si(float(branches.orientation_error.max()))
    lines = [
        ("margin", "distance of the joint nearest to its limit; negative outside"),
        ("distance", "to the seed"),
        ("worst error", f"{display.small(worst[0], 'm')}, {display.small(worst[1], units.angle)}"),
    ]
    few = branches if isinstance(branches, PointsOfFew) else None
    if few is not None and few.free_joint:
        lines.append(("note", f"{few.free_joint} is free: each row stands for all its angles"))
    elif branches.singular.any() or (few is not None and few.on_curve):
        lines.append(("note", "this pose has a curve of solutions; the rows are members of it"))
    elif few is not None and few.nearly:
        lines.append(("note", "nothing meets this pose exactly; the rows are within the tolerances, and others are"))
    elif not branches.complete:
        lines.append(("note", "there may be more"))
    display.show_facts(lines)
    return bool(acceptable.any())


def show_curves(solver: ik.IKSolver, found: ik.SolutionSet, units: Units, *, as_json: bool) -> bool:
    """Print every interval of the parameter; returns whether there is one."""
    robot = solver.robot
    joints = units.for_joints(robot)
    if as_json:
        display.print_json(
            {
                **display.head(robot, units, solver.frame),
                "complete": found.complete,
                "intervals": [
                    {
                        "branch": interval.branch,
                        "start": units.from_si(interval.start),
                        "stop": units.from_si(interval.stop),
                        "ends": [units.in_words(str(end)) for end in interval.ends],
                        "nearest": joints.from_si(interval.nearest()),
                        "widest": joints.from_si(interval.best("margin")),
                    }
                    for interval in found.intervals
                ],
            }
        )
        return bool(found.intervals)
    if not found.intervals:
        display.say("No configuration within the limits reaches this target, whatever the free parameter.")
        return False
    columns = ["branch", "from", "to", "ends", *joints.labels(robot.joint_names)]
    rows = [
        [
            str(interval.branch),
            display.number(units.from_si(interval.start), 4),
            display.number(units.from_si(interval.stop), 4),
            " / ".join(end.joint or end.kind for end in interval.ends),
            *(display.number(value, 4) for value in joints.from_si(interval.nearest())),
        ]
        for interval in found.intervals
    ]
    title = f"{robot.label}: {len(found)} intervals of the free parameter; angles in {units.angle}"
    display.show_table(title, columns, rows, text=4)
    what = "the angle about the free axis" if found.parameter == "angle" else found.parameter
    lines = [("from, to", f"ends of the interval of {what}"), ("joints", "of the member nearest to the seed")]
    if not found.complete:
        lines.append(("note", "some curves were lost: there may be more"))
    display.show_facts(lines)
    return True
