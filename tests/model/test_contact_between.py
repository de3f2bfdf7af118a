"""Contact of two robots that both move: distances by MuJoCo, and straight motions that are certified."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

import jacokin
from jacokin import Robot
from jacokin.ik import Scene, Sphere
from jacokin.model.contact import ContactBetween
from tests.two_robots import FAR, TwoRobots

BASE = jacokin.pose([0.5, 0.1, 0.05], rpy=[0.1, 0.2, 2.0])
PAIRS = [("j2n6s300", "j2n6s300"), ("j2s7s300", "gen3_lite"), ("gen3_lite", "j2s7s300")]


@pytest.mark.parametrize(("name", "other_name"), PAIRS)
def test_distances_are_those_of_both_in_one_model(
    bundled: Callable[[str], Robot], rng: np.random.Generator, name: str, other_name: str
) -> None:
    robot, other = bundled(name), bundled(other_name)
    scene = Scene().adding_robot(other, other.home, name="other", base=BASE)
    between = ContactBetween(robot, scene.surroundings, scene.robots[0])
    rows, others = robot.sample(rng, 80), other.sample(rng, 80)
    both = TwoRobots(robot, other, BASE)
    expected = np.array([both.least(q, there) for q, there in zip(rows, others, strict=True)])
    found = np.minimum(between.distances(rows, others), FAR)
    deep = expected <= 0.0
    assert deep.any()
    np.testing.assert_array_equal(found <= 0.0, deep)
    np.testing.assert_allclose(found[~deep], expected[~deep], atol=1e-5)


@pytest.mark.parametrize(("name", "other_name"), PAIRS[:2])
def test_motions_of_both_are_refused_where_samples_touch(
    bundled: Callable[[str], Robot], rng: np.random.Generator, name: str, other_name: str
) -> None:
    robot, other = bundled(name), bundled(other_name)
    scene = Scene().adding_robot(other, other.home, name="other", base=BASE)
    between, refused = ContactBetween(robot, scene.surroundings, scene.robots[0], clearance=0.002), 0
    shares = np.linspace(0.0, 1.0, 200)[:, None]
    for _ in range(60):
        start, there = robot.sample(rng), other.sample(rng)
        end, where = start + rng.uniform(-0.6, 0.6, robot.dof), there + rng.uniform(-0.6, 0.6, other.dof)
        along = between.distances(start + shares * (end - start), there + shares * (where - there))
        pair = between.in_the_way((start, end), (there, where))
        if pair is None:
            assert along.min() > 0.002
        else:
            refused += 1
            assert along.min() < 0.002 + 2e-3
            assert pair[0].startswith("other/")
            assert not pair[1].startswith("other/")
    assert 0 < refused < 60


def test_a_clearance_that_links_of_one_robot_never_keep_is_kept_between_two(
    bundled: Callable[[str], Robot], rng: np.random.Generator
) -> None:
    robot = bundled("gen3_lite")
    scene = Scene().adding_robot(robot, robot.home, name="other", base=BASE)
    between, wide = (ContactBetween(robot, scene.surroundings, scene.robots[0], clearance=c) for c in (0.0, 0.03))
    rows, others = robot.sample(rng, 100), robot.sample(rng, 100)
    near = between.distances(rows, others) < 0.03
    assert 0 < np.count_nonzero(near) < 100
    found = [wide.in_the_way((q, q), (there, there)) is not None for q, there in zip(rows, others, strict=True)]
    np.testing.assert_array_equal(found, near)


def test_what_the_arm_holds_counts_and_what_is_allowed_does_not(robot: Robot) -> None:
    """A ball at the tool is nearer by its radius to the other arm, whose tool is in front of it."""
    tool = robot.forward_kinematics(robot.home)
    facing = tool * jacokin.pose([0.0, 0.0, 0.4], rpy=[np.pi, 0.0, 0.0])
    base = facing * robot.forward_kinematics(robot.home).inverse()
    scene = Scene().adding_robot(robot, robot.home, name="other", base=base)
    holding = scene.attach(Sphere("ball", 0.05, [0.0, 0.0, 0.1]), "end_effector")
    empty, held = (
        ContactBetween(robot, each.surroundings, each.robots[0]).distances(robot.home[None], robot.home[None])[0]
        for each in (scene, holding)
    )
    assert held < empty
    allowed = holding.allowing(("ball", "other"))
    again = ContactBetween(robot, allowed.surroundings, allowed.robots[0])
    assert again.distances(robot.home[None], robot.home[None])[0] == pytest.approx(empty)


def test_levers_are_those_of_each_arm(robot: Robot, bundled: Callable[[str], Robot]) -> None:
    other = bundled("gen3_lite")
    scene = Scene().adding_robot(other, other.home, name="other", base=BASE)
    between = ContactBetween(robot, scene.surroundings, scene.robots[0])
    np.testing.assert_array_equal(between.levers, Scene().contact(robot).levers)
    np.testing.assert_array_equal(between.other_levers, Scene().contact(other).levers)
