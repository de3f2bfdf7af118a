"""How `jacokin ik --all` shows a family of configurations."""

from __future__ import annotations

from typing import TYPE_CHECKING

from jacokin.cli.arguments.units import Units
from jacokin.cli.display import json_output, tables

if TYPE_CHECKING:
    from jacokin.ik.families.family import Family
    from jacokin.ik.solver import IKSolver


def show_family(solver: IKSolver, family: Family, units: Units, *, as_json: bool) -> bool:
    """Print every interval of the parameter; returns whether there is one."""
    robot = solver.robot
    joints = units.of_joints(robot)
    if as_json:
        json_output.print_json(
            {
                **json_output.head(robot, units, solver.frame),
                "complete": family.complete,
                "intervals": [
                    {
                        "branch": interval.branch,
                        "start": units.shown(interval.start),
                        "stop": units.shown(interval.stop),
                        "ends": [str(end) for end in interval.ends],
                        "nearest": joints.shown(interval.nearest()),
                        "widest": joints.shown(interval.widest()),
                    }
                    for interval in family
                ],
            }
        )
        return bool(family.intervals)
    if not family.intervals:
        tables.say("No configuration within the limits reaches this target, whatever the free parameter.")
        return False
    columns = ["branch", "from", "to", "ends", *joints.labels(robot.joint_names)]
    rows = [
        [
            str(interval.branch),
            tables.number(units.shown(interval.start), 4),
            tables.number(units.shown(interval.stop), 4),
            " / ".join(end.joint or end.kind for end in interval.ends),
            *(tables.number(value, 4) for value in joints.shown(interval.nearest())),
        ]
        for interval in family
    ]
    title = f"{robot.name}: {len(family)} intervals of the free parameter; angles in {units.angle}"
    tables.say(tables.table(title, columns, rows, text=4))
    what = robot.joint_names[2] if robot.dof == 7 else "the angle about the free axis"
    lines = [("from, to", f"ends of the interval of {what}"), ("joints", "of the member nearest to the seed")]
    if not family.complete:
        lines.append(("note", "some curves were lost: there may be more"))
    tables.say(tables.facts(lines))
    return True
