"""The command `jacokin`: every subcommand, and the one place where errors become a sentence and an exit code.

Exit codes: 0 solved, 1 not all solved (or a check failed), 2 wrong usage or input. Read this file first.
"""

from __future__ import annotations

import inspect
import sys
from collections.abc import Callable, Sequence
from typing import Annotated

import typer

from jacokin import __version__
from jacokin.cli import process
from jacokin.cli.command import Command, Refusal
from jacokin.cli.display.tables import printable
from jacokin.cli.doctor.command import doctor
from jacokin.cli.exit_codes import WRONG_INPUT
from jacokin.cli.ik.command import ik
from jacokin.cli.kinematics.fk import fk
from jacokin.cli.kinematics.jacobian import jacobian
from jacokin.cli.robots.crosscheck import crosscheck
from jacokin.cli.robots.info import info
from jacokin.cli.track.command import track
from jacokin.cli.warmup import warmup


def _help(command: Callable[..., None]) -> str:
    """The docstring of a command, its examples kept line by line, as the mark for click says."""
    return inspect.cleandoc(command.__doc__ or "").replace("\nExamples:\n", "\n\b\nExamples:\n")


# Plain help: rich's costs a tenth of a second at every start.
app = typer.Typer(
    name="jacokin",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
for command in (ik, fk, jacobian, info, track, crosscheck, doctor, warmup):
    app.command(cls=Command, help=_help(command), no_args_is_help=command in (ik, fk, jacobian, track))(command)


def _show_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"jacokin {__version__}")
        raise typer.Exit


def jacokin(
    version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version and leave.")
    ] = False,
) -> None:
    """Kinematics of the Kinova Jaco: poses, Jacobians, and joint angles for a pose within the joint limits.

    Lengths are in metres, angles in radians (--degrees for degrees), quaternions in the order w x y z.

    Examples:
      jacokin ik --position 0.3 -0.2 0.5 --down        joint angles for a tool pointing down
      jacokin ik --position 0.3 -0.2 0.5 --down --all  every branch
      jacokin fk 4.8 2.92 1.0 4.2 1.45 1.32            pose of the end effector
      jacokin info                                     joints, limits, frames
      jacokin doctor                                   is everything installed?

    `jacokin COMMAND --help` has examples for each command.
    """


app.callback(help=_help(jacokin))(jacokin)


def main(argv: Sequence[str] | None = None) -> None:
    """Run the command line and leave the process with its exit code.

    Args:
        argv: arguments after the program's name; None for those of the process.

    Raises:
        SystemExit: always; carries the exit code.
    """
    with process.around_command():
        try:
            try:
                app(args=sys.argv[1:] if argv is None else list(argv), prog_name="jacokin")
            finally:
                process.flush()
        except Refusal as refusal:
            _refuse(str(refusal))
        except OSError as error:
            process.drop_output()
            _refuse(f"{error.filename or 'the output'}: {error.strerror}")
        except Exception as error:
            if sys.flags.dev_mode:  # python -X dev -m jacokin ... shows the traceback
                raise
            _refuse(f"internal error, please report it: {type(error).__name__}: {error}")


def _refuse(sentence: str) -> None:
    """Say on stderr, on one line, what is wrong, and leave."""
    typer.echo(f"jacokin: {printable(' '.join(sentence.split()))}", err=True)
    raise SystemExit(WRONG_INPUT)
