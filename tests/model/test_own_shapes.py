"""The shapes of an arm are prepared once a robot, for all that look for contact, and are those that MuJoCo has."""

from __future__ import annotations

import pickle
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
import trimesh

import jacokin
from jacokin import IKSolver, Robot
from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, ShapeError
from jacokin.ik import closed_form
from jacokin.model import Box, Capsule, Cylinder, Floor, Obstacle, Scene, SelfContact, Sphere
from jacokin.model import own_shapes as own
from jacokin.model.contact import Contact
from jacokin.model.poses import pose
from tests.compiled_twin import TwinContact, compile_twin
from tests.robot_files import joint, ur5_text
from tests.threads import run_in_threads

WAYS_TO_ASK: dict[str, Callable[[Robot], object]] = {
    "home": lambda robot: robot.home,
    "solver": lambda robot: IKSolver(robot, collision="reject"),
    "tracker": lambda robot: jacokin.Tracker(robot, dt=0.01, collision="reject", velocity_limit=1.0),
    "plan": lambda robot: jacokin.plan_motion(
        IKSolver(robot), robot.home, robot.home, velocity_limit=1.0, acceleration_limit=1.0
    ),
    "clearance": lambda robot: robot.clearance(robot.home, Scene([Floor(-2.0)])),
    "contact": lambda robot: SelfContact(robot).touching(robot.home),
    "notes": lambda robot: robot.notes,
}


@pytest.fixture
def mesh_arm(tmp_path: Path) -> Path:
    """An arm of six joints whose links have meshes: a horseshoe each, which is not convex."""
    parts = [((0.12, 0.03, 0.03), (0.0, 0.0, 0.0)), ((0.03, 0.03, 0.1), (0.045, 0.0, 0.06))]
    parts += [((0.03, 0.03, 0.1), (-0.045, 0.0, 0.06))]
    boxes = [trimesh.creation.box(size).apply_translation(place) for size, place in parts]
    horseshoe: Any = trimesh.util.concatenate(boxes)
    horseshoe.export(tmp_path / "horseshoe.stl")
    path = tmp_path / "arm.urdf"
    path.write_text(ur5_text('<collision><geometry><mesh filename="horseshoe.stl"/></geometry></collision>'))
    return path


