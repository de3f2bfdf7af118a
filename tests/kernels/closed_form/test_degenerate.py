"""Poses where the elimination degenerates: vertical tools, O on axis 5, folds, round angles, aligned spherical wrists.

The branches of a regular pose move continuously with the target, so a degenerate target must have as many branches as
its neighbours, in the same places.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import pinocchio as pin
import pytest

from jacokin import IKSolver, Robot
from jacokin.arrays import Array
from tests.kernels.closed_form.tools import (
    brute_force,
    circular,
    closed_form,
    closest_pair,
    contains,
    fold_between,
    sizes,
    target,
    worst_error,
)

NAMES = ("j2n6s300", "m1n6s300", "j2s6s300")


def vertical_targets(robot: Robot, rng: np.random.Generator, number: int, up: bool = False) -> Iterator[Array]:
    """Tool straight down (or up), at heights and radii the arm works at."""
    reach = 0.5 if robot.name.startswith("m1") else 0.7  # [m]
    for _ in range(number):
        turn = pin.rpy.rpyToMatrix(0.0 if up else np.pi, 0.0, rng.uniform(-np.pi, np.pi))
        yield pin.SE3(turn, rng.uniform([-reach, -reach, -0.2], [reach, reach, 0.6])).homogeneous


@pytest.mark.one_quick
@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("tilt", [1e-12, 1e-9, 1e-7, 1e-6, 1e-5, 1e-4])
@pytest.mark.parametrize("number", sizes(80, 200))
def test_vertical_tools_have_the_branches_of_slightly_tilted_ones(
    number: int, tilt: float, name: str, bundled: Callable[[str], Robot], rng: np.random.Generator
) -> None:
    robot = bundled(name)
    form = closed_form(robot)
    compared = 0
    for T in vertical_targets(robot, rng, number):
        exact = form.solve_all(np.ascontiguousarray(T), robot.home)
        if not len(exact) or min(robot.singular_values(q)[-1] for q in exact.q) < 0.02:
            continue  # near a fold the tilt itself may add or remove a pair
        axis = rng.normal(size=3)
        axis *= tilt / np.linalg.norm(axis)
        tilted = pin.SE3(T)
        tilted.rotation = tilted.rotation @ pin.exp3(axis)
        beside = form.solve_all(np.ascontiguousarray(tilted.homogeneous), robot.home)
        assert len(beside) == len(exact)
        assert all(contains(beside, q, 200.0 * tilt + 1e-8) for q in exact.q)
        assert max(worst_error(exact), worst_error(beside)) < 1e-11
        compared += 1
    assert compared > 0.05 * number


@pytest.mark.one_quick
@pytest.mark.parametrize("up", [False, True])
def test_vertical_tools_have_the_branches_of_a_brute_force_search(
    up: bool, robot: Robot, rng: np.random.Generator
) -> None:
    form = closed_form(robot)
    total = 0
    for T in vertical_targets(robot, rng, 6, up):
        found = brute_force(robot, T, rng, 120)
        rows = form.solve_all(np.ascontiguousarray(T), robot.home)
        assert len(found) == len(rows)
        assert all(contains(rows, q, 1e-5) for q in found)
        total += len(rows)
    assert total > 8


def configurations_with_O_on_axis_5(robot: Robot, rng: np.random.Generator, number: int) -> Iterator[Array]:
    """Newton on joints 3 and 4 until axis 5 passes through O, the point where axes 1 and 2 meet."""
    model, data = robot.pin_model, robot.pin_model.createData()
    pin.forwardKinematics(model, data, np.zeros(6))
    O = data.oMi[1].translation.copy()  # noqa: E741 - the letter of the derivation
    O[2] = data.oMi[2].translation[2]
    O[:2] = 0.0

    def miss(q: Array) -> Array:
        pin.forwardKinematics(model, data, q)
        return np.asarray(data.oMi[5].actInv(O)[:2])

    while number:
        q = robot.sample(rng)
        for _ in range(30):
            value = miss(q)
            slopes = np.column_stack([(miss(q + 1e-7 * np.eye(6)[j]) - value) / 1e-7 for j in (2, 3)])
            if abs(np.linalg.det(slopes)) < 1e-6:
                break
            q[[2, 3]] -= np.clip(np.linalg.solve(slopes, value), -0.3, 0.3)
        if np.abs(miss(q)).max() < 1e-14 and robot.within_limits(q):
            number -= 1
            yield q


@pytest.mark.one_quick("step")
@pytest.mark.parametrize("name", ["j2n6s300", "m1n6s300"])
@pytest.mark.parametrize("step", [0.0, 1e-9, 1e-6, 1e-4, 1e-3])
@pytest.mark.parametrize("number", sizes(8, 25))
def test_O_on_axis_5(
    number: int, name: str, step: float, bundled: Callable[[str], Robot], rng: np.random.Generator
) -> None:
    robot = bundled(name)
    form = closed_form(robot)
    for exact in configurations_with_O_on_axis_5(robot, rng, number):
        q = exact + step * rng.normal(size=6)
        rows = form.solve_all(target(robot, q), q)
        assert contains(rows, q, 1e-5)
        assert worst_error(rows) < 1e-10
        twin = form.solve_all(target(robot, q + 1e-8), q)
        if min(robot.singular_values(branch)[-1] for branch in rows.q) > 1e-3:
            assert len(twin) == len(rows)


@pytest.mark.slow
def test_O_on_axis_5_has_the_branches_of_a_brute_force_search(robot: Robot, rng: np.random.Generator) -> None:
    form = closed_form(robot)
    for q in configurations_with_O_on_axis_5(robot, rng, 4):
        T = target(robot, q)
        rows = form.solve_all(T, q)
        assert len(rows) == len(brute_force(robot, T, rng, 250))


def folds(robot: Robot, rng: np.random.Generator, number: int) -> Iterator[Array]:
    """Configurations with det J = 0, between random ones."""
    while number:
        fold = fold_between(robot, *robot.sample(rng, 2))
        if fold is not None:
            number -= 1
            yield fold


@pytest.mark.one_quick("step")
@pytest.mark.parametrize("name", ["j2n6s300", "m1n6s300"])
@pytest.mark.parametrize("step", [0.0, 1e-12, 1e-9, 1e-7, 1e-5, 1e-3])
@pytest.mark.parametrize("number", sizes(15, 60))
def test_folds(number: int, name: str, step: float, bundled: Callable[[str], Robot], rng: np.random.Generator) -> None:
    robot = bundled(name)
    form = closed_form(robot)
    for fold in folds(robot, rng, number):
        q = fold + step * rng.normal(size=6)
        rows = form.solve_all(target(robot, q), q)
        assert contains(rows, q, 1e-4)
        assert worst_error(rows) < 1e-9
        assert closest_pair(rows) > 1e-6


@pytest.mark.one_quick("unit")
@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("unit", [30.0, 45.0, 90.0])
@pytest.mark.parametrize("number", sizes(40, 150))
def test_round_angles(
    number: int, name: str, unit: float, bundled: Callable[[str], Robot], rng: np.random.Generator
) -> None:
    robot = bundled(name)
    form = closed_form(robot)
    checked = 0
    while checked < number:
        q = np.radians(unit * rng.integers(-4, 12, 6))
        if not robot.within_limits(q):
            continue
        rows = form.solve_all(target(robot, q), q)
        assert contains(rows, q, 1e-4)
        assert rows.within_limits[np.argmin(circular(rows.q, q))]
        assert worst_error(rows) < 1e-9
        assert closest_pair(rows) > 1e-6
        checked += 1


def test_an_aligned_spherical_wrist_is_a_family(bundled: Callable[[str], Robot], rng: np.random.Generator) -> None:
    robot = bundled("j2s6s300")
    form = closed_form(robot)
    for q in robot.sample(rng, 50):
        q[4] = np.pi
        T = target(robot, q)
        own = form.solve_all(T, q)
        assert own.singular.any()
        assert contains(own, q, 1e-6)
        assert own.singular[np.argmin(circular(own.q, q))]
        assert (~own.singular).sum() >= 2  # the isolated branches of the other arm postures
        seed = robot.sample(rng)
        other = form.solve_all(T, seed)
        members = other.q[other.singular]
        assert np.isclose(members[:, 5], seed[5], atol=1e-9).any()
        assert np.isclose(members[:, 3], seed[3], atol=1e-6).any()
        assert worst_error(other) < 1e-10


@pytest.mark.parametrize("away", [1e-8, 1e-6, 1e-4, 1e-2])
def test_a_nearly_aligned_spherical_wrist_is_not(
    away: float, bundled: Callable[[str], Robot], rng: np.random.Generator
) -> None:
    robot = bundled("j2s6s300")
    form = closed_form(robot)
    for q in robot.sample(rng, 100):
        q[4] = np.pi + away
        rows = form.solve_all(target(robot, q), q)
        assert not rows.singular.any()
        assert contains(rows, q, 1e-4)


@pytest.mark.parametrize(("bend", "stretch"), [(1e-5, 1e-3), (1e-6, 1e-3), (1e-6, 3e-4)])
@pytest.mark.parametrize("name", ["j2s6s300", "j2s6s200"])
def test_a_nearly_straight_wrist_on_a_nearly_stretched_arm_loses_no_posture(
    name: str, bend: float, stretch: float, bundled: Callable[[str], Robot], rng: np.random.Generator
) -> None:
    robot = bundled(name)
    form = closed_form(robot)
    for q in robot.sample(rng, 60):
        q[2], q[4] = np.pi + rng.choice([-stretch, stretch]), np.pi + rng.choice([-bend, bend])
        rows = form.solve_all(target(robot, q), q)
        arms, sides = rows.q[:, :3], rows.q[:, 4] > np.pi
        postures = [arms[0]]
        for arm in arms:
            if circular(np.array(postures), arm).min() > 0.1 * stretch:
                postures.append(arm)
        assert len(postures) == 4  # joint 1 either way round, and the elbow up or down
        for arm in postures:  # the wrist bent either way
            assert set(sides[circular(arms, arm) < 0.1 * stretch]) == {False, True}


def vertical_forearms(robot: Robot, rng: np.random.Generator, number: int) -> Iterator[Array]:
    """Configurations whose axis 4 is within 1e-7 to 3e-2 rad of parallel to axis 1: two branches differ by q1 + pi."""
    data = robot.pin_model.createData()

    def misalignment(q: Array) -> float:
        pin.forwardKinematics(robot.pin_model, data, q)
        z1, z3, z4 = (data.oMi[joint].rotation[:, 2].copy() for joint in (1, 3, 4))
        return float(np.cross(z1, z4) @ z3)

    made = 0
    while made < number:
        q = robot.sample(rng)
        for _ in range(30):
            here = misalignment(q)
            slope = (misalignment(q + 1e-6 * np.eye(6)[2]) - here) / 1e-6
            q[2] -= np.clip(here / slope, -0.5, 0.5) if abs(slope) > 1e-3 else 0.5
        q[2] += rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-7.0, -1.5)
        if abs(misalignment(q)) < 0.05 and robot.within_limits(q):
            made += 1
            yield q


@pytest.mark.one_quick
@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("number", sizes(150, 400))
def test_a_forearm_along_axis_1_loses_no_branch(number: int, bundled: Callable[[str], Robot], name: str) -> None:
    robot = bundled(name)
    form = closed_form(robot)
    for q in vertical_forearms(robot, np.random.default_rng(5), number):
        assert contains(form.solve_all(target(robot, q), robot.home), q), q.tolist()


@pytest.mark.parametrize("number", sizes(300, 2000))
def test_two_branches_that_differ_by_half_a_turn_of_joint_1_are_both_found(number: int, robot: Robot) -> None:
    # The sphere condition gives both branches one q6, an interval of 4e-7 rad that bisection leaves undecided.
    q = np.array([1.0774785, 5.12, 1.97, 4.7388, 3.90147, 1.78233])
    rng = np.random.default_rng(0)
    form = closed_form(robot)
    for tilt in rng.uniform(-1e-2, 1e-2, number):
        near = q + np.array([0.0, 0.0, tilt, 0.0, 0.0, 0.0])
        assert contains(form.solve_all(target(robot, near), robot.home), near), near.tolist()


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("number", sizes(1, 10))
def test_branches_change_in_pairs_while_the_tool_turns(number: int, robot: Robot, axis: int) -> None:
    """A lost branch shows as an odd number at a single angle: branches come and go in folds, two at a time."""
    solver = IKSolver(robot)
    unit = np.eye(3)[axis]
    for q in robot.sample(np.random.default_rng(9), number):
        start = robot.forward_kinematics(q)
        turned = [start * pin.SE3(pin.exp3(unit * angle), np.zeros(3)) for angle in np.linspace(-np.pi, np.pi, 4000)]
        form = solver.closed_form()
        matrices = np.array([pose.homogeneous for pose in turned])
        counts = form.solve_batch(matrices, np.tile(robot.home, (len(matrices), 1))).branches
        assert not (counts % 2).any(), (q.tolist(), np.flatnonzero(counts % 2).tolist())
