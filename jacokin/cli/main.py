"""The command `jacokin`: every subcommand, and the one place where errors become a sentence and an exit code.

Exit codes: 0 solved, 1 not all solved (or a check failed), 2 wrong usage or input. Read this file first.
"""

from __future__ import annotations

import importlib
import signal
import sys
import traceback
from collections.abc import Sequence

import click

from jacokin import __version__
from jacokin.cli import process
from jacokin.cli.display import printable
from jacokin.errors import JacokinError

HELP = """Kinematics of the Kinova Jaco: poses, Jacobians, and joint angles for a pose within the joint limits.

Lengths are in metres, angles in radians (--degrees for degrees), quaternions in the order w x y z.

\b
Examples:
  jacokin ik --position 0.3 -0.2 0.5 --down        joint angles for a tool pointing down
  jacokin ik --position 0.3 -0.2 0.5 --down --all  every branch
  jacokin fk 4.8 2.92 1.0 4.2 1.45 1.32            pose of the end effector
  jacokin info                                     joints, limits, frames
  jacokin doctor                                   is everything installed?
  jacokin demo                                     branches, a motion, a picture

`jacokin COMMAND --help` has examples for each command.
"""
# Commands and the modules they are in, by the same name.
COMMANDS = {
    "ik": "ik",
    "fk": "kinematics",
    "jacobian": "kinematics",
    "info": "info",
    "track": "paths",
    "plan": "paths",
    "move": "paths",
    "teleop": "teleop",
    "run": "run",
    "twin": "twin",
    "view": "viewer",
    "task": "task",
    "map": "reachability",
    "place": "reachability",
    "calibrate": "calibrate",
    "crosscheck": "crosscheck",
    "export-c": "export_c",
    "demo": "demo",
    "doctor": "doctor",
    "warmup": "doctor",
}


class Commands(click.Group):
    """The commands, loaded when they are asked for."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Their names, in the order of the help."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
        """One of them."""
        if name not in COMMANDS:
            return None
        command: click.Command = getattr(
            importlib.import_module(f"jacokin.cli.{COMMANDS[name]}"), name.replace("-", "_")
        )
        return command


SETTINGS = {"help_option_names": ["-h", "--help"], "show_default": True}
version = click.version_option(__version__, message="%(prog)s %(version)s", help="Show the version and leave.")
app = version(Commands("jacokin", help=HELP, no_args_is_help=True, context_settings=SETTINGS))


def main(argv: Sequence[str] | None = None) -> None:
    """Run the command line and leave the process with its exit code.

    Args:
        argv: arguments after the program's name; None for those of the process.

    Raises:
        SystemExit: always; carries the exit code.
    """
    with process.around_command():
        stdout, stderr = sys.stdout, sys.stderr
        try:
            try:
                code = app.main(args=argv, prog_name="jacokin", standalone_mode=False)
            except SystemExit:
                if sys.stdout is stdout:
                    raise
                sys.stdout, sys.stderr = stdout, stderr  # click replaces them where who reads its help has left
                process.drop_output()
                code = 0
            finally:
                process.flush()
        except click.ClickException as error:
            error.show()
            code = error.exit_code
        except (click.Abort, KeyboardInterrupt):
            code = _interrupted()
        except JacokinError as error:
            code = _refuse(str(error))
        except OSError as error:
            process.drop_output()
            # Only the present folder, where it was removed, is missing without a name.
            nameless = "the folder that this was started in" if isinstance(error, FileNotFoundError) else "the output"
            code = _refuse(f"{error.filename or nameless}: {error.strerror}")
        except Exception as error:
            if sys.flags.dev_mode:  # python -X dev -m jacokin ... shows the traceback
                raise
            # As compiled modules turn Ctrl-C while they are loaded into an ImportError.
            code = _interrupted() if isinstance(error.__cause__, KeyboardInterrupt) else _refuse(_unexpected(error))
    raise SystemExit(code or 0)


def _interrupted() -> int:
    """Say so on stderr; returns the exit code."""
    click.echo("jacokin: interrupted", err=True)
    return 128 + signal.SIGINT


def _unexpected(error: Exception) -> str:
    """What to say of an error that no command knows."""
    if _is_from_mujoco(error):
        return f"MuJoCo does not load ({error}): `jacokin doctor` says what helps"
    return f"internal error, please report it: {type(error).__name__}: {error}"


def _is_from_mujoco(error: Exception) -> bool:
    """Whether an error comes from MuJoCo's import, which MUJOCO_GL and half an installation make fail."""
    modules = {str(frame.f_globals.get("__name__")) for frame, _ in traceback.walk_tb(error.__traceback__)}
    return "mujoco" in modules


def _refuse(sentence: str) -> int:
    """Say on stderr, on one line, what is wrong; returns the exit code."""
    click.echo(f"jacokin: {printable(' '.join(sentence.split()))}", err=True)
    return process.WRONG_INPUT
