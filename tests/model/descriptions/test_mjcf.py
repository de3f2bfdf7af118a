"""MJCF files: what MuJoCo sees is what is read; joints that an equality ties are refused."""

from __future__ import annotations

import math
import os
from pathlib import Path

import mujoco
import numpy as np
import pytest

import jacokin
import jacokin.model
from jacokin.errors import InvalidInputError, ModelError
from jacokin.model import urdf_folder
from jacokin.motion import move_joints
from tests.optional import needs_dm_control
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


ELSEWHERE = {
    "fingers": '<joint joint1="finger_l" joint2="finger_r"/>',
    "finger to finger": '<connect body1="left" body2="right" anchor="0 0 0"/>',
    "a grasped object": '<weld body1="left" body2="box"/>',
    "a handle": '<weld body1="wrist" body2="handle"/>',
    "not active": '<weld body1="flange" body2="upper" active="false"/>',
    "tendon of the fingers": '<tendon tendon1="grip"/>',
    "within one link": '<connect site1="tool" site2="tool2"/>',
}


@pytest.mark.parametrize("case", ELSEWHERE)
def test_an_equality_elsewhere_changes_nothing(scene: Path, case: str) -> None:
    assert jacokin.load_robot(with_equality(scene, ELSEWHERE[case])).dof == 4


KEYFRAME = '<keyframe><key name="home" qpos="{}"/></keyframe></mujoco>'


@pytest.mark.parametrize("value", ["nan", "1 2 nan 4 5 6 7 8 9 10 11 12 13"])
def test_a_keyframe_with_nan_is_refused(scene: Path, value: str) -> None:
    scene.write_text(SCENE.replace("</mujoco>", KEYFRAME.format(value)))
    with pytest.raises(ModelError, match='<key> home: qpos="[^"]*" is not finite'):
        jacokin.load_robot(scene)


def test_a_site_named_like_a_body_keeps_a_frame(tmp_path: Path, rng: np.random.Generator) -> None:
    path = tmp_path / "names.xml"
    path.write_text("""<mujoco><worldbody><body name="arm"><joint name="a"/><geom size="0.1"/>
      <body name="tool" pos="0 0 1"><joint name="b"/><geom size="0.1"/>
        <site name="tool" pos="0 0.2 0"/><site name="arm_site"/><site name="arm" pos="0.3 0 0"/></body></body>
    </worldbody></mujoco>""")
    robot = jacokin.load_robot(path)
    assert robot.frames == ("world", "arm", "tool", "tool_site", "arm_site", "arm_site_")
    assert jacokin.crosscheck(robot, samples=20, rng=rng).within()
    offset = robot.forward_kinematics([0, 0], "tool").inverse() * robot.forward_kinematics([0, 0], "tool_site")
    np.testing.assert_allclose(offset.translation, [0.0, 0.2, 0.0])


@pytest.mark.one_quick
@pytest.mark.parametrize("base", [None, "pedestal", "mark"])
def test_any_mjcf_agrees_with_mujoco(scene: Path, base: str | None, rng: np.random.Generator) -> None:
    robot = jacokin.load_robot(scene, base=base, limits={"elbow": (-1.0, 3.0)})
    assert robot.joint_names == ("shoulder", "elbow", "rail", "roll")
    report = jacokin.crosscheck(robot, samples=300, rng=rng)
    assert report.within(), str(report)
    compared = {row.frame for row in report.deviations}
    assert {"pedestal", "mark", "upper", "fore", "wrist", "flange", "tool", "pad"} <= compared
    assert {"world", "box"} <= compared
    assert not report.notes  # armature of the default class came through


def test_limited_false_means_unlimited(scene: Path) -> None:
    robot = jacokin.load_robot(scene)
    elbow = robot.joint_index("elbow")
    assert robot.unlimited[elbow]
    assert robot.upper[elbow] == math.inf
    assert (robot.lower[0], robot.upper[0]) == (-2.0, 2.0)


