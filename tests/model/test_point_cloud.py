"""Clouds of points as obstacles: against spheres and brute force, in every place that looks for contact, and files."""

from __future__ import annotations

import itertools
import pickle
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial import cKDTree

import jacokin
from benchmarks.smooth import jolts
from jacokin import IKSolver, Robot, Status, Tracker
from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, ModelError, UnknownNameError
from jacokin.ik import Box, Floor, PointCloud, Scene, Sphere
from jacokin.model import depth_points
from jacokin.model.descriptions.meshes import hull_of, stl_bytes
from jacokin.model.descriptions.shapes import Shape
from jacokin.model.own_shapes import own_shapes
from jacokin.motion import plan_motion
from jacokin.reachability import Grid, build
from jacokin.reachability.pictures import outline_scene

RADIUS = 0.02  # [m]


def wall(rng: np.random.Generator, count: int) -> Array:
    """Points (n, 3) on a wall that the arm can reach [m]."""
    return np.column_stack([np.full(count, 0.35), rng.uniform(-0.6, 0.1, count), rng.uniform(-0.1, 0.8, count)])


def signed_distances(shape: Shape, points: Array) -> Array:
    """Distances (n,) of points in a shape's own frame to its surface, negative inside [m]."""
    x, y, z = points.T
    if shape.kind == "sphere":
        return np.asarray(np.linalg.norm(points, axis=1) - shape.size[0])
    if shape.kind == "capsule":
        along = np.clip(z, -shape.size[1], shape.size[1])
        return np.asarray(np.sqrt(x**2 + y**2 + (z - along) ** 2) - shape.size[0])
    if shape.kind == "cylinder":
        beyond = np.column_stack([np.hypot(x, y) - shape.size[0], np.abs(z) - shape.size[1]])
    else:
        assert shape.kind == "box"
        beyond = np.abs(points) - shape.size
    outside = np.linalg.norm(np.maximum(beyond, 0.0), axis=1)
    return np.asarray(np.where(beyond.max(axis=1) > 0.0, outside, beyond.max(axis=1)))


def by_hand(robot: Robot, q: Array, points: Array, *, moving: bool = True) -> Array:
    """Distances (n,) of points in the base to the nearest shape of the arm that moves, or to any [m]."""
    data = robot.pin_model.createData()
    pin.forwardKinematics(robot.pin_model, data, q)
    found = np.full(len(points), np.inf)
    for shape in own_shapes(robot).shapes:
        if shape.joint or not moving:
            place = data.oMi[shape.joint] * shape.placement
            there = (points - place.translation) @ place.rotation
            found = np.minimum(found, signed_distances(shape, there))
    return found


@pytest.mark.one_quick
@pytest.mark.parametrize("name", ["j2n6s300", "gen3", "j2s7s300"])
@pytest.mark.parametrize("spread", [0.1, 0.5])
def test_distances_are_those_of_brute_force(name: str, spread: float, rng: np.random.Generator) -> None:
    robot = jacokin.load_robot(name)
    points = rng.normal(size=(400, 3)) * spread + [0.3, 0.0, 0.5]
    pose = pin.SE3(pin.exp3(np.array([0.3, -0.2, 1.0])), np.array([0.1, 0.2, 0.0]))
    scene = Scene([PointCloud("cloud", (points - pose.translation) @ pose.rotation, RADIUS, pose)])
    rows = robot.sample(rng, 20)
    theirs = np.array([by_hand(robot, q, points).min() for q in rows]) - RADIUS
    np.testing.assert_allclose(robot.clearance(rows, scene), theirs, atol=1e-9)
    contact = scene.contact(robot)
    hits = [any("cloud" in pair for pair in contact.touching(q)) for q in rows]
    np.testing.assert_array_equal(hits, theirs <= 0.0)
    assert spread > 0.3 or 1 < sum(hits) < 20


