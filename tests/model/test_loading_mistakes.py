"""What is wrong with a file or an argument is said by name."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from pathlib import Path

import pytest

import jacokin
from jacokin.errors import InvalidInputError, ModelError, UnknownNameError
from tests.robot_files import SCENE, urdf_text


def test_unknown_robots_and_missing_files(tmp_path: Path) -> None:
    with pytest.raises(UnknownNameError, match="Did you mean 'j2n6s300'"):
        jacokin.load_robot("j2n6s30")
    with pytest.raises(ModelError, match="no such file"):
        jacokin.load_robot(tmp_path / "nothing.urdf")
    stray = tmp_path / "robot.txt"
    stray.write_text("robot")
    with pytest.raises(ModelError, match="unknown file type"):
        jacokin.load_robot(stray)
    with pytest.raises(InvalidInputError, match="bundled name or a path"):
        jacokin.load_robot(42)  # type: ignore[arg-type]  # wrong on purpose
    with pytest.raises(UnknownNameError, match="tool0.*end_effector"):
        jacokin.load_robot(tip="tool0")


BROKEN: dict[str, tuple[Callable[[str], str], str]] = {
    "truncated": (lambda text: text[: len(text) // 2], "not well-formed XML"),
    "other root": (lambda text: "<sdf/>", "root element is <sdf>"),
    "unknown parent": (
        lambda text: text.replace('parent link="link_2"', 'parent link="link_22"'),
        "'link_22' does not exist",
    ),
    "cycle": (
        lambda text: text.replace(
            "</robot>",
            '<joint name="back" type="fixed"><parent link="link_6"/><child link="link_base"/></joint></robot>',
        ),
        "form a cycle",
    ),
    "two parents": (
        lambda text: text.replace(
            "</robot>", '<joint name="more" type="fixed"><parent link="link_1"/><child link="link_4"/></joint></robot>'
        ),
        "two parents",
    ),
    "NaN origin": (lambda text: text.replace('xyz="0.0 -0.41 0.0"', 'xyz="0.0 nan 0.0"', 1), "not finite"),
    "words for numbers": (lambda text: text.replace('xyz="0.0 -0.41 0.0"', 'xyz="a b c"', 1), "not made of numbers"),
    "two numbers": (lambda text: text.replace('xyz="0.0 -0.41 0.0"', 'xyz="0.0 1.0"', 1), "must have 3 numbers"),
    "inverted limits": (lambda text: text.replace('lower="0.8203', 'lower="9.8203'), "above upper limit"),
    "negative mass": (lambda text: text.replace('<mass value="', '<mass value="-', 1), "negative"),
    "zero axis": (lambda text: re.sub('<axis xyz="[^"]*"', '<axis xyz="0 0 0"', text), "unit vector"),
    "axis without numbers": (lambda text: re.sub('<axis xyz="[^"]*"', "<axis", text), "the axis has no xyz"),
    "unknown joint type": (
        lambda text: text.replace('type="continuous"', 'type="spinning"', 1),
        "unknown type 'spinning'",
    ),
    "twice the same link": (lambda text: text.replace("</robot>", '<link name="link_1"/></robot>'), "more than once"),
    "loose link": (lambda text: text.replace("</robot>", '<link name="adrift"/></robot>'), "one root link"),
}


@pytest.mark.parametrize("case", BROKEN)
def test_broken_urdf_is_named(case: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    change, message = BROKEN[case]
    text = change(urdf_text())
    assert text != urdf_text()
    path = tmp_path / "robot.urdf"
    path.write_text(text)
    with pytest.raises(ModelError, match=message) as error:
        jacokin.load_robot(path)
    assert str(path) in str(error.value)
    assert capfd.readouterr().err == ""  # no parser noise beside the message


def test_mjcf_mistakes_are_named(tmp_path: Path, scene: Path) -> None:
    broken = tmp_path / "broken.xml"
    broken.write_text(SCENE[:400])
    with pytest.raises(ModelError, match="MuJoCo cannot load"):
        jacokin.load_robot(broken)
    ball = tmp_path / "ball.xml"
    ball.write_text(
        SCENE.replace(
            '<joint name="elbow" axis="0 1 0" ref="0.7" range="-1 1" limited="false"/>',
            '<joint name="elbow" type="ball"/>',
        )
    )
    with pytest.raises(ModelError, match="'elbow' in the chain has 3 degrees of freedom"):
        jacokin.load_robot(ball)
    with pytest.raises(ModelError, match="'float' in the chain has 6"):
        jacokin.load_robot(scene, tip="box")
    huge = tmp_path / "huge.xml"
    huge.write_text(SCENE.replace('<body name="fore" pos="0 0 0.3">', '<body name="fore" quat="0 0 -1e300 0">'))
    with pytest.raises(ModelError, match=r"body_quat\[4\] of the compiled model has norm 0"):
        jacokin.load_robot(huge)
    two = tmp_path / "two.xml"
    two.write_text("""<mujoco><worldbody>
      <body name="a"><joint name="ja"/><geom size="0.1"/></body>
      <body name="b"><joint name="jb"/><geom size="0.1"/></body></worldbody></mujoco>""")
    with pytest.raises(ModelError, match=r"several chains start at the base \(ja, jb\).*tip="):
        jacokin.load_robot(two)
    assert jacokin.load_robot(two, tip="b").joint_names == ("jb",)


def test_malformed_arguments_are_named() -> None:
    arguments: list[tuple[dict[str, object], str]] = [
        ({"finger_angle": "a"}, "finger_angle"),
        ({"finger_angle": True}, "finger_angle"),
        ({"limits": "x"}, "limits"),
        ({"limits": {"joint_2": "12"}}, "joint_2"),
        ({"limits": {"joint_2": (math.inf, math.inf)}}, "no angle within 1e6 rad"),
        ({"limits": {"joint_2": (-math.inf, -math.inf)}}, "no angle within 1e6 rad"),
        ({"base": ["x"]}, "base"),
    ]
    for keywords, message in arguments:
        with pytest.raises(InvalidInputError, match=message):
            jacokin.load_robot(**keywords)  # type: ignore[arg-type]  # wrong on purpose
    with pytest.raises(ModelError, match="no such file"):
        jacokin.load_robot("a" * 5000 + ".urdf")


def test_nan_in_an_mjcf_is_named(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "nan.xml"
    path.write_text(SCENE.replace('<include file="common.xml"/>', "").replace('pos="0 0 0.3"', 'pos="nan 0 0.3"'))
    with pytest.raises(ModelError, match='<body> fore: pos="nan 0 0.3" is not finite'):
        jacokin.load_robot(path)
    assert capfd.readouterr().err == ""


def test_coupled_arm_joints_are_refused(tmp_path: Path, scene: Path) -> None:
    mimic = tmp_path / "mimic.urdf"
    follow = '<mimic joint="joint_4" multiplier="2"/>'
    mimic.write_text(
        urdf_text().replace(
            '<joint name="joint_5" type="continuous">', f'<joint name="joint_5" type="continuous">{follow}'
        )
    )
    with pytest.raises(ModelError, match="'joint_5' of the arm is coupled"):
        jacokin.load_robot(mimic)
    tied = scene.parent / "tied.xml"
    couple = '<equality><joint joint1="{}" joint2="{}"/></equality></mujoco>'
    tied.write_text(SCENE.replace("</mujoco>", couple.format("elbow", "roll")))
    with pytest.raises(ModelError, match="coupled"):
        jacokin.load_robot(tied)
    tied.write_text(SCENE.replace("</mujoco>", couple.format("finger_l", "finger_r")))
    assert jacokin.load_robot(tied).dof == 4


def test_fingers_take_only_angles_they_have() -> None:
    with pytest.raises(InvalidInputError, match="the fingers move from 0.15 to 1.35 rad"):
        jacokin.load_robot(finger_angle=100.0)
