"""Tasks as environments of dm_env: specifications, copies, ends; see `test_determinism` and `test_mistakes` too."""

from __future__ import annotations

import copy
import pickle

import dm_env
import numpy as np
import pytest

import jacokin.tasks
from jacokin.errors import UnknownNameError
from jacokin.tasks import Environment
from jacokin.tasks.registry import TASKS
from tests.programs import run_drawing

FEATURES = jacokin.tasks.names("features")
QUICK = ("reach_site", "lift_brick", "place_cradle", "stack_3_bricks_random_order")


def actions(environment: Environment, count: int, seed: int = 0) -> list[np.ndarray]:
    spec = environment.action_spec()
    return list(np.random.default_rng(seed).uniform(spec.minimum, spec.maximum, (count, *spec.shape)))


def same(one: dm_env.TimeStep, other: dm_env.TimeStep) -> bool:
    return (
        one.step_type == other.step_type
        and one.reward == other.reward
        and list(one.observation) == list(other.observation)
        and all(np.array_equal(one.observation[key], other.observation[key]) for key in one.observation)
    )


def test_names_and_tags() -> None:
    ours = [name for name in jacokin.tasks.names() if "/" not in name]  # other tests register tasks of their own
    assert len(ours) == 25 + 8
    assert len([name for name in jacokin.tasks.names("features") if "/" not in name]) == 13 + 4
    assert set(jacokin.tasks.names("easy")) > {"reach_site_features", "reach_duplo_vision"}
    with pytest.raises(UnknownNameError, match="unknown tag 'hard'"):
        jacokin.tasks.names("hard")


@pytest.mark.one_quick
@pytest.mark.parametrize("name", FEATURES)
def test_steps_are_as_specified(name: str) -> None:
    environment = jacokin.tasks.load(name, seed=0)
    model = environment.physics.model
    spec = environment.observation_spec()
    for _ in range(2):
        step = environment.reset()
        assert step.first()
        assert step.reward is step.discount is None
        assert environment.physics.time == 0.0
        for action in [None, *actions(environment, 2)]:
            if action is not None:
                step = environment.step(action)
                assert 0.0 <= environment.reward_spec().validate(step.reward) <= 1.0
                assert environment.discount_spec().validate(step.discount) == 1.0
            assert list(step.observation) == list(spec)
            for key, value in step.observation.items():
                spec[key].validate(value)
                assert np.isfinite(value).all()
    assert environment.physics.model is model  # nothing is compiled anew


@pytest.mark.one_quick
@pytest.mark.parametrize("name", QUICK)
def test_copies_go_on_in_the_middle_of_an_episode(name: str) -> None:
    environment = jacokin.tasks.load(name, seed=2)
    environment.reset()
    for action in actions(environment, 4):
        environment.step(action)
    copies = [pickle.loads(pickle.dumps(environment)), copy.deepcopy(environment), copy.copy(environment)]
    for action in actions(environment, 4, seed=5):
        step = environment.step(action)
        assert all(same(each.step(action), step) for each in copies)
    again = environment.reset()
    assert all(same(each.reset(), again) for each in copies)


def test_episodes_end_after_ten_seconds() -> None:
    environment = jacokin.tasks.load("reach_site", seed=0)
    assert environment.step(np.zeros(9)).first()  # there was no episode yet
    steps = [environment.step(np.zeros(9)) for _ in range(250)]
    assert [step.last() for step in steps] == [False] * 249 + [True]
    assert steps[-1].discount == 1.0
    assert environment.physics.time == pytest.approx(10.0)
    assert environment.step(np.zeros(9)).first()


def test_observations_are_not_views_of_the_simulation() -> None:
    environment = jacokin.tasks.load("lift_brick", seed=0)
    first = environment.reset()
    before = copy.deepcopy(first.observation)
    environment.step(np.ones(9))
    assert all(np.array_equal(first.observation[key], before[key]) for key in before)


def test_mistakes_in_names() -> None:
    with pytest.raises(UnknownNameError, match="Did you mean 'reach_site_features'"):
        jacokin.tasks.load("reach_sit_features")
    with pytest.raises(UnknownNameError, match="stack_3_bricks_random_order_vision"):
        jacokin.tasks.load("stack_3_bricks_random_order_vision")


def test_the_wanted_order_and_the_fixed_brick_vary_without_recompiling() -> None:
    environment = jacokin.tasks.load("stack_3_bricks_random_order", seed=0)
    model, bases = environment.physics.model, set()
    for _ in range(20):
        observation = environment.reset().observation
        order = observation["desired_order"][0].astype(int)
        bases.add(int(order[0]))
        keys = ["duplo2x4", "duplo2x4_2", "duplo2x4_4"]
        observation = environment.step(np.zeros(9)).observation
        still = [not observation[f"{key}/linear_velocity"].any() for key in keys]
        assert still[order[0]]
        assert sum(still) == 1
    assert bases == {0, 1, 2}
    assert environment.physics.model is model


def test_a_reassembled_stack_is_built_at_first() -> None:
    task = jacokin.tasks.load("reassemble_3_bricks_fixed_order", seed=0)
    task.reset()
    reward = task.step(np.zeros(9)).reward
    assert reward is not None
    assert reward < 1e-6  # 0, 2, 1 is wanted, 0, 1, 2 is there
    names = TASKS["reassemble_3_bricks_fixed_order"]
    assert names.observations == ("features", "vision")


@pytest.mark.slow
def test_pictures_instead_of_props() -> None:
    code = (
        "import numpy as np, jacokin.tasks; e = jacokin.tasks.load('stack_2_bricks_vision', seed=0); o = e.reset();"
        "s = e.observation_spec(); assert list(s) == list(o.observation); [s[k].validate(o.observation[k]) for k in s];"
        "f = jacokin.tasks.load('stack_2_bricks', seed=0); f.reset(); a = e.step(np.ones(9)); b = f.step(np.ones(9));"
        "assert a.reward == b.reward; assert a.observation['front_close'].std() > 10; print(list(s)[0], len(s))"
    )
    assert run_drawing("-c", code).split() == ["front_close", "8"]


@pytest.mark.slow
def test_pictures_of_gymnasium() -> None:
    code = (
        "import copy, gymnasium, numpy as np, jacokin.tasks; make = gymnasium.make\n"
        "e = make('jacokin/LiftBrick-v0', observations='vision', render_mode='rgb_array', width=64, height=48)\n"
        "o, _ = e.reset(seed=0); assert e.observation_space.contains(o); frame = e.render()\n"
        "o2 = e.step(np.ones(9))[0]\n"
        "f = make('jacokin/LiftBrick-v0', render_mode='depth_array', height=96); f.reset(seed=0); depth = f.render()\n"
        "p = f.step(np.ones(9))[0]; assert frame.shape == (48, 64, 3) and frame.std() > 10\n"
        "assert depth.shape == (96, 480) and depth.dtype == np.float32 and 0.2 < depth.min() < depth.max()\n"
        "assert np.array_equal(o2['proprioception'], p[: o2['proprioception'].size])  # pictures change nothing\n"
    )
    run_drawing("-W", "ignore", "-c", code)
