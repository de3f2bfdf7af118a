"""Targets a little beyond a fold of the arm: a configuration meets them within the tolerances, whatever is asked for.

A fold is a configuration where the tool cannot move in one direction, the normal; to second order it can, to one side
of the fold only. Beyond it, no configuration meets a target exactly, and the fold itself misses it by the distance.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest

import jacokin
from jacokin import FreeAxis, IKSolver, Robot, Status
from jacokin.arrays import Array

NEAREST, FARTHEST = 1e-11, 9e-7  # [m] and [rad] beyond the fold; a success may miss its target by 1e-6
RIGHT = 0.5 * np.pi
Made = tuple[Array, pin.SE3 | FreeAxis]


def normal_at(robot: Robot, q: Array) -> Array | None:
    """The direction (6,) in which the tool cannot move, towards the side that it does not reach; None at no fold."""
    ways, sizes, moves = np.linalg.svd(robot.jacobian(q))
    if sizes[5] > 1e-9 or sizes[4] < 1e-2:
        return None
    normal, move, h = ways[:, 5], moves[5], 1e-5
    bend = normal @ (robot.jacobian(q + h * move) - robot.jacobian(q - h * move)) @ move / (2.0 * h)
    return None if abs(bend) < 1e-2 else -np.sign(bend) * normal


def fold_of_six(robot: Robot, rng: np.random.Generator) -> tuple[Array, Array]:
    """A fold between two random configurations, and its normal."""
    while True:
        a, b = robot.sample(rng), robot.sample(rng)
        sides = [np.linalg.det(robot.jacobian(a + share * (b - a))) > 0.0 for share in np.linspace(0.0, 1.0, 9)]
        if all(sides) or not any(sides):
            continue
        first = next(i for i in range(8) if sides[i] != sides[i + 1])
        low, high = first / 8, (first + 1) / 8
        for _ in range(60):
            middle = 0.5 * (low + high)
            same = (np.linalg.det(robot.jacobian(a + middle * (b - a))) > 0.0) == sides[first]
            low, high = (middle, high) if same else (low, middle)
        q = a + low * (b - a)
        normal = normal_at(robot, q)
        if normal is not None:
            return q, normal


def fold_of_seven(robot: Robot, rng: np.random.Generator) -> tuple[Array, Array]:
    """A configuration with some joints at right angles that is a fold, and its normal."""
    while True:
        q = robot.sample(rng)
        some = rng.random(7) < 0.6
        q[some] = RIGHT * np.round(q[some] / RIGHT)
        normal = normal_at(robot, q) if robot.within_limits(q) else None
        if normal is not None:
            return q, normal


def beyond(robot: Robot, q: Array, normal: Array, rng: np.random.Generator, by: float | None) -> pin.SE3:
    """The pose of the tool moved beyond the fold, by a random distance where none is given."""
    T = robot.forward_kinematics(q)
    way = normal * (np.exp(rng.uniform(np.log(NEAREST), np.log(FARTHEST))) if by is None else by)
    return pin.SE3(pin.exp3(way[3:]) @ T.rotation, T.translation + way[:3])


def plain(robot: Robot, rng: np.random.Generator, by: float | None = None) -> Made:
    q, normal = fold_of_six(robot, rng)
    return q, beyond(robot, q, normal, rng, by)


def with_free_axis(robot: Robot, rng: np.random.Generator, by: float | None = None) -> Made:
    """About an axis that does not help: square to the moment that the arm bears without its motors."""
    q, normal = fold_of_six(robot, rng)
    T = beyond(robot, q, normal, rng, by)
    axis = np.cross(normal[3:], rng.normal(size=3))
    angle = 0.0 if rng.random() < 0.5 else rng.uniform(-2.0, 2.0)
    axis = T.rotation.T @ (axis / np.linalg.norm(axis))
    return q, FreeAxis(pin.SE3(T.rotation @ pin.exp3(angle * axis), T.translation), axis=axis)


def of_seven(robot: Robot, rng: np.random.Generator, by: float | None = None) -> Made:
    q, normal = fold_of_seven(robot, rng)
    return q, beyond(robot, q, normal, rng, by)


def limits_around(robot: Robot, q: Array, rng: np.random.Generator) -> dict[str, tuple[float, float]]:
    """Limits that q keeps, on some of them."""
    room = np.where(rng.random((2, robot.dof)) < 0.3, 0.0, rng.uniform(0.02, 1.5, (2, robot.dof)))
    room[1] += np.where(room.sum(axis=0) == 0.0, 0.3, 0.0)
    return {
        name: (float(value - below), float(value + above))
        for name, value, below, above in zip(robot.joint_names, q, *room, strict=True)
    }


KINDS: dict[str, tuple[tuple[str, ...], Callable[..., Made]]] = {
    "plain": (("j2n6s300", "j2s6s200"), plain),
    "free axis": (("j2n6s300", "j2s6s300"), with_free_axis),
    "seven joints": (("j2s7s300",), of_seven),
}


@pytest.mark.one_quick
@pytest.mark.parametrize("count", [2, pytest.param(10, marks=pytest.mark.slow)])
@pytest.mark.parametrize("own_limits", [False, True], ids=["robot's limits", "own limits"])
@pytest.mark.parametrize("kind", KINDS)
def test_a_target_just_beyond_a_fold_is_reached(
    kind: str, own_limits: bool, count: int, rng: np.random.Generator
) -> None:
    names, make = KINDS[kind]
    for number in range(count):
        robot = jacokin.load_robot(names[number % len(names)])
        q, target = make(robot, rng)
        if own_limits:
            robot = jacokin.load_robot(robot.name, limits=limits_around(robot, q, rng))
        solver = IKSolver(robot, frame="end_effector")
        for closest in (False, True):
            result = solver.solve(target, closest=closest)
            assert result.status is Status.OK, (number, q.tolist(), result.message)
            goal = target.at(result.parameter or 0.0) if isinstance(target, FreeAxis) else target
            reached = robot.forward_kinematics(result.q)
            assert np.linalg.norm(reached.translation - goal.translation) <= 1e-6
            assert np.linalg.norm(pin.log3(reached.rotation.T @ goal.rotation)) <= 1e-6
            assert robot.within_limits(result.q)
        batch = solver.solve_batch([target], closest=False)
        assert batch.status == (Status.OK,)


@pytest.mark.parametrize("kind", KINDS)
def test_wide_tolerances_reach_as_far_beyond_a_fold(kind: str, rng: np.random.Generator) -> None:
    names, make = KINDS[kind]
    robot = jacokin.load_robot(names[0])
    wide = IKSolver(robot, frame="end_effector", position_tolerance=1e-3, orientation_tolerance=1e-3)
    for _ in range(3):
        _, target = make(robot, rng, 5e-4)
        assert wide.solve(target, closest=False).status is Status.OK


@pytest.mark.one_quick
@pytest.mark.parametrize("bent", [4e-9, 1e-7, 8e-7])
def test_a_wrist_that_is_nearly_straight_turns_within_limits_that_leave_out_its_branches(
    bent: float, rng: np.random.Generator
) -> None:
    free = jacokin.load_robot("j2s6s300")
    for _ in range(3):
        q = free.sample(rng)
        q[4] = np.pi
        turn = rng.uniform(0.1, 3.0)  # of all branches of the bent wrist
        T = free.forward_kinematics(np.add(q, (0.0, 0.0, 0.0, turn, bent, 0.0)))
        limits = {"joint_4": (q[3] - 1e-3, q[3] + 1e-3), "joint_5": (2.0, q[4])}
        solver = IKSolver(jacokin.load_robot("j2s6s300", limits=limits), frame="end_effector", collision="ignore")
        assert not any(solver.solve_all(T).within_limits)
        result = solver.solve(T, closest=False)
        assert result.status is Status.OK, (q.tolist(), result.message)
        assert solver.robot.within_limits(result.q)
        assert solver.solve_batch([T], closest=False).status == (Status.OK,)


@pytest.mark.parametrize("count", [3, pytest.param(20, marks=pytest.mark.slow)])
def test_a_target_well_beyond_a_fold_has_one_status(count: int, rng: np.random.Generator) -> None:
    robot = jacokin.load_robot("j2n6s300")
    solver = IKSolver(robot)
    for _ in range(count):
        _, target = plain(robot, rng, 2e-5)
        assert solver.solve(target, closest=False).status is solver.solve(target).status


@pytest.mark.one_quick
@pytest.mark.parametrize("count", [3, pytest.param(12, marks=pytest.mark.slow)])  # three distances in turn
@pytest.mark.parametrize("kind", ["free axis", "seven joints"])
def test_beyond_a_fold_with_own_limits_there_is_one_status(kind: str, count: int, rng: np.random.Generator) -> None:
    names, make = KINDS[kind]
    for number in range(count):
        robot = jacokin.load_robot(names[number % len(names)])
        q, target = make(robot, rng, (2e-6, 1e-4, 1e-2)[number % 3])
        robot = jacokin.load_robot(robot.name, limits=limits_around(robot, q, rng))
        solver = IKSolver(robot, frame="end_effector")
        statuses = {solver.solve(target, closest=closest).status for closest in (False, True)}
        assert statuses == set(solver.solve_batch([target], closest=False).status), (number, q.tolist())


@pytest.mark.parametrize("count", [2, pytest.param(6, marks=pytest.mark.slow)])
def test_a_position_just_out_of_reach_is_reached(count: int, rng: np.random.Generator) -> None:
    robot = jacokin.load_robot("j2n6s300")
    solver = IKSolver(robot)
    for _ in range(count):
        q, way = farthest(robot, rng)
        position = robot.forward_kinematics(q).translation + rng.uniform(1e-9, 8e-7) * way
        statuses = [solver.solve(position, closest=closest).status for closest in (False, True)]
        assert statuses == [Status.OK, Status.OK]


def farthest(robot: Robot, rng: np.random.Generator) -> tuple[Array, Array]:
    """A configuration of which the tool is as far in a direction (3,) as it gets near by, and that direction."""
    way = np.append(rng.normal(size=2), abs(rng.normal()))
    way /= np.linalg.norm(way)
    while True:
        q = robot.sample(rng)
        for _ in range(400):  # Newton's method uphill, damped, with differences of the gradient
            slope = way @ robot.jacobian(q)[:3]
            bend = np.array([way @ robot.jacobian(q + 1e-6 * unit)[:3] - slope for unit in np.eye(robot.dof)]) / 1e-6
            values, vectors = np.linalg.eigh(0.5 * (bend + bend.T))
            step = vectors @ ((slope @ vectors) / np.maximum(np.abs(values), 1e-3))
            q = np.clip(q + step * min(1.0, 0.3 / np.abs(step).max()), robot.lower, robot.upper)
            if np.abs(step).max() < 1e-9:
                break
        if np.abs(way @ robot.jacobian(q)[:3]).max() < 1e-9 and values.max() < 1e-7:
            return q, way
