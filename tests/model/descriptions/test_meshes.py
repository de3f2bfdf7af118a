"""Meshes of a URDF are found in packages and by path, and the same body collides alike whatever its file."""

from __future__ import annotations

import gzip
import os
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh

import jacokin
from jacokin.errors import ShapeError
from jacokin.model import Box, Scene, SelfContact
from jacokin.model.descriptions.meshes import hull_of, read_mesh_file
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
    with pytest.raises(ShapeError, match=r"mesh 'package://my_arm/meshes/part.stl' is not found.*package_dirs="):
        SelfContact(robot)
    (tmp_path / "share" / "my_arm" / "meshes" / "part.stl").write_text("solid nothing")
    with pytest.raises(ShapeError, match="part.stl"):
        SelfContact(jacokin.load_robot(tmp_path / "robots" / "arm.urdf", package_dirs=[tmp_path / "share"]))


SIZE, PLACE = (0.1, 0.06, 0.04), (0.03, -0.02, 0.05)  # [m] of a body that no turn or mirroring leaves as it is
APART = 0.2  # [m] between the body and the obstacle


def body() -> trimesh.Trimesh:
    mesh: trimesh.Trimesh = trimesh.creation.box(SIZE).apply_translation(PLACE)
    return mesh


def dae_text(mesh: trimesh.Trimesh, unit: float, node: str = "", up: str = "Z_UP") -> str:
    """COLLADA by hand, in a unit of its own [m]."""
    values = " ".join(f"{value:.12g}" for value in (np.asarray(mesh.vertices) / unit).ravel())
    corners = " ".join(map(str, np.asarray(mesh.faces).ravel()))
    count = len(mesh.vertices)
    return f"""<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit name="own" meter="{unit}"/><up_axis>{up}</up_axis></asset>
<library_geometries><geometry id="g"><mesh>
<source id="s"><float_array id="a" count="{3 * count}">{values}</float_array><technique_common>
<accessor source="#a" count="{count}" stride="3"><param name="X" type="float"/><param name="Y" type="float"/>
<param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#s"/></vertices>
<triangles count="{len(mesh.faces)}"><input semantic="VERTEX" source="#v" offset="0"/><p>{corners}</p></triangles>
</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="w"><node id="n">{node}<instance_geometry url="#g"/></node></visual_scene>
</library_visual_scenes><scene><instance_visual_scene url="#w"/></scene></COLLADA>"""


def scaled(factor: float, *axes: float) -> trimesh.Trimesh:
    mesh = body()
    mesh.vertices = mesh.vertices * factor * np.array(axes or (1.0, 1.0, 1.0))
    return mesh


def obj_text() -> str:
    """Two groups and an object, polygons, relative numbers and a broken line."""
    corners = [np.array(PLACE) + np.array(SIZE) * (np.array(sign) - 0.5) for sign in np.ndindex(2, 2, 2)]
    v = [f"v {x} {y} {z}" for x, y, z in corners]
    lines = ["# made by a test", "mtllib none.mtl", "g left", *v[:4], "f -4/1/1 -3/2/2 -1/3/3 -2/4/4"]
    lines += [
        "g right",
        "usemtl paint",
        *v[4:],
        "f 5//1 6//2 8//3 \\",
        "7//4",
        "o rest",
        "f 1 2 6 5",
        "f 3 4 8 7",
        "l 1 2",
    ]
    return "\n".join(lines)


def binary_stl(mesh: trimesh.Trimesh, header: bytes = b"") -> bytes:
    data = trimesh.exchange.stl.export_stl(mesh)
    return header.ljust(80) + bytes(data[80:])


def ascii_stl(mesh: trimesh.Trimesh) -> str:
    return str(trimesh.exchange.stl.export_stl_ascii(mesh))


def half_text(side: int) -> str:
    half = trimesh.creation.box((0.5 * SIZE[0], *SIZE[1:]))
    x, y, z = PLACE
    return ascii_stl(half.apply_translation((x + 0.25 * side * SIZE[0], y, z)))


def many_faces() -> trimesh.Trimesh:
    mesh = body()
    while len(mesh.faces) < 150_000:
        mesh = mesh.subdivide()
    return mesh


