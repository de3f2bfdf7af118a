"""`jacokin view`: the arm and every branch in the browser."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import click

from jacokin.cli import options
from jacokin.cli.declared import Option
from jacokin.cli.units import Units, numbers

FULL_TURN = (-math.pi, math.pi)  # [rad]


def view(
    target: Annotated[
        str | None,
        Option(
            "--target",
            metavar="X Y Z [W X Y Z]",
            help="Where the tool should be at first [m], and its orientation as a quaternion.",
        ),
    ] = None,
    port: Annotated[
        int, Option("--port", metavar="N", at_least=0, help="Port to serve at; 0 for any free one.")
    ] = 8080,
    host: Annotated[
        str, Option("--host", metavar="ADDRESS", help="Address to serve at; any other opens it to other computers.")
    ] = "127.0.0.1",
    collision: Annotated[
        str, Option("--collision", metavar="NAME", help="Self-contact: ignore, report or reject.")
    ] = "ignore",
    scene: options.SceneOption = None,
    clearance: options.ClearanceOption = None,
    prefer: Annotated[
        str, Option("--prefer", metavar="NAME", help="The branch to go to: nearest, margin or manipulability.")
    ] = "nearest",
    free_axis: Annotated[
        str | None, Option("--free-axis", metavar="AXIS", help="The tool may turn about this axis: x, y or z.")
    ] = None,
    free_range: options.FreeRangeOption = None,
    trajectory: Annotated[
        Path | None,
        Option("--trajectory", metavar="FILE", help="A trajectory to play: .csv, .npz, .json (ROS) or .kinova.csv."),
    ] = None,
    reachability: Annotated[
        str | None,
        Option(
            "--map", metavar="FOLDER|NAME", help="A reachability map to show slices of: its folder, or a bundled robot."
        ),
    ] = None,
    visuals: Annotated[
        bool, Option("--visuals", help="Draw the visual meshes of the file, not the shapes that collide.")
    ] = False,
    frame: options.FrameOption = None,
    tool: options.ToolOption = None,
    seed: options.SeedOption = None,
    degrees: options.DegreesOption = False,
    *,
    source: options.RobotOptions,
) -> None:
    """Show the arm and every branch in the browser, with a gizmo to move the target.

    Prints the address to open, and serves it to this computer only until Ctrl-C. --degrees is for --seed and
    --free-range.

    Examples:
      jacokin view
      jacokin view --robot my_arm.urdf --port 0
      jacokin view --target 0.3 -0.2 0.5 --collision report
      jacokin view --target 0.3 -0.2 0.5 0 1 0 0
      jacokin view --target 0.3 -0.2 0.5 0 1 0 0 --free-axis z --tool 0 0 0.05
      jacokin view --scene table.yaml --collision report --trajectory trajectory.csv
    """
    from jacokin.cli.reachability import load_map as load_map
    from jacokin.viewer import serve

    wanted = options.placement("--target", target)
    arm = source.load()
    typed = numbers("--seed", seed)
    start = None if typed is None else Units(degrees).of_joints(arm).read(typed)
    obstacles, kept = options.surroundings(scene, clearance)
    chosen_map = None if reachability is None else load_map(reachability)
    viewer = serve(
        arm,
        frame=frame,
        tool=options.tool_pose(tool),
        collision=collision,
        scene=obstacles,
        clearance=kept,
        prefer=prefer,
        free_axis=free_axis,
        free_range=FULL_TURN if free_range is None else Units(degrees).read(free_range),
        visuals=visuals,
        reachability=chosen_map,
        trajectory=trajectory,
        target=wanted,
        seed=start,
        host=host,
        port=port,
    )
    with viewer:
        try:
            click.echo(f"{viewer.url} shows {arm.name}; Ctrl-C ends it")
            viewer.wait()
        except KeyboardInterrupt:
            click.echo("closed", err=True)
