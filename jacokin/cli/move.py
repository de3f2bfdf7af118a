"""`jacokin move`: a motion from joint angles to a pose or to joint angles, without contact."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from jacokin import ik, motion
from jacokin.cli import display, options
from jacokin.cli.command import Command, NumberList
from jacokin.cli.display import number, show_facts
from jacokin.cli.ik import TargetOptions, target_options
from jacokin.cli.options import keep_apart
from jacokin.cli.paths import Written, check_trajectory_files, compute_into, files_written
from jacokin.cli.process import NOT_SOLVED
from jacokin.cli.units import Units
from jacokin.errors import InvalidInputError

if TYPE_CHECKING:
    import pinocchio as pin

    from jacokin import model


@click.command(cls=Command, no_args_is_help=True)
@click.option("--from", "start", cls=NumberList, metavar="Q1 .. Q6", help="Joint angles now; home if not given.")
@click.option("--to", "goal", cls=NumberList, metavar="Q1 .. Q6", help="Joint angles to go to, in place of a pose.")
@target_options
@options.scene
@options.clearance
@click.option("--time-limit", default=2.0, metavar="T", help="For the search [s].")
@options.random_seed
@click.option("--dt", default=0.01, metavar="T", help="Control step [s].")
@options.velocity_limit
@click.option(
    "--acceleration-limit", cls=NumberList, metavar="A ..", help="Of the joints [rad/s^2]; 1 rad/s^2 if not given."
)
@click.option(
    "--torque-limit",
    cls=NumberList,
    metavar="N ..",
    help="Of the joints [N m], one for all or one for each: the motion is slowed down until none needs more.",
)
@click.option("--rated-torque", is_flag=True, help="The same, with the limits of the robot's description.")
@click.option(
    "--output",
    type=options.FILE,
    metavar="FILE",
    help="Write the motion here, .csv, .npz, .json (ROS), .kinova.csv or .kinova.json (kinova-ros).",
)
@click.option("--ros", type=click.Choice(["1", "2"]), default="2", help="The version of ROS a .json is for.")
@click.option(
    "--joint-prefix", default="", metavar="P", help="Before the names of joints in a .json, such as j2n6s300_."
)
@click.option("--first-time", default=0.0, metavar="T", help="Of the first point in a .json [s].")
@click.option("--save-failed", is_flag=True, help="Write a motion that failed, too, .csv or .npz, to look at.")
@click.option("--plot", type=options.FILE, metavar="FILE.png", help="Draw joints, limits and distances over time.")
@options.frame
@options.tool
@options.degrees
@options.json
@options.robot()
def move(
    start: list[float] | None,
    goal: list[float] | None,
    wanted: TargetOptions,
    scene: Path | None,
    clearance: float,
    time_limit: float,
    random_seed: int | None,
    dt: float,
    velocity_limit: list[float] | None,
    acceleration_limit: list[float] | None,
    torque_limit: list[float] | None,
    rated_torque: bool,
    output: Path | None,
    ros: str,
    joint_prefix: str,
    first_time: float,
    save_failed: bool,
    plot: Path | None,
    frame: str | None,
    tool: pin.SE3 | None,
    units: Units,
    json: bool,
    source: options.RobotOptions,
) -> None:
    """Plan a motion to a pose or to joint angles that touches nothing on its way.

    Exit code: 0 there is one, 1 not, 2 wrong input.

    Examples:
      jacokin move --position 0.3 -0.2 0.5 --down --output motion.csv
      jacokin move --position 0.4 0.3 0.3 --approach 1 0 0 --scene scene.yaml --clearance 0.01
      jacokin move --from 275 167 57 241 83 76 --to 200 180 90 240 80 70 --degrees --output arm.kinova.csv
    """
    import numpy as np

    has_pose = wanted.position is not None or wanted.kinova is not None
    if has_pose == (goal is not None):
        raise InvalidInputError("exactly one of --to and a pose (--position or --kinova) is needed")
    if rated_torque and torque_limit is not None:
        raise InvalidInputError("at most one of --torque-limit and --rated-torque is needed")
    written = Written(output, int(ros), joint_prefix, first_time, save_failed)
    check_trajectory_files(written, plot)
    keep_apart({"--output": output, "--plot": plot}, {"--robot": source.robot, "--scene": scene}, source.package_dirs)
    arm = source.load()
    joints = units.for_joints(arm)
    solver = ik.IKSolver(
        arm, frame, tool=tool, collision="reject", scene=options.load_scene(scene), clearance=clearance
    )
    target = wanted.build(units) if goal is None else np.array(joints.configuration("--to", goal))
    limits = joints.limits("--acceleration-limit", acceleration_limit, "rad/s^2")
    acceleration: dict[str, Any] = {} if limits is None else {"acceleration_limit": limits}

    def compute() -> motion.Trajectory:
        return motion.plan_motion(
            solver,
            arm.home if start is None else joints.configuration("--from", start),
            target,
            time_limit=time_limit,
            rng=None if random_seed is None else np.random.default_rng(random_seed),
            dt=dt,
            velocity_limit=joints.limits("--velocity-limit", velocity_limit, "rad/s"),
            torque_limit=rated_torque or (torque_limit[0] if torque_limit and len(torque_limit) == 1 else torque_limit),
            **acceleration,
        )

    result = compute_into(written, plot, compute)
    if json:
        _print_json(arm, result, units)
    else:
        _show(arm, result, units, files_written(written, plot, result))
    if not result.success:
        raise SystemExit(NOT_SOLVED)


def _print_json(arm: model.Robot, result: motion.Trajectory, units: Units) -> None:
    joints = units.for_joints(arm)
    display.print_json(
        {
            **display.identity(arm),
            "success": result.success,
            "outcome": result.outcome,
            "message": result.message,
            "duration": result.duration,
            "joint_names": arm.joint_names,
            "q_start": joints.from_si(result.q[0]),
            "q_end": joints.from_si(result.q[-1]),
            "min_clearance": _least(result),
            "angle_unit": units.angle,
        }
    )


def _show(arm: model.Robot, result: motion.Trajectory, units: Units, written: list[tuple[str, str]]) -> None:
    joints = units.for_joints(arm)
    ends = zip(joints.from_si(result.q[-1]), joints.names, strict=True)
    lines = [
        ("result", "there is a way" if result.success else "no way"),
        ("note", units.in_words(result.message)),
    ]
    if result.success:
        lines += [
            ("duration", f"{result.duration:.3f} s, {len(result)} rows"),
            ("ends at", ", ".join(f"{number(value)} {unit}" for value, unit in ends)),
        ]
    else:
        lines.append(("advice", motion.MotionStatus[result.outcome].value))
    least = _least(result)
    if least is not None:
        lines.append(("least clearance", f"{number(least)} m"))
    show_facts([*lines, *written], arm.label)


def _least(result: motion.Trajectory) -> float | None:
    """The smallest distance along a motion [m]; None where none was measured."""
    known = [each for each in result.clearance.tolist() if math.isfinite(each)]
    return min(known, default=None)
