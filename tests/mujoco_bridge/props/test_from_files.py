"""Props from files: mass and inertia against tetrahedra, touching against balls that are dropped, what is refused."""

from __future__ import annotations

import copy
import importlib.util
import logging
import math
import pickle
from pathlib import Path

import mujoco
import numpy as np
import pytest
import trimesh

from examples.make_mug import HEIGHT, RADIUS, SECTIONS, WALL, make_mug, write_mug
from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, ModelError
from jacokin.mujoco_bridge import Arena, Brick, Entity, Physics, Primitive
from jacokin.mujoco_bridge.props import Mesh, ModelFile

BALL = 0.012  # [m] radius
CUP = """<mujoco model="cup"><worldbody><body name="cup" pos="0 0 0.03"><freejoint/>
<geom type="cylinder" size="0.03 0.03" mass="0.2"/><body name="lid" pos="0 0 0.04"><joint name="hinge" axis="1 0 0"/>
<geom type="box" size="0.03 0.03 0.005" mass="0.01"/></body></body></worldbody>
<keyframe><key name="shut" qpos="0 0 0 1 0 0 0 0"/></keyframe></mujoco>"""


def free(*props: Entity, height: float = 0.0) -> Physics:
    arena = Arena()
    for number, prop in enumerate(props):
        arena.add_free_entity(prop, position=(0.0, 0.0, height * number))
    return Physics.from_entity(arena)


def mass_and_inertia(vertices: Array, faces: Array, density: float) -> tuple[float, Array, Array]:
    """Mass [kg], centre [m] and inertia about the centre of a closed mesh: a sum over tetrahedra from the origin."""
    corners = vertices[faces]
    volumes = np.linalg.det(corners) / 6.0
    mass = density * volumes.sum()
    middle = corners.sum(axis=1) / 4.0
    centre = density * (volumes[:, None] * middle).sum(axis=0) / mass
    # The integral of x x^T over a tetrahedron with one corner in the origin is V / 20 (sum of outer products + s s^T).
    sums = corners.sum(axis=1)
    squares = np.einsum("nci,ncj->nij", corners, corners) + np.einsum("ni,nj->nij", sums, sums)
    second = density * (volumes[:, None, None] * squares).sum(axis=0) / 20.0 - mass * np.outer(centre, centre)
    return float(mass), centre, np.trace(second) * np.eye(3) - second


@pytest.mark.parametrize("handle", [False, True])
def test_a_mesh_weighs_what_it_encloses(handle: bool, tmp_path: Path) -> None:
    mug = Mesh(write_mug(tmp_path / "mug.obj", handle=handle), density=600.0, decomposed=False)
    body = free(mug).bind(mug.root_body)
    shape = make_mug(handle=handle)
    mass, centre, inertia = mass_and_inertia(np.array(shape.vertices), np.array(shape.faces), 600.0)
    if not handle:  # a prism of 48 sides, less another

        def area(radius: float) -> float:
            return SECTIONS / 2.0 * radius**2 * math.sin(2.0 * math.pi / SECTIONS)

        assert mass == pytest.approx(600.0 * (area(RADIUS) * HEIGHT - area(RADIUS - WALL) * (HEIGHT - WALL)), rel=1e-6)
    assert body.mass[0] == pytest.approx(mass, rel=1e-6)
    np.testing.assert_allclose(np.ravel(body.ipos), centre, atol=1e-7)
    rotation = np.empty(9)
    mujoco.mju_quat2Mat(rotation, np.ravel(body.iquat))
    axes = rotation.reshape(3, 3)
    found = axes @ np.diag(np.ravel(body.inertia)) @ axes.T
    np.testing.assert_allclose(found, inertia, rtol=1e-4, atol=1e-5 * inertia.max())


def test_mass_and_scale_are_taken(tmp_path: Path) -> None:
    file = write_mug(tmp_path / "mug.stl")
    mug, small = Mesh(file, mass=0.3, name="mug", decomposed=False), Mesh(file, scale=0.5, decomposed=False)
    assert free(mug).bind(mug.root_body).mass[0] == pytest.approx(0.3)
    assert free(small).bind(small.root_body).mass[0] == pytest.approx(1000.0 * make_mug().volume / 8.0, rel=1e-5)
    np.testing.assert_allclose(small.shape.vertices.max(axis=0), make_mug().bounds[1] / 2.0, atol=1e-8)
    assert (mug.name, small.name) == ("mug", "mug")