def test_spheres_one_by_one_are_the_same(robot: Robot, rng: np.random.Generator) -> None:
    """Contact, motions and what is in the way."""
    points = rng.uniform(-0.8, 0.8, (60, 3))
    cloud = Scene([PointCloud("cloud", points, RADIUS)]).contact(robot)
    spheres = Scene([Sphere(f"ball_{k}", RADIUS, point) for k, point in enumerate(points)]).contact(robot)
    rows = robot.sample(rng, 120)
    np.testing.assert_array_equal(cloud.touches_at(rows), spheres.touches_at(rows))
    clear = 0
    for start, end in itertools.pairwise(rows):
        answers = [contact.in_the_way(start, start + 0.2 * (end - start)) is None for contact in (cloud, spheres)]
        assert answers[0] == answers[1]
        clear += answers[0]
    assert 20 < clear < 110
    near = rows[:12]
    for ours, theirs in zip(cloud.nearest_between(near), spheres.nearest_between(near), strict=True):
        assert ours.distance == pytest.approx(theirs.distance, abs=2e-4 + 0.04 * abs(theirs.distance))


def test_contact_with_a_cloud_may_be_allowed(robot: Robot, rng: np.random.Generator) -> None:
    points = rng.uniform(-0.6, 0.6, (60, 3))
    balls = [Sphere(f"ball_{k}", RADIUS, point) for k, point in enumerate(points)]
    cloud = Scene([PointCloud("cloud", points, RADIUS)], allow=[("hand", "cloud")])
    spheres = Scene(balls, allow=[("hand", ball.name) for ball in balls])
    rows = robot.sample(rng, 60)
    np.testing.assert_allclose(robot.clearance(rows, cloud), robot.clearance(rows, spheres), atol=2e-7)
    found = cloud.contact(robot).touches_at(rows)
    np.testing.assert_array_equal(found, spheres.contact(robot).touches_at(rows))
    assert found.sum() < Scene(balls).contact(robot).touches_at(rows).sum()


def test_two_clouds_a_mesh_and_a_held_box_stand_in_one_scene(rng: np.random.Generator) -> None:
    """Each keeps its own part of the arrays."""
    robot = jacokin.load_robot("j2n6s300")
    first, second = rng.uniform(-0.7, 0.7, (2, 50, 3))
    box = Box("box", [0.05, 0.05, 0.2], [0.0, 0.0, 0.1])
    clouds = Scene([PointCloud("first", first, RADIUS), Floor(-0.4), PointCloud("second", second, 2.0 * RADIUS)])
    balls = [Sphere(f"ball_{k}", RADIUS, point) for k, point in enumerate(first)]
    balls += [Sphere(f"other_{k}", 2.0 * RADIUS, point) for k, point in enumerate(second)]
    rows = robot.sample(rng, 40)
    for scene in (clouds, clouds.attach(box, pose=[0.0, 0.0, -0.1]), clouds.allowing(("first", "hand"))):
        around = Scene([*balls, Floor(-0.4)])
        if scene.attached:
            around = around.attach(box, pose=[0.0, 0.0, -0.1])
        if scene.allow:
            around = around.allowing(*((f"ball_{k}", "hand") for k in range(len(first))))
        np.testing.assert_allclose(robot.clearance(rows, scene), robot.clearance(rows, around), atol=2e-7)


def test_a_cloud_is_moved_without_its_points(robot: Robot, rng: np.random.Generator) -> None:
    cloud = PointCloud("cloud", rng.uniform(-0.5, 0.5, (100, 3)), RADIUS)
    pose = jacokin.pose([0.2, 0.1, 0.3], rpy=[0.1, 0.2, 0.3])
    moved = Scene([cloud]).moving({"cloud": pose})
    (there,) = moved.obstacles
    assert isinstance(there, PointCloud)
    assert there.points is cloud.points
    anew = PointCloud("cloud", (np.asarray(cloud.points) @ pose.rotation.T) + pose.translation, RADIUS)
    rows = robot.sample(rng, 20)
    np.testing.assert_allclose(robot.clearance(rows, moved), robot.clearance(rows, Scene([anew])), atol=1e-9)
    np.testing.assert_allclose(np.sort(there.some_points(10**6), axis=0), np.sort(np.asarray(anew.points), axis=0))


def test_it_is_pickled_with_its_scene(robot: Robot, rng: np.random.Generator) -> None:
    scene = Scene([PointCloud("cloud", rng.uniform(-0.5, 0.5, (100, 3)), RADIUS, [0.1, 0.0, 0.0])])
    again = pickle.loads(pickle.dumps(scene))
    rows = robot.sample(rng, 10)
    np.testing.assert_array_equal(robot.clearance(rows, again), robot.clearance(rows, scene))


