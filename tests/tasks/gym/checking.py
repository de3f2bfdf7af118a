"""Gymnasium's own checks of one environment, and that copies of it go on as it does. Also run by `render_program`."""

from __future__ import annotations

import copy
import pickle
import warnings
from typing import Any

import gymnasium
import numpy as np
from gymnasium.envs.mujoco.utils import check_mujoco_reset_state
from gymnasium.utils.env_checker import check_env, data_equivalence
from gymnasium.utils.env_match import check_environments_match

import jacokin.tasks
from jacokin.tasks.gym.registration import IDS

gymnasium.register_envs(jacokin.tasks)

FEATURE_OPTIONS: dict[str, dict[str, Any]] = {
    "plain": {},
    "sparse": {"reward": "sparse"},
    "joint_position": {"control": "joint_position"},
    "joint_delta": {"control": "joint_delta"},
    "tool_velocity": {"control": "tool_velocity"},
    "tool_pose": {"control": "tool_pose"},
    "goal": {"goal": True},
    "by name": {"flatten": False},
    "sparse goal, tool_velocity": {"goal": True, "reward": "sparse", "control": "tool_velocity"},
}
RENDER_OPTIONS: dict[str, dict[str, Any]] = {
    "vision, rgb_array": {"observations": "vision", "render_mode": "rgb_array", "width": 64, "height": 48},
    "depth_array, goal": {"render_mode": "depth_array", "width": 64, "height": 48, "goal": True},
}
BEFORE, AFTER = 2, 2  # steps before and after a copy is made


def make(task: str, **options: Any) -> gymnasium.Env[Any, Any]:
    """An environment as users make it."""
    return _quick(gymnasium.make(IDS[task], **options))


def _quick(environment: gymnasium.Env[Any, Any]) -> gymnasium.Env[Any, Any]:
    """The same with pictures of lower quality, which processors draw in a quarter of the time."""
    quality = environment.unwrapped.model.vis.quality  # type: ignore[attr-defined]  # of our environments
    quality.shadowsize, quality.offsamples = 256, 0
    return environment


def check(task: str, options: dict[str, Any]) -> None:
    """What Gymnasium checks."""
    environment = make(task, **options)
    with warnings.catch_warnings():
        # Velocities have no bounds, and actions are in rad/s.
        warnings.filterwarnings("ignore", ".*infinity|.*symmetric and normalized")
        check_env(environment.unwrapped, skip_render_check=True)  # which wants a window
    check_mujoco_reset_state(environment)  # type: ignore[arg-type]  # has `model` and `data` as a MujocoEnv
    if environment.render_mode is None:  # otherwise many pictures, which `check_copies` compares too
        check_environments_match(environment, make(task, **options), num_steps=2)


def check_copies(task: str, options: dict[str, Any]) -> None:
    """Copies made in the middle of an episode go on in the same way, through the next reset too."""
    environment = make(task, **options)
    environment.reset(seed=3)
    environment.action_space.seed(0)
    for _ in range(BEFORE):
        environment.step(environment.action_space.sample())
    copies = [pickle.loads(pickle.dumps(environment))]
    if environment.render_mode is None:
        copies += [copy.deepcopy(environment), copy.copy(environment.unwrapped)]
    actions = [environment.action_space.sample() for _ in range(AFTER)]
    wanted = _results(environment, actions)
    for each in copies:
        assert data_equivalence(_results(_quick(each), actions), wanted, exact=True)


def _results(environment: gymnasium.Env[Any, Any], actions: list[Any]) -> list[Any]:
    """All that steps, a reset and a step return, and pictures where there are any."""
    found: list[Any] = [environment.step(action) for action in actions]
    found += [environment.reset(), environment.step(actions[0])]
    if environment.render_mode is not None:
        picture = environment.render()
        assert isinstance(picture, np.ndarray)
        assert picture.std() > 0.0
        found.append(picture)
    return found
