"""Options and arguments as the signature of a command declares them: `Annotated[float, Option("--dt", ...)]`.

A parameter whose type is a dataclass stands for the options that the fields of the dataclass declare.
"""

from __future__ import annotations

import inspect
import typing
from collections.abc import Callable
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from types import NoneType
from typing import Any

import click


@dataclass(frozen=True, slots=True)
class Option:
    """An option.

    Attributes:
        flag: how it is typed.
        help: what it means, in a sentence.
        metavar: what stands for its value in the help.
        at_least: the smallest whole number allowed.
    """

    flag: str
    help: str
    metavar: str | None = None
    at_least: int | None = None


@dataclass(frozen=True, slots=True)
class Argument:
    """An argument without a flag.

    Attributes:
        metavar: its name in the help.
        help: what it means, in a sentence.
    """

    metavar: str
    help: str


class Positional(click.Argument):
    """An argument that the help explains; click's own have no text."""

    def __init__(self, name: str, text: str, **attributes: Any) -> None:  # Any: click's own have a dozen types
        """Keep the text; the attributes are those of `click.Argument`."""
        super().__init__([name], **attributes)
        self.text = text


def parameters(command: Callable[..., object]) -> list[click.Parameter]:
    """What click has to know about the parameters of a command."""
    hints = typing.get_type_hints(command, include_extras=True)
    found: list[click.Parameter] = []
    for each in inspect.signature(command).parameters.values():
        hint = hints[each.name]
        found += parameters(hint) if _is_group(hint) else [_parameter(each, hint)]
    return found


def callback(command: Callable[..., None]) -> Callable[..., None]:
    """What click is to call: the command, with the options that belong to dataclasses put into them."""
    groups = {name: hint for name, hint in typing.get_type_hints(command).items() if _is_group(hint)}

    def call(**values: object) -> None:
        made = {
            name: group(**{field.name: values.pop(field.name) for field in fields(group)})
            for name, group in groups.items()
        }
        command(**values, **made)

    return call


def _is_group(hint: object) -> bool:
    return isinstance(hint, type) and is_dataclass(hint)


def _parameter(parameter: inspect.Parameter, hint: object) -> click.Parameter:
    annotated, declared = typing.get_args(hint)
    kind = _without_none(annotated)
    items = typing.get_args(kind)
    # Of a parameter that is required, click must not be told any default, not even None; and click before 8.2 requires
    # an argument whose default is None, unless told otherwise.
    required = parameter.default is inspect.Parameter.empty
    default = {"required": True} if required else {"required": False, "default": parameter.default}
    several = typing.get_origin(kind) is list
    if isinstance(declared, Argument):
        return Positional(
            parameter.name,
            declared.help,
            type=_converter(items[0] if several else kind),
            metavar=f"{declared.metavar}..." if several else declared.metavar,
            nargs=-1 if several else 1,
            **default,
        )
    assert isinstance(declared, Option)
    if kind is bool:
        return click.Option([declared.flag, parameter.name], is_flag=True, help=declared.help, **default)
    return click.Option(
        [declared.flag, parameter.name],
        type=_converter(items[0] if items else kind, declared.at_least),
        nargs=len(items) if items and not several else 1,
        multiple=several,
        metavar=declared.metavar,
        show_default=default.get("default") is not None,
        help=declared.help,
        **default,
    )


def _without_none(kind: object) -> object:
    """`T` of `T | None`."""
    if NoneType not in typing.get_args(kind):
        return kind
    (kind,) = (item for item in typing.get_args(kind) if item is not NoneType)
    return kind


def _converter(kind: object, at_least: int | None = None) -> object:
    """What click converts a word with."""
    if at_least is not None:
        return click.IntRange(min=at_least)
    return click.Path(path_type=Path) if kind is Path else kind
