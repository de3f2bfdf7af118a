"""The configuration to start from: documented, from a keyframe, or found."""

from __future__ import annotations

import math
import pickle
from pathlib import Path

import numpy as np

import jacokin
import jacokin.model
from jacokin.model import SelfContact, urdf_folder
from tests.robot_files import SCENE, joint, load_text, ur5_text, urdf_text


def test_a_pickled_robot_keeps_the_home_it_found(scene: Path) -> None:
    robot = jacokin.load_robot(scene)
    home = robot.home
    copy = pickle.loads(pickle.dumps(robot))
    assert copy.home.tolist() == home.tolist()
    assert copy.home_source == robot.home_source
    assert not copy.home.flags.writeable


KEYFRAME = '<keyframe><key name="home" qpos="{}"/></keyframe></mujoco>'
HOME = "1 1 1 1 0 0 0 0.5 0.2 0.05 0.3 0.2 0.2"


def test_the_keyframe_called_home_is_the_home(scene: Path) -> None:
    scene.write_text(SCENE.replace("</mujoco>", KEYFRAME.format(HOME)))
    robot = jacokin.load_robot(scene)
    np.testing.assert_allclose(robot.home, [0.5, 0.2, 0.05, 0.3])
    assert robot.home_source == "keyframe 'home' of the file"


def test_another_arm_does_not_get_the_home_of_a_jaco(tmp_path: Path) -> None:
    robot = load_text(tmp_path / "ur5.urdf", ur5_text())
    assert robot.home_source == "a random search within the limits; without shapes to check for contact"
    assert robot.within_limits(robot.home)
    assert robot.singular_values(robot.home)[-1] > 0.01  # its middle, all joints at 0, is a straight arm
    assert not np.allclose(robot.home, jacokin.load_robot().home)
    heights = [robot.forward_kinematics(robot.home, frame).translation[2] for frame in robot.frames]
    assert min(heights) >= 0.0  # on a table, too
    assert (np.minimum(robot.home - robot.lower, robot.upper - robot.home) > math.radians(30)).all()


def test_a_jaco_from_a_file_has_the_documented_home(tmp_path: Path) -> None:
    robot = load_text(tmp_path / "mine.urdf", urdf_text().replace("joint_", "my_joint_").replace("link_", "my_link_"))
    assert robot.home_source == "documented for the j2n6s300"
    assert robot.home.tolist() == jacokin.load_robot().home.tolist()
    assert jacokin.load_robot().home_source == "documented for the j2n6s300"
    other = jacokin.load_robot(limits={"joint_1": (0.0, 1.0)})
    assert other.home_source == "a random search within the limits"


def test_home_is_within_limits_and_free_of_contact(scene: Path) -> None:

    robot = jacokin.load_robot(scene)
    assert robot.within_limits(robot.home)
    for name in ("j2n6s300", urdf_folder() / "jaco_arm.xml"):
        arm = jacokin.load_robot(name)
        assert arm.within_limits(arm.home)
        assert SelfContact(arm).touching(arm.home) == []
        assert SelfContact(arm).pairs > 20
    assert SelfContact(arm).touching(np.array([0.0, math.pi, arm.lower[2], 0.0, 0.0, 0.0])) != []


def test_home_of_shapes_that_always_overlap(tmp_path: Path) -> None:
    shape = '<collision><geometry><sphere radius="0.5"/></geometry></collision>'
    inertial = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
    links = "".join(f'<link name="l{i}">{inertial}{shape}</link>' for i in range(4))
    joints = "".join(
        joint(f"q{i}", f"l{i - 1}", f"l{i}", (0.0, 0.0, 0.1), axis=(1.0, 0.0, 0.0), limits=(-2.0, 2.0))
        for i in range(1, 4)
    )
    robot = load_text(tmp_path / "coarse.urdf", f'<robot name="coarse">{links}{joints}</robot>')
    assert robot.within_limits(robot.home)


def test_shapes_that_count_for_nothing_are_told_from_none(scene: Path) -> None:
    """As of arms of which only the hand may touch something, and that something is elsewhere."""
    scene.write_text(SCENE.replace("<geom ", '<geom contype="0" conaffinity="1" '))
    robot = jacokin.load_robot(scene)
    assert robot.home_source.endswith("; no two of its own shapes count as touching, by its description")
