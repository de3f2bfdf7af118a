"""A physics that is pickled goes on as the original does."""

from __future__ import annotations

import concurrent.futures
import multiprocessing
import pickle

import numpy as np
import pytest

from jacokin.errors import InvalidInputError
from jacokin.mujoco_bridge import Physics
from tests.mujoco_bridge.scenes import Scene


def advance(physics: Physics) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    physics.step(20)
    return physics.get_state()


def test_a_pickled_physics_has_the_same_state_and_goes_on_alike(jaco: Scene) -> None:
    physics, _, arm, hand = jaco
    physics.set_control(np.full(9, 0.1))
    physics.step(7)
    physics.bind(arm.joints).damping = 0.5
    twin = pickle.loads(pickle.dumps(physics))
    np.testing.assert_array_equal(twin.get_state(), physics.get_state())
    np.testing.assert_array_equal(twin.bind(hand.pinch_site).xpos, physics.bind(hand.pinch_site).xpos)  # by its name
    np.testing.assert_array_equal(twin.bind(arm.joints).damping, 0.5)
    for each in (physics, twin):
        each.forward()
    np.testing.assert_array_equal(advance(physics), advance(twin))
    twin.step()
    assert twin.time > physics.time


@pytest.mark.slow
def test_a_physics_is_sent_to_another_process(jaco: Scene) -> None:
    physics = jaco.physics
    context = multiprocessing.get_context("spawn")
    with concurrent.futures.ProcessPoolExecutor(1, mp_context=context) as pool:
        np.testing.assert_array_equal(pool.submit(advance, physics).result(timeout=60), advance(physics.copy()))


def test_controls_are_checked(jaco: Scene) -> None:
    physics = jaco.physics
    physics.set_control(range(9))
    np.testing.assert_array_equal(physics.data.ctrl, range(9))
    for wrong in (np.zeros(8), np.full(9, np.nan), 0.0, "fast"):
        with pytest.raises(InvalidInputError, match="control must"):
            physics.set_control(wrong)
    np.testing.assert_array_equal(physics.data.ctrl, range(9))


def test_an_old_copy_knows_the_elements_that_the_original_knew(jaco: Scene) -> None:
    physics, arena, arm, _ = jaco
    added = arena.mjcf_model.worldbody.add_site(name="added")
    twin = physics.copy()
    np.testing.assert_array_equal(twin.bind(arm.joints).qpos, physics.bind(arm.joints).qpos)
    with pytest.raises(InvalidInputError, match="not part of this physics"):
        twin.bind(added)
