"""Contact, distances and motions on the collision shapes of a description, against MuJoCo, coal and dense sampling."""

from __future__ import annotations

import pickle
import xml.etree.ElementTree as ET
from collections.abc import Callable, Sequence
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
import pytest

import jacokin
from jacokin import Robot, pose
from jacokin.arrays import Array
from jacokin.errors import ShapeError
from jacokin.model import Scene, SelfContact
from jacokin.model.contact import Contact, self_contact
from jacokin.model.descriptions import mjcf
from jacokin.model.descriptions.shapes import PreparedShapes, prepare_shapes
from jacokin.model.mujoco_twin import to_mujoco, to_spec
from jacokin.model.obstacles import (
    Box,
    Capsule,
    Cylinder,
    Floor,
    Obstacle,
    Sphere,
    Surroundings,
)
from jacokin.model.own_shapes import kept_less, overlapping
from tests.coal_shapes import coal_shape, collision_pairs
from tests.near_neighbours import CLEARANCE, NEIGHBOURS, near_neighbours, of_neighbours_and_others, own_distances
from tests.robot_files import ur5_text, urdf_text
from tests.threads import run_in_threads

ROBOTS = ("j2n6s300", "j2n6s200", "j2s6s300", "j2s7s300")


def random_obstacles(seed: int, n: int = 8) -> list[Obstacle]:
    """A floor, and shapes of all kinds around the arm."""
    rng = np.random.default_rng(seed)
    found: list[Obstacle] = [Floor(-0.1 * (seed % 4))]
    for number in range(n):
        direction = rng.normal(size=3)
        place = direction / np.linalg.norm(direction) * rng.uniform(0.5, 1.1)
        T, size, name = pose(place, rpy=rng.uniform(-3.0, 3.0, 3)), rng.uniform(0.02, 0.2, 3), f"shape_{number}"
        found.append(
            (
                Box(name, size, T),
                Cylinder(name, size[0], 2.0 * size[1], T),
                Capsule(name, 0.5 * size[0], 2.0 * size[1], T),
                Sphere(name, size[0], place),
            )[number % 4]
        )
    return found


def touching_by_mujoco(
    robot: Robot, obstacles: Sequence[Obstacle], finger_angle: float | None
) -> Callable[[Array], list[tuple[str, str]]]:
    """Contact as MuJoCo's own pipeline finds it."""
    spec = to_spec(robot, geometry=True, finger_angle=finger_angle)
    moving = [geom.name for geom in spec.geoms if geom.parent.parent.name != "world"]
    for obstacle in obstacles:
        obstacle.add_to(spec.worldbody)
    for obstacle in obstacles:
        for name in moving:
            spec.add_pair(name=f"{obstacle.name}~{name}", geomname1=obstacle.name, geomname2=name)
    model = spec.compile()
    data = mujoco.MjData(model)

    def touching(q: Array) -> list[tuple[str, str]]:
        data.qpos[:] = q
        mujoco.mj_kinematics(model, data)
        mujoco.mj_collision(model, data)
        touched = data.contact.dist <= 0.0
        return sorted({(model.geom(int(a)).name, model.geom(int(b)).name) for a, b in data.contact.geom[touched]})

    return touching


class ByCoal:
    """Contact as coal finds it through Pinocchio."""

    def __init__(self, robot: Robot, obstacles: Sequence[Obstacle]) -> None:
        spec = to_spec(robot, geometry=True)
        for obstacle in obstacles:
            obstacle.add_to(spec.worldbody)
        model = spec.compile()
        self.geometry, self.robot = pin.GeometryModel(), robot.pin_model
        for geom in range(model.ngeom):
            joint = max((j + 1 for j in mjcf.joints_above(model, int(model.geom_bodyid[geom]))), default=0)
            placement = mjcf.placement(model.geom_quat[geom], model.geom_pos[geom])
            shape = coal_shape(model, geom)
            self.geometry.addGeometryObject(pin.GeometryObject(model.geom(geom).name, joint, placement, shape))
        for a, b in collision_pairs(model, obstacles):
            self.geometry.addCollisionPair(pin.CollisionPair(a, b))
        self.data, self.geometry_data = self.robot.createData(), self.geometry.createData()

    def touches(self, q: Array) -> bool:
        """Whether any pair does."""
        return bool(pin.computeCollisions(self.robot, self.data, self.geometry, self.geometry_data, q, True))