def test_whoever_looks_for_contact_shares_what_was_made_once(mesh_arm: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[str] = []

    def counted(module: Any, name: str) -> None:
        original = getattr(module, name)

        def call(*arguments: object, **named: object) -> object:
            made.append(name)
            return original(*arguments, **named)

        monkeypatch.setattr(module, name, call)

    counted(own, "shape_rows")
    counted(closed_form, "measure_general")
    robot = jacokin.load_robot(mesh_arm)
    for ask in WAYS_TO_ASK.values():
        ask(robot)
    assert made.count("shape_rows") == 1
    structures = made.count("measure_general")
    for ask in WAYS_TO_ASK.values():
        ask(robot)
    IKSolver(robot, tool=pose([0.0, 0.0, 0.1])).in_scene(Scene([Floor(-1.0)]))
    assert made.count("shape_rows") == 1
    assert made.count("measure_general") == structures + 1  # for the tool


def test_threads_that_ask_at_once_get_the_same(mesh_arm: Path) -> None:
    robot = jacokin.load_robot(mesh_arm)
    found: list[object] = []
    start = threading.Barrier(4)

    def ask(_: int) -> None:
        start.wait()
        found.append(own.own_shapes(robot))

    run_in_threads(ask, 4)
    assert len({id(each) for each in found}) == 1


@pytest.mark.slow
def test_a_pickled_robot_carries_its_shapes(mesh_arm: Path, rng: np.random.Generator) -> None:
    robot = jacokin.load_robot(mesh_arm)
    rows = robot.sample(rng, 200)
    before = [SelfContact(robot).touching(q) for q in rows]
    assert 10 < sum(map(bool, before)) < 190
    heavier = robot.with_payload(1.0, [0.0, 0.0, 0.1])
    (mesh_arm.parent / "horseshoe.stl").unlink()  # it is not read again
    for other in (pickle.loads(pickle.dumps(robot)), heavier, pickle.loads(pickle.dumps(IKSolver(robot))).robot):
        assert [SelfContact(other).touching(q) for q in rows] == before


def test_only_the_last_results_are_kept(robot: Robot) -> None:
    asked: list[float] = []

    def make(_: Robot, value: float) -> float:
        asked.append(value)
        return 2.0 * value

    for value in range(40):
        assert robot.once(make, float(value)) == 2.0 * value
    assert robot.once(make, 39.0) == 78.0
    assert len(asked) == 40
    robot.once(make, 0.0)
    assert len(asked) == 41


class Slab:
    """An obstacle that is none of the package's classes."""

    name = "slab"

    def add_to(self, body: mujoco.MjsBody) -> None:
        """Add an ellipsoid."""
        body.add_geom(name=self.name, type=mujoco.mjtGeom.mjGEOM_ELLIPSOID, size=[0.2, 0.1, 0.05], pos=[0.4, 0.4, 0.4])


def shape(number: int, rng: np.random.Generator) -> Obstacle:
    """A shape of one of four kinds near an arm."""
    direction = rng.normal(size=3)
    place = direction / np.linalg.norm(direction) * rng.uniform(0.45, 0.9)
    T, size, name = pose(place, rpy=rng.uniform(-3.0, 3.0, 3)), rng.uniform(0.02, 0.12, 3), f"shape {number}"
    if number % 4 == 0:
        return Box(name, size, T)
    if number % 4 == 1:
        return Sphere(name, size[0], place)
    return (Cylinder if number % 4 == 2 else Capsule)(name, size[0], size[1], T)


def scenes(rng: np.random.Generator, hand: str) -> dict[str, Scene]:
    """Scenes of every sort."""
    shapes = [shape(number, rng) for number in range(10)]
    plain = Scene([Floor(-0.4), *shapes])
    cup = Cylinder("cup", 0.03, 0.1, [0.0, 0.0, -0.25])
    return {
        "nothing": Scene(),
        "obstacles": plain,
        "another class": plain.adding(Slab()),
        "held": plain.attach(cup, to=hand).attach("shape 1", to=hand, pose=[0.0, 0.5, 0.0]),
        "allowed": Scene(
            plain.obstacles,
            allow=[("shape 0", hand), ("floor", "robot"), ("shape 2", "shape 3"), (hand, "robot")],
        ),
        "held and allowed": Scene(plain.obstacles, allow=[("shape 4", hand)])
        .attach(cup, to=hand)
        .allowing(("cup", "floor")),
    }


def compare(robot: Robot, scene: Scene, rows: Array) -> int:
    """How many configurations are in contact: those, and in the same pairs, that are by the twin."""
    ours, theirs = Contact(robot, scene.surroundings), TwinContact(robot, scene.surroundings)
    assert ours.pairs == len(compile_twin(robot, scene.surroundings).pairs)
    hits = 0
    for q in rows:
        found = ours.touching(q)
        assert {frozenset(pair) for pair in found} == theirs.touching(q)
        assert ours.touches(q) == bool(found)
        hits += bool(found)
    return hits


@pytest.mark.one_quick
@pytest.mark.parametrize("name", ["j2n6s300", "j2s7s300"])
@pytest.mark.parametrize("finger_angle", [None, 1.1])
def test_the_same_pairs_touch_as_by_the_twin(
    name: str, finger_angle: float | None, bundled: Callable[[str], Robot], rng: np.random.Generator
) -> None:
    robot = bundled(name)
    hits = {
        sort: compare(robot, scene.with_fingers(finger_angle), robot.sample(rng, 300))
        for sort, scene in scenes(rng, "hand").items()
    }
    assert min(hits.values()) > 3
    assert hits["nothing"] < 290


def test_the_same_pairs_touch_as_by_the_twin_on_meshes(mesh_arm: Path, rng: np.random.Generator) -> None:
    robot = jacokin.load_robot(mesh_arm)
    for scene in scenes(rng, "l6").values():
        assert 10 < compare(robot, scene, robot.sample(rng, 300)) <= 300


def test_a_name_of_the_arm_is_no_name_of_an_obstacle(robot: Robot) -> None:
    name = SelfContact(robot).names[3]
    for scene in (Scene([Box(name, [0.1, 0.1, 0.1], [5.0, 0.0, 0.0])]), Scene().attach(Sphere(name, 0.1, [0, 0, 0]))):
        with pytest.raises(InvalidInputError, match="names must differ"):
            scene.contact(robot)


def test_a_shape_beyond_all_measure_is_refused_where_contact_needs_it(tmp_path: Path) -> None:
    path = tmp_path / "arm.urdf"
    shape = '<collision name="ball"><origin xyz="0 0 -1e200"/><geometry><sphere radius="0.1"/></geometry></collision>'
    links = "".join(f'<link name="l{i}">{shape if i == 2 else ""}</link>' for i in range(4))
    joints = "".join(
        joint(f"j{i}", f"l{i}", f"l{i + 1}", (0.0, 0.0, 0.2), axis=(0, 1, 0) if i else (0, 0, 1), limits=(-2.0, 2.0))
        for i in range(3)
    )
    path.write_text(f'<robot name="arm">{links}{joints}</robot>')
    robot = jacokin.load_robot(path)
    assert robot.dof == 3
    assert any("contact cannot be looked for" in note for note in robot.notes)
    with pytest.raises(ShapeError, match=r"shape 'ball' is at \(0, 0, -1e\+200\) m of its joint"):
        IKSolver(robot, collision="reject").solve(robot.forward_kinematics(robot.home).translation)


def test_an_obstacle_that_mujoco_refuses_says_so(robot: Robot) -> None:
    class Nothing:
        name = "nothing"

        def add_to(self, body: mujoco.MjsBody) -> None:
            body.add_geom(name=self.name, type=mujoco.mjtGeom.mjGEOM_BOX, size=[-1.0, 0.0, 0.0])

    class Unnamed:
        name = "unnamed"

        def add_to(self, body: mujoco.MjsBody) -> None:
            body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.1, 0.1, 0.1])

    for shape_of_another_class in (Nothing(), Unnamed()):
        with pytest.raises(ShapeError, match=shape_of_another_class.name):
            Scene([shape_of_another_class]).contact(robot)


