"""The example that clones an expert: its derivatives, what it sees, and a fit that takes seconds."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest

pytest.importorskip("examples.clone_expert", reason="examples are in the repository, not in the package")
pytest.importorskip("h5py", reason="the extra data is not installed")

from examples import clone_expert
from examples.clone_expert import Network
from jacokin.mujoco_bridge.entity import quaternion_product


def test_slopes_are_those_of_finite_differences() -> None:
    rng = np.random.default_rng(0)
    weights: Any = [each.astype(np.float64) for each in Network.random([5, 7, 6, 3], rng).weights]
    network = Network(weights)  # more exact than it is used
    x: Any = rng.normal(size=(4, 5))
    wanted: Any = rng.normal(size=(4, 3))

    def loss() -> float:
        return float(0.5 * ((network(x) - wanted) ** 2).sum())

    layers = network.layers(x)
    for weight, slope in zip(weights, network.slopes(layers, layers[-1] - wanted), strict=True):
        for place in [tuple(rng.integers(weight.shape)) for _ in range(5)]:
            before, step = weight[place], 1e-6
            weight[place] = before + step
            above = loss()
            weight[place] = before - step
            below = loss()
            weight[place] = before
            assert slope[place] == pytest.approx((above - below) / (2.0 * step), rel=1e-5, abs=1e-7)


def test_half_a_turn_of_the_brick_is_not_seen() -> None:
    env = gymnasium.make("jacokin/PlaceBrick-v0", flatten=False)
    seen = {name: value[None] for name, value in env.reset(seed=3)[0].items()}
    before = clone_expert.look(seen)
    name = "duplo2x4/orientation"
    half, quarter = ((0.0, 0.0, 0.0, 1.0), (np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)))
    turned = [{**seen, name: quaternion_product(seen[name][0], np.array(turn))[None]} for turn in (half, quarter)]
    np.testing.assert_allclose(clone_expert.look(turned[0]), before, atol=1e-6)
    assert np.abs(clone_expert.look(turned[1]) - before).max() > 0.5


@pytest.mark.slow
def test_what_is_fitted_comes_near_the_expert(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(clone_expert, "NOISE", 0.0)  # which nothing could be fitted to
    monkeypatch.setattr(clone_expert, "WIDTH", 64)
    monkeypatch.setattr(clone_expert, "BATCH", 64)
    path = tmp_path / "demos.hdf5"
    clone_expert.record("reach", path, 2)
    x, actions = next(clone_expert.demonstrations(path))
    errors = []
    for steps in (20, 300):
        policy = clone_expert.fit(path, steps, 0)
        errors.append(np.abs(policy.chunks(x)[:, 0] - actions).mean() / np.abs(actions).mean())
    assert errors[1] < min(0.65, 0.85 * errors[0])
