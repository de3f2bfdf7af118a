"""`jacokin ik`: joint angles for one pose, every branch of it, or a file of poses."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import click

import jacokin.ik
import jacokin.model
from jacokin.cli import options
from jacokin.cli.command import Command, option_group, parse_numbers
from jacokin.cli.options import Vector3, Vector4, Vector6, keep_apart
from jacokin.cli.process import NOT_SOLVED
from jacokin.cli.units import Units, warn_of_degrees, warn_of_millimetres
from jacokin.errors import InvalidInputError

if TYPE_CHECKING:
    import numpy as np
    import pinocchio as pin
    from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class TargetOptions:
    """The pose to reach; a command that has these options takes them as one parameter."""

    position: Vector3 | None
    kinova: Vector6 | None
    quat_wxyz: Vector4 | None
    rpy: Vector3 | None
    down: bool
    approach: Vector3 | None
    free_axis: list[float] | None
    free_range: tuple[float, float] | None

    @property
    def is_oriented(self) -> bool:
        """Whether an orientation is given."""
        return (
            self.kinova is not None
            or self.approach is not None
            or self.quat_wxyz is not None
            or self.rpy is not None
            or self.down
        )

    @property
    def is_free(self) -> bool:
        """Whether the tool may turn about an axis, apart from --approach."""
        return self.free_axis is not None or self.free_range is not None

    def build(self, units: Units) -> pin.SE3 | NDArray[np.float64] | jacokin.FreeAxis:
        """The pose; the position alone when the orientation is free; or a pose that may turn about an axis.

        Raises:
            InvalidInputError: options that do not go together, or a malformed value.
        """
        if self.kinova is not None:
            at = jacokin.model.pose_from_kinova(self.kinova[:3], self.kinova[3:])
            return self._about_axis(at, units)
        assert self.position is not None  # check
        if self.approach is not None:
            if self.quat_wxyz is not None or self.rpy is not None or self.down or self.free_axis is not None:
                raise InvalidInputError("--approach is an orientation with a free axis: give it alone")
            target = jacokin.pose(self.position, approach=self.approach)
            if self.free_range is None:
                return target
            return jacokin.FreeAxis(target.pose, axis=target.axis, range=units.to_si(self.free_range))
        if not self.is_oriented:
            if self.is_free:
                raise InvalidInputError("--free-axis and --free-range need an orientation to start from")
            from jacokin.model import checks

            warn_of_millimetres("--position", self.position)
            return checks.vector("position", self.position, 3, "m")
        # Within half a turn: of more, `warn_of_degrees` has told already.
        rpy = None if self.rpy is None else [math.remainder(angle, 2.0 * math.pi) for angle in units.to_si(self.rpy)]
        return self._about_axis(jacokin.pose(self.position, self.quat_wxyz, rpy=rpy, down=self.down), units)

    def _about_axis(self, at: pin.SE3, units: Units) -> pin.SE3 | jacokin.FreeAxis:
        """The pose, or one that may turn about an axis where that is asked for."""
        if self.free_axis is None:
            if self.free_range is not None:
                raise InvalidInputError("--free-range goes with --free-axis or --approach")
            return at
        return options.free_about(at, self.free_axis, self.free_range, units)


target_options = option_group(
    "wanted",
    TargetOptions,
    click.option("--position", type=options.VECTOR, metavar="X Y Z", help="Where the tool should be [m]."),
    click.option(
        "--kinova",
        type=(float,) * 6,
        metavar="X Y Z A B C",
        help="Its pose as Kinova says it: [mm], [deg], R = Rx(A) Ry(B) Rz(C).",
    ),
    click.option("--quat-wxyz", type=options.QUATERNION, metavar="W X Y Z", help="Its orientation as a quaternion."),
    click.option("--rpy", type=options.VECTOR, metavar="R P Y", help="Its orientation as R = Rz(Y) Ry(P) Rx(R)."),
    click.option("--down", is_flag=True, help="Its orientation: pointing vertically down."),
    click.option(
        "--approach", type=options.VECTOR, metavar="X Y Z", help="The direction its z axis points in; the roll is free."
    ),
    options.free_axis,
    options.free_range,
)


@click.command(cls=Command, no_args_is_help=True)
@target_options
@click.option("--prefer", metavar="NAME", help="Which configuration: nearest (if not given), margin, manipulability.")
@click.option("--all", "every", is_flag=True, help="Show every branch, inside the limits or not.")
@click.option(
    "--targets",
    type=options.FILE,
    metavar="FILE",
    help="Solve every row of a .csv, .npz or .parquet: columns x,y,z and qw,qx,qy,qz or none; others are kept.",
)
@click.option(
    "--output", type=options.FILE, metavar="FILE", help="Write the answers to --targets to this .csv, .npz or .parquet."
)
@click.option(
    "--resume/--no-resume",
    default=None,
    help="Continue a run with --targets and --output that did not end, as happens if not given; or start again.",
)
@click.option(
    "--closest/--no-closest",
    default=None,
    help="Look for the closest configuration where a pose is not reached, which takes long; "
    "if not given, for one pose and not for files.",
)
@options.workers
@options.dask
@options.frame
@options.tool
@options.seed
@options.random_seed
@click.option("--method", default="auto", metavar="NAME", help="auto, closed_form or qp.")
@click.option("--position-tolerance", type=float, metavar="D", help="A success is this near [m]; 1e-6 by default.")
@click.option(
    "--orientation-tolerance",
    type=float,
    metavar="A",
    help="And this near in orientation [rad], also with --degrees; 1e-6 by default.",
)
@click.option(
    "--fixed",
    multiple=True,
    metavar="JOINT=VALUE",
    help="With --all, on an arm of more than six joints: hold a joint there. Repeatable.",
)
@click.option("--qp-solver", default="daqp", metavar="NAME", help="daqp, quadprog, osqp or proxqp.")
@click.option(
    "--collision",
    metavar="NAME",
    help="Contact: prefer to avoid it, reject, report or ignore it; with a scene or a clearance reject, else prefer.",
)
@options.scene
@options.clearance
@options.degrees
@options.json
@options.robot()
def ik(
    wanted: TargetOptions,
    prefer: str | None,
    every: bool,
    targets: Path | None,
    output: Path | None,
    resume: bool | None,
    closest: bool | None,
    workers: int,
    dask: str | None,
    frame: str | None,
    tool: pin.SE3 | None,
    seed: list[float] | None,
    random_seed: int | None,
    method: str,
    position_tolerance: float | None,
    orientation_tolerance: float | None,
    fixed: Sequence[str],
    qp_solver: str,
    collision: str | None,
    scene: Path | None,
    clearance: float,
    units: Units,
    json: bool,
    source: options.RobotOptions,
) -> None:
    """Find joint angles, inside the joint limits, for a pose.

    Give at most one orientation; without one the orientation is free.
    Exit code: 0 solved, 1 not (all) solved, 2 wrong input.

    Examples:
      jacokin ik --position 0.3 -0.2 0.5                        position only
      jacokin ik --position 0.3 -0.2 0.5 --down                 tool vertically down
      jacokin ik --position 0.3 -0.2 0.5 --rpy 90 0 -30 --degrees
      jacokin ik --position 0.3 -0.2 0.5 --down --all           every branch
      jacokin ik --position 0.3 -0.2 0.5 --down --json          for programs
      jacokin ik --position 0.3 -0.2 0.5 --down --seed 4.8 2.9 1.0 4.2 1.4 1.3
      jacokin ik --position 0.3 -0.2 0.5 --down --scene scene.yaml --clearance 0.01
      jacokin ik --position 0.3 -0.2 0.3 --approach 1 0 0       from the side, roll free
      jacokin ik --position 0.3 -0.2 0.3 --down --free-axis y --free-range -0.5 0.5 --prefer margin
      jacokin ik --targets targets.csv --output joints.csv      a file of poses
      jacokin ik --targets poses.parquet --output joints.parquet --workers 8
    """
    from jacokin.cli.ik_answers import show_curves, show_points, show_result
    from jacokin.ik.options import ORIENTATION_TOLERANCE, POSITION_TOLERANCE

    if fixed and not every:
        raise InvalidInputError("--fixed goes with --all")
    if targets is None:
        check_one_pose(wanted, every, prefer, output)
        if every and closest is not None:
            raise InvalidInputError("--closest and --no-closest do not go with --all, which shows every branch")
    else:
        others = {"--all": every, "--random-seed": random_seed is not None, "--prefer": prefer is not None}
        check_file(wanted, {**others, "--degrees": units.degrees})
    if output is None and (resume is not None or dask is not None):
        option = "--dask" if resume is None else "--resume" if resume else "--no-resume"
        raise InvalidInputError(f"{option} goes with --targets and --output")
    keep_apart(
        {"--output": output}, {"--targets": targets, "--robot": source.robot, "--scene": scene}, source.package_dirs
    )
    arm = source.load()
    if wanted.rpy is not None:
        warn_of_degrees("--rpy", wanted.rpy, units)
    if wanted.free_range is not None:
        warn_of_degrees("--free-range", wanted.free_range, units)
    start = units.for_joints(arm).seed("--seed", seed)
    obstacles = options.load_scene(scene)
    solver = jacokin.IKSolver(
        arm,
        frame,
        tool=tool,
        method=method,
        qp_solver=qp_solver,
        collision=collision,
        scene=obstacles,
        clearance=clearance,
        position_tolerance=POSITION_TOLERANCE if position_tolerance is None else position_tolerance,
        orientation_tolerance=ORIENTATION_TOLERANCE if orientation_tolerance is None else orientation_tolerance,
    )
    if targets is not None:
        from jacokin.cli import ik_batch

        solved = ik_batch.run(
            solver,
            targets,
            output,
            start,
            resume=resume is not False,
            closest=bool(closest),
            workers=workers,
            dask=dask,
            as_json=json,
        )
    elif every:
        held = read_fixed(fixed, arm, units)
        target = wanted.build(units)
        found = solver.solve_all(target, start, fixed=held) if held else solver.solve_all(target, start)
        if found.dimension == 1:
            solved = show_curves(solver, found, units, as_json=json)
        else:
            solved = show_points(solver, found, units, as_json=json)
    else:
        import numpy as np

        rng = None if random_seed is None else np.random.default_rng(random_seed)
        looks = closest is not False
        result = solver.solve(wanted.build(units), start, rng, prefer=prefer or "nearest", closest=looks)
        solved = show_result(solver, result, units, closest=looks, as_json=json)
    if not solved:
        raise SystemExit(NOT_SOLVED)


def read_fixed(texts: Sequence[str], arm: jacokin.Robot, units: Units) -> dict[str, float]:
    """Joints and the values that they are held at [rad or m].

    Raises:
        InvalidInputError: not JOINT=VALUE.
    """
    slides = dict(zip(arm.joint_names, arm.sliding.tolist(), strict=True))
    values = {}
    for text in texts:
        joint, sign, value = text.rpartition("=")
        if not sign:
            raise InvalidInputError(f"--fixed must be JOINT=VALUE, for example joint_3=0.4, got {text!r}")
        [number] = parse_numbers(f"--fixed {joint}", value, 1)
        values[joint] = number if slides.get(joint, False) else units.to_si([number])[0]
    return values


def check_file(wanted: TargetOptions, others: Mapping[str, bool]) -> None:
    """Refuse options that do not go with --targets.

    Raises:
        InvalidInputError: names the option.
    """
    position = {"--position": wanted.position is not None, "--kinova": wanted.kinova is not None}
    turned = {"an orientation": wanted.is_oriented, "a free axis": wanted.is_free}
    for name, is_given in {**position, **turned, **others}.items():
        if is_given:
            raise InvalidInputError(f"{name} does not go with --targets: files hold poses, and angles in radians")


def check_one_pose(wanted: TargetOptions, every: bool, prefer: str | None, output: Path | None) -> None:
    """Refuse options that do not go together without --targets.

    Raises:
        InvalidInputError: names the options.
    """
    turned = (wanted.quat_wxyz, wanted.rpy, wanted.approach, wanted.position)
    if wanted.kinova is not None and (wanted.down or any(each is not None for each in turned)):
        raise InvalidInputError("--kinova is a whole pose: give it without --position and an orientation")
    if wanted.position is None and wanted.kinova is None:
        raise InvalidInputError("give --position X Y Z or --targets FILE.csv; `jacokin ik --help` has examples")
    if output is not None:
        raise InvalidInputError("--output goes with --targets")
    if every and prefer is not None:
        raise InvalidInputError("--prefer does not go with --all, which shows every branch")
    if every and not wanted.is_oriented:
        raise InvalidInputError("--all needs an orientation: a position alone is reached by infinitely many")