def test_points_cannot_be_changed(rng: np.random.Generator) -> None:
    points = rng.normal(size=(20, 3))
    cloud = PointCloud("cloud", points)
    points[:] = 0.0
    assert np.abs(np.asarray(cloud.points)).min() > 0.0
    with pytest.raises(ValueError, match="read-only"):
        np.asarray(cloud.points)[0] = 1.0
    assert repr(cloud) == "PointCloud('cloud', 20 points, radius=0.005)"
    assert len(cloud) == 20


def test_a_solver_keeps_clear_of_a_cloud(robot: Robot, rng: np.random.Generator) -> None:
    points = wall(rng, 500)
    scene = Scene([PointCloud("wall", points, RADIUS)])
    solver = IKSolver(robot, scene=scene)
    through, refused = 0, 0
    for q in robot.sample(rng, 40):
        result = solver.solve(robot.forward_kinematics(q), seed=q)
        if result.success:
            assert by_hand(robot, result.q, points).min() > RADIUS
            through += 1
        else:
            assert result.status is Status.IN_COLLISION
            refused += any("wall" in pair for pair in result.touching)
    assert through > 10
    assert refused > 3


def test_a_plan_keeps_clear_of_a_cloud(robot: Robot, rng: np.random.Generator) -> None:
    points = wall(rng, 500)
    scene = Scene([PointCloud("wall", points, RADIUS), Floor(-0.2)])
    solver = IKSolver(robot, scene=scene, clearance=0.005)
    free = [q for q in robot.sample(rng, 200) if not solver.verifier.touching(q)]
    ends = [q for q in free if abs(robot.forward_kinematics(q).translation[0] - 0.35) < 0.25][:4]
    least = np.inf
    for start, goal in itertools.pairwise(ends):
        motion = plan_motion(solver, start, goal)
        assert motion.success
        least = min(least, *(by_hand(robot, q, points).min() - RADIUS for q in motion.q[::25]))
    assert 0.005 - 1e-6 < least < 0.05


@pytest.mark.parametrize("speed", [0.0, 0.05])
def test_a_tracker_stops_before_a_cloud(robot: Robot, rng: np.random.Generator, speed: float) -> None:
    """Told to go through walls of points, standing and coming nearer.

    Points beside the nearest one counted as near as they are along the wall: a hand stopped up to 12 mm before one that
    stands. It stops half a millimetre before the clearance, but for what curvature takes.
    """
    start, found = robot.forward_kinematics(robot.home), []
    target = pin.SE3(start.rotation, start.translation + np.array([0.5, 0.0, 0.0]))
    for _ in range(4):
        points = start.translation + np.column_stack([np.full(500, 0.2), rng.uniform(-0.2, 0.2, (500, 2))])
        assert by_hand(robot, robot.home, points).min() > 0.05
        tracker = Tracker(robot, scene=Scene([PointCloud("wall", points, RADIUS)]), clearance=0.01)
        least = np.inf
        for tick in range(200):
            away = -speed * (tick + 1) * tracker.dt
            there = {"wall": ([away, 0.0, 0.0], [-speed, 0.0, 0.0, 0.0, 0.0, 0.0])} if speed else None
            step = tracker.step(target, obstacles=there)
            if tick % 10 == 0:
                shift = [away, 0.0, 0.0] if speed else [0.0, 0.0, 0.0]
                least = min(least, by_hand(robot, step.q, points + shift).min() - RADIUS)
        found.append(least)
    # One that comes nearer is kept away as far as it comes while the arm stops from full speed.
    ahead = speed * float((tracker.velocity_limit / tracker.acceleration_limit).max())
    assert 0.01 - 1e-4 + 0.5 * ahead < min(found)
    assert max(found) < 0.011 + ahead
    assert np.mean(found) > 0.01 + 0.7 * ahead


