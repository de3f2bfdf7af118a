"""`jacokin view`: the arm and every branch in the browser."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from jacokin import logs, viewer
from jacokin.cli import display, options
from jacokin.cli.command import Command, NumberList
from jacokin.cli.reachability import load_map
from jacokin.cli.units import Units, warn_of_degrees
from jacokin.errors import InvalidInputError

if TYPE_CHECKING:
    import pinocchio as pin
    from numpy.typing import ArrayLike

    from jacokin.model import Robot

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
    "--log",
    type=options.FILE,
    metavar="FILE",
    help="A recording of ROS to play: .bag, .mcap or .db3; what was commanded is drawn beside what was measured.",
)
@options.joints_topic
@click.option("--commanded-topic", metavar="NAME", help="Of a log: what was commanded; the usual names are found.")
@options.joint_prefix
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
    log: Path | None,
    joints_topic: str | None,
    commanded_topic: str | None,
    joint_prefix: str | None,
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
      jacokin view --log run.mcap --commanded-topic /arm_controller/controller_state
    """
    arm = source.load()
    recording = _recording(arm, log, joints_topic, commanded_topic, joint_prefix)
    if recording is not None and trajectory is not None:
        raise InvalidInputError("--log and --trajectory exclude each other")
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
        trajectory=trajectory if recording is None else recording,
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


def _recording(
    arm: Robot, log: Path | None, joints: str | None, commanded: str | None, prefix: str | None
) -> logs.Recording | None:
    """What there is to play of a log; None without one.

    Raises:
        InvalidInputError: its options without a log, or as `Log.recording`.
    """
    if log is None:
        if joints or commanded or prefix:
            raise InvalidInputError("--joints-topic, --commanded-topic and --joint-prefix are for --log")
        return None
    return logs.Log(log, arm, prefix=prefix).recording(joints=joints, commanded=commanded)
