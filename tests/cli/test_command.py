"""Negative numbers are values, never options; messages name the options as they are typed."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import click
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from jacokin.cli.command import (
    MANY,
    OTHER_NAMES,
    Argument,
    Command,
    NumberList,
    command,
    join_numbers,
    name_flags,
    option,
)
from jacokin.errors import InvalidInputError, UnknownNameError
from tests.cli.run import Run

LISTS = {"--seed"}

numbers = st.floats().map(repr)
words = st.text(min_size=1).filter(lambda word: not word.startswith("-"))

FROM = ("twin", "--ros", "1", "--from", *"000000")  # outside the limits


@pytest.mark.parametrize(
    ("typed", "parsed"),
    [
        (["-1.2", "3"], [" -1.2", "3"]),
        (["--seed", "-1", "2e-3", "--json"], ["--seed=-1 2e-3", "--json"]),
        (["--seed=-1", "2", "--json"], ["--seed=-1 2", "--json"]),
        (["--seed", "1 2 3", "4"], ["--seed=1 2 3", "4"]),
        (["--seed"], ["--seed="]),
        (["--seed", "--json"], ["--seed=", "--json"]),
        (["-h", "--frame", "-x"], ["-h", "--frame", "-x"]),
        (["--seed", "1", "--position", "-.5", "-inf", "0"], ["--seed=1", "--position", " -.5", " -inf", "0"]),
        (["-", "--", "--json", "-5"], ["-", "--", "--json", "-5"]),
    ],
)
def test_lists_of_numbers_become_one_word(typed: list[str], parsed: list[str]) -> None:
    assert join_numbers(typed, LISTS, as_arguments=True) == parsed
    assert join_numbers(typed, LISTS) == [word if word.startswith("--seed=") else word.strip() for word in parsed]


@pytest.mark.slow
@given(position=st.tuples(numbers, numbers, numbers), frame=words, q=st.lists(numbers, min_size=1), data=st.data())
@settings(max_examples=50, deadline=None)
def test_words_are_parsed_as_typed_in_any_order(
    position: tuple[str, str, str], frame: str, q: list[str], data: st.DataObject
) -> None:
    """Options between the arguments, and negative numbers everywhere."""
    parts = [["--position", *position], ["--frame", frame], ["--json"], *([word] for word in q)]
    order = data.draw(st.permutations(range(3)))
    at = data.draw(st.lists(st.integers(0, len(q)), min_size=3, max_size=3).map(sorted))
    typed: list[str] = []
    for index in range(len(q) + 1):
        for place, which in zip(at, order, strict=True):
            typed += parts[which] if place == index else []
        typed += parts[3 + index] if index < len(q) else []
    options = [
        click.Option(["--position"], type=(float, float, float)),
        click.Option(["--frame"]),
        click.Option(["--json"], is_flag=True),
    ]
    made = Command("fk", params=[*options, Argument(["q"], nargs=-1, type=float)])
    found = made.make_context("fk", typed).params
    assert [*map(repr, found["position"])] == [*position]
    assert [*map(repr, found["q"])] == q
    assert (found["frame"], found["json"]) == (frame, True)


@pytest.mark.slow
@given(seed=st.lists(numbers, min_size=1), joined=st.booleans())
@settings(max_examples=50, deadline=None)
def test_a_seed_is_one_value_with_every_number(seed: list[str], joined: bool) -> None:
    typed = [f"--seed={seed[0]}", *seed[1:]] if joined else ["--seed", *seed]
    made = Command("ik", params=[NumberList(["--seed"]), click.Option(["--json"], is_flag=True)])
    found = made.make_context("ik", [*typed, "--json"]).params
    assert [*map(repr, found["seed"])] == seed
    assert found["json"]


@given(typed=st.lists(words))
@settings(max_examples=50, deadline=None)
def test_other_words_keep_their_order_and_their_characters(typed: list[str]) -> None:
    assert join_numbers(typed, LISTS) == typed


@pytest.mark.parametrize(
    ("message", "said"),
    [
        ("tip='x' is not a frame", "--tip 'x' is not a frame"),
        ("give base= or tip=, not both", "give --base or --tip, not both"),
        ("package_dirs=[...] or ROS_PACKAGE_PATH", "--package-dir [...] or ROS_PACKAGE_PATH"),
        ("filter must be a finite number", "--filter must be a finite number"),
        ("range must be (least, largest)", "--free-range must be (least, largest)"),
        ("the axis of tip is not base", "the axis of tip is not base"),
    ],
)
def test_messages_name_the_options(message: str, said: str) -> None:
    flags = {"tip": "--tip", "base": "--base", "package_dirs": "--package-dir", **OTHER_NAMES}
    assert name_flags(InvalidInputError(message), flags, {}) == said


def test_an_unknown_name_is_told_with_the_option_that_gave_it() -> None:
    flags = {"tip": "--tip", "base": "--base"}
    error = UnknownNameError("frame", "nowhere", ["somewhere"])
    assert name_flags(error, flags, {"tip": "nowhere"}).startswith("--tip: unknown frame 'nowhere'")
    assert name_flags(error, flags, {"tip": "nowhere", "base": "nowhere"}).startswith("unknown frame 'nowhere'")


def test_a_file_whose_name_is_a_number_keeps_it(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "1").write_text("x,y,z\n0.3,-0.2,0.5\n", encoding="utf-8")
    run("ik", "--targets", "1", "--output", "5.csv")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["1", "5.csv"]


@pytest.mark.parametrize(("words", "flag"), [(("fk", *"12345", "1e400"), "ANGLE..."), (FROM, "--from")])
def test_joint_angles_are_called_as_the_command_calls_them(run: Run, words: tuple[str, ...], flag: str) -> None:
    assert run(*words, code=2).err.splitlines()[-1].startswith(f"jacokin: {flag} ")


def test_an_unknown_option_is_named_not_its_value(run: Run) -> None:
    assert "--fraem" in run("fk", "1", "2", "--fraem", "-3", code=2).err


@dataclass(frozen=True)
class Where:
    """Where it is."""

    q: tuple[float, ...] = option(nargs=-1, type=float, text="Joint angles.")
    frame: str | None = option("--frame", default="hand", help="Of the arm.")


@dataclass(frozen=True)
class How:
    """How it is said."""

    aloud: bool = option("--loud", is_flag=True)
    words: tuple[str, ...] = option("--word", multiple=True)


def test_a_command_takes_its_options_as_the_classes_that_declare_them() -> None:
    taken: list[tuple[Where, How]] = []

    @command("say")
    def speak(where: Where, how: How) -> None:
        """Say where something is."""
        taken.append((where, how))

    speak.main(["-1", "2.5", "--loud", "--word", "a", "--word", "b"], standalone_mode=False)
    speak.main([], standalone_mode=False)
    assert taken == [(Where((-1.0, 2.5), "hand"), How(aloud=True, words=("a", "b"))), (Where((), "hand"), How())]
    assert (speak.name, speak.get_short_help_str()) == ("say", "Say where something is.")


def test_help_has_an_argument_once_and_headings_only_where_options_are_many() -> None:
    few = [click.Option(["--loud"], help="How.")]
    many = [click.Option([f"--loud-{k}"], help="How.") for k in range(MANY)]
    for options in (few, many):
        made = Command(
            "say", params=[*options, Argument(["words"], "What.", metavar="WORDS")], headings={"loud_0": "How"}
        )
        said = made.get_help(click.Context(made))
        assert said.count("WORDS") == 2  # in the usage and among the arguments
        assert said.index("Arguments:") < said.index("--loud")
        assert ("\nHow:\n" in said) is (options is many)
