"""Convex parts hold the whole mesh, and little else; contact on them is that of the triangles."""

from __future__ import annotations

import pickle
import shutil
from pathlib import Path
from typing import Any

import coal
import numpy as np
import pinocchio as pin
import pytest
import trimesh
from scipy.spatial import ConvexHull

import jacokin
from jacokin import Robot
from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.model import Box, Scene, SelfContact, Sphere
from jacokin.model.contact import Contact
from jacokin.model.descriptions.convex_parts import MOST_PARTS, convex_parts
from jacokin.model.descriptions.meshes import TriangleMesh
from jacokin.model.robot import fingerprint
from tests.robot_files import UR5_JOINTS, ur5_text


def joined(*meshes: Any) -> Any:
    return trimesh.util.concatenate(meshes)


def block(size: tuple[float, float, float], place: tuple[float, float, float]) -> Any:
    return trimesh.creation.box(size).apply_translation(place)


def bent_tube() -> Any:
    """A third of a torus, closed."""
    along, around = np.meshgrid(np.linspace(0.0, 2.0, 25), np.arange(24) * np.pi / 12, indexing="ij")
    out = 0.1 + 0.02 * np.cos(around)
    rings = np.stack([out * np.cos(along), out * np.sin(along), 0.02 * np.sin(around)], axis=-1)
    number = np.arange(25 * 24).reshape(25, 24)
    a, b, c, d = number[:-1], np.roll(number[:-1], -1, 1), number[1:], np.roll(number[1:], -1, 1)
    sides = np.concatenate([np.stack(each, axis=-1).reshape(-1, 3) for each in ((a, c, b), (b, c, d))])
    lids = [(number[0, 0], number[0, k], number[0, k + 1]) for k in range(1, 23)]
    lids += [(number[-1, 0], number[-1, k + 1], number[-1, k]) for k in range(1, 23)]
    return trimesh.Trimesh(rings.reshape(-1, 3), np.concatenate([sides, lids]))


HORSESHOE = joined(
    block((0.12, 0.03, 0.03), (0.0, 0.0, 0.0)),
    block((0.03, 0.03, 0.1), (0.045, 0.0, 0.06)),
    block((0.03, 0.03, 0.1), (-0.045, 0.0, 0.06)),
)
TURN = pin.SE3(pin.rpy.rpyToMatrix(0.3, 0.6, 0.9), np.zeros(3)).homogeneous
SCALE = 1.5  # of the horseshoes of an arm
MESHES: dict[str, Any] = {
    "box": block((0.1, 0.2, 0.3), (0.3, 0.2, 0.1)),
    "ball": trimesh.creation.icosphere(subdivisions=3, radius=0.1),
    "horseshoe": HORSESHOE,
    "turned horseshoe": HORSESHOE.copy().apply_transform(TURN),
    "ring": trimesh.creation.annulus(r_min=0.08, r_max=0.1, height=0.03),
    "bent tube": bent_tube(),
    "two": joined(block((0.02, 0.02, 0.02), (0.0, 0.0, 0.0)), block((0.02, 0.02, 0.02), (0.1, 0.1, 0.1))),
}
# Volume of the parts by that of the mesh, at most.
SHARE = {
    "box": 1.001,
    "ball": 1.001,
    "horseshoe": 1.02,
    "turned horseshoe": 1.6,
    "ring": 1.3,
    "bent tube": 1.25,
    "two": 1.1,
}


def mesh_of(shape: Any) -> TriangleMesh:
    return TriangleMesh(np.array(shape.vertices), np.array(shape.faces, dtype=np.int64))


def outside(points: Array, part: Array) -> Array:
    """How far points (n, 3) stick out of the hull of others [m]."""
    equations = ConvexHull(part).equations
    return np.asarray((points @ equations[:, :3].T + equations[:, 3]).max(axis=1))