@pytest.mark.slow
def test_a_hand_attached_through_mujoco(tmp_path: Path, rng: np.random.Generator) -> None:
    # What MjSpec writes after attaching holds frames, which Pinocchio's own reader drops.
    arm = mujoco.MjSpec.from_file(str(urdf_folder() / "jaco_arm.xml"))
    hand = mujoco.MjSpec.from_file(str(urdf_folder() / "jaco_hand.xml"))
    arm.attach(hand, site=arm.site("wristsite"), prefix="hand/")
    arm.compiler.savecompiled = False
    arm.body("link_base").pos = [0.0, 0.4, 0.1]
    arm.body("link_base").quat = [0.5, 0.5, 0.5, 0.5]
    arm.compile()
    path = tmp_path / "arm_and_hand.xml"
    path.write_text(arm.to_xml())
    robot = jacokin.load_robot(path)
    report = jacokin.crosscheck(robot, samples=200, rng=rng)
    assert report.within(), str(report)
    assert {"hand/gripsite", "hand/pinchsite"} <= {row.frame for row in report.deviations}
    # The world is the base of an MJCF; the posed root moves the whole arm with it.
    plain = jacokin.load_robot()
    q = robot.sample(rng)
    T_world_base = jacokin.pose([0.0, 0.4, 0.1], quat_wxyz=[0.5, 0.5, 0.5, 0.5])
    expected = (T_world_base * plain.forward_kinematics(q, "pinchsite")).homogeneous
    np.testing.assert_allclose(robot.forward_kinematics(q, "hand/pinchsite").homogeneous, expected, atol=1e-12)


@pytest.mark.slow
def test_dm_control_arm_agrees_with_mujoco_and_with_ours(rng: np.random.Generator) -> None:
    needs_dm_control()
    import dm_control

    path = Path(dm_control.__file__).parent / "third_party" / "kinova" / "jaco_arm.xml"
    theirs = jacokin.load_robot(path)
    assert jacokin.crosscheck(theirs, samples=300, rng=rng).within()
    ours = jacokin.load_robot(urdf_folder() / "jaco_arm.xml")
    report = jacokin.crosscheck(ours, theirs, samples=300, frame_map={"link_6": "b_6", "wristsite": "wristsite"})
    # Their quaternions have six digits.
    for quantity in ("position", "rotation", "jacobian"):
        assert 1e-9 < report.worst(quantity).value < 2e-6


def test_generated_names_do_not_hide_given_ones(tmp_path: Path) -> None:
    path = tmp_path / "names.xml"
    path.write_text("""<mujoco><worldbody><body name="body_2"><joint name="a"/><geom size="0.1"/>
      <body pos="0 0 1"><joint/><geom size="0.1"/><site name="tip"/></body></body></worldbody></mujoco>""")
    robot = jacokin.load_robot(path)
    assert robot.frames == ("world", "body_2", "body_2_", "tip")
    assert robot.joint_names == ("a", "joint#1")


def test_huge_limits_mean_none(tmp_path: Path) -> None:
    path = tmp_path / "huge.xml"
    path.write_text("""<mujoco><worldbody><body name="b"><joint name="j" range="-1e30 1e30" limited="true"/>
      <geom size="0.1"/></body></worldbody></mujoco>""")
    robot = jacokin.load_robot(path)
    assert robot.unlimited.all()
    assert (robot.home == 0.0).all()


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


def test_a_name_that_is_no_utf_8_is_named(scene: Path) -> None:
    content = scene.read_bytes()
    assert b'name="tool"' in content
    scene.write_bytes(content.replace(b'name="tool"', b'name="werkzeugtr\xe4ger"'))
    with pytest.raises(ModelError, match=r"the name b'werkzeugtr\\xe4ger' is not in UTF-8"):
        jacokin.load_robot(scene, base="pedestal")


