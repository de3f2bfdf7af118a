"""Shapes that the arm holds, and contact that a scene allows."""

from __future__ import annotations

import json
import pickle
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import jacokin
from jacokin import IKSolver, Robot
from jacokin.errors import InvalidInputError, UnknownNameError
from jacokin.ik import Box, Floor, Scene, Sphere
from jacokin.model.contact import Contact

FAR = Box("wall", [0.1, 4.0, 4.0], [3.0, 0.0, 0.0])
IN_HAND = [0.0, 0.0, -0.2]  # [m] of the frame "hand"


@pytest.mark.parametrize("frame", ["hand", "end_effector", "link_finger_1", "link_3"])
def test_what_is_held_moves_along(robot: Robot, rng: np.random.Generator, frame: str) -> None:
    """A ball far out on the hand is nearer to the wall than the arm is: its distance is known."""
    ball = Sphere("ball", 0.05, [0.0, 0.0, 0.0])
    held = Scene([FAR]).attach(ball, to=frame, pose=[0.0, 0.3, -1.2])
    for q in robot.sample(rng, 10):
        centre = robot.forward_kinematics(q, frame=frame).act(np.array([0.0, 0.3, -1.2]))
        alone = float(robot.clearance(q, Scene([FAR])))
        expected = min(2.95 - centre[0] - 0.05, alone)
        assert float(robot.clearance(q, held)) == pytest.approx(expected, abs=1e-6)


@pytest.mark.slow
def test_what_is_held_counts_against_other_links_only(robot: Robot, rng: np.random.Generator) -> None:
    inside = Scene().attach(Sphere("ball", 0.08, IN_HAND), to="hand")
    assert Contact(robot, inside.surroundings).touching(robot.home) == []
    large = Scene().attach(Sphere("ball", 0.25, IN_HAND), to="hand")
    rows, verifier = robot.sample(rng, 100), IKSolver(robot, collision="report").verifier
    touching = [Contact(robot, large.surroundings).touching(q) for q in rows]
    assert any("ball" in pair for pairs in touching for pair in pairs)
    for q, pairs in zip(rows, touching, strict=True):
        centre = robot.forward_kinematics(q, frame="hand").act(np.array(IN_HAND))
        alone = verifier.distances(q[None])[0]
        apart = float(robot.clearance(q, Scene([Sphere("ball", 0.25, centre)], allow=[("link_6", "ball")])))
        if abs(apart) > 1e-5 and abs(alone) > 1e-5:
            assert bool(pairs) == (apart < 0.0 or alone < 0.0)


def test_a_held_shape_is_one_that_stood(robot: Robot) -> None:
    scene = Scene([FAR, Box("cup", [0.06, 0.06, 0.1], [0.4, -0.4, 0.05])])
    held = scene.attach("cup", to="end_effector", pose=[0.0, 0.0, 0.02])
    assert (held.names, [each.name for each in held.attached]) == (("wall",), ["cup"])
    assert scene.names == ("wall", "cup")
    put = held.detach("cup", pose=[0.2, 0.3, 0.05])
    assert put.names == ("wall", "cup")
    assert put.attached == ()
    assert held.detach("cup").names == ("wall",)
    copy = pickle.loads(pickle.dumps(held))
    assert float(robot.clearance(robot.home, copy)) == float(robot.clearance(robot.home, held))
    assert repr(held) == "Scene(wall, cup on end_effector)"


def test_allowed_contact_does_not_count(robot: Robot) -> None:
    cup = Sphere("cup", 0.1, robot.forward_kinematics(robot.home, frame="end_effector").translation)

    def names(scene: Scene) -> set[str]:
        return {name for pair in Contact(robot, scene.surroundings).touching(robot.home) for name in pair} - {"cup"}

    touched = names(Scene([cup]))
    assert any(name.startswith("hand") for name in touched)
    assert any(name.startswith("link_finger") for name in touched)
    without_hand = names(Scene([cup], allow=[("hand", "cup")]))
    assert without_hand == {name for name in touched if not name.startswith(("hand", "link_finger"))}
    assert names(Scene([cup], allow=[("cup", "robot")])) == set()
    one = next(iter(touched))
    assert names(Scene([cup]).allowing((one, "cup"))) == touched - {one}
    solver = IKSolver(robot, collision="reject", scene=Scene([cup], allow=[("robot", "cup")]))
    assert solver.solve(robot.forward_kinematics(robot.home), seed=robot.home).success


