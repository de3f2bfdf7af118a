"""`jacokin map build`: a map in a folder, or the part of it that is missing."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from jacokin.cli.arguments import options
from jacokin.cli.arguments.declared import Argument, Option
from jacokin.cli.arguments.options import (
    DEFAULT_ROBOT,
    BaseOption,
    DaskOption,
    FrameOption,
    PackageDirOption,
    RobotOption,
    TipOption,
    WorkersOption,
)
from jacokin.cli.display import tables
from jacokin.cli.display.progress import progress_bar

Vector3 = tuple[float, float, float]


def build(
    folder: Annotated[Path, Argument(metavar="FOLDER", help="Where the map is kept; one that is there is completed.")],
    spacing: Annotated[float, Option("--spacing", metavar="M", help="Edge of a cell [m].")] = 0.05,
    orientations: Annotated[
        int, Option("--orientations", metavar="N", at_least=1, help="How many, spread evenly.")
    ] = 200,
    down: Annotated[bool, Option("--down", help="The tool pointing vertically down instead.")] = False,
    lower: Annotated[Vector3 | None, Option("--lower", metavar="X Y Z", help="Lower corner of the box [m].")] = None,
    upper: Annotated[Vector3 | None, Option("--upper", metavar="X Y Z", help="Upper corner of the box [m].")] = None,
    shard: Annotated[str | None, Option("--shard", metavar="I/N", help="Build the I-th of N parts only.")] = None,
    workers: WorkersOption = 1,
    dask: DaskOption = None,
    frame: FrameOption = None,
    robot: RobotOption = DEFAULT_ROBOT,
    base: BaseOption = None,
    tip: TipOption = None,
    package_dir: PackageDirOption = None,
) -> None:
    """Build a map of where the arm reaches.

    Continues where a build that was killed has stopped. Exit code: 0, also when parts of other shards are missing.

    Examples:
      jacokin map build out/jaco
      jacokin map build out/jaco --spacing 0.02 --orientations 500 --workers 8
      jacokin map build out/jaco --shard 3/16
    """
    from concurrent.futures import ThreadPoolExecutor
    from contextlib import nullcontext

    from jacokin.chunks.cluster import dask_executor
    from jacokin.errors import InvalidInputError
    from jacokin.ik.batches.progress import Progress
    from jacokin.reachability import Grid, Orientations
    from jacokin.reachability import build as build_map

    if (lower is None) != (upper is None):
        raise InvalidInputError("--lower and --upper go together")
    arm = options.load(robot, base, tip, package_dir)
    grid = Grid.around(arm, spacing) if lower is None or upper is None else Grid(lower, upper, spacing)
    executor = ThreadPoolExecutor(workers) if dask is None else nullcontext(None)
    with progress_bar("positions") as show, executor as threads:

        def advance(so_far: Progress) -> None:
            show(so_far.done, so_far.total)

        with nullcontext(threads) if dask is None else dask_executor(dask) as pool:
            found = build_map(
                arm,
                folder=folder,
                grid=grid,
                orientations=Orientations.down() if down else orientations,
                executor=pool,
                shard=shard,
                progress=advance,
                frame=frame,
            )
    if found is None:
        tables.say(f"{folder}: shard {shard} is finished; others are missing")
    else:
        tables.say(f"{folder}: {found.counts.size} poses, {float((found.counts > 0).mean()):.1%} of them reached")
