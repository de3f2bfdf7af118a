"""`jacokin ik`: joint angles for one pose, every branch of it, or a file of poses."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from jacokin.cli import options
from jacokin.cli.declared import Option
from jacokin.cli.exit_codes import NOT_SOLVED
from jacokin.cli.options import free_about
from jacokin.cli.outputs import keep_apart
from jacokin.cli.units import Units, numbers, warn_of_degrees
from jacokin.errors import InvalidInputError

if TYPE_CHECKING:
    import numpy as np
    import pinocchio as pin
    from numpy.typing import NDArray

    from jacokin.model.poses import FreeAxis

Vector3 = tuple[float, float, float]
Vector4 = tuple[float, float, float, float]


def ik(
    position: Annotated[
        Vector3 | None, Option("--position", metavar="X Y Z", help="Where the tool should be [m].")
    ] = None,
    quat_wxyz: Annotated[
        Vector4 | None, Option("--quat-wxyz", metavar="W X Y Z", help="Its orientation as a quaternion.")
    ] = None,
    rpy: Annotated[
        Vector3 | None,
        Option("--rpy", metavar="R P Y", help="Its orientation as R = Rz(Y) Ry(P) Rx(R)."),
    ] = None,
    down: Annotated[bool, Option("--down", help="Its orientation: pointing vertically down.")] = False,
    approach: Annotated[
        Vector3 | None,
        Option("--approach", metavar="X Y Z", help="The direction its z axis points in; the roll is free."),
    ] = None,
    free_axis: options.FreeAxisOption = None,
    free_range: options.FreeRangeOption = None,
    prefer: Annotated[
        str | None,
        Option("--prefer", metavar="NAME", help="Which configuration: nearest (if not given), margin, manipulability."),
    ] = None,
    every: Annotated[bool, Option("--all", help="Show every branch, inside the limits or not.")] = False,
    targets: Annotated[
        Path | None,
        Option(
            "--targets",
            metavar="FILE",
            help="Solve every row of a .csv, .npz or .parquet: columns x,y,z and qw,qx,qy,qz or none.",
        ),
    ] = None,
    output: Annotated[
        Path | None,
        Option("--output", metavar="FILE", help="Write the answers to --targets to this .csv, .npz or .parquet."),
    ] = None,
    resume: Annotated[bool, Option("--resume", help="Continue a run with --targets that did not end.")] = False,
    workers: options.WorkersOption = 1,
    dask: options.DaskOption = None,
    frame: options.FrameOption = None,
    tool: options.ToolOption = None,
    seed: options.SeedOption = None,
    random_seed: options.RandomSeedOption = None,
    method: Annotated[str, Option("--method", metavar="NAME", help="auto, closed_form or qp.")] = "auto",
    qp_solver: Annotated[str, Option("--qp-solver", metavar="NAME", help="daqp, quadprog, osqp or proxqp.")] = "daqp",
    collision: Annotated[
        str | None,
        Option(
            "--collision", metavar="NAME", help="Contact: ignore, report or reject; reject with a scene, else ignore."
        ),
    ] = None,
    scene: options.SceneOption = None,
    clearance: options.ClearanceOption = None,
    degrees: options.DegreesOption = False,
    json: options.JsonOption = False,
    *,
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
      jacokin ik --targets poses.parquet --output joints.parquet --workers 8 --resume
    """
    from jacokin.cli.ik_answers import show_branches, show_family, show_result
    from jacokin.ik.families.family import Family
    from jacokin.ik.solver import IKSolver

    oriented = quat_wxyz is not None or rpy is not None or down or approach is not None
    free = free_axis is not None or free_range is not None
    check(position, oriented, every, targets, output, random_seed, degrees, free, prefer)
    if output is None and (resume or dask is not None):
        raise InvalidInputError(f"{'--resume' if resume else '--dask'} goes with --targets and --output")
    keep_apart(
        {"--output": output},
        {"--targets": targets, "--robot": source.robot, "--scene": scene},
        source.package_dir or (),
    )
    units = Units(degrees)
    arm = source.load()
    if rpy is not None:
        warn_of_degrees("--rpy", rpy, units)
    typed = numbers("--seed", seed)
    start = None if typed is None else units.of_joints(arm).read(typed)
    around, distance = options.surroundings(scene, clearance)
    if collision is None:
        collision = "ignore" if around is None and not distance else "reject"
    solver = IKSolver(
        arm,
        frame,
        tool=options.tool_pose(tool),
        method=method,
        qp_solver=qp_solver,
        collision=collision,
        scene=around,
        clearance=distance,
        warm=None,
    )
    if targets is not None:
        from jacokin.cli import ik_batch

        solved = ik_batch.run(solver, targets, output, start, resume=resume, workers=workers, dask=dask, as_json=json)
    elif every:
        wanted = build(position, quat_wxyz, rpy, down, approach, free_axis, free_range, units)
        found = solver.solve_all(wanted, start)
        if isinstance(found, Family):
            solved = show_family(solver, found, units, as_json=json)
        else:
            solved = show_branches(solver, found, units, reject_contact=collision == "reject", as_json=json)
    else:
        import numpy as np

        rng = None if random_seed is None else np.random.default_rng(random_seed)
        wanted = build(position, quat_wxyz, rpy, down, approach, free_axis, free_range, units)
        result = solver.solve(wanted, start, rng, prefer=prefer or "nearest")
        solved = show_result(solver, result, units, as_json=json)
    if not solved:
        raise SystemExit(NOT_SOLVED)


