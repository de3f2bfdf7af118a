"""Trajectories that are played, and files of them."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import jacokin
from jacokin import Robot
from jacokin.errors import InvalidInputError
from jacokin.motion import track_path
from jacokin.motion.trajectory import Trajectory
from jacokin.viewer.playback import Playback
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


@pytest.mark.parametrize("ending", [".csv", ".npz"])
def test_saved_paths_are_loaded(robot: Robot, tmp_path: Path, ending: str) -> None:
    start = robot.forward_kinematics(robot.home)
    end = jacokin.pose(start.translation + np.array([0.0, 0.0, 0.01]), rotation=start.rotation)
    path = track_path(robot, [start, end], start=robot.home)
    path.save(tmp_path / f"path{ending}")
    loaded = Playback(tmp_path / f"path{ending}", robot)
    assert np.array_equal(loaded.q, path.q)
    assert np.allclose(loaded.t, path.t)


def test_saved_joint_motions_are_loaded(robot: Robot, tmp_path: Path) -> None:
    from jacokin.motion import move_joints

    end = np.array(robot.home)
    end[0] += 0.1
    motion = move_joints(robot, robot.home, end, acceleration_limit=1.0)
    motion.save(tmp_path / "motion.csv")
    assert np.array_equal(Playback(tmp_path / "motion.csv", robot).q, motion.q)


@pytest.mark.parametrize("name", ["missing.csv", "text.csv", "x.txt"])
def test_a_file_that_is_none_is_named(robot: Robot, tmp_path: Path, name: str) -> None:
    (tmp_path / "text.csv").write_text("hello\n", encoding="utf-8")
    with pytest.raises(InvalidInputError, match=name):
        Playback(tmp_path / name, robot)


@pytest.fixture
def followed(robot: Robot) -> Trajectory:
    start = robot.forward_kinematics(robot.home)
    end = jacokin.pose(start.translation + np.array([0.0, 0.0, 0.01]), rotation=start.rotation)
    return track_path(robot, [start, end], start=robot.home)


def test_ros_trajectories_are_loaded_with_joints_in_any_order(
    robot: Robot, followed: Trajectory, tmp_path: Path
) -> None:
    file = tmp_path / "path.json"
    followed.save(file)
    loaded = Playback(file, robot)
    assert np.array_equal(loaded.q, followed.q)
    assert np.allclose(loaded.t, followed.t, atol=1e-9)
    message = json.loads(file.read_text(encoding="utf-8"))
    order = [3, 1, 0, 5, 4, 2]
    message["joint_names"] = [message["joint_names"][joint] for joint in order]
    for index, point in enumerate(message["points"]):
        point["positions"] = [point["positions"][joint] for joint in order]
        stamp = point["time_from_start"]
        if index % 2:  # as ROS 1 has it
            point["time_from_start"] = {"secs": stamp["sec"], "nsecs": stamp["nanosec"]}
    file.write_text(json.dumps(message), encoding="utf-8")
    again = Playback(file, robot)
    assert np.array_equal(again.q, followed.q)
    assert np.allclose(again.t, followed.t, atol=1e-9)


@pytest.mark.parametrize("prefix", ["j2n6s300_", "left/", "joint_1"])
def test_ros_trajectories_may_have_a_prefix_before_every_joint(
    robot: Robot, followed: Trajectory, tmp_path: Path, prefix: str
) -> None:
    file = tmp_path / "path.json"
    followed.save(file, ros=1, joint_prefix=prefix)
    assert np.array_equal(Playback(file, robot).q, followed.q)


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        ("j2n6s300_", "j2s6s200_", "the joints j2s6s200_joint_1, .*; the robot is j2n6s300"),
        ("j2n6s300_joint_2", "left_joint_2", "j2n6s300 has others"),
        ("j2n6s300_joint_1", "j2n6s300_shoulder", "j2n6s300 has others"),
    ],
)
def test_ros_trajectories_of_other_joints_are_refused(
    robot: Robot, followed: Trajectory, tmp_path: Path, before: str, after: str, message: str
) -> None:
    file = tmp_path / "path.json"
    followed.save(file, joint_prefix="j2n6s300_")
    file.write_text(file.read_text(encoding="utf-8").replace(before, after), encoding="utf-8")
    with pytest.raises(InvalidInputError, match=message):
        Playback(file, robot)


def test_files_for_kinovas_driver_are_loaded(robot: Robot, followed: Trajectory, tmp_path: Path) -> None:
    followed.save(tmp_path / "path.kinova.csv")
    loaded = Playback(tmp_path / "path.kinova.csv", robot)
    assert np.allclose(loaded.q[[0, -1]], followed.q[[0, -1]], atol=1e-12)
    assert np.allclose(np.diff(loaded.t), 0.01)
    assert (loaded.q >= robot.lower).all()
    assert (loaded.q <= robot.upper).all()


POINT = {"positions": [4.8, 2.9, 1.0, 4.2, 1.4, 1.3], "time_from_start": {"sec": 0, "nanosec": 0}}
NAMES = [f"joint_{number}" for number in range(1, 7)]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("{", "not a JointTrajectory"),
        ("[]", "not a JointTrajectory"),
        ("[" * 100_000, "not a JointTrajectory"),
        (json.dumps({"joint_names": NAMES}), "not a JointTrajectory"),
        (json.dumps({"joint_names": NAMES, "points": [{}]}), "not a JointTrajectory"),
        (json.dumps({"joint_names": NAMES, "points": [{**POINT, "positions": ["a"] * 6}]}), "not a JointTrajectory"),
        (json.dumps({"joint_names": NAMES, "points": [{**POINT, "time_from_start": {}}]}), "not a JointTrajectory"),
        (json.dumps({"joint_names": NAMES, "points": [{**POINT, "positions": [1.0]}]}), "must have 6 positions"),
        (json.dumps({"joint_names": ["a", *NAMES[1:]], "points": [POINT]}), "has the joints a, joint_2"),
        (json.dumps({"joint_names": [NAMES[0], *NAMES], "points": [POINT]}), "has the joints"),
    ],
)
def test_what_is_not_a_message_is_refused(robot: Robot, tmp_path: Path, content: str, message: str) -> None:
    file = tmp_path / "bad.json"
    file.write_text(content, encoding="utf-8")
    with pytest.raises(InvalidInputError, match=f"bad.json.*{message}"):
        Playback(file, robot)


def test_messages_that_are_no_trajectory_are_refused(robot: Robot, tmp_path: Path) -> None:
    for points in ([], [POINT, POINT], [{**POINT, "positions": [float("nan")] * 6}]):
        file = tmp_path / "bad.json"
        file.write_text(json.dumps({"joint_names": NAMES, "points": points}), encoding="utf-8")
        with pytest.raises(InvalidInputError, match="bad.json.*rajectory"):
            Playback(file, robot)


@pytest.mark.parametrize("line", ["time_s,joint1_deg\n0.0,1.0\n", "t,a\n0,1\n", "", "time_s\n"])
def test_what_is_not_a_file_for_kinovas_driver_is_refused(robot: Robot, tmp_path: Path, line: str) -> None:
    (tmp_path / "bad.kinova.csv").write_text(line, encoding="utf-8")
    with pytest.raises(InvalidInputError, match=r"bad\.kinova\.csv"):
        Playback(tmp_path / "bad.kinova.csv", robot)


def test_a_cell_that_is_not_a_number_is_named(robot: Robot, followed: Trajectory, tmp_path: Path) -> None:
    file = tmp_path / "path.kinova.csv"
    followed.save(file)
    lines = file.read_text(encoding="utf-8").splitlines()
    for damage in ("x", "1_"):
        damaged = [*lines[:2], lines[2].replace(",", f",{damage}", 1), *lines[3:]]
        file.write_text("\n".join(damaged), encoding="utf-8")
        with pytest.raises(InvalidInputError, match=r"path\.kinova\.csv, line 3"):
            Playback(file, robot)