@pytest.mark.one_quick
@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize("finger_angle", [None, 1.2])
def test_the_same_pairs_touch_as_in_mujoco(
    name: str, finger_angle: float | None, bundled: Callable[[str], Robot], rng: np.random.Generator
) -> None:
    robot = bundled(name)
    obstacles = random_obstacles(len(name) + ord(name[-3]))
    ours, theirs = (
        Contact(robot, Surroundings(tuple(obstacles), finger_angle=finger_angle)),
        touching_by_mujoco(robot, obstacles, finger_angle),
    )
    hits = 0
    for q in robot.sample(rng, 200):
        assert ours.touching(q) == theirs(q)
        hits += ours.touches(q)
    assert 20 < hits < 200


def compare_with_coal(robot: Robot, seeds: Sequence[int], n: int) -> int:
    """Contact at configurations in several scenes; returns how often shapes touched."""
    hits = 0
    for seed in seeds:
        obstacles = random_obstacles(seed)
        ours, theirs = Contact(robot, Surroundings(tuple(obstacles))), ByCoal(robot, obstacles)
        rows = robot.sample(np.random.default_rng(seed), n)
        for q, distance in zip(rows, ours.distances(rows, self_collision=True).tolist(), strict=True):
            touches = ours.touches(q)
            assert touches == (distance <= 0.0)
            if abs(distance) > 1e-6:
                assert touches == theirs.touches(q)
            hits += touches
    return hits


def test_contact_is_what_coal_finds(robot: Robot) -> None:
    assert 100 < compare_with_coal(robot, [0, 1], 200) < 300


@pytest.mark.slow
def test_contact_is_what_coal_finds_among_more_obstacles(robot: Robot) -> None:
    assert compare_with_coal(robot, range(6), 1500) > 1500


def test_many_obstacles_are_found_in_their_tree(robot: Robot, rng: np.random.Generator) -> None:
    obstacles = [Sphere(f"ball_{i}", 0.01, place) for i, place in enumerate(rng.uniform(-0.9, 0.9, (400, 3)))]
    together, alone = (
        Contact(robot, Surroundings(tuple(obstacles))),
        [Contact(robot, Surroundings(tuple(obstacles[i::4]))) for i in range(4)],
    )
    for q in robot.sample(rng, 50):
        assert together.touching(q) == sorted({pair for some in alone for pair in some.touching(q)})
        rows = q[np.newaxis]
        assert together.distances(rows)[0] == min(some.distances(rows)[0] for some in alone)


def test_answers_do_not_depend_on_earlier_calls_or_threads(robot: Robot, rng: np.random.Generator) -> None:
    contact, rows = Contact(robot, Surroundings(tuple(random_obstacles(3)))), robot.sample(rng, 100)
    first = [contact.touches(q) for q in rows]
    assert [contact.touches(q) for q in rows[::-1]] == first[::-1]
    distances, found = contact.distances(rows), list[Array]()
    run_in_threads(lambda _: found.append(contact.distances(rows)), 4)
    for again in found:
        np.testing.assert_array_equal(again, distances)


def motions(robot: Robot, contact: Contact, rng: np.random.Generator, n: int) -> list[Array]:
    """Straight motions (2, dof) whose ends are free."""
    found: list[Array] = []
    while len(found) < n:
        start = robot.sample(rng)
        ends = np.array([start, start + rng.uniform(-2.0, 2.0, robot.dof) * rng.choice([0.2, 1.5])])
        if robot.within_limits(ends[1]) and not any(map(contact.touches, ends)):
            found.append(ends)
    return found


@pytest.mark.one_quick
@pytest.mark.parametrize("name", ["j2n6s300", "j2s7s300"])
def test_motions_are_certified_as_dense_sampling_finds_them(
    name: str, bundled: Callable[[str], Robot], rng: np.random.Generator
) -> None:
    robot = bundled(name)
    contact = Contact(robot, Surroundings(tuple(random_obstacles(0))))
    blocked, all_ends = 0, np.array(list(motions(robot, contact, rng, 60)))
    together = contact.are_in_the_way(all_ends[:, 0], all_ends[:, 1]).tolist()
    for ends, at_once in zip(all_ends, together, strict=True):
        share = np.linspace(0.0, 1.0, 2000)[:, np.newaxis]
        sampled = contact.distances(ends[0] + share * (ends[1] - ends[0]), self_collision=True)
        pair = contact.in_the_way(*ends)
        assert at_once == (pair is not None)
        assert pair is None or sampled.min() < 5e-3
        assert pair is not None or sampled.min() > 0.0
        (least,) = contact.nearest_between(ends, self_collision=True)
        # Sampling may miss what lies between its places, the search no more than 0.1 mm and 2 %.
        assert sampled.min() - 2e-3 < least.distance < sampled.min() + 1e-4 + 0.02 * abs(sampled.min())
        there = ends[0] + least.where * (ends[1] - ends[0])
        assert contact.distances(there[np.newaxis], self_collision=True)[0] == pytest.approx(least.distance, abs=1e-8)
        blocked += pair is not None
    assert 5 < blocked < 55


