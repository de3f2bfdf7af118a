"""Numbers that are not finite: every option of every command refuses them by its name, before anything is done."""

from __future__ import annotations

from collections.abc import Iterator

import click
import pytest

from jacokin.cli.command import NumberList
from jacokin.cli.main import app, main

NUMBERS = click.types.FloatParamType


def count_of(option: click.Parameter) -> int:
    """How many numbers an option takes; 0 for one that takes others."""
    if isinstance(option, NumberList):
        return 3
    if isinstance(option.type, click.Tuple):
        return len(option.type.types) if all(isinstance(each, NUMBERS) for each in option.type.types) else 0
    return int(isinstance(option.type, NUMBERS))


def numeric_options(command: click.Command, words: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], str, int]]:
    """Words of a command, an option of it and how many numbers that takes."""
    if isinstance(command, click.Group):
        for name in command.list_commands(click.Context(command)):
            inner = command.get_command(click.Context(command), name)
            assert inner is not None
            yield from numeric_options(inner, (*words, name))
        return
    for option in command.params:
        if isinstance(option, click.Option) and count_of(option):
            yield words, option.opts[0], count_of(option)


OPTIONS = list(numeric_options(app))


def test_there_are_many() -> None:
    assert len(OPTIONS) > 80
    assert (("ik",), "--rpy", 3) in OPTIONS


@pytest.mark.one_quick
@pytest.mark.parametrize("number", ["inf", "-inf", "nan", "1e400"])
def test_an_option_that_is_not_finite_is_refused_by_name(number: str, capsys: pytest.CaptureFixture[str]) -> None:
    for words, flag, count in OPTIONS:
        command: click.Command = app
        for word in words:
            assert isinstance(command, click.Group)
            command = command.get_command(click.Context(command), word) or command
        given: list[str] = []
        for each in command.params:
            if each.required and each.opts[0] != flag:
                given += [each.opts[0]] if isinstance(each, click.Option) else []
                given += ["1"] * max(count_of(each), 1)
        with pytest.raises(SystemExit) as left:
            main([*words, *given, flag, *[number] * count])
        said = capsys.readouterr().err
        assert left.value.code == 2, (words, flag, said)
        assert "internal error" not in said
        assert flag in said or "finite" in said, (words, flag, said)


def test_a_limit_of_a_joint_may_be_infinite(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as left:
        main(["ik", "--position", "0.3", "0.1", "0.4", "--limit", "joint_2=0,inf"])
    assert left.value.code == 0
    assert "unlimited" in capsys.readouterr().out
