"""Equalities that tie an arm's joints are refused; those that only tie what follows are not."""

from __future__ import annotations

from pathlib import Path

import pytest

import jacokin
from jacokin.errors import ModelError
from tests.robot_files import SCENE

ON_THE_ARM = {
    "connect": '<connect name="pin" body1="wrist" body2="pedestal" anchor="0 0 0"/>',
    "connect to the world": '<connect body1="fore" anchor="0 0 0"/>',
    "weld": '<weld body1="flange" body2="upper"/>',
    "weld of sites": '<weld site1="tool" site2="mark"/>',
    "joint": '<joint joint1="elbow" joint2="roll"/>',
    "joint to a value": '<joint joint1="elbow"/>',
    "tendon": '<tendon tendon1="fixed"/>',
    "tendon through sites": '<tendon tendon1="spatial"/>',
}
ELSEWHERE = {
    "fingers": '<joint joint1="finger_l" joint2="finger_r"/>',
    "finger to finger": '<connect body1="left" body2="right" anchor="0 0 0"/>',
    "a grasped object": '<weld body1="left" body2="box"/>',
    "a handle": '<weld body1="wrist" body2="handle"/>',
    "not active": '<weld body1="flange" body2="upper" active="false"/>',
    "tendon of the fingers": '<tendon tendon1="grip"/>',
    "within one link": '<connect site1="tool" site2="tool2"/>',
}


def with_equality(scene: Path, equality: str) -> Path:
    text = SCENE.replace('<site name="tool" pos', '<site name="tool2" pos="0 0 0.1"/><site name="tool" pos').replace(
        "<worldbody>", '<worldbody><body name="handle" mocap="true"/>'
    )
    tendons = """<tendon>
      <fixed name="fixed"><joint joint="elbow" coef="1"/><joint joint="finger_l" coef="1"/></fixed>
      <fixed name="grip"><joint joint="finger_l" coef="1"/><joint joint="finger_r" coef="-1"/></fixed>
      <spatial name="spatial"><site site="mark"/><site site="tool"/></spatial></tendon>"""
    path = scene.parent / "tied.xml"
    path.write_text(text.replace("</mujoco>", f"{tendons}<equality>{equality}</equality></mujoco>"))
    return path


@pytest.mark.parametrize("case", ON_THE_ARM)
def test_an_equality_on_the_arm_is_refused_by_name(scene: Path, case: str) -> None:
    with pytest.raises(ModelError, match=r"of the arm is coupled \((connect|weld|joint|tendon) equality"):
        jacokin.load_robot(with_equality(scene, ON_THE_ARM[case]))


def test_the_equality_is_named(scene: Path) -> None:
    with pytest.raises(ModelError, match="joint 'shoulder' of the arm is coupled.*connect equality 'pin'"):
        jacokin.load_robot(with_equality(scene, ON_THE_ARM["connect"]))


@pytest.mark.parametrize("case", ELSEWHERE)
def test_an_equality_elsewhere_changes_nothing(scene: Path, case: str) -> None:
    assert jacokin.load_robot(with_equality(scene, ELSEWHERE[case])).dof == 4
