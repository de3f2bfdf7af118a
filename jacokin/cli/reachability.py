"""`jacokin map build`: a map in a folder, or the part of it that is missing."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from jacokin.cli import display, options
from jacokin.cli.declared import Argument, Option
from jacokin.cli.display import progress_bar
from jacokin.cli.exit_codes import NOT_SOLVED
from jacokin.cli.options import axis_of
from jacokin.errors import UnknownNameError
from jacokin.model.descriptions.bundled import NAMES

if TYPE_CHECKING:
    import pinocchio as pin

    from jacokin.reachability import Orientations
    from jacokin.reachability.map import ReachabilityMap

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

    from jacokin.chunks.execution import Progress, dask_executor, worker_processes
    from jacokin.errors import InvalidInputError
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
        display.say(f"{folder}: shard {shard} is finished; others are missing")
    else:
        display.say(f"{folder}: {found.counts.size} poses, {float((found.counts > 0).mean()):.1%} of them reached")


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


def load_map(folder: str) -> ReachabilityMap:
    """A map in a folder, or the bundled one of a robot.

    Raises:
        UnknownNameError: it is neither.
        InvalidInputError: a folder without a map, or with a damaged one.
    """
    from jacokin import reachability

    if Path(folder).exists():
        return reachability.load(folder)
    if folder in NAMES:
        return reachability.bundled(folder)
    raise UnknownNameError("map", folder, [*NAMES, "or the folder of a map"])


@dataclass(frozen=True, slots=True)
class MapOptions:
    """What a map was built with, where that is not a bundled robot as it is, without a scene."""

    scene: options.SceneOption = None
    robot: Annotated[
        str | None,
        Option("--robot", metavar="NAME|FILE", help="The robot of the map, where it is not a bundled one as it is."),
    ] = None
    base: options.BaseOption = None
    tip: options.TipOption = None
    package_dir: options.PackageDirOption = None
    limit: options.LimitOption = None
    finger_angle: options.FingerAngleOption = None

    def load(self, folder: str) -> ReachabilityMap:
        """A map in a folder, or the bundled one of a robot, with its robot and scene.

        Raises:
            UnknownNameError: it is neither.
            InvalidInputError: a folder without a map, a damaged one, or a map of another robot or scene.
        """
        from jacokin import reachability

        found = load_map(folder)
        around, _ = options.surroundings(self.scene, None)
        arm = None
        if self.robot is not None or self.limit or self.finger_angle is not None:
            name = self.robot or found.recipe["robot"]["bundled"] or options.DEFAULT_ROBOT
            arm = options.load(
                name, self.base, self.tip, self.package_dir, limits=self.limit, finger_angle=self.finger_angle
            )
        if arm is None and around is None:
            return found
        return reachability.load(found.folder, robot=arm, scene=around)


Vector4 = tuple[float, float, float, float]


def query(
    folder: Annotated[str, Argument(metavar="FOLDER|NAME", help="A map, or the bundled one of a robot.")],
    position: Annotated[Vector3, Option("--position", metavar="X Y Z", help="A position in the base [m].")],
    quat_wxyz: Annotated[
        Vector4 | None, Option("--quat-wxyz", metavar="W X Y Z", help="An orientation as a quaternion.")
    ] = None,
    down: Annotated[bool, Option("--down", help="An orientation: pointing vertically down.")] = False,
    json: options.JsonOption = False,
    *,
    built: MapOptions,
) -> None:
    """Say how many orientations are reached at a position, and which pose near a given one is.

    A map of tools that may turn needs the robot, limits and scene that it was built with, where they were your own.

    Examples:
      jacokin map query j2n6s300 --position 0.4 0.2 0.3
      jacokin map query j2n6s300 --position 1.4 0.2 0.3 --down
    """
    from jacokin.model import poses
    from jacokin.model.poses import pose

    reach = built.load(folder)
    dexterity = reach.dexterity(position)
    document: dict[str, object] = {"dexterity": dexterity}
    lines = [("orientations reached", f"{dexterity:.1%}")]
    if quat_wxyz is not None or down:
        nearest = reach.nearest_reachable(pose(position, quat_wxyz, down=down))
        quat = poses.quat_wxyz(nearest.rotation)
        document |= {"nearest_position": nearest.translation, "nearest_quat_wxyz": quat}
        lines.append(("nearest position x y z [m]", display.numbers(nearest.translation)))
        lines.append(("its quaternion w x y z", display.numbers(quat)))
    if json:
        display.print_json(document)
    else:
        display.say(display.facts(lines))


def show(
    folder: Annotated[str, Argument(metavar="FOLDER|NAME", help="A map, or the bundled one of a robot.")],
    output: Annotated[
        Path,
        Option(
            "--output",
            metavar="FILE",
            help="A picture (.png, .svg, .pdf), one that turns (.apng, .gif), or an .html page to turn it.",
        ),
    ] = Path("map.png"),
) -> None:
    """Draw a map: slices and a view in space.

    Examples:
      jacokin map show j2n6s300
      jacokin map show out/jaco --output out/jaco.html
      jacokin map show out/jaco --output out/jaco.apng
    """
    load_map(folder).plot(output)
    display.say(f"written to {output}")


def place(
    targets: Annotated[Path, Option("--targets", metavar="FILE.csv", help="Poses of the tool in the world.")],
    folder: Annotated[
        str, Option("--map", metavar="FOLDER|NAME", help="A map, or the bundled one of a robot.")
    ] = options.DEFAULT_ROBOT,
    height: Annotated[
        float | None, Option("--height", metavar="Z", help="Height that the base stands at [m]; any if not given.")
    ] = None,
    json: options.JsonOption = False,
    *,
    built: MapOptions,
) -> None:
    """Find places for the base of the arm from which it reaches as many targets as possible.

    A map that was built with a scene, a robot or limits of your own needs the same again.
    Exit code: 0 if the best place reaches all of them, 1 if not.

    Examples:
      jacokin place --targets examples/targets.csv
      jacokin place --targets examples/targets.csv --map out/jaco --height 0.75
      jacokin place --targets examples/targets.csv --map out/mine --robot my_arm.urdf --scene table.yaml
    """
    from jacokin.ik.files.csv_files import read_targets
    from jacokin.reachability import place_base

    wanted = read_targets(targets).targets
    found = place_base(built.load(folder), wanted, heights=None if height is None else [height])
    if json:
        places = [
            {
                "position": each.pose.translation,
                "yaw": _yaw(each.pose),
                "reached": each.reached,
                "margin": each.margin,
            }
            for each in found
        ]
        display.print_json({"targets": len(wanted), "places": places})
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
        display.say(display.table("Places for the base", columns, rows))
    if not found or found[0].reached < len(wanted):
        raise SystemExit(NOT_SOLVED)


def _yaw(T_world_base: pin.SE3) -> float:
    """The turn of an upright base about the vertical [rad]; 0 where joint 1 turns freely."""
    return math.atan2(T_world_base.rotation[1, 0], T_world_base.rotation[0, 0])
