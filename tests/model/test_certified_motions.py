"""Certified motions against dense sampling: none that touches is passed, and few that do not are refused."""

from __future__ import annotations

import numpy as np
import pytest

from jacokin import Robot
from jacokin.ik import Box, Cylinder, Floor, Scene, Sphere
from jacokin.model.contact import Contact

SCENE = Scene(
    [
        Box("plate", [0.3, 0.3, 0.002], [0.4, -0.3, 0.4]),
        Cylinder("post", 0.03, 1.2, [-0.35, 0.2, 0.6]),
        Sphere("ball", 0.08, [0.2, 0.45, 0.6]),
        Floor(-0.05),
    ]
)


@pytest.mark.parametrize("count", [25, pytest.param(300, marks=pytest.mark.slow)])
@pytest.mark.parametrize("margin", [0.0, 0.01])
def test_no_contact_is_stepped_over(robot: Robot, rng: np.random.Generator, count: int, margin: float) -> None:
    contact = Contact(robot, SCENE.surroundings, clearance=margin)
    clear = blocked = 0
    while clear + blocked < count:
        start = robot.sample(rng)
        end = np.clip(start + rng.normal(size=robot.dof) * rng.choice([0.1, 0.4]), robot.lower, robot.upper)
        if contact.touches(start) or contact.touches(end):
            continue
        block = contact.in_the_way(start, end)
        steps = np.linspace(0.0, 1.0, 2 + int(np.abs(end - start).max() / 0.02))[:, None]
        least = float(np.min(robot.clearance(start + steps * (end - start), SCENE, self_collision=True)))
        if block is None:
            assert least > margin
            clear += 1
        else:
            assert least < margin + 0.02
            blocked += 1
    assert clear > count // 3
    assert blocked > 0


def test_a_thin_plate_is_not_stepped_over(robot: Robot) -> None:
    """A plate of a hundredth of a millimetre stands across the way of the hand."""
    plate = Scene([Box("plate", [1e-5, 0.2, 0.2], robot.forward_kinematics(robot.home).translation)])
    contact = Contact(robot, plate.surroundings)
    start, end = robot.home.copy(), robot.home.copy()
    start[0], end[0] = start[0] - 1.0, end[0] + 0.7
    block = contact.in_the_way(start, end)
    assert block is not None
    assert "plate" in block


def test_no_point_is_farther_than_the_levers(robot: Robot, rng: np.random.Generator) -> None:
    contact = Contact(robot, SCENE.surroundings)
    for q in robot.sample(rng, 20):
        tip = robot.forward_kinematics(q).translation
        axis = robot.forward_kinematics(q, frame="link_2").translation
        assert np.linalg.norm(tip - axis) < contact.levers[1] + 0.1
        assert np.linalg.norm(tip[:2]) < contact.levers[0]
