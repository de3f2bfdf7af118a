"""`jacokin fk` and `jacokin jacobian`: the pose and the Jacobian of a frame for given joint angles."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from jacokin import model
from jacokin.cli import display, options
from jacokin.cli.command import command, option
from jacokin.cli.groups import FormOptions, RobotOptions


@dataclass(frozen=True, slots=True)
class ConfigurationOptions:
    """Joint angles, and a frame of the arm there."""

    q: Sequence[float] = option(
        nargs=-1, type=float, required=True, metavar="ANGLE...", text="Joint angles, base to tip, one for each joint."
    )
    frame: str | None = options.frame()


@command(no_args_is_help=True)
def fk(at: ConfigurationOptions, form: FormOptions, source: RobotOptions) -> None:
    """Show the pose of a frame for given joint angles.

    Examples:
      jacokin fk 4.8 2.92 1.0 4.2 1.45 1.32
      jacokin fk -85 167 57 -119 83 76 --degrees
      jacokin fk 4.8 2.92 1.0 4.2 1.45 1.32 --frame gripsite --json
    """
    import numpy as np
    import pinocchio as pin

    arm = source.load()
    joints = form.units.for_joints(arm)
    configuration = arm.configuration(joints.configuration("ANGLE", at.q))
    pose = arm.forward_kinematics(configuration, at.frame)
    quat = model.quat_wxyz(pose.rotation)
    rpy = [form.units.from_si(angle) for angle in pin.rpy.matrixToRpy(pose.rotation)]
    kinova = model.pose_to_kinova(pose)
    within = arm.within_limits(configuration)
    name = at.frame or arm.default_frame
    if form.json:
        display.print_json(
            {
                **display.identity(arm),
                "base": arm.base,
                "frame": name,
                "angle_unit": form.units.angle,
                "position": pose.translation,
                "quat_wxyz": quat,
                "rpy": rpy,
                "kinova": {"position_mm": kinova[0], "angles_deg": kinova[1]},
                "matrix": pose.homogeneous,
                "within_limits": within,
            }
        )
        return
    rows = [
        ("position x y z [m]", display.numbers(pose.translation)),
        ("quaternion w x y z", display.numbers(quat)),
        (f"roll pitch yaw [{form.units.angle}]", display.numbers(rpy)),
        ("as Kinova says it [mm, deg]", display.numbers(np.concatenate(kinova))),
        ("joint limits", "all kept" if within else _broken(arm.joint_names, arm.lower, arm.upper, configuration)),
    ]
    display.show_facts(rows, f"{arm.label}: {name} in {arm.base}")


def _broken(names: Iterable[str], lower: Iterable[float], upper: Iterable[float], q: Iterable[float]) -> str:
    """Names of the joints that are outside their limits."""
    outside = [name for name, low, high, at in zip(names, lower, upper, q, strict=True) if not low <= at <= high]
    return f"broken by {', '.join(outside)}"


@dataclass(frozen=True, slots=True)
class JacobianOptions(ConfigurationOptions):
    """The axes of a Jacobian, too."""

    reference: str = option(
        "--reference", default="local_world_aligned", metavar="NAME", help="local_world_aligned, local or world."
    )


@command(no_args_is_help=True)
def jacobian(at: JacobianOptions, form: FormOptions, source: RobotOptions) -> None:
    """Show the Jacobian of a frame.

    Linear rows [m/rad] come first, then angular ones.
    --degrees is for the joint angles given; the Jacobian stays per radian (per metre for a prismatic joint).

    Examples:
      jacokin jacobian 4.8 2.92 1.0 4.2 1.45 1.32
      jacokin jacobian 4.8 2.92 1.0 4.2 1.45 1.32 --reference local --frame gripsite --json
    """
    arm = source.load()
    joints = form.units.for_joints(arm)
    configuration = arm.configuration(joints.configuration("ANGLE", at.q))
    matrix = arm.jacobian(configuration, at.frame, at.reference)
    singular_values = arm.singular_values(configuration, at.frame)
    manipulability = arm.manipulability(configuration, at.frame)
    name = at.frame or arm.default_frame
    if form.json:
        display.print_json(
            {
                **display.identity(arm),
                "frame": name,
                "reference": at.reference,
                "joint_names": arm.joint_names,
                "jacobian": matrix,
                "singular_values": singular_values,
                "manipulability": manipulability,
            }
        )
        return
    names = ("vx", "vy", "vz", "wx", "wy", "wz")
    rows = [(label, *(display.number(value) for value in row)) for label, row in zip(names, matrix, strict=True)]
    display.show_table(f"{arm.label}: Jacobian of {name}, {at.reference}", ("", *arm.joint_names), rows)
    display.show_facts(
        [("singular values", display.numbers(singular_values)), ("manipulability", f"{manipulability:.6g}")],
    )
