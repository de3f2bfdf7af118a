"""`jacokin fk` and `jacokin jacobian`."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Annotated

import typer

from jacokin.cli import arguments, output
from jacokin.cli.arguments import (
    DEFAULT_ROBOT,
    Angles,
    BaseOption,
    DegreesOption,
    FrameOption,
    JsonOption,
    QArgument,
    RobotOption,
    TipOption,
)


def fk(
    q: QArgument,
    frame: FrameOption = None,
    degrees: DegreesOption = False,
    json: JsonOption = False,
    robot: RobotOption = DEFAULT_ROBOT,
    base: BaseOption = None,
    tip: TipOption = None,
) -> None:
    """Show the pose of a frame for given joint angles.

    Examples:
      jacokin fk 4.8 2.92 1.0 4.2 1.45 1.32
      jacokin fk -85 167 57 -119 83 76 --degrees
      jacokin fk 4.8 2.92 1.0 4.2 1.45 1.32 --frame gripsite --json
    """
    import pinocchio as pin

    from jacokin.model import poses

    arm = arguments.load(robot, base, tip)
    angles = Angles(degrees)
    configuration = arm.configuration(angles.given(q))
    pose = arm.forward_kinematics(configuration, frame)
    quat = poses.quat_wxyz(pose.rotation)
    rpy = angles.shown(pin.rpy.matrixToRpy(pose.rotation))
    legal = arm.within_limits(configuration)
    name = frame or arm.default_frame
    if json:
        output.print_json(
            {
                "robot": arm.name,
                "base": arm.base,
                "frame": name,
                "angle_unit": angles.unit,
                "position": pose.translation,
                "quat_wxyz": quat,
                "rpy": rpy,
                "matrix": pose.homogeneous,
                "within_limits": legal,
            }
        )
        return
    rows = [
        ("position x y z [m]", _row(pose.translation)),
        ("quaternion w x y z", _row(quat)),
        (f"roll pitch yaw [{angles.unit}]", _row(rpy)),
        ("joint limits", "all kept" if legal else _broken(arm.joint_names, arm.lower, arm.upper, configuration)),
    ]
    output.console().print(output.facts(rows, f"{arm.name}: {name} in {arm.base}"))


def jacobian(
    q: QArgument,
    frame: FrameOption = None,
    reference: Annotated[
        str, typer.Option("--reference", metavar="NAME", help="local_world_aligned, local or world.")
    ] = "local_world_aligned",
    degrees: DegreesOption = False,
    json: JsonOption = False,
    robot: RobotOption = DEFAULT_ROBOT,
    base: BaseOption = None,
    tip: TipOption = None,
) -> None:
    """Show the Jacobian of a frame.

    Linear rows [m/rad] come first, then angular ones.
    --degrees is for the joint angles given; the Jacobian stays per radian.

    Examples:
      jacokin jacobian 4.8 2.92 1.0 4.2 1.45 1.32
      jacokin jacobian 4.8 2.92 1.0 4.2 1.45 1.32 --reference local --frame gripsite --json
    """
    arm = arguments.load(robot, base, tip)
    configuration = arm.configuration(Angles(degrees).given(q))
    matrix = arm.jacobian(configuration, frame, reference)
    singular_values = arm.singular_values(configuration, frame)
    manipulability = arm.manipulability(configuration, frame)
    name = frame or arm.default_frame
    if json:
        output.print_json(
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
    rows = [(label, *(output.number(value) for value in row)) for label, row in zip(names, matrix, strict=True)]
    screen = output.console()
    screen.print(output.table(f"Jacobian of {name}, {reference}", ("", *arm.joint_names), rows))
    screen.print(
        output.facts(
            [("singular values", _row(singular_values)), ("manipulability", f"{manipulability:.6g}")],
        )
    )


def _row(values: Iterable[float]) -> str:
    return "  ".join(f"{output.number(float(value)):>10}" for value in values)


def _broken(names: Iterable[str], lower: Iterable[float], upper: Iterable[float], q: Iterable[float]) -> str:
    """Names of the joints that are outside their limits."""
    outside = [name for name, low, high, at in zip(names, lower, upper, q, strict=True) if not low <= at <= high]
    return f"broken by {', '.join(outside)}"