def test_a_sheet_thinner_than_any_step_is_in_the_way(robot: Robot) -> None:
    x, y, _ = robot.forward_kinematics(robot.home).translation
    azimuth = float(np.arctan2(y, x))
    place = pose([0.5 * np.cos(azimuth), 0.5 * np.sin(azimuth), 0.4], rpy=[0.0, 0.0, azimuth])
    contact = Contact(robot, Surroundings((Box("sheet", [0.6, 1e-5, 0.8], place),)))
    ends = np.array([robot.home, robot.home])
    ends[:, 0] += [-1.0, 1.0]
    assert not any(map(contact.touches, ends))
    pair = contact.in_the_way(*ends)
    assert pair is not None
    assert "sheet" in pair
    assert contact.nearest_between(ends)[0].distance <= 0.0


def test_own_urdf_shapes_are_checked_for_contact(tmp_path: Path, rng: np.random.Generator) -> None:
    path = tmp_path / "mine.urdf"
    path.write_text(urdf_text())
    mine, bundled = SelfContact(jacokin.load_robot(path, finger_angle=0.15)), SelfContact(jacokin.load_robot())
    hits = 0
    for q in jacokin.load_robot().sample(rng, 300):
        # A URDF cannot exclude pairs, so it may report more; never less.
        theirs = {frozenset(pair) for pair in bundled.touching(q)}
        assert theirs <= {frozenset(pair) for pair in mine.touching(q)}
        hits += bool(theirs)
    assert hits > 5
    own = jacokin.load_robot(path)
    assert mine.touching(own.home) == []


def ball_arm(tmp_path: Path, names: str = "", radius: float = 0.09) -> Path:
    """An arm with a ball at each joint [m]: those of the base and of the upper arm are as near whatever joints do."""
    path = tmp_path / "arm.urdf"
    path.write_text(ur5_text(f'<collision {names}><geometry><sphere radius="{radius}"/></geometry></collision>'))
    return path


@pytest.mark.one_quick
@pytest.mark.parametrize(("name", "clearance"), [("balls", 0.02), ("gen3_lite", 0.03), ("m1n6s200", 0.035)])
def test_shapes_that_are_near_everywhere_are_not_kept_apart(
    tmp_path: Path, rng: np.random.Generator, name: str, clearance: float
) -> None:
    robot = jacokin.load_robot(ball_arm(tmp_path, radius=0.076) if name == "balls" else name)
    near = robot.sample(rng, 150)
    distances = {pair: each for pair, each in own_distances(robot, near).items() if pair not in overlapping(robot)}
    kept_apart = {pair for pair, found in distances.items() if found.max() > clearance + 1e-3}
    assert len(kept_apart) < len(distances)  # the case is one
    contact = self_contact(robot).with_clearance(clearance)
    clear = 0
    for index, q in enumerate(near):
        least = min(distances[pair][index] for pair in kept_apart)
        if abs(least - clearance) > 1e-5:  # [m] rounding of two engines
            assert contact.touches(q) == (least < clearance)
            clear += least > clearance
    assert clear > 50
    assert self_contact(robot).pairs == len(distances)  # without a clearance all count
    for scene in (
        Scene([Sphere("moon", 0.1, [5.0, 0.0, 0.0])]),
        Scene().attach(Sphere("ball", 0.01, [0.0, 0.0, 0.3]), to=robot.default_frame),
    ):
        among = scene.contact(robot)
        assert among.pairs - among.with_clearance(clearance).pairs == len(distances) - contact.pairs > 0