def test_own_pairs_can_be_allowed(robot: Robot, rng: np.random.Generator) -> None:
    plain, allowing = Contact(robot), Contact(robot, Scene(allow=[("robot", "robot")]).surroundings)
    rows = [q for q in robot.sample(rng, 60) if plain.touching(q)]
    assert rows
    assert all(allowing.touching(q) == [] for q in rows)


def test_files_say_what_is_allowed(robot: Robot, tmp_path: Path) -> None:
    entry = {"shape": "sphere", "name": "cup", "radius": 0.05, "position": [0.3, 0.3, 0.3]}
    file = tmp_path / "scene.json"
    file.write_text(json.dumps({"obstacles": [entry], "allow": [["hand", "cup"]]}))
    assert Scene.load(file).allow == (("hand", "cup"),)
    file.write_text(json.dumps({"obstacles": [entry], "allow": [["hand"]]}))
    with pytest.raises(InvalidInputError, match=r"scene.json: allow must be pairs of names, for example"):
        Scene.load(file)


def test_mistakes_name_what_is_there(robot: Robot) -> None:
    cup = Box("cup", [0.06, 0.06, 0.1], [0.4, -0.4, 0.05])
    scene = Scene([cup, Floor(-1.0)])
    with pytest.raises(UnknownNameError, match="unknown obstacle 'cap'"):
        scene.attach("cap", pose=[0, 0, 0])
    with pytest.raises(InvalidInputError, match="pose is needed: where 'cup' is in the frame 'hand'"):
        scene.attach("cup")
    with pytest.raises(InvalidInputError, match="'floor' is a floor, which no arm can hold"):
        scene.attach("floor", pose=[0, 0, 0])
    with pytest.raises(InvalidInputError, match="the name 'cup' is used by two shapes"):
        scene.attach(Sphere("cup", 0.1, [0, 0, 0]))
    with pytest.raises(UnknownNameError, match="unknown attached shape 'cup'"):
        scene.detach("cup")
    with pytest.raises(UnknownNameError, match="unknown frame 'hands'"):
        robot.clearance(robot.home, scene.attach("cup", to="hands", pose=[0, 0, 0]))
    with pytest.raises(InvalidInputError, match="'link_base' is moved by no joint of j2n6s300: leave 'cup'"):
        robot.clearance(robot.home, scene.attach("cup", to="link_base", pose=[0, 0, 0]))
    with pytest.raises(UnknownNameError, match="unknown shape or link 'hnd'"):
        robot.clearance(robot.home, Scene([cup], allow=[("hnd", "cup")]))
    with pytest.raises(InvalidInputError, match="allow must be pairs of names"):
        Scene([cup], allow=["hand"])  # type: ignore[list-item]  # wrong on purpose
    assert isinstance(jacokin.pose([0, 0, 0]), pin.SE3)


def test_an_obstacle_more_leaves_the_rest_of_a_scene_as_it_was() -> None:
    wall, cup = Box("wall", (0.1, 1.0, 1.0), (0.6, 0.0, 0.5)), Sphere("cup", 0.03, (0.0, 0.0, 0.05))
    before = Scene([wall], finger_angle=0.4, allow=[("hand", "cup")]).attach(cup, pose=[0.0, 0.0, 0.05])
    after = before.adding(Box("crate", (0.1, 0.1, 0.1), (0.0, 0.6, 0.1)))
    assert [each.name for each in after] == ["wall", "crate"]
    assert [each.name for each in before] == ["wall"]
    assert (after.attached, after.allow, after.finger_angle) == (before.attached, before.allow, before.finger_angle)
    with pytest.raises(InvalidInputError, match="the name 'wall' is used by two shapes"):
        before.adding(wall)
