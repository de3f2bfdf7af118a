"""Visual meshes of a user's file are drawn where yourdfpy and MuJoCo have them; what is missing is named."""

from __future__ import annotations

import logging
import re
from pathlib import Path

import mujoco
import numpy as np
import pytest
import trimesh
import yourdfpy

import jacokin
from jacokin import IKSolver, Robot
from jacokin.arrays import Array
from jacokin.errors import ModelError
from jacokin.model import urdf_folder
from jacokin.viewer import Inspector, serve
from jacokin.viewer.drawing.robot import Part, parts_of, visuals_of
from tests.viewer.page import opened, until


def visual(name: str, file: str, scale: str = "1 1 1", xyz: str = "0.01 0.02 0.03", rpy: str = "0.3 0.2 0.1") -> str:
    return (
        f'<visual name="{name}"><origin xyz="{xyz}" rpy="{rpy}"/><geometry><mesh filename="{file}" scale="{scale}"/>'
        "</geometry></visual>"
    )


@pytest.fixture
def meshed(tmp_path: Path) -> Path:
    """The bundled arm with meshes of several formats, as its visuals."""
    trimesh.creation.icosphere(subdivisions=1, radius=0.05).export(tmp_path / "ball.stl")
    trimesh.creation.box((0.1, 0.05, 0.2)).export(tmp_path / "block.obj")
    trimesh.creation.cylinder(0.03, 0.1).export(tmp_path / "tube.ply")
    trimesh.creation.cone(0.04, 0.1).export(tmp_path / "cone.dae")
    text = (urdf_folder() / "j2n6s300.urdf").read_text(encoding="utf-8")
    text = re.sub(r"\s*<visual.*?</visual>", "", text, flags=re.S)
    drawn = {
        "link_base": visual("base", "block.obj"),
        "link_2": visual("two", "tube.ply", scale="2 1 0.5") + visual("three", "ball.stl"),
        "link_4": visual("four", "cone.dae"),
        "link_finger_1": visual("finger", "block.obj", scale="0.2 -0.2 0.2"),
    }
    for link, element in drawn.items():
        assert f'<link name="{link}">' in text
        text = text.replace(f'<link name="{link}">', f'<link name="{link}">{element}')
    path = tmp_path / "meshed.urdf"
    path.write_text(text, encoding="utf-8")
    return path


def cloud(robot: Robot, parts: tuple[Part, ...], q: Array) -> Array:
    """Every vertex of the drawn arm in the base frame, sorted."""
    places = Inspector(IKSolver(robot, warm=None)).places([q])
    found = []
    for part, position, quat in zip(parts, places.positions[0], places.wxyzs[0], strict=True):
        if part.mesh is not None:
            rotation = np.zeros(9)
            mujoco.mju_quat2Mat(rotation, quat.astype(np.float64))
            found.append(part.mesh.vertices @ rotation.reshape(3, 3).T + position)
    return ordered(np.vstack(found))


def ordered(points: Array) -> Array:
    return points[np.lexsort(np.round(points, 4).T)]


def nearest(points: Array, others: Array) -> float:
    """The largest distance of a point to its nearest other point [m]."""
    return float(np.linalg.norm(points[:, None] - others, axis=2).min(axis=1).max())


@pytest.mark.filterwarnings("ignore:Conversion of an array:DeprecationWarning")  # yourdfpy 0.0.58's own
def test_meshes_of_a_urdf_are_where_yourdfpy_has_them(meshed: Path, rng: np.random.Generator) -> None:
    robot = jacokin.load_robot(meshed, finger_angle=0.4)
    parts = visuals_of(robot)
    assert parts is not None
    other = yourdfpy.URDF.load(str(meshed), load_meshes=True, mesh_dir=str(meshed.parent))
    q = robot.sample(rng)
    angles = dict(zip(robot.joint_names, q.tolist(), strict=True))
    fingers = {name: 0.4 for name in other.actuated_joint_names if name not in angles}
    other.update_cfg({**angles, **fingers})
    points = []
    for name in other.scene.graph.nodes_geometry:
        placement, geometry = other.scene.graph.get(name)
        vertices = other.scene.geometry[geometry].vertices
        points.append(vertices @ placement[:3, :3].T + placement[:3, 3])
    drawn, wanted = cloud(robot, parts, q), np.vstack(points)
    assert len(drawn) > 100
    assert nearest(drawn, wanted) < 1e-5
    assert nearest(wanted, drawn) < 1e-5


