"""`replay`: the episodes of a data set again, compared with what was recorded."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

from jacokin.errors import InvalidInputError
from jacokin.files import parsing
from jacokin.model import checks
from jacokin.mujoco_bridge.arena import DM_CONTROL
from jacokin.tasks import registry
from jacokin.tasks.datasets.recorded import NOT_OURS, Recorded
from jacokin.tasks.datasets.recording import FORMATS, FUNCTION, KEPT, checked_environment, run_actions
from jacokin.tasks.gym.environment import TaskEnv
from jacokin.tasks.gym.registration import IDS


@dataclass(frozen=True, slots=True)
class Replayed:
    """How an episode of a data set went when it was run again."""

    episode: int
    """Its number."""
    seed: int
    """From which it was reset."""
    success: bool
    """Whether it was solved at its end, now."""
    is_equal: bool
    """Whether observations, actions, rewards, success and states are those of the recording, bit by bit."""
    largest_difference: float
    """Of the states; infinite where there are more or fewer of them, or one is not a number."""
    differing: tuple[str, ...]
    """The names of what is not equal."""


def replay(
    path: str | Path,
    *,
    env: gymnasium.Env[Any, Any] | None = None,
    render_mode: str | None = None,
    watch: Callable[[TaskEnv], None] | None = None,
) -> list[Replayed]:
    """Run the episodes of a data set again: from their seeds, by their actions.

    On the version of MuJoCo and of jacokin that recorded them, they are equal bit by bit. An episode that was recorded
    with fewer steps than the environment's are run as far as it goes.

    Args:
        path: what `record` wrote.
        env: the environment; None to make it as the data set says.
        render_mode: of the environment that is made.
        watch: called with the environment after each reset and each step, to render it, for example.

    Raises:
        InvalidInputError: no such data set, or it is damaged; or its environment has a function as its reward, and env
            is None; or its actions are not those of the environment.
        UnknownNameError: the task of the data set is not registered.
    """
    source = checks.path("path", path)
    checks.optional(checks.function, "watch", watch)
    with parsing(source, NOT_OURS):
        is_there = source.exists()
    if source.suffix not in FORMATS or not is_there:
        raise InvalidInputError(f"path must be a data set that is there, ending in {', '.join(FORMATS)}, got {source}")
    description, episodes = importlib.import_module(f"jacokin.tasks.datasets.{FORMATS[source.suffix]}").read(source)
    made = _make(source, description, render_mode) if env is None else checked_environment(env)
    look = (lambda: None) if watch is None else (lambda: watch(made))
    return [_again(f"{source}: episode {number + 1}", number, each, made, look) for number, each in enumerate(episodes)]


def _make(source: Path, description: dict[str, Any], render_mode: str | None) -> TaskEnv:
    kwargs = dict(description["kwargs"])
    if kwargs["reward"] == FUNCTION:
        raise InvalidInputError(f"{source}: its reward is a function, which it does not hold: give env=...")
    name = description["id"]
    task = {identifier: task for task, identifier in IDS.items()}.get(name, name)
    checks.choice("task", task, registry.TASKS)
    for option in kwargs:
        checks.choice(f"option of the environment of {source}", option, KEPT)
    kwargs.setdefault("contact", DM_CONTROL)  # before it was an option
    with parsing(source, NOT_OURS):
        return TaskEnv(task, render_mode=render_mode, **kwargs)


def _again(place: str, number: int, recorded: Recorded, env: TaskEnv, look: Callable[[], None]) -> Replayed:
    shape = env.action_space.shape
    if recorded.actions.shape[1:] != shape:
        raise InvalidInputError(
            f"{place} has actions of {recorded.actions.shape[1]} numbers, and the environment takes actions of shape "
            f"{shape} (control={env.options.control!r})"
        )
    try:
        now = run_actions(env, recorded, look)
    except InvalidInputError as error:
        raise InvalidInputError(f"{place} cannot be run again: {error}") from error
    found = recorded.differences(now)
    difference = np.inf
    if recorded.states.shape == now.states.shape:
        difference = float(np.nan_to_num(np.abs(recorded.states - now.states), nan=np.inf, posinf=np.inf).max())
    if "states" not in found:
        difference = 0.0
    return Replayed(number, recorded.seed, bool(now.success[-1]), not found, difference, tuple(found))