@pytest.mark.parametrize(
    ("name", "seed"), [("j2n6s300", 0), pytest.param("j2n6s300", 2, marks=pytest.mark.slow), ("gen3", 0)]
)
def test_a_hand_that_is_pressed_at_sparse_points_comes_to_rest(
    bundled: Callable[[str], Robot], name: str, seed: int
) -> None:
    """Only the direction of the surface that the nearest points make was kept: 119 jolts in three seconds.

    So it still was for a hand that is so wide that many points are near.
    """
    robot = bundled(name)
    start, rng = robot.forward_kinematics(robot.home), np.random.default_rng(seed)
    target = pin.SE3(start.rotation, start.translation + np.array([0.5, 0.0, 0.0]))
    points = start.translation + np.column_stack([np.full(500, 0.2), rng.uniform(-0.2, 0.2, (500, 2))])
    tracker = Tracker(robot, scene=Scene([PointCloud("wall", points, RADIUS)]), clearance=0.01)
    steps = [tracker.step(target) for _ in range(500)]
    assert jolts(np.array([step.v for step in steps]), tracker.acceleration_limit, tracker.dt) <= 16
    assert np.abs(steps[-1].v).max() < 1e-3
    assert 0.01 - 1e-9 < min(step.clearance or 0.0 for step in steps) < 0.0106


def test_a_hand_that_is_led_along_a_cloud_does_not_shake(robot: Robot) -> None:
    """The direction to the nearest point leaps from point to point: the arm jolted up to 460 times in ten seconds."""
    grid = np.stack(np.meshgrid(np.arange(0.1, 0.8, 0.004), np.arange(-0.35, 0.35, 0.004)), axis=-1).reshape(-1, 2)
    points = np.column_stack([grid, np.full(len(grid), 0.12)])
    tracker = Tracker(robot, dt=0.01, scene=Scene([PointCloud("table", points)]), clearance=0.01)
    down, velocities, heights = pin.utils.rotate("x", np.pi), [], []
    for t in 0.01 * np.arange(600):
        place = [0.45 + 0.1 * np.cos(t), 0.1 * np.sin(t), 0.08 + 0.05 * np.cos(0.7 * t)]
        step = tracker.step(pin.SE3(down @ pin.utils.rotate("z", 0.3 * t), np.array(place)))
        velocities.append(step.v)
        heights.append(step.clearance or 0.0)
    assert jolts(np.array(velocities), tracker.acceleration_limit, 0.01) <= 40
    assert min(heights) >= 0.01 - 1e-9
    assert np.median(heights[300:]) < 0.013


@pytest.mark.slow
def test_a_tracker_is_given_what_the_camera_sees_next(robot: Robot, rng: np.random.Generator) -> None:
    start = robot.forward_kinematics(robot.home)
    target = pin.SE3(start.rotation, start.translation + np.array([0.5, 0.0, 0.0]))
    points = start.translation + np.column_stack([np.full(500, 0.2), rng.uniform(-0.2, 0.2, (500, 2))])
    first = PointCloud("seen", points + np.array([0.3, 0.0, 0.0]), RADIUS)
    tracker = Tracker(robot, scene=Scene([first]), clearance=0.01)
    least = np.inf
    for tick in range(150):
        seen = {"seen": PointCloud("seen", points + rng.normal(size=3) * 1e-4, RADIUS)} if tick % 10 == 5 else None
        step = tracker.step(target, obstacles=seen)
        least = min(least, float(robot.clearance(step.q, Scene([PointCloud("wall", points, RADIUS)]))))
    assert 0.01 - 5e-4 < least < 0.02


def test_a_map_leaves_out_what_a_cloud_blocks(robot: Robot, tmp_path: Path, rng: np.random.Generator) -> None:
    points = wall(rng, 500)
    scene = Scene([PointCloud("wall", points, 0.02)])
    grid = Grid([-0.6, -0.4, 0.0], [0.6, 0.4, 0.8], 0.4)
    solver = IKSolver(robot, collision="reject", scene=scene)
    reach = build(solver, folder=tmp_path / "map", grid=grid, orientations=6)
    assert reach is not None
    targets = reach.samples.targets(np.arange(reach.samples.positions)).reshape(-1, 4, 4)
    found = solver.solve_batch(targets, closest=False).success
    np.testing.assert_array_equal(found, reach.counts.ravel() > 0)
    anywhere = IKSolver(robot, collision="reject").solve_batch(targets, closest=False).success
    assert 0 < found.sum() < anywhere.sum()


@pytest.mark.one_quick
@pytest.mark.parametrize("name", ["j2n6s300", "gen3", "j2s7s300"])
def test_points_on_the_arm_are_dropped(name: str, rng: np.random.Generator) -> None:
    robot = jacokin.load_robot(name)
    for q in robot.sample(rng, 3):
        points = rng.uniform(-0.6, 0.6, (4000, 3))
        distance = by_hand(robot, q, points, moving=False)
        for margin in (0.0, 0.05):
            kept = robot.without_own_points(q, points, margin=margin)
            np.testing.assert_array_equal(kept, points[distance > margin])
            assert 0 < len(kept) < len(points)


