"""`jacokin export-c`: a robot for the C library, with its header and the library itself."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from jacokin import ik, model
from jacokin.cli import display, options
from jacokin.cli.command import Argument, Command
from jacokin.cli.options import RobotOptions
from jacokin.errors import InvalidInputError

if TYPE_CHECKING:
    import pinocchio as pin


@click.command("export-c", cls=Command)
@click.argument("robot", cls=Argument, default=model.DEFAULT_ROBOT, metavar="[NAME|FILE]", text=options.NAME_OR_FILE)
@click.option("--output", type=options.FILE, metavar="DIR", help="Folder for all files; made where it is not there.")
@options.frame
@options.tool
@options.limit
@options.base
@options.tip
@options.package_dir
@options.calibration
@click.option(
    "--target", type=click.Choice(["linux-aarch64", "macos", "windows", "wasm"]), help="Another machine; from a clone."
)
@click.option("--cflags", is_flag=True, help="Print what a compiler is told to use the installed library, and leave.")
def export_c(
    robot: str,
    output: Path | None,
    frame: str | None,
    tool: pin.SE3 | None,
    limits: dict[str, tuple[float, float]] | None,
    base: str | None,
    tip: str | None,
    package_dirs: Sequence[Path],
    calibration: Path | None,
    target: str | None,
    cflags: bool,
) -> None:
    """Write what a C, C++ or Rust program needs to solve for a robot.

    DIR gets the robot's numbers as NAME.jacokin, the headers in include, the library in lib, and a CMake package. With
    --target the library is one for another machine, which a clone of the repository compiles.

    Examples:
      jacokin export-c j2n6s300 --output arm
      jacokin export-c j2s7s300 --tool 0 0 0.1 --limit joint_2=1,5 --output arm
      jacokin export-c gen3 --target windows --output arm
      cc program.c $(jacokin export-c --cflags)
    """
    from jacokin.ik.c_library import compiler_flags

    if cflags:
        display.echo(compiler_flags())
        return
    if output is None:
        raise InvalidInputError("--output must be given: the folder to write to")
    arm = RobotOptions(robot, base, tip, package_dirs, limits, calibration=calibration).load()
    file = ik.export_c(ik.IKSolver(arm, frame, tool=tool), output, target=target)
    display.say(f"{arm.label}: {file}, with include and lib beside it")