@pytest.mark.one_quick
@pytest.mark.parametrize("name", MESHES)
def test_parts_hold_the_surface_and_the_inside(name: str, rng: np.random.Generator) -> None:
    shape = MESHES[name]
    parts = convex_parts(mesh_of(shape))
    surface = np.asarray(trimesh.sample.sample_surface(shape, 5000, seed=1)[0])
    low, high = shape.bounds
    anywhere = rng.uniform(low, high, (1000, 3))
    inside = anywhere[shape.contains(anywhere)]
    for points, slack in ((surface, 1e-9), (inside, 1e-9)):
        assert np.min([outside(points, part) for part in parts], axis=0).max() < slack
    hull = ConvexHull(shape.vertices).volume
    volume = sum(ConvexHull(part).volume for part in parts)
    assert volume < max(SHARE[name] * abs(shape.volume), 0.0) + 0.01 * hull
    assert len(parts) <= MOST_PARTS
    if name in ("box", "ball"):
        assert len(parts) == 1


def test_a_flat_mesh_and_an_open_one_are_held_too(rng: np.random.Generator) -> None:
    sheet = TriangleMesh(np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]), np.array([[0, 1, 2], [0, 2, 3]]))
    (part,) = convex_parts(sheet)
    assert outside(rng.uniform((0, 0, 0), (1, 1, 0), (100, 3)), part).max() < 1e-9
    shell = MESHES["horseshoe"].copy()
    shell.update_faces(np.arange(len(shell.faces)) % 7 > 0)
    points = np.asarray(trimesh.sample.sample_surface(shell, 2000, seed=1)[0])
    parts = convex_parts(mesh_of(shell))
    assert np.min([outside(points, part) for part in parts], axis=0).max() < 1e-9
    assert convex_parts(TriangleMesh(np.zeros((3, 3)), np.array([[0, 1, 2]]))) == []


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A UR5 of horseshoes, each other link of a bent tube."""
    folder = tmp_path_factory.mktemp("arm")
    HORSESHOE.copy().apply_scale(SCALE).export(folder / "horseshoe.stl")
    bent_tube().export(folder / "tube.obj")
    path, text = (
        folder / "arm.urdf",
        ur5_text('<collision><geometry><mesh filename="horseshoe.stl"/></geometry></collision>'),
    )
    for link in (1, 3, 5):
        start = text.index(f'<link name="l{link}">')
        text = text[:start] + text[start:].replace('"horseshoe.stl"', '"tube.obj" scale="1 1 1"', 1)
    path.write_text(text)
    return path


@pytest.fixture(scope="module")
def in_parts(arm: Path) -> Robot:
    """The same with its meshes decomposed, which takes a second, once."""
    return jacokin.load_robot(arm, decompose=True)


class Triangles:
    """The arm's meshes in coal, triangle by triangle."""

    def __init__(self, robot: Robot, folder: Path) -> None:
        self._robot, self._data = robot.pin_model, robot.pin_model.createData()
        self._shapes = []
        for link in range(7):
            shape = HORSESHOE.copy().apply_scale(SCALE) if link % 2 == 0 else bent_tube()
            triangles = coal.BVHModelOBBRSS()
            triangles.beginModel(len(shape.faces), len(shape.vertices))
            triangles.addVertices(np.array(shape.vertices))
            triangles.addTriangles(np.array(shape.faces, dtype=np.int64))
            triangles.endModel()
            self._shapes.append(triangles)

    def touches(self, q: Array) -> bool:
        """Whether links that do not follow each other do."""
        pin.forwardKinematics(self._robot, self._data, q)
        places = [coal.Transform3s(place.rotation, place.translation) for place in self._data.oMi]
        request = coal.CollisionRequest()
        return any(
            coal.collide(self._shapes[a], places[a], self._shapes[b], places[b], request, coal.CollisionResult())
            for a in range(7)
            for b in range(a + 2, 7)
        )


@pytest.mark.slow
def test_contact_on_parts_is_that_of_the_triangles(arm: Path, in_parts: Robot, rng: np.random.Generator) -> None:
    hulls, parts = jacokin.load_robot(arm), in_parts
    truth, rows = Triangles(hulls, arm.parent), hulls.sample(rng, 400)
    real = np.array([truth.touches(q) for q in rows])
    by_hulls, by_parts = (SelfContact(robot).touches_at(rows) for robot in (hulls, parts))
    assert 40 < real.sum() < 300
    assert not (real & ~by_hulls).any()
    assert not (real & ~by_parts).any()
    assert (by_hulls & ~real).mean() > 0.04
    assert (by_parts & ~real).mean() <= 0.02