def test_what_is_left_is_clear_of_the_arm(robot: Robot, rng: np.random.Generator) -> None:
    points = rng.uniform(-0.8, 0.8, (20_000, 3))
    kept = robot.without_own_points(robot.home, points, margin=0.03)
    assert robot.clearance(robot.home, Scene([PointCloud("seen", kept, 0.01)])) > 0.02


def test_fingers_and_what_is_held_are_the_arms_own(robot: Robot, rng: np.random.Generator) -> None:
    points = robot.forward_kinematics(robot.home).translation + rng.uniform(-0.2, 0.2, (20_000, 3))
    closed = Scene(finger_angle=1.2)
    by_scene = robot.without_own_points(robot.home, points, margin=0.0, scene=closed)
    loaded = jacokin.load_robot(finger_angle=1.2).without_own_points(robot.home, points, margin=0.0)
    np.testing.assert_array_equal(by_scene, loaded)
    as_loaded = robot.without_own_points(robot.home, points, margin=0.0)
    assert len(as_loaded) != len(by_scene)
    ball = Scene([PointCloud("seen", points)]).attach(Sphere("ball", 0.05, [0.0, 0.0, 0.0]), "end_effector")
    holding = robot.without_own_points(robot.home, points, margin=0.01, scene=ball)
    near = robot.without_own_points(robot.home, points, margin=0.01)
    centre = robot.forward_kinematics(robot.home).translation
    np.testing.assert_array_equal(holding, near[np.linalg.norm(near - centre, axis=1) > 0.06])
    assert len(holding) < len(near)


def test_other_robots_made_of_one_know_their_points(robot: Robot, rng: np.random.Generator) -> None:
    points = rng.uniform(-0.6, 0.6, (1000, 3))
    wanted = robot.without_own_points(robot.home, points)
    for other in (pickle.loads(pickle.dumps(robot)), robot.with_payload(1.0, [0.0, 0.0, 0.05]), robot.described):
        np.testing.assert_array_equal(other.without_own_points(robot.home, points), wanted)


def test_own_points_of_meshes(tmp_path: Path, rng: np.random.Generator) -> None:
    """Of a tetrahedron: a point is outside by its distance to the planes of its faces."""
    corners = np.array([[0.0, 0.0, 0.0], [0.3, 0.0, 0.0], [0.0, 0.3, 0.0], [0.0, 0.0, 0.3]])
    part = hull_of(corners)
    assert part is not None
    (tmp_path / "part.stl").write_bytes(stl_bytes(part))
    (tmp_path / "arm.urdf").write_text(
        '<robot name="arm"><link name="base"/><link name="tip"><collision><geometry><mesh filename="part.stl"/>'
        '</geometry></collision></link><joint name="turn" type="revolute"><parent link="base"/><child link="tip"/>'
        '<axis xyz="0 0 1"/><limit lower="-3" upper="3" velocity="1" effort="1"/></joint></robot>'
    )
    robot = jacokin.load_robot(tmp_path / "arm.urdf", home=[0.0])
    points = rng.uniform(-0.1, 0.4, (3000, 3))
    there = points @ pin.exp3(np.array([0.0, 0.0, 0.7]))  # in the frame of the tip
    beyond = np.maximum((-there).max(axis=1), (there.sum(axis=1) - 0.3) / np.sqrt(3.0))
    kept = robot.without_own_points([0.7], points, margin=0.0)
    np.testing.assert_array_equal(kept, points[beyond > 0.0])
    weights = rng.dirichlet(np.ones(4), 40_000)
    weights[:, 0] = 0.0
    on_faces = np.vstack([np.roll(weights, turn, axis=1) for turn in range(4)])
    on_faces = (on_faces / on_faces.sum(axis=1, keepdims=True)) @ corners
    to_faces = np.where(beyond > 0.0, cKDTree(on_faces).query(there)[0], 0.0)
    some = set(map(tuple, robot.without_own_points([0.7], points, margin=0.02)))
    assert set(map(tuple, points[to_faces > 0.024])) <= some <= set(map(tuple, points[to_faces > 0.02]))


