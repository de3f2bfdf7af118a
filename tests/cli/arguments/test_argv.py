"""Negative numbers are values, never options, and words are passed on as they were typed."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from jacokin.cli.command import separated
from tests.cli.run import Run, leave

OPTIONS = {"--seed": 1, "--position": 3, "--frame": 1, "--json": 0}


@pytest.mark.parametrize(
    ("typed", "parsed"),
    [
        (["-1.2", "3"], ["--", "-1.2", "3"]),
        (["--seed", "-1", "2e-3", "--json"], ["--seed", "-1 2e-3", "--json"]),
        (["--seed=-1", "2", "--json"], ["--seed", "-1 2", "--json"]),
        (["--seed", "1 2 3", "4"], ["--seed", "1 2 3", "--", "4"]),
        (["--seed"], ["--seed", ""]),
        (["--seed", "--json"], ["--seed", "", "--json"]),
        (["-h", "--frame", "-x"], ["-h", "--frame", "-x"]),
        (["--frame"], ["--frame"]),
        (["1", "--frame"], ["--frame"]),  # the parser says that the value is missing
        (["--position=1", "-2", "3", "-4"], ["--position", "1", "-2", "3", "--", "-4"]),
        (["--position", "1", "2"], ["--position", "1", "2"]),
        (["--seed", "1", "--position", "-.5", "-inf", "0"], ["--seed", "1", "--position", "-.5", "-inf", "0"]),
        (["--frame", "5", "-", "--", "--json"], ["--frame", "5", "--", "-", "--json"]),
    ],
)
def test_numbers_are_never_taken_for_options(typed: list[str], parsed: list[str]) -> None:
    assert separated(typed, OPTIONS) == parsed


numbers = st.floats().map(repr)
names = st.text(min_size=1).filter(lambda word: not word.startswith("-"))


@given(position=st.tuples(numbers, numbers, numbers), frame=st.text(), q=st.lists(numbers), data=st.data())
def test_words_reach_the_parser_as_typed_in_any_order(
    position: tuple[str, str, str], frame: str, q: list[str], data: st.DataObject
) -> None:
    parts = [["--position", *position], ["--frame", frame], ["--json"], *([word] for word in q)]
    order = data.draw(st.permutations(range(3)))
    at = data.draw(st.lists(st.integers(0, len(q)), min_size=3, max_size=3).map(sorted))
    typed: list[str] = []
    for index in range(len(q) + 1):
        for place, option in zip(at, order, strict=True):
            typed += parts[option] if place == index else []
        typed += parts[3 + index] if index < len(q) else []
    options = [word for option in order for word in parts[option]]
    assert separated(typed, OPTIONS) == options + (["--", *q] if q else [])


@given(seed=st.lists(numbers, min_size=1), joined=st.booleans())
def test_a_seed_is_one_value_with_every_number(seed: list[str], joined: bool) -> None:
    typed = [f"--seed={seed[0]}", *seed[1:]] if joined else ["--seed", *seed]
    assert separated([*typed, "--json"], OPTIONS) == ["--seed", " ".join(seed), "--json"]


@given(words=st.lists(names))
def test_arguments_that_are_no_options_keep_their_order_and_their_characters(words: list[str]) -> None:
    assert separated(words, OPTIONS) == (["--", *words] if words else [])


def test_a_file_whose_name_is_a_number_keeps_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "1").write_text("x,y,z\n0.3,-0.2,0.5\n", encoding="utf-8")
    assert leave("ik", "--targets", "1", "--output", "5") == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["1", "5"]


def test_an_unknown_option_is_named_not_its_value(run: Run) -> None:
    answer = run("fk", "1", "2", "--fraem", "-3")
    assert answer.code == 2
    assert "--fraem" in answer.err
