"""The same seed gives the same episode, bit for bit: whatever was before, in any process, in both interfaces."""

from __future__ import annotations

import copy
import functools
import hashlib
import pickle
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import jacokin.tasks
from jacokin.errors import InvalidInputError, JacokinError, PhysicsError
from jacokin.tasks.registry import TASKS
from tests.programs import python
from tests.tasks.families_sample import ONE_OF_EACH_FAMILY, slow_but

ROOT = Path(__file__).resolve().parents[2]
QUICK = ("reach_site", "place_cradle", "stack_2_of_3_bricks_random_order")
CONTROLS = ("joint_velocity", "joint_position", "tool_velocity", "tool_pose")
SEED, STEPS = 11, 6
# The folder of the tests comes last: the installed package is what gets tested.
PROGRAM = """
import sys
sys.path.append(sys.argv[1])
from tests.tasks import test_determinism
for line in test_determinism.fresh_digests(sys.argv[2:]): print(line)
"""


def all_of(results: Iterable[Any]) -> bytes:
    """Every bit of nested results."""
    digest = hashlib.sha256()

    def add(value: Any) -> None:
        if isinstance(value, dict):
            for key in value:
                digest.update(str(key).encode())
                add(value[key])
        elif isinstance(value, list | tuple):
            for item in value:
                add(item)
        else:
            array = np.asarray(value)
            digest.update(str((array.dtype, array.shape)).encode())
            digest.update(repr(value).encode() if array.dtype == object else array.tobytes())

    add(list(results))
    return digest.digest()


def gym_episode(environment: Any, seed: int | None = SEED) -> bytes:
    """A reset with the seed, and steps."""
    environment.action_space.seed(seed)
    first = environment.reset(seed=seed)
    return all_of([first, *(environment.step(environment.action_space.sample()) for _ in range(STEPS))])


def dm_env_episode(environment: Any) -> bytes:
    """The next episode of the environment."""
    spec = environment.action_spec()
    actions = np.random.default_rng(SEED).uniform(spec.minimum, spec.maximum, (STEPS, *spec.shape))
    return all_of([tuple(environment.reset()), *(tuple(environment.step(action)) for action in actions)])


def fresh_digests(names: Iterable[str]) -> list[str]:
    """Of each task, dm_env's interface; of one in each family Gymnasium's too, by every control."""
    found = []
    for name in names:
        found.append(f"{name} dm_env {dm_env_episode(jacokin.tasks.load(name, seed=SEED)).hex()}")
        for control in CONTROLS if name in ONE_OF_EACH_FAMILY else ():
            environment = jacokin.tasks.TaskEnv(name, control=control, flatten=False)
            found.append(f"{name} {control} {gym_episode(environment).hex()}")
    return found


def exception(environment: Any, cause: str) -> None:
    """Let a step or a reset fail."""
    if cause == "action":
        with pytest.raises(InvalidInputError):
            environment.step("forward")
    elif cause == "divergence":
        environment.unwrapped.data.qvel[:] = 1e12
        assert "error" in environment.step(environment.action_space.sample())[4]
        with pytest.raises(PhysicsError):
            environment.step(environment.action_space.sample())
    else:
        task = environment.task
        place, task.place_tool = task.place_tool, fail
        with pytest.raises(JacokinError, match="none"):
            environment.reset(seed=3)
        task.place_tool = place


def fail(*arguments: Any, **options: Any) -> Any:
    raise PhysicsError("none of 10 poses")


@pytest.mark.parametrize("name", slow_but(dict.fromkeys((*QUICK, *ONE_OF_EACH_FAMILY)), QUICK[-1:]))
def test_fresh_and_reused_environments_give_the_same_episodes(name: str) -> None:
    for control in CONTROLS:
        make = functools.partial(jacokin.tasks.TaskEnv, name, control=control)
        environment = make()
        wanted = gym_episode(environment)
        assert gym_episode(environment, seed=5) != wanted
        environment.step(environment.action_space.sample())
        assert gym_episode(environment) == wanted
        copies: list[Callable[[Any], Any]] = [copy.copy, copy.deepcopy, lambda each: pickle.loads(pickle.dumps(each))]
        assert all(gym_episode(twin(environment)) == wanted for twin in copies)
    reused = jacokin.tasks.load(name, seed=SEED)
    first, second = dm_env_episode(reused), dm_env_episode(reused)
    assert first != second
    fresh = jacokin.tasks.load(name, seed=SEED)
    assert dm_env_episode(fresh) == first
    fresh.step(np.ones(9))
    assert dm_env_episode(copy.deepcopy(fresh)) == second
    assert dm_env_episode(fresh) == second


@pytest.mark.one_quick
@pytest.mark.parametrize("cause", ["action", "divergence", "no initial state"])
@pytest.mark.parametrize("control", CONTROLS)
def test_an_exception_changes_no_later_episode(control: str, cause: str) -> None:
    environment = jacokin.tasks.TaskEnv("reach_duplo", control=control)
    wanted = gym_episode(environment)
    exception(environment, cause)
    assert gym_episode(environment) == wanted


@pytest.mark.slow
def test_another_process_gives_the_same_episodes() -> None:
    names = sorted(TASKS)
    wanted = fresh_digests(names)
    assert python("-c", PROGRAM, ROOT, *names, environment={"PYTHONHASHSEED": "7"}).stdout.splitlines() == wanted
