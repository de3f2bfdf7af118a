"""`prefer=` for poses and families, batches with free axes, and targets in the tracker's words."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable

import numpy as np
import pytest

import jacokin
from jacokin import FreeAxis, IKSolver, Robot
from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.ik.preferences import by_distance
from jacokin.ik.solutions.curve_set import CurveSet
from jacokin.motion import AxisTarget, OrientationTarget, PoseTarget, PositionTarget


@pytest.fixture(scope="module")
def solver() -> IKSolver:
    return IKSolver(jacokin.load_robot(), collision="ignore")


def margin(solver: IKSolver, q: Array) -> float:
    return float(np.minimum(q - solver.robot.lower, solver.robot.upper - q).min())


def test_the_best_branch_of_a_pose(solver: IKSolver, rng: np.random.Generator) -> None:
    robot = solver.robot
    for q in robot.sample(rng, 20):
        target = robot.forward_kinematics(q)
        within = solver.solve_all(target).q_within_limits
        assert margin(solver, solver.solve(target, prefer="margin").q) == max(margin(solver, row) for row in within)
        best = solver.solve(target, prefer="manipulability").q
        assert robot.manipulability(best) >= max(robot.manipulability(row) for row in within) - 1e-12
        own = solver.solve(target, prefer=lambda row: float(row[1])).q
        assert own[1] == min(row[1] for row in within)


def test_equal_branches_are_taken_by_distance(solver: IKSolver, rng: np.random.Generator) -> None:
    for q in solver.robot.sample(rng, 5):
        target = solver.robot.forward_kinematics(q)
        np.testing.assert_array_equal(solver.solve(target, prefer=lambda _: 1.0).q, solver.solve(target).q)


def test_the_best_member_of_a_family(solver: IKSolver, rng: np.random.Generator) -> None:
    robot = solver.robot
    for q in robot.sample(rng, 3):
        target = FreeAxis(robot.forward_kinematics(q), axis=(1.0, 0.0, 0.0))
        family = solver.solve_all(target)
        rows = family.sample(500)
        widest = margin(solver, solver.solve(target, prefer="margin").q)
        assert widest >= max(margin(solver, row) for row in rows) - 1e-9
        assert widest == pytest.approx(max(interval.margin for interval in family.intervals))
        best = robot.manipulability(solver.solve(target, prefer="manipulability").q)
        assert best >= max(robot.manipulability(row) for row in rows) - 1e-8


def test_members_of_equal_margin_are_taken_by_distance(solver: IKSolver) -> None:
    """About the last axis, joint 6 alone turns, which has no limits."""
    robot = solver.robot
    target = FreeAxis(robot.forward_kinematics(robot.home), axis=(0.0, 0.0, 1.0))
    result = solver.solve(target, prefer="margin", seed=robot.home)
    assert abs(math.remainder(result.q[5] - robot.home[5], 2.0 * math.pi)) < 1e-4 or result.q[0] != robot.home[0]


def test_without_limits_all_members_have_the_same_margin() -> None:
    robot = jacokin.load_robot(limits=dict.fromkeys(("joint_2", "joint_3"), (-np.inf, np.inf)))
    free = IKSolver(robot, collision="ignore")
    target = FreeAxis(robot.forward_kinematics(robot.home), axis=(1.0, 0.0, 0.0))
    found = free.solve_all(target, seed=robot.home)
    assert isinstance(found, CurveSet)
    nearest = found.nearest(robot.home)
    assert nearest is not None
    best = found.best("margin")
    assert best is not None
    for q in (free.solve(target, seed=robot.home, prefer="margin").q, best):
        np.testing.assert_allclose(q, nearest, atol=1e-6)
    assert {interval.margin for interval in found.intervals} == {math.inf}


def test_a_function_chooses_among_copies_around_the_seed() -> None:
    """Six joints of 400 rad have a hundred billion copies."""
    robot = jacokin.load_robot(limits={f"joint_{number}": (-200.0, 200.0) for number in range(1, 7)})
    wide = IKSolver(robot, collision="ignore")
    target = robot.forward_kinematics(robot.home)
    result = wide.solve(target, seed=robot.home, prefer=lambda q: float(np.abs(q - robot.home).max()))
    np.testing.assert_allclose(result.q, robot.home, atol=1e-9)


def test_batches_prefer_too(solver: IKSolver, rng: np.random.Generator) -> None:
    targets = [solver.robot.forward_kinematics(q) for q in solver.robot.sample(rng, 4)]
    batch = solver.solve_batch(targets, prefer="margin")
    for row, target in zip(batch.q, targets, strict=True):
        np.testing.assert_array_equal(row, solver.solve(target, prefer="margin").q)
    with pytest.raises(InvalidInputError, match="prefer must be picklable"):
        solver.solve_batch(targets, prefer=lambda q: float(q[0]), workers=2)


def test_batches_take_free_axes_among_poses(solver: IKSolver, rng: np.random.Generator) -> None:
    robot = solver.robot
    poses = [robot.forward_kinematics(q) for q in robot.sample(rng, 3)]
    free = FreeAxis(poses[1], axis=(1.0, 0.0, 0.0))
    batch = solver.solve_batch([poses[0], free, poses[2].translation])
    assert batch.success.all()
    assert batch.parameter is not None
    assert np.isnan(batch.parameter).tolist() == [True, False, True]
    np.testing.assert_array_equal(batch.q[1], solver.solve(free).q)
    np.testing.assert_array_equal(batch.q[0], solver.solve(poses[0]).q)


def test_a_position_and_an_axis_are_a_free_axis(solver: IKSolver) -> None:
    robot = solver.robot
    parts = [PositionTarget((0.3, 0.2, 0.3)), AxisTarget((0.0, 0.0, -1.0))]
    result = solver.solve(parts).raise_for_status()
    reached = robot.forward_kinematics(result.q)
    np.testing.assert_allclose(reached.translation, (0.3, 0.2, 0.3), atol=1e-9)
    np.testing.assert_allclose(reached.rotation[:, 2], (0.0, 0.0, -1.0), atol=1e-9)
    np.testing.assert_allclose(result.q, solver.solve(jacokin.pose((0.3, 0.2, 0.3), approach=(0, 0, -1))).q, atol=1e-6)
    across = solver.solve([PositionTarget((0.3, 0.2, 0.3)), AxisTarget((0.0, 0.0, 1.0), (1.0, 0.0, 0.0))])
    np.testing.assert_allclose(robot.forward_kinematics(across.q).rotation[:, 0], (0.0, 0.0, 1.0), atol=1e-9)


def test_poses_in_the_words_of_the_tracker(solver: IKSolver) -> None:
    target = solver.robot.forward_kinematics(solver.robot.home)
    expected = solver.solve(target).q
    np.testing.assert_array_equal(solver.solve(PoseTarget(target)).q, expected)
    both = [PositionTarget(target.translation), OrientationTarget(target.rotation)]
    np.testing.assert_allclose(solver.solve(both).q, expected, atol=1e-12)


def cramped(solver: IKSolver, q: Array) -> float:
    return -margin(solver, q)


def stiffness(robot: Robot, q: Array) -> float:
    return -float(robot.manipulability(q))


def wave(q: Array) -> float:
    """A cost with several minima as a wrist turns."""
    return float(np.sin(3.0 * q[-1]) + 0.5 * np.cos(2.0 * q[-3] - 0.3) + 0.01 * (q[-3] - 1.0) ** 2)


@pytest.mark.one_quick
@pytest.mark.parametrize("count", [2, pytest.param(8, marks=pytest.mark.slow)])
@pytest.mark.parametrize("limited", [False, True])
@pytest.mark.parametrize(("name", "turns"), [("j2s7s300", False), ("j2s6s300", False), ("j2s6s300", True)])
def test_the_best_member_of_a_straight_wrist_is_found(
    name: str, turns: bool, limited: bool, count: int, rng: np.random.Generator
) -> None:
    """The joints beside the middle one turn against each other, of a pose and of a tool that turns about an axis."""
    for _ in range(count):
        robot = jacokin.load_robot(name)
        q, seed = robot.sample(rng, 2)
        q[-2] = np.pi
        room = rng.uniform(0.3, 1.5, (2, 2))
        if limited:
            limits = {
                robot.joint_names[j]: (float(q[j] - low), float(q[j] + high))
                for j, (low, high) in zip((-3, -1), room, strict=True)
            }
            robot = jacokin.load_robot(name, limits=limits)
        T = robot.forward_kinematics(q)
        turn = np.linspace(-np.pi, np.pi, 4001)
        ways = np.zeros((2, robot.dof))
        ways[:, -3], ways[:, -1] = 1.0, (1.0, -1.0)
        way = next(way for way in ways if robot.forward_kinematics(q + 0.1 * way).isApprox(T, 1e-9))
        dense = q + turn[:, np.newaxis] * way
        dense = np.array([each for each in dense if robot.within_limits(each)])
        target = FreeAxis(T, axis=rng.normal(size=3)) if turns else T
        solver = IKSolver(robot, collision="ignore")
        costs: dict[str, Callable[[Array], float]] = {
            "margin": functools.partial(cramped, solver),
            "manipulability": functools.partial(stiffness, robot),
            "function": wave,
        }
        for prefer, cost in costs.items():
            result = solver.solve(target, seed=seed, prefer=wave if prefer == "function" else prefer)
            copies = np.where(robot.unlimited, dense + 2.0 * np.pi * np.round((seed - dense) / (2.0 * np.pi)), dense)
            assert cost(result.q) <= min(map(cost, copies[:: 4 if prefer == "manipulability" else 1])) + 1e-6, prefer


def test_samples_of_a_straight_wrist_reach_from_limit_to_limit(rng: np.random.Generator) -> None:
    robot = jacokin.load_robot("j2s7s300")
    q = robot.sample(rng)
    q[5] = np.pi
    robot = jacokin.load_robot("j2s7s300", limits={"joint_7": (float(q[6] - 0.5), float(q[6] + 0.4))})
    family = IKSolver(robot, collision="ignore").solve_all(robot.forward_kinematics(q), seed=q)
    wrist = [interval for interval in family.intervals if interval.start == interval.stop]
    assert wrist
    assert isinstance(family, CurveSet)
    everywhere = family.spread(0.3)[1]
    for interval in wrist:
        rows = interval.sample(9)[1]
        turned = np.mod(rows[:, 6] - q[6] + np.pi, 2.0 * np.pi) - np.pi
        np.testing.assert_allclose((turned.min(), turned.max()), (-0.5, 0.4), atol=1e-6)
        for end in rows[[0, -1]]:
            away = np.mod(everywhere - end + np.pi, 2.0 * np.pi) - np.pi
            assert np.abs(away).max(axis=1).min() < 1e-6


def test_members_at_steps_of_the_parameter_are_nearly_members(robot: Robot, rng: np.random.Generator) -> None:
    axis = FreeAxis(robot.forward_kinematics(robot.sample(rng)), axis=(1.0, 0.0, 0.0))
    family = IKSolver(robot, collision="ignore").solve_all(axis)
    assert isinstance(family, CurveSet)
    parameters, rows = family.spread(0.3)
    assert len(rows) > len(family.intervals) > 1
    for p, q in zip(parameters.tolist(), rows, strict=True):
        members = [interval.at(p) for interval in family.intervals if interval.contains(p)]
        away = [np.abs(np.mod(q - member + np.pi, 2.0 * np.pi) - np.pi).max() for member in members]
        assert min(away) < 5e-3
    for interval in family.intervals:  # every multiple of the step that is inside
        inside = 0.3 * np.arange(np.ceil(interval.start / 0.3), np.floor(interval.stop / 0.3) + 1.0)
        assert all(np.abs(parameters - p).min() < 1e-9 for p in inside)


@pytest.mark.parametrize("name", ["j2n6s300", "j2s7s300", "gen3"])
@pytest.mark.one_quick("name")
def test_the_least_member_of_each_interval_and_others_all_along_it(name: str, rng: np.random.Generator) -> None:
    robot = jacokin.load_robot(name)
    seed, pose = robot.home, robot.forward_kinematics(robot.sample(rng))
    target = FreeAxis(pose, axis=(1.0, 0.0, 0.0), range=(-2.0, 2.0)) if robot.dof == 6 else pose
    curves = IKSolver(robot, collision="ignore").solve_all(target, seed=seed)
    assert isinstance(curves, CurveSet)
    least, rows = curves.least_and_others(by_distance(seed).of)
    assert len(rows) == len(curves.intervals) > 1
    for q, interval in zip(rows, curves.intervals, strict=True):
        assert np.linalg.norm(q - seed) <= np.linalg.norm(interval.nearest(seed) - seed) + 0.1
    parameters, rows = curves.least_and_others(by_distance(seed).of, 0.5)
    assert len(rows) > 3 * len(curves.intervals)
    for p, q in zip([*least, *parameters], [*curves.least_and_others(by_distance(seed).of)[1], *rows], strict=True):
        assert robot.within_limits(q)
        wanted = target.at(p) if isinstance(target, FreeAxis) else target
        assert np.abs(robot.forward_kinematics(q).homogeneous - wanted.homogeneous).max() < 2e-9
    for interval in curves.intervals:
        for member in interval.sample(40)[1]:
            away = np.abs(np.mod(rows - member + np.pi, 2.0 * np.pi) - np.pi)
            assert np.linalg.norm(away, axis=1).min() < 0.5