def test_a_floor_that_one_link_may_touch_counts_against_the_others(robot: Robot, rng: np.random.Generator) -> None:
    solid, partly = Scene([Floor(0.1)]), Scene([Floor(0.1)], allow=[("floor", "link_1")])
    everywhere, elsewhere = solid.contact(robot), partly.contact(robot)
    rows, hits = robot.sample(rng, 500), 0
    for q in rows:
        expected = {pair for pair in everywhere.touching(q) if not ("floor" in pair and pair[1].startswith("link_1"))}
        assert set(elsewhere.touching(q)) == expected
        hits += any("floor" in pair for pair in expected)
    assert hits > 100
    below = [(a, b) for a, b in zip(everywhere.nearest(rows), elsewhere.nearest(rows), strict=True) if a.pair == b.pair]
    assert len(below) > 100
    assert max(abs(a.distance - b.distance) for a, b in below) < 1e-7


def test_a_floor_among_the_shapes_of_the_base_has_no_end(tmp_path: Path, rng: np.random.Generator) -> None:
    """Contact with a plane, and with what stands beside it, is as MuJoCo finds it; spheres it takes exactly."""
    text = """<mujoco><compiler angle="radian"/><worldbody>
      <body name="ground"><geom name="plane" type="plane" size="1 1 1"/></body>
      <body name="table" pos="0.4 0 0.1"><geom name="top" type="box" size="0.2 0.3 0.02"/></body>
      <body name="stand" pos="0 0 0.3"><geom name="post" type="box" size="0.02 0.02 0.1" pos="0 0 -0.12"/>
        <body name="upper"><joint name="yaw" axis="0 0 1" range="-3 3"/><joint name="lift" axis="0 1 0" range="-2 2"/>
          <geom size="0.01" contype="0" conaffinity="0"/>
          <body name="fore" pos="0.3 0 0"><joint name="elbow" axis="0 1 0" range="-2 2"/>
            <geom name="tip" type="sphere" pos="0.25 0 0" size="0.03"/><geom name="bulge" type="sphere" size="0.05"/>
    </body></body></body></worldbody></mujoco>"""
    path = tmp_path / "arm.xml"
    path.write_text(text)
    robot, model = jacokin.load_robot(path, velocity_limit=1.0), mujoco.MjModel.from_xml_string(text)
    data, contact, seen = mujoco.MjData(model), SelfContact(robot), set[tuple[str, ...]]()
    for q in robot.sample(rng, 400):
        data.qpos[:] = q
        mujoco.mj_forward(model, data)
        touching = {tuple(sorted(model.geom(int(geom)).name for geom in pair)) for pair in data.contact.geom}
        assert {tuple(sorted(pair)) for pair in contact.touching(q)} == touching
        seen |= touching
    assert {("plane", "tip"), ("tip", "top"), ("bulge", "plane"), ("bulge", "top")} <= seen