def test_links_that_are_near_everywhere_by_turns_of_their_parts_are_not_kept_apart(
    tmp_path: Path, rng: np.random.Generator
) -> None:
    ball = '<collision><origin xyz="{} {} 0"/><geometry><sphere radius="0.03"/></geometry></collision>'
    path = tmp_path / "arm.urdf"
    path.write_text(ur5_text("".join(ball.format(x, y) for x, y in ((0.05, 0), (-0.05, 0), (0, 0.05), (0, -0.05)))))
    robot = jacokin.load_robot(path)
    rows = robot.sample(rng, 150)
    distances = own_distances(robot, rows)
    inner = {pair for pair in distances if {name.split("#")[0] for name in pair} == {"l0", "l2"}}
    assert len(inner) == 16
    near = np.array([distances[pair] for pair in inner])
    assert 0.03 < near.min(axis=0).min() < near.min(axis=0).max() < 0.05 < near.max(axis=1).min()
    wrist = {pair for pair in distances if {name.split("#")[0] for name in pair} == {"l4", "l6"}}
    least = np.min([distances[pair] for pair in wrist], axis=0)  # these touch somewhere
    assert (least < 0.05).mean() > 0.85
    assert (least < 0.0).any()
    (kept,) = {kept_less(robot, None, 0.05)[pair] for pair in wrist}
    assert 0.05 * np.median(least) < kept < 0.2 * np.median(least)
    contact = self_contact(robot).with_clearance(0.05)
    for index, q in enumerate(rows):
        others = min(distances[pair][index] for pair in distances.keys() - inner - wrist)
        if min(abs(others - 0.05), abs(least[index] - kept)) > 1e-5:  # [m] rounding of two engines
            assert contact.touches(q) == (others < 0.05 or least[index] < kept)


