"""`jacokin map query`: what a map says about a position or a pose."""

from __future__ import annotations

from typing import Annotated

from jacokin.cli.arguments import options
from jacokin.cli.arguments.declared import Argument, Option
from jacokin.cli.display import json_output, tables
from jacokin.cli.reachability.maps import MapOptions

Vector3 = tuple[float, float, float]
Vector4 = tuple[float, float, float, float]


def query(
    folder: Annotated[str, Argument(metavar="FOLDER|NAME", help="A map, or the bundled one of a robot.")],
    position: Annotated[Vector3, Option("--position", metavar="X Y Z", help="A position in the base [m].")],
    quat_wxyz: Annotated[
        Vector4 | None, Option("--quat-wxyz", metavar="W X Y Z", help="An orientation as a quaternion.")
    ] = None,
    down: Annotated[bool, Option("--down", help="An orientation: pointing vertically down.")] = False,
    json: options.JsonOption = False,
    *,
    built: MapOptions,
) -> None:
    """Say how many orientations are reached at a position, and which pose near a given one is.

    A map of tools that may turn needs the robot, limits and scene that it was built with, where they were your own.

    Examples:
      jacokin map query j2n6s300 --position 0.4 0.2 0.3
      jacokin map query j2n6s300 --position 1.4 0.2 0.3 --down
    """
    from jacokin.model import poses
    from jacokin.model.pose_targets import pose

    reach = built.load(folder)
    dexterity = reach.dexterity(position)
    document: dict[str, object] = {"dexterity": dexterity}
    lines = [("orientations reached", f"{dexterity:.1%}")]
    if quat_wxyz is not None or down:
        nearest = reach.nearest_reachable(pose(position, quat_wxyz, down=down))
        quat = poses.quat_wxyz(nearest.rotation)
        document |= {"nearest_position": nearest.translation, "nearest_quat_wxyz": quat}
        lines.append(("nearest position x y z [m]", tables.numbers(nearest.translation)))
        lines.append(("its quaternion w x y z", tables.numbers(quat)))
    if json:
        json_output.print_json(document)
    else:
        tables.say(tables.facts(lines))