def test_without_own_points_refuses(robot: Robot, tmp_path: Path) -> None:
    assert robot.without_own_points(robot.home, np.zeros((0, 3))).shape == (0, 3)
    with pytest.raises(InvalidInputError, match=r"points must have shape \(n, 3\)"):
        robot.without_own_points(robot.home, np.zeros((4, 2)))
    with pytest.raises(InvalidInputError, match="keep points"):
        robot.without_own_points(robot.home, [[0.0, np.nan, 0.0]])
    with pytest.raises(InvalidInputError, match="margin must be"):
        robot.without_own_points(robot.home, np.zeros((4, 3)), margin=-0.1)
    with pytest.raises(InvalidInputError, match="scene must be a Scene"):
        robot.without_own_points(robot.home, np.zeros((4, 3)), scene=3)  # type: ignore[arg-type]
    (tmp_path / "bare.urdf").write_text(
        '<robot name="bare"><link name="base"/><link name="tip"/><joint name="turn" type="continuous"><parent '
        'link="base"/><child link="tip"/><axis xyz="0 0 1"/><limit velocity="1" effort="1"/></joint></robot>'
    )
    with pytest.raises(ModelError, match="no collision shapes"):
        jacokin.load_robot(tmp_path / "bare.urdf").without_own_points([0.0], np.zeros((4, 3)))


def test_a_depth_image_gives_the_points_that_are_seen() -> None:
    """Points on a plane, projected by hand, come back; pixels without a depth do not."""
    pose = jacokin.pose([0.5, 0.2, 1.0], rpy=[np.pi, 0.2, 0.1])
    fx, fy, cx, cy = 300.0, 310.0, 31.5, 23.5
    depth = np.zeros((48, 64))
    expected = []
    for row in range(0, 48, 7):
        for column in range(0, 64, 5):
            depth[row, column] = 0.8 + 0.01 * row
            x, y = (column - cx) / fx * depth[row, column], (row - cy) / fy * depth[row, column]
            expected.append(pose.act(np.array([x, y, depth[row, column]])))
    depth[1, 1], depth[2, 2] = np.nan, np.inf
    found = depth_points(depth, [fx, fy, cx, cy], pose)
    np.testing.assert_allclose(found, expected, atol=1e-12)
    matrix = [[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]]
    np.testing.assert_array_equal(
        depth_points(depth.astype(np.float32), matrix, pose),
        depth_points(depth.astype(np.float32), [fx, fy, cx, cy], pose),
    )
    near = depth_points(depth, matrix, pose, farthest=1.0)
    assert 0 < len(near) < len(found)
    assert depth_points(np.zeros((4, 4)), matrix, pose).shape == (0, 3)


@pytest.mark.parametrize(
    ("depth", "intrinsics", "match"),
    [
        (np.ones((4, 4), np.uint16), [1.0, 1.0, 0.0, 0.0], r"depth / 1000.0"),
        (np.ones(4), [1.0, 1.0, 0.0, 0.0], r"depth must be an image \(rows, columns\)"),
        (np.ones((4, 4, 3)), [1.0, 1.0, 0.0, 0.0], r"depth must be an image"),
        (np.ones((4, 4)), [1.0, 1.0, 0.0], r"intrinsics"),
        (np.ones((4, 4)), [0.0, 1.0, 0.0, 0.0], r"intrinsics: fx must be a positive"),
        (np.ones((4, 4)), np.eye(3) + 0.1, r"intrinsics must be \[\[fx, 0, cx\]"),
        (np.ones((4, 4)), "wide", r"intrinsics must be"),
    ],
)
def test_wrong_depth_images_are_refused(depth: Array, intrinsics: object, match: str) -> None:
    with pytest.raises(InvalidInputError, match=match):
        depth_points(depth, intrinsics, np.eye(4))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("name", "points", "radius", "match"),
    [
        ("", np.zeros((3, 3)), 0.01, "the name of an obstacle must be a word"),
        ("cloud", np.zeros((3, 2)), 0.01, r"cloud: points must have shape \(n, 3\)"),
        ("cloud", np.zeros(3), 0.01, r"cloud: points must have shape \(n, 3\)"),
        ("cloud", np.zeros((0, 3)), 0.01, "cloud: points is empty; leave a cloud without points out of the scene"),
        ("cloud", [], 0.01, "cloud: points is empty"),
        ("cloud", [[0.0, 0.0, np.nan]], 0.01, r"row 0 is not; keep points\[np.isfinite\(points\).all\(axis=1\)\]"),
        ("cloud", [[0.0, 0.0, 1e7]], 0.01, r"within 1e\+06 m"),
        ("cloud", "points", 0.01, "cloud: points must be rows of 3 numbers"),
        ("cloud", np.zeros((3, 3)), -0.01, "cloud: radius must be"),
        ("cloud", np.zeros((3, 3)), np.nan, "cloud: radius must be"),
    ],
)
def test_wrong_clouds_are_refused(name: str, points: object, radius: float, match: str) -> None:
    with pytest.raises(InvalidInputError, match=match):
        PointCloud(name, points, radius)  # type: ignore[arg-type]


