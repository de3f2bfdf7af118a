"""The example that learns to reach, in a version that takes seconds."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("examples.learn_reach", reason="examples are in the repository, not in the package")

from examples import learn_reach


@pytest.mark.slow
def test_a_few_generations_are_better_than_random_actions(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(learn_reach, "EPISODE_STEPS", 100)
    monkeypatch.setattr(learn_reach, "EVERY", 8)
    monkeypatch.setattr(learn_reach, "expert_return", lambda seeds: 100.0)
    found, curve = learn_reach.learn(8)
    assert found["learned"] > 2.0 * found["random"]
    learn_reach.draw(found, curve, tmp_path / "curve.png")
    assert (tmp_path / "curve.png").stat().st_size > 10_000


def test_the_expert_it_is_compared_with_reaches() -> None:
    assert learn_reach.expert_return([learn_reach.FRESH_SEED]) > 200.0
