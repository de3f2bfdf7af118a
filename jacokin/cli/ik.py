"""`jacokin ik`: joint angles for one pose, every branch of it, or a file of poses."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING

import jacokin.ik
import jacokin.model
from jacokin.cli import options
from jacokin.cli.command import command, option, switch
from jacokin.cli.groups import (
    BatchOptions,
    FormOptions,
    RobotOptions,
    SceneOptions,
    ToolOptions,
    free_about,
    load_generator,
)
from jacokin.cli.options import Vector3, Vector4, Vector6
from jacokin.cli.process import NOT_SOLVED
from jacokin.cli.units import Units, warn_of_degrees, warn_of_millimetres
from jacokin.errors import InvalidInputError

if TYPE_CHECKING:
    import numpy as np
    import pinocchio as pin
    from numpy.typing import NDArray


ORIENTATIONS = ("--quat-wxyz", "--rpy", "--down", "--approach")
OTHER_TARGETS = ("--targets", "--to")  # a file of poses, and joint angles


@dataclass(frozen=True, slots=True)
class TargetOptions:
    """The pose to reach."""

    position: Vector3 | None = option(
        "--position", without=OTHER_TARGETS, metavar="X Y Z", help="Where the tool should be [m]."
    )
    kinova: Vector6 | None = option(
        "--kinova",
        without=("--position", *ORIENTATIONS, *OTHER_TARGETS),
        metavar="X Y Z A B C",
        help="Its pose as Kinova says it: [mm], [deg], R = Rx(A) Ry(B) Rz(C).",
    )
    quat_wxyz: Vector4 | None = option(
        "--quat-wxyz", without=OTHER_TARGETS, metavar="W X Y Z", help="Its orientation as a quaternion."
    )
    rpy: Vector3 | None = option(
        "--rpy", without=OTHER_TARGETS, metavar="R P Y", help="Its orientation as R = Rz(Y) Ry(P) Rx(R)."
    )
    down: bool = switch("--down", without=OTHER_TARGETS, help="Its orientation: pointing vertically down.")
    approach: Vector3 | None = option(
        "--approach",
        without=("--quat-wxyz", "--rpy", "--down", "--free-axis", *OTHER_TARGETS),
        metavar="X Y Z",
        help="The direction its z axis points in; the roll is free.",
    )
    free_axis: list[float] | None = options.free_axis(without=OTHER_TARGETS)
    free_range: tuple[float, float] | None = options.free_range(needs=("--free-axis", "--approach"))

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

    def build(self, units: Units) -> pin.SE3 | NDArray[np.float64] | jacokin.FreeAxis:
        """The pose; the position alone when the orientation is free; or a pose that may turn about an axis.

        With a note where a number looks like one of another unit.

        Raises:
            InvalidInputError: options that do not go together, or a malformed value.
        """
        for flag, angles in (("--rpy", self.rpy), ("--free-range", self.free_range)):
            if angles is not None:
                warn_of_degrees(flag, angles, units)
        if self.kinova is not None:
            at = jacokin.model.pose_from_kinova(self.kinova[:3], self.kinova[3:])
            return self._about_axis(at, units)
        assert self.position is not None  # each command asks for one of the two
        if self.approach is not None:
            target = jacokin.pose(self.position, approach=self.approach)
            if self.free_range is None:
                return target
            return jacokin.FreeAxis(target.pose, axis=target.axis, range=units.to_si(self.free_range))
        if not self.is_oriented:
            if self.free_axis is not None:
                raise InvalidInputError("--free-axis needs an orientation to start from")
            from jacokin.model import checks

            warn_of_millimetres("--position", self.position)
            return checks.vector("position", self.position, 3, "m")
        # Within half a turn: of more, `warn_of_degrees` has told already.
        rpy = None if self.rpy is None else [math.remainder(angle, 2.0 * math.pi) for angle in units.to_si(self.rpy)]
        return self._about_axis(jacokin.pose(self.position, self.quat_wxyz, rpy=rpy, down=self.down), units)

    def _about_axis(self, at: pin.SE3, units: Units) -> pin.SE3 | jacokin.FreeAxis:
        """The pose, or one that may turn about an axis where that is asked for."""
        return at if self.free_axis is None else free_about(at, self.free_axis, self.free_range, units)


@dataclass(frozen=True, slots=True)
class SolvingOptions:
    """How a pose is solved for, and when it counts as reached."""

    method: str = option("--method", default="auto", metavar="NAME", help="auto, closed_form or qp.")
    position_tolerance: float = option(
        "--position-tolerance", default=1e-6, metavar="D", help="A success is this near [m]."
    )
    orientation_tolerance: float = option(
        "--orientation-tolerance",
        default=1e-6,
        metavar="A",
        help="And this near in orientation [rad], also with --degrees.",
    )
    qp_solver: str = option("--qp-solver", default="daqp", metavar="NAME", help="daqp, quadprog, osqp or proxqp.")
    collision: str | None = option(
        "--collision",
        metavar="NAME",
        help="Contact: prefer to avoid it, reject, report or ignore it; "
        "with a scene or a clearance reject, else prefer.",
    )


@dataclass(frozen=True, slots=True)
class IKOptions:
    """Which answer is looked for, and where the search starts."""

    prefer: str | None = option(
        "--prefer",
        without=("--all", "--targets"),
        metavar="NAME",
        help="Which configuration: nearest (if not given), margin, manipulability.",
    )
    every: bool = switch("--all", without=("--targets",), help="Show every branch, inside the limits or not.")
    closest: bool | None = option(
        "--closest/--no-closest",
        without=("--all",),
        default=None,
        help="Look for the closest configuration where a pose is not reached, which takes long; "
        "if not given, for one pose and not for files.",
    )
    seed: list[float] | None = options.seed()
    random_seed: int | None = options.random_seed(without=("--all", "--targets"))
    fixed: Sequence[str] = option(
        "--fixed",
        needs=("--all",),
        multiple=True,
        metavar="JOINT=VALUE",
        help="With --all, on an arm of more than six joints: hold a joint there. Repeatable.",
    )


@command(no_args_is_help=True)
def ik(
    given: IKOptions,
    wanted: TargetOptions,
    batch: BatchOptions,
    solving: SolvingOptions,
    around: SceneOptions,
    tool: ToolOptions,
    form: FormOptions,
    source: RobotOptions,
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
    from jacokin.cli.ik_answers import show_curves, show_none, show_points, show_result

    if batch.targets is not None and form.units.degrees:
        raise InvalidInputError("--degrees does not go with --targets: files hold angles in radians")
    if batch.targets is None and wanted.position is None and wanted.kinova is None:
        raise InvalidInputError("give --position X Y Z or --targets FILE.csv; `jacokin ik --help` has examples")
    if given.every and not wanted.is_oriented:
        raise InvalidInputError("--all needs an orientation: a position alone is reached by infinitely many")
    source.keep_apart({"--output": batch.output}, {"--targets": batch.targets, "--scene": around.scene})
    arm = source.load()
    start = form.units.for_joints(arm).seed("--seed", given.seed)
    solver = jacokin.IKSolver(
        arm,
        tool.frame,
        tool=tool.tool,
        scene=around.load(),
        clearance=around.clearance,
        **asdict(solving),
    )
    if batch.targets is not None:
        from jacokin.cli import ik_batch

        solved = ik_batch.run(solver, batch.targets, batch, start, closest=bool(given.closest), as_json=form.json)
    elif given.every:
        held = read_fixed(given.fixed, arm, form.units)
        target = wanted.build(form.units)
        found = solver.solve_all(target, start, fixed=held) if held else solver.solve_all(target, start)
        if found.dimension == 1:
            solved = show_curves(solver, found, form.units, as_json=form.json)
        elif not len(found) and not form.json:
            show_none(solver, target, start, form.units, held=bool(held))
            solved = False
        else:
            solved = show_points(solver, found, form.units, as_json=form.json)
    else:
        rng = load_generator(given.random_seed)
        looks = given.closest is not False
        result = solver.solve(wanted.build(form.units), start, rng, prefer=given.prefer or "nearest", closest=looks)
        solved = show_result(solver, result, form.units, closest=looks, as_json=form.json)
    if not solved:
        raise SystemExit(NOT_SOLVED)


def read_fixed(texts: Sequence[str], arm: jacokin.Robot, units: Units) -> dict[str, float]:
    """Joints and the values that they are held at [rad or m].

    Raises:
        InvalidInputError: not JOINT=VALUE.
    """
    slides = dict(zip(arm.joint_names, arm.sliding.tolist(), strict=True))
    values = {}
    for joint, [number] in options.parse_joints("--fixed", "JOINT=VALUE", "joint_3=0.4", texts).items():
        values[joint] = number if slides.get(joint, False) else units.to_si([number])[0]
    return values
