"""`jacokin task`: episodes and their recordings."""

from __future__ import annotations

from pathlib import Path

import numpy as np

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


def test_random_actions_are_those_of_the_seed(run: Run) -> None:
    first, second = (run("task", "reach_site", "--seed", "3").out for _ in range(2))
    assert first == second
    assert run("task", "reach_site", "--seed", "4").out != first


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
