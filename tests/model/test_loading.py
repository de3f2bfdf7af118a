"""Loading by name or from a file, which may change or go afterwards."""

from __future__ import annotations

import math
import os
import pickle
import re
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import jacokin
import jacokin.model
from jacokin import Robot
from jacokin.errors import InvalidInputError, ModelError, UnknownNameError
from jacokin.model import Floor, Scene, SelfContact, urdf_folder
from jacokin.model.robot import fingerprint
from tests.gripper_arms import panda_text
from tests.robot_files import SCENE, load_text, skeleton, ur5_text, urdf_text

KEYFRAME = '<keyframe><key name="home" qpos="{}"/></keyframe></mujoco>'
HOME = "1 1 1 1 0 0 0 0.5 0.2 0.05 0.3 0.2 0.2"


def facts(robot: Robot) -> tuple[object, ...]:
    report = jacokin.crosscheck(robot, samples=20)
    touching = SelfContact(robot).touching(robot.lower.clip(-1.0, 1.0))
    return robot.home.tolist(), robot.home_source, str(report), touching, SelfContact(robot).pairs


@pytest.mark.one_quick("then")
@pytest.mark.parametrize("kind", ["urdf", "mjcf"])
@pytest.mark.parametrize("then", ["delete", "edit", "pickle and delete"])
def test_the_file_is_not_read_again(tmp_path: Path, scene: Path, kind: str, then: str) -> None:
    path = tmp_path / "robot.urdf" if kind == "urdf" else scene
    path.write_text(urdf_text() if kind == "urdf" else SCENE.replace("</mujoco>", KEYFRAME.format(HOME)))
    expected = facts(jacokin.load_robot(path))
    robot = jacokin.load_robot(path)
    if then == "edit":
        other = SCENE.replace("</mujoco>", KEYFRAME.format(HOME.replace("0.5", "0.6")))
        path.write_text("<robot name='other'/>" if kind == "urdf" else other)
    else:
        path.unlink()
    if then.startswith("pickle"):
        robot = pickle.loads(pickle.dumps(robot))
    assert facts(robot) == expected


def test_what_is_not_a_file_is_named(tmp_path: Path) -> None:
    folder, pipe, loop = tmp_path / "folder.urdf", tmp_path / "pipe.xml", tmp_path / "loop.urdf"
    folder.mkdir()
    os.mkfifo(pipe)
    loop.symlink_to(loop)
    for path, message in (
        (folder, "is a folder, not a file"),
        (pipe, "is not a regular file"),
        (loop, "is a loop of symbolic links"),
        (tmp_path, "is a folder, not a file"),
        (tmp_path / "none.urdf", "no such file"),
        (tmp_path / "none.urdf" / "below.urdf", "no such file"),
    ):
        with pytest.raises(ModelError, match=re.escape(f"{path}: {message}")):
            jacokin.load_robot(path)
    with pytest.raises(ModelError, match="no such file"):
        jacokin.load_robot("a\0b.urdf")


def test_package_dirs_is_a_list_of_folders() -> None:
    wrong: list[Any] = ["/tmp", Path("/tmp"), 3, [3], None]
    for value in wrong:
        with pytest.raises(InvalidInputError, match=r"package_dirs(\[0\])? must be a"):
            jacokin.load_robot(urdf_folder() / "j2n6s300.urdf", package_dirs=value)


