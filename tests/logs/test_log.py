"""What is read of recordings of ROS: joints, commands and poses, by the names and units of drivers."""

from __future__ import annotations

import logging
import sqlite3
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

import jacokin
from jacokin import Robot
from jacokin.errors import InvalidInputError, MissingExtraError, UnknownNameError
from jacokin.logs import Log
from tests.logs.recordings import (
    KINDS,
    Said,
    controller_state,
    joint_angles,
    joint_state,
    names_of,
    pose,
    trajectory,
    write,
)

TIMES = np.arange(0.0, 1.0, 0.1)


def angles(robot: Robot) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    """(10, dof) of an arm that moves [rad]."""
    return robot.home + 0.1 * TIMES[:, None] * np.arange(1, robot.dof + 1)


def states(robot: Robot, topic: str = "/joint_states", prefix: str = "j2n6s300_") -> list[Said]:
    """Joint states with fingers behind the arm's joints, which come in another order."""
    names = names_of(robot, prefix)
    order = [*reversed(names.arm), *names.fingers]
    return [
        joint_state(topic, float(t), order, [*q[::-1], 0.1, 0.2, 0.3], [*np.arange(6.0)[::-1], 0, 0, 0])
        for t, q in zip(TIMES, angles(robot), strict=True)
    ]


@pytest.mark.parametrize("ending", KINDS)
def test_joints_are_those_of_the_arm_in_its_order(ending: str, robot: Robot, tmp_path: Path) -> None:
    log = Log(write(tmp_path, ending, states(robot)), robot)
    (topic,) = log.topics.values()
    assert (topic.name, topic.type, topic.count) == ("/joint_states", "sensor_msgs/msg/JointState", 10)
    record = log.joints()
    np.testing.assert_array_equal(record.q, angles(robot))
    np.testing.assert_allclose(record.t, TIMES, atol=1e-9)
    assert record.stamp is not None
    np.testing.assert_allclose(record.stamp, TIMES, atol=1e-9)
    assert record.v is not None
    np.testing.assert_array_equal(record.v[3], np.arange(6.0))
    assert record.torque is None
    assert record.left_out == 0
    assert not record.q.flags.writeable


@pytest.mark.parametrize("ending", KINDS)
def test_kinovas_own_topics_are_in_degrees(ending: str, robot: Robot, tmp_path: Path) -> None:
    said = [
        joint_angles("/j2n6s300_driver/out/joint_angles", float(t), q)
        for t, q in zip(TIMES, angles(robot), strict=True)
    ]
    said += [joint_angles("/j2n6s300_driver/out/joint_command", each.time, robot.home + 0.5) for each in said]
    log = Log(write(tmp_path, ending, said), robot)
    record, commanded = log.joints(), log.commanded()
    np.testing.assert_allclose(record.q, angles(robot), atol=1e-6)  # float32 degrees
    assert record.stamp is None
    assert commanded is not None
    np.testing.assert_allclose(commanded.q, np.tile(robot.home + 0.5, (10, 1)), atol=1e-6)


def test_a_gripper_that_publishes_alone_on_joint_states_is_left_out(robot: Robot, tmp_path: Path) -> None:
    names = names_of(robot)
    fingers = [joint_state("/joint_states", float(t) + 0.03, names.fingers, [0.0, 0.0, 0.0]) for t in TIMES]
    record = Log(write(tmp_path, ".mcap", [*states(robot), *fingers]), robot).joints()
    np.testing.assert_array_equal(record.q, angles(robot))
    assert record.left_out == 10


def test_driver_topics_are_preferred_and_others_must_be_named(robot: Robot, tmp_path: Path) -> None:
    driver = states(robot, "/j2n6s300_driver/out/joint_state")
    shifted = [joint_state("/copy", each.time, names_of(robot).arm, robot.home) for each in driver]
    log = Log(write(tmp_path, ".mcap", [*driver, *shifted]), robot)
    assert log.joints().topic == "/j2n6s300_driver/out/joint_state"
    np.testing.assert_array_equal(log.joints("/copy").q, np.tile(robot.home, (10, 1)))
    two = Log(write(tmp_path / "two", ".mcap", [*states(robot, "/a"), *states(robot, "/b")]), robot)
    with pytest.raises(InvalidInputError, match=r"several topics could be meant by joints: /a .*, /b .*; name one"):
        two.joints()


def test_what_was_commanded_is_never_taken_for_measured(robot: Robot, tmp_path: Path) -> None:
    said = [joint_angles("/j2n6s300_driver/out/joint_command", 0.0, robot.home)]
    with pytest.raises(InvalidInputError, match="has no topic for joints"):
        Log(write(tmp_path, ".bag", said), robot).joints()


