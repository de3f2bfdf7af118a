"""What is drawn: closed meshes, where MuJoCo and yourdfpy have them; what is missing is named."""

from __future__ import annotations

import logging
import re
from collections.abc import Callable
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
from jacokin.ik import Floor, PointCloud, Scene
from jacokin.model import NAMES, to_mujoco, urdf_folder
from jacokin.model.mujoco_twin import rgba_of
from jacokin.viewer import Inspector, ViewerOptions, drawing, serve
from jacokin.viewer.drawing import ArmPart, load_parts, load_visuals, read_geom, read_site, to_colour
from tests.robot_files import load_text, ur5_text
from tests.viewer.page import Page, opened, until


def volume(mesh: drawing.Triangles) -> float:
    """By the divergence theorem: positive when the faces look outward [m^3]."""
    corners = mesh.vertices[mesh.faces].astype(np.float64)
    return float(np.einsum("fi,fi->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6.0)


@pytest.mark.parametrize(
    ("mesh", "wanted"),
    [
        (drawing.box(np.array([0.1, 0.2, 0.3])), 8 * 0.006),
        (drawing.sphere(0.1), 4 / 3 * np.pi * 1e-3),
        (drawing.cylinder(0.1, 0.2), np.pi * 0.01 * 0.4),
        (drawing.capsule(0.1, 0.2), np.pi * 0.01 * 0.4 + 4 / 3 * np.pi * 1e-3),
        (drawing.rounded_box(np.array([0.1, 0.2, 0.3])), 8 * 0.006),
        (drawing.rounded_box(np.array([0.1, 0.002, 0.3])), 8 * 0.00006),
        (drawing.rounded_cylinder(0.1, 0.2), np.pi * 0.01 * 0.4),
    ],
)
def test_a_primitive_is_closed_and_has_its_volume(mesh: drawing.Triangles, wanted: float) -> None:
    assert volume(mesh) == pytest.approx(wanted, rel=0.04)
    edges = np.sort(np.vstack([mesh.faces[:, [a, b]] for a, b in ((0, 1), (1, 2), (2, 0))]), axis=1)
    assert (np.unique(edges, axis=0, return_counts=True)[1] == 2).all()


def test_a_cloud_is_drawn_inside_of_its_spheres_and_some_of_many_points(rng: np.random.Generator) -> None:
    few = PointCloud("few", rng.normal(size=(30, 3)), 0.02, [0.1, 0.2, 0.3])
    mesh = drawing.build_obstacles(Scene([few, Floor(-0.1)]))["few"]
    assert volume(mesh) == pytest.approx(30 * 4 / 3 * 0.02**3, rel=1e-3)
    centres = mesh.vertices.reshape(30, 6, 3).mean(axis=1)
    wanted = few.some_points(30)
    np.testing.assert_allclose(centres[np.lexsort(centres.T)], wanted[np.lexsort(wanted.T)], atol=1e-6)
    many = drawing.cloud(PointCloud("many", rng.normal(size=(3 * drawing.DRAWN_POINTS + 1, 3)), 0.0))
    assert drawing.DRAWN_POINTS / 2 < len(many.faces) / 8 <= drawing.DRAWN_POINTS
    assert volume(many) > 0.0


def test_rounded_edges_stay_inside_and_round() -> None:
    half = np.array([0.04, 0.2, 0.018])
    mesh = drawing.rounded_box(half)
    assert (np.abs(mesh.vertices) <= half + 1e-7).all()
    assert np.abs(mesh.vertices).max(axis=0) == pytest.approx(half, abs=1e-7)
    radius = drawing.bevel(half)
    corner = np.abs(mesh.vertices) - (half - radius)
    assert np.linalg.norm(np.maximum(corner, 0.0), axis=1) == pytest.approx(radius, abs=1e-7)
    turned = drawing.rounded_cylinder(0.05, 0.011)
    assert np.linalg.norm(turned.vertices[:, :2], axis=1).max() == pytest.approx(0.05, abs=1e-7)
    assert np.abs(turned.vertices[:, 2]).max() == pytest.approx(0.011, abs=1e-7)


def test_the_arm_has_the_colours_of_its_description(robot: Robot, tmp_path: Path) -> None:
    dark, light = (26, 26, 26), (178, 178, 178)  # 0.1 and 0.7, as the URDF and the MJCF have them
    base, *moved = load_parts(robot)[0]
    assert {piece.colour for piece in base.pieces} == {dark}
    assert all({piece.colour for piece in part.pieces} == {dark, light} for part in moved)
    text = (urdf_folder() / "j2n6s300.urdf").read_text(encoding="utf-8")
    drawn = load_visuals(load_text(tmp_path / "own.urdf", text.replace("0.7 0.7 0.7 1.0", "1 0 0 1")))
    assert drawn is not None
    assert {piece.colour for piece in drawn[1].pieces} == {dark, (255, 0, 0)}


def test_an_arm_of_few_sides_has_few_triangles_in_the_same_places_and_colours(robot: Robot) -> None:
    for fine, light in zip(load_parts(robot)[0], load_parts(robot, sides=12)[0], strict=True):
        assert {piece.colour for piece in light.pieces} == {piece.colour for piece in fine.pieces}
        assert light.mesh is not None
        assert fine.mesh is not None
        assert len(light.mesh.faces) < len(fine.mesh.faces) / 7
        for end in (np.min, np.max):
            difference = end(light.mesh.vertices, axis=0) - end(fine.mesh.vertices, axis=0)
            assert np.abs(difference).max() < 0.004  # [m] of round shapes, 12 sides lie within


def cloud(robot: Robot, parts: tuple[ArmPart, ...], q: Array) -> Array:
    """Every vertex of the drawn arm in the base frame."""
    places = Inspector(IKSolver(robot)).places([q])
    found = []
    for part, position, quat in zip(parts, places.positions[0], places.wxyzs[0], strict=True):
        if part.mesh is not None:
            rotation = np.zeros(9)
            mujoco.mju_quat2Mat(rotation, quat.astype(np.float64))
            found.append(part.mesh.vertices @ rotation.reshape(3, 3).T + position)
    return np.vstack(found)


@pytest.mark.one_quick
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
    distances = np.linalg.norm(cloud(robot, load_parts(robot)[0], q)[:, None] - centres, axis=2)
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
    (base, arm), note = load_parts(robot)
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
    parts, note = load_parts(bare)
    assert "no collision shapes" in note
    assert len(parts) == 7
    assert all(part.mesh is not None and not part.shapes for part in parts)
    tip = bare.forward_kinematics(bare.home).translation
    assert np.linalg.norm(cloud(bare, parts, bare.home) - tip, axis=1).min() < 0.03


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


def nearest(points: Array, others: Array) -> float:
    """The largest distance of a point to its nearest other point [m]."""
    return float(np.linalg.norm(points[:, None] - others, axis=2).min(axis=1).max())


@pytest.mark.filterwarnings("ignore:Conversion of an array:DeprecationWarning")  # yourdfpy 0.0.58's own
def test_meshes_of_a_urdf_are_where_yourdfpy_has_them(meshed: Path, rng: np.random.Generator) -> None:
    robot = jacokin.load_robot(meshed, finger_angle=0.4)
    parts = load_visuals(robot)
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
    parts = load_visuals(jacokin.load_robot(meshed))
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
    parts = load_visuals(robot)
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
    assert load_visuals(robot) is None
    assert load_visuals(load_text(tmp_path / "arm.xml", MJCF.replace('contype="0" conaffinity="0"', ""))) is None


@pytest.mark.slow
def test_a_missing_mesh_is_named_and_the_shapes_are_drawn(meshed: Path, caplog: pytest.LogCaptureFixture) -> None:
    (meshed.parent / "cone.dae").unlink()
    robot = jacokin.load_robot(meshed)
    with pytest.raises(ModelError, match=r"cone\.dae' is not found"):
        load_visuals(robot)
    with caplog.at_level(logging.WARNING), serve(robot, ViewerOptions(visuals=True), port=0) as viewer:
        assert "shapes that collide are drawn instead of the visual meshes" in caplog.text
        with opened(viewer) as page:
            assert page.control("Visual meshes").props["disabled"]
            assert {name for name in page.names("/arm/") if "/" not in name} == set("0123456")
            assert all(part.mesh is not None for part in load_parts(robot)[0])
    (meshed.parent / "cone.dae").write_text("not a mesh", encoding="utf-8")
    with pytest.raises(ModelError, match=r"cone\.dae cannot be read"):
        load_visuals(robot)


def test_a_missing_mesh_that_collides_is_named_and_sticks_are_drawn(tmp_path: Path) -> None:
    text = (urdf_folder() / "j2n6s300.urdf").read_text(encoding="utf-8")
    text = re.sub(r"<cylinder[^>]*/>", '<mesh filename="package://gone/part.stl"/>', text)
    parts, note = load_parts(load_text(tmp_path / "arm.urdf", text))
    assert "package_dirs=" in note
    assert all(part.mesh is not None and not part.shapes for part in parts)


@pytest.mark.slow
def test_the_switch_changes_what_is_drawn_and_leaves_no_messages_behind(meshed: Path) -> None:
    robot = jacokin.load_robot(meshed)
    visuals = load_visuals(robot)
    assert visuals is not None

    def drawn(page: Page, parts: tuple[ArmPart, ...]) -> bool:
        """Whether the page draws just these, where forward kinematics has them."""
        wanted = {
            f"{index}/{number}": piece.mesh
            for index, part in enumerate(parts)
            for number, piece in enumerate(part.pieces)
        }
        frames = {name.partition("/")[0] for name in wanted}
        if page.names("/arm/") != frames | set(wanted):
            return False
        at = Inspector(IKSolver(robot)).places([viewer.view.q]).positions[0]
        return all(
            np.array_equal(page.node(f"/arm/{name}").props["vertices"], mesh.vertices.ravel())
            for name, mesh in wanted.items()
        ) and all(np.allclose(page.node(f"/arm/{name}").position, at[int(name)]) for name in frames)

    with serve(robot, port=0) as viewer, opened(viewer) as page:
        assert drawn(page, load_parts(robot)[0])
        backlogs = []
        for _ in range(3):
            for shown, parts in ((True, visuals), (False, load_parts(robot)[0])):
                page.change("Visual meshes", shown)
                assert until(lambda parts=parts: drawn(page, parts))  # type: ignore[misc]  # bound here
            with opened(viewer) as other:
                backlogs.append(other.screen.backlog)
        assert backlogs[-1] <= backlogs[0]
    with serve(robot, ViewerOptions(visuals=True), port=0) as viewer, opened(viewer) as page:
        assert drawn(page, visuals)
        assert page.names("/arm/") == {f"{part}{piece}" for part in (0, 2, 4, 6) for piece in ("", "/0")}


def test_a_visual_mesh_has_the_unit_of_its_file_and_colours_of_three_numbers(tmp_path: Path) -> None:
    """Millimetres in a .dae file, a scale of one number, and a `<color>` without a fourth number."""
    ball = trimesh.creation.icosphere(subdivisions=1, radius=50.0)
    ball.export(tmp_path / "ball.stl")
    ball.export(tmp_path / "ball.dae")
    text = (tmp_path / "ball.dae").read_text()
    (tmp_path / "ball.dae").write_text(text.replace("<up_axis>", '<unit name="millimeter" meter="0.001"/><up_axis>'))
    paint = '<material name=""><color rgba="1 0.5 0"/></material>'
    path = tmp_path / "arm.urdf"
    for mesh in ('filename="ball.dae"', 'filename="ball.stl" scale="0.001"'):
        path.write_text(ur5_text(f"<visual><geometry><mesh {mesh}/></geometry>{paint}</visual>"))
        parts = load_visuals(jacokin.load_robot(path))
        assert parts is not None
        for part in parts:
            assert part.mesh is not None
            np.testing.assert_allclose(np.linalg.norm(part.mesh.vertices, axis=1), 0.05, atol=1e-6)
            assert [piece.colour for piece in part.pieces] == [(255, 128, 0)]


@pytest.mark.parametrize("kind", ["box", "sphere", "capsule", "cylinder", "ellipsoid"])
def test_a_site_is_drawn_like_a_geom(kind: str) -> None:
    look = f'type="{kind}" size="0.1 0.2 0.3" pos="1 2 3" quat="0.5 0.5 -0.5 0.5"'
    model = mujoco.MjModel.from_xml_string(
        f"<mujoco><worldbody><geom {look} rgba='1 0 0 1'/><site {look} rgba='0 1 0 1'/></worldbody></mujoco>"
    )
    geom, site = read_geom(model, 0), read_site(model, 0)
    assert geom is not None
    assert site is not None
    np.testing.assert_array_equal(site.vertices, geom.vertices)
    assert to_colour(rgba_of(model, 0)) == (255, 0, 0)
    assert to_colour(rgba_of(model, 0, "site")) == (0, 255, 0)
