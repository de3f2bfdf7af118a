"""Two descriptions, or two engines, compared."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import jacokin
import jacokin.model
from jacokin import Robot
from jacokin.errors import InvalidInputError
from jacokin.model import NAMES, urdf_folder
from jacokin.model.descriptions.bundled import JACOS
from tests.gripper_arms import panda_text
from tests.robot_files import load_text, torso_text, ur5_text


def test_a_rotation_differs_by_an_angle(tmp_path: Path) -> None:
    """Two thirds of pi about a diagonal: 2.094 rad, of which the chord would be 1.732."""
    one, other = tmp_path / "one.urdf", tmp_path / "other.urdf"
    one.write_text(ur5_text())
    turned = '<link name="tool"/><joint name="t" type="fixed"><parent link="l6"/><child link="tool"/>{}</joint></robot>'
    one.write_text(ur5_text().replace("</robot>", turned.format("")))
    other.write_text(
        ur5_text().replace("</robot>", turned.format('<origin rpy="1.5707963267948966 0 1.5707963267948966"/>'))
    )
    a, b = (jacokin.load_robot(path, tip="tool") for path in (one, other))
    report = jacokin.crosscheck(a, b, samples=5, frame_map={"tool": "tool"})
    assert report.worst("rotation").value == pytest.approx(2.0 * np.pi / 3.0, abs=1e-12)


@pytest.mark.one_quick
@pytest.mark.parametrize("samples", [100, pytest.param(400, marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", NAMES)
def test_every_frame_agrees_with_mujoco(
    name: str, samples: int, bundled: Callable[[str], Robot], rng: np.random.Generator
) -> None:
    robot = bundled(name)
    report = jacokin.crosscheck(robot, samples=samples, rng=rng)
    assert report.within(), str(report)
    compared = {row.frame for row in report.deviations if row.frame}
    assert {"link_base", "link_6", "wristsite", "end_effector"} <= compared
    assert ("hand" in compared) == (name not in ("gen3", "gen3_6dof"))
    assert ("gripsite" in compared) == (name in JACOS)
    assert ("pinchsite" in compared) == name.endswith("300")


def test_masses_that_are_not_given_are_said(tmp_path: Path) -> None:
    """Two engines agree that nothing weighs anything, which says nothing of an arm."""
    weighing = load_text(tmp_path / "panda.urdf", panda_text())
    weightless = load_text(tmp_path / "bare.urdf", re.sub("<inertial>.*?</inertial>", "", panda_text()))
    assert jacokin.crosscheck(weighing, samples=5).notes == ()
    for arms in ((weightless,), (weighing, weightless), (weightless, weighing)):
        (note,) = jacokin.crosscheck(*arms, samples=5).notes
        assert note == "panda (urdf) gives no masses: its mass matrix and torques are zero"


def test_absurd_requests_are_refused(robot: Robot) -> None:
    with pytest.raises(InvalidInputError, match="too large"):
        robot.sample(np.random.default_rng(0), 10**15)
    with pytest.raises(InvalidInputError, match="robot_a"):
        jacokin.crosscheck("j2n6s300")  # type: ignore[arg-type]  # wrong on purpose
    with pytest.raises(InvalidInputError, match="robot_b"):
        jacokin.crosscheck(robot, "x")  # type: ignore[arg-type]  # wrong on purpose
    with pytest.raises(InvalidInputError, match="frame_map"):
        jacokin.crosscheck(robot, frame_map=["a"])  # type: ignore[arg-type]  # wrong on purpose
    with pytest.raises(InvalidInputError, match="joint_map"):
        jacokin.crosscheck(robot, joint_map=["a"])  # type: ignore[arg-type]  # wrong on purpose


def test_a_user_s_urdf_passes_its_own_crosscheck(rng: np.random.Generator) -> None:
    robot = jacokin.load_robot(urdf_folder() / "j2n6s300.urdf")
    assert robot.source.bundled is None
    report = jacokin.crosscheck(robot, samples=100, rng=rng)
    assert report.within(), str(report)


def test_a_robot_without_masses_agrees_with_itself(tmp_path: Path, rng: np.random.Generator) -> None:
    report = jacokin.crosscheck(load_text(tmp_path / "bare.urdf", torso_text({"left": 5})), samples=50, rng=rng)
    assert report.within(), str(report)
    assert report.worst("mass_matrix").value == 0.0


@pytest.mark.parametrize("inertia", ["9 1 1", "0 0 0", "1 2 3.5", "-1 1 1"])
def test_inertias_that_no_body_has_are_compared_as_the_file_says(
    tmp_path: Path, inertia: str, rng: np.random.Generator
) -> None:
    xx, yy, zz = inertia.split()
    inertial = (
        f'<inertial><origin xyz="0.1 0.2 0.3" rpy="0.4 0.5 0.6"/><mass value="2"/>'
        f'<inertia ixx="{xx}" ixy="0.1" ixz="0" iyy="{yy}" iyz="0" izz="{zz}"/></inertial>'
    )
    path = tmp_path / "odd.urdf"
    path.write_text(torso_text({"left": 4}).replace('<link name="left_1"/>', f'<link name="left_1">{inertial}</link>'))
    report = jacokin.crosscheck(jacokin.load_robot(path), samples=50, rng=rng)
    assert report.within(), str(report)
