"""`read_motion`: all files that `Trajectory.save` writes, messages of others, and what is neither."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import jacokin
from jacokin import Robot
from jacokin.errors import InvalidInputError
from jacokin.logs.motion_files import read_motion
from jacokin.motion import Trajectory, move_joints, track_path
from tests.robot_files import CRANE

POINT = {"positions": [4.8, 2.9, 1.0, 4.2, 1.4, 1.3], "time_from_start": {"sec": 0, "nanosec": 0}}
NAMES = [f"joint_{number}" for number in range(1, 7)]


@pytest.fixture(scope="module", params=["path", "motion"])
def trajectory(robot: Robot, request: pytest.FixtureRequest) -> Trajectory:
    if request.param == "motion":
        return move_joints(robot, robot.home, robot.home + np.array([0.4, 0.1, -0.2, 0.5, 0.1, 0.6]), dt=0.01)
    start = robot.forward_kinematics(robot.home)
    end = jacokin.pose(start.translation + np.array([0.0, 0.0, 0.01]), rotation=start.rotation)
    return track_path(robot, [start, end], start=robot.home)


@pytest.mark.parametrize("name", ["m.csv", "m.npz", "m.json", "m.kinova.csv", "m.kinova.json"])
def test_all_that_save_writes_is_read(robot: Robot, trajectory: Trajectory, tmp_path: Path, name: str) -> None:
    trajectory.save(tmp_path / name)
    t, q, fault = read_motion(tmp_path / name, robot)
    if "kinova" in name:  # rows of its own
        np.testing.assert_allclose(q[[0, -1]], trajectory.q[[0, -1]], atol=1e-12)
        np.testing.assert_allclose(np.diff(t), 0.01, atol=1e-9)
        assert all(robot.within_limits(row) for row in q)
    else:
        np.testing.assert_array_equal(q, trajectory.q)
        np.testing.assert_allclose(t, trajectory.t, atol=1e-9)
    assert fault == ""


@pytest.mark.parametrize("prefix", ["", "j2n6s300_", "left/", "joint_1"])
def test_joints_of_a_message_come_in_any_order_with_one_prefix_and_times_of_either_ros(
    robot: Robot, trajectory: Trajectory, tmp_path: Path, prefix: str
) -> None:
    file = tmp_path / "m.json"
    trajectory.save(file, joint_prefix=prefix)
    message = json.loads(file.read_text(encoding="utf-8"))
    order = [3, 1, 0, 5, 4, 2]
    message["joint_names"] = [message["joint_names"][joint] for joint in order]
    for index, point in enumerate(message["points"]):
        point["positions"] = [point["positions"][joint] for joint in order]
        stamp = point["time_from_start"]
        if index % 2:  # as ROS 1 has it
            point["time_from_start"] = {"secs": stamp["sec"], "nsecs": stamp["nanosec"]}
    file.write_text(json.dumps(message), encoding="utf-8")
    t, q, _ = read_motion(file, robot)
    np.testing.assert_array_equal(q, trajectory.q)
    np.testing.assert_allclose(t, trajectory.t, atol=1e-9)


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        ("j2n6s300_", "j2s6s200_", "the joints j2s6s200_joint_1, .*; the robot is j2n6s300"),
        ("j2n6s300_joint_2", "left_joint_2", "j2n6s300 has others"),
        ("j2n6s300_joint_1", "j2n6s300_shoulder", "j2n6s300 has others"),
    ],
)
def test_other_joints_are_refused(
    robot: Robot, trajectory: Trajectory, tmp_path: Path, before: str, after: str, message: str
) -> None:
    file = tmp_path / "m.json"
    trajectory.save(file, joint_prefix="j2n6s300_")
    file.write_text(file.read_text(encoding="utf-8").replace(before, after), encoding="utf-8")
    with pytest.raises(InvalidInputError, match=message):
        read_motion(file, robot)
    trajectory.save(tmp_path / "m.csv")
    with pytest.raises(InvalidInputError, match="j2s7s300"):
        read_motion(tmp_path / "m.csv", jacokin.load_robot("j2s7s300"))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("{", "not a JointTrajectory"),
        ("[]", "not a JointTrajectory"),
        ("[" * 100_000, "not a JointTrajectory"),
        (json.dumps({"joint_names": NAMES}), "not a JointTrajectory"),
        (json.dumps({"joint_names": NAMES, "points": [1]}), "not a JointTrajectory"),
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
        read_motion(file, robot)


def test_damaged_files_for_kinovas_driver_are_refused(robot: Robot, trajectory: Trajectory, tmp_path: Path) -> None:
    file = tmp_path / "m.kinova.csv"
    trajectory.save(file)
    head, first, *rest = file.read_text(encoding="utf-8").splitlines()
    for lines, why in (
        ([head, *rest], "its rows are not 10 ms apart"),
        ([head.replace("joint1", "axis1"), first, *rest], "the head line must begin time_s,joint1_deg"),
        ([head, first, rest[0].replace(",", ",x", 1), *rest[1:]], "line 3: could not convert string to float"),
        ([head, first, rest[0].replace(",", ",1_", 1), *rest[1:]], "line 3"),
        ([head, first, *rest[: len(rest) // 2]], "its last row is not at rest"),
        ([head], ""),
        (["time_s,joint1_deg", "0.0,1.0"], ""),
        (["t,a", "0,1"], ""),
        (["time_s"], ""),
        ([], ""),
    ):
        file.write_text("\n".join(lines) + "\n", encoding="utf-8")
        with pytest.raises(InvalidInputError, match=rf"m\.kinova\.csv.*{why}"):
            read_motion(file, robot)


def test_degrees_are_not_read_as_metres(tmp_path: Path) -> None:
    (tmp_path / "crane.urdf").write_text(CRANE, encoding="utf-8")
    crane = jacokin.load_robot(tmp_path / "crane.urdf")
    file = tmp_path / "m.kinova.csv"
    joints = [f"joint{k}_deg" for k in (1, 2, 3)]
    head = ",".join(["time_s", *joints, *(f"{joint}_s" for joint in joints)])
    file.write_text(f"{head}\n0.00,0,40,0,0,0,0\n", encoding="utf-8")
    with pytest.raises(InvalidInputError, match=r"m\.kinova\.csv: Kinova's files hold angles, and slide slides"):
        read_motion(file, crane)


@pytest.mark.parametrize("name", ["missing.csv", "text.csv", "x.txt"])
def test_a_file_that_is_none_is_named(robot: Robot, tmp_path: Path, name: str) -> None:
    (tmp_path / "text.csv").write_text("hello\n", encoding="utf-8")
    with pytest.raises(InvalidInputError, match=name):
        read_motion(tmp_path / name, robot)