def test_unlimited_joints_do_not_jump_by_turns(robot: Robot, tmp_path: Path) -> None:
    q = np.tile(robot.home, (10, 1))
    q[:, 3] = np.pi - 0.5 + 1.0 * TIMES
    said = [
        joint_state(
            "/joint_states", float(t), names_of(robot).arm, [*row[:3], (row[3] + np.pi) % (2 * np.pi) - np.pi, *row[4:]]
        )
        for t, row in zip(TIMES, q, strict=True)
    ]
    found = Log(write(tmp_path, ".db3", said), robot).joints().q
    np.testing.assert_allclose(np.diff(found[:, 3]), 0.1, atol=1e-9)


def test_two_arms_are_told_apart_by_their_prefix(robot: Robot, tmp_path: Path) -> None:
    left, right = names_of(robot, "left_").arm, names_of(robot, "right_").arm
    said = [
        joint_state("/joint_states", float(t), [*left, *right], [*q, *(q + 1.0)])
        for t, q in zip(TIMES, angles(robot), strict=True)
    ]
    path = write(tmp_path, ".mcap", said)
    np.testing.assert_array_equal(Log(path, robot, prefix="right_").joints().q, angles(robot) + 1.0)
    with pytest.raises(InvalidInputError, match="several arms; the prefix must be one of left_, right_"):
        Log(path, robot).joints()
    with pytest.raises(InvalidInputError, match="'middle_' before their names"):
        Log(path, robot, prefix="middle_").joints()


@pytest.mark.one_quick("state")
@pytest.mark.parametrize("ending", KINDS)
@pytest.mark.parametrize("state", ["desired", "reference"])
def test_the_state_of_a_controller_says_what_was_commanded(
    ending: str, state: str, robot: Robot, tmp_path: Path
) -> None:
    names, topic = names_of(robot, "").arm, "/arm_controller/controller_state"
    said = [
        controller_state(topic, float(t), names, q + 0.2, q, state) for t, q in zip(TIMES, angles(robot), strict=True)
    ]
    log = Log(write(tmp_path, ending, [*said, *states(robot, prefix="")], state=state), robot)
    commanded = log.commanded()
    assert commanded is not None
    np.testing.assert_array_equal(commanded.q, angles(robot) + 0.2)


def test_the_controller_of_a_gripper_is_not_that_of_the_arm(robot: Robot, tmp_path: Path) -> None:
    names = names_of(robot)
    said = [
        *states(robot),
        *states(robot, "/gripper/joint_states", prefix="other_")[:1],
        controller_state("/gripper_controller/state", 0.1, names.fingers, np.zeros(3), np.zeros(3), "desired"),
    ]
    gripper = Log(write(tmp_path / "gripper", ".bag", said), robot, prefix="j2n6s300_")
    assert gripper.joints().topic == "/joint_states"
    assert gripper.commanded() is None
    arm = controller_state("/arm_controller/state", 0.1, names.arm, robot.home, robot.home, "desired")
    found = Log(write(tmp_path / "both", ".bag", [*said, arm]), robot).commanded()
    assert found is not None
    assert found.topic == "/arm_controller/state"


def test_the_next_trajectory_takes_over_and_the_end_is_held(robot: Robot, tmp_path: Path) -> None:
    names, home = names_of(robot).arm, robot.home
    topic = "/arm_controller/joint_trajectory"
    said = [
        trajectory(topic, 1.0, names, [(0.0, home), (1.0, home + 1.0)]),
        trajectory(topic, 1.5, names, [(1.0, home)]),  # from where the first one is: half way
        trajectory(topic, 4.0, names, [(1.0, home + 2.0)]),
    ]
    path = write(tmp_path, ".mcap", [*said, *states(robot)], stamped=False)
    record = Log(path, robot).commanded()
    assert record is not None
    np.testing.assert_allclose(record.t, [1.0, 1.5, 2.5, 4.0, 5.0], atol=1e-9)
    np.testing.assert_allclose(record.q - home, np.outer([0.0, 0.5, 0.0, 0.0, 2.0], np.ones(6)), atol=1e-12)


