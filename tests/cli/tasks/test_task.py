"""`jacokin task`: episodes and their recordings."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from jacokin.arrays import Array
from tests.cli.run import Run


def test_the_expert_reaches_and_is_recorded(run: Run, tmp_path: Path) -> None:
    file = tmp_path / "episodes.npz"
    answer = run("task", "reach_site", "--expert", "--episodes", "2", "--record", str(file))
    assert answer.code == 0
    assert "2 of 2 solved" in answer.out
    with np.load(file) as arrays:
        assert arrays["action"].shape == (500, 9)
        assert arrays["target_position"].shape == (500, 3)
        assert arrays["success"][[249, 499]].all()
        np.testing.assert_array_equal(arrays["episode"], np.repeat([0, 1], 250))


def test_random_actions_are_those_of_the_seed(run: Run, tmp_path: Path) -> None:
    def actions(seed: int) -> Array:
        file = tmp_path / "episodes.npz"
        assert run("task", "reach_site", "--seed", f"{seed}", "--record", str(file)).code == 0
        with np.load(file) as arrays:
            return np.asarray(arrays["action"])

    first = actions(3)
    np.testing.assert_array_equal(actions(3), first)
    assert not np.isclose(actions(4), first).any()


def test_mistakes_are_sentences(run: Run, tmp_path: Path) -> None:
    for words, message in (
        (("reach_sit",), "unknown task 'reach_sit'. Did you mean 'reach_site'"),
        (("stack_2_bricks", "--expert"), "unknown expert 'stack_2_bricks'"),
        (("reach_site", "--record", "episodes.csv"), "must end in .npz or .mp4"),
        (("reach_site", "--record", str(tmp_path / "none" / "a.npz")), "there is no folder"),
    ):
        answer = run("task", *words)
        assert answer.code == 2
        assert message in answer.err
