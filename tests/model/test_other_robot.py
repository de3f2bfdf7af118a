"""Another robot in a scene: its shapes are where its joints put them, it can go elsewhere, and mistakes are named."""

from __future__ import annotations

import json
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

import jacokin
from jacokin import IKSolver, Robot
from jacokin.errors import InvalidInputError, JacokinError, ModelError, UnknownNameError
from jacokin.ik import Box, Floor, Scene
from jacokin.motion import plan_motion
from tests.two_robots import FAR, TwoRobots

BASE = jacokin.pose([0.6, 0.1, 0.05], rpy=[0.1, 0.2, 2.0])


@pytest.fixture(scope="module")
def lite() -> Robot:
    return jacokin.load_robot("gen3_lite")


@pytest.fixture(scope="module")
def beside(lite: Robot) -> Scene:
    return Scene([Floor(-0.5)]).adding_robot(lite, lite.home, name="left", base=BASE)


def test_distances_are_those_of_both_in_one_model(robot: Robot, lite: Robot, rng: np.random.Generator) -> None:
    both, touching = TwoRobots(robot, lite, BASE), 0
    for q, there in zip(robot.sample(rng, 60), lite.sample(rng, 60), strict=True):
        expected = both.least(q, there)
        found = np.minimum(  # of what moves of either
            robot.clearance(q, Scene().adding_robot(lite, there, name="other", base=BASE)),
            lite.clearance(there, Scene().adding_robot(robot, q, name="other", base=BASE.inverse())),
        )
        touching += expected <= 0.0
        assert min(float(found), FAR) == pytest.approx(expected, abs=1e-3 if expected <= 0.0 else 1e-5)
    assert touching


def test_fingers_of_the_other_robot_stand_where_they_are_told(robot: Robot) -> None:
    """Closed fingers are nearer to each other; a point between the open ones is clear of them."""
    open_, closed = (
        Scene().adding_robot(robot, robot.home, name="other", base=np.zeros(3), finger_angle=angle)
        for angle in (0.15, 1.35)
    )
    places = [
        {part.name: part.solid.placement.translation for part in scene.robots[0].parts} for scene in (open_, closed)
    ]
    moved = {name for name, place in places[0].items() if not np.allclose(place, places[1][name])}
    assert moved
    assert all("/link_finger" in name for name in moved)


def test_it_goes_elsewhere_and_away(robot: Robot, lite: Robot, beside: Scene, rng: np.random.Generator) -> None:
    q, there = robot.home, lite.sample(rng)
    moved = beside.moving({"left": there})
    assert [each.name for each in moved.robots] == ["left"]
    np.testing.assert_array_equal(np.asarray(moved.robots[0].q), there)
    np.testing.assert_array_equal(np.asarray(beside.robots[0].q), lite.home)
    built = Scene([Floor(-0.5)]).adding_robot(lite, there, name="left", base=BASE)
    assert robot.clearance(q, moved) == robot.clearance(q, built)
    assert moved.names == built.names
    gone = moved.removing("left")
    assert gone.names == ("floor",)
    assert gone.robots == ()


def test_contact_with_it_can_be_allowed(robot: Robot, lite: Robot, rng: np.random.Generator) -> None:
    scene = Scene().adding_robot(lite, lite.home, name="left", base=[0.3, 0.0, 0.0])
    rows = robot.sample(rng, 200)
    names = {name for q in rows for pair in scene.contact(robot).touching(q) for name in pair}
    assert any(name.startswith("left/") for name in names)
    allowed = scene.allowing(("robot", "left"))
    names = {name for q in rows for pair in allowed.contact(robot).touching(q) for name in pair}
    assert not any(name.startswith("left/") for name in names)
    assert allowed.removing("left").allow == ()


def test_plans_and_answers_keep_clear_of_it(robot: Robot, bundled: Callable[[str], Robot]) -> None:
    other, base = bundled("j2s7s300"), jacokin.pose([0.0, -0.5, 0.0])
    scene, both = Scene().adding_robot(other, other.home, name="other", base=base), TwoRobots(robot, other, base)
    solver, free = IKSolver(robot, scene=scene), IKSolver(robot)
    turn = np.array([1.2, 0.0, 0.0, 0.0, 0.0, 0.0])
    start, goal = robot.home - turn, robot.home + turn
    assert min(both.least(q, other.home) for q in plan_motion(free, start, goal).q[::10]) < 0.0
    motion = plan_motion(solver, start, goal, time_limit=5.0)
    assert motion.success, motion.message
    assert min(both.least(q, other.home) for q in motion.q[::5]) > 0.0
    poses = [robot.forward_kinematics(start + share * turn) for share in np.linspace(0.0, 2.0, 60)]
    reached = [free.solve(pose).success for pose in poses]
    apart = [solver.solve(pose) for pose in poses]
    assert all(reached)
    assert all(both.least(result.q, other.home) > 0.0 for result in apart if result.success)
    assert any("other/" in result.message for result in apart if not result.success)


def test_scenes_with_robots_can_be_pickled_and_drawn(robot: Robot, beside: Scene) -> None:
    from jacokin.viewer.drawing import build_obstacles

    again = pickle.loads(pickle.dumps(beside))
    assert robot.clearance(robot.home, again) == robot.clearance(robot.home, beside)
    assert again.robots[0].parts[0].robot is again.robots[0]
    assert set(build_obstacles(beside)) == set(beside.names)


