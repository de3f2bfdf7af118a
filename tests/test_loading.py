"""Loading a user's own files: exact for any MJCF with hinges, and clear about what is wrong."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np
import pytest

import jacokin
from jacokin.errors import InvalidInputError, ModelError, UnknownNameError
from jacokin.model.bundled import urdf_folder

INCLUDED = """<mujocoinclude>
  <default><default class="arm"><joint damping="0.1" armature="0.3"/></default></default>
</mujocoinclude>"""

# Base posed, include, default classes, frame, reference angle, anchor off the origin, slanted axis, jointless body
# with a site, a branching gripper, a free box, and a second arm's worth of names to trip over.
SCENE = """<mujoco model="scene">
  <compiler angle="radian"/>
  <include file="common.xml"/>
  <worldbody>
    <geom type="plane" size="1 1 0.1"/>
    <body name="box" pos="1 1 1"><freejoint name="float"/><geom size="0.1"/></body>
    <body name="pedestal" pos="0.3 -0.2 0.5" euler="0.3 0.2 0.1">
      <geom size="0.05"/>
      <site name="mark" pos="0.01 0.02 0.03"/>
      <frame pos="0 0 0.1" euler="0 0.4 0">
        <body name="upper" childclass="arm">
          <joint name="shoulder" axis="0 1 1" pos="0 0.02 0" range="-2 2" limited="true"/>
          <geom type="capsule" fromto="0 0 0 0 0 0.3" size="0.02"/>
          <body name="fore" pos="0 0 0.3">
            <joint name="elbow" axis="0 1 0" ref="0.7" range="-1 1" limited="false"/>
            <geom type="capsule" fromto="0 0 0 0 0 0.2" size="0.02"/>
            <body name="wrist" pos="0 0 0.2">
              <joint name="rail" type="slide" axis="0 0 1" range="0 0.1" limited="true"/>
              <joint name="roll" axis="0 0 1"/>
              <geom size="0.02"/>
              <body name="flange" pos="0 0 0.05" euler="0 1.2 0">
                <geom size="0.01" pos="0.02 0 0"/>
                <site name="tool" pos="0.1 0 0" euler="0.5 0 0"/>
              </body>
              <body name="left">
                <joint name="finger_l" axis="0 0 1" range="0.1 1"/>
                <geom size="0.01"/>
                <site name="pad"/>
              </body>
              <body name="right">
                <joint name="finger_r" axis="0 0 1" range="0.1 1"/>
                <geom size="0.01"/>
              </body>
            </body>
          </body>
        </body>
      </frame>
    </body>
  </worldbody>
