"""URDF files: what is wrong is named, what is unusual and right is read."""

from __future__ import annotations

import pickle
import random
import re
import xml.etree.ElementTree as ET
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import event, given, settings
from hypothesis import strategies as st

import jacokin
from jacokin.errors import InvalidInputError, JacokinError, ModelError, ShapeError
from jacokin.model import Floor, Scene
from jacokin.model.descriptions import urdf
from jacokin.motion import move_joints
from jacokin.viewer.drawing import load_parts
from tests.robot_files import load_text, urdf_text

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
    "no upper": (robot_text('<limit lower="0"/>', "revolute"), "joint 'j': a <limit> has no upper"),
    "no limit": (robot_text("", "prismatic"), "joint 'j': a prismatic joint needs <limit>"),
    "huge": (robot_text('<origin xyz="1e999 0 0"/>'), "joint 'j': <origin> xyz=\"1e999 0 0\" is not finite"),
    "other digits": (robot_text('<origin xyz="\u0661 0 0"/>'), "is not made of numbers"),
    "half an inertia": (
        robot_text(link='<inertial><mass value="1"/><inertia ixx="1"/></inertial>'),
        "link 'a': a <inertia> has no ixy",
    ),
    "too many joints": (chain_text(201, "continuous"), "has 201 joints that move; at most 200"),
    "too many links": (chain_text(5000, "fixed"), "has 5001 links; at most 1000"),
    "too deep": ("<robot name='r'>" + "<x>" * 5000 + "</x>" * 5000 + "</robot>", "nested more than 100 deep"),
    "far away": (robot_text('<origin xyz="0 2e6 0"/>'), "joint 'j' is at (0, 2e+06, 0) m of the joint before it"),
    "two children": (robot_text('<child link="a"/>'), "joint 'j': its <joint> has more than one <child>: keep one"),
    "nothing": ('<robot name="r"><!-- of a macro --></robot>', "has no links: a xacro file that only defines a macro"),
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


@pytest.mark.slow
@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_a_damaged_urdf_is_read_or_named(seed: int) -> None:
    damage_and_check(seed)


