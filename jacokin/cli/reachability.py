"""`jacokin map build`, `show` and `query`: maps of where an arm reaches; `jacokin place`: where to put its base."""

from __future__ import annotations

import contextlib
import importlib.util
import math
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from jacokin import ik, model, reachability
from jacokin.chunks.execution import dask_executor, worker_processes
from jacokin.cli import display, options
from jacokin.cli.command import command, option, switch
from jacokin.cli.display import progress_bar
from jacokin.cli.groups import MapRobotOptions, RobotOptions, ToolOptions, load_scene
from jacokin.cli.options import Vector3, Vector4
from jacokin.cli.process import NOT_SOLVED
from jacokin.errors import InvalidInputError, MissingExtraError, UnknownNameError
from jacokin.files import replacing
from jacokin.model import NAMES

if TYPE_CHECKING:
    import pinocchio as pin

    from jacokin.arrays import Array


MAP = "A map, or the bundled one of a robot."


@click.group()
def map() -> None:  # noqa: A001 - the command's name
    """Maps of where the arm reaches: build, draw and query them."""


@dataclass(frozen=True, slots=True)
class BuildOptions:
    """What a map is built of."""

    folder: Path = option(metavar="FOLDER", text="Where the map is kept; one that is there is completed.")
    spacing: float = option("--spacing", default=0.05, metavar="M", help="Edge of a cell [m].")
    orientations: int = option(
        "--orientations",
        without=("--down",),
        type=click.IntRange(min=1),
        default=200,
        metavar="N",
        help="How many, spread evenly.",
    )
    down: bool = switch("--down", help="The tool pointing vertically down instead.")
    free_axis: list[float] | None = option(
        "--free-axis",
        callback=options.read_axis,
        metavar="AXIS",
        help="Directions of this axis of the tool (x, y, z or X,Y,Z), about which it may turn; "
        "with --down, the tool pointing down, which may turn about it.",
    )
    lower: Vector3 | None = options.lower_corner(help="Lower corner of the box [m].")
    upper: Vector3 | None = options.upper_corner(help="Upper corner of the box [m].")
    scene: Path | None = options.scene()
    collision: str | None = option(
        "--collision",
        metavar="NAME",
        help="Configurations in contact: prefer leaves out those of the arm with itself, as happens if not given; "
        "reject without using symmetry, as with a scene; ignore.",
    )
    shard: str | None = option("--shard", metavar="I/N", help="Build the I-th of N parts only.")
    workers: int = options.workers(without=("--dask",))
    dask: str | None = options.dask()


@command(group=map, no_args_is_help=True)
def build(given: BuildOptions, tool: ToolOptions, source: RobotOptions) -> None:
    """Build a map of where the arm reaches.

    Continues where a build that was killed has stopped. Seven joints and a free axis take some hundred times as long as
    the rest, contact some four times. Exit code: 0, also when parts of other shards are missing.

    Examples:
      jacokin map build out/jaco
      jacokin map build out/jaco --spacing 0.02 --orientations 500 --workers 8
      jacokin map build out/jaco --shard 3/16
      jacokin map build out/level --down --free-axis x --scene table.yaml --workers 2
    """
    arm = source.load()
    grid = (
        reachability.Grid.around(arm, given.spacing)
        if given.lower is None or given.upper is None
        else reachability.Grid(given.lower, given.upper, given.spacing)
    )
    solver = ik.IKSolver(arm, tool.frame, tool=tool.tool, collision=given.collision, scene=load_scene(given.scene))
    is_slow = (  # in Python, where threads wait for each other
        given.collision != "ignore" or given.free_axis is not None or solver.dimension() == 1
    )
    pool: AbstractContextManager[Executor]
    if given.dask is not None:
        pool = dask_executor(given.dask)
    else:
        pool = worker_processes(given.workers) if is_slow and given.workers > 1 else ThreadPoolExecutor(given.workers)
    with progress_bar("positions") as show, pool as executor:
        found = reachability.build(
            solver,
            folder=given.folder,
            grid=grid,
            orientations=_read_orientations(given.orientations, given.free_axis, down=given.down),
            executor=executor,
            shard=given.shard,
            progress=lambda so_far: show(so_far.done, so_far.total),
        )
    if found is None:
        display.say(f"{given.folder}: shard {given.shard} is finished; others are missing")
    else:
        display.say(
            f"{given.folder}: {found.counts.size} poses, {float((found.counts > 0).mean()):.1%} of them reached"
        )


def _read_orientations(count: int, axis: list[float] | None, *, down: bool) -> reachability.Orientations | int:
    """The orientations that the options ask for."""
    if axis is None:
        return reachability.Orientations.down() if down else count
    if down:
        return reachability.Orientations(
            reachability.Orientations.down().quats_wxyz, "tool down, free about an axis", axes=[axis]
        )
    return reachability.Orientations.directions(count, axis, free_roll=True)