def build(
    position: Vector3 | None,
    quat_wxyz: Vector4 | None,
    rpy: Vector3 | None,
    down: bool,
    approach: Vector3 | None,
    free_axis: str | None,
    free_range: tuple[float, float] | None,
    units: Units,
) -> pin.SE3 | NDArray[np.float64] | FreeAxis:
    """The pose; the position alone when the orientation is free; or a pose that may turn about an axis.

    Raises:
        InvalidInputError: options that do not go together, or a malformed value.
    """
    import numpy as np

    from jacokin.model.poses import FreeAxis, pose

    assert position is not None  # combinations.check
    if approach is not None:
        if quat_wxyz is not None or rpy is not None or down or free_axis is not None:
            raise InvalidInputError("--approach is an orientation with a free axis: give it alone")
        target = pose(position, approach=approach)
        if free_range is None:
            return target
        return FreeAxis(target.pose, axis=target.axis, range=units.read(free_range))
    if quat_wxyz is None and rpy is None and not down:
        if free_axis is not None or free_range is not None:
            raise InvalidInputError("--free-axis and --free-range need an orientation to start from")
        return np.array(position)
    at = pose(position, quat_wxyz, rpy=None if rpy is None else units.read(rpy), down=down)
    if free_axis is None:
        if free_range is not None:
            raise InvalidInputError("--free-range goes with --free-axis or --approach")
        return at
    return free_about(at, free_axis, free_range, units)


def check(
    position: tuple[float, float, float] | None,
    oriented: bool,
    every: bool,
    targets: Path | None,
    output: Path | None,
    random_seed: int | None,
    degrees: bool,
    free: bool,
    prefer: str | None,
) -> None:
    """Refuse options that do not go together.

    Raises:
        InvalidInputError: names the options.
    """
    if targets is None and position is None:
        raise InvalidInputError("give --position X Y Z or --targets FILE.csv; `jacokin ik --help` has examples")
    if targets is None and output is not None:
        raise InvalidInputError("--output goes with --targets")
    if targets is not None:
        for name, given in (
            ("--position", position is not None),
            ("an orientation", oriented),
            ("--all", every),
            ("--random-seed", random_seed is not None),
            ("--degrees", degrees),
            ("a free axis", free),
            ("--prefer", prefer is not None),
        ):
            if given:
                raise InvalidInputError(f"{name} does not go with --targets: files hold poses, and angles in radians")
    if every and prefer is not None:
        raise InvalidInputError("--prefer does not go with --all, which shows every branch")
    if every and not oriented:
        raise InvalidInputError("--all needs an orientation: a position alone is reached by infinitely many")
