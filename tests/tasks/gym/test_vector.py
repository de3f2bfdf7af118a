"""Vectors of environments: each is what a single one is, bit for bit; ends, seeds, mistakes."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest

import jacokin.tasks
from jacokin.errors import InvalidInputError
from jacokin.mujoco_bridge.distributions import Uniform
from jacokin.tasks import Randomization, TaskEnv
from jacokin.tasks.gym import batched
from jacokin.tasks.gym.make_vector import make_vector
from jacokin.tasks.gym.vector import ThreadedVectorEnv

gymnasium.register_envs(jacokin.tasks)
COUNT = 4


def rows(observation: Any) -> np.ndarray:
    if isinstance(observation, np.ndarray):
        return observation
    return np.concatenate([np.asarray(value, np.float64) for _, value in sorted(observation.items())], axis=-1)


@pytest.mark.parametrize(
    ("task", "options", "steps"),
    [
        ("reach_site", {}, 255),  # beyond the end of an episode
        ("place_cradle", {"goal": True, "reward": "sparse"}, 12),
        ("stack_3_bricks_random_order", {}, 12),
        ("reach_site", {"control": "tool_velocity"}, 12),
        ("lift_brick", {"randomization": Randomization(mass=Uniform(0.5, 2.0))}, 12),
    ],
)
def test_environments_equal_single_ones(task: str, options: dict[str, Any], steps: int) -> None:
    vector = make_vector(COUNT, task=task, threads=2, **options)
    singles = [TaskEnv(task, **options) for _ in range(COUNT)]
    observations, _ = vector.reset(seed=10)
    wanted = [rows(each.reset(seed=10 + index)[0]) for index, each in enumerate(singles)]
    np.testing.assert_array_equal(rows(observations), wanted)
    space, rng = vector.single_action_space, np.random.default_rng(0)
    assert isinstance(space, gymnasium.spaces.Box)
    is_over = [False] * COUNT
    for _ in range(steps):
        action = rng.uniform(space.low, space.high, (COUNT, *space.shape))
        observations, rewards, terminated, truncated, infos = vector.step(action)
        assert not terminated.any()
        for index, single in enumerate(singles):
            if is_over[index]:
                (observation, info), reward, ends = single.reset(), 0.0, False
            else:
                observation, reward, _, ends, info = single.step(action[index])
            np.testing.assert_array_equal(rows(observations)[index], rows(observation))
            assert (rewards[index], truncated[index], infos["is_success"][index]) == (reward, ends, info["is_success"])
            is_over[index] = ends
    vector.close()


def test_gymnasium_makes_vectors() -> None:
    vector: Any = gymnasium.make_vec(
        "jacokin/ReachSite-v0", num_envs=3, vectorization_mode="vector_entry_point", threads=2, reward="sparse"
    )
    observations, _ = vector.reset(seed=[1, 2, 1])
    np.testing.assert_array_equal(observations[0], observations[2])
    assert not np.array_equal(observations[0], observations[1])
    assert vector.observation_space.contains(observations)
    kept = observations.copy()
    vector.step(vector.action_space.sample())
    np.testing.assert_array_equal(observations, kept)


@pytest.mark.parametrize("kind", ["batch", "threads"])
def test_a_diverged_simulation_leaves_the_others_alone(kind: str) -> None:
    if kind == "batch" and not batched.is_available():
        pytest.skip("this version of MuJoCo has no batches")
    vector: Any = make_vector(3, task="reach_site") if kind == "batch" else ThreadedVectorEnv(3, 1, task="reach_site")
    single = TaskEnv("reach_site")
    vector.reset(seed=0)
    single.reset(seed=2)
    if kind == "batch":
        vector._inputs["qvel"][1] = 1e12
    else:
        vector._environments[1].data.qvel[:] = 1e12
    observations, rewards, _, truncated, infos = vector.step(np.zeros((3, 9)))
    np.testing.assert_array_equal(truncated, [False, True, False])
    assert infos["error"][1]
    assert np.isfinite(observations).all()
    assert rewards[1] == 0.0
    np.testing.assert_array_equal(observations[2], single.step(np.zeros(9))[0])
    observations, _, _, truncated, _ = vector.step(np.zeros((3, 9)))
    assert not truncated.any()
    assert np.isfinite(observations).all()
    np.testing.assert_array_equal(observations[2], single.step(np.zeros(9))[0])


def test_mistakes() -> None:
    vector: Any = make_vector(2, task="reach_site")
    with pytest.raises(InvalidInputError, match="call reset"):
        vector.step(np.zeros((2, 9)))
    vector.reset(seed=0)
    with pytest.raises(InvalidInputError, match="shape"):
        vector.step(np.zeros((3, 9)))
    with pytest.raises(InvalidInputError, match="NaN"):
        vector.step(np.full((2, 9), np.nan))
    with pytest.raises(InvalidInputError, match="seed must be one number, or 2"):
        vector.reset(seed=[1])
    with pytest.raises(InvalidInputError, match="does not render"):
        make_vector(2, task="reach_site", render_mode="rgb_array")
    with pytest.raises(InvalidInputError, match="threads"):
        make_vector(2, task="reach_site", threads=0)