def test_mass_and_density_are_not_both_taken(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match="mass or density, not both"):
        Mesh(write_mug(tmp_path / "mug.obj"), mass=0.3, density=600.0)


def test_a_mesh_in_millimetres_is_refused_with_the_scale_it_needs(tmp_path: Path) -> None:
    file = tmp_path / "mug.obj"
    shape = make_mug()
    shape.vertices *= 1000.0
    shape.export(file)
    with pytest.raises(InvalidInputError, match=r"mesh is \d+ m long, .* millimetres needs scale=0\.001"):
        Mesh(file)
    mug = Mesh(file, scale=0.001, decomposed=False)
    np.testing.assert_allclose(np.ptp(mug.shape.vertices, axis=0), make_mug().extents, atol=1e-6)


def rest_height(mug: Mesh, drop: float) -> float:
    """Where the middle of a ball comes to rest that falls on the middle of a mug [m]."""
    ball = Primitive("sphere", (BALL,), mass=0.02, name="ball")
    physics = free(mug, ball, height=drop)
    physics.step(1000)
    assert np.abs(ball.get_velocity(physics)[0]).max() < 0.05
    np.testing.assert_allclose(mug.get_pose(physics)[0], 0.0, atol=2e-3)  # it stands
    return float(ball.get_pose(physics)[0][2])


@pytest.mark.slow
def test_what_falls_into_a_mug_stays_in_it(tmp_path: Path) -> None:
    mug = Mesh(write_mug(tmp_path / "mug.obj"), name="mug")
    assert mug.shape.method != "convex hull"
    assert len(mug.shape.parts) > 5
    # Parts fill edges of the inside a little: the bottom may lie higher.
    assert WALL + BALL - 1e-3 < rest_height(mug, 0.12) < WALL + BALL + 0.01


