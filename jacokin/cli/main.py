"""The command `jacokin`: every subcommand, and the one place where errors become a sentence and an exit code.

Exit codes: 0 solved, 1 not all solved (or a check failed), 2 wrong usage or input. Read this file first.
"""

from __future__ import annotations

import importlib
import inspect
import sys
import traceback
from collections.abc import Mapping, Sequence
from typing import Any

import click

from jacokin import __version__
from jacokin.cli import process
from jacokin.cli.command import Command, Refusal
from jacokin.cli.declared import callback, parameters
from jacokin.cli.display import printable
from jacokin.cli.exit_codes import WRONG_INPUT

HELP = """Kinematics of the Kinova Jaco: poses, Jacobians, and joint angles for a pose within the joint limits.

Lengths are in metres, angles in radians (--degrees for degrees), quaternions in the order w x y z.

Examples:
  jacokin ik --position 0.3 -0.2 0.5 --down        joint angles for a tool pointing down
  jacokin ik --position 0.3 -0.2 0.5 --down --all  every branch
  jacokin fk 4.8 2.92 1.0 4.2 1.45 1.32            pose of the end effector
  jacokin info                                     joints, limits, frames
  jacokin doctor                                   is everything installed?
  jacokin demo                                     206 poses, and a picture

`jacokin COMMAND --help` has examples for each command.
"""

# Name of a command, which is that of its function, and the module it is in: loaded when it is asked for.
COMMANDS = {
    "ik": "jacokin.cli.ik",
    "fk": "jacokin.cli.kinematics",
    "jacobian": "jacokin.cli.kinematics",
    "info": "jacokin.cli.info",
    "track": "jacokin.cli.paths",
    "plan": "jacokin.cli.paths",
    "view": "jacokin.cli.viewer",
    "task": "jacokin.cli.task",
    "place": "jacokin.cli.reachability",
    "crosscheck": "jacokin.cli.crosscheck",
    "demo": "jacokin.cli.demo",
    "doctor": "jacokin.cli.doctor",
    "warmup": "jacokin.cli.doctor",
}
# Commands that have commands of their own, and what they are about.
GROUPS = {
    "map": (
        "Maps of where the arm reaches: build one, draw it, ask it.",
        {
            "build": "jacokin.cli.reachability",
            "show": "jacokin.cli.reachability",
            "query": "jacokin.cli.reachability",
        },
    )
}
NEED_ARGUMENTS = ("build", "show", "query", "place", "ik", "fk", "jacobian", "track", "plan", "task")
SETTINGS = {"help_option_names": ["-h", "--help"]}


class Commands(click.Group):
    """The subcommands, loaded when they are asked for."""

    def __init__(self, name: str, commands: Mapping[str, str], text: str, **settings: Any) -> None:  # Any: click's own
        """Keep names and modules of commands; the settings are those of `click.Group`."""
        super().__init__(name, help=_help(text), no_args_is_help=True, context_settings=SETTINGS, **settings)
        self._modules = commands

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Their names, in the order of the help."""
        names = list(self._modules)
        if self._modules is COMMANDS:
            place = names.index("place")
            names[place:place] = GROUPS
        return names

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
        """One of them."""
        if name in GROUPS and self._modules is COMMANDS:
            text, modules = GROUPS[name]
            return Commands(name, modules, text)
        if name not in self._modules:
            return None
        function = getattr(importlib.import_module(self._modules[name]), name)
        text = inspect.getdoc(function) or ""
        return Command(
            name,
            callback=callback(function),
            params=parameters(function),
            help=_help(text),
            short_help=text.partition("\n")[0],
            no_args_is_help=name in NEED_ARGUMENTS,
            context_settings=SETTINGS,
        )


def _help(text: str) -> str:
    """A help text whose examples are kept line by line, as the mark for click says."""
    return text.replace("\nExamples:\n", "\n\b\nExamples:\n")


def _show_version(context: click.Context, parameter: click.Parameter, wanted: bool) -> None:
    if wanted:
        click.echo(f"jacokin {__version__}")
        context.exit()


VERSION = click.Option(
    ["--version"],
    is_flag=True,
    is_eager=True,
    expose_value=False,
    callback=_show_version,
    help="Show the version and leave.",
)
app = Commands("jacokin", COMMANDS, HELP, params=[VERSION])


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
                app.main(args=sys.argv[1:] if argv is None else list(argv), prog_name="jacokin")
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
            if _from_mujoco(error):
                _refuse(f"MuJoCo does not load ({error}): `jacokin doctor` says what helps")
            _refuse(f"internal error, please report it: {type(error).__name__}: {error}")


def _from_mujoco(error: Exception) -> bool:
    """Whether an error comes from MuJoCo's import, which MUJOCO_GL and half an installation make fail."""
    modules = {str(frame.f_globals.get("__name__")) for frame, _ in traceback.walk_tb(error.__traceback__)}
    return "mujoco" in modules


def _refuse(sentence: str) -> None:
    """Say on stderr, on one line, what is wrong, and leave."""
    click.echo(f"jacokin: {printable(' '.join(sentence.split()))}", err=True)
    raise SystemExit(WRONG_INPUT)
