"""Starts of episodes as a task makes them: repeatable, the same after pickling, in the time of few physics steps."""

from __future__ import annotations

import pickle
from typing import Any

import numpy as np
import pytest

from jacokin.mujoco_bridge import Physics, Primitive, PropPlacer, ToolCenterPointInitializer, distributions
from tests.mujoco_bridge.scenes import jaco_parts
from tests.threads import run_in_threads


def task() -> tuple[Any, ...]:
    """An arena, its physics, the arm and hand, and the initializers of the tool and of two cubes."""
    arena, arm, hand = jaco_parts()
    cubes = [Primitive("box", (0.02, 0.02, 0.02), name=f"cube_{i}") for i in range(2)]
    for cube in cubes:
        arena.add_free_entity(cube)
    turn = distributions.Uniform(0.0, 2.0 * np.pi, single_sample=True)
    place_tool = ToolCenterPointInitializer(hand, arm, distributions.Uniform((-0.1, -0.1, 0.2), (0.1, 0.1, 0.4)))
    place_cubes = PropPlacer(
        cubes,
        distributions.uniform_box((-0.1, -0.1, 0.021), (0.1, 0.1, 0.021)),
        distributions.QuaternionFromAxisAngle((0.0, 0.0, 1.0), turn),
        settle_physics=True,
    )
    return arena, Physics.from_entity(arena), arm, hand, place_tool, place_cubes


def start(parts: tuple[Any, ...], seed: int) -> Any:
    _, physics, arm, hand, place_tool, place_cubes = parts
    rng = np.random.RandomState(seed)
    physics.reset()
    arm.set_home(physics)
    hand.set_grasp(physics, rng.uniform())
    place_tool(physics, rng)
    place_cubes(physics, rng)
    return physics.get_state()


@pytest.mark.one_quick
@pytest.mark.parametrize("seed", range(3))
def test_a_seed_determines_the_start_whatever_happened_before(seed: int) -> None:
    parts = task()
    first = start(parts, seed)
    other = start(parts, seed + 100)
    assert not np.array_equal(first, other)
    parts[1].data.ctrl[:] = 0.5
    parts[1].step(50)
    np.testing.assert_array_equal(start(parts, seed), first)
    np.testing.assert_array_equal(start(task(), seed), first)


def test_a_pickled_task_starts_in_the_same_way() -> None:
    parts = task()
    expected = start(parts, 4)
    np.testing.assert_array_equal(start(pickle.loads(pickle.dumps(parts)), 4), expected)


def test_threads_that_share_a_physics_take_turns() -> None:
    _, physics, arm, hand, place_tool, place_cubes = task()
    arm.set_home(physics)
    failures: list[BaseException] = []

    def work(seed: int) -> None:
        rng = np.random.RandomState(seed)
        try:
            for _ in range(10):
                with physics.lock:
                    goal = rng.uniform((-0.1, -0.1, 0.2), (0.1, 0.1, 0.4))
                    assert arm.set_site_to_xpos(physics, rng, hand.pinch_site, goal)
                    np.testing.assert_allclose(physics.bind(hand.pinch_site).xpos, goal, atol=1e-6)
                arm.set_site_to_xpos(physics, rng, hand.pinch_site, (0.0, 0.0, 0.3))
                place_tool(physics, rng)
                place_cubes(physics, rng)
        except BaseException as error:
            failures.append(error)

    run_in_threads(work, 6)
    assert failures == []
