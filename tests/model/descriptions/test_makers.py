"""The joints and the frame that an arm has when nobody says where it ends, with the names that makers give them."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import pytest

import jacokin
from benchmarks import makers
from jacokin.model.descriptions import tools
from tests.robot_files import load_text, skeleton


class Arm(NamedTuple):
    """A skeleton of names, and what is expected of it."""

    parts: str
    """As `skeleton` takes them."""
    last: str
    dof: int
    frame: str


#: Arms that `makers.toml` does not have, and names that might mislead.
ARMS = {
    # Grippers with one jaw, that are the last joint of a chain.
    "Koch, names without a meaning": Arm(
        "joint1>link1=0.05 joint2>link2=0.04 joint3>link3=0.04 joint4>link4=0.03 joint5>link5=0.04 "
        "joint6>link6[-0.2,1.9]=0.008",
        "joint5", 5, "link5",
    ),
    "Unitree Z1": Arm(
        "joint1>link01[-2.6,2.6] joint2>link02[0,2.97] joint3>link03[-2.88,0] joint4>link04[-1.52,1.52] "
        "joint5>link05[-1.34,1.34] joint6>link06[-2.79,2.79] +gripperStator jointGripper>gripperMover[-1.57,0]",
        "joint6", 6, "link06",
    ),
    "RealMan RM65 with a camera": Arm(
        "joint1>Link1[-3.1,3.1] joint2>Link2[-2.27,2.27] joint3>Link3[-2.35,2.35] joint4>Link4[-3.1,3.1] "
        "joint5>Link5[-2.23,2.23] joint6>Link6[-6.28,6.28] camera_joint>camera_link[-3.1,3.1]",
        "joint6", 6, "Link6",
    ),
    "Gen3 with one finger joint": Arm(
        "joint_1>shoulder_link* joint_2>half_arm_1_link[-2.41,2.41] joint_3>half_arm_2_link* "
        "joint_4>forearm_link[-2.66,2.66] joint_5>spherical_wrist_1_link* joint_6>spherical_wrist_2_link[-2.23,2.23] "
        "joint_7>bracelet_link* +end_effector_link +camera_link +tool_frame finger_joint>left_outer_knuckle[0,0.8]",
        "joint_7", 7, "end_effector_link",
    ),
    "Braccio": Arm(
        "joint_base>braccio_base_link[0,3.14] joint_shoulder>shoulder_link[0.26,2.88] joint_elbow>elbow_link[0,3.14] "
        "joint_wrist_pitch>wrist_pitch_link[0,3.14] joint_wrist_roll>wrist_roll_link[0,3.14] "
        "joint_gripper>right_gripper_link[0.17,1.27]",
        "joint_wrist_roll", 5, "wrist_roll_link",
    ),
    "Talos, left": Arm(
        "arm_left_1_joint>arm_left_1_link arm_left_2_joint>arm_left_2_link arm_left_3_joint>arm_left_3_link "
        "arm_left_4_joint>arm_left_4_link arm_left_5_joint>arm_left_5_link arm_left_6_joint>arm_left_6_link "
        "arm_left_7_joint>arm_left_7_link[-0.68,0.68] +wrist_left_ft_link +gripper_left_base_link "
        "gripper_left_joint>gripper_left_motor_double_link[-1.05,0]",
        "arm_left_7_joint", 7, "arm_left_7_link",
    ),
    "a slide for a gripper": Arm(
        "joint1>link1 joint2>link2 joint3>link3 joint4>link4 joint5>link5 joint6>link6 joint7>link7{0,0.035}",
        "joint6", 6, "link6",
    ),
    "a finger of two joints": Arm(
        "a1>l1 a2>l2 a3>l3 a4>l4 a5>l5 a6>l6 +tool0 finger_joint_1>finger_1[0,1.5] finger_joint_2>finger_tip[0,1]",
        "a6", 6, "tool0",
    ),
    "a robot that is called after its gripper": Arm(
        "gripper_arm_joint1>gripper_arm_link1 gripper_arm_joint2>gripper_arm_link2 "
        "gripper_arm_joint3>gripper_arm_link3 gripper_arm_joint4>gripper_arm_link4 "
        "gripper_arm_joint5>gripper_arm_link5[-1,1]",
        "gripper_arm_joint5", 5, "gripper_arm_link5",
    ),
    # Fingers on branches.
    "PiPER": Arm(
        "joint1>link1[-2.6,2.6] joint2>link2[0,3.14] joint3>link3[-2.97,0] joint4>link4[-1.75,1.75] "
        "joint5>link5[-1.22,1.22] joint6>link6[-2.09,2.09] +gripper_base |joint7>link7{0,0.035} "
        "|joint8>link8{-0.035,0}",
        "joint6", 6, "link6",
    ),
    "Jaco": Arm(
        "j2n6s300_joint_1>j2n6s300_link_1* j2n6s300_joint_2>j2n6s300_link_2 j2n6s300_joint_3>j2n6s300_link_3 "
        "j2n6s300_joint_4>j2n6s300_link_4* j2n6s300_joint_5>j2n6s300_link_5* j2n6s300_joint_6>j2n6s300_link_6* "
        "+j2n6s300_end_effector |j2n6s300_joint_finger_1>j2n6s300_link_finger_1[0,1.51] "
        "|j2n6s300_joint_finger_2>j2n6s300_link_finger_2[0,1.51]",
        "j2n6s300_joint_6", 6, "j2n6s300_end_effector",
    ),
    # No gripper; nothing may be left out.
    "UR5 of before": Arm(
        "shoulder_pan_joint>shoulder_link shoulder_lift_joint>upper_arm_link elbow_joint>forearm_link "
        "wrist_1_joint>wrist_1_link wrist_2_joint>wrist_2_link wrist_3_joint>wrist_3_link +ee_link",
        "wrist_3_joint", 6, "ee_link",
    ),
    "UR5e as in MuJoCo": Arm(
        "shoulder_pan_joint>shoulder_link shoulder_lift_joint>upper_arm_link elbow_joint>forearm_link "
        "wrist_1_joint>wrist_1_link wrist_2_joint>wrist_2_link wrist_3_joint>wrist_3_link +attachment_site",
        "wrist_3_joint", 6, "attachment_site",
    ),
    "Gen3": Arm(
        "Actuator1>Shoulder_Link* Actuator2>HalfArm1_Link[-2.25,2.25] Actuator3>HalfArm2_Link* "
        "Actuator4>ForeArm_Link[-2.58,2.58] Actuator5>SphericalWrist1_Link* Actuator6>SphericalWrist2_Link[-2.1,2.1] "
        "Actuator7>Bracelet_Link* +EndEffector_Link",
        "Actuator7", 7, "EndEffector_Link",
    ),
    "iiwa 14": Arm(
        "iiwa_joint_1>iiwa_link_1 iiwa_joint_2>iiwa_link_2[-2.09,2.09] iiwa_joint_3>iiwa_link_3 "
        "iiwa_joint_4>iiwa_link_4[-2.09,2.09] iiwa_joint_5>iiwa_link_5 iiwa_joint_6>iiwa_link_6[-2.09,2.09] "
        "iiwa_joint_7>iiwa_link_7[-3.05,3.05] +iiwa_link_ee",
        "iiwa_joint_7", 7, "iiwa_link_ee",
    ),
    "IRB 120": Arm(
        "joint_1>link_1 joint_2>link_2[-1.92,1.92] joint_3>link_3[-1.92,1.22] joint_4>link_4 "
        "joint_5>link_5[-2.09,2.09] joint_6>link_6[-6.98,6.98] +flange +tool0",
        "joint_6", 6, "tool0",
    ),
    "Rizon 4": Arm(
        "joint1>link1[-2.79,2.79] joint2>link2[-2.26,2.26] joint3>link3 joint4>link4[-1.86,2.69] joint5>link5 "
        "joint6>link6[-1.39,4.53] joint7>link7 +flange",
        "joint7", 7, "flange",
    ),
    "AUBO i5": Arm(
        "shoulder_joint>shoulder_Link upperArm_joint>upperArm_Link foreArm_joint>foreArm_Link wrist1_joint>wrist1_Link "
        "wrist2_joint>wrist2_Link wrist3_joint>wrist3_Link[-3.05,3.05] +ee_link",
        "wrist3_joint", 6, "ee_link",
    ),
    "Alex, left": Arm(
        "LeftShoulderY>LeftShoulderPitchLink LeftShoulderX>LeftShoulderRollLink LeftShoulderZ>LeftShoulderYawLink "
        "LeftElbowY>LeftElbowLink LeftWristZ>LeftWristYawLink LeftWristX>LeftWristRollLink[-1,1] "
        "LeftGripperZ>LeftGripperYawLink[-1,1]",
        "LeftGripperZ", 7, "LeftGripperYawLink",
    ),
    "a wrist that is called after its gripper": Arm(
        "joint_1>l1 joint_2>l2 joint_3>l3 joint_4>l4 gripper_pitch_joint>gripper_pitch_link[-1,1] "
        "gripper_roll_joint>gripper_base[-1,1]",
        "gripper_roll_joint", 6, "gripper_base",
    ),
    "a last link that is the gripper": Arm(
        "joint_1>l1 joint_2>l2 joint_3>l3 joint_4>l4 joint_5>gripper_link[-3.1,3.1]", "joint_5", 5, "gripper_link"
    ),
    "a gripper that turns, with a tool": Arm(
        "joint_1>l1 joint_2>l2 joint_3>l3 joint_4>l4 gripper_joint>l5[-1.6,1.6] +tool0", "gripper_joint", 5, "tool0"
    ),
    "servos of half a turn, six joints": Arm(
        "j1>l1[-1,1]=0.2 j2>l2[-1,1]=0.2 j3>l3[-1,1]=0.2 j4>l4[-1,1]=0.2 j5>l5[-1,1]=0.1 j6>l6[-1,1]=0.01",
        "j6", 6, "l6",
    ),
    "a SCARA": Arm("j1>l1 j2>l2 j4>l4[-6.28,6.28] j3>l3{0,0.1} +tool0", "j3", 4, "tool0"),
    "a SCARA without names": Arm("j1>l1=5 j2>l2=3 j3>l3{-0.1,0}=0.5 j4>l4[-6.28,6.28]=0.1", "j4", 4, "l4"),
    "a finger": Arm(
        "finger_base_to_upper>finger_upper finger_upper_to_middle>finger_middle finger_middle_to_lower>finger_lower",
        "finger_middle_to_lower", 3, "finger_lower",
    ),
    "a hand of few joints": Arm("wrist>palm thumb_1>thumb_a thumb_2>thumb_b", "thumb_2", 3, "thumb_b"),
}  # fmt: skip


TABLE = {arm.name: arm for arm in makers.read_table()}


@pytest.mark.parametrize("name", TABLE)
def test_joints_and_tool_are_those_that_makers_use(tmp_path: Path, name: str) -> None:
    arm, path = TABLE[name], tmp_path / "arm.urdf"
    path.write_text(skeleton(arm.parts))
    assert arm.problem(path) == ""


def test_the_table_has_forty_arms_or_more() -> None:
    assert sum(not arm.refused and arm.base is None for arm in TABLE.values()) >= 40


def test_real_files_are_compared_with_the_table(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arm, other = TABLE["UR5e"], TABLE["UR3e"]
    (tmp_path / "deep").mkdir()
    (tmp_path / "deep" / arm.file).write_text(skeleton(arm.parts))
    (tmp_path / other.file).write_text(skeleton(TABLE["TM12"].parts))
    makers.main([str(tmp_path)])
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines if line.endswith("as expected")] == ["UR5e"]
    assert any(line.startswith("UR3e") and "joints joint_1, joint_2" in line for line in lines)
    assert "1 files as expected, 1 not; no file of SO-100, SO-101," in lines[-1]


@pytest.mark.parametrize(
    ("name", "sentence"),
    [
        (
            "Fetch",
            "the chain branches at joint 'torso_lift_joint', its number 1, into chains of up to 8 joints: arms on a "
            "torso rather than fingers on an arm; say which frame ends the arm with tip=..., for example gripper_link; "
            "base='torso_lift_link', too, for the arm without joint 'torso_lift_joint'",
        ),
        (
            "ALOHA of MuJoCo Menagerie",
            "several chains start at the base (left/waist, right/waist); say which frame ends the arm with tip=..., "
            "for example left/gripper, right/gripper_link (and which begins it with base=...)",
        ),
    ],
)
def test_robots_of_several_arms_are_refused_with_the_cure(tmp_path: Path, name: str, sentence: str) -> None:
    path = tmp_path / "robot.urdf"
    path.write_text(skeleton(TABLE[name].parts))
    with pytest.raises(jacokin.errors.ModelError) as raised:
        jacokin.load_robot(path)
    assert str(raised.value) == sentence


def test_a_head_or_a_linkage_beside_the_arm_is_locked_and_named(tmp_path: Path) -> None:
    robot = load_text(tmp_path / "arm.urdf", skeleton(TABLE["IRB 2400"].parts))
    assert "locked beside the arm are joint_lever_a, joint_lever_b" in robot.notes


def test_a_torso_with_one_arm_asks_whether_it_is_part_of_it(tmp_path: Path) -> None:
    path = tmp_path / "arm.urdf"
    arm = " ".join(f"a{i}>l{i}" for i in range(6))
    path.write_text(skeleton(f"torso_yaw>torso |head_pan>head {arm}"))
    with pytest.raises(jacokin.errors.ModelError, match="base='torso', too, for the arm without joint 'torso_yaw'"):
        jacokin.load_robot(path)
    path.write_text(skeleton(f"waist_yaw>chest |head_pan>head {arm}"))
    assert jacokin.load_robot(path).dof == 7


def test_a_floating_base_is_named_with_the_base_behind_it(tmp_path: Path) -> None:
    path = tmp_path / "mobile.xml"
    part = '<body name="l{0}" pos="0 0 0.1"><joint name="j{0}" axis="0 {1} {2}"/><geom size="0.01"/>'
    arm = "".join(part.format(i, i % 2, (i + 1) % 2) for i in range(6)) + "</body>" * 6
    wheel = '<body name="{0}" pos="0.1 0 0"><joint name="{0}_joint"/><geom size="0.1"/></body>'
    path.write_text(
        '<mujoco><worldbody><body name="platform"><freejoint name="root"/><geom size="0.2"/>'
        f"{arm}{wheel.format('left')}{wheel.format('right')}</body></worldbody></mujoco>"
    )
    with pytest.raises(jacokin.errors.ModelError, match=r"for example l5, and where it begins with base='platform'"):
        jacokin.load_robot(path)
    assert jacokin.load_robot(path, tip="l5", base="platform").dof == 6


@pytest.mark.parametrize("name", ARMS)
def test_an_arm_ends_where_its_maker_ends_it(tmp_path: Path, name: str) -> None:
    arm, path = ARMS[name], tmp_path / "arm.urdf"
    path.write_text(skeleton(arm.parts))
    robot = jacokin.load_robot(path)
    assert (robot.joint_names[-1], robot.dof, robot.default_frame) == (arm.last, arm.dof, arm.frame)


@pytest.mark.parametrize(
    ("name", "note"),
    [
        (
            "SO-101",
            "joint 'gripper' is not part of the arm, as it moves only the jaw 'moving_jaw_so101_v1_link', by its name: "
            "tip='moving_jaw_so101_v1_link' takes it in",
        ),
        (
            "a slide for a gripper",
            "joint 'joint7' is not part of the arm, as it slides only 35 mm: tip='link7' takes it in",
        ),
        (
            "Koch, names without a meaning",
            "joint 'joint6' is not part of the arm, as it turns only 120 degrees and moves only 8 g: tip='link6' takes "
            "it in",
        ),
    ],
)
def test_what_is_left_out_is_said_and_can_be_taken_in(tmp_path: Path, name: str, note: str) -> None:
    path = tmp_path / "arm.urdf"
    path.write_text(skeleton((TABLE | ARMS)[name].parts))
    robot = jacokin.load_robot(path)
    assert note in robot.notes
    whole = jacokin.load_robot(path, tip=note.split("'")[-2])
    assert whole.dof == robot.dof + 1
    assert whole.joint_names[-1] == note.split("'")[1]
    assert not any("not part of the arm" in each for each in whole.notes)


def test_a_gripper_that_follows_another_joint_is_left_out_with_it(tmp_path: Path) -> None:
    path = tmp_path / "arm.urdf"
    text = skeleton("j1>l1 j2>l2 j3>l3 j4>l4 j5>l5 slider>jaw_1{0,0.03} other>part_2{0,0.03}")
    path.write_text(text.replace("</joint></robot>", '<mimic joint="slider"/></joint></robot>'))
    robot = jacokin.load_robot(path)
    assert robot.joint_names == ("j1", "j2", "j3", "j4", "j5")
    assert "joint 'other' is not part of the arm, as it follows joint 'slider': tip='part_2' takes it in" in robot.notes


def test_a_wrist_that_follows_the_arm_is_refused_rather_than_left_out(tmp_path: Path) -> None:
    path = tmp_path / "palletizer.urdf"
    text = skeleton("j1>l1 j2>l2 j3>l3 j4>l4 j5>level")
    path.write_text(text.replace("</joint></robot>", '<mimic joint="j2"/></joint></robot>'))
    with pytest.raises(jacokin.errors.ModelError, match="joint 'j5' of the arm is coupled"):
        jacokin.load_robot(path)


def test_the_one_arm_of_a_scene_is_taken(tmp_path: Path) -> None:
    path = tmp_path / "scene.xml"
    part = '<body name="l{0}" pos="0 0 0.1"><joint name="j{0}" axis="0 {1} {2}"/><geom size="0.01"/>'
    arm = "".join(part.format(i, i % 2, (i + 1) % 2) for i in range(6))
    door = '<body name="{0}" pos="1 0 0"><joint name="{0}_hinge"/><geom size="0.1"/></body>'
    path.write_text(
        f"<mujoco><worldbody>{arm}{'</body>' * 6}{door.format('door')}{door.format('lid')}</worldbody></mujoco>"
    )
    robot = jacokin.load_robot(path)
    assert robot.joint_names == tuple(f"j{i}" for i in range(6))
    assert "the arm is the chain that begins with joint 'j0'; locked are door_hinge, lid_hinge" in robot.notes


def test_the_thumb_of_a_hand_is_no_arm(tmp_path: Path) -> None:
    path = tmp_path / "hand.urdf"
    thumb = skeleton("thumb_1>a thumb_2>b thumb_3>c thumb_4>d")
    index = '<link name="{0}"/><joint name="to_{0}" type="revolute"><parent link="base"/><child link="{0}"/>'
    index += '<limit lower="0" upper="1"/></joint>'
    path.write_text(thumb.replace("</robot>", f"{index.format('index')}{index.format('ring')}</robot>"))
    with pytest.raises(jacokin.errors.ModelError, match="several chains start at the base"):
        jacokin.load_robot(path)


def test_frames_to_choose_a_tool_from_are_in_order(tmp_path: Path) -> None:
    path = tmp_path / "arm.urdf"
    path.write_text(skeleton(ARMS["Gen3 with one finger joint"].parts))
    assert jacokin.load_robot(path).tool_frames == ("end_effector_link", "tool_frame")
    path.write_text(skeleton(ARMS["Unitree Z1"].parts))
    assert set(jacokin.load_robot(path).tool_frames) == {"link06", "gripperStator", "gripperMover"}


def test_the_page_lists_the_frames_of_tools_in_their_order() -> None:
    page = " ".join((Path(__file__).parents[3] / "docs" / "kinematics.md").read_text().split())
    assert ", ".join(f"`{frame}`" for frame in tools.TOOL_FRAMES) in page
