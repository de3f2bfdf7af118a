"""Meshes of a URDF are found in packages and by path."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

import jacokin
from jacokin.errors import ModelError
from jacokin.model import SelfContact
from tests.robot_files import ur5_text


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
