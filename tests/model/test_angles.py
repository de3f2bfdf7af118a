from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from jacokin.kernels.tolerances import LIMIT_SNAP
from jacokin.model import angles

TURNS = st.integers(-1000, 1000)
ANGLES = st.floats(-1e4, 1e4)
ROUNDING = 1e-11  # [rad] of an angle of 1e4 rad after adding turns


def on_circle(a: float, b: float) -> float:
    """Size of the angle between two directions, by complex numbers."""
    return abs(math.atan2(math.sin(a - b), math.cos(a - b)))


def into_limits(angle: float, lower: float, upper: float) -> float:
    return float(angles.into_limits(np.array([angle]), np.array([lower]), np.array([upper]))[0])


@given(ANGLES)
def test_wrapping_keeps_the_direction_and_stays_half_open(angle: float) -> None:
    half, whole = float(angles.wrap_to_pi(angle)), float(angles.wrap_to_turn(angle))
    assert -math.pi <= half < math.pi
    assert 0.0 <= whole < angles.TURN
    assert on_circle(half, angle) < ROUNDING
    assert on_circle(whole, angle) < ROUNDING


@pytest.mark.parametrize("angle", [-1e-17, -1e-300, -0.0, 0.0, angles.TURN, -angles.TURN, math.pi, -math.pi])
def test_wrapping_is_half_open_at_the_edges(angle: float) -> None:
    assert 0.0 <= angles.wrap_to_turn(angle) < angles.TURN
    assert -math.pi <= angles.wrap_to_pi(angle) < math.pi


@given(ANGLES, ANGLES)
def test_the_nearest_copy_is_at_most_half_a_turn_away(q: float, reference: float) -> None:
    copy = float(angles.nearest_copy(np.array([q]), np.array([reference]))[0])
    assert on_circle(copy, q) < ROUNDING
    assert abs(copy - reference) <= math.pi + ROUNDING
    assert float(angles.circular_distance(np.array([q]), np.array([reference]))) == pytest.approx(
        on_circle(q, reference), abs=ROUNDING
    )


def test_limited_angles_stay_where_they_are() -> None:
    q, reference = np.array([7.0, 7.0]), np.zeros(2)
    unlimited = np.array([True, False])
    assert angles.nearest_copy(q, reference, unlimited).tolist() == [7.0 - angles.TURN, 7.0]
    assert angles.circular_distance(q, reference, unlimited) == pytest.approx(math.hypot(7.0 - angles.TURN, 7.0))
    rows = np.tile(q, (3, 1))
    assert angles.circular_distance(rows, reference, unlimited).shape == (3,)


@given(ANGLES, st.floats(-20.0, 20.0), st.floats(0.0, 30.0))
def test_into_limits_finds_the_copy_that_brute_force_finds(q: float, lower: float, width: float) -> None:
    upper = lower + width
    result = into_limits(q, lower, upper)
    assert lower <= result <= upper
    copies = [q + turn * angles.TURN for turn in range(-1700, 1700)]
    gaps = [max(lower - copy, copy - upper, 0.0) for copy in copies]
    if min(gaps) > ROUNDING:  # no copy inside: the limit that is the least away
        assert min(abs(result - lower), abs(result - upper)) == 0.0
        assert on_circle(result, q) == pytest.approx(min(gaps), abs=ROUNDING)
    else:
        assert on_circle(result, q) < ROUNDING + LIMIT_SNAP
        clear = [copy for copy in copies if lower + ROUNDING < copy < upper - ROUNDING]
        if clear:
            assert abs(result - q) <= min(abs(copy - q) for copy in clear) + ROUNDING


@given(st.floats(-50.0, 50.0), st.floats(-50.0, 50.0), st.floats(0.0, 60.0), st.floats(-60.0, 60.0))
def test_the_nearest_copies_that_brute_force_finds(q: float, lower: float, width: float, near: float) -> None:
    limits = np.array([lower]), np.array([lower + width])
    start = np.array([[into_limits(q, lower, lower + width)]])
    counts = angles.copies_counted(*limits, np.array([True]))
    found = angles.copies_within(start, np.array([near]), *limits, counts)[:, 0]
    copies = start[0, 0] + angles.TURN * np.arange(-40, 41)
    every = copies[(copies >= lower + ROUNDING) & (copies <= lower + width - ROUNDING)]
    assert ((found >= lower) & (found <= lower + width)).all()
    assert len(every) <= len(found) <= max(1, len(every) + 2)  # those on a limit may be there
    assert all(np.abs(found - each).min() < ROUNDING for each in every)


def test_of_many_copies_those_nearest_to_a_place_are_found() -> None:
    lower, upper = np.full(6, -20.0), np.array([20.0] * 5 + [np.inf])
    counts = angles.copies_counted(lower, upper, np.array([True] * 6))
    assert counts.prod() == angles.MOST_COPIES
    found = angles.copies_within(np.zeros((1, 6)), np.full(6, 7.0), lower, upper, counts)
    turns = np.round(found / angles.TURN)
    assert len(np.unique(turns, axis=0)) == len(found) == angles.MOST_COPIES
    assert set(turns.ravel().tolist()) == {1.0, 2.0}


def test_into_limits_with_open_sides() -> None:
    inf = np.inf
    q = np.array([100.0, 100.0, 100.0, -100.0])
    result = angles.into_limits(q, np.array([-inf, -inf, 0.0, 0.0]), np.array([inf, 0.0, inf, inf]))
    assert result[0] == 100.0
    assert -angles.TURN < result[1] <= 0.0
    assert result[2] == 100.0
    assert 0.0 <= result[3] < angles.TURN
    np.testing.assert_allclose(np.cos(result), np.cos(q), atol=1e-13)


@given(st.floats(0.9, 5.4), TURNS)
def test_an_angle_inside_comes_back_from_any_number_of_turns(angle: float, turns: int) -> None:
    assert into_limits(angle + turns * angles.TURN, 0.82, 5.46) == pytest.approx(angle, abs=ROUNDING)


def test_an_angle_past_a_limit_by_rounding_is_put_on_it_and_not_moved_by_a_turn() -> None:
    lower, upper = np.array([-6.0, -1.0]), np.array([4.0, 1.0])
    past = np.array([-6.0 - 1e-10, 1.0 + 1e-10])
    assert np.array_equal(angles.into_limits(past, lower, upper), [-6.0, 1.0])
    assert np.allclose(angles.into_limits(np.array([-6.0 - 1e-8, 0.0]), lower, upper), [angles.TURN - 6.0, 0.0])
