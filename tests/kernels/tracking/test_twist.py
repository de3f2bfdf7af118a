"""The damped inverse and the turning Jacobian of ticks along twists, as plain Python: against NumPy and differences."""

from __future__ import annotations

import numpy as np
import pytest

from jacokin.arrays import Array
from jacokin.kernels.contact.arm import SLIDE
from jacokin.kernels.tracking.inverse import (
    EXACT,
    damping_leaving,
    decompose,
    fill_bend,
    make_inverse,
    part_left,
    solve_damped,
)
from jacokin.kernels.tracking.tasks import LINK, PLACEMENT, fill_columns, place_joints
from jacokin.kernels.tracking.tick import TickWork, make_tick_work
from jacokin.kernels.tracking.twist import fill_turn, tool_of

STEP = 1e-6  # [rad]


def damped(jacobian: Array, y: Array, damping: float) -> Array:
    """The x of the least |J x - y|^2 + damping |x|^2."""
    dof = jacobian.shape[1]
    stacked = np.vstack([jacobian, np.sqrt(damping) * np.eye(dof)])
    return np.asarray(np.linalg.lstsq(stacked, np.append(y, np.zeros(dof)), rcond=None)[0])


@pytest.mark.parametrize("singular", [False, True])
@pytest.mark.parametrize("dof", [5, 6, 7])
def test_answers_are_the_least_squares_and_bend_as_their_differences(
    dof: int, singular: bool, rng: np.random.Generator
) -> None:
    for damping in (1e-5, 1e-2):
        jacobian, turn, y = rng.normal(size=(6, dof)), rng.normal(size=(6, dof)), rng.normal(size=6)
        if singular:
            jacobian[:, 1] = 0.5 * jacobian[:, 0]
        inverse, x, bend = make_inverse(dof), np.zeros(dof), np.zeros(dof)
        inverse.jacobian[:] = jacobian.ravel()
        decompose(inverse)
        solve_damped(inverse, y, damping, x)
        np.testing.assert_allclose(x, damped(jacobian, y, damping), rtol=1e-6, atol=1e-8)
        fill_bend(inverse, y, x, turn.ravel(), damping, bend)
        size = STEP * np.sqrt(damping)
        ends = [damped(jacobian + side * size * turn, y, damping) for side in (1.0, -1.0)]
        difference = (ends[0] - ends[1]) / (2.0 * size)
        if dof == 7:  # the way within the null space is not taken
            row_space = np.linalg.svd(jacobian)[2][:6]
            difference, bend = row_space @ difference, row_space @ bend
        np.testing.assert_allclose(bend, difference, rtol=1e-3, atol=1e-4 * np.abs(difference).max())


@pytest.mark.parametrize("dof", [6, 7])
def test_damping_leaves_no_more_than_is_allowed(dof: int, rng: np.random.Generator) -> None:
    for _ in range(20):
        jacobian, y = rng.normal(size=(6, dof)), rng.normal(size=6)
        inverse, x = make_inverse(dof), np.zeros(dof)
        inverse.jacobian[:] = jacobian.ravel()
        decompose(inverse)
        damping = damping_leaving(inverse, y, 0.01)
        solve_damped(inverse, y, damping, x)
        assert 0.009 < np.linalg.norm(jacobian @ x - y) <= 0.01


def test_what_no_damping_reaches_does_not_count(rng: np.random.Generator) -> None:
    """A direction that all joints leave alone allowed no damping at all."""
    jacobian, y = rng.normal(size=(6, 6)), rng.normal(size=6)
    jacobian[2] = 0.0
    inverse, exact, x = make_inverse(6), np.zeros(6), np.zeros(6)
    inverse.jacobian[:] = jacobian.ravel()
    decompose(inverse)
    solve_damped(inverse, y, EXACT, exact)
    damping = damping_leaving(inverse, y, 0.01)
    solve_damped(inverse, y, damping, x)
    assert 0.009 < np.linalg.norm(jacobian @ (x - exact)) <= 0.01


def test_what_no_damping_reaches_is_in_directions_in_which_no_joint_leads(rng: np.random.Generator) -> None:
    for dof in (4, 6, 7):
        jacobian, y = rng.normal(size=(6, dof)), rng.normal(size=6)
        inverse = make_inverse(dof)
        inverse.jacobian[:] = jacobian.ravel()
        decompose(inverse)
        assert part_left(inverse, y) < 1e-9 * np.linalg.norm(y)
        jacobian[2] = 0.0
        inverse.jacobian[:] = jacobian.ravel()
        decompose(inverse)
        expected = abs(y[2]) if dof >= 6 else 0.0  # too few joints lead in as many directions as there are of them
        assert part_left(inverse, y) == pytest.approx(expected, abs=1e-9)


def tool_columns(tick: TickWork, q: Array) -> Array:
    """The tool's Jacobian (6, dof) at a configuration."""
    place_joints(tick.arm, q)
    fill_columns(tick.arm, int(tick.tasks.integers[0, LINK]), tool_of(tick), tick.columns)
    return tick.columns.T.copy()


def test_the_jacobian_turns_as_its_differences(rng: np.random.Generator) -> None:
    """Of arms whose joints turn and slide, and of a tool that not all of them move."""
    for _ in range(10):
        dof = 6
        tick, q, x = make_tick_work(dof, 1), rng.normal(size=dof), rng.normal(size=dof)
        rotations = np.linalg.qr(rng.normal(size=(dof, 3, 3)))[0]
        tick.arm.placements[:, :, :3] = rotations * np.linalg.det(rotations)[:, np.newaxis, np.newaxis]
        tick.arm.placements[:, :, 3] = rng.normal(size=(dof, 3))
        tick.arm.kinds[rng.integers(dof)] = SLIDE
        tick.tasks.integers[0, LINK] = rng.integers(4, dof + 1)
        tick.tasks.numbers[0, PLACEMENT : PLACEMENT + 12] = np.column_stack([np.eye(3), rng.normal(size=3)]).ravel()
        weights, turn = rng.uniform(0.5, 2.0, 6), np.zeros(6 * dof)
        difference = (tool_columns(tick, q + STEP * x) - tool_columns(tick, q - STEP * x)) / (2.0 * STEP)
        tool_columns(tick, q)
        fill_turn(tick, x, weights, turn)
        np.testing.assert_allclose(turn.reshape(6, dof), weights[:, np.newaxis] * difference, atol=1e-7)
