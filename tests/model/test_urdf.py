"""URDF files: what is wrong is named, what is unusual and right is read."""

from __future__ import annotations

import random
import re
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest
from hypothesis import event, given, settings
from hypothesis import strategies as st

import jacokin
from jacokin.errors import JacokinError, ModelError
from jacokin.model.descriptions import urdf
from tests.robot_files import urdf_text

JOINT = '<joint name="j" type="{kind}"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/>{inside}</joint>'
ROBOT = '<robot name="r"><link name="a">{link}</link><link name="b"/>{joint}</robot>'


def robot_text(inside: str = "", kind: str = "continuous", link: str = "") -> str:
    return ROBOT.format(link=link, joint=JOINT.format(kind=kind, inside=inside))


def chain_text(joints: int, kind: str) -> str:
    links = "".join(f'<link name="l{i}"/>' for i in range(joints + 1))
    tree = "".join(
        f'<joint name="j{i}" type="{kind}"><parent link="l{i}"/><child link="l{i + 1}"/><axis xyz="0 0 1"/></joint>'
        for i in range(joints)
    )
    return f'<robot name="long">{links}{tree}</robot>'


MISTAKES = {
    "damping": (robot_text('<dynamics damping="nan"/>'), "joint 'j': <dynamics> damping=\"nan\" is not finite"),
    "friction": (robot_text('<dynamics friction="1_0"/>'), '<dynamics> friction="1_0" is not made of numbers'),
    "empty dynamics": (robot_text("<dynamics/>"), "joint 'j': a <dynamics> has neither damping nor friction"),
    "mimic": (robot_text('<mimic joint="j" multiplier="nan"/>'), "joint 'j': <mimic> multiplier=\"nan\""),
    "mimic of nothing": (robot_text("<mimic/>"), "joint 'j': a <mimic> has no joint"),
    "mimic of nobody": (robot_text('<mimic joint="x"/>'), "joint 'j': follows joint 'x', which does not exist"),
    "safety": (
        robot_text('<safety_controller k_velocity="1" soft_lower_limit="-inf"/>'),
        "joint 'j': <safety_controller> soft_lower_limit=\"-inf\" is not finite",
    ),
    "empty safety": (robot_text("<safety_controller/>"), "joint 'j': a <safety_controller> has no k_velocity"),
    "calibration": (robot_text('<calibration rising="x"/>'), "joint 'j': <calibration> rising=\"x\" is not made of"),
    "no lower": (
        robot_text('<limit upper="1" effort="1" velocity="1"/>', "revolute"),
        "joint 'j': a <limit> has no lower",
    ),
    "no effort": (robot_text('<limit lower="0" upper="1"/>', "revolute"), "joint 'j': a <limit> has no effort"),
    "no limit": (robot_text("", "prismatic"), "joint 'j': a prismatic joint needs <limit>"),
    "no name": (robot_text().replace('robot name="r"', "robot"), "a <robot> has no name"),
    "huge": (robot_text('<origin xyz="1e999 0 0"/>'), "joint 'j': <origin> xyz=\"1e999 0 0\" is not finite"),
    "other digits": (robot_text('<origin xyz="\u0661 0 0"/>'), "is not made of numbers"),
    "no inertia": (
        robot_text(link='<inertial><mass value="1"/></inertial>'),
        "link 'a': its <inertial> has no <inertia>",
    ),
    "half an inertia": (
        robot_text(link='<inertial><mass value="1"/><inertia ixx="1"/></inertial>'),
        "link 'a': a <inertia> has no ixy",
    ),
    "shape": (
        robot_text(link='<collision><geometry><sphere radius="nan"/></geometry></collision>'),
        "link 'a': <sphere> radius=\"nan\" is not finite",
    ),
    "too many joints": (chain_text(201, "continuous"), "has 201 joints that move; at most 200"),
    "too many links": (chain_text(5000, "fixed"), "has 5001 links; at most 1000"),
    "too deep": ("<robot name='r'>" + "<x>" * 5000 + "</x>" * 5000 + "</robot>", "nested more than 100 deep"),
    "far away": (robot_text('<origin xyz="0 2e6 0"/>'), "joint 'j' is at (0, 2e+06, 0) m of the joint before it"),
    "half a cylinder": (
        robot_text(link='<collision><geometry><cylinder length="1"/></geometry></collision>'),
        "link 'a': a <cylinder> has no radius",
    ),
    "two children": (robot_text('<child link="a"/>'), "joint 'j': its <joint> has more than one <child>"),
    "xacro": (
        '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:arm/></robot>',
        "is a xacro file, not a URDF",
    ),
}


