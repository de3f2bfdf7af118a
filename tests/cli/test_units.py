"""Degrees are for what turns; what slides stays in metres, and each value says its unit."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import jacokin
from jacokin.cli.units import Units
from tests.cli.run import POSE, Run

TURNING = [True, True, False, True]  # the joints of the scene's arm
Q = [0.3, -0.4, 0.05, 0.2]


@pytest.fixture
def arm(scene: Path) -> tuple[str, ...]:
    return "--robot", str(scene), "--base", "pedestal", "--tip", "tool"


def in_degrees(q: list[float]) -> list[float]:
    return [math.degrees(value) if turns else value for value, turns in zip(q, TURNING, strict=True)]


def test_fk_converts_turning_joints_only(run: Run, arm: tuple[str, ...]) -> None:
    radians = run("fk", *map(repr, Q), *arm, "--json").document
    degrees = run("fk", *map(repr, in_degrees(Q)), *arm, "--json", "--degrees").document
    assert np.allclose(degrees["position"], radians["position"], rtol=0.0, atol=1e-14)
    assert np.allclose(np.radians(degrees["rpy"]), radians["rpy"], rtol=0.0, atol=1e-14)


def test_info_labels_each_joint_with_its_unit(run: Run, scene: Path) -> None:
    words = ("info", str(scene), "--base", "pedestal", "--tip", "tool", "--degrees")
    document = run(*words, "--json").document
    assert [joint["unit"] for joint in document["joints"]] == ["deg", "deg", "m", "deg"]
    rail = document["joints"][2]
    assert (rail["lower"], rail["upper"]) == (0.0, 0.1)
    assert document["joints"][0]["upper"] == pytest.approx(math.degrees(2.0))
    table = run(*words).out
    assert "rail [m]" in table
    assert "shoulder [deg]" in table


def test_ik_takes_a_seed_and_shows_an_answer_in_each_unit(run: Run, arm: tuple[str, ...], scene: Path) -> None:
    robot = jacokin.load_robot(scene, base="pedestal", tip="tool")
    position = list(map(repr, robot.forward_kinematics(Q).translation.tolist()))
    words = ("ik", "--position", *position, *arm, "--seed", *map(repr, in_degrees(Q)), "--degrees")
    document = run(*words, "--json").document
    assert document["joint_units"] == ["deg", "deg", "m", "deg"]
    assert np.allclose(document["q"], in_degrees(Q), rtol=0.0, atol=1e-4)
    assert "rail [m]" in run(*words).out


def test_angles_that_look_like_degrees_are_noticed(run: Run, tmp_path: Path) -> None:
    words = ("ik", *POSE[:4], "--rpy", "90", "0", "-30")
    assert "--rpy is in radians" in run(*words).err
    assert run(*words, "--degrees").err == ""
    file = tmp_path / "targets.csv"
    file.write_text("x,y,z,roll,pitch,yaw\n0.3,-0.2,0.5,1.57,0,-0.5\n", encoding="utf-8")
    assert "radians" not in run("ik", "--targets", file).err
    file.write_text("x,y,z,roll,pitch,yaw\n0.3,-0.2,0.5,90,0,-30\n", encoding="utf-8")
    assert "radians" in run("ik", "--targets", file).err


def test_numbers_of_another_unit_are_noticed(run: Run, arm: tuple[str, ...]) -> None:
    for orientation in ([], ["--down"], ["--approach", "0", "0", "-1"]):
        far = run("ik", "--position", "350", "-300", "100", *orientation, code=1)
        assert far.err.count("position is in metres") == 1
    assert "position_mm is in millimetres" in run("ik", "--kinova", "0.35", "-0.3", "0.1", "1.5", "0", "0", code=1).err
    radians = ("4.8", "2.9", "1", "4.2", "1.4", "1.3")
    assert "ANGLE is in degrees, and no angle exceeds 6.28" in run("fk", "--degrees", *radians).err
    assert "ANGLE is in radians" in run("fk", "275", "167", "57", "241", "83", "76").err
    assert "--seed is in radians" in run("ik", *POSE, "--seed", "275", "167", "57", "241", "83", "76").err
    for words in (("fk", "275", "167", "57", "241", "83", "76", "--degrees"), ("fk", "1", "1", "9.0", "1", *arm)):
        assert "note" not in run(*words).err  # degrees are asked for; the third joint slides


@pytest.fixture
def waypoints(tmp_path: Path) -> str:
    """A file of a line of 1 cm."""
    file = tmp_path / "path.csv"
    file.write_text("x,y,z,qw,qx,qy,qz\n0.3,-0.2,0.5,0,1,0,0\n0.3,-0.2,0.51,0,1,0,0\n", encoding="utf-8")
    return str(file)


@pytest.mark.parametrize("command", ["plan", "track"])
def test_numbers_of_a_path_in_another_unit_are_noticed(run: Run, waypoints: str, command: str) -> None:
    degrees = ("275", "167", "57", "241", "83", "76")
    words = (command, "--path", waypoints)
    assert "--seed is in radians, and an angle exceeds a full turn" in run(*words, "--seed", *degrees).err
    assert "--start is in radians, and an angle exceeds a full turn" in run(*words, "--start", *degrees, code=1).err
    fast = run(*words, "--velocity-limit", "36", "--angular-speed", "30").err
    assert "--velocity-limit is in radians/s, and 6.28 rad/s are a full turn; --degrees is for degrees" in fast
    assert "--angular-speed is in radians/s" in fast
    assert "note" not in run(*words, "--degrees", "--seed", *degrees, "--velocity-limit", "36").err
    assert "--velocity-limit must be one number or 6, got 2" in run(*words, "--velocity-limit", "1", "2", code=2).err
    assert "--start does not go with --seed" in run(*words, "--seed", *degrees, "--start", *degrees, code=2).err


def test_a_free_range_in_degrees_is_noticed(run: Run) -> None:
    answer = run("ik", *POSE[:4], "--down", "--free-axis", "z", "--free-range", "-30", "30", code=2)
    assert "--free-range is in radians" in answer.err
    assert "at most one turn, got -30.0 to 30.0 rad" in answer.err


@pytest.mark.parametrize(
    ("message", "expected"),
    [
        ("at parameter 1 rad", "at parameter 57.2958 deg"),
        ("at 7.0000000000000001 rad, outside [0, 3.14] rad", "at 401.070456591576 deg, outside [0, 179.909] deg"),
        ("0.001 m and 1e-06 rad away", "0.001 m and 5.72958e-05 deg away"),
        ("a limit of 0.5 to 1 rad/s, 2 rad/s^3", "a limit of 28.6479 to 57.2958 deg/s, 114.592 deg/s^3"),
        ("q must be 6 numbers [rad], got [1.0, nan]", "q must be 6 numbers [deg], got [57.2958, nan]"),
        ("q must have shape (6,) [rad], got shape (2,)", "q must have shape (6,) [deg], got shape (2,)"),
        ("the branch at j2n6s300 rad1 2 radii", "the branch at j2n6s300 rad1 2 radii"),
    ],
)
def test_angles_in_a_message_are_turned_into_degrees(message: str, expected: str) -> None:
    assert Units(degrees=True).in_words(message) == expected
    assert Units(degrees=False).in_words(message) == message


def test_refusals_are_in_degrees_too(run: Run, waypoints: str) -> None:
    start, outside = ("275", "50", "57", "241", "83", "76"), ("275", "10", "57", "241", "83", "76")
    refused = run("move", "--from", *start, "--to", *outside, "--degrees", code=2).err
    assert "--to puts joint_2 at 10 deg, outside [47, 313] deg" in refused
    refused = run("ik", *POSE, "--free-axis", "z", "--free-range", "10", "-10", "--degrees", code=2).err
    assert "got 10 to -10 deg" in refused
    held = run("fk", *start, "--degrees", "--finger-angle", "9", code=2).err
    assert "= 9.0: the fingers move from 0.15 to 1.35 rad" in held  # the option is in radians


def test_notes_of_paths_are_in_degrees_too(run: Run, waypoints: str) -> None:
    radians, degrees = (run("plan", "--path", waypoints, *words, "--json").document for words in ((), ("--degrees",)))
    assert " rad (joint" in str(radians["message"])
    assert " deg (joint" in str(degrees["message"])


def test_messages_are_in_degrees_too(run: Run) -> None:
    words = ("ik", "--position", "0.35", "-0.3", "0.3", "--approach", "1", "0", "0", "--degrees")
    parameter = run(*words, "--json").document["parameter"]
    assert f"parameter {parameter:.6g} deg" in run(*words).out


def test_a_pose_as_kinova_says_it(run: Run) -> None:
    angles = ("275.0", "167.4", "57.4", "241.0", "82.7", "75.5")
    kinova = run("fk", *angles, "--degrees", "--json").document["kinova"]
    numbers = map(repr, [*kinova["position_mm"], *kinova["angles_deg"]])
    document = run("ik", "--kinova", *numbers, "--seed", *angles, "--degrees", "--json").document
    assert np.allclose(document["q"], [float(angle) for angle in angles], rtol=0.0, atol=1e-6)
    assert "--kinova does not go with --down" in run("ik", "--kinova", *"123456", "--down", code=2).err
