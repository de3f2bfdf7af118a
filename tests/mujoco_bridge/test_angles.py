"""Angles back from (sin, cos) pairs."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import ArrayLike

from jacokin.errors import InvalidInputError
from jacokin.mujoco_bridge.observations import angles_from_sin_cos, sin_cos

TURN = 2 * np.pi
ROUNDING = 1e-14  # [rad], a few rounding errors of an angle of up to 10 pi


def pairs(angles: ArrayLike) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    return np.stack([np.sin(angles), np.cos(angles)], axis=-1)


@given(st.floats(-10 * np.pi, 10 * np.pi))
def test_angle_is_the_same_up_to_full_turns_and_in_range(angle: float) -> None:
    back = float(angles_from_sin_cos(pairs(angle)))
    assert 0.0 <= back < TURN
    assert abs((back - angle + np.pi) % TURN - np.pi) < ROUNDING


@given(st.floats(-30.0, 30.0), st.floats(-30.0, 30.0))
def test_the_copy_nearest_to_a_reference_is_returned(angle: float, near: float) -> None:
    back = float(angles_from_sin_cos(pairs(angle), near=near))
    assert abs(back - near) <= np.pi + ROUNDING
    assert abs((back - angle + np.pi) % TURN - np.pi) < 2 * ROUNDING


@pytest.mark.parametrize("shape", [(), (6,), (4, 6)])
def test_pairs_of_any_number_of_angles(shape: tuple[int, ...]) -> None:
    angles = np.random.default_rng(0).uniform(-9.0, 9.0, shape)
    np.testing.assert_array_equal(sin_cos(angles), pairs(angles))


def test_shapes_and_edge_cases() -> None:
    home = np.array([4.8046852, 2.92482, 1.002, 4.2031852, 1.4458, 1.3233])  # [rad]
    np.testing.assert_allclose(angles_from_sin_cos(pairs(home)), home, rtol=0, atol=ROUNDING)
    batch = np.stack([home, home - 0.3])
    np.testing.assert_allclose(angles_from_sin_cos(2.0 * pairs(batch)), batch, rtol=0, atol=ROUNDING)
    assert angles_from_sin_cos([-1e-17, 1.0]) == 0.0  # not 2 pi
    assert angles_from_sin_cos([0.0, -1.0]) == np.pi
    assert angles_from_sin_cos([0.0, -1.0], near=-3.0) == -np.pi


@pytest.mark.parametrize(
    ("sin_cos", "near", "message"),
    [
        ([0.0, 1.0, 0.0], None, "shape"),
        (1.0, None, "shape"),
        ([np.nan, 1.0], None, "finite"),
        ([[0.0, 1.0], [0.0, 0.0]], None, r"\(0, 0\)"),
        ("north", None, "numbers"),
        ([0.0, 1.0], [1.0, 2.0], "near"),
        ([0.0, 1.0], np.inf, "near"),
    ],
)
def test_wrong_input_is_refused(sin_cos: ArrayLike, near: ArrayLike | None, message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        angles_from_sin_cos(sin_cos, near=near)
