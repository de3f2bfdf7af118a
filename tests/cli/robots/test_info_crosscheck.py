"""`jacokin info` and `jacokin crosscheck`: what a robot is, and whether two descriptions agree."""

from __future__ import annotations

import numpy as np
import pytest

import jacokin
from jacokin.model.descriptions import bundled
from tests.cli.run import Run


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


def test_info_of_a_file_names_the_file_as_source(run: Run) -> None:
    path = bundled.urdf_folder() / "j2n6s300.urdf"
    document = run("info", str(path), "--json").document
    assert document["sources"] == {"file": str(path)}
    assert document["joints"][0]["datasheet_torque"] is None


def test_crosscheck_of_the_same_arm_passes(run: Run) -> None:
    answer = run("crosscheck", "--samples", "20", "--json")
    assert answer.code == 0
    assert answer.document["within_tolerance"] is True
    assert max(row["value"] for row in answer.document["deviations"]) < 1e-11


def test_crosscheck_of_different_arms_fails(run: Run) -> None:
    answer = run("crosscheck", "j2n6s300", "j2s6s300", "--samples", "5")
    assert answer.code == 1
    assert "DIFFERS" in answer.out


def test_crosscheck_tolerance_is_heeded(run: Run) -> None:
    assert run("crosscheck", "--samples", "5", "--tolerance", "0").code == 1
    assert run("crosscheck", "j2n6s300", "j2s6s300", "--samples", "5", "--tolerance", "100").code == 0


def test_crosscheck_with_frames_and_joints_by_name(run: Run) -> None:
    words = ["crosscheck", "j2n6s300", "j2n6s300", "--samples", "5", "--json"]
    answer = run(*words, "--joint", "joint_1=joint_1", "--frame", "end_effector=end_effector")
    frames = {row["frame"] for row in answer.document["deviations"]}
    assert frames == {"end_effector", None}


def test_crosscheck_with_bases_of_their_own(run: Run) -> None:
    urdf, mjcf = (str(bundled.urdf_folder() / f"j2n6s300.{ending}") for ending in ("urdf", "xml"))
    words = ("crosscheck", urdf, mjcf, "--samples", "5", "--base", "link_1", "--json")
    same = run(*words, "--second-base", "link_1")
    assert same.code == 0
    assert run(*words).document == same.document
    assert "'lnk'" in run(*words, "--second-base", "lnk").err