</mujoco>"""


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    (tmp_path / "common.xml").write_text(INCLUDED)
    path = tmp_path / "scene.xml"
    path.write_text(SCENE)
    return path


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
    assert robot.free[elbow]
    assert robot.upper[elbow] == math.inf
    assert (robot.lower[0], robot.upper[0]) == (-2.0, 2.0)


def test_fingers_lock_where_asked(scene: Path) -> None:
    def pad_angle(angle: float | None) -> float:
        robot = jacokin.load_robot(scene, finger_angle=angle)
        rotation = (
            robot.forward_kinematics(np.zeros(4), "wrist").rotation.T
            @ robot.forward_kinematics(np.zeros(4), "pad").rotation
        )
        return math.atan2(rotation[1, 0], rotation[0, 0])

    assert pad_angle(0.6) == pytest.approx(0.6, abs=1e-12)
    assert pad_angle(None) == pytest.approx(0.1, abs=1e-12)  # the reference, 0, is outside the finger's limits
    with pytest.raises(InvalidInputError, match="finger_angle"):
        jacokin.load_robot(scene, finger_angle=math.nan)


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


def test_dm_control_arm_agrees_with_mujoco_and_with_ours(rng: np.random.Generator) -> None:
    import dm_control

    path = Path(dm_control.__file__).parent / "third_party" / "kinova" / "jaco_arm.xml"
    theirs = jacokin.load_robot(path)
    assert jacokin.crosscheck(theirs, samples=300, rng=rng).within()
    ours = jacokin.load_robot(urdf_folder() / "jaco_arm.xml")
    report = jacokin.crosscheck(ours, theirs, samples=300, frame_map={"link_6": "b_6", "wristsite": "wristsite"})
    # Their quaternions have six digits.
    for quantity in ("position", "rotation", "jacobian"):
        assert 1e-9 < report.worst(quantity).value < 2e-6


@pytest.mark.parametrize("base", ["link_2", "end_effector"])
def test_a_chain_can_start_anywhere(base: str, rng: np.random.Generator) -> None:
    if base == "end_effector":
        with pytest.raises(ModelError, match="does not descend"):
            jacokin.load_robot(base=base, tip="link_3")
        return
    part, whole = jacokin.load_robot(base=base), jacokin.load_robot()
    assert part.joint_names == whole.joint_names[2:]
    q = whole.sample(rng)
    expected = whole.forward_kinematics(q, "link_2").inverse() * whole.forward_kinematics(q)
    np.testing.assert_allclose(part.forward_kinematics(q[2:]).homogeneous, expected.homogeneous, atol=1e-14)
    for shorter in (part, jacokin.load_robot(tip="link_3")):
        assert shorter.home.shape == (shorter.dof,)
        assert shorter.within_limits(shorter.home)


def test_own_limits_replace_those_of_the_file() -> None:
    robot = jacokin.load_robot(limits={"joint_1": (-1.0, 1.0), "joint_2": (1.0, 2.0)})
    assert (robot.lower[0], robot.upper[0]) == (-1.0, 1.0)
    assert not robot.free[0]
    assert robot.within_limits(robot.home)
    with pytest.raises(UnknownNameError, match="joint_9"):
        jacokin.load_robot(limits={"joint_9": (0.0, 1.0)})
    for pair in ((2.0, 1.0), (math.nan, 1.0), (1.0,), "ab"):
        with pytest.raises(InvalidInputError, match="joint_2"):
            jacokin.load_robot(limits={"joint_2": pair})  # type: ignore[dict-item]  # wrong on purpose


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


def urdf_text() -> str:
    return (urdf_folder() / "j2n6s300.urdf").read_text()


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


def test_urdf_from_a_user_is_the_bundled_one(tmp_path: Path, rng: np.random.Generator) -> None:
    path = tmp_path / "mine.urdf"
    path.write_text(urdf_text())
    mine, bundled = jacokin.load_robot(path), jacokin.load_robot()
    assert mine.default_frame == "end_effector"
    assert mine.base == "link_base"
    q = bundled.sample(rng)
    np.testing.assert_array_equal(mine.forward_kinematics(q).homogeneous, bundled.forward_kinematics(q).homogeneous)
    assert (mine.velocity_limit == [math.radians(36)] * 3 + [math.radians(48)] * 3).all()
    assert (mine.effort_limit == [40, 80, 40, 20, 20, 20]).all()


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
    two = tmp_path / "two.xml"
    two.write_text("""<mujoco><worldbody>
      <body name="a"><joint name="ja"/><geom size="0.1"/></body>
      <body name="b"><joint name="jb"/><geom size="0.1"/></body></worldbody></mujoco>""")
    with pytest.raises(ModelError, match=r"several chains start at the base \(ja, jb\).*tip="):
        jacokin.load_robot(two)
    assert jacokin.load_robot(two, tip="b").joint_names == ("jb",)


def test_home_is_legal_and_free_of_contact(scene: Path) -> None:
    from jacokin.model.contact import SelfContact

    robot = jacokin.load_robot(scene)
    assert robot.within_limits(robot.home)
    for name in ("j2n6s300", urdf_folder() / "jaco_arm.xml"):
        arm = jacokin.load_robot(name)
        assert arm.within_limits(arm.home)
        assert SelfContact(arm).touching(arm.home) == []
        assert SelfContact(arm).pairs > 20
    assert SelfContact(arm).touching(np.array([0.0, math.pi, arm.lower[2], 0.0, 0.0, 0.0])) != []


def test_own_urdf_shapes_are_checked_for_contact(tmp_path: Path, rng: np.random.Generator) -> None:
    from jacokin.model.contact import SelfContact

    path = tmp_path / "mine.urdf"
    path.write_text(urdf_text())
    mine, bundled = SelfContact(jacokin.load_robot(path, finger_angle=0.15)), SelfContact(jacokin.load_robot())
    hits = 0
    for q in jacokin.load_robot().sample(rng, 300):
        # A URDF cannot exclude pairs, so it may report more; never less.
        theirs = {frozenset(pair) for pair in bundled.touching(q)}
        assert theirs <= {frozenset(pair) for pair in mine.touching(q)}
        hits += bool(theirs)
    assert hits > 5
    own = jacokin.load_robot(path)
    assert mine.touching(own.home) == []


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


def test_equal_limits_lock_a_joint() -> None:
    angle = float(jacokin.load_robot().home[1])
    robot = jacokin.load_robot(limits={"joint_2": (angle, angle)})
    result = jacokin.IKSolver(robot, method="qp").solve(robot.forward_kinematics(robot.home), robot.home)
    assert result.success
    assert result.q[1] == angle


def test_home_of_shapes_that_always_overlap(tmp_path: Path) -> None:
    shape = '<collision><geometry><sphere radius="0.5"/></geometry></collision>'
    inertial = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
    links = "".join(f'<link name="l{i}">{inertial}{shape}</link>' for i in range(4))
    joints = "".join(
        f'<joint name="q{i}" type="revolute"><parent link="l{i - 1}"/><child link="l{i}"/><origin xyz="0 0 0.1"/>'
        '<axis xyz="1 0 0"/><limit lower="-2" upper="2" effort="1" velocity="1"/></joint>'
        for i in range(1, 4)
    )
    path = tmp_path / "coarse.urdf"
    path.write_text(f'<robot name="coarse">{links}{joints}</robot>')
    robot = jacokin.load_robot(path)
    assert robot.within_limits(robot.home)


def test_a_relative_path_outlives_a_change_of_folder(
    scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    robot = jacokin.load_robot(scene.name)
    monkeypatch.chdir("/")
    assert robot.source.path == scene
    assert robot.within_limits(robot.home)


def test_a_urdf_is_a_urdf_whatever_it_is_called(tmp_path: Path) -> None:
    path = tmp_path / "robot.xml"
    path.write_text(urdf_text())
    robot = jacokin.load_robot(path)
    assert (robot.source.kind, robot.base, robot.default_frame) == ("urdf", "link_base", "end_effector")
    path.write_text(urdf_text().replace('xyz="0.0 -0.41 0.0"', 'xyz="0.0 nan 0.0"', 1))
    with pytest.raises(ModelError, match="not finite"):
        jacokin.load_robot(path)


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
    assert robot.free.all()
    assert (robot.home == 0.0).all()


def test_a_user_s_urdf_passes_its_own_crosscheck(rng: np.random.Generator) -> None:
    robot = jacokin.load_robot(urdf_folder() / "j2n6s300.urdf")
    assert robot.source.bundled is None
    report = jacokin.crosscheck(robot, samples=100, rng=rng)
    assert report.within(), str(report)
