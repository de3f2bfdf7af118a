"""Inverse kinematics that several scenes of one arm ask for in turns: answered as one batch, as if one by one."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import pytest

from jacokin.arrays import Array
from jacokin.errors import EpisodeInitializationError
from jacokin.mujoco_bridge import Physics
from jacokin.mujoco_bridge.control import site_ik
from jacokin.mujoco_bridge.control.initializers import ToolCenterPointInitializer
from jacokin.mujoco_bridge.distributions import UniformQuaternion, uniform_box
from jacokin.mujoco_bridge.entity import rotation_matrix
from tests.mujoco_bridge.scenes import jaco_scene

BOX = ((-0.3, -0.3, 0.02), (0.3, 0.3, 0.6))  # [m]; some of it is out of reach, and some configurations collide
COUNT = 20


def placed_alone(physics: Physics, initializer: ToolCenterPointInitializer, home: Array) -> list[Array]:
    found = []
    for seed in range(COUNT):
        physics.set_state(home)
        initializer(physics, np.random.default_rng(seed))
        found.append(physics.get_state())
    return found


def test_turns_in_one_simulation_end_as_single_calls_do() -> None:
    physics, _, arm, hand = jaco_scene()
    initializer = ToolCenterPointInitializer(hand, arm, uniform_box(*BOX), branch="nearest_to_random")
    home = physics.get_state()
    states = [home] * COUNT

    @contextmanager
    def switch(number: int) -> Iterator[None]:
        physics.set_state(states[number])
        yield
        states[number] = physics.get_state()

    rngs = [np.random.default_rng(seed) for seed in range(COUNT)]
    site_ik.run_all([initializer.placing(physics, rng) for rng in rngs], switch)
    np.testing.assert_array_equal(states, placed_alone(physics, initializer, home))


def test_values_are_returned_in_order() -> None:
    def asking(number: int) -> site_ik.Asking[int]:
        yield from ()
        return number

    assert site_ik.run_all([asking(number) for number in range(3)]) == [0, 1, 2]
    assert site_ik.run_all([]) == []


def test_a_pose_that_collides_from_every_start_is_given_up() -> None:
    physics, _, arm, hand = jaco_scene()
    low = ToolCenterPointInitializer(hand, arm, (0.0, 0.0, -0.1), branch="nearest_to_random", max_ik_attempts=3)
    before = physics.get_state()
    with pytest.raises(EpisodeInitializationError, match="none of 10 poses"):
        low(physics, np.random.default_rng(0))
    np.testing.assert_array_equal(physics.get_state(), before)


def test_an_answer_is_that_of_the_solver_to_the_last_bit(rng: np.random.Generator) -> None:
    """Whether the target can be reached or not; the answer looks at the nearest branch alone."""
    physics, _, arm, hand = jaco_scene()
    solver, bounds = arm.site_solver(physics, hand.tool_center_point), arm.sampling_bounds(physics)
    reached = 0
    for position in rng.uniform(*BOX, (200, 3)):
        query = solver.query(position, rotation_matrix(UniformQuaternion()(None, None, rng)), bounds, rng)
        result, answer = query.solver.solve(query.target, query.start, closest=False), query.answer()
        assert (answer is not None) == result.success
        if answer is not None:
            np.testing.assert_array_equal(answer, site_ik.canonical(result.q, query.wraps))
            reached += 1
    assert 20 < reached < 180