def test_maps_draw_a_cloud_as_wide_as_it_is(rng: np.random.Generator) -> None:
    points = rng.normal(size=(30, 3))
    lines = [line for line in outline_scene(Scene([PointCloud("cloud", points, RADIUS), Floor(0.0)])) if len(line) == 2]
    middles = np.array([line.mean(axis=0) for line in lines])
    np.testing.assert_allclose(middles[np.lexsort(middles.T)], points[np.lexsort(points.T)])
    np.testing.assert_allclose([np.linalg.norm(line[1] - line[0]) for line in lines], 2.0 * RADIUS)


def test_a_cloud_cannot_be_held(rng: np.random.Generator) -> None:
    cloud = PointCloud("cloud", rng.normal(size=(5, 3)))
    for shape, pose in ((cloud, None), ("cloud", [0.0, 0.0, 0.1])):
        with pytest.raises(InvalidInputError, match="'cloud' is a PointCloud: attach a Box"):
            Scene([cloud] if pose else []).attach(shape, pose=pose)


@pytest.mark.parametrize("ending", [".ply", ".npz"])
def test_files_give_back_the_points(ending: str, tmp_path: Path, rng: np.random.Generator) -> None:
    cloud = PointCloud("cloud", rng.normal(size=(100, 3)), RADIUS, [0.1, 0.2, 0.3])
    cloud.save(tmp_path / f"cloud{ending}")
    again = PointCloud.load(tmp_path / f"cloud{ending}", name="again", radius=RADIUS)
    np.testing.assert_array_equal(again.points, cloud.points)
    assert again.name == "again"


def test_a_scene_file_names_the_file_of_a_cloud(tmp_path: Path, robot: Robot, rng: np.random.Generator) -> None:
    points = rng.uniform(-0.5, 0.5, (100, 3))
    PointCloud("any", points).save(tmp_path / "table.ply")
    (tmp_path / "scene.yaml").write_text(
        "- {shape: point_cloud, name: table, file: table.ply, radius: 0.02, position: [0, 0, 0.1], rpy: [0, 0, 1]}\n"
        "- {shape: point_cloud, file: table.ply}\n"
    )
    scene = Scene.load(tmp_path / "scene.yaml")
    assert scene.names == ("table", "point_cloud_1")
    here = [PointCloud("table", points, 0.02, jacokin.pose([0.0, 0.0, 0.1], rpy=[0.0, 0.0, 1.0]))]
    rows = robot.sample(rng, 10)
    wanted = robot.clearance(rows, Scene([*here, PointCloud("other", points)]))
    np.testing.assert_array_equal(robot.clearance(rows, scene), wanted)
    for entry, error, match in (
        ("{shape: point_cloud}", InvalidInputError, "point_cloud needs file"),
        ("{shape: point_cloud, file: 3}", InvalidInputError, "file must be a string"),
        ("{shape: point_cloud, file: none.ply}", InvalidInputError, r"obstacle 0: .*none.ply: cannot be read"),
        ("{shape: point_cloud, file: table.ply, size: 3}", UnknownNameError, "key in .*: 'size'"),
    ):
        (tmp_path / "wrong.yaml").write_text(f"- {entry}\n")
        with pytest.raises(error, match=match):
            Scene.load(tmp_path / "wrong.yaml")


HEAD = "ply\nformat ascii 1.0\ncomment by hand\nelement vertex 2\n"
AXES = "property float x\nproperty float y\nproperty float z\n"


