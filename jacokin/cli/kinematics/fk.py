"""`jacokin fk`: the pose of a frame for given joint angles."""

from __future__ import annotations

from collections.abc import Iterable

from jacokin.cli.arguments import options
from jacokin.cli.arguments.units import Units
from jacokin.cli.display import json_output, tables


def fk(
    q: options.QArgument,
    frame: options.FrameOption = None,
    degrees: options.DegreesOption = False,
    json: options.JsonOption = False,
    *,
    source: options.RobotOptions,
) -> None:
    """Show the pose of a frame for given joint angles.

    Examples:
      jacokin fk 4.8 2.92 1.0 4.2 1.45 1.32
      jacokin fk -85 167 57 -119 83 76 --degrees
      jacokin fk 4.8 2.92 1.0 4.2 1.45 1.32 --frame gripsite --json
    """
    import pinocchio as pin

    from jacokin.model import poses

    arm = source.load()
    units = Units(degrees)
    configuration = arm.configuration(units.of_joints(arm).read(q))
    pose = arm.forward_kinematics(configuration, frame)
    quat = poses.quat_wxyz(pose.rotation)
    rpy = [units.shown(angle) for angle in pin.rpy.matrixToRpy(pose.rotation)]
    within = arm.within_limits(configuration)
    name = frame or arm.default_frame
    if json:
        json_output.print_json(
            {
                "robot": arm.name,
                "base": arm.base,
                "frame": name,
                "angle_unit": units.angle,
                "position": pose.translation,
                "quat_wxyz": quat,
                "rpy": rpy,
                "matrix": pose.homogeneous,
                "within_limits": within,
            }
        )
        return
    rows = [
        ("position x y z [m]", tables.numbers(pose.translation)),
        ("quaternion w x y z", tables.numbers(quat)),
        (f"roll pitch yaw [{units.angle}]", tables.numbers(rpy)),
        ("joint limits", "all kept" if within else _broken(arm.joint_names, arm.lower, arm.upper, configuration)),
    ]
    tables.say(tables.facts(rows, f"{arm.name}: {name} in {arm.base}"))


def _broken(names: Iterable[str], lower: Iterable[float], upper: Iterable[float], q: Iterable[float]) -> str:
    """Names of the joints that are outside their limits."""
    outside = [name for name, low, high, at in zip(names, lower, upper, q, strict=True) if not low <= at <= high]
    return f"broken by {', '.join(outside)}"