WAYS: dict[str, tuple[str, Callable[[Path], object], str]] = {
    "binary": ("a.stl", lambda file: file.write_bytes(binary_stl(body())), ""),
    "solid": ("a.stl", lambda file: file.write_bytes(binary_stl(body(), b"solid part of an arm")), ""),
    "text": ("a.stl", lambda file: file.write_text(ascii_stl(body())), ""),
    "text in capitals": ("A.STL", lambda file: file.write_text(ascii_stl(body()).upper()), ""),
    "two solids": ("a.stl", lambda file: file.write_text(half_text(-1) + half_text(1)), ""),
    "trailing bytes": ("a.stl", lambda file: file.write_bytes(binary_stl(body()) + b"\0\0"), ""),
    "solid and trailing bytes": ("a.stl", lambda file: file.write_bytes(binary_stl(body(), b"solid") + b"\n\n"), ""),
    "groups": ("a.obj", lambda file: file.write_text(obj_text()), ""),
    "ply": ("a.ply", lambda file: body().export(file), ""),
    "off": ("a.off", lambda file: body().export(file), ""),
    "glb": ("a.glb", lambda file: body().export(file), ""),
    "dae": ("a.dae", lambda file: file.write_text(dae_text(body(), 1.0)), ""),
    "dae in mm": ("a.dae", lambda file: file.write_text(dae_text(body(), 0.001)), ""),
    "dae in inches": ("a.DAE", lambda file: file.write_text(dae_text(body(), 0.0254)), ""),
    "dae placed": (
        "a.dae",
        lambda file: file.write_text(dae_text(scaled(0.5), 0.01, "<scale>2 2 2</scale>")),
        "",
    ),
    "dae of an exporter": ("a.dae", lambda file: body().export(file), ""),
    "scale of one number": ("a.stl", lambda file: file.write_bytes(binary_stl(scaled(1000.0))), 'scale="0.001"'),
    "scale of three": (
        "a.stl",
        lambda file: file.write_bytes(binary_stl(scaled(1000.0, 0.5, 1.0, -2.0))),
        'scale="0.002 0.001 -0.0005"',
    ),
    "many faces": ("a.stl", lambda file: file.write_bytes(binary_stl(many_faces())), ""),
}


def arm_with(tmp_path: Path, geometry: str, name: str = "arm.urdf") -> Path:
    """An arm of one shape, on its last link."""
    path = tmp_path / name
    shape = f"<collision><geometry>{geometry}</geometry></collision>"
    path.write_text(ur5_text().replace('<link name="l6"></link>', f'<link name="l6">{shape}</link>'))
    return path


def clearance(path: Path) -> float:
    """To an obstacle 0.2 m from where the body's larger face is."""
    robot = jacokin.load_robot(path)
    q = np.array([0.3, -0.7, 0.9, 0.2, 0.5, -0.4])
    T = robot.forward_kinematics(q).homogeneous
    T_tool_wall = np.eye(4)
    T_tool_wall[:3, 3] = PLACE
    T_tool_wall[0, 3] += 0.5 * SIZE[0] + APART + 0.05
    return float(robot.clearance(q, Scene([Box("wall", [0.1, 0.1, 0.1], T @ T_tool_wall)])))


@pytest.mark.one_quick
@pytest.mark.parametrize("way", WAYS)
def test_the_same_body_is_as_near_whatever_its_file(tmp_path: Path, way: str) -> None:
    name, write, scale = WAYS[way]
    write(tmp_path / name)
    assert abs(clearance(arm_with(tmp_path, f'<mesh filename="{name}" {scale}/>')) - APART) < 1e-4
    drawn = read_mesh_file(tmp_path / name, tmp_path)
    assert drawn.faces.max() < len(drawn.vertices)


def test_axes_of_a_mesh_are_those_of_its_file_and_a_doubt_is_said(tmp_path: Path) -> None:
    (tmp_path / "a.dae").write_text(dae_text(body(), 0.001, up="Y_UP"))
    path = arm_with(tmp_path, '<mesh filename="a.dae"/>')
    assert abs(clearance(path) - APART) < 1e-4
    assert any("'a.dae' says Y_UP; it is not turned" in note for note in jacokin.load_robot(path).notes)