def test_ply_files_of_other_programs_are_read(tmp_path: Path) -> None:
    """Text and both orders of bytes, other properties and other elements, which are left out."""
    rows = np.array([[0.5, -1.0, 2.0], [0.25, 0.0, -3.0]])
    head = HEAD + "property uchar red\n" + AXES + "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    text = head + "".join(f"7 {x} {y} {z}\n" for x, y, z in rows.tolist()) + "3 0 1 1\n"
    (tmp_path / "text.ply").write_text(text)
    for order, name in (("<", "little"), (">", "big")):
        dtype = np.dtype([("red", "u1"), ("x", f"{order}f4"), ("y", f"{order}f4"), ("z", f"{order}f4")])
        packed = np.zeros(2, dtype)
        for column, axis in enumerate("xyz"):
            packed[axis] = rows[:, column]
        binary = head.replace("ascii", f"binary_{name}_endian").encode() + packed.tobytes() + bytes(13)
        (tmp_path / f"{name}.ply").write_bytes(binary)
    for name in ("text", "little", "big"):
        np.testing.assert_array_equal(PointCloud.load(tmp_path / f"{name}.ply", name=name).points, rows)


@pytest.mark.parametrize(
    ("content", "match"),
    [
        (b"solid part\n", "is not a .ply file"),
        (b"", "is not a .ply file"),
        (b"ply\nformat ascii 1.0\n", "is not a .ply file"),
        ((HEAD + AXES + "end_header\n0 0 0\n").encode(), "ends before its 2 vertices do"),
        ((HEAD + AXES + "end_header\n0 0 0\n0 0\n").encode(), "its vertex 1 has 2 numbers, its header names 3"),
        ((HEAD + AXES + "end_header\n0 0 0\n0 0 up\n").encode(), "cannot be read as a .ply file"),
        ((HEAD + AXES + "end_header\n0 0 0\n0 0 nan\n").encode(), "row 1 is not"),
        ((HEAD.replace("ascii", "binary_little_endian") + AXES + "end_header\n").encode(), "ends before its 2"),
        ((HEAD.replace("ascii", "zipped") + AXES + "end_header\n").encode(), "no known format"),
        ((HEAD + AXES.replace(" z", " w") + "end_header\n").encode(), "have no 'z'"),
        ((HEAD + AXES.replace("float", "half") + "end_header\n").encode(), "unknown type"),
        ((HEAD.replace("vertex 2", "face 2") + AXES + "end_header\n").encode(), "vertices must come first"),
        ((HEAD.replace("vertex 2", "vertex -2") + AXES + "end_header\n").encode(), "no vertices"),
        ((HEAD.replace("vertex 2", "vertex 0") + AXES + "end_header\n").encode(), "points is empty"),
        ((HEAD + AXES + "property list uchar int more\nend_header\n").encode(), "have lists"),
    ],
)
def test_damaged_ply_files_are_refused(content: bytes, match: str, tmp_path: Path) -> None:
    (tmp_path / "cloud.ply").write_bytes(content)
    with pytest.raises(InvalidInputError, match=match):
        PointCloud.load(tmp_path / "cloud.ply", name="cloud")


def test_other_files_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match=r"must end in .ply or .npz"):
        PointCloud.load(tmp_path / "cloud.pcd", name="cloud")
    with pytest.raises(InvalidInputError, match=r"must end in .ply or .npz"):
        PointCloud("cloud", np.zeros((1, 3))).save(tmp_path / "cloud")
    with pytest.raises(InvalidInputError, match=r"none.npz: cannot be read"):
        PointCloud.load(tmp_path / "none.npz", name="cloud")
    (tmp_path / "text.npz").write_text("no archive")
    with pytest.raises(InvalidInputError, match="is not an .npz file"):
        PointCloud.load(tmp_path / "text.npz", name="cloud")
    np.savez(tmp_path / "other.npz", q=np.zeros((4, 3)))
    with pytest.raises(InvalidInputError, match="has no array 'points', only 'q'"):
        PointCloud.load(tmp_path / "other.npz", name="cloud")
    np.savez(tmp_path / "flat.npz", points=np.zeros((4, 2)))
    with pytest.raises(InvalidInputError, match=r"'points' must hold numbers of shape \(n, 3\), not float64 \(4, 2\)"):
        PointCloud.load(tmp_path / "flat.npz", name="cloud")