def test_package_dirs_are_there(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    for name in ("nowhere", "file", "a\0b", "a" * 300):
        folders = [tmp_path, tmp_path / name]
        with pytest.raises(InvalidInputError, match=r"package_dirs\[1\]: there is no folder '"):
            jacokin.load_robot(urdf_folder() / "j2n6s300.urdf", package_dirs=folders)


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


def test_equal_limits_lock_a_joint() -> None:
    angle = float(jacokin.load_robot().home[1])
    robot = jacokin.load_robot(limits={"joint_2": (angle, angle)})
    result = jacokin.IKSolver(robot, method="qp").solve(robot.forward_kinematics(robot.home), robot.home)
    assert result.success
    assert result.q[1] == angle


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


def test_the_range_of_fingers_that_slide_is_in_metres(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match=r"finger_angle = 0.5: the fingers move from 0.0 to 0.04 m$"):
        load_text(tmp_path / "panda.urdf", panda_text(), finger_angle=0.5)
    assert load_text(tmp_path / "ur5.urdf", ur5_text(), finger_angle=0.5).dof == 6
    panda = load_text(tmp_path / "panda.urdf", panda_text())
    with pytest.raises(InvalidInputError, match=r"from 0.0 to 0.04 m$"):
        panda.clearance(panda.home, Scene([Floor(-1.0)], finger_angle=0.5))


@pytest.fixture
def two_arms(tmp_path: Path) -> Path:
    """Two chains of four joints on a base, and two fingers on the left one, of which one mimics the other."""
    path = tmp_path / "two.urdf"
    text = skeleton(
        "left_1>left_a left_2>left_b left_3>left_c left_4>left_d "
        "|finger_1>finger_a[0,1] |finger_2>finger_b[-2,0] |spinner>propeller*"
    )
    mimic = '<mimic joint="finger_1" multiplier="-2" offset="0.5"/></joint>'
    head, sign, tail = text.partition('<joint name="finger_2"')
    text = head + sign + tail.replace("</joint>", mimic, 1)
    right = skeleton("right_1>right_a right_2>right_b right_3>right_c right_4>right_d")
    inside = right[right.index('<link name="right_a"') : right.index("</robot>")]
    path.write_text(text.replace("</robot>", f"{inside}</robot>"))
    return path


def test_joints_off_the_arm_are_locked_where_asked(two_arms: Path, rng: np.random.Generator) -> None:
    locked = {"right_2": 0.4, "right_3": -0.7, "finger_1": 0.6, "spinner": 7.0}
    robot = jacokin.load_robot(two_arms, tip="left_d", locked=locked)
    assert robot.joint_names == ("left_1", "left_2", "left_3", "left_4")
    whole = jacokin.load_robot(two_arms, tip="right_d")
    other = whole.forward_kinematics([0.0, 0.4, -0.7, 0.0], "right_d")
    q = robot.sample(rng)
    np.testing.assert_allclose(robot.forward_kinematics(q, "right_d").homogeneous, other.homogeneous, atol=1e-12)
    T_tip = robot.forward_kinematics(q, "left_d").inverse()
    for frame, angle in (("finger_a", 0.6), ("finger_b", 0.5 - 2 * 0.6), ("propeller", 7.0)):
        turned = pin.log3((T_tip * robot.forward_kinematics(q, frame)).rotation)
        np.testing.assert_allclose(np.linalg.norm(turned), abs(math.remainder(angle, math.tau)), atol=1e-12)
    assert dict(robot.source.locked) == locked | {"finger_2": pytest.approx(-0.7)}
    assert jacokin.crosscheck(robot, samples=10).within()  # MuJoCo has the other arm in the same place
    assert pickle.loads(pickle.dumps(robot)).source.locked == robot.source.locked


@pytest.mark.parametrize(
    ("locked", "message"),
    [
        ({"right_9": 0.0}, "unknown joint 'right_9'"),
        ({"left_1": 0.0}, "locked['left_1']: is a joint of the arm"),
        ({"right_1": 3.0}, "locked['right_1'] = 3.0: the joint moves from -2.9 to 2.9"),
        ({"right_1": math.nan}, "locked['right_1'] must be a finite number"),
        ([("right_1", 0.0)], "locked must be a dict"),
    ],
)
def test_what_cannot_be_locked_is_named(two_arms: Path, locked: Any, message: str) -> None:
    with pytest.raises(InvalidInputError, match=re.escape(message)):
        jacokin.load_robot(two_arms, tip="left_d", locked=locked)


def test_a_free_object_cannot_be_locked(scene: Path) -> None:
    with pytest.raises(InvalidInputError, match="'float'.*has 6 degrees of freedom"):
        jacokin.load_robot(scene, locked={"float": 0.0})


def test_shapes_of_a_locked_arm_stand_where_it_is_locked(tmp_path: Path) -> None:
    path = tmp_path / "two.xml"
    geom = '<geom type="sphere" size="0.06"/>'
    hinge = '<joint name="{0}_{1}" axis="0 1 0" range="-2 2"/>{2}<body name="{0}_{3}" pos="0 0 0.3">{2}'
    first, second = hinge.replace("{1}", "1").replace("{3}", "b"), hinge.replace("{1}", "2").replace("{3}", "c")
    arm = f'<body name="{{0}}" pos="{{1}} 0 0">{first}{second}</body></body></body>'
    path.write_text(
        '<mujoco><compiler angle="radian" autolimits="true"/><worldbody>'
        f"{arm.format('left', 0, geom)}{arm.format('right', 1, geom)}</worldbody></mujoco>"
    )
    robots = [jacokin.load_robot(path, tip="left_c", locked={"right_1": angle}) for angle in (0.0, -1.5)]
    places = [robot.forward_kinematics([0.0, 0.0], "right_c").translation for robot in robots]
    np.testing.assert_allclose(places[1], [1.0 - 0.6 * math.sin(1.5), 0.0, 0.6 * math.cos(1.5)], atol=1e-12)
    clear = [not SelfContact(robot).touching([math.atan2(0.4, 0.04), 0.0]) for robot in robots]
    assert clear == [True, False]


def test_arms_that_differ_in_an_axis_have_other_fingerprints(tmp_path: Path) -> None:
    text, found = (urdf_folder() / "j2n6s300.urdf").read_text(), set()
    for axis in ("0 0 1", "0 0 -1", "0 -1 0", "0.6 0 0.8", "0.6 0 -0.8"):
        file = tmp_path / "arm.urdf"
        file.write_text(text.replace('axis xyz="0 0 1"', f'axis xyz="{axis}"', 1))
        found.add(fingerprint(jacokin.load_robot(file)))
    assert len(found) == 5


def test_arms_that_differ_in_which_shapes_meet_have_other_fingerprints(tmp_path: Path) -> None:
    file, found, pairs = tmp_path / "arm.xml", set(), set()
    exclude = '<contact><exclude body1="b1" body2="b3"/></contact>'
    for mask, more in (("", ""), ("", exclude), ('contype="0" conaffinity="0"', ""), ('contype="2"', "")):
        body = '<body name="b{0}" pos="0.3 0 0"><joint name="j{0}" axis="0 1 0"/><geom size="0.05" {1}/>'
        bodies = "".join(body.format(k, mask if k == 3 else "") for k in range(1, 4))
        file.write_text(f"<mujoco><worldbody>{bodies}</body></body></body></worldbody>{more}</mujoco>")
        robot = jacokin.load_robot(file)
        found.add(fingerprint(robot, shapes=True))
        pairs.add(SelfContact(robot).pairs)
    assert len(pairs) > 1
    assert len(found) == 4


def test_a_home_of_ones_own_is_taken(two_arms: Path) -> None:
    robot = jacokin.load_robot(two_arms, tip="left_d", home=[0.1, -0.2, 0.3, 2.9])
    assert robot.home.tolist() == [0.1, -0.2, 0.3, 2.9]
    assert robot.home_source == "given with home="
    assert jacokin.load_robot(home=jacokin.load_robot().home + 0.1).home_source == "given with home="
    wrong: list[tuple[Any, str]] = [
        ([0.0] * 5, r"home must have shape \(4,\)"),
        ([0.0, 0.0, 0.0, 3.0], "home: joint 'left_4' at 3.0 is out of its limits, -2.9 to 2.9"),
        ([0.0, 0.0, 0.0, math.inf], "home must be finite"),
        ("here", "home must be 4 numbers"),
    ]
    for home, message in wrong:
        with pytest.raises(InvalidInputError, match=message):
            jacokin.load_robot(two_arms, tip="left_d", home=home)