def test_a_round_mesh_of_many_faces_keeps_its_size(tmp_path: Path) -> None:
    ball = trimesh.creation.icosphere(subdivisions=6, radius=0.1)
    hull = hull_of(np.asarray(ball.vertices))
    assert hull is not None
    assert len(hull.vertices) < len(ball.vertices)
    along = np.random.default_rng(0).normal(size=(300, 3))
    along /= np.linalg.norm(along, axis=1)[:, None]
    missing = (ball.vertices @ along.T).max(axis=0) - (hull.vertices @ along.T).max(axis=0)
    assert missing.min() + 1e-12 >= 0.0
    assert missing.max() < 1e-4
    outside = trimesh.Trimesh(hull.vertices, hull.faces)
    assert outside.is_winding_consistent
    assert outside.volume > 0.0


FLAT = {
    "square": [(-0.05, -0.03, 0.0), (0.05, -0.03, 0.0), (0.05, 0.03, 0.0), (-0.05, 0.03, 0.0)],
    "tilted": [(-0.05, -0.03, 0.02), (0.05, -0.03, -0.01), (0.05, 0.03, -0.01), (-0.05, 0.03, 0.02)],
    "line": [(-0.05, 0.0, 0.0), (0.05, 0.0, 0.0), (0.02, 0.0, 0.0), (0.0, 0.0, 0.0)],
}


@pytest.mark.parametrize("case", FLAT)
@pytest.mark.parametrize("suffix", ["obj", "stl"])
def test_a_flat_mesh_is_a_thin_shape(tmp_path: Path, case: str, suffix: str) -> None:
    corners = np.array(FLAT[case]) + PLACE
    mesh = trimesh.Trimesh(corners, [(0, 1, 2), (0, 2, 3)], process=False)
    mesh.export(tmp_path / f"flat.{suffix}")
    assert abs(clearance(arm_with(tmp_path, f'<mesh filename="flat.{suffix}"/>')) - APART) < 1e-4


@pytest.mark.one_quick
@pytest.mark.parametrize(
    "geometry",
    [
        '<box size="0 0 0"/>',
        '<sphere radius="0"/>',
        '<cylinder radius="0" length="0"/>',
        '<capsule radius="0" length="0"/>',
        "",
        '<mesh filename="part.stl" scale="0 0 0"/>',
        '<mesh filename="point.obj"/>',
    ],
)
def test_a_shape_without_a_size_is_left_out_alone_and_said(tmp_path: Path, geometry: str) -> None:
    body().export(tmp_path / "part.stl")
    (tmp_path / "point.obj").write_text("v 0 0 0\nv 0 0 0\nv 0 0 0\nf 1 2 3\n")
    shape = f'<collision name="bad"><geometry>{geometry}</geometry></collision>'
    good = '<collision><geometry><mesh filename="part.stl"/></geometry></collision>'
    path = arm_with(tmp_path, '<mesh filename="part.stl"/>')
    path.write_text(path.read_text().replace(good, shape + good))
    assert abs(clearance(path) - APART) < 1e-4
    robot = jacokin.load_robot(path)
    assert sum("'bad' of link 'l6' has no size and is left out" in note for note in robot.notes) == 1
    assert jacokin.IKSolver(robot, collision="reject").solve(robot.forward_kinematics(robot.home)).success


@pytest.mark.parametrize(
    ("geometry", "near"),
    [
        ('<box size="0.1 0.06 0"/>', 0.23),
        ('<cylinder radius="0" length="0.1"/>', 0.28),
        ('<cylinder radius="0.05" length="0"/>', 0.23),
        ('<capsule radius="0.05" length="0"/>', 0.23),
        ('<capsule radius="0" length="0.1"/>', 0.28),
    ],
)
def test_a_flat_simple_shape_is_thin(tmp_path: Path, geometry: str, near: float) -> None:
    path = arm_with(tmp_path, geometry)
    assert abs(clearance(path) - near) < 1e-4
    assert not any("left out" in note for note in jacokin.load_robot(path).notes)


