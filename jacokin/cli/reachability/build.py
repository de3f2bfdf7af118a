"""`jacokin map build`: a map in a folder, or the part of it that is missing."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from jacokin.cli.arguments import options
from jacokin.cli.arguments.declared import Argument, Option
from jacokin.cli.arguments.free_axis import axis_of
from jacokin.cli.display import tables
from jacokin.cli.display.progress import progress_bar

if TYPE_CHECKING:
    from jacokin.reachability import Orientations

SEVEN = 7  # joints of an arm whose poses have families

Vector3 = tuple[float, float, float]


def build(
    folder: Annotated[Path, Argument(metavar="FOLDER", help="Where the map is kept; one that is there is completed.")],
    spacing: Annotated[float, Option("--spacing", metavar="M", help="Edge of a cell [m].")] = 0.05,
    orientations: Annotated[
        int, Option("--orientations", metavar="N", at_least=1, help="How many, spread evenly.")
    ] = 200,
    down: Annotated[bool, Option("--down", help="The tool pointing vertically down instead.")] = False,
    free_axis: Annotated[
        str | None,
        Option(
            "--free-axis",
            metavar="AXIS",
            help="Directions of this axis of the tool (x, y, z or X,Y,Z), about which it may turn; "
            "with --down, the tool pointing down, which may turn about it.",
        ),
    ] = None,
    lower: Annotated[Vector3 | None, Option("--lower", metavar="X Y Z", help="Lower corner of the box [m].")] = None,
    upper: Annotated[Vector3 | None, Option("--upper", metavar="X Y Z", help="Upper corner of the box [m].")] = None,
    scene: options.SceneOption = None,
    avoid_contact: Annotated[
        bool, Option("--avoid-contact", help="Leave out configurations in self-contact; a scene does so, too.")
    ] = False,
    shard: Annotated[str | None, Option("--shard", metavar="I/N", help="Build the I-th of N parts only.")] = None,
    workers: options.WorkersOption = 1,
    dask: options.DaskOption = None,
    frame: options.FrameOption = None,
    tool: options.ToolOption = None,
    *,
    source: options.RobotOptions,
) -> None:
    """Build a map of where the arm reaches.

    Continues where a build that was killed has stopped. Seven joints, a free axis and contact take some hundred times
    as long as the rest. Exit code: 0, also when parts of other shards are missing.

    Examples:
      jacokin map build out/jaco
      jacokin map build out/jaco --spacing 0.02 --orientations 500 --workers 8
      jacokin map build out/jaco --shard 3/16
      jacokin map build out/level --down --free-axis x --scene table.yaml --workers 2
    """
    from concurrent.futures import ThreadPoolExecutor
    from contextlib import nullcontext

    from jacokin.chunks.cluster import dask_executor
    from jacokin.chunks.processes import worker_processes
    from jacokin.errors import InvalidInputError
    from jacokin.ik.batches.progress import Progress
    from jacokin.reachability import Grid
    from jacokin.reachability import build as build_map

    if (lower is None) != (upper is None):
        raise InvalidInputError("--lower and --upper go together")
    arm = source.load()
    grid = Grid.around(arm, spacing) if lower is None or upper is None else Grid(lower, upper, spacing)
    around, _ = options.surroundings(scene, None)
    contact = avoid_contact or around is not None
    slow = contact or free_axis is not None or arm.dof == SEVEN  # in Python, where threads wait for each other
    start = worker_processes if slow and workers > 1 else ThreadPoolExecutor
    executor = start(workers) if dask is None else nullcontext(None)
    with progress_bar("positions") as show, executor as threads:

        def advance(so_far: Progress) -> None:
            show(so_far.done, so_far.total)

        with nullcontext(threads) if dask is None else dask_executor(dask) as pool:
            found = build_map(
                arm,
                folder=folder,
                grid=grid,
                orientations=_orientations(orientations, free_axis, down=down),
                executor=pool,
                shard=shard,
                progress=advance,
                frame=frame,
                tool=options.tool_pose(tool),
                collision="reject" if contact else "ignore",
                scene=around,
            )
    if found is None:
        tables.say(f"{folder}: shard {shard} is finished; others are missing")
    else:
        tables.say(f"{folder}: {found.counts.size} poses, {float((found.counts > 0).mean()):.1%} of them reached")


def _orientations(count: int, free_axis: str | None, *, down: bool) -> Orientations | int:
    """What was asked for.

    Raises:
        InvalidInputError: a malformed axis.
    """
    from jacokin.reachability import Orientations

    if free_axis is None:
        return Orientations.down() if down else count
    axis = axis_of(free_axis)
    if down:
        return Orientations(Orientations.down().quats_wxyz, "tool down, free about an axis", axes=[axis])
    return Orientations.directions(count, axis, free_roll=True)
