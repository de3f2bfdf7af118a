"""`jacokin export-c`: a robot for the C library, with its header and the library itself."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import click

from jacokin import ik
from jacokin.cli import display
from jacokin.cli.command import command, option, switch
from jacokin.cli.groups import NamedRobotOptions, ToolOptions
from jacokin.errors import InvalidInputError


@dataclass(frozen=True, slots=True)
class ExportOptions(NamedRobotOptions):
    """What is written, for which robot and machine."""

    output: Path | None = option(
        "--output", without=("--cflags",), metavar="DIR", help="Folder for all files; made where it is not there."
    )
    target: str | None = option(
        "--target",
        without=("--cflags",),
        type=click.Choice(["linux-aarch64", "macos", "windows", "wasm"]),
        help="Another machine; from a clone.",
    )
    cflags: bool = switch("--cflags", help="Print what a compiler is told to use the installed library, and leave.")


@command("export-c")
def export_c(given: ExportOptions, tool: ToolOptions) -> None:
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

    if given.cflags:
        display.echo(compiler_flags())
        return
    if given.output is None:
        raise InvalidInputError("--output must be given: the folder to write to")
    arm = given.load()
    file = ik.export_c(ik.IKSolver(arm, tool.frame, tool=tool.tool), given.output, target=given.target)
    display.say(f"{arm.label}: {file}, with include and lib beside it")
