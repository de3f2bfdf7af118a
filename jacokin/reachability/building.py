"""`build`: a map of where an arm reaches. Read this file first.

Every orientation of a set is tried at every position of a grid, with the closed form, which gives all configurations
and needs no seed: what a map calls unreachable is unreachable. The work is cut into chunks that are kept in a folder
with the recipe of the map; a build that was killed continues from there, and several processes can share the work.

The folder is plain: `recipe.json`, the chunks as NPZ files `000000-<hash>.npz`, and, once complete, `manifest.json`
with the SHA-256 of each.
"""

from __future__ import annotations

import math
import pickle
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import orjson
from scipy.spatial import ConvexHull, QhullError

import jacokin
from jacokin import files
from jacokin.arrays import Array
from jacokin.chunks.execution import Progress, checked_executor, reporter, run_jobs, usable_cores
from jacokin.chunks.folder import RECIPE, ChunkFolder, Keeper, file_digest
from jacokin.errors import InvalidInputError, StructureError
from jacokin.ik.fixed_joints import SIX
from jacokin.ik.solver import IKSolver
from jacokin.model import checks
from jacokin.model.many_configurations import Chain
from jacokin.model.poses import FreeAxis
from jacokin.model.robot import Robot, checked_robot
from jacokin.reachability.folder import MANIFEST, MapJob, load, make, make_recipe
from jacokin.reachability.map import ReachabilityMap
from jacokin.reachability.samples import (
    NO_SYMMETRIES,
    Grid,
    Orientations,
    Samples,
    checked_orientations,
    find_symmetries,
)


def build(
    robot: Robot | IKSolver,
    *,
    folder: str | Path,
    grid: Grid | None = None,
    orientations: Orientations | FreeAxis | Sequence[FreeAxis] | int = 200,
    executor: Executor | None = None,
    shard: str | None = None,
    progress: Callable[[Progress], None] | None = None,
    use_symmetry: bool = True,
) -> ReachabilityMap | None:
    """Build a map, or the part of it that is missing.

    Args:
        robot: an arm of six or seven joints with a closed form, or a solver of one, for its frame, tool, contact, scene
            and clearance. With collision="prefer" configurations in which the arm does not touch itself are counted,
            at the samples as they are; with "reject" those that touch neither the arm nor the scene, without using
            symmetry, of which hand and base have little; with "ignore" all. On seven joints, each pose has curves of
            configurations, which takes some hundred times as long, and intervals are counted.
        folder: where the map is kept; made if it is not there. A map that is there is completed.
        grid: the box to cover; None for all that the arm could reach, in steps of 5 cm.
        orientations: a set, or a number of evenly spread ones: of rotations, or, where the last joint rolls the tool
            freely, of directions of its axis. One or several `FreeAxis` (their positions are not used) are reached
            where any of their members is; intervals are counted, and unless the axis is that of the last joint, it
            takes some hundred times as long.
        executor: any executor; None for threads of this process, one for each core.
        shard: "i/n" builds the i-th of n parts (1/n to n/n) and returns None while others are missing.
        progress: called when a chunk is finished, with numbers of positions.
        use_symmetry: use that the first and the last joint turn freely, where they do; see `Symmetries`.

    Returns:
        The map; None while chunks of other shards are missing.

    Raises:
        InvalidInputError: malformed arguments, too large a grid, or a folder of another map (says what differs).
        StructureError: the robot has no closed form, or fewer than six joints.
        ShapeError: the robot's shapes cannot be loaded, and contact is to be avoided.
        JacokinError: a worker failed or the disk is full; finished chunks are kept.
    """
    mine = _shard(shard)
    use_symmetry = checks.flag("use_symmetry", use_symmetry)
    checked_executor(executor)
    path = Path(checks.text("folder", str(checks.path("folder", folder))))
    checks.optional(checks.instance, "grid", grid, Grid, "a Grid")
    checks.optional(checks.function, "progress", progress)
    solver = _solver(robot)
    if solver.dimension() != 1:
        solver.closed_form()
    found = NO_SYMMETRIES
    if use_symmetry and solver.verifier.options.collision in ("ignore", "prefer"):
        found = find_symmetries(solver)
    chosen, found = checked_orientations(orientations, found)
    if chosen.axes is not None and solver.dimension() == 1:
        raise InvalidInputError("orientations that may turn about an axis are for six joints: seven turn by themselves")
    samples = Samples(Grid.around(solver.robot, spacing=0.05) if grid is None else grid, chosen, found)
    recipe = make_recipe(solver, samples)
    size = recipe["chunks"]["positions"]  # type: ignore[index]  # a dictionary, written above
    starts = range(0, samples.positions, size)
    chunks = ChunkFolder(path, recipe, len(starts), ".npz")
    with chunks.locked(shared=True):
        finished = chunks.finished()
        manifest = chunks.path / MANIFEST
        if len(finished) < len(starts):
            manifest.unlink(missing_ok=True)
        missing = [index for index in range(len(starts)) if index not in finished and index % mine[1] == mine[0]]
        with ExitStack() as stack:
            if executor is None:
                executor = stack.enter_context(ThreadPoolExecutor(usable_cores()))
            total = min(samples.positions, (len(missing) + len(finished)) * size)
            advance = reporter(progress, total, min(total, len(finished) * size))
            for index, content in run_jobs(make, _jobs(solver, samples, size, missing, chunks.keeper), executor):
                finished[index] = chunks.put(index, content)
                advance(min(size, samples.positions - index * size))
        finished = chunks.finished()
        if len(finished) < len(starts):
            return None
        with files.replacing(manifest) as written:
            hashes = {finished[index].name: file_digest(finished[index]) for index in range(len(starts))}
            document = {
                "sha256": hashes,
                "recipe": file_digest(chunks.path / RECIPE),
                "symmetries": recipe["symmetries"],
                "bound": derive_bound(samples, solver),
            }
            written.write_bytes(orjson.dumps(document, option=orjson.OPT_INDENT_2))
        chunks.remove_unfinished()
    return load(path, robot=solver.robot, scene=solver.verifier.options.scene)