@dataclass(frozen=True, slots=True)
class QueryOptions:
    """Where a map is looked up."""

    folder: str = option(metavar="FOLDER|NAME", text=MAP)
    position: Vector3 = option("--position", required=True, metavar="X Y Z", help="A position in the base [m].")
    quat_wxyz: Vector4 | None = option("--quat-wxyz", metavar="W X Y Z", help="An orientation as a quaternion.")
    down: bool = switch("--down", help="An orientation: pointing vertically down.")
    json: bool = options.json()
    scene: Path | None = options.scene()


@command(group=map, no_args_is_help=True)
def query(given: QueryOptions, source: MapRobotOptions) -> None:
    """Say how many orientations are reached at a position, whether a pose is, and which one near it.

    A map of tools that may turn needs the robot, limits and scene that it was built with, where they were your own.

    Examples:
      jacokin map query j2n6s300 --position 0.4 0.2 0.3
      jacokin map query j2n6s300 --position 1.4 0.2 0.3 --down
    """
    reach = load_map(given.folder, source, given.scene)
    dexterity, is_covered = reach.dexterity(given.position), reach.covers(given.position)
    document: dict[str, object] = {"dexterity": dexterity, "covered": is_covered}
    lines = [("orientations reached", f"{dexterity:.1%}" if is_covered else "not known: outside the grid of the map")]
    if given.quat_wxyz is not None or given.down:
        wanted = model.pose(given.position, given.quat_wxyz, down=given.down)
        nearest = reach.nearest_reachable(wanted)
        is_reached, how = _is_reached(reach, wanted)
        document |= {"reached": is_reached, "reached_by": how}
        lines.append(("the pose asked for", f"{'is' if is_reached else 'is not'} reached, by the {how}"))
        quat = model.quat_wxyz(nearest.rotation)
        document |= {"nearest_position": nearest.translation, "nearest_quat_wxyz": quat}
        lines.append(("nearest position x y z [m]", display.numbers(nearest.translation)))
        lines.append(("its quaternion w x y z", display.numbers(quat)))
    if given.json:
        display.print_json(document)
    else:
        display.show_facts(lines)


def _is_reached(reach: reachability.ReachabilityMap, wanted: pin.SE3) -> tuple[bool, str]:
    """Whether a pose is reached, and what says so: the map where it was loaded without its robot or scene."""
    try:
        solver = reach.solver
    except InvalidInputError:
        return bool(reach.reached(wanted.homogeneous[None])[0]), "nearest sample of the map"
    return solver.solve(wanted, closest=False).success, "solver"


@dataclass(frozen=True, slots=True)
class ShowOptions:
    """What is drawn, and where."""

    folder: str = option(metavar="FOLDER|NAME", text=MAP)
    output: Path = option(
        "--output",
        default=Path("map.png"),
        help="A picture (.png, .svg, .pdf), one that turns (.apng, .gif), or an .html page to turn it.",
    )
    scene: Path | None = options.scene()


@command(group=map, no_args_is_help=True)
def show(given: ShowOptions, source: MapRobotOptions) -> None:
    """Draw a map: slices and a view in space, with the arm and obstacles around it.

    Examples:
      jacokin map show j2n6s300
      jacokin map show out/jaco --output out/jaco.html
      jacokin map show out/jaco --output out/jaco.apng
      jacokin map show out/level --scene table.yaml --output out/level.html
    """
    source.keep_apart({"--output": given.output}, {"--scene": given.scene})
    reach = load_map(given.folder, source)
    if reach.recipe["scene"] is not None and given.scene is not None:
        reach = load_map(given.folder, source, given.scene)  # checks that it is the same
    reach.plot(given.output, scene=load_scene(given.scene))
    display.say(f"written to {given.output}")


@dataclass(frozen=True, slots=True)
class PlaceOptions:
    """What is to be reached, and where the base may stand."""

    targets: Path = option("--targets", required=True, metavar="FILE.csv", help="Poses of the tool in the world.")
    folder: str | None = option(
        "--map", metavar="FOLDER|NAME", help="A map, or the bundled one of a robot; of --robot if not given."
    )
    x: tuple[float, float] | None = option("--x", metavar="LOW HIGH", help="From and to where the base may stand [m].")
    y: tuple[float, float] | None = option("--y", metavar="LOW HIGH", help="As --x.")
    height: float | None = option("--height", metavar="Z", help="Height that the base stands at [m]; any if not given.")
    scene: Path | None = option(
        "--scene",
        metavar="FILE.yaml",
        help="Obstacles in the world, .yaml or .json, which neither the arm nor its base may touch.",
    )
    map_scene: Path | None = option(
        "--map-scene", metavar="FILE.yaml", help="The scene that the map was built with; on the base."
    )
    plot: Path | None = option("--plot", help="Draw the best place from above and the side (.png, .svg, .pdf).")
    json: bool = options.json()