def test_hulls_of_meshes_are_in_the_way(robot: Robot, tmp_path: Path) -> None:
    """A robot whose shape is a mesh, a cube, is as far as a box of the same size."""
    corners = [(x, y, z) for x in (-0.1, 0.1) for y in (-0.1, 0.1) for z in (-0.1, 0.1)]
    vertices = " ".join(str(number) for corner in corners for number in corner)
    path = tmp_path / "cube.xml"
    path.write_text(
        f"""<mujoco><asset><mesh name="cube" vertex="{vertices}"/></asset><worldbody><body name="foot">
        <geom type="box" size="0.01 0.01 0.01"/><body name="arm" pos="0 0 0.5"><joint name="turn" axis="0 0 1"/>
        <geom name="cube" type="mesh" mesh="cube" pos="0.3 0 0"/></body></body></worldbody></mujoco>"""
    )
    other = jacokin.load_robot(path, velocity_limit=1.0)
    turned = 0.5
    scene = Scene().adding_robot(other, [turned], name="cube", base=[0.2, -0.9, 0.0])
    centre = np.array([0.2, -0.9, 0.5]) + 0.3 * np.array([np.cos(turned), np.sin(turned), 0.0])
    box = Scene([Box("box", [0.2, 0.2, 0.2], jacokin.pose(centre, rpy=[0.0, 0.0, turned]))])
    assert robot.clearance(robot.home, scene) == pytest.approx(robot.clearance(robot.home, box), abs=1e-6)
    spec = mujoco.MjSpec()
    for part in scene:
        part.add_to(spec.worldbody)
    assert spec.compile().ngeom == 2


def test_files_name_robots(tmp_path: Path, robot: Robot, lite: Robot, beside: Scene) -> None:
    path = tmp_path / "scene.json"
    entry = {
        "shape": "robot",
        "name": "left",
        "robot": "gen3_lite",
        "q": lite.home.tolist(),
        "position": [0.6, 0.1, 0.05],
        "rpy": [0.1, 0.2, 2.0],
    }
    path.write_text(json.dumps([{"shape": "floor", "height": -0.5}, entry]))
    scene = Scene.load(path)
    assert scene.names == beside.names
    assert robot.clearance(robot.home, scene) == pytest.approx(robot.clearance(robot.home, beside), abs=1e-9)
    for wrong, words in (
        ({"robot": "gen3_light"}, "gen3_lite"),
        ({"q": [0.0]}, "shape"),
        ({"robot": "missing.urdf"}, "missing.urdf"),
        ({"robot": 3}, "robot"),
    ):
        path.write_text(json.dumps([{**entry, **wrong}]))
        with pytest.raises(JacokinError, match=words):
            Scene.load(path)


@pytest.mark.parametrize(
    ("change", "error", "words"),
    [
        (lambda scene, robot: scene.adding_robot("gen3", [0.0], name="a", base=BASE), InvalidInputError, "a Robot"),
        (
            lambda scene, robot: scene.adding_robot(robot, [0.0, 1.0], name="a", base=BASE),
            InvalidInputError,
            r"a: q must have shape \(6,\)",
        ),
        (
            lambda scene, robot: scene.adding_robot(robot, robot.home, name="a", base=[0.0, 1.0]),
            InvalidInputError,
            "a: base",
        ),
        (
            lambda scene, robot: scene.adding_robot(robot, robot.home, name="left", base=BASE),
            InvalidInputError,
            "'left' is used",
        ),
        (
            lambda scene, robot: scene.adding_robot(robot, robot.home, name="floor", base=BASE),
            InvalidInputError,
            "'floor' is used",
        ),
        (
            lambda scene, robot: scene.adding_robot(robot, robot.home, name="", base=BASE),
            InvalidInputError,
            "name",
        ),
        (lambda scene, robot: scene.adding(Box("left", [1, 1, 1], [2, 2, 2])), InvalidInputError, "'left' is used"),
        (lambda scene, robot: scene.moving({"left": [0.0, 1.0]}), InvalidInputError, "left: q"),
        (lambda scene, robot: scene.moving({"right": robot.home}), UnknownNameError, "left"),
        (lambda scene, robot: scene.removing("right"), UnknownNameError, "left"),
        (lambda scene, robot: scene.attach("left", pose=BASE), InvalidInputError, "another robot"),
        (
            lambda scene, robot: scene.adding_robot(robot, robot.home, name="a", base=BASE, finger_angle=9.0),
            InvalidInputError,
            "9",
        ),
    ],
)
def test_mistakes_are_named(
    beside: Scene, robot: Robot, change: Callable[..., Any], error: type[Exception], words: str
) -> None:
    with pytest.raises(error, match=words):
        change(beside, robot)


def test_a_robot_without_shapes_is_no_obstacle(tmp_path: Path) -> None:
    path = tmp_path / "bare.xml"
    path.write_text(
        """<mujoco><worldbody><body name="foot"><body name="arm"><joint name="turn" axis="0 0 1"/>
        <inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body></body></worldbody></mujoco>"""
    )
    bare = jacokin.load_robot(path, velocity_limit=1.0)
    with pytest.raises(ModelError, match="no collision shapes"):
        Scene().adding_robot(bare, [0.0], name="bare", base=np.zeros(3))
