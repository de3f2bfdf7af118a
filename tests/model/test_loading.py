"""Loading a user's own files: exact for any MJCF with hinges, whatever its structure."""

from __future__ import annotations

import math
import resource
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
import pytest

import jacokin
import jacokin.model
from jacokin.errors import InvalidInputError, ModelError, UnknownNameError
from jacokin.model import urdf_folder
from tests.optional import needs_dm_control
from tests.robot_files import SCENE, urdf_text


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
    assert not robot.unlimited[0]
    assert robot.within_limits(robot.home)
    with pytest.raises(UnknownNameError, match="joint_9"):
        jacokin.load_robot(limits={"joint_9": (0.0, 1.0)})
    for pair in ((2.0, 1.0), (math.nan, 1.0), (1.0,), "ab"):
        with pytest.raises(InvalidInputError, match="joint_2"):
            jacokin.load_robot(limits={"joint_2": pair})  # type: ignore[dict-item]  # wrong on purpose


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


def test_home_is_within_limits_and_free_of_contact(scene: Path) -> None:
    from jacokin.model import SelfContact

    robot = jacokin.load_robot(scene)
    assert robot.within_limits(robot.home)
    for name in ("j2n6s300", urdf_folder() / "jaco_arm.xml"):
        arm = jacokin.load_robot(name)
        assert arm.within_limits(arm.home)
        assert SelfContact(arm).touching(arm.home) == []
        assert SelfContact(arm).pairs > 20
    assert SelfContact(arm).touching(np.array([0.0, math.pi, arm.lower[2], 0.0, 0.0, 0.0])) != []


def test_own_urdf_shapes_are_checked_for_contact(tmp_path: Path, rng: np.random.Generator) -> None:
    from jacokin.model import SelfContact

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


def test_a_user_s_urdf_passes_its_own_crosscheck(rng: np.random.Generator) -> None:
    robot = jacokin.load_robot(urdf_folder() / "j2n6s300.urdf")
    assert robot.source.bundled is None
    report = jacokin.crosscheck(robot, samples=100, rng=rng)
    assert report.within(), str(report)


@pytest.mark.parametrize("name", ["base", "jacokin_base", "world", "universe", "link"])
def test_a_joint_may_have_any_name(tmp_path: Path, name: str) -> None:
    path = tmp_path / "names.xml"
    path.write_text(f"""<mujoco><worldbody><body name="link"><joint name="{name}" range="-1 1"/><geom size="0.1"/>
      <body name="tip" pos="0 0 1"><joint name="last"/><geom size="0.1"/>
      <body name="finger" pos="0 0 1"><joint name="grip"/><geom size="0.1"/></body></body></body>
    </worldbody></mujoco>""")
    robot = jacokin.load_robot(path, tip="tip")
    assert robot.joint_names == (name, "last")
    assert robot.within_limits(robot.home)
    assert jacokin.crosscheck(robot, samples=5).within()
    assert jacokin.model.to_mujoco(robot).njnt == 2


def test_many_objects_in_the_scene_take_no_memory(tmp_path: Path) -> None:
    """Working memory for the whole scene would be 3 GB: it grows with the cube of the degrees of freedom."""
    boxes = "".join(f'<body pos="{i} 5 0"><freejoint/><geom size="0.1"/></body>' for i in range(60))
    path = tmp_path / "many.xml"
    path.write_text(
        SCENE.replace('<include file="common.xml"/>', "<default><default class='arm'/></default>").replace(
            "<worldbody>", f"<worldbody>{boxes}"
        )
    )
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss  # [kB]
    assert jacokin.load_robot(path).dof == 4
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 500_000


def test_an_arm_has_at_most_200_joints(tmp_path: Path) -> None:
    path = tmp_path / "rope.xml"
    open_tags = "".join(f'<body pos="0 0 0.1"><joint name="j{i}"/><geom size="0.01"/>' for i in range(201))
    path.write_text(f"<mujoco><worldbody>{open_tags}{'</body>' * 201}</worldbody></mujoco>")
    with pytest.raises(ModelError, match="the chain has 201 joints; at most 200"):
        jacokin.load_robot(path)


def test_continuous_joints_turn_about_any_axis(tmp_path: Path, rng: np.random.Generator) -> None:
    path = tmp_path / "oblique.urdf"
    path.write_text("""<robot name="oblique"><link name="base"/><link name="one"/><link name="two"/>
      <joint name="turn" type="continuous"><parent link="base"/><child link="one"/>
        <origin xyz="0.1 0 0.2" rpy="0.1 0.2 0.3"/><axis xyz="0.6 0 0.8"/><limit effort="1" velocity="1"/></joint>
      <joint name="bend" type="revolute"><parent link="one"/><child link="two"/><origin xyz="0.3 0 0"/>
        <axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>""")
    robot = jacokin.load_robot(path)
    assert robot.unlimited.tolist() == [True, False]
    first = jacokin.pose([0.1, 0.0, 0.2], rpy=[0.1, 0.2, 0.3])
    for q in robot.sample(rng, 10):
        turn = pin.SE3(pin.AngleAxis(q[0], np.array([0.6, 0.0, 0.8])).toRotationMatrix(), np.zeros(3))
        bend = jacokin.pose([0.3, 0.0, 0.0], rpy=[0.0, 0.0, q[1]])
        reached = robot.forward_kinematics(q, "two")
        np.testing.assert_allclose(reached.homogeneous, (first * turn * bend).homogeneous, atol=1e-14)
