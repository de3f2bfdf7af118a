"""`jacokin move`: a motion from joint angles to a pose or to joint angles, without contact."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from jacokin import ik, motion
from jacokin.cli import display, options
from jacokin.cli.command import command, option, switch
from jacokin.cli.display import number, show_facts
from jacokin.cli.groups import FormOptions, RobotOptions, SceneOptions, ToolOptions, load_generator
from jacokin.cli.ik import TargetOptions
from jacokin.cli.paths import TrajectoryFile
from jacokin.cli.process import NOT_SOLVED
from jacokin.cli.units import Units
from jacokin.errors import InvalidInputError

if TYPE_CHECKING:
    from jacokin import model


@dataclass(frozen=True, slots=True)
class MoveOptions:
    """From where to where, how long the search may take, and how fast the arm moves."""

    start: list[float] | None = option("--from", metavar="Q1 .. Q6", help="Joint angles now; home if not given.")
    goal: list[float] | None = option("--to", metavar="Q1 .. Q6", help="Joint angles to go to, in place of a pose.")
    time_limit: float = option("--time-limit", default=2.0, metavar="T", help="For the search [s].")
    random_seed: int | None = options.random_seed()
    dt: float = options.dt()
    velocity_limit: list[float] | None = options.velocity_limit()
    acceleration_limit: list[float] | None = options.acceleration_limit()
    torque_limit: list[float] | None = option(
        "--torque-limit",
        metavar="N ..",
        help="Of the joints [N m], one for all or one for each: the motion is slowed down until none needs more.",
    )
    rated_torque: bool = switch(
        "--rated-torque", without=("--torque-limit",), help="The same, with the limits of the robot's description."
    )


@command(no_args_is_help=True)
def move(
    given: MoveOptions,
    wanted: TargetOptions,
    around: SceneOptions,
    written: TrajectoryFile,
    tool: ToolOptions,
    form: FormOptions,
    source: RobotOptions,
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
    if has_pose == (given.goal is not None):
        raise InvalidInputError("exactly one of --to and a pose (--position or --kinova) is needed")
    written.check(source, {"--scene": around.scene})
    arm = source.load()
    options.keep_degrees(written.output, arm)
    joints = form.units.for_joints(arm)
    scene, clearance = around.load(), around.clearance
    solver = ik.IKSolver(arm, tool.frame, tool=tool.tool, collision="reject", scene=scene, clearance=clearance)
    target = wanted.build(form.units) if given.goal is None else np.array(joints.configuration("--to", given.goal))
    limits = joints.limits("--acceleration-limit", given.acceleration_limit, "rad/s^2")
    acceleration: dict[str, Any] = {} if limits is None else {"acceleration_limit": limits}

    def compute() -> motion.Trajectory:
        return motion.plan_motion(
            solver,
            arm.home if given.start is None else joints.configuration("--from", given.start),
            target,
            time_limit=given.time_limit,
            rng=load_generator(given.random_seed),
            dt=given.dt,
            velocity_limit=joints.limits("--velocity-limit", given.velocity_limit, "rad/s"),
            torque_limit=given.rated_torque
            or (given.torque_limit[0] if given.torque_limit and len(given.torque_limit) == 1 else given.torque_limit),
            **acceleration,
        )

    result = written.fill(compute)
    if form.json:
        _print_json(arm, result, form.units)
    else:
        _show(arm, result, form.units, written.facts(result))
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