def test_parts_have_names_that_links_stand_for(in_parts: Robot) -> None:
    robot, contact = in_parts, SelfContact(in_parts)
    assert any(name.endswith(", part 2") for name in contact.arm_shapes)
    T = robot.forward_kinematics(robot.home).homogeneous
    around = Box("around the tool", [0.5, 0.5, 0.5], T)
    touched = {name for pair in Scene([around]).contact(robot).touching(robot.home) for name in pair}
    allowed = Scene([around], allow=[("around the tool", link) for link in ("l3", "l4", "l5", "l6")])
    left = {name for pair in allowed.contact(robot).touching(robot.home) for name in pair}
    assert any(name.startswith("l6") for name in touched)
    assert not any(name.startswith(("l3", "l4", "l5", "l6")) for name in left)
    assert jacokin.model.to_mujoco(robot, geometry=True).ngeom == len(contact.arm_shapes)


@pytest.mark.slow
def test_what_was_decomposed_is_kept_and_pickled(arm: Path, tmp_path: Path, rng: np.random.Generator) -> None:
    folder = Path(shutil.copytree(arm.parent, tmp_path / "copy"))
    robot = jacokin.load_robot(folder / arm.name, decompose=True)
    rows = robot.sample(rng, 100)
    before = SelfContact(robot).touches_at(rows)
    for name in ("horseshoe.stl", "tube.obj"):
        (folder / name).unlink()
    again = pickle.loads(pickle.dumps(robot))
    np.testing.assert_array_equal(SelfContact(again).touches_at(rows), before)
    assert again.source.decompose
    assert again.with_payload(1.0, [0.0, 0.0, 0.1]).source.decompose


@pytest.mark.slow
def test_meshes_of_an_mjcf_are_decomposed_alike(tmp_path: Path, rng: np.random.Generator) -> None:
    HORSESHOE.copy().apply_scale(SCALE).export(tmp_path / "horseshoe.stl")
    bodies, ends = "", ""
    for number, (xyz, rpy, axis) in enumerate(UR5_JOINTS):
        geom = '<geom type="mesh" mesh="horseshoe"/>'
        bodies += f'<body name="l{number + 1}" pos="{xyz}" euler="{rpy}"><joint name="q{number}" axis="{axis}" '
        bodies += f'range="-6.283 6.283" limited="true"/>{geom}'
        ends += "</body>"
    mjcf = tmp_path / "arm.xml"
    mjcf.write_text(
        '<mujoco><compiler angle="radian" eulerseq="XYZ"/><asset><mesh file="horseshoe.stl"/></asset><worldbody>'
        f'<body name="l0"><geom type="mesh" mesh="horseshoe"/>{bodies}{ends}</body></worldbody></mujoco>'
    )
    urdf = tmp_path / "arm.urdf"
    urdf.write_text(ur5_text('<collision><geometry><mesh filename="horseshoe.stl"/></geometry></collision>'))
    one, other = (Contact(jacokin.load_robot(path, decompose=True)) for path in (mjcf, urdf))
    rows = rng.uniform(-3.0, 3.0, (500, 6))
    assert len(one.arm_shapes) > 14
    assert (one.touches_at(rows) == other.touches_at(rows)).mean() > 0.98
    assert (one.touches_at(rows) < Contact(jacokin.load_robot(mjcf)).touches_at(rows)).mean() > 0.04
    assert any("convex hulls" in note for note in jacokin.load_robot(mjcf).notes)
    assert not any("convex hulls" in note for note in jacokin.load_robot(urdf, decompose=True).notes)


def test_an_obstacle_fits_into_the_gap_of_a_part(arm: Path, in_parts: Robot) -> None:
    """A ball between the legs of the last link's horseshoe."""
    for robot, clear in ((jacokin.load_robot(arm), False), (in_parts, True)):
        T = robot.forward_kinematics(robot.home)
        ball = Scene([Sphere("ball", 0.02, T.act(np.array([0.0, 0.0, 0.1])))])
        touching = [pair for pair in ball.contact(robot).touching(robot.home) if pair[1].startswith("l6")]
        assert (not touching) == clear


def test_decompose_is_yes_or_no(arm: Path, in_parts: Robot) -> None:
    with pytest.raises(InvalidInputError, match="decompose"):
        jacokin.load_robot(arm, decompose="yes")  # type: ignore[arg-type]
    assert fingerprint(jacokin.load_robot(arm), shapes=True) != fingerprint(in_parts, shapes=True)
