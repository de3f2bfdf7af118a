from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from jacokin.errors import InvalidInputError, UnknownNameError, shown
from jacokin.model import checks

NO_NUMBERS = [
    True,
    np.True_,
    "1",
    b"1",
    None,
    1j,
    np.complex128(1),
    np.datetime64("2020-01-01"),
    np.timedelta64(1, "s"),
    np.ma.masked,
    10**400,
    10**5000,
    [1.0],
    np.array([1.0, 2.0]),
    np.nan,
    np.inf,
    -np.inf,
    np.float16(np.inf),
]


class Unprintable:
    def __repr__(self) -> str:
        raise RuntimeError("no repr")


@pytest.mark.parametrize("check", [checks.number, checks.positive, checks.non_negative])
@pytest.mark.parametrize("value", [*NO_NUMBERS, Unprintable()], ids=lambda value: type(value).__name__)
def test_what_is_not_a_finite_number_is_refused_by_name(check: Callable[..., float], value: object) -> None:
    with pytest.raises(InvalidInputError, match=r"^speed must be .* \[m/s\], got "):
        check("speed", value, "m/s")


@pytest.mark.parametrize("value", [1, 1.0, np.int8(1), np.uint64(1), np.float32(1), np.float64(1)])
def test_numbers_of_python_and_numpy_become_floats(value: object) -> None:
    for check in (checks.number, checks.positive, checks.non_negative):
        result = check("speed", value)
        assert result == 1.0
        assert type(result) is float


def test_the_sign_of_a_number() -> None:
    assert checks.number("x", -2) == -2.0
    assert checks.non_negative("x", 0) == 0.0
    for check, value in ((checks.positive, 0.0), (checks.positive, -1), (checks.non_negative, -1e-300)):
        with pytest.raises(InvalidInputError, match="x must be"):
            check("x", value)


@pytest.mark.parametrize(
    "value", [True, np.True_, 1.0, "1", None, np.array(1), np.nan, np.ma.masked, np.timedelta64(5, "s"), 0, -1]
)
def test_what_is_not_a_whole_number_from_the_lowest_on_is_refused(value: object) -> None:
    with pytest.raises(InvalidInputError, match="^workers must be a whole number >= 1, got "):
        checks.whole_number("workers", value, 1)


@pytest.mark.parametrize("value", [3, np.int64(3), np.uint8(3)])
def test_whole_numbers_become_ints(value: object) -> None:
    assert checks.whole_number("workers", value, 3) == 3
    assert type(checks.whole_number("workers", value)) is int


def test_a_flag_is_a_bool_and_nothing_that_counts_as_one() -> None:
    assert checks.flag("closest", np.True_) is True
    for value in ("no", 1, 0, None, np.array([True])):
        with pytest.raises(InvalidInputError, match="^closest must be True or False, got "):
            checks.flag("closest", value)


def test_a_choice_lists_what_there_is() -> None:
    assert checks.choice("method", "qp", ("auto", "qp")) == "qp"
    for value in ("pq", None, 3, ["qp"], np.array(["auto", "qp"])):
        with pytest.raises(UnknownNameError, match="Valid: auto, qp"):
            checks.choice("method", value, ("auto", "qp"))


def test_what_has_no_unit_is_told_without_one() -> None:
    with pytest.raises(InvalidInputError, match=r"^axis must have shape \(3,\), got shape \(2,\)$"):
        checks.vector("axis", [0.0, 1.0], 3, "")
    with pytest.raises(InvalidInputError, match=r"^q must have shape \(3,\) \[rad\], got shape \(2,\)$"):
        checks.vector("q", [0.0, 1.0], 3, "rad")
    with pytest.raises(InvalidInputError, match=r"^axes must have shape \(n, 3\), got shape \(2,\)$"):
        checks.matrix("axes", [0.0, 1.0], 3, "")


