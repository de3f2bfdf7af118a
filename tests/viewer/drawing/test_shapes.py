"""Meshes of the arm: closed, outward, and where MuJoCo has the shapes."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np
import pytest

import jacokin
from jacokin import IKSolver, Robot
from jacokin.arrays import Array
from jacokin.model import NAMES, to_mujoco
from jacokin.viewer import Inspector
from jacokin.viewer.drawing import meshes as shapes
from jacokin.viewer.drawing.robot import parts_of


def volume(mesh: shapes.Mesh) -> float:
    """By the divergence theorem: positive when the faces look outward [m^3]."""
    corners = mesh.vertices[mesh.faces].astype(np.float64)
    return float(np.einsum("fi,fi->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6.0)


@pytest.mark.parametrize(
    ("mesh", "wanted"),
    [
        (shapes.box(np.array([0.1, 0.2, 0.3])), 8 * 0.006),
        (shapes.sphere(0.1), 4 / 3 * np.pi * 1e-3),
        (shapes.cylinder(0.1, 0.2), np.pi * 0.01 * 0.4),
        (shapes.capsule(0.1, 0.2), np.pi * 0.01 * 0.4 + 4 / 3 * np.pi * 1e-3),
    ],
)
def test_a_primitive_is_closed_and_has_its_volume(mesh: shapes.Mesh, wanted: float) -> None:
    assert volume(mesh) == pytest.approx(wanted, rel=0.04)
    edges = np.sort(np.vstack([mesh.faces[:, [a, b]] for a, b in ((0, 1), (1, 2), (2, 0))]), axis=1)
    assert (np.unique(edges, axis=0, return_counts=True)[1] == 2).all()


def surface(robot: Robot, q: Array) -> Array:
    """Every vertex of the drawn arm in the base frame."""
    places = Inspector(IKSolver(robot, warm=None)).places([q])
    vertices = []
    for part, position, quat in zip(parts_of(robot)[0], places.positions[0], places.wxyzs[0], strict=True):
        if part.mesh is not None:
            rotation = np.zeros(9)
            mujoco.mju_quat2Mat(rotation, quat.astype(np.float64))
            vertices.append(part.mesh.vertices @ rotation.reshape(3, 3).T + position)
    return np.vstack(vertices)


@pytest.mark.parametrize("name", NAMES)
def test_the_drawn_arm_is_where_mujoco_has_its_shapes(
    name: str, bundled: Callable[[str], Robot], rng: np.random.Generator
) -> None:
    robot = bundled(name)
    model = to_mujoco(robot, geometry=True)
    data = mujoco.MjData(model)
    q = robot.sample(rng)
    data.qpos[:] = q
    mujoco.mj_kinematics(model, data)
    centres, reach = np.array(data.geom_xpos), np.array(model.geom_rbound)
    distances = np.linalg.norm(surface(robot, q)[:, None] - centres, axis=2)
    assert (distances <= reach + 1e-5).any(axis=1).all()  # nothing is drawn where no shape is
    assert (distances.min(axis=0) <= reach + 1e-5).all()  # no shape is missing


def test_meshes_of_a_file_are_drawn(tmp_path: Path) -> None:
    path = tmp_path / "arm.xml"
    path.write_text(
        """<mujoco><asset><mesh name="wedge" vertex="0 0 0  0.1 0 0  0 0.1 0  0 0 0.1"/></asset><worldbody>
        <body name="base"><body name="one"><joint name="a" axis="0 0 1" range="-1 1" limited="true"/>
        <geom name="w" type="mesh" mesh="wedge" pos="0.2 0 0"/><geom name="e" type="ellipsoid" size="0.1 0.02 0.02"/>
        <site name="tip" pos="0.3 0 0"/></body></body></worldbody></mujoco>""",
        encoding="utf-8",
    )
    robot = jacokin.load_robot(path)
    (base, arm), note = parts_of(robot)
    assert note == ""
    assert base.mesh is None
    assert arm.mesh is not None
    assert tuple(arm.shapes) == ("w", "e")
    assert arm.mesh.vertices.max(axis=0) == pytest.approx([0.3, 0.1, 0.1], abs=1e-6)
    assert volume(arm.mesh) == pytest.approx(1e-3 / 6 + 4 / 3 * np.pi * 4e-5, rel=0.05)


def test_an_arm_without_shapes_is_drawn_as_sticks(tmp_path: Path, robot: Robot) -> None:
    path = tmp_path / "bare.urdf"
    text = Path(robot.source.path).read_text(encoding="utf-8")
    path.write_text(re.sub(r"<collision.*?</collision>|<visual.*?</visual>", "", text, flags=re.S), encoding="utf-8")
    bare = jacokin.load_robot(path)
    parts, note = parts_of(bare)
    assert "no collision shapes" in note
    assert len(parts) == 7
    assert all(part.mesh is not None and not part.shapes for part in parts)
    tip = bare.forward_kinematics(bare.home).translation
    assert np.linalg.norm(surface(bare, bare.home) - tip, axis=1).min() < 0.03
