"""`jacokin jacobian`: the Jacobian of a frame, its singular values and the manipulability."""

from __future__ import annotations

from typing import Annotated

from jacokin.cli.arguments import options
from jacokin.cli.arguments.declared import Option
from jacokin.cli.arguments.units import Units
from jacokin.cli.display import json_output, tables


def jacobian(
    q: options.QArgument,
    frame: options.FrameOption = None,
    reference: Annotated[
        str, Option("--reference", metavar="NAME", help="local_world_aligned, local or world.")
    ] = "local_world_aligned",
    degrees: options.DegreesOption = False,
    json: options.JsonOption = False,
    *,
    source: options.RobotOptions,
) -> None:
    """Show the Jacobian of a frame.

    Linear rows [m/rad] come first, then angular ones.
    --degrees is for the joint angles given; the Jacobian stays per radian (per metre where a joint slides).

    Examples:
      jacokin jacobian 4.8 2.92 1.0 4.2 1.45 1.32
      jacokin jacobian 4.8 2.92 1.0 4.2 1.45 1.32 --reference local --frame gripsite --json
    """
    arm = source.load()
    configuration = arm.configuration(Units(degrees).of_joints(arm).read(q))
    matrix = arm.jacobian(configuration, frame, reference)
    singular_values = arm.singular_values(configuration, frame)
    manipulability = arm.manipulability(configuration, frame)
    name = frame or arm.default_frame
    if json:
        json_output.print_json(
            {
                "robot": arm.name,
                "frame": name,
                "reference": reference,
                "joint_names": arm.joint_names,
                "jacobian": matrix,
                "singular_values": singular_values,
                "manipulability": manipulability,
            }
        )
        return
    names = ("vx", "vy", "vz", "wx", "wy", "wz")
    rows = [(label, *(tables.number(value) for value in row)) for label, row in zip(names, matrix, strict=True)]
    tables.say(tables.table(f"Jacobian of {name}, {reference}", ("", *arm.joint_names), rows))
    tables.say(
        tables.facts(
            [("singular values", tables.numbers(singular_values)), ("manipulability", f"{manipulability:.6g}")],
        )
    )
