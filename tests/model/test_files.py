"""What is read from a file is kept: the file may change or go. Meshes are found in packages."""

from __future__ import annotations

import os
import pickle
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

import jacokin
from jacokin import Robot
from jacokin.errors import InvalidInputError, ModelError
from jacokin.model import SelfContact, urdf_folder
from tests.robot_files import SCENE, urdf_text

KEYFRAME = '<keyframe><key name="home" qpos="{}"/></keyframe></mujoco>'
HOME = "1 1 1 1 0 0 0 0.5 0.2 0.05 0.3 0.2 0.2"


def facts(robot: Robot) -> tuple[object, ...]:
    report = jacokin.crosscheck(robot, samples=20)
    touching = SelfContact(robot).touching(robot.lower.clip(-1.0, 1.0))
    return robot.home.tolist(), robot.home_source, str(report), touching, SelfContact(robot).pairs


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


def test_a_pickled_robot_keeps_the_home_it_found(scene: Path) -> None:
    robot = jacokin.load_robot(scene)
    home = robot.home
    copy = pickle.loads(pickle.dumps(robot))
    assert copy.home.tolist() == home.tolist()
    assert copy.home_source == robot.home_source
    assert not copy.home.flags.writeable


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


@pytest.mark.parametrize("value", ["nan", "1 2 nan 4 5 6 7 8 9 10 11 12 13"])
def test_a_keyframe_with_nan_is_refused(scene: Path, value: str) -> None:
    scene.write_text(SCENE.replace("</mujoco>", KEYFRAME.format(value)))
    with pytest.raises(ModelError, match='<key> home: qpos="[^"]*" is not finite'):
        jacokin.load_robot(scene)


def test_the_keyframe_called_home_is_the_home(scene: Path) -> None:
    scene.write_text(SCENE.replace("</mujoco>", KEYFRAME.format(HOME)))
    robot = jacokin.load_robot(scene)
    np.testing.assert_allclose(robot.home, [0.5, 0.2, 0.05, 0.3])
    assert robot.home_source == "keyframe 'home' of the file"


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


# A UR5's joints, from the parameters that its maker publishes [m].
UR5 = """<robot name="ur5">{links}{joints}</robot>"""
UR5_JOINTS = [
    ("0 0 0.089159", "0 0 0", "0 0 1"),
    ("0 0.13585 0", "0 1.5707963267948966 0", "0 1 0"),
    ("0 -0.1197 0.425", "0 0 0", "0 1 0"),
    ("0 0 0.39225", "0 1.5707963267948966 0", "0 1 0"),
    ("0 0.093 0", "0 0 0", "0 0 1"),
    ("0 0 0.09465", "0 0 0", "0 1 0"),
]


def ur5_text(shape: str = "") -> str:
    links = "".join(f'<link name="l{i}">{shape}</link>' for i in range(7))
    joints = "".join(
        f'<joint name="q{i}" type="revolute"><parent link="l{i}"/><child link="l{i + 1}"/>'
        f'<origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="{axis}"/>'
        '<limit lower="-6.283" upper="6.283" effort="1" velocity="1"/></joint>'
        for i, (xyz, rpy, axis) in enumerate(UR5_JOINTS)
    )
    return UR5.format(links=links, joints=joints)


def test_another_arm_does_not_get_the_home_of_a_jaco(tmp_path: Path) -> None:
    path = tmp_path / "ur5.urdf"
    path.write_text(ur5_text())
    robot = jacokin.load_robot(path)
    assert robot.home_source == "a random search within the limits; without shapes to check for contact"
    assert robot.within_limits(robot.home)
    assert robot.singular_values(robot.home)[-1] > 0.01  # its middle, all joints at 0, is a straight arm
    assert not np.allclose(robot.home, jacokin.load_robot().home)


def test_a_jaco_from_a_file_has_the_documented_home(tmp_path: Path) -> None:
    path = tmp_path / "mine.urdf"
    path.write_text(urdf_text().replace("joint_", "my_joint_").replace("link_", "my_link_"))
    robot = jacokin.load_robot(path)
    assert robot.home_source == "documented for the j2n6s300"
    assert robot.home.tolist() == jacokin.load_robot().home.tolist()
    assert jacokin.load_robot().home_source == "documented for the j2n6s300"
    other = jacokin.load_robot(limits={"joint_1": (0.0, 1.0)})
    assert other.home_source == "a random search within the limits"