@pytest.mark.parametrize(
    ("check", "good", "bad", "words"),
    [
        (lambda name, value: checks.instance(name, value, Path, "a Path"), Path(), "x", "a Path"),
        (checks.function, len, 3, "callable"),
        (checks.mapping, {"a": 1}, [("a", 1)], "a dict"),
        (checks.path, "x", 3, "a str or a Path"),
        (checks.path, Path("x"), "", "a str or a Path"),
    ],
)
def test_what_is_of_another_kind_is_refused_by_name(
    check: Callable[[str, object], object], good: object, bad: object, words: str
) -> None:
    assert check("given", good) == (Path(good) if isinstance(good, str) else good)
    with pytest.raises(InvalidInputError, match=re.escape(f"given must be {words}, got {bad!r}")):
        check("given", bad)


def test_a_generator_is_neither_a_seed_nor_a_random_state(rng: np.random.Generator) -> None:
    assert checks.generator("rng", rng) is rng
    for value in (0, None, np.random.RandomState(0)):
        with pytest.raises(InvalidInputError, match="^rng must be a numpy.random.Generator, got "):
            checks.generator("rng", value)


ROWS: list[Any] = [
    np.ma.array([1.0, 2.0, 3.0], mask=[False, True, False]),
    np.ma.array([1.0, 2.0, 3.0]),
    [1.0, np.ma.masked, 2.0],
    [1.0, True, 2.0],
    (1.0, np.False_, 2.0),
    np.array([True, False, True]),
    ["1", "2", "3"],
    [1.0, "2", 3.0],
    np.array(["2020-01-01"] * 3, dtype="datetime64[D]"),
    [1.0, 10**400, 2.0],
    [1.0, None, 2.0],
    [1.0, [2.0], 3.0],
    [1.0, 2j, 3.0],
    {"x": 1.0},
    Unprintable(),
    [1.0, np.nan, 2.0],
    np.array([1.0, np.longdouble("1e400"), 2.0], dtype=np.longdouble),
]


@pytest.mark.parametrize("value", ROWS, ids=range(len(ROWS)))
def test_vectors_and_matrices_refuse_what_is_not_made_of_numbers(value: Any) -> None:
    for check in (checks.vector, checks.positive_vector):
        with pytest.raises(InvalidInputError, match="^q must "):
            check("q", value, 3, "rad")
    with pytest.raises(InvalidInputError, match="^seeds must "):
        checks.matrix("seeds", [value, value], 3, "rad")


def test_a_vector_is_contiguous_and_otherwise_the_array_itself() -> None:
    q = np.array([1.0, 2.0, 3.0])
    assert checks.vector("q", q, 3, "rad") is q
    column = checks.vector("q", np.arange(9.0).reshape(3, 3)[:, 1], 3, "rad")
    assert column.flags.c_contiguous
    assert column.tolist() == [1.0, 4.0, 7.0]
    assert checks.vector("q", [1, 2, 3], 3, "rad").dtype == np.float64
    assert checks.vector("q", [1e308, 1e308, 1e308], 3, "rad").tolist() == [1e308] * 3  # whose sum is not finite


def test_one_positive_number_stands_for_all() -> None:
    assert checks.positive_vector("a", 2, 3, "rad/s").tolist() == [2.0, 2.0, 2.0]
    limits = checks.positive_vector("a", [1, 2, 3], 3, "rad/s")
    assert not limits.flags.writeable
    wrong: list[Any] = [0.0, [1.0, 0.0, 1.0], [1.0, -1.0, 1.0], True, "1", [1.0, 2.0], []]
    for value in wrong:
        with pytest.raises(InvalidInputError, match="^a must "):
            checks.positive_vector("a", value, 3, "rad/s")


def test_a_matrix_names_the_row_that_is_not_finite() -> None:
    rows = np.zeros((4, 3))
    rows[2, 1] = np.inf
    with pytest.raises(InvalidInputError, match="row 2 is not"):
        checks.matrix("seeds", rows, 3, "rad")
    malformed: list[Any] = [[], np.zeros((0, 3)), np.zeros((2, 4)), np.zeros(3)]
    for value in malformed:
        with pytest.raises(InvalidInputError, match="^seeds "):
            checks.matrix("seeds", value, 3, "rad")


def test_a_long_value_is_cut_in_a_message() -> None:
    assert len(shown("x" * 10_000)) < 250
    assert shown(10**5000) == "an unprintable int"