def test_a_mirrored_mesh_still_looks_outward(meshed: Path) -> None:
    parts = visuals_of(jacokin.load_robot(meshed))
    assert parts is not None
    finger = parts[-1].mesh
    assert finger is not None
    corners = finger.vertices[finger.faces].astype(np.float64)
    volume = np.einsum("fi,fi->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6.0
    assert volume == pytest.approx(0.2**3 * 0.1 * 0.05 * 0.2, rel=1e-3)


MJCF = """<mujoco><asset><mesh name="wedge" vertex="0 0 0  0.1 0 0  0 0.1 0  0 0 0.1"/>
<material name="clear" rgba="1 1 1 0"/></asset><worldbody>
<body name="base"><geom type="box" size="0.05 0.05 0.02" contype="0" conaffinity="0" group="2"/>
<body name="one" pos="0 0 0.1"><joint name="a" axis="0 0 1" range="-1 1" limited="true"/>
<geom name="hull" type="sphere" size="0.1" group="3"/>
<geom name="w" type="mesh" mesh="wedge" pos="0.2 0 0" euler="10 20 30" contype="0" conaffinity="0" group="2"/>
<geom name="glass" type="sphere" size="0.5" material="clear" contype="0" conaffinity="0"/>
<site name="tip" pos="0.3 0 0"/></body></body></worldbody></mujoco>"""


def test_meshes_of_an_mjcf_are_where_mujoco_has_them(tmp_path: Path) -> None:
    path = tmp_path / "arm.xml"
    path.write_text(MJCF, encoding="utf-8")
    robot = jacokin.load_robot(path)
    parts = visuals_of(robot)
    assert parts is not None
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    data.qpos[:] = 0.7
    mujoco.mj_kinematics(model, data)
    geom = model.geom("w").id
    wanted = model.mesh_vert @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]
    drawn = cloud(robot, parts, np.array([0.7]))
    assert nearest(wanted, drawn) < 1e-6
    assert len(drawn) == len(wanted) + 8  # with the box of the base, without what collides and what is clear


def test_without_visuals_of_its_own_a_robot_has_none(robot: Robot, tmp_path: Path) -> None:
    assert visuals_of(robot) is None
    path = tmp_path / "arm.xml"
    path.write_text(MJCF.replace('contype="0" conaffinity="0"', ""), encoding="utf-8")
    assert visuals_of(jacokin.load_robot(path)) is None


def test_a_missing_mesh_is_named_and_the_shapes_are_drawn(meshed: Path, caplog: pytest.LogCaptureFixture) -> None:
    (meshed.parent / "cone.dae").unlink()
    robot = jacokin.load_robot(meshed)
    with pytest.raises(ModelError, match=r"cone\.dae' is not found"):
        visuals_of(robot)
    with caplog.at_level(logging.WARNING), serve(robot, visuals=True, port=0) as viewer:
        assert "shapes that collide are drawn instead of the visual meshes" in caplog.text
        assert viewer._panel._visuals.disabled
        assert len(viewer._stage.arm.solid) == sum(part.mesh is not None for part in parts_of(robot)[0]) == 7
    (meshed.parent / "cone.dae").write_text("not a mesh", encoding="utf-8")
    with pytest.raises(ModelError, match=r"cone\.dae cannot be read"):
        visuals_of(robot)


def test_a_missing_mesh_that_collides_is_named_and_sticks_are_drawn(tmp_path: Path) -> None:
    text = (urdf_folder() / "j2n6s300.urdf").read_text(encoding="utf-8")
    text = re.sub(r"<cylinder[^>]*/>", '<mesh filename="package://gone/part.stl"/>', text)
    path = tmp_path / "arm.urdf"
    path.write_text(text, encoding="utf-8")
    parts, note = parts_of(jacokin.load_robot(path))
    assert "package_dirs=" in note
    assert all(part.mesh is not None and not part.shapes for part in parts)


def test_the_switch_changes_what_is_drawn(meshed: Path) -> None:
    robot = jacokin.load_robot(meshed)
    with serve(robot, port=0) as viewer, opened(viewer) as page:
        assert until(viewer.server.get_clients)
        arm = viewer._stage.arm
        shapes = {index: len(node.vertices) for index, node in arm.solid.items()}
        page.set(viewer._panel._visuals, True)
        assert until(lambda: {index: len(node.vertices) for index, node in arm.solid.items()} != shapes)
        assert until(lambda: len(arm.solid) == 4)  # base, link 2, link 4, finger
        places = viewer._inspector.places([viewer.view.q])
        assert until(lambda: all(np.allclose(n.position, places.positions[0, i]) for i, n in arm.solid.items()))
        names = set(viewer.server.scene._handle_from_node_name)
        assert {name for name in names if name.startswith("/arm/")} == {f"/arm/{index}" for index in arm.solid}
        page.set(viewer._panel._visuals, False)
        assert until(lambda: {index: len(node.vertices) for index, node in arm.solid.items()} == shapes)
    with serve(robot, visuals=True, port=0) as viewer:
        assert len(viewer._stage.arm.solid) == 4


def test_changing_what_is_drawn_leaves_no_messages_behind(meshed: Path) -> None:
    with serve(jacokin.load_robot(meshed), port=0) as viewer:
        arm, look = viewer._stage.arm, viewer._look
        assert look.visuals is not None

        def messages() -> int:
            return len(viewer.server._websock_server._broadcast_buffer.message_from_id)

        counts = []
        for _ in range(5):
            arm.dress(look.visuals)
            arm.dress(look.shapes)
            counts.append(messages())
        assert counts[-1] <= counts[1]