def test_a_recording_has_both_on_one_clock(robot: Robot, tmp_path: Path) -> None:
    late = [
        joint_angles("/j2n6s300_driver/out/joint_command", float(t) + 0.05, q + 4.0 * np.pi * robot.unlimited)
        for t, q in zip(TIMES, angles(robot), strict=True)
    ]
    played = Log(write(tmp_path, ".bag", [*states(robot), *late]), robot).recording()
    np.testing.assert_allclose(played.t, TIMES, atol=1e-9)
    np.testing.assert_allclose(played.commanded_t, TIMES + 0.05, atol=1e-9)
    np.testing.assert_allclose(played.commanded_q, played.q, atol=1e-5)  # turns of unlimited joints are no distance
    assert played.joint_names == robot.joint_names
    # The first command comes when a joint without limits has turned by most of a turn.
    first, turned = robot.joint_names.index("joint_1"), robot.home + np.outer(6.0 * TIMES, np.eye(6)[0])
    assert robot.unlimited[first]
    said = [joint_state("/joint_states", float(t), robot.joint_names, q) for t, q in zip(TIMES, turned, strict=True)]
    topic, begins = "/j2n6s300_driver/out/joint_command", 6
    late = [joint_angles(topic, float(TIMES[k]), turned[k] - 2.0 * np.pi * np.eye(6)[0]) for k in range(begins, 10)]
    played = Log(write(tmp_path / "turned", ".bag", [*said, *late]), robot).recording()
    np.testing.assert_allclose(played.commanded_q, played.q[begins:], atol=1e-5)
    alone = Log(write(tmp_path / "alone", ".bag", states(robot)), robot).recording()
    assert len(alone.commanded_t) == 0
    assert alone.commanded_q.shape == (0, 6)


