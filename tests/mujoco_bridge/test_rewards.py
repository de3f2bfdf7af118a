"""Rewards: the shapes by their defining values, bounds, arrays, and dm_control's function beside them."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest

from jacokin.errors import InvalidInputError, UnknownNameError
from jacokin.mujoco_bridge.rewards import SHAPES, tolerance
from tests.optional import needs_dm_control

REACH_ZERO = ("cosine", "linear", "quadratic")
SAME = 1e-12  # of values in 0..1; the same formulas in another order


@pytest.mark.parametrize("sigmoid", SHAPES)
@pytest.mark.parametrize("margin", [0.01, 1.0, 30.0])
@pytest.mark.parametrize("value", [0.001, 0.1, 0.99])
def test_value_at_the_margin(sigmoid: str, margin: float, value: float) -> None:
    for x in (-margin, 1.0 + margin):
        assert tolerance(x, (0.0, 1.0), margin, sigmoid, value) == pytest.approx(value, rel=1e-9)
    assert tolerance(1.0, (0.0, 1.0), margin, sigmoid, value) == 1.0
    assert tolerance(0.0, (0.0, 1.0), margin, sigmoid, value) == 1.0


@pytest.mark.parametrize("sigmoid", SHAPES)
def test_values_fall_with_the_distance_between_one_and_zero(sigmoid: str) -> None:
    x = np.linspace(0.0, 5.0, 401)
    values = np.asarray(tolerance(x, margin=1.0, sigmoid=sigmoid))
    assert values[0] == 1.0
    assert (np.diff(values) <= 0.0).all()
    assert (values >= 0.0).all()
    assert (values[-1] == 0.0) == (sigmoid in REACH_ZERO)
    np.testing.assert_array_equal(values, tolerance(-x, margin=1.0, sigmoid=sigmoid))
    if sigmoid in REACH_ZERO:
        assert tolerance(1.0, margin=1.0, sigmoid=sigmoid, value_at_margin=0.0) == pytest.approx(0.0, abs=1e-15)


def test_published_formulas() -> None:
    d = 0.37
    for sigmoid, expected in {
        "gaussian": math.exp(d**2 * math.log(0.1)),
        "linear": 1.0 - 0.9 * d,
        "long_tail": 1.0 / (1.0 + 9.0 * d**2),
    }.items():
        assert tolerance(0.05 + d * 0.05, (0.0, 0.05), 0.05, sigmoid) == pytest.approx(expected, rel=1e-12)
    assert tolerance(0.5, (0.8, math.inf), 0.3, "linear", 0.0) == pytest.approx(0.0, abs=1e-15)


@pytest.mark.parametrize(
    ("x", "bounds", "expected"),
    [
        (0.0, (0.0, 0.0), 1.0),
        (-1e-9, (0.0, 0.0), 0.0),
        (0.5, (0.0, 1.0), 1.0),
        (1.5, (0.0, 1.0), 0.0),
        (1e300, (-math.inf, math.inf), 1.0),
        (math.inf, (0.0, math.inf), 1.0),
        (-math.inf, (0.0, math.inf), 0.0),
    ],
)
def test_without_a_margin_it_is_whether_x_is_in_bounds(x: float, bounds: tuple[float, float], expected: float) -> None:
    value = tolerance(x, bounds)
    assert value == expected
    assert type(value) is float


def test_arrays_are_their_numbers() -> None:
    x = np.random.default_rng(0).normal(size=(3, 4, 5))
    values = np.asarray(tolerance(x, (-0.2, 0.3), 0.5, "long_tail"))
    assert values.shape == x.shape
    assert all(values[index] == tolerance(x[index], (-0.2, 0.3), 0.5, "long_tail") for index in np.ndindex(x.shape))
    assert np.isnan(tolerance(math.nan, margin=1.0))
    assert np.isnan(tolerance(math.nan))


@pytest.mark.filterwarnings("ignore")
def test_dm_control_gives_the_same() -> None:
    needs_dm_control()
    from dm_control.utils import rewards as reference

    x = np.array([*np.linspace(-3.0, 3.0, 241), 1e200, -1e200])
    bounds = [(0.0, 0.0), (-1.0, 1.0), (0.3, math.inf), (-math.inf, -0.2)]
    for sigmoid, interval, margin, value in itertools.product(SHAPES, bounds, (0.0, 0.05, 2.0), (0.1, 0.7)):
        expected = reference.tolerance(x, interval, margin, sigmoid, value)
        np.testing.assert_allclose(tolerance(x, interval, margin, sigmoid, value), expected, rtol=0.0, atol=SAME)


def test_wrong_arguments_are_refused() -> None:
    wrong: list[tuple[Any, type[InvalidInputError], str]] = [
        (lambda: tolerance(0.0, (1.0, 0.0)), InvalidInputError, "lower <= upper"),
        (lambda: tolerance(0.0, (math.nan, 0.0)), InvalidInputError, "lower <= upper"),
        (lambda: tolerance(0.0, (0.0,)), InvalidInputError, "bounds"),  # type: ignore[arg-type]  # wrong on purpose
        (lambda: tolerance("far"), InvalidInputError, "x must be numbers"),
        (lambda: tolerance(0.0, margin=-1.0), InvalidInputError, "margin must be"),
        (lambda: tolerance(0.0, margin=1.0, sigmoid="round"), UnknownNameError, "Valid: gaussian"),
        (lambda: tolerance(0.0, margin=1.0, value_at_margin=0.0), InvalidInputError, "value_at_margin must be"),
        (lambda: tolerance(0.0, margin=1.0, value_at_margin=1.0), InvalidInputError, "value_at_margin must be"),
        (lambda: tolerance(0.0, sigmoid="linear", value_at_margin=-0.1), InvalidInputError, "value_at_margin must be"),
    ]
    for call, error, message in wrong:
        with pytest.raises(error, match=message):
            call()