@pytest.fixture(scope="module")
def neighbours(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    return near_neighbours(tmp_path_factory.mktemp("arm"))


def test_neighbours_that_are_nearly_always_near_keep_a_tenth_of_their_usual_distance(
    neighbours: Robot, rng: np.random.Generator
) -> None:
    rows = neighbours.sample(rng, 2000)
    away, others = of_neighbours_and_others(neighbours, rows)
    assert away.max() < CLEARANCE + 1e-3
    assert 0.1 < (away < 0.0).mean() < 0.4  # it touches here and there
    assert 0.01 < (others < CLEARANCE).mean() < 0.5
    kept = kept_less(neighbours, None, CLEARANCE)
    assert kept.keys() == {NEIGHBOURS}
    length = kept[NEIGHBOURS]
    assert length == pytest.approx(0.1 * np.median(away), rel=0.2)
    contact = self_contact(neighbours).with_clearance(CLEARANCE)
    certain = np.minimum(np.abs(others - CLEARANCE), np.abs(away - length)) > 1e-5  # [m] rounding of two engines
    touching = (others < CLEARANCE) | (away < length)
    np.testing.assert_array_equal(contact.touches_at(rows)[certain], touching[certain])
    for q, is_touching in zip(rows[certain][:200], touching[certain], strict=False):
        assert contact.touches(q) == is_touching
        pairs = {frozenset(pair) for pair in contact.all_touching(q)}
        assert bool(pairs) == is_touching
    # What is measured is how far they are apart, whatever they keep.
    found = contact.distances(rows, self_collision=True)
    np.testing.assert_allclose(np.clip(found, 0.0, 0.1), np.clip(np.minimum(away, others), 0.0, None), atol=1e-5)
    for nearest, least in zip(contact.nearest(rows[:50], self_collision=True), found, strict=False):
        assert nearest.distance == least
    assert f"l4#2 and l6#3 ({length:.2g} m)" in contact.keeping_less
    assert not self_contact(neighbours).keeping_less
    for again in (contact.with_clearance(0.0).with_clearance(CLEARANCE), pickle.loads(pickle.dumps(contact))):
        np.testing.assert_array_equal(again.touches_at(rows), contact.touches_at(rows))


def test_motions_of_such_neighbours_are_certified_at_what_they_keep(
    neighbours: Robot, rng: np.random.Generator
) -> None:
    contact = self_contact(neighbours).with_clearance(CLEARANCE)
    length = kept_less(neighbours, None, CLEARANCE)[NEIGHBOURS]
    shares, clear, refused = np.linspace(0.0, 1.0, 60)[:, None], 0, set[frozenset[str]]()
    for start, end in zip(neighbours.sample(rng, 60), neighbours.sample(rng, 60), strict=True):
        end = start + 0.4 * (end - start)
        away, others = of_neighbours_and_others(neighbours, start + shares * (end - start))
        pair = contact.in_the_way(start, end)
        assert contact.are_in_the_way(start[None], end[None])[0] == (pair is not None)
        if pair is None:
            clear += 1
            assert away.min() > length - 1e-6
            assert others.min() > CLEARANCE - 1e-6
        else:
            refused.add(frozenset(pair))
            step = 0.01 * np.abs(end - start).sum()  # [m] between two of the samples, at most
            assert away.min() < length + step or others.min() < CLEARANCE + step
    assert clear > 10
    assert NEIGHBOURS in refused


def test_what_only_seems_to_be_near_everywhere_counts_where_it_touches(
    tmp_path: Path, rng: np.random.Generator
) -> None:
    robot = jacokin.load_robot(ball_arm(tmp_path, radius=0.076))
    wide = self_contact(robot).with_clearance(0.5)  # [m] all that is on an arm of a metre is nearer
    rows = robot.sample(rng, 150)
    touching = {pair for pair, found in own_distances(robot, rows).items() if found.min() < 0.0}
    assert touching
    for q in rows:
        assert {frozenset(pair) for pair in self_contact(robot).touching(q)} <= {
            frozenset(pair) for pair in wide.touching(q)
        }


def test_shapes_that_overlap_everywhere_are_no_contact_and_are_said(tmp_path: Path, rng: np.random.Generator) -> None:
    robot = jacokin.load_robot(ball_arm(tmp_path))
    model = to_mujoco(robot, geometry=True)
    data = mujoco.MjData(model)
    both = zip(model.pair_geom1.tolist(), model.pair_geom2.tolist(), strict=True)
    always = {frozenset((model.geom(a).name, model.geom(b).name)) for a, b in both}
    contact = SelfContact(robot)
    for q in robot.sample(rng, 300):
        data.qpos[:] = q
        mujoco.mj_kinematics(model, data)
        mujoco.mj_collision(model, data)
        touching = {frozenset(model.geom(int(geom)).name for geom in pair) for pair in data.contact.geom}
        always &= touching
        assert {frozenset(pair) for pair in contact.touching(q)} == touching - overlapping(robot)
    assert overlapping(robot) == always
    assert len(always) == 2
    assert contact.pairs == 15 - len(always)
    assert contact.touching(robot.home) == []
    notes = [note for note in robot.notes if "touch in every configuration" in note]
    assert len(notes) == 1
    for pair in always:
        assert all(name in notes[0] for name in pair)
    assert jacokin.IKSolver(robot, collision="reject").solve(robot.forward_kinematics(robot.home)).success
    # With an obstacle around, and with contact that is allowed, the same pairs are left out.
    around = Scene([Box("wall", [0.1, 0.1, 0.1], [5.0, 0.0, 0.0])], allow=[("wall", "l6")])
    assert around.contact(robot).touching(robot.home) == []
    assert robot.clearance(robot.home, Scene(), self_collision=True) > 0.0


def test_names_that_shapes_share_are_no_message_of_mujoco(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    robot = jacokin.load_robot(ball_arm(tmp_path, 'name="ball"'))
    assert robot.clearance(robot.home, Scene([Box("wall", [0.1, 0.1, 0.1], [5.0, 0.0, 0.0])])) > 1.0
    assert len(set(Scene().contact(robot).names)) == 7
    assert jacokin.crosscheck(robot, samples=3).within()
    assert capfd.readouterr() == ("", "")


def test_the_shapes_of_a_robot_are_read_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    read: list[object] = []

    def counted(tree: ET.Element, path: Path, package_dirs: Sequence[Path]) -> PreparedShapes:
        read.append(path)
        return prepare_shapes(tree, path, package_dirs)

    monkeypatch.setattr("jacokin.model.mujoco_twin.prepare_shapes", counted)
    robot = jacokin.load_robot(ball_arm(tmp_path))
    for _ in range(2):
        assert robot.home.shape == (6,)
        assert robot.notes
        jacokin.IKSolver(robot, collision="reject")
        robot.clearance(robot.home, Scene([Box("wall", [0.1, 0.1, 0.1], [5.0, 0.0, 0.0])]))
    assert len(read) == 1


def test_nothing_is_planned_without_looking_where_shapes_cannot_be_loaded(tmp_path: Path) -> None:
    from jacokin.calibration import plan_measurements
    from jacokin.reachability import Grid, build

    path = tmp_path / "arm.urdf"
    path.write_text(ur5_text('<collision><geometry><mesh filename="package://arm/a.stl"/></geometry></collision>'))
    robot = jacokin.load_robot(path)
    assert "contact was not checked" in robot.home_source
    solver = jacokin.IKSolver(robot)
    T = robot.forward_kinematics([0.1, -1.0, 1.2, 0.3, 0.5, 0.2])
    up = T.copy()
    up.translation[2] += 0.02
    grid = Grid([-0.1] * 3, [0.1] * 3, 0.1)
    asked: tuple[Callable[[], object], ...] = (
        lambda: jacokin.plan_path(solver, [T, up], dt=0.05),
        lambda: build(robot, grid=grid, orientations=2, folder=tmp_path / "map"),
        lambda: plan_measurements(robot, n=10),
    )
    for ask in asked:
        with pytest.raises(ShapeError, match=r"'package://arm/a.stl' is not found.* with package_dirs="):
            ask()
    unchecked = jacokin.IKSolver(robot, collision="ignore")
    assert jacokin.plan_path(unchecked, [T, up], dt=0.05).success
