"""Targets on the edge of reach, where configurations are single points: the arm stretched out, within limits or not."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import jacokin
from jacokin import FreeAxis, IKSolver, Robot, Status
from jacokin.arrays import Array
from jacokin.model.angles import wrap_to_pi
from tests.seven_joint_arms import HALF, XARM7, Placement, load_arm, load_placed

CLOSURE = 1e-9  # [m] and [rad] by which members may be off
TOLERANCE = 1e-6  # [m] and [rad] of a success


@pytest.fixture(scope="module", params=["j2s7s300", "j2s6s300"])
def solver(request: pytest.FixtureRequest) -> IKSolver:
    return IKSolver(jacokin.load_robot(request.param), collision="ignore")


def stretched(robot: Robot, rng: np.random.Generator) -> Array:
    """A configuration within the limits whose wrist is as far from the shoulder as the arm allows."""
    q = robot.sample(rng)
    q[2] = math.pi
    if robot.dof == 7:
        q[3] = math.pi
    else:
        q[4] = math.pi + rng.choice([-1.0, 1.0]) * rng.uniform(0.3, 0.9)  # the tool is farther out than the wrist
    return q


def target_at(robot: Robot, q: Array, outward: float = 0.0) -> pin.SE3 | FreeAxis:
    """Pose, or pose with a free axis, that a stretched arm reaches; moved away from the shoulder [m]."""
    T = robot.forward_kinematics(q)
    ways, sizes, _ = np.linalg.svd(robot.jacobian(q))
    assert sizes[5] < 1e-9
    force, moment = ways[:3, 5], ways[3:, 5]  # what the arm bears without its motors: along the stretched arm
    shoulder = robot.forward_kinematics(q, frame="link_2").translation
    away = force / np.linalg.norm(force) * np.sign(force @ (T.translation - shoulder))
    moved = pin.SE3(T.rotation, T.translation + outward * away)
    if robot.dof == 7:
        return moved
    axis = np.cross(moment, force)  # turned about it, the arm bears the tool all the same
    return FreeAxis(moved, axis=T.rotation.T @ axis / np.linalg.norm(axis))


@pytest.mark.parametrize("count", [6, pytest.param(12, marks=pytest.mark.slow)])
def test_a_stretched_arm_is_its_own_answer(solver: IKSolver, rng: np.random.Generator, count: int) -> None:
    """It reaches its target all alone: without a seed nearby it may be missed, and then the set is not complete."""
    robot = solver.robot
    for _ in range(count):
        q = stretched(robot, rng)
        target = target_at(robot, q)
        result = solver.solve(target, seed=q, closest=False).raise_for_status()
        np.testing.assert_allclose(wrap_to_pi(result.q - q), np.zeros(robot.dof), atol=1e-3)
        nearest = solver.solve_all(target, seed=q).nearest(q)
        assert nearest is not None
        assert np.abs(wrap_to_pi(nearest - q)).max() < 1e-3
        everything = solver.solve_all(target)
        best = everything.nearest(q)
        assert not everything.complete or (best is not None and np.abs(wrap_to_pi(best - q)).max() < 1e-3)


@pytest.mark.parametrize("count", [3, pytest.param(6, marks=pytest.mark.slow)])
def test_what_counts_as_reached_is_as_near_as_a_success(solver: IKSolver, rng: np.random.Generator, count: int) -> None:
    robot = solver.robot
    for _ in range(count):
        q = stretched(robot, rng)
        near = solver.solve(target_at(robot, q, 5e-7), closest=False).raise_for_status()
        assert near.position_error <= TOLERANCE
        assert near.orientation_error <= TOLERANCE
        beyond = solver.solve(target_at(robot, q, 2e-6), closest=False)
        assert beyond.status is Status.UNREACHABLE


def test_joints_on_their_limits_are_members_too(solver: IKSolver, rng: np.random.Generator) -> None:
    robot = solver.robot
    for number in range(8):
        q = stretched(robot, rng)
        q[1] = (robot.lower, robot.upper)[number % 2][1]
        assert solver.solve(target_at(robot, q), closest=False).success


def test_a_joint_that_comes_to_its_limit_and_hardly_moves_there_is_within_it() -> None:
    """Its angle goes past the limit with the third power of the parameter: 1e-13 rad after 1e-4."""
    solver = IKSolver(jacokin.load_robot("gen3_lite"), collision="ignore")
    q = np.array([0.0, 0.0, -0.5 * math.pi, -2.6, 0.5 * math.pi, 0.0])
    target = FreeAxis(solver.robot.forward_kinematics(q), axis=(0.0, 1.0, 0.0))
    nearest = solver.solve_all(target).nearest(q)
    assert nearest is not None
    np.testing.assert_allclose(nearest, q, atol=1e-6)


@pytest.mark.parametrize("q", [(2.923, 4.108, 1.533, 0.283, 0.0, -2.816), (-2.603, 1.92, 4.835, 0.516, 0.0, -0.42)])
def test_a_curve_that_circles_of_a_nearly_straight_wrist_lead_to_is_not_there_again(q: tuple[float, ...]) -> None:
    """Axes 4 and 6 are on one line but for 1e-10 rad: where it crosses a circle, a walk goes on along a curve."""
    solver = IKSolver(jacokin.load_robot("j2s6s300"), collision="ignore")
    target = FreeAxis(
        solver.robot.forward_kinematics(np.add(q, [0, 0, 0, 0, math.pi - 1e-10, 0])), axis=(1.0, 0.0, 0.0)
    )
    assert solver.solve_all(target).branches <= 16


def test_the_only_curve_may_lie_between_two_slices(rng: np.random.Generator) -> None:
    robot = jacokin.load_robot("j2s6s300")
    solver = IKSolver(robot, collision="ignore")
    for _ in range(12):
        q = stretched(robot, rng)
        q[4] = math.pi + rng.choice([-1.0, 1.0]) * rng.uniform(0.002, 0.03)  # within reach for twice this angle at most
        target = FreeAxis(robot.forward_kinematics(q), axis=(1.0, 0.0, 0.0))
        family = solver.solve_all(target)
        assert len(family)
        assert solver.solve(target, closest=False).success


def test_curves_along_which_the_parameter_hardly_changes_are_found(tmp_path: Path) -> None:
    """No pair of roots comes to the real axis between two slices: the equation changes its sign all round instead."""
    robot = load_arm("xarm7", tmp_path)
    target = robot.forward_kinematics([0.0, 1.573, 0.002, -0.006, 4.71, -1.573, 4.713])
    everything = IKSolver(robot, collision="ignore").solve_all(target)
    assert everything.complete
    assert everything.branches == 16  # four of them are two curves that go all round within 5e-3 rad of joint 7


@pytest.mark.parametrize("turned", [0.0, math.pi])
def test_curves_along_which_the_parameter_stands_still_are_in_the_set_or_in_doubt(
    tmp_path: Path, rng: np.random.Generator, turned: float
) -> None:
    """Two pairs of parallel axes, parallel to each other: four joints move, where no root tells of it beside."""
    for _ in range(3):
        a, d = rng.uniform(0.1, 0.5, (2, 6))
        placements: list[Placement] = [
            ((a[j], 0.0, d[j]), (turn, 0.0, 0.0)) for j, turn in enumerate((0.0, 0.0, -HALF, 2.0 * HALF, HALF, 0.0))
        ]
        robot = load_placed("pairs", [*placements, ((0.1, -0.1, 0.1), (0.0, 0.0, 0.0))], [None] * 6, tmp_path)
        solver = IKSolver(robot, collision="ignore")
        for _ in range(5):
            q = robot.sample(rng)
            q[3] = q[2] + turned
            family = solver.solve_all(FreeAxis(robot.forward_kinematics(q), axis=rng.normal(size=3)))
            own = family.nearest(q)
            assert not family.complete or (own is not None and np.abs(wrap_to_pi(own - q)).max() < 1e-6)


@pytest.mark.one_quick
@pytest.mark.parametrize(("coaxial", "parameter"), [((1, 0), "joint_1"), ((6, 5), "joint_7")])
def test_the_parameter_is_a_joint_that_moves_along_the_curves(
    tmp_path: Path, coaxial: tuple[int, int], parameter: str, rng: np.random.Generator
) -> None:
    """Joints at one end that turn about nearly the same axis turn against each other; the other end stands still."""
    placements = list(XARM7)
    placements[coaxial[0]] = (1e-3, 0.0, 0.2), (0.0, 1e-3, 0.0)
    placements[coaxial[1]] = (0.1, 0.0, 0.1), (-1.2, 0.3, 0.0)
    robot = load_placed("coaxial", placements, [None] * 7, tmp_path)
    solver = IKSolver(robot, collision="ignore")
    assert solver.parameter == parameter
    for q in robot.sample(rng, 5):
        everything = solver.solve_all(robot.forward_kinematics(q))
        near = min(float(np.abs(wrap_to_pi(interval.nearest(q) - q)).max()) for interval in everything.intervals)
        assert near < 1e-6


def test_without_a_joint_that_moves_along_the_curves_there_are_none(tmp_path: Path) -> None:
    """Joints 4 and 5 turn about the same axis but for 1e-6 m, so the first and the last joint stand still."""
    placements = list(XARM7)
    placements[4] = (1e-6, 0.0, 0.2), (0.0, 0.0, 0.0)
    robot = load_placed("coaxial", placements, [None] * 7, tmp_path)
    solver = IKSolver(robot, collision="ignore")
    assert solver.dimension() is None
    q = np.full(7, 0.3)
    assert np.abs(solver.solve(robot.forward_kinematics(q), seed=q).raise_for_status().q - q).max() < 1e-6


@pytest.mark.parametrize("count", [8, pytest.param(20, marks=pytest.mark.slow)])
@pytest.mark.parametrize("several", [1, 3, 6])
def test_the_end_of_a_range_may_be_the_only_member(several: int, count: int, rng: np.random.Generator) -> None:
    """Some joints are on the limits that they pass as the tool turns on."""
    for number in range(count):
        name = ("j2n6s300", "j2s6s300")[number % 2]
        free = jacokin.load_robot(name)
        q, axis = free.sample(rng), rng.normal(size=3)
        T, axis = free.forward_kinematics(q), axis / np.linalg.norm(axis)
        rates = np.linalg.solve(free.jacobian(q), np.append(np.zeros(3), T.rotation @ axis))
        lower, upper = q - rng.uniform(0.05, 0.4, 6), q + rng.uniform(0.05, 0.4, 6)
        for joint in rng.permutation(6)[:several]:
            (upper if rates[joint] > 0.0 else lower)[joint] = q[joint]
        limits = {f"joint_{j + 1}": (float(lower[j]), float(upper[j])) for j in range(6)}
        target = FreeAxis(T, axis=axis, range=(0.0, 0.5))
        family = IKSolver(jacokin.load_robot(name, limits=limits), collision="ignore").solve_all(target, seed=q)
        nearest = family.nearest(q)
        assert nearest is not None
        np.testing.assert_allclose(nearest, q, atol=1e-6)
