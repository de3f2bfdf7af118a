"""Pairs of tasks repeat, and their referee sees contact of the arms with the table and with each other."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.two_arms import Referee, random_pairs, scene_of
from jacokin import Robot
from jacokin.motion import move_joints


def test_pairs_repeat_and_their_starts_are_clear(robot: Robot) -> None:
    first, again = list(random_pairs(robot, 2)), list(random_pairs(robot, 2))
    referee = Referee(robot)
    for pair, same in zip(first, again, strict=True):
        np.testing.assert_array_equal(pair.starts, same.starts)
        left, right = (move_joints(robot, q, q) for q in pair.starts)
        assert referee.nearest((left, right), 2e-3)[0] > 0.0
        assert np.min(robot.clearance(pair.starts[0], scene_of(robot, 0, pair.starts[1]))) > 0.0


@pytest.mark.slow
def test_the_referee_sees_contact_with_the_table_and_between_the_arms(robot: Robot) -> None:
    referee, (left, right) = Referee(robot), next(random_pairs(robot, 1)).starts
    stays = move_joints(robot, right, right)
    leans = np.array([0.0, 0.8, 0.0, 0.0, 0.0, 0.0])
    distance, what = referee.nearest((move_joints(robot, left, left + leans), stays), 2e-3)
    assert distance < 0.0
    assert "table" in what
    turns = np.array([np.pi, 0.0, 0.0, 0.0, 0.0, 0.0])
    both = tuple(move_joints(robot, q - 0.5 * turns, q + 0.5 * turns) for q in (left, left))
    distance, what = referee.nearest((both[0], both[1]), 2e-3)
    assert distance < 0.0
    assert "left/" in what
    assert "right/" in what
    alone, _ = referee.nearest((both[0], move_joints(robot, left - 0.5 * turns, left - 0.5 * turns)), 2e-3)
    assert alone > distance
