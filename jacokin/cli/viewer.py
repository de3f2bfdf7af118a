"""`jacokin view`: the arm and every branch in the browser."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from jacokin import viewer
from jacokin.cli import display, options
from jacokin.cli.command import Command, NumberList
from jacokin.cli.reachability import load_map
from jacokin.cli.units import Units, warn_of_degrees

if TYPE_CHECKING:
    import pinocchio as pin
    from numpy.typing import ArrayLike

FULL_TURN = (-math.pi, math.pi)  # [rad]


@click.command(cls=Command)
@click.option(
    "--target",
    cls=NumberList,
    callback=options.read_placement,
    metavar="X Y Z [W X Y Z]",
    help="Where the tool should be at first [m], and its orientation as a quaternion.",
)
@click.option(
    "--port", type=click.IntRange(min=0), default=8080, metavar="N", help="Port to serve at; 0 for any free one."
)
@click.option(
    "--host",
    default="127.0.0.1",
    metavar="ADDRESS",
    help="Address to serve at; any other opens it to other computers, unencrypted.",
)
@click.option("--collision", metavar="NAME", help="Contact: prefer, reject, report or ignore; see `jacokin ik --help`.")
@options.scene
@options.clearance
@click.option(
    "--prefer", default="nearest", metavar="NAME", help="The branch to go to: nearest, margin or manipulability."
)
@click.option("--free-axis", metavar="AXIS", help="The tool may turn about this axis: x, y or z.")
@options.free_range
@click.option(
    "--trajectory",
    type=options.FILE,
    metavar="FILE",
    help="A trajectory to play: .csv, .npz, .json (ROS) or .kinova.csv.",
)
@click.option(
    "--map",
    "reachability",
    metavar="FOLDER|NAME",
    help="A reachability map to show slices of: its folder, or a bundled robot.",
)
@options.velocity_limit
@click.option("--visuals", is_flag=True, help="Draw the visual meshes of the file, not the shapes that collide.")
@options.frame
@options.tool
@options.seed
@options.degrees
@options.robot()
def view(
    target: pin.SE3 | ArrayLike | None,
    port: int,
    host: str,
    collision: str | None,
    scene: Path | None,
    clearance: float,
    prefer: str,
    free_axis: str | None,
    free_range: tuple[float, float] | None,
    trajectory: Path | None,
    reachability: str | None,
    velocity_limit: list[float] | None,
    visuals: bool,
    frame: str | None,
    tool: pin.SE3 | None,
    seed: list[float] | None,
    units: Units,
    source: options.RobotOptions,
) -> None:
    """Show the arm and every branch in the browser, with a gizmo to move the target.

    Prints the address to open, and serves it to this computer only until Ctrl-C; its token keeps other users of the
    computer out. --degrees is for --seed, --free-range and --velocity-limit, within which the arm moves.

    Examples:
      jacokin view
      jacokin view --robot my_arm.urdf --port 0
      jacokin view --target 0.3 -0.2 0.5 --collision report
      jacokin view --target 0.3 -0.2 0.5 0 1 0 0
      jacokin view --target 0.3 -0.2 0.5 0 1 0 0 --free-axis z --tool 0 0 0.05
      jacokin view --scene table.yaml --collision report --trajectory trajectory.csv
    """
    arm = source.load()
    if free_range is not None:
        warn_of_degrees("--free-range", free_range, units)
    limits = units.for_joints(arm).limits("--velocity-limit", velocity_limit, "rad/s")
    speeds: dict[str, Any] = {} if limits is None else {"velocity_limit": limits}
    shown = viewer.serve(
        arm,
        frame=frame,
        tool=tool,
        collision=collision,
        scene=options.load_scene(scene),
        clearance=clearance,
        prefer=prefer,
        free_axis=free_axis,
        free_range=FULL_TURN if free_range is None else units.to_si(free_range),
        visuals=visuals,
        reachability=None if reachability is None else load_map(reachability),
        trajectory=trajectory,
        target=target,
        seed=units.for_joints(arm).seed("--seed", seed),
        host=host,
        port=port,
        **speeds,
    )
    with shown:
        try:
            display.echo(f"{shown.url} shows {arm.label}; Ctrl-C ends it")
            shown.wait()
        except KeyboardInterrupt:
            click.echo("closed", err=True)
