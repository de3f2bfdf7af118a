"""Trajectories that are played, and files of them."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import jacokin
from jacokin import Robot
from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.motion import track_path
from jacokin.motion.trajectory import PathResult
from jacokin.viewer.playback import Playback, Trajectory, load_recording


def recorded(robot: Robot, t: list[float], q: Array) -> Trajectory:
    made: Trajectory = SimpleNamespace(joint_names=robot.joint_names, t=np.array(t), q=q)
    return made


@pytest.fixture
def playback(robot: Robot) -> Playback:
    return Playback(recorded(robot, [1.0, 2.0, 4.0], robot.home + np.array([[0.0], [0.1], [0.5]])), robot)


def test_time_starts_at_zero_and_rows_are_joined_by_lines(playback: Playback, robot: Robot) -> None:
    assert playback.duration == 3.0
    assert np.allclose(playback.at(0.5), robot.home + 0.05)
    assert np.allclose(playback.at(2.0), robot.home + 0.3)


def test_speed_scales_the_clock_and_the_end_is_a_pause(playback: Playback, robot: Robot) -> None:
    assert np.allclose(playback.advance(1.0), robot.home)  # paused
    playback.play()
    playback.set_speed(2.0)
    assert np.allclose(playback.advance(0.5), robot.home + 0.1)
    assert np.allclose(playback.advance(100.0), robot.home + 0.5)
    assert not playback.playing
    playback.play()
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


@pytest.mark.parametrize("t", [[], [0.0, 0.0], [1.0, 0.5], [0.0, float("nan")], [0.0]])
def test_what_is_not_a_trajectory_is_refused(robot: Robot, t: list[float]) -> None:
    rows = np.tile(robot.home, (2 if len(t) < 2 else len(t), 1))
    with pytest.raises(InvalidInputError, match="trajectory"):
        Playback(recorded(robot, t, rows), robot)


@pytest.mark.parametrize("what", [5, [1.0], np.zeros((3, 6)), SimpleNamespace(joint_names=5, t=[0.0], q=[])])
def test_what_has_no_rows_and_times_is_refused(robot: Robot, what: Trajectory) -> None:
    with pytest.raises(InvalidInputError, match="trajectory must be a PathResult, a JointMotion or a file"):
        Playback(what, robot)


def test_a_trajectory_of_another_robot_is_refused(robot: Robot) -> None:
    other: Trajectory = SimpleNamespace(joint_names=("a", "b"), t=np.zeros(1), q=np.zeros((1, 2)))
    with pytest.raises(InvalidInputError, match="trajectory has the joints a, b"):
        Playback(other, robot)


@pytest.mark.parametrize("ending", [".csv", ".npz"])
def test_saved_paths_are_loaded(robot: Robot, tmp_path: Path, ending: str) -> None:
    start = robot.forward_kinematics(robot.home)
    end = jacokin.pose(start.translation + np.array([0.0, 0.0, 0.01]), rotation=start.rotation)
    path = track_path(robot, [start, end], start=robot.home)
    path.save(tmp_path / f"path{ending}")
    loaded = Playback(load_recording(tmp_path / f"path{ending}", robot), robot)
    assert np.array_equal(loaded.q, path.q)
    assert np.allclose(loaded.t, path.t)


def test_saved_joint_motions_are_loaded(robot: Robot, tmp_path: Path) -> None:
    pytest.importorskip("ruckig")
    from jacokin.motion import move_joints

    end = np.array(robot.home)
    end[0] += 0.1
    motion = move_joints(robot, robot.home, end, acceleration_limit=1.0)
    motion.save(tmp_path / "motion.csv")
    assert np.array_equal(Playback(load_recording(tmp_path / "motion.csv", robot), robot).q, motion.q)


@pytest.mark.parametrize("name", ["missing.csv", "text.csv", "x.txt"])
def test_a_file_that_is_none_is_named(robot: Robot, tmp_path: Path, name: str) -> None:
    (tmp_path / "text.csv").write_text("hello\n", encoding="utf-8")
    with pytest.raises(InvalidInputError, match=name):
        load_recording(tmp_path / name, robot)


@pytest.fixture
def followed(robot: Robot) -> PathResult:
    start = robot.forward_kinematics(robot.home)
    end = jacokin.pose(start.translation + np.array([0.0, 0.0, 0.01]), rotation=start.rotation)
    return track_path(robot, [start, end], start=robot.home)


def test_ros_trajectories_are_loaded_with_joints_in_any_order(
    robot: Robot, followed: PathResult, tmp_path: Path
) -> None:
    file = tmp_path / "path.json"
    followed.save(file)
    loaded = Playback(load_recording(file, robot), robot)
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
    again = Playback(load_recording(file, robot), robot)
    assert np.array_equal(again.q, followed.q)
    assert np.allclose(again.t, followed.t, atol=1e-9)


def test_files_for_kinovas_driver_are_loaded(robot: Robot, followed: PathResult, tmp_path: Path) -> None:
    followed.save(tmp_path / "path.kinova.csv")
    loaded = Playback(load_recording(tmp_path / "path.kinova.csv", robot), robot)
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
        load_recording(file, robot)


def test_messages_that_are_no_trajectory_are_refused(robot: Robot, tmp_path: Path) -> None:
    for points in ([], [POINT, POINT], [{**POINT, "positions": [float("nan")] * 6}]):
        file = tmp_path / "bad.json"
        file.write_text(json.dumps({"joint_names": NAMES, "points": points}), encoding="utf-8")
        with pytest.raises(InvalidInputError, match="trajectory"):
            Playback(load_recording(file, robot), robot)


@pytest.mark.parametrize("line", ["time_s,joint1_deg\n0.0,1.0\n", "t,a\n0,1\n", "", "time_s\n"])
def test_what_is_not_a_file_for_kinovas_driver_is_refused(robot: Robot, tmp_path: Path, line: str) -> None:
    (tmp_path / "bad.kinova.csv").write_text(line, encoding="utf-8")
    with pytest.raises(InvalidInputError, match=r"bad\.kinova\.csv"):
        load_recording(tmp_path / "bad.kinova.csv", robot)


def test_a_cell_that_is_not_a_number_is_named(robot: Robot, followed: PathResult, tmp_path: Path) -> None:
    file = tmp_path / "path.kinova.csv"
    followed.save(file)
    lines = file.read_text(encoding="utf-8").splitlines()
    lines[2] = lines[2].replace(",", ",x", 1)
    file.write_text("\n".join(lines), encoding="utf-8")
    with pytest.raises(InvalidInputError, match=r"path\.kinova\.csv, line 3"):
        load_recording(file, robot)


@pytest.mark.parametrize("trajectory", [[], 1.0, np.eye(4), "path.csv"])
def test_what_has_no_rows_is_refused(trajectory: object, robot: Robot) -> None:
    with pytest.raises(InvalidInputError, match="trajectory must be a PathResult"):
        Playback(trajectory, robot)  # type: ignore[arg-type]  # the mistakes
