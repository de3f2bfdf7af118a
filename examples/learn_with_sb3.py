"""Learn by reinforcement with Stable-Baselines3, in a vector of environments.

python -m examples.learn_with_sb3 reach
python -m examples.learn_with_sb3 lift
python -m examples.learn_with_sb3 lift_her

`pip install stable-baselines3` brings it, and PyTorch; `lift` needs jacokin[data] too. A recipe is a row of `RECIPES`:
its task, its algorithm and the settings that differ from the library's. `lift` begins with a policy that is cloned from
the expert. It prints what is reached on fresh seeds, and draws the learning curve.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium
import matplotlib.figure
import numpy as np
import torch
from gymnasium import spaces
from stable_baselines3 import PPO, SAC, HerReplayBuffer
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecEnv, VecNormalize

from examples import clone_expert
from jacokin.arrays import Array

FRESH_SEED = 1_000_000  # of the episodes on which policies are compared; training uses smaller ones
FRESH = 50  # episodes
POINTS = 4  # of the learning curve
FITS, FIT_BATCH, FIT_RATE = 6_000, 256, 1e-3  # steps of cloning


@dataclass(frozen=True, slots=True)
class Recipe:
    """How a task is learned.

    Attributes:
        task: id of the environment.
        options: of the environment.
        algorithm: of Stable-Baselines3.
        settings: of the algorithm.
        count: environments in the vector.
        episode: control steps of an episode while learning.
        steps: control steps of all environments.
        cloned: task of `clone_expert` whose expert the policy is fitted to before; "" for none.
        values: control steps at the start in which only values are learned: a cloned policy is lost by wrong ones.
    """

    task: str
    options: dict[str, Any]
    algorithm: Any
    settings: dict[str, Any]
    count: int
    episode: int
    steps: int
    cloned: str = ""
    values: int = 0


RECIPES = {
    "reach": Recipe(
        "jacokin/ReachSite-v0",
        {"control": "tool_velocity"},
        PPO,
        {"n_steps": 100, "batch_size": 800, "n_epochs": 10, "gamma": 0.98, "learning_rate": 5e-4},
        count=32,
        episode=100,
        steps=300_000,
    ),
    "lift": Recipe(
        "jacokin/LiftBrick-v0",
        {"control": "tool_velocity", "flatten": False},
        PPO,
        {
            "n_steps": 250,
            "batch_size": 1_000,
            "n_epochs": 8,
            "learning_rate": 2e-4,
            "target_kl": 0.03,
            "policy_kwargs": {"net_arch": [256, 256], "activation_fn": torch.nn.ReLU, "log_std_init": -2.0},
        },
        count=32,
        episode=250,
        steps=600_000,
        cloned="lift",
        values=48_000,
    ),
    "lift_her": Recipe(
        "jacokin/LiftBrick-v0",
        {"control": "tool_velocity", "reward": "sparse", "goal": True},
        SAC,
        {
            "batch_size": 256,
            "gamma": 0.98,
            "ent_coef": "auto_0.1",
            "learning_starts": 4_000,
            "train_freq": 1,
            "gradient_steps": 4,
            "replay_buffer_class": HerReplayBuffer,
            "replay_buffer_kwargs": {"n_sampled_goal": 4, "goal_selection_strategy": "future"},
        },
        count=8,
        episode=250,
        steps=200_000,
    ),
}


class Vector(VecEnv):  # type: ignore[misc]  # Stable-Baselines3 is not installed where types are checked
    """Environments of jacokin as Stable-Baselines3 has them: actions in -1..1, single precision."""

    def __init__(self, task: str, count: int, episode: int, seed: int, **options: Any) -> None:
        """Make them; `episode` is the number of control steps after which they start anew."""
        self._envs: Any = gymnasium.make_vec(
            f"jacokin.tasks:{task}",
            num_envs=count,
            vectorization_mode="vector_entry_point",
            max_episode_steps=episode,
            autoreset_mode="SameStep",
            threads=2,
            **options,
        )
        space: Any = self._envs.single_action_space
        self._low, self._range = space.low, space.high - space.low
        seen = _single(self._envs.single_observation_space)
        super().__init__(count, seen, spaces.Box(-1, 1, space.shape))
        self._seed: int | None = seed
        self._actions = np.zeros((count, *space.shape))

    def reset(self) -> Any:
        """Start all episodes."""
        observations, _ = self._envs.reset(seed=self._seed)
        self._seed = None
        return _cast(observations)

    def step_async(self, actions: Array) -> None:
        """Keep the actions in -1..1."""
        self._actions = self._low + (np.asarray(actions, dtype=np.float64) + 1.0) / 2.0 * self._range

    def scaled(self, actions: Array) -> Array:
        """Actions of the environments in -1..1."""
        return np.asarray(2.0 * (actions - self._low) / self._range - 1.0)

    def step_wait(self) -> Any:
        """Apply them."""
        observations, rewards, _, truncated, found = self._envs.step(self._actions)
        infos = [{"is_success": bool(each)} for each in found.get("is_success", np.zeros(self.num_envs))]
        for index in np.flatnonzero(truncated).tolist():
            infos[index] = {
                "terminal_observation": _last(found["final_obs"][index]),
                "TimeLimit.truncated": True,
                "is_success": bool(found["final_info"]["is_success"][index]),
            }
        return _cast(observations), rewards.astype(np.float32), truncated, infos

    def env_method(self, name: str, *args: Any, indices: Any = None, **kwargs: Any) -> list[Any]:
        """Call a method, such as ``compute_reward``, which is the same of all."""
        return [getattr(self._envs._first, name)(*args)]

    def get_attr(self, name: str, indices: Any = None) -> list[Any]:
        """An attribute of all."""
        return [getattr(self._envs._first, name, None)] * self.num_envs

    def set_attr(self, name: str, value: Any, indices: Any = None) -> None:
        """Nothing is to be set."""
        raise AttributeError(name)

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """None is."""
        return [False] * self.num_envs

    def close(self) -> None:
        """Free them."""
        self._envs.close()


def _cast(observations: Any) -> Any:
    """Observations of many in single precision; features by name become what a cloned network sees."""
    if not isinstance(observations, dict):
        return np.asarray(observations, dtype=np.float32)
    if "observation" in observations:  # with goals
        return {name: _cast(each) for name, each in observations.items()}
    return clone_expert.look(observations)


def _last(observation: Any) -> Any:
    """The same of one."""
    if not isinstance(observation, dict):
        return _cast(observation)
    found = _cast({name: each[None] for name, each in observation.items()})
    return {name: each[0] for name, each in found.items()} if isinstance(found, dict) else found[0]


def _single(space: Any) -> Any:
    """The space of what `_last` gives."""
    found = _last(space.sample())
    if isinstance(found, dict):
        return spaces.Dict({name: _box(each) for name, each in found.items()})
    return _box(found)


def _box(values: Array) -> Any:
    return spaces.Box(-np.inf, np.inf, values.shape, np.float32)


def evaluate(recipe: Recipe, act: Callable[[Any], Array], episodes: int = FRESH) -> tuple[Array, Array]:
    """Returns (n,) of whole episodes with fresh seeds, and whether they were solved at their end."""
    envs = Vector(recipe.task, episodes, 250, FRESH_SEED, **recipe.options)
    observations, total = envs.reset(), np.zeros(episodes)
    for _ in range(250):
        observations, rewards, _, infos = envs.step(act(observations))
        total += rewards
    envs.close()
    return total, np.array([info["is_success"] for info in infos])


class Progress(BaseCallback):  # type: ignore[misc]  # likewise
    """Evaluates the policy at times, and keeps the curve."""

    def __init__(self, recipe: Recipe, normal: VecNormalize, path: Path) -> None:
        """Write the policy and the curve to a path without ending."""
        super().__init__()
        self._recipe, self._normal, self._path = recipe, normal, path
        self.curve: list[tuple[int, float, float]] = []
        self._started = time.process_time()
        self._next = 0

    def _on_step(self) -> bool:
        if self.num_timesteps >= self._next:
            self._next += self._recipe.steps // POINTS
            self.look()
        return True

    def look(self) -> None:
        """Evaluate the policy as it is."""
        total, solved = evaluate(self._recipe, self.act)
        self.curve.append((self.num_timesteps, float(total.mean()), float(solved.mean())))
        print(
            f"{self.num_timesteps} steps, {time.process_time() - self._started:.0f} s of processor time: "
            f"mean return {total.mean():.1f}, solved {100.0 * solved.mean():.0f} %",
            flush=True,
        )
        self.model.save(self._path)
        draw(self.curve, self._path.with_suffix(".png"))

    def act(self, observations: Any) -> Array:
        """The actions of the policy, without its noise."""
        found, _ = self.model.predict(self._normal.normalize_obs(observations), deterministic=True)
        return np.asarray(found)


def draw(curve: Sequence[tuple[int, float, float]], path: Path) -> None:
    """Draw the learning curve."""
    figure = matplotlib.figure.Figure(figsize=(6, 4), layout="constrained")
    axes = figure.subplots()
    steps, means, solved = zip(*curve, strict=True)
    axes.plot(steps, means, marker="o", label="mean return")
    axes.set(xlabel="control steps", ylabel="mean return of fresh episodes")
    right = axes.twinx()
    right.plot(steps, np.array(solved) * 100.0, color="tab:green", linestyle=":", label="solved")
    right.set(ylabel="solved [%]", ylim=(0, 100))
    figure.savefig(path, dpi=150)


def clone(model: Any, vector: Vector, normal: VecNormalize, task: str, path: Path) -> None:
    """Fit a policy to what the expert of a task does, and keep observations normalized by what was seen there."""
    clone_expert.record(task, path, 200)
    inputs, outputs = (np.concatenate(each) for each in zip(*clone_expert.demonstrations(path), strict=True))
    normal.obs_rms.update(inputs)
    normal.training = False
    x = torch.as_tensor(normal.normalize_obs(inputs), dtype=torch.float32)
    y = torch.as_tensor(vector.scaled(outputs), dtype=torch.float32)
    optimizer = torch.optim.Adam(model.policy.parameters(), FIT_RATE)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, FITS)
    for _ in range(FITS):
        rows = torch.randint(len(x), (FIT_BATCH,))
        mean = model.policy.get_distribution(x[rows]).distribution.mean
        loss = torch.nn.functional.huber_loss(mean, y[rows], delta=0.2)
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        schedule.step()


def learn(recipe: Recipe, path: Path, seed: int) -> None:
    """Learn a task, and write the policy and its curve to a path without ending."""
    torch.set_num_threads(1)  # networks are small, and the simulation has the other cores
    vector = Vector(recipe.task, recipe.count, recipe.episode, seed, **recipe.options)
    normal = VecNormalize(vector, norm_reward=False)
    policy = "MultiInputPolicy" if recipe.options.get("goal") else "MlpPolicy"
    model = recipe.algorithm(policy, normal, seed=seed, device="cpu", **recipe.settings)
    progress = Progress(recipe, normal, path)
    if recipe.cloned:
        clone(model, vector, normal, recipe.cloned, path.with_suffix(".hdf5"))
        layers = model.policy.mlp_extractor.policy_net, model.policy.action_net
        actor = [model.policy.log_std, *layers[0].parameters(), *layers[1].parameters()]
        for each in actor:
            each.requires_grad_(False)
        model.learn(recipe.values, callback=progress)
        for each in actor:
            each.requires_grad_(True)
    model.learn(recipe.steps - recipe.values, callback=progress, reset_num_timesteps=not recipe.cloned)
    progress.look()
    normal.save(str(path.with_suffix(".normal")))


def main() -> None:
    parser = argparse.ArgumentParser(description="Learn by reinforcement.")
    parser.add_argument("recipe", choices=RECIPES)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--output", type=Path, default=Path("learn_with_sb3"))
    options = parser.parse_args()
    learn(RECIPES[options.recipe], options.output, options.seed)


if __name__ == "__main__":
    main()
