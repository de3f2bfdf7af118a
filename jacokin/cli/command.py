"""A command of click that takes lists of numbers, also negative ones, and names its options in messages."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Container, Iterable, Mapping, Sequence
from dataclasses import Field, field, fields
from inspect import cleandoc
from pathlib import Path
from typing import Any, NamedTuple, get_type_hints

import click
from click.core import ParameterSource

from jacokin.cli.units import Units
from jacokin.errors import InvalidInputError, JacokinError, UnknownNameError

# Names of the library's arguments where those of the parameters differ.
OTHER_NAMES = {
    "axis": "--free-axis",
    "range": "--free-range",
    "degrees": "--degrees",
    "filter": "--filter",
}
ANGLES = "ANGLE...", "--from"  # what gives the joint angles that the library calls q
# In a message about options, and fields of a scene, that are in radians also with --degrees.
ALWAYS_RADIANS = ("--limit", "--finger-angle", "finger_angle")

VECTORS = {"Vector3": 3, "Vector4": 4, "Vector6": 6, "tuple[float, float]": 2}  # kind of a field, and its numbers
MANY = 15  # options of a command whose help has headings

_NUMBER = re.compile(r"[-+]?((\d+\.?\d*|\.\d+)(e[-+]?\d+)?|inf(inity)?|nan)", re.IGNORECASE | re.ASCII)


class File(click.Path):
    """The name of a file or folder."""

    def __init__(self) -> None:
        """Any, whether it is there or not."""
        super().__init__(path_type=Path)

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:  # Any: click's own
        """The path.

        Raises:
            InvalidInputError: "-", which other programs take for standard input or output.
        """
        if str(value) == "-":
            name = param.metavar if isinstance(param, Argument) else param.opts[0] if param else "a file"
            raise InvalidInputError(f"{name} is '-': the standard streams are /dev/stdin and /dev/stdout")
        return super().convert(value, param, ctx)


FILE = File()


class Company(NamedTuple):
    """Options that an option needs one of, and those beside which it has no effect."""

    needs: Sequence[str]
    without: Sequence[str]


class Command(click.Command):
    """A command whose help is its docstring and whose messages name its options.

    Options of the class NumberList take all numbers that follow, and a negative number is never taken for an option.
    """

    def __init__(
        self,
        name: str | None,
        help: str = "",  # noqa: A002 - click's own
        *,
        headings: Mapping[str, str] | None = None,
        company: Mapping[str, Company] | None = None,
        **settings: Any,  # click's own
    ) -> None:
        """Keep the examples of the help line by line, and list the command with its first sentence.

        Args:
            name: of the command.
            help: its docstring.
            headings: name of a parameter, and what it stands under in a long help.
            company: name of a parameter, and the options that it needs, or has no effect beside.
            settings: those of `click.Command`.
        """
        self._headings, self._company = headings or {}, company or {}
        text = cleandoc(help)
        marked = text.replace("\nExamples:\n", "\n\b\nExamples:\n")  # the mark is click's
        super().__init__(name, help=marked, short_help=text.partition("\n")[0], **settings)

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse the arguments after `join_numbers`."""
        lists = {flag for each in self.params if isinstance(each, NumberList) for flag in each.opts}
        takes_numbers = any(isinstance(each, Argument) and each.nargs == -1 for each in self.params)
        return super().parse_args(ctx, join_numbers(args, lists, as_arguments=takes_numbers))

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the arguments and the options into the help."""
        under: dict[str, list[tuple[str, str]]] = {"Arguments": []}
        parameters = self.get_params(ctx)
        is_long = sum(not isinstance(each, Argument) for each in parameters) >= MANY
        for each in parameters:
            if isinstance(each, Argument):
                under["Arguments"].append((str(each.metavar), each.text))
            elif (row := each.get_help_record(ctx)) is not None:
                heading = self._headings.get(str(each.name), "Options") if is_long else "Options"
                under.setdefault(heading, []).append(row)
        for heading, rows in under.items():
            if rows:
                with formatter.section(heading):
                    formatter.write_dl(rows)

    def invoke(self, ctx: click.Context) -> object:
        """Run the command.

        Raises:
            InvalidInputError: says what is wrong, with the names of the options.
        """
        try:
            self._check_company(ctx)
            self._check_finite(ctx)
            result: object = super().invoke(ctx)
        except JacokinError as error:
            arguments = {str(each.metavar) for each in self.params if isinstance(each, Argument)}
            flags = {str(each.name): each.opts[0] for each in self.params if each.opts[0].startswith("-")}
            angles = next((name for name in ANGLES if name in {*flags.values(), *arguments}), "q")
            text = name_flags(error, {**flags, **OTHER_NAMES, "q": angles}, ctx.params)
            # Words of the library for what an option does; where a command has that option, it is named.
            words = {"solve_all": "--all", "a FreeAxis": "--free-axis", "write_urdf": "--urdf", "write_mjcf": "--mjcf"}
            for word, flag in words.items():
                if flag in flags.values():
                    text = text.replace(word, flag)
            units = ctx.params.get("units")
            if isinstance(units, Units) and not any(name in text for name in ALWAYS_RADIANS):
                text = units.in_words(text)
            raise InvalidInputError(text) from error
        return result

    def _check_company(self, ctx: click.Context) -> None:
        """InvalidInputError where an option that is given has no effect, for what else is given or not."""
        names = {str(each.name): each.opts[0] for each in self.params}
        given = {flag for name, flag in names.items() if ctx.get_parameter_source(name) is ParameterSource.COMMANDLINE}
        for name, (needs, without) in self._company.items():
            flag, beside = names[name], [other for other in without if other in given]
            if flag in given and beside:
                raise InvalidInputError(f"{flag} does not go with {beside[0]}")
            if flag in given and needs and given.isdisjoint(needs):
                raise InvalidInputError(f"{flag} goes with {' or '.join(needs)}")

    def _check_finite(self, ctx: click.Context) -> None:
        """InvalidInputError where a number of an option is NaN or infinite; limits of joints may be."""
        for option in (each for each in self.params if isinstance(each, click.Option)):
            value = ctx.params.get(str(option.name))
            numbers = value if isinstance(value, list | tuple) else [value]
            wrong = [number for number in numbers if isinstance(number, float) and not math.isfinite(number)]
            if wrong:
                raise InvalidInputError(f"{option.opts[0]} must be finite, got {wrong[0]}")


class Argument(click.Argument):
    """An argument with a text in the help, as click itself has it since 8.5."""

    def __init__(self, declarations: list[str], text: str = "", **settings: Any) -> None:  # Any: click's own
        """Keep the text; the settings are those of `click.Argument`."""
        super().__init__(declarations, **settings)
        self.text = text


class NumberList(click.Option):
    """An option followed by any number of numbers, such as one for each joint."""

    def __init__(self, declarations: list[str], **settings: Any) -> None:  # Any: click's own
        """Give the command a list of numbers, or what a callback makes of the text."""
        super().__init__(declarations, **{"callback": read_numbers, **settings})


def option(
    *flags: str, needs: Sequence[str] = (), without: Sequence[str] = (), **settings: Any
) -> Any:  # Any: click's own, and a field of any type
    """A field of a class of options: what `click.Option` makes of flags and settings.

    A field without flags is an argument, with the settings of `Argument`. What the type of the field says need not be
    given: a path is a file, a list of float a list of numbers.

    Args:
        flags: of the option.
        needs: options of which one must be given with it.
        without: options beside which it has no effect; with one of them it is refused.
        settings: those of `click.Option`.
    """
    default = settings.get("default", False if settings.get("is_flag") else () if settings.get("multiple") else None)
    return field(default=default, metadata={"flags": flags, "settings": settings, "company": Company(needs, without)})


def switch(name: str, **settings: Any) -> Any:  # Any: as of `option`
    """A field that is True where the option is given."""
    return option(name, is_flag=True, **settings)


def command(
    name: str | None = None, *, group: click.Group | None = None, **settings: Any
) -> Callable[[Callable[..., object]], Command]:  # Any: click's own
    """Make a command of a function whose parameters are classes of options, dataclasses of `option` fields.

    Their docstrings, of one line, are the headings of a long help.

    Args:
        name: of the command; that of the function if not given.
        group: of commands, which it is added to.
        settings: those of `click.Command`.
    """

    def decorate(function: Callable[..., object]) -> Command:
        kinds = {parameter: kind for parameter, kind in get_type_hints(function).items() if parameter != "return"}

        def call(**values: object) -> object:
            return function(
                **{
                    parameter: kind(**{each.name: values[each.name] for each in fields(kind)})
                    for parameter, kind in kinds.items()
                }
            )

        made = Command(
            name or function.__name__,
            function.__doc__ or "",
            headings={each.name: str(kind.__doc__).rstrip(".") for kind in kinds.values() for each in fields(kind)},
            company={each.name: each.metadata["company"] for kind in kinds.values() for each in fields(kind)},
            callback=call,
            params=[_parameter(each) for kind in kinds.values() for each in fields(kind)],
            **settings,
        )
        if group is not None:
            group.add_command(made)
        return made

    return decorate


def of_kind(kind: str, settings: Mapping[str, Any]) -> dict[str, Any]:
    """The settings that follow from the annotation of a field, such as "Path | None"."""
    match kind.removesuffix(" | None"):
        case "float":
            return {"type": float}
        case "Path":
            return {"type": FILE, "metavar": "FILE"}
        case "list[float]" if "callback" not in settings:
            return {"cls": NumberList}
        case vector if count := VECTORS.get(vector):
            return {"type": (float,) * count}
    return {}


def _parameter(each: Field[Any]) -> click.Parameter:
    """The parameter of a field."""
    flags, settings = each.metadata["flags"], dict(each.metadata["settings"])
    settings = {**of_kind(str(each.type), settings), **settings}
    kind = settings.pop("cls", click.Option) if flags else Argument
    parameter: click.Parameter = kind([*flags, each.name], **settings)
    return parameter


def join_numbers(words: Iterable[str], lists: Container[str], *, as_arguments: bool = False) -> list[str]:
    """Prepare arguments for click, which gives an option a fixed number of words and takes -1 for an option.

    Args:
        words: the arguments as typed.
        lists: options that take all numbers that follow, which become one word: `--seed=1 2 3`. Without any, they take
            the next word, such as "1 2 3" in quotes or something to refuse.
        as_arguments: whether other numbers are arguments; a space keeps a negative one from being taken for an option.
    """
    ahead = list(words)
    joined: list[str] = []
    while ahead:
        word = ahead.pop(0)
        name, _, first = word.partition("=")
        if word == "--":
            return [*joined, word, *ahead]
        if name in lists:
            numbers = [first] if first else []
            while ahead and _NUMBER.fullmatch(ahead[0]):
                numbers.append(ahead.pop(0))
            if not numbers and ahead and not ahead[0].startswith("-"):
                numbers.append(ahead.pop(0))
            joined.append(f"{name}={' '.join(numbers)}")
        else:
            is_negative = word.startswith("-") and _NUMBER.fullmatch(word)
            joined.append(f" {word}" if as_arguments and is_negative else word)
    return joined


def read_numbers(context: click.Context, option: click.Parameter, text: str | None) -> list[float] | None:
    """The numbers of an option; None where it is not given."""
    return None if text is None else parse_numbers(option.opts[0], text)


def parse_numbers(flag: str, text: str, count: int | None = None) -> list[float]:
    """The numbers in a text, between spaces or commas.

    Raises:
        InvalidInputError: names the flag: not numbers, or not as many as `count`.
    """
    try:
        values = [float(word) for word in text.replace(",", " ").split()]
    except ValueError:
        raise InvalidInputError(f"{flag} must be numbers, got {text.strip()!r}") from None
    if not values:
        raise InvalidInputError(f"{flag} must be followed by numbers")
    if count is not None and len(values) != count:
        raise InvalidInputError(f"{flag} must be {count} numbers, got {len(values)}")
    return values


def name_flags(error: JacokinError, flags: Mapping[str, str], values: Mapping[str, object]) -> str:
    """The message of an error with `--tip` instead of `tip=`.

    Args:
        error: what the library raised.
        flags: argument of the library and option of the command.
        values: what was given for each argument.
    """
    names = "|".join(map(re.escape, flags))
    text = re.sub(
        rf"^({names})(?=[ :\[])|\b({names})=(?:True\b|([\w'\"(\[-])?)",
        lambda match: flags[match[1] or match[2]] + (f" {match[3]}" if match[3] else ""),
        str(error),
    )
    if isinstance(error, UnknownNameError):
        given = [flag for name, flag in flags.items() if _is_or_has(values.get(name), error.given)]
        if len(given) == 1:
            text = f"{given[0]}: {text}"
    return text


def _is_or_has(value: object, name: object) -> bool:
    """Whether a value is this name, or has it as a key or an item."""
    return value == name or (isinstance(value, Mapping | list | tuple) and name in value)
