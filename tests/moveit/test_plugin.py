"""The plugin for MoveIt, compiled against stubs of the interface that it implements: ROS is not needed, nor tried."""

from __future__ import annotations

import shutil
import subprocess
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import pytest

import jacokin
from jacokin.ik import IKSolver, export_c
from jacokin.kernels import library

HERE = Path(__file__).parent
PLUGIN = HERE.parents[1] / "integrations" / "moveit"
WARNINGS = ("-Wall", "-Wextra", "-Werror", "-pedantic", "-Wshadow", "-Woverloaded-virtual")

pytestmark = pytest.mark.skipif(shutil.which("c++") is None, reason="needs a C++ compiler")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An export of both kinds of arm, and the program that drives the plugin."""
    made = tmp_path_factory.mktemp("moveit")
    for name in ("j2n6s300", "j2s7s300"):
        export_c(IKSolver(jacokin.load_robot(name)), made)
    sources = [HERE / "drive.cpp", *(PLUGIN / "src").glob("*.cpp")]
    folders = [f"-I{place}" for place in (HERE / "stubs", PLUGIN / "include", made / "include")]
    link = [made / "lib" / library.PATH.name, f"-Wl,-rpath,{made / 'lib'}", "-pthread", "-o", made / "drive"]
    words = ["c++", "-std=c++17", *WARNINGS, *folders, *map(str, [*sources, *link])]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return made


def drive(folder: Path, name: str) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    """Solutions (k, dof) that the plugin gives for home, after it has passed the program's own checks."""
    words = [folder / "drive", folder / f"{name}.jacokin"]
    done = subprocess.run(words, capture_output=True, text=True, check=False, timeout=120)
    assert done.returncode == 0, done.stderr
    return np.array([[float(word) for word in line.split()] for line in done.stdout.splitlines()])


@pytest.mark.slow
def test_six_joints_give_every_branch_of_the_package(folder: Path) -> None:
    robot = jacokin.load_robot("j2n6s300")
    found = IKSolver(robot).solve_all(robot.forward_kinematics(robot.home), robot.home)
    np.testing.assert_allclose(drive(folder, "j2n6s300"), found.q_within_limits, atol=1e-6)


@pytest.mark.slow
def test_seven_joints_with_joint_3_held_give_what_the_family_has_there(folder: Path) -> None:
    robot = jacokin.load_robot("j2s7s300")
    family = IKSolver(robot).solve_all(robot.forward_kinematics(robot.home), robot.home)
    expected = [each.at(robot.home[2]) for each in family.intervals if each.contains(float(robot.home[2]))]
    rows = drive(folder, "j2s7s300")
    assert len(rows) == len(expected) > 1
    for q in expected:
        away = np.abs(np.remainder(rows - q + np.pi, 2.0 * np.pi) - np.pi)
        assert away.max(axis=1).min() < 1e-6


def test_names_in_the_files_of_the_package_agree() -> None:
    cmake = (PLUGIN / "CMakeLists.txt").read_text(encoding="utf-8")
    description = ElementTree.parse(PLUGIN / "jacokin_kinematics_plugin.xml").getroot()
    (described,) = description.iter("class")
    assert f"add_library({description.get('path')} SHARED" in cmake
    source = (PLUGIN / "src" / "kinematics_plugin.cpp").read_text(encoding="utf-8")
    assert f"PLUGINLIB_EXPORT_CLASS({described.get('type')}, {described.get('base_class_type')})" in source
    yaml = (PLUGIN / "config" / "kinematics.yaml").read_text(encoding="utf-8")
    assert f"kinematics_solver: {described.get('name')}" in yaml
    manifest = ElementTree.parse(PLUGIN / "package.xml").getroot()
    assert f"project({manifest.findtext('name')} CXX)" in cmake
    for each in manifest.iter("depend"):
        assert f"find_package({each.text} REQUIRED)" in cmake


def test_the_build_links_targets_of_every_package_and_calls_nothing_deprecated() -> None:
    cmake = (PLUGIN / "CMakeLists.txt").read_text(encoding="utf-8")
    assert "ament_target_dependencies" not in cmake
    linked = cmake.split("target_link_libraries(jacokin_kinematics_plugin")[1].split(")")[0]
    manifest = ElementTree.parse(PLUGIN / "package.xml").getroot()
    assert {word.split("::")[0] for word in linked.split() if "::" in word} == {
        "jacokin",
        *(each.text for each in manifest.iter("depend")),
    }