@pytest.mark.parametrize("case", MISTAKES)
def test_the_element_at_fault_is_named(case: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    text, message = MISTAKES[case]
    path = tmp_path / "robot.urdf"
    path.write_text(text)
    with pytest.raises(ModelError, match=re.escape(message)) as error:
        jacokin.load_robot(path)
    assert str(error.value).startswith(str(path)) or case == "far away"
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("blank", ["\t", "\n", "  ", "&#9;", "&#10;"])
def test_any_white_space_may_stand_between_numbers(tmp_path: Path, blank: str) -> None:
    path = tmp_path / "robot.urdf"
    path.write_text(robot_text(f'<origin xyz="1{blank}2{blank}3" rpy="0{blank}0{blank}0"/>'))
    assert jacokin.load_robot(path).forward_kinematics([0.0]).translation.tolist() == [1.0, 2.0, 3.0]


def test_a_long_chain_is_read(tmp_path: Path) -> None:
    path = tmp_path / "robot.urdf"
    path.write_text(chain_text(999, "fixed").replace('"j998" type="fixed"', '"j998" type="continuous"'))
    assert jacokin.load_robot(path).dof == 1
    path.write_text(chain_text(200, "continuous"))
    assert jacokin.load_robot(path).dof == 200


def test_what_is_for_other_programs_does_not_matter(tmp_path: Path) -> None:
    path = tmp_path / "robot.urdf"
    path.write_text(
        urdf_text().replace(
            "</robot>",
            "<gazebo><plugin><a>nan</a></plugin></gazebo><transmission name='t'><x/></transmission>"
            "<mujoco><compiler fusestatic='true' angle='degree'/></mujoco></robot>",
        )
    )
    robot = jacokin.load_robot(path)
    assert jacokin.crosscheck(robot, samples=20).within()
    assert robot.home_source.startswith("documented")


@settings(max_examples=150, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_a_damaged_urdf_is_read_or_named(seed: int) -> None:
    """Deleted, doubled and emptied elements and attributes: `checked` lets through only what has one tree."""
    damage = random.Random(seed)
    tree = ET.fromstring(urdf_text())
    for _ in range(damage.randint(1, 3)):
        parent = damage.choice([element for element in tree.iter() if len(element)])
        child = damage.choice(list(parent))
        act = damage.randrange(4)
        if act == 0:
            parent.remove(child)
        elif act == 1:
            parent.append(child)
        elif child.attrib:
            attribute = damage.choice(list(child.attrib))
            values = ["", "nan", "1e400", "0 0", "-1", "link_3", child.get(attribute, "") + "0"]
            child.set(attribute, damage.choice(values))
            if act == 3:
                del child.attrib[attribute]
    try:
        robot = urdf.checked(ET.tostring(tree, encoding="unicode"), "damaged")
    except ModelError as error:
        event("refused")
        assert str(error).startswith("damaged: ")  # noqa: PT017 - both outcomes are right
        robot = ET.fromstring(urdf_text())
    children = [element.get("link") for element in robot.findall("joint/child")]
    assert len(set(children)) == len(children) == len(robot.findall("link")) - 1


def test_damaged_files_make_a_robot_or_a_message(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    damage = random.Random(7)
    path = tmp_path / "robot.urdf"
    read = 0
    for _ in range(150):
        text = list(urdf_text())
        for _ in range(damage.randint(1, 3)):
            at = damage.randrange(len(text))
            text[at : at + damage.randint(0, 3)] = damage.choice(["", "<", '"', "0", "e", "-", "\x01", "link_2", " "])
        path.write_text("".join(text))
        try:
            read += jacokin.load_robot(path).dof > 0
        except JacokinError as error:  # both outcomes are right
            assert str(path) in str(error) or "base" in str(error)  # noqa: PT017
    assert 10 < read < 140
    assert capfd.readouterr().err == ""


TORSO = """<robot name="torso">{links}
  <joint name="lift" type="prismatic"><parent link="floor"/><child link="torso"/><axis xyz="0 0 1"/>
    <limit lower="0" upper="1" effort="1" velocity="1"/></joint>{arms}</robot>"""


def torso_text(arms: dict[str, int]) -> str:
    links, joints = ['<link name="floor"/><link name="torso"/>'], []
    for side, count in arms.items():
        parent = "torso"
        for i in range(count):
            child = f"{side}_{i}"
            links.append(f'<link name="{child}"/>')
            joints.append(
                f'<joint name="{child}_joint" type="continuous"><parent link="{parent}"/><child link="{child}"/>'
                '<origin xyz="0.1 0.2 0.3"/><axis xyz="0 1 0"/></joint>'
            )
            parent = child
    return TORSO.format(links="".join(links), arms="".join(joints))


def test_arms_on_a_torso_ask_for_the_tip(tmp_path: Path) -> None:
    path = tmp_path / "torso.urdf"
    path.write_text(torso_text({"head": 2, "left": 7, "right": 7}))
    with pytest.raises(ModelError, match=r"branches at joint 'lift'.*tip=.*left_6, right_6, head_1"):
        jacokin.load_robot(path)
    assert jacokin.load_robot(path, tip="left_6").dof == 8
    assert jacokin.load_robot(path, tip="left_6", base="torso").dof == 7
    path.write_text(torso_text({"left": 1, "right": 1}))  # a gripper on a slide
    assert jacokin.load_robot(path).joint_names == ("lift",)


def test_a_robot_without_masses_agrees_with_itself(tmp_path: Path, rng: np.random.Generator) -> None:
    path = tmp_path / "bare.urdf"
    path.write_text(torso_text({"left": 5}))
    report = jacokin.crosscheck(jacokin.load_robot(path), samples=50, rng=rng)
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
