"""A subcommand: how its arguments are parsed and its errors worded."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping

import click

from jacokin.cli.declared import Positional
from jacokin.cli.exit_codes import INTERRUPTED
from jacokin.errors import JacokinError, UnknownNameError

# Options followed by any number of numbers, such as one for each joint.
NUMBER_LISTS = frozenset({"--seed", "--start", "--velocity-limit", "--acceleration-limit", "--target", "--tool"})

_NUMBER = re.compile(r"[-+]?((\d+\.?\d*|\.\d+)(e[-+]?\d+)?|inf(inity)?|nan)", re.IGNORECASE | re.ASCII)


def separated(words: Iterable[str], values: Mapping[str, int]) -> list[str]:
    """The arguments with options first and everything else after `--`, where nothing is taken for an option.

    Args:
        words: the arguments as typed.
        values: how many values follow each option; the names in NUMBER_LISTS take all numbers that follow, which
            become one value.
    """
    ahead = list(words)
    options: list[str] = []
    others: list[str] = []
    while ahead:
        word = ahead.pop(0)
        if word == "--":
            others += ahead
            break
        name, sign, value = word.partition("=")
        if name in NUMBER_LISTS and name in values:
            options += [name, " ".join(_numbers(ahead, [value] if sign else []))]
        elif name in values and values[name] > 0:
            given = [value] if sign else []
            missing = values[name] - len(given)
            if len(ahead) < missing:
                return [*options, name, *given, *ahead]  # the parser says what is missing
            options += [name, *given, *ahead[:missing]]
            del ahead[:missing]
        elif len(word) > 1 and word.startswith("-") and not _NUMBER.fullmatch(word):
            options.append(word)
        else:
            others.append(word)
    return [*options, "--", *others] if others else options


def _numbers(ahead: list[str], taken: list[str]) -> list[str]:
    """Take the numbers ahead; without any, the next word, such as "1 2 3" in quotes or something to refuse."""
    while ahead and _NUMBER.fullmatch(ahead[0]):
        taken.append(ahead.pop(0))
    if not taken and ahead and not ahead[0].startswith("-"):
        taken.append(ahead.pop(0))
    return taken


# Arguments of the library whose options have other names.
_OTHER_NAMES = {
    "joint_map": "--joint",
    "frame_map": "--frame",
    "waypoints": "--path",
    "q": "ANGLE...",
    "axis": "--free-axis",
    "range": "--free-range",
    "package_dirs": "--package-dir",
}


class Refusal(Exception):  # noqa: N818 - it is not an error of the program
    """The sentence that says what is wrong with the input."""


class Command(click.Command):
    """A command that takes negative numbers, and whose messages name its options."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse the arguments after `separated` has put them in order."""
        values = {
            name: 0 if getattr(parameter, "is_flag", False) else parameter.nargs
            for parameter in self.params
            for name in parameter.opts
            if name.startswith("-")
        }
        return super().parse_args(ctx, separated(args, values))

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the arguments and the options into the help."""
        rows = [(str(each.metavar), each.text) for each in self.params if isinstance(each, Positional)]
        if rows:
            with formatter.section("Arguments"):
                formatter.write_dl(rows)
        super().format_options(ctx, formatter)

    def invoke(self, ctx: click.Context) -> object:
        """Run the command; what it refuses is said with the names of the options.

        Raises:
            Refusal: the input is wrong.
            SystemExit: Ctrl-C.
        """
        try:
            result: object = super().invoke(ctx)
        except JacokinError as error:
            flags = {str(parameter.name): parameter.opts[0] for parameter in self.params if parameter.opts}
            options = {name: flag for name, flag in flags.items() if flag.startswith("-")}
            raise Refusal(with_flags(error, {**options, **_OTHER_NAMES}, ctx.params)) from error
        except KeyboardInterrupt:
            click.echo("jacokin: interrupted", err=True)
            raise SystemExit(INTERRUPTED) from None
        return result


def with_flags(error: JacokinError, flags: Mapping[str, str], values: Mapping[str, object]) -> str:
    """The message of an error with `--tip` instead of `tip=`.

    Args:
        error: what the library raised.
        flags: argument of the library and option of the command.
        values: what was given for each argument.
    """
    text = str(error)
    for name, flag in flags.items():
        text = re.sub(rf"\b{name}=(?=[\w'\"(\[-])", f"{flag} ", text)
        text = re.sub(rf"\b{name}=", flag, text)
        text = re.sub(rf"^{name}(?=[ :\[])", flag, text)
    if isinstance(error, UnknownNameError):
        given = [flag for name, flag in flags.items() if values.get(name) == error.given]
        if len(given) == 1:
            text = f"{given[0]}: {text}"
    return text