def mesh_robot(tmp_path: Path, file_name: str, suffix: str = "stl") -> Path:
    """A package beside the folder of the URDF, with one mesh."""
    meshes = tmp_path / "share" / "my_arm" / "meshes"
    meshes.mkdir(parents=True)
    trimesh.creation.box((0.05, 0.05, 0.05)).export(meshes / f"part.{suffix}")
    path = tmp_path / "robots" / "arm.urdf"
    path.parent.mkdir()
    shape = f'<collision><geometry><mesh filename="{file_name}"/></geometry></collision>'
    path.write_text(ur5_text(shape))
    return path


@pytest.mark.parametrize("suffix", ["stl", "obj", "ply"])
@pytest.mark.parametrize("how", ["argument", "environment", "package itself"])
def test_meshes_are_found_in_packages(
    tmp_path: Path, how: str, suffix: str, monkeypatch: pytest.MonkeyPatch, rng: np.random.Generator
) -> None:
    monkeypatch.delenv("ROS_PACKAGE_PATH", raising=False)
    path = mesh_robot(tmp_path, f"package://my_arm/meshes/part.{suffix}", suffix)
    share = tmp_path / "share"
    if how == "environment":
        monkeypatch.setenv("ROS_PACKAGE_PATH", f"/nowhere:{share}")
    folders: dict[str, list[str | Path]] = {"argument": [share], "package itself": [str(share / "my_arm")]}
    robot = jacokin.load_robot(path, package_dirs=folders.get(how, []))
    contact = SelfContact(robot)
    assert contact.pairs == 15
    assert contact.touching(np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0])) == []
    folded = [contact.touching(q) for q in robot.sample(rng, 200)]
    assert any(folded)
    assert "search" in robot.home_source


@pytest.mark.parametrize("file_name", ["../share/my_arm/meshes/part.stl", "file://{}/share/my_arm/meshes/part.stl"])
def test_meshes_are_found_by_path(tmp_path: Path, file_name: str) -> None:
    path = mesh_robot(tmp_path, file_name.format(tmp_path))
    assert SelfContact(jacokin.load_robot(path)).pairs == 15


def test_a_mesh_that_is_missing_matters_to_contact_only(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, rng: np.random.Generator
) -> None:
    monkeypatch.delenv("ROS_PACKAGE_PATH", raising=False)
    robot = jacokin.load_robot(mesh_robot(tmp_path, "package://my_arm/meshes/part.stl"))
    assert robot.forward_kinematics(robot.home).translation.shape == (3,)
    assert jacokin.crosscheck(robot, samples=10, rng=rng).within()
    with pytest.raises(ModelError, match=r"mesh 'package://my_arm/meshes/part.stl' is not found.*package_dirs="):
        SelfContact(robot)
    (tmp_path / "share" / "my_arm" / "meshes" / "part.stl").write_text("solid nothing")
    with pytest.raises(ModelError, match="part.stl"):
        SelfContact(jacokin.load_robot(tmp_path / "robots" / "arm.urdf", package_dirs=[tmp_path / "share"]))


def test_package_dirs_is_a_list_of_folders() -> None:
    wrong: list[Any] = ["/tmp", Path("/tmp"), 3, [3], None]
    for value in wrong:
        with pytest.raises(InvalidInputError, match=r"package_dirs(\[0\])? must be a"):
            jacokin.load_robot(urdf_folder() / "j2n6s300.urdf", package_dirs=value)


def test_a_rotation_differs_by_an_angle(tmp_path: Path) -> None:
    """Two thirds of pi about a diagonal: 2.094 rad, of which the chord would be 1.732."""
    one, other = tmp_path / "one.urdf", tmp_path / "other.urdf"
    one.write_text(ur5_text())
    turned = '<link name="tool"/><joint name="t" type="fixed"><parent link="l6"/><child link="tool"/>{}</joint></robot>'
    one.write_text(ur5_text().replace("</robot>", turned.format("")))
    other.write_text(
        ur5_text().replace("</robot>", turned.format('<origin rpy="1.5707963267948966 0 1.5707963267948966"/>'))
    )
    a, b = (jacokin.load_robot(path, tip="tool") for path in (one, other))
    report = jacokin.crosscheck(a, b, samples=5, frame_map={"tool": "tool"})
    assert report.worst("rotation").value == pytest.approx(2.0 * np.pi / 3.0, abs=1e-12)