def test_a_hull_has_no_opening(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    file = write_mug(tmp_path / "mug.obj")
    assert rest_height(Mesh(file, decomposed=False), 0.12) == pytest.approx(HEIGHT + BALL, abs=1e-3)
    assert not caplog.records
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with caplog.at_level(logging.WARNING):
        assert Mesh(file, name="other", scale=1.01).shape.method == "convex hull"
    assert "pip install coacd" in caplog.text


def test_a_convex_mesh_is_one_part(tmp_path: Path) -> None:
    box = tmp_path / "box.obj"
    corners = [(x, y, z) for x in (0, 0.1) for y in (0, 0.2) for z in (0, 0.3)]
    faces = [(1, 3, 2), (2, 3, 4), (5, 6, 7), (6, 8, 7), (1, 2, 5), (2, 6, 5), (3, 7, 4)]
    faces += [(4, 7, 8), (1, 5, 3), (3, 5, 7), (2, 4, 6), (4, 8, 6)]
    lines = [*(f"v {x} {y} {z}" for x, y, z in corners), *(f"f {a} {b} {c}" for a, b, c in faces)]
    box.write_text("\n".join(lines))
    prop = Mesh(box)
    assert len(prop.shape.parts) == 1
    assert prop.height_above_lowest == pytest.approx(0.0, abs=1e-12)
    body = free(prop).bind(prop.root_body)
    assert body.mass[0] == pytest.approx(6.0)
    np.testing.assert_allclose(np.ravel(body.ipos), (0.05, 0.1, 0.15))


def test_an_open_mesh_weighs_as_its_parts(tmp_path: Path) -> None:
    shape = make_mug(handle=False)
    shape.update_faces(np.arange(len(shape.faces)) > 0)  # a hole
    shape.export(str(tmp_path / "open.obj"))
    prop = Mesh(tmp_path / "open.obj", mass=0.4, decomposed=False)
    assert not prop.shape.is_closed
    assert free(prop).bind(prop.root_body).mass[0] == pytest.approx(0.4, rel=1e-6)


def test_a_model_from_a_file_keeps_its_joints(tmp_path: Path) -> None:
    (tmp_path / "cup.xml").write_text(CUP)
    cup = ModelFile(tmp_path / "cup.xml")
    physics = free(cup)
    assert physics.model.nq == 8
    assert physics.model.joint("cup/hinge").type == mujoco.mjtJoint.mjJNT_HINGE
    assert physics.model.body_subtreemass[cup.root_body.id] == pytest.approx(0.21, rel=1e-3)
    corners = physics.bind(cup.vertices).xpos
    np.testing.assert_allclose(corners.max(axis=0), (0.03, 0.03, 0.075), atol=1e-12)
    np.testing.assert_allclose((corners.min(axis=0)[2], cup.height_above_lowest), (0.0, 0.0), atol=1e-12)
    cup.set_pose(physics, (0.1, 0.0, 0.2))
    np.testing.assert_allclose(physics.bind(cup.position).sensordata, (0.1, 0.0, 0.2), atol=1e-12)


@pytest.mark.parametrize("prop", [Primitive("sphere", (0.03,)), Primitive("cylinder", (0.02, 0.05)), Brick()])
def test_props_know_how_high_they_lie(prop: Primitive | Brick) -> None:
    physics = free(prop)
    prop.set_pose(physics, (0.0, 0.0, prop.height_above_lowest))
    physics.forward()
    assert physics.bind(prop.vertices).xpos[:, 2].min() == pytest.approx(0.0, abs=1e-9)


def test_copies_are_made_from_the_file(tmp_path: Path) -> None:
    mug = Mesh(write_mug(tmp_path / "mug.obj"), decomposed=False, friction=(0.7, 0.005, 0.0001))
    for other in (copy.deepcopy(mug), pickle.loads(pickle.dumps(mug))):
        part = free(other).bind(other.mjcf_model.geoms[1])
        np.testing.assert_allclose(part.friction, (0.7, 0.005, 0.0001))


def test_mistakes(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match=r"there is no file .*nothing\.obj"):
        Mesh(tmp_path / "nothing.obj")
    (tmp_path / "text.obj").write_text("no mesh")
    with pytest.raises(InvalidInputError, match="no mesh that can be read|has no volume"):
        Mesh(tmp_path / "text.obj")
    flat = tmp_path / "flat.obj"
    flat.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    with pytest.raises(InvalidInputError, match="flat.obj: the mesh has no volume$"):
        Mesh(flat)
    file = write_mug(tmp_path / "mug.obj")
    with pytest.raises(InvalidInputError, match="density must be"):
        Mesh(file, density=-1.0, decomposed=False)
    with pytest.raises(InvalidInputError, match="MuJoCo refuses the attributes") as refused:
        Mesh(file, decomposed=False, colour=3)
    assert len(str(refused.value)) < 200
    (tmp_path / "floor.xml").write_text('<mujoco><worldbody><geom type="plane" size="1 1 1"/></worldbody></mujoco>')
    with pytest.raises(InvalidInputError, match="holds a plane"):
        ModelFile(tmp_path / "floor.xml")
    (tmp_path / "empty.xml").write_text("<mujoco/>")
    with pytest.raises(InvalidInputError, match="nothing in 'empty' collides"):
        ModelFile(tmp_path / "empty.xml")
    (tmp_path / "broken.xml").write_text("<mujoco")
    with pytest.raises(ModelError, match="MuJoCo cannot read"):
        ModelFile(tmp_path / "broken.xml")


def test_a_mesh_has_the_unit_that_its_file_says(tmp_path: Path) -> None:
    file = tmp_path / "ball.dae"
    trimesh.creation.icosphere(subdivisions=1, radius=30.0).export(file)
    file.write_text(file.read_text().replace("<up_axis>", '<unit name="millimeter" meter="0.001"/><up_axis>'))
    ball = Mesh(file, decomposed=False)
    np.testing.assert_allclose(np.linalg.norm(ball.shape.vertices, axis=1), 0.03, atol=1e-6)
