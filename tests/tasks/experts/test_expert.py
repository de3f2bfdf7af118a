"""Experts solve their tasks, by the physics of the hand."""

from __future__ import annotations

import numpy as np
import pytest

import jacokin.tasks
from jacokin.errors import InvalidInputError, UnknownNameError
from jacokin.tasks.experts.expert import SCRIPTS


def solved(name: str, seeds: range) -> int:
    environment = jacokin.tasks.TaskEnv(name, flatten=False)
    expert, count = jacokin.tasks.expert(name), 0
    for seed in seeds:
        observation, info = environment.reset(seed=seed)
        expert.reset()
        is_over = False
        while not is_over:
            observation, _, _, is_over, info = environment.step(expert(observation))
        count += info["is_success"]
    return count


@pytest.mark.parametrize(("name", "least"), [("reach_site", 3), ("reach_top_left", 3), ("lift_brick", 3)])
def test_experts_solve_their_tasks(name: str, least: int) -> None:
    assert solved(name, range(3)) >= least


@pytest.mark.slow
@pytest.mark.parametrize(("name", "least"), [("reach_duplo", 20), ("lift_brick", 19), ("place_cradle", 12)])
def test_experts_solve_most_episodes(name: str, least: int) -> None:
    assert solved(name, range(20)) >= least


def test_observations_of_dm_env_will_do() -> None:
    environment, expert = jacokin.tasks.load("reach_site", seed=0), jacokin.tasks.expert("reach_site")
    step = environment.reset()
    for _ in range(120):
        step = environment.step(expert(step.observation))
    assert step.reward == pytest.approx(1.0)


def test_mistakes() -> None:
    with pytest.raises(UnknownNameError, match="unknown expert 'juggle'"):
        jacokin.tasks.expert("juggle")
    assert set(SCRIPTS) <= {name.removesuffix("_features") for name in jacokin.tasks.names("features")}
    with pytest.raises(InvalidInputError, match="features by name"):
        jacokin.tasks.expert("reach_site")(np.zeros(42))
