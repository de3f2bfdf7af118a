"""`jacokin place`: where to put the base for a file of targets."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from jacokin.cli.arguments import options
from jacokin.cli.arguments.declared import Option
from jacokin.cli.display import json_output, tables
from jacokin.cli.exit_codes import NOT_SOLVED
from jacokin.cli.reachability.maps import MapOptions

if TYPE_CHECKING:
    import pinocchio as pin


def place(
    targets: Annotated[Path, Option("--targets", metavar="FILE.csv", help="Poses of the tool in the world.")],
    folder: Annotated[
        str, Option("--map", metavar="FOLDER|NAME", help="A map, or the bundled one of a robot.")
    ] = options.DEFAULT_ROBOT,
    height: Annotated[
        float | None, Option("--height", metavar="Z", help="Height that the base stands at [m]; any if not given.")
    ] = None,
    json: options.JsonOption = False,
    *,
    built: MapOptions,
) -> None:
    """Find places for the base of the arm from which it reaches as many targets as possible.

    A map that was built with a scene, a robot or limits of your own needs the same again.
    Exit code: 0 if the best place reaches all of them, 1 if not.

    Examples:
      jacokin place --targets examples/targets.csv
      jacokin place --targets examples/targets.csv --map out/jaco --height 0.75
      jacokin place --targets examples/targets.csv --map out/mine --robot my_arm.urdf --scene table.yaml
    """
    from jacokin.ik.files.targets_csv import read_targets
    from jacokin.reachability import place_base

    wanted = read_targets(targets).targets
    found = place_base(built.load(folder), wanted, heights=None if height is None else [height])
    if json:
        places = [
            {
                "position": each.pose.translation,
                "yaw": _yaw(each.pose),
                "reached": each.reached,
                "margin": each.margin,
            }
            for each in found
        ]
        json_output.print_json({"targets": len(wanted), "places": places})
    else:
        rows = [
            (
                *(f"{value:.3f}" for value in (*each.pose.translation, _yaw(each.pose))),
                f"{each.reached} of {len(wanted)}",
                f"{each.margin:.3f}",
            )
            for each in found
        ]
        columns = ("x [m]", "y [m]", "z [m]", "yaw [rad]", "reached", "margin [rad]")
        tables.say(tables.table("Places for the base", columns, rows))
    if not found or found[0].reached < len(wanted):
        raise SystemExit(NOT_SOLVED)


def _yaw(T_world_base: pin.SE3) -> float:
    """The turn of an upright base about the vertical [rad]; 0 where joint 1 turns freely."""
    return math.atan2(T_world_base.rotation[1, 0], T_world_base.rotation[0, 0])
