"""Samplers: the draws are those of the random state, in the shape of the initial value, for each calling style."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from jacokin.errors import InvalidInputError
from jacokin.mujoco_bridge.distributions import (
    IDENTITY_QUATERNION,
    Normal,
    QuaternionFromAxisAngle,
    Uniform,
    UniformQuaternion,
    constant_or_sampler,
    uniform_box,
)
from tests.optional import needs_dm_control

KINDS = [np.random.RandomState, np.random.default_rng]


def test_equal_parameters_make_equal_samplers() -> None:
    assert Uniform(0, 1) == Uniform(0.0, 1.0) == Uniform(np.float64(0.0), np.array(1.0))
    different: list[object] = [Uniform(0, 1), Uniform(0, 2), Uniform(0, 1, single_sample=True), Normal(0, 1)]
    assert [different.index(each) for each in different] == [0, 1, 2, 3]
    assert uniform_box((0, 0, 0), (1, 2, 3)) == uniform_box(np.zeros(3), [1, 2, 3])
    yaw = QuaternionFromAxisAngle(np.array((0, 0, 1)), Uniform(-1, 1))
    assert yaw == QuaternionFromAxisAngle((0, 0, 1), Uniform(-1, 1)) != QuaternionFromAxisAngle((0, 1, 0), 0.5)
    assert len({Uniform(0, 1), Uniform(0.0, 1.0), UniformQuaternion(), UniformQuaternion()}) == 2


@pytest.mark.parametrize("kind", KINDS)
def test_draws_are_those_of_the_random_state(kind: Any) -> None:
    rng, twin = kind(4), kind(4)
    assert Uniform(-1.0, 2.0)(random_state=rng) == twin.uniform(-1.0, 2.0)
    np.testing.assert_array_equal(
        Uniform((0.0, 1.0), (1.0, 5.0))(random_state=rng), twin.uniform((0.0, 1.0), (1.0, 5.0))
    )
    np.testing.assert_array_equal(Uniform(0.0, 3.0)(np.zeros((2, 3)), None, rng), twin.uniform(0.0, 3.0, (2, 3)))
    assert Uniform(0.0, 3.0, single_sample=True)(np.zeros(3), None, rng) == twin.uniform(0.0, 3.0)
    np.testing.assert_array_equal(Normal(1.0, 0.1)(np.zeros(4), None, rng), twin.normal(1.0, 0.1, 4))
    np.testing.assert_array_equal(
        uniform_box((0, 0, 0), (1, 2, 3))(np.zeros(7), None, rng), twin.uniform((0, 0, 0), (1, 2, 3))
    )


@pytest.mark.filterwarnings("ignore")
def test_dm_control_draws_the_same() -> None:
    needs_dm_control()
    from dm_control.composer.variation import distributions, rotations

    z = (0.0, 0.0, 1.0)
    pairs: list[tuple[Any, Any]] = [
        (Uniform(-1.0, 2.0), distributions.Uniform(-1.0, 2.0)),
        (Uniform((0, 0, 1), (1, 1, 2)), distributions.Uniform((0, 0, 1), (1, 1, 2))),
        (Normal(0.5, 0.2), distributions.Normal(0.5, 0.2)),
        (Normal(0.5, 0.2, single_sample=True), distributions.Normal(0.5, 0.2, single_sample=True)),
        (UniformQuaternion(), rotations.UniformQuaternion()),
        (
            QuaternionFromAxisAngle(z, Uniform(0, 2 * np.pi, single_sample=True)),
            rotations.QuaternionFromAxisAngle(z, distributions.Uniform(0, 2 * np.pi, single_sample=True)),
        ),
    ]
    for own, theirs in pairs:
        mine, reference = np.random.RandomState(9), np.random.RandomState(9)
        for initial in (None, np.zeros(3)):
            np.testing.assert_allclose(own(initial, initial, mine), theirs(initial, initial, reference), atol=1e-15)


def test_rotations_are_about_the_axis_and_uniform_ones_have_no_direction() -> None:
    rng = np.random.default_rng(0)
    quat_wxyz = QuaternionFromAxisAngle((0.0, 3.0, 0.0), 0.5)(random_state=rng)
    np.testing.assert_allclose(quat_wxyz, (np.cos(0.25), 0.0, np.sin(0.25), 0.0), atol=1e-15)
    drawn = np.array([UniformQuaternion()(random_state=rng) for _ in range(4000)])
    np.testing.assert_allclose(np.linalg.norm(drawn, axis=1), 1.0, atol=1e-12)
    # Of uniform rotations, the mean of q q^T is the identity over 4.
    np.testing.assert_allclose(drawn.T @ drawn / len(drawn), np.eye(4) / 4, atol=0.02)
    np.testing.assert_array_equal(IDENTITY_QUATERNION, (1.0, 0.0, 0.0, 0.0))


def test_styles_of_samplers() -> None:
    marker: Any = object()
    styles: list[Any] = [
        lambda initial_value, current_value, random_state: (initial_value, current_value, random_state),
        lambda *, random_state, current_value, initial_value: (initial_value, current_value, random_state),
        lambda first, last, rng: (first, last, rng),
        lambda **given: (given["initial_value"], given["current_value"], given["random_state"]),
    ]
    for style in styles:
        assert constant_or_sampler("x", style)(1, 2, marker) == (1, 2, marker)
    for alone in (lambda random_state: random_state, lambda rng: rng, lambda *, random_state: random_state):
        assert constant_or_sampler("x", alone)(1, 2, marker) is marker
    assert constant_or_sampler("x", (1.0, 2.0))(None, None, None) == (1.0, 2.0)


def test_wrong_arguments_are_refused() -> None:
    rng = np.random.RandomState(0)
    wrong: list[tuple[Any, str]] = [
        (lambda: Uniform(1.0, 0.0), "low must not be above high"),
        (lambda: Uniform((0, 0), (1, 1, 1)), "low and high must fit"),
        (lambda: Uniform("low", 1.0), "low must be numbers"),
        (lambda: Uniform(0.0, np.inf), "high must be finite"),
        (lambda: Normal(0.0, -1.0), "scale must not be negative"),
        (lambda: Normal(np.nan, 1.0), "loc must be finite"),
        (lambda: QuaternionFromAxisAngle((0.0, 0.0, 0.0), 1.0), "axis must not be zero"),
        (lambda: QuaternionFromAxisAngle((0.0, 0.0, 1.0), "half"), "angle must be a finite number"),  # type: ignore[arg-type]  # wrong on purpose
        (lambda: QuaternionFromAxisAngle((0, 0, 1), lambda: 1.0), "angle must take"),
        (
            lambda: QuaternionFromAxisAngle((0, 0, 1), Uniform((0, 0), (1, 1)))(None, None, rng),
            "angle",
        ),
        (lambda: Uniform((0, 0), (1, 1))(np.zeros(3), None, rng), r"cannot be drawn for numbers of shape \(3,\)"),
        (lambda: Uniform(-1e308, 1e308)(None, None, rng), "cannot be drawn"),
        (lambda: Uniform()(), "random_state must be"),
        (lambda: Uniform()(None, None, 3), "random_state must be"),  # type: ignore[arg-type]  # wrong on purpose
        (lambda: UniformQuaternion()(), "random_state must be"),
        (lambda: constant_or_sampler("position", lambda: 3), "position must take .*so that a seed"),
        (lambda: constant_or_sampler("position", lambda a, b: 3), "position must take"),
        (lambda: constant_or_sampler("position", max), "wrap it"),
        (lambda: constant_or_sampler(10**5000, max), "name must be a string"),  # type: ignore[arg-type]  # wrong on purpose
    ]
    for call, message in wrong:
        with pytest.raises(InvalidInputError, match=message):
            call()