@pytest.mark.parametrize("ending", KINDS)
def test_poses_of_an_instrument_are_preferred_to_those_the_driver_computes(
    ending: str, robot: Robot, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    T = robot.forward_kinematics(robot.home).homogeneous
    own = [pose("/j2n6s300_driver/out/tool_pose", float(t), np.eye(4), "j2n6s300_link_base") for t in TIMES]
    theirs = [pose("/tracker/hand", float(t), T) for t in TIMES]
    found = Log(write(tmp_path, ending, [*own, *theirs]), robot).poses()
    assert (found.topic, found.frame, len(found)) == ("/tracker/hand", "world", 10)
    assert found.rotations is not None
    np.testing.assert_allclose(found.positions, np.tile(T[:3, 3], (10, 1)), atol=1e-12)
    np.testing.assert_allclose(found.rotations[2], T[:3, :3], atol=1e-12)
    with caplog.at_level(logging.WARNING):
        Log(write(tmp_path / "own", ending, own), robot).poses()
    assert "says nothing about where the arm really is" in caplog.text


def test_poses_that_are_none_are_left_out_and_several_frames_refused(robot: Robot, tmp_path: Path) -> None:
    sound = [pose("/hand", float(t), np.eye(4)) for t in TIMES]
    bad = np.eye(4)
    bad[0, 3] = np.nan
    found = Log(write(tmp_path, ".mcap", [*sound, pose("/hand", 2.0, bad)]), robot).poses()
    assert (len(found), found.left_out) == (10, 1)
    mixed = write(tmp_path / "mixed", ".mcap", [*sound, pose("/hand", 2.0, np.eye(4), "camera")])
    with pytest.raises(InvalidInputError, match="several frames: camera, world"):
        Log(mixed, robot).poses()


@pytest.mark.parametrize(
    ("names", "values", "message"),
    [
        (["elbow", "wrist"], [0.0, 1.0], "the joints elbow, wrist; j2n6s300 has others: joint_1, .*joint_6"),
        ([f"j2s6s300_joint_{j}" for j in range(1, 7)], range(6), "the robot is j2n6s300"),
        ([f"joint_{j}" for j in range(1, 7)], range(5), "not one for each joint"),
        ([f"joint_{j}" for j in range(1, 7)], [np.nan] * 6, "not finite"),
        ([*(f"joint_{j}" for j in range(1, 7)), "joint_6"], range(7), "one is there twice"),
    ],
)
def test_other_joints_are_refused_by_their_names(
    names: Sequence[str], values: Sequence[float], message: str, robot: Robot, tmp_path: Path
) -> None:
    path = write(tmp_path, ".mcap", [joint_state("/joint_states", 0.0, names, values)])
    with pytest.raises(InvalidInputError, match=f"/joint_states .* does not have the joints of j2n6s300: .*{message}"):
        Log(path, robot).joints()


def test_missing_topics_list_those_that_are_there(robot: Robot, tmp_path: Path) -> None:
    log = Log(write(tmp_path, ".mcap", [pose("/hand", 0.0, np.eye(4))]), robot)
    with pytest.raises(
        InvalidInputError, match=r"no topic for joints .*topics are: /hand \(geometry_msgs/msg/PoseStamped, 1\)"
    ):
        log.joints()
    with pytest.raises(UnknownNameError, match="unknown topic '/hnd'. Did you mean '/hand'"):
        log.poses("/hnd")
    with pytest.raises(InvalidInputError, match="/hand .* is none of sensor_msgs/msg/JointState"):
        log.joints("/hand")
    assert log.commanded() is None


def test_a_clock_that_begins_anew_is_refused(robot: Robot, tmp_path: Path) -> None:
    names = names_of(robot).arm
    path = write(tmp_path, ".mcap", [joint_state("/joint_states", 0.0, names, robot.home) for _ in range(5)])
    with pytest.raises(InvalidInputError, match="4 of 5 messages are not later"):
        Log(path, robot).joints()


def test_a_database_of_humble_says_nothing_of_its_types(robot: Robot, tmp_path: Path) -> None:
    """Types of ROS are known all the same, the state of a controller is not."""
    topic = "/arm_controller/controller_state"
    state = controller_state(topic, 0.5, names_of(robot).arm, robot.home, robot.home, "desired")
    path = write(tmp_path, ".db3", [*states(robot), state])
    database = sqlite3.connect(path)
    for table in ("message_definitions", "schema", "metadata"):
        database.execute(f"DROP TABLE {table}")
    database.execute("ALTER TABLE topics DROP COLUMN type_description_hash")
    database.commit()
    database.close()
    log = Log(path, robot)
    np.testing.assert_array_equal(log.joints().q, angles(robot))
    with pytest.raises(InvalidInputError, match="does not say what its messages of .*ControllerState are made of"):
        log.commanded()


@pytest.mark.parametrize("ending", KINDS)
def test_a_recording_that_was_cut_off_is_refused_by_name(ending: str, robot: Robot, tmp_path: Path) -> None:
    path = write(tmp_path, ending, states(robot))
    whole = path.read_bytes()
    cut = tmp_path / f"cut{ending}"
    for part in (0.0, 0.3, 0.6, 0.9):
        cut.write_bytes(whole[: int(part * len(whole))])
        with pytest.raises(InvalidInputError, match=f"cut{ending}: is not a recording of ROS that can be read"):
            Log(cut, robot).joints()


def test_other_kinds_of_files_are_refused(robot: Robot, tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match="cannot be read: No such file"):
        Log(tmp_path / "none.bag", robot)
    (tmp_path / "folder.mcap").mkdir()
    with pytest.raises(InvalidInputError, match="is a folder"):
        Log(tmp_path / "folder.mcap", robot)
    with pytest.raises(InvalidInputError, match="ends in .bag, .mcap, .db3"):
        Log(tmp_path / "log.csv", robot)
    file = write(tmp_path / "drive", ".mcap", states(robot))  # the folder is what `ros2 bag record` is told
    with pytest.raises(InvalidInputError, match=rf"ends in .*; in this folder is {file.name}$"):
        Log(file.parent, robot)
    (tmp_path / "plain").mkdir()
    with pytest.raises(InvalidInputError, match="ends in .bag, .mcap, .db3$"):
        Log(tmp_path / "plain", robot)
    address = tmp_path / "a?mode=rw.db3"
    address.write_bytes(b"")
    with pytest.raises(InvalidInputError, match="as long as"):
        Log(address, robot)
    with pytest.raises(InvalidInputError, match="robot must be"):
        Log(tmp_path / "none.bag", "j2n6s300")  # type: ignore[arg-type]


def test_a_chunk_that_unpacks_to_more_than_it_says_is_refused(robot: Robot, tmp_path: Path) -> None:
    import bz2
    import struct

    path = write(tmp_path, ".mcap", states(robot))
    whole = path.read_bytes()
    bomb = bz2.compress(bytes(3_000_000))
    chunk = struct.pack("<QQQI", 0, 1, 1000, 0) + struct.pack("<I", 3) + b"bz2" + struct.pack("<Q", len(bomb)) + bomb
    (size,) = struct.unpack("<Q", whole[9:17])
    at = 17 + size
    path.write_bytes(whole[:at] + struct.pack("<BQ", 6, len(chunk)) + chunk + whole[at:])
    with pytest.raises(InvalidInputError, match="a chunk unpacks to more than 1000 bytes"):
        Log(path, robot)


def test_without_rosbags_the_command_that_installs_it_is_named(
    robot: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write(tmp_path, ".mcap", states(robot))
    monkeypatch.setitem(__import__("sys").modules, "rosbags.rosbag1", None)
    with pytest.raises(MissingExtraError, match=r"rosbags is needed .*\[logs\]"):
        Log(path, robot)


def test_seven_joints_are_read_from_kinovas_angles(tmp_path: Path) -> None:
    robot = jacokin.load_robot("j2s7s300")
    path = write(tmp_path, ".bag", [joint_angles("/j2s7s300_driver/out/joint_angles", 0.0, robot.home)])
    np.testing.assert_allclose(Log(path, robot).joints().q, [robot.home], atol=1e-6)
