"""`jacokin view`: the arm and every branch in the browser."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import click

from jacokin.cli.arguments import options
from jacokin.cli.arguments.declared import Option
from jacokin.cli.arguments.options import (
    DEFAULT_ROBOT,
    BaseOption,
    ClearanceOption,
    DegreesOption,
    FrameOption,
    PackageDirOption,
    RobotOption,
    SceneOption,
    SeedOption,
    TipOption,
)
from jacokin.cli.arguments.units import Units, numbers
from jacokin.errors import InvalidInputError

if TYPE_CHECKING:
    import pinocchio as pin
    from numpy.typing import ArrayLike


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
    scene: SceneOption = None,
    clearance: ClearanceOption = None,
    prefer: Annotated[
        str, Option("--prefer", metavar="NAME", help="The branch to go to: nearest, margin or manipulability.")
    ] = "nearest",
    trajectory: Annotated[
        Path | None, Option("--trajectory", metavar="FILE", help="A saved trajectory to play, .csv or .npz.")
    ] = None,
    frame: FrameOption = None,
    seed: SeedOption = None,
    degrees: DegreesOption = False,
    robot: RobotOption = DEFAULT_ROBOT,
    base: BaseOption = None,
    tip: TipOption = None,
    package_dir: PackageDirOption = None,
) -> None:
    """Show the arm and every branch in the browser, with a gizmo to move the target.

    Prints the address to open, and serves it to this computer only until Ctrl-C. --degrees is for --seed.

    Examples:
      jacokin view
      jacokin view --robot my_arm.urdf --port 0
      jacokin view --target 0.3 -0.2 0.5 --collision report
      jacokin view --target 0.3 -0.2 0.5 0 1 0 0
      jacokin view --scene table.yaml --collision report --trajectory trajectory.csv
    """
    from jacokin.viewer import serve

    wanted = _target(target)
    arm = options.load(robot, base, tip, package_dir)
    typed = numbers("--seed", seed)
    start = None if typed is None else Units(degrees).of_joints(arm).read(typed)
    obstacles, kept = options.surroundings(scene, clearance)
    viewer = serve(
        arm,
        frame=frame,
        collision=collision,
        scene=obstacles,
        clearance=kept,
        prefer=prefer,
        trajectory=trajectory,
        target=wanted,
        seed=start,
        host=host,
        port=port,
    )
    with viewer:
        click.echo(f"{viewer.url} shows {arm.name}; Ctrl-C ends it")
        try:
            viewer.wait()
        except KeyboardInterrupt:
            click.echo("closed", err=True)


def _target(text: str | None) -> pin.SE3 | ArrayLike | None:
    """The pose or the position that --target names.

    Raises:
        InvalidInputError: not three or seven numbers, or not a quaternion.
    """
    values = numbers("--target", text)
    if values is None or len(values) == 3:
        return values
    if len(values) != 7:
        raise InvalidInputError(f"--target must be 3 numbers, or 7 with a quaternion, got {len(values)}")
    from jacokin.model.pose_targets import pose

    return pose(values[:3], values[3:])
