"""`jacokin info`: what a robot is."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import jacokin
from jacokin.model import SelfContact
from jacokin.model.descriptions import bundled
from tests import gripper_arms
from tests.cli.run import Run
from tests.model.measured_arms import drawn_arm
from tests.robot_files import skeleton, ur5_text


@pytest.mark.one_quick
@pytest.mark.parametrize("name", bundled.NAMES)
def test_info_of_each_bundled_robot(run: Run, name: str) -> None:
    document = run("info", name, "--json").document
    robot = jacokin.load_robot(name)
    assert [joint["name"] for joint in document["joints"]] == list(robot.joint_names)
    assert [frame["name"] for frame in document["frames"]] == list(robot.frames)
    assert document["home"] == robot.home.tolist()
    assert document["home_source"] == robot.home_source
    lower = [-np.inf if joint["lower"] is None else joint["lower"] for joint in document["joints"]]
    assert lower == robot.lower.tolist()
    assert all(joint["source"] in document["sources"] for joint in document["joints"])


def test_info_shows_datasheet_torques_beside_the_efforts(run: Run) -> None:
    joints = run("info", "--json").document["joints"]
    assert [joint["effort"] for joint in joints] == [40.0, 80.0, 40.0, 20.0, 20.0, 20.0]
    assert [joint["datasheet_torque"] for joint in joints] == [30.5, 30.5, 30.5, 6.8, 6.8, 6.8]
    table = run("info", "--degrees").out
    assert "47.000000" in table
    assert "313.000000" in table
    assert "datasheet" in table


def test_info_and_the_page_of_the_robots_say_the_same_of_a_home(run: Run) -> None:
    lines = (Path(__file__).parents[2] / "docs" / "robot.md").read_text().splitlines()
    assert run("info", "--json").document["home_source"] == "documented for the j2n6s300"
    for name in ("j2s6s200", "j2s7s300"):
        source = run("info", name, "--json").document["home_source"]
        assert any(f"`{name}`" in line and line.endswith(f": the home is {source}.") for line in lines)


@pytest.mark.slow
def test_info_of_a_file_names_the_file_as_source(run: Run) -> None:
    path = bundled.urdf_folder() / "j2n6s300.urdf"
    document = run("info", path, "--json").document
    assert document["sources"] == {"file": str(path)}
    assert document["joints"][0]["datasheet_torque"] is None


def test_info_says_what_a_calibration_says(run: Run, robot: jacokin.Robot, tmp_path: Path) -> None:
    path = tmp_path / "my_arm.toml"
    drawn_arm(robot, np.random.default_rng(1)).save(path)
    said = " ".join(run("info", "--calibration", path).out.split())
    assert "mrad of offset from the description" in said
    document = run("info", "--calibration", path, "--json").document
    assert document["calibration"]["file"] == str(path)
    assert document["calibration"]["joints"]["joint_1"]["scale"] == 1.0
    assert run("info", "--json").document["calibration"] is None
    refused = run("info", "j2s6s200", "--calibration", path, code=2)
    assert "is a calibration of 'j2n6s300', and this robot is 'j2s6s200'" in refused.err


def test_info_says_what_a_file_leaves_open(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "ARM.URDF"
    text = ur5_text('<collision><geometry><mesh filename="package://arm/a.stl"/></geometry></collision>')
    path.write_text(text.replace('effort="1"', 'effort="0"'))
    notes = run("info", path, "--json").document["notes"]
    assert notes == list(jacokin.load_robot(path).notes)
    table = run("info", path).out
    for word in ("no limits of effort", "no masses", "contact cannot be looked for", "'package://arm/a.stl'"):
        assert any(word in note for note in notes)
        assert word in " ".join(table.split())
    assert run("info", "--json").document["notes"] == []


def test_info_takes_the_robot_as_every_other_command_does(run: Run) -> None:
    assert run("info", "--robot", "j2s6s200", "--json").document == run("info", "j2s6s200", "--json").document
    both = run("info", "j2s6s200", "--robot", "j2s6s200", code=2).err
    assert both == "jacokin: give the robot once: as an argument, or with --robot\n"


def test_info_is_the_page_that_says_what_an_arm_is_and_can_do(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "arm.urdf"
    text = skeleton("j1>l1 j2>l2 j3>l3 j4>l4 j5>l5 +tool0 +flange gripper>jaw[0,1]")
    path.write_text(
        text.replace("</link>", '<collision><geometry><sphere radius="0.02"/></geometry></collision></link>')
    )
    robot = jacokin.load_robot(path)
    document = run("info", path, "--json").document
    assert (document["default_frame"], document["other_tool_frames"]) == ("tool0", ["flange"])
    assert document["structure"]["gives"].startswith("every configuration about a FreeAxis")
    assert document["shapes"] == {"shapes": 8, "pairs": SelfContact(robot).pairs}
    assert document["masses"] == "not given: no torques"
    page = " ".join(run("info", path).out.split())
    for said in (
        "other tools flange",
        "joint 'gripper' is not part of the arm",
        "tip='jaw' takes it in",
        "no masses: what needs",
    ):
        assert said in page
    run("info", path, "--lock", "gripper=0.5", "--json")
    assert "'gripper'] = 9.0: the joint moves from 0.0 to 1.0" in run("info", path, "--lock", "gripper=9", code=2).err


@pytest.mark.parametrize(
    ("name", "gives"),
    [("j2n6s300", "every configuration of a pose, and curves"), ("j2s7s300", "curves of configurations")],
)
def test_info_says_what_a_structure_gives(run: Run, name: str, gives: str) -> None:
    document = run("info", name, "--json").document
    assert document["structure"]["gives"].startswith(gives)
    assert document["masses"].endswith("kg that joints move")
    assert document["shapes"]["shapes"] > 40


def test_pairs_that_an_srdf_disables_are_not_among_those_that_may_touch(run: Run, tmp_path: Path) -> None:
    path, srdf = tmp_path / "arm.urdf", tmp_path / "other.srdf"
    shape = '<collision><geometry><sphere radius="0.01"/></geometry></collision></link>'
    path.write_text(skeleton("j1>l1 j2>l2 j3>l3 j4>l4").replace("</link>", shape))
    pair = '<disable_collisions link1="l1" link2="{}" reason="Never"/>'
    srdf.write_text(f"<robot name='arm'>{pair.format('l3')}{pair.format('l4')}</robot>")
    found = [run("info", path, "--json", *words).document["shapes"] for words in ((), ("--srdf", str(srdf)))]
    assert found[0]["pairs"] - found[1]["pairs"] == 2


def test_info_says_how_wide_the_gripper_opens(run: Run, tmp_path: Path) -> None:
    gripper_arms.load("panda", tmp_path)
    path = str(tmp_path / "panda.urdf")
    assert "opens by 80 mm from 0 to 0.04, for 68 mm" in " ".join(run("info", path).out.split())
    found = run("info", path, "--json").document["gripper"]
    assert found == pytest.approx({"open": 0.04, "shut": 0.0, "width": 0.08, "span": 0.068})
    assert run("info", "gen3_6dof", "--json").document["gripper"] is None
