"""Learn to reach, with nothing but numpy: evolution strategies on a linear policy.

python -m examples.learn_reach

The tool is moved by its velocity (control="tool_velocity"): the way from the tool to the target is linear in what is
observed, which it is not in the velocities of the joints. The rewards are the task's own. They are below 1e-3 from
0.14 m on, so only their order counts: which of two opposite changes of the policy did better from the same start.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import gymnasium
import matplotlib.figure
import numpy as np

import jacokin.tasks
from jacokin.arrays import Array

NOISE = 0.7  # of the weights
STEP, MOMENTUM = 0.7, 0.8
TRAINED_STEPS, EPISODE_STEPS = 60, 250  # 60 steps are 0.6 m at the tool's speed
MOVED = 3  # of the seven actions: the linear velocity; the tool keeps its orientation and its fingers
OBSERVED = ("target_position", "jaco_arm/jaco_hand/pinch_site_pos")  # what the policy uses of the observation [m]
FRESH_SEED = 1_000_000  # of the episodes on which policies are compared; training uses smaller ones
EVERY = 10  # generations between two comparisons

gymnasium.register_envs(jacokin.tasks)

Observation = Mapping[str, Array]


class Policy:
    """Velocities of the tool, linear in the normalised observations."""

    def __init__(self, scale: Array) -> None:
        """Begin with no motion; `scale` (7,) has the largest action."""
        self.weights = np.zeros((MOVED, 3 * len(OBSERVED) + 1))
        self.scale = scale
        self._count, self._mean, self._squares = 1e-2, np.zeros(3 * len(OBSERVED)), np.full(3 * len(OBSERVED), 1e-4)

    def look(self, observation: Observation) -> None:
        """Take observations (n, ...) into the mean and the deviation by which they are normalised."""
        for x in np.hstack([observation[name] for name in OBSERVED]):
            self._count += 1.0
            delta = x - self._mean
            self._mean = self._mean + delta / self._count
            self._squares = self._squares + delta * (x - self._mean)

    def act(self, observation: Observation, weights: Array) -> Array:
        """Actions (n, 7) of weights (3, k), or (n, 3, k): one policy for each environment."""
        x = np.hstack([observation[name] for name in OBSERVED])
        x = np.hstack([(x - self._mean) / np.sqrt(self._squares / self._count), np.ones((len(x), 1))])
        part = np.clip(np.einsum("...ak,...k->...a", weights, x), -1.0, 1.0)
        return np.asarray(self.scale * np.pad(part, ((0, 0), (0, len(self.scale) - MOVED))))


def returns(envs: Any, seeds: Sequence[int], steps: int, act: Callable[[Observation], Array]) -> Array:
    """The sum of rewards (n,) of one episode in each environment."""
    observation, _ = envs.reset(seed=list(seeds))
    total = np.zeros(len(seeds))
    for _ in range(steps):
        observation, rewards, *_ = envs.step(act(observation))
        total += rewards
    return total


def expert_return(seeds: Sequence[int]) -> float:
    """The mean return of the scripted expert."""
    env, expert = gymnasium.make("jacokin/ReachSite-v0", flatten=False), jacokin.tasks.expert("reach_site")
    total = 0.0
    for seed in seeds:
        (observation, _), is_over = env.reset(seed=seed), False
        expert.reset()
        while not is_over:
            observation, reward, _, is_over, _ = env.step(expert(observation))
            total += float(reward)
    return total / len(seeds)


def learn(generations: int, pairs: int = 32, seed: int = 0) -> tuple[dict[str, float], list[tuple[int, float]]]:
    """The mean returns of random actions, of the expert and of what was learned, and those on the way there."""
    envs: Any = gymnasium.make_vec(
        "jacokin/ReachSite-v0",
        num_envs=2 * pairs,
        vectorization_mode="vector_entry_point",
        control="tool_velocity",
        flatten=False,
        threads=2,
    )
    rng = np.random.default_rng(seed)
    low, high = envs.action_space.low, envs.action_space.high
    policy = Policy(high[0])
    fresh = range(FRESH_SEED, FRESH_SEED + envs.num_envs)
    found = {"random": float(returns(envs, fresh, EPISODE_STEPS, lambda _: rng.uniform(low, high)).mean())}
    found["expert"] = expert_return(fresh)
    curve, velocity, started = list[tuple[int, float]](), np.zeros_like(policy.weights), time.perf_counter()
    for generation in range(1, generations + 1):
        noise = rng.normal(size=(pairs, *policy.weights.shape))
        candidates = policy.weights + NOISE * np.concatenate([noise, -noise])

        def act(observation: Observation, candidates: Array = candidates) -> Array:
            policy.look(observation)
            return policy.act(observation, candidates)

        starts = rng.integers(FRESH_SEED, size=pairs).tolist()  # the same for both of a pair
        better, worse = returns(envs, starts * 2, TRAINED_STEPS, act).reshape(2, pairs)
        rank = np.sign(better - worse) * (np.abs(better - worse).argsort().argsort() + 1) / pairs
        velocity = MOMENTUM * velocity + (1.0 - MOMENTUM) * np.tensordot(rank, noise, 1) / np.sqrt(pairs)
        policy.weights += STEP * velocity
        if generation % EVERY == 0 or generation == generations:
            mean = float(returns(envs, fresh, EPISODE_STEPS, lambda seen: policy.act(seen, policy.weights)).mean())
            curve.append((generation, mean))
            print(f"generation {generation}: mean return {mean:.1f}, {time.perf_counter() - started:.0f} s", flush=True)
    envs.close()
    return {**found, "learned": curve[-1][1]}, curve


def draw(found: Mapping[str, float], curve: Sequence[tuple[int, float]], path: Path) -> None:
    """Draw the learning curve between the returns of random actions and of the expert."""
    figure = matplotlib.figure.Figure(figsize=(6, 4), layout="constrained")
    axes = figure.subplots()
    axes.plot(*zip(*curve, strict=True), marker="o", label="learned")
    for name, style in (("expert", "--"), ("random", ":")):
        axes.axhline(found[name], linestyle=style, color="gray", label=name)
    axes.set(xlabel="generation", ylabel="mean return of fresh episodes", title="Reaching with a linear policy")
    axes.legend()
    figure.savefig(path, dpi=150)


def main() -> None:
    parser = argparse.ArgumentParser(description="Learn to reach.")
    parser.add_argument("--generations", type=int, default=80)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--output", type=Path, default=Path("learn_reach.png"))
    options = parser.parse_args()
    found, curve = learn(options.generations, seed=options.seed)
    draw(found, curve, options.output)
    print(", ".join(f"{name} {value:.1f}" for name, value in found.items()), end="")
    print(f": {100.0 * found['learned'] / found['expert']:.0f} % of the expert's return; wrote {options.output}")


if __name__ == "__main__":
    main()
