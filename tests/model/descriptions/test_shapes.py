"""The shapes of bundled robots, read from their files, are those that MuJoCo reads there."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

import jacokin
from jacokin import Robot
from jacokin.model.contact import Contact
from jacokin.model.descriptions import bundled
from jacokin.model.descriptions.shapes import read_bundled
from jacokin.model.mujoco_twin import shapes_of_twin, to_mujoco
from jacokin.model.scene import Scene


def assert_as_in_mujoco(robot: Robot) -> None:
    assert robot.source.bundled is not None
    links = {name: robot.frame_id(name) for name in robot.frames}
    found = read_bundled(robot.source.bundled, robot.pin_model, links)
    model = to_mujoco(robot, geometry=True)
    expected = shapes_of_twin(model)
    assert [each[:2] for each in found.shapes] == [each[:2] for each in expected]
    assert [each.joint for each in found.shapes] == [each.joint for each in expected]
    for ours, theirs in zip(found.shapes, expected, strict=True):
        np.testing.assert_array_equal(ours.size, theirs.size)
        np.testing.assert_allclose(ours.placement.homogeneous, theirs.placement.homogeneous, rtol=0.0, atol=1e-14)
    pairs = zip(model.pair_geom1.tolist(), model.pair_geom2.tolist(), strict=True)
    assert sorted(map(sorted, found.pairs)) == sorted(map(sorted, pairs))


@pytest.mark.one_quick
@pytest.mark.parametrize("name", bundled.NAMES)
def test_shapes_and_pairs_are_those_of_mujoco(name: str) -> None:
    assert_as_in_mujoco(jacokin.load_robot(name))


def test_with_open_fingers_and_parts_of_an_arm() -> None:
    assert_as_in_mujoco(jacokin.load_robot(finger_angle=1.2))
    assert_as_in_mujoco(jacokin.load_robot(base="link_2", tip="hand"))


def test_contact_agrees_with_the_way_through_mujoco(robot: Robot) -> None:
    """The same angle of the fingers as a part of a scene goes through MuJoCo."""
    alone, other = Contact(robot), Scene([]).with_fingers(robot.finger_angle).contact(robot)
    rows = robot.sample(np.random.default_rng(3), 500)
    assert 20 < sum(map(alone.touches, rows)) < 450
    assert [alone.touching(q) for q in rows] == [other.touching(q) for q in rows]
    np.testing.assert_allclose(
        alone.distances(rows, self_collision=True), other.distances(rows, self_collision=True), rtol=0.0, atol=1e-12
    )


def test_contact_of_a_bundled_robot_needs_no_mujoco() -> None:
    code = (
        "import sys, jacokin; from jacokin.model.contact import Contact; robot = jacokin.load_robot();"
        "print(Contact(robot).touching(robot.home), 'mujoco' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-P", "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[] False\n"
