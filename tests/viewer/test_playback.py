"""Trajectories that are played, and files of them."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from jacokin import Robot
from jacokin.errors import InvalidInputError
from jacokin.motion import move_joints
from jacokin.viewer.contents import Playback
from tests.viewer.trajectories import recorded


@pytest.fixture
def playback(robot: Robot) -> Playback:
    rows = robot.home + np.array([[0.0], [0.1], [0.5]])
    return Playback(recorded(robot, [1.0, 2.0, 4.0], rows), robot)


def test_time_starts_at_zero_and_rows_are_joined_by_lines(playback: Playback, robot: Robot) -> None:
    assert playback.duration == 3.0
    assert np.allclose(playback.at(0.5), robot.home + 0.05)
    assert np.allclose(playback.at(2.0), robot.home + 0.3)


def test_speed_scales_the_clock_and_the_end_is_a_pause(playback: Playback, robot: Robot) -> None:
    assert np.allclose(playback.advance(1.0), robot.home)  # paused
    playback.toggle()
    playback.set_speed(2.0)
    assert np.allclose(playback.advance(0.5), robot.home + 0.1)
    assert np.allclose(playback.advance(100.0), robot.home + 0.5)
    assert not playback.playing
    playback.toggle()
    assert playback.time == 0.0


@pytest.mark.parametrize(("asked", "given"), [(-1.0, 0.0), (9.0, 3.0), (1.5, 1.5)])
def test_scrubbing_stays_in_the_trajectory(playback: Playback, asked: float, given: float) -> None:
    playback.scrub(asked)
    assert playback.time == given
    for wrong in (float("nan"), float("inf")):
        with pytest.raises(InvalidInputError):
            playback.scrub(wrong)
        with pytest.raises(InvalidInputError):
            playback.set_speed(wrong)
    assert playback.time == given


JOINTS = tuple(f"joint_{number}" for number in range(1, 7))
NONE = "trajectory must be a Trajectory or a file"
ROWS = "trajectory must have rows at finite times that increase"


@pytest.mark.parametrize(
    ("trajectory", "message"),
    [
        (5, NONE),
        ([], NONE),
        (np.zeros((3, 6)), NONE),
        (SimpleNamespace(joint_names=5, t=[0.0], q=[]), NONE),
        (SimpleNamespace(joint_names=JOINTS, t="ab", q=[]), NONE),
        (
            {"names": ("a", "b"), "t": [0.0], "q": np.zeros((1, 2))},
            "the joints a, b; j2n6s300 has others",
        ),
        ({"t": [], "q": np.zeros((1, 6))}, ROWS),
        ({"t": [0.0], "q": np.zeros((2, 6))}, ROWS),
        ({"t": [0.0, 0.0], "q": np.zeros((2, 6))}, ROWS),
        ({"t": [1.0, 0.5], "q": np.zeros((2, 6))}, ROWS),
        ({"t": [0.0, np.nan], "q": np.zeros((2, 6))}, ROWS),
        ({"t": [0.0], "q": np.full((1, 6), np.nan)}, "trajectory must be finite"),
    ],
)
def test_what_is_not_a_trajectory_of_the_robot_is_refused(robot: Robot, trajectory: object, message: str) -> None:
    made = recorded(robot, **trajectory) if isinstance(trajectory, dict) else trajectory
    with pytest.raises(InvalidInputError, match=message):
        Playback(made, robot)  # type: ignore[arg-type]  # the mistakes


def test_files_are_played(robot: Robot, tmp_path: Path) -> None:
    motion = move_joints(robot, robot.home, robot.home + np.array([0.1, 0.0, 0.0, 0.0, 0.0, 0.0]))
    for name in ("motion.csv", "motion.json"):
        motion.save(tmp_path / name)
        assert np.array_equal(Playback(tmp_path / name, robot).q, motion.q)


def test_messages_that_are_no_trajectory_are_refused(robot: Robot, tmp_path: Path) -> None:
    point = {"positions": robot.home.tolist(), "time_from_start": {"sec": 0, "nanosec": 0}}
    for points in ([], [point, point], [{**point, "positions": [float("nan")] * 6}]):
        file = tmp_path / "bad.json"
        file.write_text(json.dumps({"joint_names": list(JOINTS), "points": points}), encoding="utf-8")
        with pytest.raises(InvalidInputError, match="bad.json.*rajectory"):
            Playback(file, robot)
