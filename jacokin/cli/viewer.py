"""`jacokin view`: the arm and every branch in the browser."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import click

from jacokin import logs, viewer
from jacokin.cli import display, options
from jacokin.cli.command import NumberList, command, option, switch
from jacokin.cli.groups import RobotOptions, SceneOptions, ToolOptions
from jacokin.cli.reachability import load_map
from jacokin.cli.units import Units, warn_of_degrees

if TYPE_CHECKING:
    import pinocchio as pin
    from numpy.typing import ArrayLike

    from jacokin.model import Robot


@dataclass(frozen=True, slots=True)
class PlayedLogOptions:
    """A recording to play."""

    log: Path | None = option(
        "--log",
        help="A recording of ROS to play: .bag, .mcap or .db3; what was commanded is drawn beside what was measured.",
    )
    joints_topic: str | None = options.joints_topic(needs=("--log",))
    commanded_topic: str | None = option(
        "--commanded-topic",
        needs=("--log",),
        metavar="NAME",
        help="Of a log: what was commanded; the usual names are found.",
    )
    joint_prefix: str | None = options.joint_prefix(needs=("--log",))

    def load(self, arm: Robot) -> logs.Recording | None:
        """What there is to play of a log; None without one.

        Raises:
            InvalidInputError: as `Log.recording`.
        """
        if self.log is None:
            return None
        log = logs.Log(self.log, arm, prefix=self.joint_prefix)
        return log.recording(joints=self.joints_topic, commanded=self.commanded_topic)


@dataclass(frozen=True, slots=True)
class ViewOptions:
    """The page, and what it shows."""

    target: pin.SE3 | ArrayLike | None = option(
        "--target",
        cls=NumberList,
        callback=options.read_placement,
        metavar="X Y Z [W X Y Z]",
        help="Where the tool should be at first [m], and its orientation as a quaternion.",
    )
    port: int = options.port()
    host: str = option(
        "--host",
        default="127.0.0.1",
        metavar="ADDRESS",
        help="Address to serve at; any other opens it to other computers, unencrypted.",
    )
    collision: str | None = option(
        "--collision", metavar="NAME", help="Contact: prefer, reject, report or ignore; see `jacokin ik --help`."
    )
    prefer: str = option(
        "--prefer", default="nearest", metavar="NAME", help="The branch to go to: nearest, margin or manipulability."
    )
    free_axis: str | None = option("--free-axis", metavar="AXIS", help="The tool may turn about this axis: x, y or z.")
    free_range: tuple[float, float] | None = options.free_range(needs=("--free-axis",))
    trajectory: Path | None = option(
        "--trajectory", without=("--log",), help="A trajectory to play: .csv, .npz, .json (ROS) or .kinova.csv."
    )
    reachability: str | None = option(
        "--map", metavar="FOLDER|NAME", help="A reachability map to show slices of: its folder, or a bundled robot."
    )
    velocity_limit: list[float] | None = options.velocity_limit()
    visuals: bool = switch("--visuals", help="Draw the visual meshes of the file, not the shapes that collide.")
    seed: list[float] | None = options.seed()
    units: Units = options.degrees()


@command()
def view(
    given: ViewOptions, recorded: PlayedLogOptions, around: SceneOptions, tool: ToolOptions, source: RobotOptions
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
    from jacokin.viewer.inspector import FULL_TURN

    arm = source.load()
    recording = recorded.load(arm)
    if given.free_range is not None:
        warn_of_degrees("--free-range", given.free_range, given.units)
    joints = given.units.for_joints(arm)
    shown = viewer.serve(
        arm,
        viewer.ViewerOptions(
            frame=tool.frame,
            tool=tool.tool,
            collision=given.collision,
            clearance=around.clearance,
            prefer=given.prefer,
            free_axis=given.free_axis,
            free_range=FULL_TURN if given.free_range is None else given.units.to_si(given.free_range),
            visuals=given.visuals,
            velocity_limit=joints.limits("--velocity-limit", given.velocity_limit, "rad/s"),
            host=given.host,
        ),
        scene=around.load(),
        reachability=None if given.reachability is None else load_map(given.reachability),
        trajectory=given.trajectory if recording is None else recording,
        target=given.target,
        seed=joints.seed("--seed", given.seed),
        port=given.port,
    )
    with shown:
        try:
            display.echo(f"{shown.url} shows {arm.label}; Ctrl-C ends it")
            shown.wait()
        except KeyboardInterrupt:
            click.echo("closed", err=True)