@command(no_args_is_help=True)
def place(given: PlaceOptions, source: MapRobotOptions) -> None:
    """Find places for the base of the arm from which it reaches as many targets as possible.

    Targets and obstacles stand in the world. A map that was built with a robot, limits or a scene of your own needs
    the same again. Exit code: 0 if the best place reaches all of them, 1 if not.

    Examples:
      jacokin place --targets examples/targets.csv
      jacokin place --targets examples/targets.csv --scene bench.yaml --x 0 0.4 --y -1 1 --height 0.75 --plot place.png
      jacokin place --targets examples/targets.csv --map out/mine --robot my_arm.urdf --map-scene column.yaml
    """
    source.keep_apart(
        {"--plot": given.plot},
        {"--targets": given.targets, "--scene": given.scene, "--map-scene": given.map_scene},
    )
    from jacokin.reachability.placement import PLACE_ENDINGS, draw_placement

    if given.plot is not None and given.plot.suffix not in PLACE_ENDINGS:
        raise InvalidInputError(f"--plot must end in {' or '.join(PLACE_ENDINGS)}, got {str(given.plot)!r}")
    if given.plot is not None and importlib.util.find_spec("matplotlib") is None:
        raise MissingExtraError("matplotlib", "plot")
    rows_of_file = ik.read_targets(given.targets)
    wanted = rows_of_file.targets
    reach, obstacles = load_map(_map_of(given.folder, source), source, given.map_scene), load_scene(given.scene)
    heights = None if given.height is None else [given.height]
    with contextlib.ExitStack() as stack:
        drawable = None if given.plot is None else stack.enter_context(replacing(given.plot))
        with progress_bar("looking for places"):
            found = reachability.place_base(reach, wanted, scene=obstacles, x=given.x, y=given.y, heights=heights)
        if not found:
            raise InvalidInputError("the base stands inside an obstacle wherever it may stand")
        if drawable is not None:
            draw_placement(drawable, found[0], wanted, reach, obstacles)
    failed = [
        (int(rows_of_file.lines[row]), _why_missed(reach, found[0], row, wanted[row]))
        for row, is_reached in enumerate(found[0].success)
        if not is_reached
    ]
    if given.json:
        places = [
            {
                "position": each.pose.translation,
                "yaw": _yaw(each.pose),
                "reached": each.reached,
                "margin": each.margin,
            }
            for each in found
        ]
        missed = [{"line": line, "why": why} for line, why in failed]
        display.print_json({"targets": len(wanted), "places": places, "missed": missed})
    else:
        rows = [
            (
                *(f"{value:.3f}" for value in (*each.pose.translation, _yaw(each.pose))),
                f"{each.reached} of {len(wanted)}",
                f"{each.margin:.3f}",
            )
            for each in found
        ]
        columns = ("x [m]", "y [m]", "z [m]", "yaw [rad]", "reached", "margin [rad]")
        display.show_table("Places for the base", columns, rows)
        if failed:
            shown = failed[:20]  # targets of which is said why they are missed; --json has them all
            more = f", the first {len(shown)} of {len(failed)}" if len(failed) > len(shown) else ""
            display.show_table(
                f"Not reached from the first place{more}",
                ("line", "why"),
                [(str(line), why) for line, why in shown],
                text=2,
            )
        if given.plot is not None:
            display.say(f"written to {given.plot}")
    if failed:
        raise SystemExit(NOT_SOLVED)


def _map_of(folder: str | None, source: MapRobotOptions) -> str:
    """The map that is given, or else the bundled one of the robot.

    Raises:
        InvalidInputError: there is none.
    """
    robot = model.DEFAULT_ROBOT if source.robot is None else source.robot
    if folder is None and robot not in NAMES:
        raise InvalidInputError(
            f"--map is needed: no map of {robot} comes with the package; `jacokin map build FOLDER --robot ...` "
            "builds one"
        )
    return robot if folder is None else folder


def _why_missed(reach: reachability.ReachabilityMap, place: reachability.BasePlacement, row: int, target: Array) -> str:
    """Why a place does not reach a target."""
    if place.touching[row]:
        return "only in contact with the scene or of the arm with itself"
    return reach.solver.solve(place.pose.inverse().homogeneous @ target, closest=False).status.name


def _yaw(T_world_base: pin.SE3) -> float:
    """The turn of an upright base about the vertical [rad]; 0 where joint 1 turns freely."""
    return math.atan2(T_world_base.rotation[1, 0], T_world_base.rotation[0, 0])


def load_map(
    folder: str, source: MapRobotOptions | None = None, scene: Path | None = None
) -> reachability.ReachabilityMap:
    """A map in a folder, or the bundled one of a robot.

    Args:
        folder: which.
        source: the robot that it was built with, where that is not a bundled one as it is.
        scene: the scene that it was built with.

    Raises:
        UnknownNameError: it is neither.
        InvalidInputError: a folder without a map, a damaged one, or a map of another robot or scene.
    """
    if Path(folder).exists():
        found = reachability.load(folder)
    elif folder in NAMES:
        found = reachability.bundled(folder)
    else:
        raise UnknownNameError("map", folder, [*NAMES, "or the folder of a map"])
    arm = None
    if source is not None and replace(source, package_dirs=()) != MapRobotOptions():
        arm = replace(source, robot=source.robot or found.recipe["robot"]["bundled"]).load()
    obstacles = load_scene(scene)
    if arm is None and obstacles is None:
        return found
    return reachability.load(found.folder, robot=arm, scene=obstacles)