def pack(tmp_path: Path, name: str) -> None:
    if name.endswith(".gz") or name == "zeros.stl":
        (tmp_path / name).write_bytes(gzip.compress(bytes(10_000_000) if name == "zeros.stl" else binary_stl(body())))
    else:
        with zipfile.ZipFile(tmp_path / name, "w", zipfile.ZIP_DEFLATED) as packed:
            packed.writestr("part.dae", dae_text(body(), 1.0))


REFUSED = {
    "missing": ("nowhere.stl", "mesh 'nowhere.stl' is not found"),
    "missing package": ("package://arm/nowhere.stl", "package_dirs="),
    "long name": ("x" * 300 + ".stl", "File name too long"),
    "long path": ("package://arm/" + "x/" * 3000, "File name too long"),
    "odd address": ("package://[x/a.stl", "cannot be a file: "),
    "zero byte": ("file:///a%00.stl", "is not found"),
    "gz": ("a.stl.gz", "unknown format; valid: .stl"),
    "bomb": ("zeros.stl", "packed"),
    "zip": ("packed.dae", "packed"),
    "zae": ("packed.zae", "unknown format"),
    "folder": ("folder.stl", "is not found"),
    "empty": ("empty.stl", "holds no triangles"),
    "cut": ("cut.stl", "cannot be read"),
    "words": ("words.obj", "cannot be read"),
    "far vertex": ("far.obj", "cannot be read"),
    "far away": ("away.obj", "beyond 1e+09 m"),
    "not finite": ("nan.obj", "not finite"),
    "no vertex": ("index.ply", "triangles of vertices that it has not"),
    "giant": ("giant.gltf", "more than 9000000 numbers of a kind"),
    "pipe beside": ("pipe.gltf", "pipe: cannot be read: it is not a regular file"),
    "no unit": ("unit.dae", "its unit is 0.0 m"),
}


@pytest.mark.one_quick
@pytest.mark.parametrize("case", REFUSED)
def test_what_is_no_mesh_is_refused_by_name_wherever_contact_is_asked_for(tmp_path: Path, case: str) -> None:
    name, message = REFUSED[case]
    for packed in ("a.stl.gz", "zeros.stl", "packed.dae", "packed.zae"):
        pack(tmp_path, packed)
    (tmp_path / "folder.stl").mkdir()
    (tmp_path / "empty.stl").write_text("solid nothing\nendsolid")
    (tmp_path / "cut.stl").write_bytes(binary_stl(body())[:300])
    (tmp_path / "words.obj").write_text("v a b c\nf 1 2 3")
    (tmp_path / "far.obj").write_text("v 0 0 0\nf 1 2 3")
    (tmp_path / "away.obj").write_text("v 0 0 0\nv 1e200 0 0\nv 0 1 0\nf 1 2 3")
    (tmp_path / "nan.obj").write_text("v 0 0 0\nv nan 0 0\nv 0 1 0\nf 1 2 3")
    body().export(tmp_path / "index.ply", encoding="ascii")
    text = (tmp_path / "index.ply").read_text()
    (tmp_path / "index.ply").write_text(text[: text.rindex("3 ")] + "3 1 2 99\n")
    (tmp_path / "giant.gltf").write_text('{"accessors": [{"count": 2000000000}]}')
    (tmp_path / "pipe.gltf").write_text('{"buffers": [{"byteLength": 9, "uri": "pipe"}]}')
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "unit.dae").write_text(dae_text(body(), 1.0).replace('meter="1.0"', 'meter="0"'))
    robot = jacokin.load_robot(arm_with(tmp_path, f'<mesh filename="{name}"/>'))
    solver = jacokin.IKSolver(robot)
    result = solver.solve(robot.forward_kinematics(robot.home))
    assert result.success
    assert "contact was not checked" in result.message
    for ask in (
        lambda: robot.clearance(robot.home, Scene()),
        lambda: SelfContact(robot),
        lambda: jacokin.IKSolver(robot, collision="reject"),
        lambda: jacokin.IKSolver(robot, scene=Scene([Box("b", [0.1, 0.1, 0.1], [1, 0, 0])])),
        lambda: jacokin.Tracker(robot, clearance=0.01, velocity_limit=1.0),
    ):
        with pytest.raises(ShapeError) as error:
            ask()
        assert message in str(error.value)
        assert len(str(error.value)) < 1000
    assert any("contact cannot be looked for" in note and message in note for note in robot.notes)