def test_nan_in_an_mjcf_is_named(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "nan.xml"
    path.write_text(SCENE.replace('<include file="common.xml"/>', "").replace('pos="0 0 0.3"', 'pos="nan 0 0.3"'))
    with pytest.raises(ModelError, match='<body> fore: pos="nan 0 0.3" is not finite'):
        jacokin.load_robot(path)
    assert capfd.readouterr().err == ""


def two_joints(tmp_path: Path, world: str = "", top: str = "", actuators: str = "", joint: str = "") -> Path:
    path = tmp_path / "arm.xml"
    path.write_text(
        f"""<mujoco>{top}<worldbody><body><joint name="a" axis="0 1 0" {joint}/><geom size="0.05 0.2" type="capsule"/>
        <body pos="0 0 0.5"><joint name="b" axis="0 1 0"/><geom size="0.05 0.2" type="capsule" fromto="0 0 0 1 0 0"/>
        </body></body>{world}</worldbody><actuator>{actuators}</actuator></mujoco>"""
    )
    return path


EFFORTS = {
    "none": ("", "", (np.inf, np.inf)),
    "motors": (
        '<motor joint="a" ctrlrange="-1 1"/><motor joint="b" gear="-50" ctrlrange="-1 2"/>',
        "",
        (1.0, 50.0),
    ),
    "unbounded motors": ('<motor joint="a"/><motor joint="b" gear="0"/>', "", (np.inf, np.inf)),
    "force ranges": (
        '<position joint="a" kp="10" forcerange="-3 4"/><velocity joint="b" kv="9" forcerange="-2 2" gear="3"/>',
        "",
        (3.0, 6.0),
    ),
    "the tighter range": ('<motor joint="a" ctrlrange="-9 9" forcerange="-4 4"/>', "", (4.0, np.inf)),
    "servos with a range of positions": ('<position joint="a" kp="10" ctrlrange="-3 3"/>', "", (np.inf, np.inf)),
    "two on a joint": ('<motor joint="a" ctrlrange="-1 1"/><motor joint="a" ctrlrange="-2 2"/>', "", (3.0, np.inf)),
    "one way only": ('<motor joint="a" ctrlrange="0 1"/>', "", (np.inf, np.inf)),
    "the joint's own": ('<motor joint="a" ctrlrange="-9 9"/>', 'actuatorfrcrange="-5 6"', (5.0, np.inf)),
}


@pytest.mark.parametrize("case", EFFORTS)
def test_ranges_of_actuators_are_efforts(tmp_path: Path, case: str) -> None:
    actuators, joint, efforts = EFFORTS[case]
    robot = jacokin.load_robot(two_joints(tmp_path, actuators=actuators, joint=joint))
    np.testing.assert_allclose(robot.effort_limit, efforts)


def test_motors_that_are_too_weak_pass_no_motion(tmp_path: Path) -> None:
    weak = '<motor joint="a" ctrlrange="-1 1"/><motor joint="b" ctrlrange="-1 1"/>'
    robot = jacokin.load_robot(two_joints(tmp_path, actuators=weak), velocity_limit=1.0)
    motion = move_joints(robot, [0.0, 0.0], [0.5, 0.5], torque_limit=True)
    assert not motion.success
    assert "a needs -46.23 N m on the way" in motion.message
    robot = jacokin.load_robot(two_joints(tmp_path), velocity_limit=1.0)
    with pytest.raises(InvalidInputError, match=r"arm.xml\) gives no effort limits for a, b; pass torque_limit="):
        move_joints(robot, [0.0, 0.0], [0.5, 0.5], torque_limit=True)


GIANTS = {
    "replicate": ('<replicate count="1000000" offset="1 0 0"><geom size="0.1"/></replicate>', "", "more than 20000"),
    "replicate of replicates": (
        '<replicate count="150" offset="1 0 0"><replicate count="150" offset="0 1 0"><geom size="1"/></replicate>'
        "</replicate>",
        "",
        "more than 20000",
    ),
    "grid": ('<flexcomp name="f" type="grid" count="300 300 30" spacing="1 1 1" dim="3"/>', "", "more than 20000"),
    "terrain": (
        "",
        '<asset><hfield name="h" nrow="9000" ncol="9000" size="1 1 1 1"/></asset>',
        "h has 81000000 points",
    ),
    "picture": ("", '<asset><hfield name="h" file="big.png" size="1 1 1 1"/></asset>', "h has 900000000 points"),
    "texture": (
        "",
        '<asset><texture name="t" type="2d" builtin="flat" width="50000" height="50000"/></asset>',
        "<texture> t has 2500000000 points",
    ),
    "user data": ("", '<size nuserdata="1000000000"/>', "nuserdata=1000000000 is more than"),
    "included": ("", '<include file="inside.xml"/>', "more than 20000"),
    "a long name": (
        "",
        f'<compiler meshdir="{"x" * 300}"/><asset><mesh name="m" file="a.stl"/></asset>',
        "MuJoCo cannot",
    ),
    "a pipe": ("", '<asset><mesh name="m" file="pipe.stl"/></asset>', "pipe.stl is not a regular file"),
}


@pytest.mark.parametrize("case", GIANTS)
def test_what_would_take_minutes_or_gigabytes_is_refused(tmp_path: Path, case: str) -> None:
    world, top, message = GIANTS[case]
    header = b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR" + (30_000).to_bytes(4, "big") * 2
    (tmp_path / "big.png").write_bytes(header + bytes(20))
    (tmp_path / "inside.xml").write_text(f"<mujoco><worldbody>{GIANTS['replicate'][0]}</worldbody></mujoco>")
    os.mkfifo(tmp_path / "pipe.stl")
    with pytest.raises(ModelError) as error:
        jacokin.load_robot(two_joints(tmp_path, world, top))
    assert message in str(error.value)


def test_a_pile_of_copies_is_read(tmp_path: Path) -> None:
    many = "".join(f'<numeric name="n{number}" data="1"/>' for number in range(21_000))
    assert jacokin.load_robot(two_joints(tmp_path, top=f"<custom>{many}</custom>")).dof == 2
    row = '<replicate count="20" offset="0 0.3 0"><geom size="0.1"/></replicate>'
    pile = f'<replicate count="20" offset="0.3 0 0">{row}</replicate>'
    assert jacokin.load_robot(two_joints(tmp_path, pile)).dof == 2
