"""Experts solve their tasks, by the physics of the hand."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest

import jacokin.tasks
from jacokin.errors import InvalidInputError, UnknownNameError
from jacokin.tasks.experts.expert import SCRIPTS

RECORD = Path(__file__).resolve().parents[3] / "docs" / "tasks_experts.json"
PROMISED = {
    **{name: 100 for name in SCRIPTS if name.startswith("reach")},
    "lift_brick": 95,
    "place_cradle": 95,
    "place_brick": 95,
    **{name: 90 for name in SCRIPTS if name.startswith("stack_2")},
}


def solved(name: str, seeds: Iterable[int]) -> int:
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
@pytest.mark.parametrize(
    ("name", "least"),
    [("reach_top_right", 5), ("lift_brick", 5), ("place_cradle", 4), ("place_brick", 4), ("stack_2_bricks", 4)],
)
def test_experts_solve_most_episodes(name: str, least: int) -> None:
    assert solved(name, range(3, 8)) >= least


@pytest.mark.slow
def test_bricks_close_to_the_pedestal_are_placed() -> None:
    beside = (7, 10, 11, 16, 43, 65)  # seeds whose brick leaves no room between it and the pedestal for the fingers
    assert solved("place_cradle", beside) >= 5


def test_the_record_holds_every_expert_and_what_is_promised_of_them() -> None:
    if not RECORD.exists():
        pytest.skip("docs are in the repository, not in the package")
    rows = {row["name"]: row for row in json.loads(RECORD.read_text(encoding="utf-8"))}
    assert list(rows) == list(SCRIPTS)
    for name, row in rows.items():
        assert row["episodes"] == 100
        assert row["seeds"] == [0, 99]
        assert row["successes"] + len(row["failed_seeds"]) == 100
        assert 0.0 <= row["mean_return"] <= 250.0
        assert row["successes"] >= PROMISED.get(name, 0), name


def test_observations_of_dm_env_will_do() -> None:
    environment, expert = jacokin.tasks.load("reach_site", seed=0), jacokin.tasks.expert("reach_site")
    step = environment.reset()
    for _ in range(120):
        step = environment.step(expert(step.observation))
    assert step.reward == pytest.approx(1.0)


def test_the_name_of_an_environment_names_its_expert() -> None:
    observation = jacokin.tasks.load("reach_site_features", seed=0).reset().observation
    one, other = (jacokin.tasks.expert(name)(observation) for name in ("reach_site_features", "reach_site"))
    np.testing.assert_array_equal(one, other)
    with pytest.raises(UnknownNameError, match="reach_site_vision"):
        jacokin.tasks.expert("reach_site_vision")


def test_mistakes() -> None:
    with pytest.raises(UnknownNameError, match="unknown expert 'juggle'"):
        jacokin.tasks.expert("juggle")
    assert set(SCRIPTS) <= {name.removesuffix("_features") for name in jacokin.tasks.names("features")}
    with pytest.raises(InvalidInputError, match=r"features by name.*got an array of shape \(42,\)$"):
        jacokin.tasks.expert("reach_site")(np.zeros(42))
