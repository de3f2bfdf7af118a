"""Behaviour cloning with nothing but numpy: record an expert, fit networks to what it did, let these act.

python -m examples.clone_expert lift

A network of four layers sees where the tool is, how it moves, and where things are from the tool. It says how tool and
fingers are to move in the next steps; a weighted mean of what it has said for a step, now and before, is applied. The
mean of what several networks say is better than any of them.
"""

from __future__ import annotations

import argparse
import itertools
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium
import h5py
import matplotlib.figure
import numpy as np
from numpy.typing import NDArray

import jacokin.tasks

TASKS = {  # id, and name of the expert
    "reach": ("jacokin/ReachSite-v0", "reach_site"),
    "lift": ("jacokin/LiftBrick-v0", "lift_brick"),
    "place": ("jacokin/PlaceBrick-v0", "place_brick"),
}
CONTROL = "tool_velocity"
NOISE = 0.1  # [rad/s] on the velocities of the actuators, so that the expert shows how to come back
FRESH_SEED = 1_000_000  # of the episodes on which policies are compared; demonstrations use smaller ones
ARM, HAND = "jaco_arm/", "jaco_arm/jaco_hand/"
THINGS = ("target_position", "duplo2x4/position", "pedestal/position")
WIDTH, BATCH, RATE, DECAY = 256, 256, 1e-3, 1e-4
AHEAD = 20  # control steps that the network looks ahead
FORGETTING = 0.1  # older words about a step weigh less by this part for each step
FINE = 0.01  # [m] within which the place of things is told more finely
AFTER = 50  # control steps that are kept of an episode after it was solved: staying is learned from few

Floats = NDArray[np.float32]
Observation = Mapping[str, NDArray[Any]]

gymnasium.register_envs(jacokin.tasks)


def look(seen: Observation) -> Floats:
    """What the network sees (n, k) of observations by name, (n, ...) each."""
    tool, count = seen[f"{HAND}pinch_site_pos"], len(seen[f"{HAND}pinch_site_pos"])
    R_world_tool = seen[f"{HAND}pinch_site_rmat"].reshape(-1, 3, 3)
    found = [tool, seen[f"{HAND}pinch_site_rmat"], seen[f"{ARM}joints_pos"].reshape(count, -1)]
    found += [seen[f"{ARM}joints_vel"], seen[f"{HAND}joints_pos"], seen[f"{HAND}joints_vel"]]
    for position in (seen[name] for name in THINGS if name in seen):
        way = position - tool
        near = np.einsum("nji,nj->ni", R_world_tool, way)
        found += [position, way, near, np.tanh(near / FINE)]
    if "duplo2x4/orientation" in seen:
        w, x, y, z = seen["duplo2x4/orientation"].T
        long = np.stack((2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)), axis=-1)
        # Turned by half a turn a brick is the same: its long axis is the one on the side of the tool's.
        long *= np.where(np.sum(long * R_world_tool[:, :, 1], axis=1) < 0.0, -1.0, 1.0)[:, None]
        upright = np.stack((2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)), axis=-1)
        for axis in (long, upright):
            found += [axis, np.einsum("nji,nj->ni", R_world_tool, axis)]
        if "pedestal/position" in seen:
            found.append(seen["duplo2x4/position"] - seen["pedestal/position"])
    return np.concatenate(found, axis=1, dtype=np.float32)


def demonstrations(path: Path) -> Iterator[tuple[Floats, Floats]]:
    """What the network sees (n, k), and the actions (n, m), of each recorded episode that was solved."""
    with h5py.File(path) as file:
        for name in file["mask/solved"][:]:
            demo = file["data"][name.decode()]
            success = demo["success"][:]
            end = len(success) - int(np.argmin(success[::-1])) + AFTER  # solved for good, and some more
            seen = {each.attrs["name"]: each[:end] for each in demo["obs"].values()}
            yield look(seen), np.asarray(demo["actions"][:end], np.float32)