def _solver(robot: Robot | IKSolver) -> IKSolver:
    """What solves for the poses of a map.

    Raises:
        InvalidInputError: neither a robot nor a solver, or contact is treated in a way that maps do not have.
        JacokinError: as `build`.
    """
    arm = robot.robot if isinstance(robot, IKSolver) else checked_robot("robot", robot)
    if not SIX <= arm.dof <= SIX + 1:
        raise StructureError(f"maps are of arms with six or seven joints; {arm.label} has {arm.dof}")
    if not isinstance(robot, IKSolver):
        solver = IKSolver(robot, method="closed_form")
    else:
        options = robot.verifier.options
        collision, scene = options.collision, options.scene
        if collision == "report" or (collision == "prefer" and scene is not None):
            known = "'reject' for a map with obstacles" if scene else "'prefer', 'reject' or 'ignore' for a map"
            raise InvalidInputError(f"collision must be {known}, got {collision!r}")
        solver = IKSolver(
            robot.robot,
            robot.frame,
            tool=robot.tool,
            method="closed_form",
            collision=collision,
            scene=scene,
            clearance=options.clearance,
        )
    solver.verifier.require_contact()
    return solver


def _jobs(
    solver: IKSolver, samples: Samples, size: int, missing: list[int], keeper: Keeper
) -> Iterator[tuple[int, MapJob]]:
    pickled = pickle.dumps(solver)
    for index in missing:
        stop = min((index + 1) * size, samples.positions)
        yield index, MapJob(jacokin.__version__, pickled, samples, index * size, stop, index, keeper)


def _shard(shard: str | None) -> tuple[int, int]:
    """Remainder and divisor of the chunks that are this one's.

    Raises:
        InvalidInputError: not "i/n" with 1 <= i <= n.
    """
    if shard is None:
        return 0, 1
    parts = shard.split("/") if isinstance(shard, str) else []
    if len(parts) == 2 and all(part.isascii() and part.isdigit() for part in parts):
        number, count = int(parts[0]), int(parts[1])
        if 1 <= number <= count:
            return number - 1, count
    raise checks.refusal("shard", "'i/n' with 1 <= i <= n", shard)


def derive_bound(samples: Samples, solver: IKSolver) -> float | None:
    """The bound [m]; None where the orientations are some that were chosen and not spread over all."""
    angle = covering_angle(samples.orientations, samples.symmetries.tool_axis)
    if angle is None:
        return None
    half = 0.5 * samples.grid.spacing * math.sqrt(len(samples.shape))
    return 2.0 * half + 2.0 * lever(solver) * math.sin(0.5 * angle)


def covering_angle(orientations: Orientations, tool_axis: Array | None) -> float | None:
    """The largest angle [rad] from any orientation to the nearest one of the set; None if half a turn is not covered.

    Exact: the directions farthest from points on a sphere are the normals of the faces of their convex hull. Rotations
    are points on the sphere of unit quaternions, two for each, at half their angles.

    Args:
        orientations: the set.
        tool_axis: (3,) where only the direction of this axis counts; None where all of the rotation does.
    """
    if orientations.axes is not None:
        return None
    if tool_axis is not None:
        points = orientations.rotations @ tool_axis
    else:
        quats = orientations.quats_wxyz / np.linalg.norm(orientations.quats_wxyz, axis=1, keepdims=True)
        points = np.concatenate([quats, -quats])
    try:
        nearest = -ConvexHull(points).equations[:, -1].max()
    except (QhullError, ValueError):  # too few, or all in one plane
        return None
    if nearest <= 0.0:
        return None
    return (1.0 if tool_axis is not None else 2.0) * math.acos(min(1.0, nearest))


def lever(solver: IKSolver) -> float:
    """Distance [m] from the tool to where the last two axes meet, or come nearest to each other."""
    robot = solver.robot
    chain = Chain(robot, robot.frame_id(solver.frame), solver.tool)
    (T,), (jacobian,) = chain.placements(robot.home[None])
    tool, linear, axes = T[:3, 3], jacobian[:3].T, jacobian[3:].T[-2:]
    points = tool + np.cross(axes, linear[-2:])  # nearest to the tool on each axis
    across = np.cross(axes[0], axes[1])
    if np.linalg.norm(across) < 1e-9:  # sine of an angle between axes that do not meet
        return float(np.linalg.norm(np.cross(axes[1], tool - points[1])))
    along = float(np.cross(points[0] - points[1], axes[0]) @ np.cross(axes[1], axes[0])) / float(across @ across)
    return float(np.linalg.norm(tool - (points[1] + along * axes[1])))