@pytest.mark.slow
@settings(max_examples=300, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_many_damaged_urdfs_are_read_or_named(seed: int) -> None:
    damage_and_check(seed)


def damage_and_check(seed: int) -> None:
    """Deleted, doubled and emptied elements and attributes: `check` lets through only what has one tree."""
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
        robot = urdf.check(ET.tostring(tree, encoding="unicode"), "damaged")
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
    for _ in range(60):
        text = list(urdf_text())
        for _ in range(damage.randint(1, 3)):
            at = damage.randrange(len(text))
            text[at : at + damage.randint(0, 3)] = damage.choice(["", "<", '"', "0", "e", "-", "\x01", "link_2", " "])
        path.write_text("".join(text))
        try:
            read += jacokin.load_robot(path).dof > 0
        except JacokinError as error:  # both outcomes are right
            assert str(path) in str(error) or "base" in str(error)  # noqa: PT017
    assert 5 < read < 55
    assert capfd.readouterr().err == ""


def arm_text(limit: str = 'lower="-3" upper="3"', shape: str = "", head: str = "") -> str:
    """An arm of two joints with masses."""
    inertial = '<inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>'
    joints = "".join(
        f'<joint name="j{i}" type="revolute"><parent link="l{i}"/><child link="l{i + 1}"/><origin xyz="0.2 0 0"/>'
        f'<axis xyz="0 1 0"/><limit {limit}/></joint>'
        for i in range(2)
    )
    links = f'<link name="l0"/><link name="l1">{inertial}{shape}</link><link name="l2">{inertial}</link>'
    return f'<robot name="arm" {head}{links}{joints}</robot>'


@pytest.mark.parametrize(
    ("limit", "velocity", "effort"),
    [
        ('lower="-3" upper="3"', np.inf, np.inf),
        ('lower="-3" upper="3" velocity="2"', 2.0, np.inf),
        ('lower="-3" upper="3" effort="5"', np.inf, 5.0),
        ('lower="-3" upper="3" effort="0" velocity="0"', np.inf, np.inf),
        ('lower="-3" upper="3" effort="0.0" velocity="1"', 1.0, np.inf),
        ('lower="-3" upper="3" effort="1e-320" velocity="-0"', np.inf, np.inf),
    ],
)
def test_zero_and_nothing_stand_for_limits_that_are_not_given(
    tmp_path: Path, limit: str, velocity: float, effort: float, capfd: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "arm.urdf"
    path.write_text(arm_text(limit, head=">"))
    robot = jacokin.load_robot(path)
    np.testing.assert_array_equal(robot.velocity_limit, velocity)
    np.testing.assert_array_equal(robot.effort_limit, effort)
    assert any("no limits of velocity for j0, j1" in note for note in robot.notes) == np.isinf(velocity)
    assert any("no limits of effort for j0, j1" in note for note in robot.notes) == np.isinf(effort)
    start, goal = [0.0, 0.0], [0.5, 0.5]
    if np.isinf(velocity):
        with pytest.raises(
            InvalidInputError, match=r"arm.urdf\) gives no velocity limits for j0, j1; pass velocity_lim"
        ):
            move_joints(robot, start, goal)
        with pytest.raises(
            InvalidInputError, match=r"arm.urdf\) gives no velocity limits for j0, j1; pass velocity_lim"
        ):
            jacokin.Tracker(robot)
    assert move_joints(robot, start, goal, velocity_limit=1.0).success
    given = jacokin.load_robot(path, velocity_limit=[1.0, 2.0])
    for same in (given, pickle.loads(pickle.dumps(given)), given.with_payload(1.0, [0.0, 0.0, 0.0])):
        np.testing.assert_array_equal(same.velocity_limit, [1.0, 2.0])
        assert move_joints(same, start, goal).success
    assert not any("velocity" in note for note in given.notes)
    if np.isinf(effort):
        with pytest.raises(InvalidInputError, match=r"arm.urdf\) gives no effort limits for j0, j1; pass torque_limit"):
            move_joints(robot, start, goal, velocity_limit=1.0, torque_limit=True)
    assert move_joints(robot, start, goal, velocity_limit=1.0, torque_limit=100.0).success
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("value", [0.0, -1.0, np.nan, [1.0], "fast", np.inf])
def test_velocity_limits_are_checked(value: object) -> None:
    with pytest.raises(InvalidInputError, match="velocity_limit"):
        jacokin.load_robot(velocity_limit=value)  # type: ignore[arg-type]  # wrong on purpose


LOOKS = [
    '<visual><geometry><box size="0.1 0.1 0.1"/></geometry><material><color rgba="1 0 0"/></material></visual>',
    '<visual><geometry><box size="a b c"/></geometry></visual>',
    '<visual><geometry><mesh filename=""/></geometry></visual>',
    '<visual><geometry><mesh filename="nowhere.dae" scale="1 2"/></geometry></visual>',
    '<visual><origin xyz="nan 0 0"/><geometry><sphere/></geometry></visual>',
    "<visual/>",
    '<visual><geometry><cylinder radius="1" length="nan"/></geometry><material><color rgba="red"/></material></visual>',
]


@pytest.mark.parametrize("shape", LOOKS)
def test_looks_stop_nothing(tmp_path: Path, shape: str) -> None:
    path = tmp_path / "arm.urdf"
    collision = '<collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision>'
    text = arm_text(shape=shape + collision, head='><material name="m"><color rgba="1 2"/></material>')
    path.write_text(text)
    robot = jacokin.load_robot(path)
    assert robot.clearance([0.0, 0.0], Scene([Floor(-0.3)])) == pytest.approx(0.25)
    assert any("what cannot be drawn is left out" in note and "material 'm'" in note for note in robot.notes)
    load_parts(robot)


@pytest.mark.parametrize(
    ("shape", "message"),
    [
        ('<sphere radius="nan"/>', '<sphere> radius="nan" is not finite'),
        ('<cylinder length="1"/>', "a <cylinder> has no radius"),
        ('<capsule length="1"/>', "a <capsule> has no radius"),
        ('<mesh filename="a.stl" scale="1 1 1 1"/>', "must have 3 numbers"),
    ],
)
def test_a_malformed_collision_shape_matters_to_contact_only(tmp_path: Path, shape: str, message: str) -> None:
    path = tmp_path / "arm.urdf"
    path.write_text(arm_text(shape=f"<collision><geometry>{shape}</geometry></collision>", head=">"))
    robot = jacokin.load_robot(path)
    assert any("contact cannot be looked for" in note and message in note for note in robot.notes)
    with pytest.raises(ShapeError, match=re.escape(f"link 'l1': {message}" if message[0] == "a" else message)):
        robot.clearance([0.0, 0.0], Scene([Floor(-0.3)]))
    jacokin.model.write_urdf(robot, tmp_path / "again.urdf")
    assert " malformed=" not in (tmp_path / "again.urdf").read_text()


@pytest.mark.parametrize(
    ("moments", "got"),
    [((1, 1, 2), ""), ((0, 0, 0), ""), ((1, 1, 2.1), "got 1, 1, 2.1 kg m^2"), ((1, -1, 1), "got -1, 1, 1 kg m^2")],
)
def test_an_inertia_that_no_body_has_is_said(tmp_path: Path, moments: tuple[float, ...], got: str) -> None:
    path = tmp_path / "arm.urdf"
    xx, yy, zz = moments
    inertia = f'<inertia ixx="{xx}" ixy="0" ixz="0" iyy="{yy}" iyz="0" izz="{zz}"/>'
    path.write_text(re.sub(r"<inertia .*?/>", inertia, arm_text(head=">"), count=1))
    said = [note for note in jacokin.load_robot(path).notes if "inertia that no body has" in note]
    assert [note.split()[1] for note in said] == ["j0"] * bool(got)
    assert all(note.endswith(got) for note in said)


def test_a_robot_without_a_name_has_that_of_its_file(tmp_path: Path) -> None:
    assert load_text(tmp_path / "ur3.urdf", arm_text(head=">").replace(' name="arm"', "")).name == "ur3"


@pytest.mark.parametrize(
    "part", ["", "<mass value='2'/>", "<inertia ixx='1' ixy='0' ixz='0' iyy='1' iyz='0' izz='1'/>"]
)
def test_an_inertial_that_says_half_is_completed_or_left_out(tmp_path: Path, part: str) -> None:
    path = tmp_path / "arm.urdf"
    camera = f'<link name="camera"><inertial><origin xyz="0.1 0 0"/>{part}</inertial></link>'
    camera += '<joint name="to_camera" type="fixed"><parent link="l2"/><child link="camera"/></joint>'
    path.write_text(arm_text(head=">").replace("</robot>", f"{camera}</robot>"))
    robot = jacokin.load_robot(path)
    expected = "no <inertia>: its mass is in one point" if "mass" in part else "no <mass> and is left out"
    assert any("link 'camera'" in note and expected in note for note in robot.notes)
    assert robot.pin_model.inertias[2].mass == (3.0 if "mass" in part else 1.0)
    if "mass" in part:
        hung = jacokin.load_robot(path, base="l1").gravity([0.0])[0]
        path.write_text(arm_text(head=">"))
        np.testing.assert_allclose(
            hung - jacokin.load_robot(path, base="l1").gravity([0.0])[0], -2 * 9.81 * 0.1, rtol=1e-12
        )


@pytest.mark.parametrize(
    "foreign",
    [
        "<sensor:camera><sensor:noise/></sensor:camera>",
        '<xacro:property name="pi" value="3.14"/>',
        '<gz:plugin gz:name="x"><link name="l1"/></gz:plugin>',
        "<gazebo><controller:ros_camera name='c'/></gazebo>",
    ],
)
def test_prefixes_need_not_be_declared(tmp_path: Path, foreign: str) -> None:
    """ROS's parser knows no namespaces, and files that it takes are full of them."""
    for name, head in (("arm.urdf", ">"), ("arm.xml", 'xmlns="http://www.ros.org">')):
        path = tmp_path / name
        path.write_text("\n <?xml version='1.0'?>" + arm_text(head=head).replace("</robot>", f"{foreign}</robot>"))
        robot = jacokin.load_robot(path)
        assert robot.joint_names == ("j0", "j1")
        assert jacokin.crosscheck(robot, samples=3).within()


XACRO = 'xmlns:xacro="http://www.ros.org/wiki/xacro"'


@pytest.mark.parametrize(
    "head",
    [
        f'{XACRO}><xacro:property name="width" value="0.2"/>',
        f'{XACRO}><xacro:arg name="hand" default="true"/><xacro:property name="pi" value="3.14"/>',
        f'{XACRO}><xacro:macro name="wheel" params="side"><link name="wheel"/></xacro:macro>',
        'xmlns:gz="http://gazebosim.org"><gz:plugin name="p"/><gazebo reference="${link}"/>',
    ],
)
def test_definitions_of_xacro_that_nothing_uses_are_skipped(tmp_path: Path, head: str) -> None:
    robot = load_text(tmp_path / "ARM.URDF", arm_text(head=head))
    assert robot.joint_names == ("j0", "j1")
    assert any("xacro" in note for note in robot.notes) == ("xacro" in head)


@pytest.mark.parametrize(
    "text",
    [
        arm_text(head=f'{XACRO}><xacro:include filename="other.xacro"/>'),
        arm_text(head=f'{XACRO}><xacro:property name="w" value="${{2 * pi}}"/>'),
        arm_text(head=f'{XACRO}><xacro:property name="w" value="1"/><xacro:arm w="1"/>'),
        arm_text(head=f'{XACRO}><xacro:if value="true"><link name="x"/></xacro:if>'),
        arm_text('lower="${low}" upper="3"', head=">"),
        arm_text(shape='<visual><geometry><mesh filename="$(find arm)/a.dae"/></geometry></visual>', head=">"),
    ],
)
def test_real_xacro_says_how_it_is_expanded(tmp_path: Path, text: str) -> None:
    for name in ("arm.urdf", "arm.urdf.xacro"):
        (tmp_path / name).write_text(text)
        with pytest.raises(ModelError, match=rf"expand it: xacro {name} > out\.urdf"):
            jacokin.load_robot(tmp_path / name)


def test_some_masses_that_are_missing_are_said(tmp_path: Path) -> None:
    path = tmp_path / "arm.urdf"
    text = arm_text(head=">")
    path.write_text(text[: text.rindex("<inertial>")] + text[text.rindex("</inertial>") + len("</inertial>") :])
    robot = jacokin.load_robot(path)
    assert any("no masses between j1 and the next joint" in note for note in robot.notes)
    assert np.isfinite(robot.gravity([0.1, 0.2])).all()