@dataclass
class Network:
    """Layers with ReLU between them, fitted by Adam."""

    weights: list[Floats]

    @classmethod
    def random(cls, sizes: list[int], rng: np.random.Generator) -> Network:
        """Weights and offsets of layers between these sizes."""
        found: list[Floats] = []
        for before, after in itertools.pairwise(sizes):
            weights = rng.normal(0.0, np.sqrt(2.0 / before), (before, after)).astype(np.float32)
            found += [weights, np.zeros(after, np.float32)]
        return cls(found)

    def __call__(self, x: Floats) -> Floats:
        """The output (n, m) of inputs (n, k)."""
        return self.layers(x)[-1]

    def layers(self, x: Floats) -> list[Floats]:
        """What goes into each layer, and the output."""
        found = [x]
        for number in range(0, len(self.weights), 2):
            x = found[-1] @ self.weights[number] + self.weights[number + 1]
            found.append(x if number + 2 == len(self.weights) else np.maximum(x, 0.0))
        return found

    def slopes(self, layers: list[Floats], error: Floats) -> list[Floats]:
        """Derivatives of a loss by the weights, from those by the output."""
        found: list[Floats] = []
        for number in range(len(self.weights) - 2, -1, -2):
            before = layers[number // 2]
            found += [error.sum(axis=0), before.T @ error]
            if number:
                error = (error @ self.weights[number].T) * (before > 0.0)
        return found[::-1]


@dataclass
class Policy:
    """A network with the scales of what goes in and comes out."""

    network: Network
    mean: Floats
    deviation: Floats
    scale: Floats

    def chunks(self, x: Floats) -> Floats:
        """Actions of the next steps (n, AHEAD, m)."""
        found = self.network((x - self.mean) / self.deviation)
        return np.asarray(found.reshape(len(x), AHEAD, -1) * self.scale)


def fit(path: Path, steps: int, seed: int) -> Policy:
    """Fit a network to recorded episodes."""
    rng = np.random.default_rng(seed)
    inputs, outputs = [], []
    for seen, actions in demonstrations(path):
        padded = np.concatenate((actions, np.repeat(actions[-1:], AHEAD, axis=0)))
        inputs.append(seen)
        outputs.append(np.stack([padded[k : k + len(actions)] for k in range(AHEAD)], axis=1))
    x, y = np.concatenate(inputs), np.concatenate(outputs)
    mean, deviation, scale = x.mean(axis=0), x.std(axis=0) + 1e-3, y[:, 0].std(axis=0) + 1e-3
    x, y = (x - mean) / deviation, (y / scale).reshape(len(y), -1)
    network = Network.random([x.shape[1], WIDTH, WIDTH, WIDTH, y.shape[1]], rng)
    first, second = ([np.zeros_like(each) for each in network.weights] for _ in range(2))
    for step in range(1, steps + 1):
        rows = rng.integers(len(x), size=BATCH)
        layers = network.layers(x[rows])
        error = np.clip(layers[-1] - y[rows], -1.0, 1.0) / BATCH  # of Huber's loss: experts have more than one way
        rate = RATE * 0.5 * (1.0 + np.cos(np.pi * step / steps))
        fixed = np.sqrt(1.0 - 0.999**step) / (1.0 - 0.9**step)
        for weight, slope, m, v in zip(network.weights, network.slopes(layers, error), first, second, strict=True):
            m += 0.1 * (slope - m)
            v += 0.001 * (slope * slope - v)
            weight -= np.float32(rate) * (np.float32(fixed) * m / (np.sqrt(v) + 1e-8) + np.float32(DECAY) * weight)
    return Policy(network, mean, deviation, scale)


def evaluate(task: str, policies: Sequence[Policy], episodes: int) -> tuple[NDArray[Any], NDArray[Any]]:
    """Whether (n,) episodes with fresh seeds are solved at their end, and the sums of their rewards (n,)."""
    envs: Any = gymnasium.make_vec(
        TASKS[task][0],
        num_envs=episodes,
        vectorization_mode="vector_entry_point",
        control=CONTROL,
        flatten=False,
        threads=2,
    )
    low, high = envs.single_action_space.low, envs.single_action_space.high
    seen, _ = envs.reset(seed=FRESH_SEED)
    total, truncated, info = np.zeros(episodes), np.zeros(1, bool), {}
    said: list[Floats] = []  # chunks of the last steps, the newest first
    while not truncated.any():
        x = look(seen)
        said = [np.mean([policy.chunks(x) for policy in policies], axis=0), *said[: AHEAD - 1]]
        weights = np.exp(-FORGETTING * np.arange(len(said)))
        action = sum(w * each[:, age] for age, (w, each) in enumerate(zip(weights, said, strict=True))) / weights.sum()
        seen, rewards, _, truncated, info = envs.step(np.clip(action, low, high))
        total += rewards
    envs.close()
    return info["is_success"], total


def record(task: str, path: Path, episodes: int) -> None:
    """Record the expert, unless that is done."""
    if not path.exists():
        name, expert = TASKS[task]
        varied = {"action_noise": NOISE}  # of the environment: the actions that are kept are those without
        env = gymnasium.make(name, control=CONTROL, flatten=False, randomization=varied)
        print(jacokin.tasks.record(env, jacokin.tasks.expert(expert, control=CONTROL), path, episodes=episodes))


def draw(solved: Sequence[float], path: Path) -> None:
    """Draw which part of the episodes is solved by how many networks."""
    figure = matplotlib.figure.Figure(figsize=(6, 4), layout="constrained")
    axes = figure.subplots()
    axes.plot(np.arange(len(solved)) + 1, 100.0 * np.array(solved), marker="o")
    axes.set(xlabel="networks", ylabel="fresh episodes solved [%]", ylim=(0, 100), title=path.stem)
    figure.savefig(path, dpi=150)


def main() -> None:
    parser = argparse.ArgumentParser(description="Clone an expert.")
    parser.add_argument("task", choices=TASKS)
    parser.add_argument("--demonstrations", type=Path, help="recorded before, or to be recorded: an .hdf5 file")
    parser.add_argument("--episodes", type=int, default=200)
    parser.add_argument("--steps", type=int, default=4_000, help="of fitting a network")
    parser.add_argument("--networks", type=int, default=3)
    parser.add_argument("--fresh", type=int, default=100, help="episodes of each evaluation")
    options = parser.parse_args()
    path = options.demonstrations or Path(f"{options.task}.hdf5")
    record(options.task, path, options.episodes)
    policies, curve, started = list[Policy](), list[float](), time.process_time()
    for seed in range(options.networks):
        policies.append(fit(path, options.steps, seed))
        solved, total = evaluate(options.task, policies, options.fresh)
        curve.append(float(solved.mean()))
        print(
            f"{len(policies)} networks, {time.process_time() - started:.0f} s of processor time: {solved.sum()} of "
            f"{len(solved)} solved, mean return {total.mean():.1f}",
            flush=True,
        )
    draw(curve, path.with_suffix(".png"))


if __name__ == "__main__":
    main()
