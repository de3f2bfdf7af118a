"""Limited joints with more than a turn of room: every 2 pi copy within the limits is a configuration of its own."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable

import numpy as np
import pytest

import jacokin
from jacokin import FreeAxis, IKSolver, Robot
from jacokin.arrays import Array
from jacokin.ik import SolutionSet

TURN = 2.0 * math.pi
WIDE = {"joint_1": (-7.0, 7.0), "joint_2": (0.0, TURN), "joint_4": (-5.0, 4.0)}
SAMPLES = 800
#: Members of an interval among which to look for extrema of a joint.
COARSE = 200


def lopsided(q: Array) -> float:
    """A cost that tells copies apart."""
    return float(abs(q[0] - 5.0) + 0.3 * abs(q[1] - 1.0) + 0.2 * abs(q[3] + 4.0))


def copies(rows: Array, robot: Robot, seed: Array) -> Array:
    """All copies of configurations within the limits; unlimited joints nearest to the seed."""
    rows = np.where(robot.unlimited, rows + TURN * np.round((seed - rows) / TURN), rows)
    limited = np.flatnonzero(~robot.unlimited)
    found = [rows]
    for turns in itertools.product((-2, -1, 0, 1, 2), repeat=len(limited)):
        moved = rows.copy()
        moved[:, limited] += TURN * np.array(turns)
        found.append(moved)
    every = np.vstack(found)
    inside = (every >= robot.lower - 1e-9) & (every <= robot.upper + 1e-9)
    return np.clip(every[inside.all(axis=1)], robot.lower, robot.upper)


def costs(robot: Robot, seed: Array) -> dict[str, Callable[[Array], Array]]:
    return {
        "nearest": lambda rows: np.linalg.norm(rows - seed, axis=1),
        "margin": lambda rows: -np.minimum(rows - robot.lower, robot.upper - rows).min(axis=1),
        "function": lambda rows: np.array([lopsided(q) for q in rows]),
    }


@pytest.mark.parametrize("count", [6, pytest.param(15, marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", ["j2n6s300", "j2s6s300"])
def test_a_pose_is_solved_in_the_best_copy(name: str, count: int, rng: np.random.Generator) -> None:
    robot = jacokin.load_robot(name, limits=WIDE)
    solver = IKSolver(robot, collision="ignore")
    for _ in range(count):
        seed = robot.sample(rng)
        target = robot.forward_kinematics(robot.sample(rng))
        branches = solver.solve_all(target, seed)
        assert isinstance(branches, SolutionSet)
        every = copies(branches.q, robot, seed)
        for prefer, cost in costs(robot, seed).items():
            result = solver.solve(target, seed, prefer=lopsided if prefer == "function" else prefer)
            batch = solver.solve_batch([target], seed, prefer=lopsided if prefer == "function" else prefer)
            np.testing.assert_array_equal(batch.q[0], result.q)
            assert cost(result.q[np.newaxis])[0] <= cost(every).min() + 1e-6, prefer


@pytest.mark.one_quick
@pytest.mark.parametrize("count", [2, pytest.param(6, marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", ["j2n6s300", "j2s6s300", "j2s7s300"])
def test_a_member_is_chosen_in_the_best_copy(name: str, count: int, rng: np.random.Generator) -> None:
    robot = jacokin.load_robot(name, limits=WIDE)
    solver = IKSolver(robot, collision="ignore")
    for number in range(count):
        seed, q = robot.sample(rng, 2)
        T = robot.forward_kinematics(q)
        axis = (0.0, 0.0, 1.0) if number % 3 == 2 else rng.normal(size=3)
        target = T if robot.dof == 7 else FreeAxis(T, axis=axis)
        family = solver.solve_all(target, seed)
        every = copies(family.sample(SAMPLES), robot, seed)
        for prefer, cost in costs(robot, seed).items():
            result = solver.solve(target, seed, prefer=lopsided if prefer == "function" else prefer)
            assert result.success
            assert cost(result.q[np.newaxis])[0] <= cost(every).min() + 1e-6, prefer
        nearest = family.nearest(seed)
        assert nearest is not None
        assert np.linalg.norm(nearest - seed) <= np.linalg.norm(every - seed, axis=1).min() + 1e-6


def passing_its_limit(
    name: str, joint: int, depth: float, rng: np.random.Generator
) -> tuple[Robot, Array | FreeAxis, Array]:
    """An arm with more than a turn of room in a joint, which passes its upper limit for a short way along a curve.

    Returns the arm, a target, and the members (2, dof) before and after which the joint is past it, by no more than a
    depth [rad].
    """
    robot = jacokin.load_robot(name)
    solver = IKSolver(robot, collision="ignore")
    while True:
        T = robot.forward_kinematics(robot.sample(rng))
        target: Array | FreeAxis = T.homogeneous if robot.dof == 7 else FreeAxis(T, axis=rng.normal(size=3))
        for interval in solver.solve_all(target).intervals:
            p, rows = interval.sample(COARSE)
            angle = np.unwrap(rows[:, joint])
            for top in 1 + np.flatnonzero((angle[1:-1] > angle[:-2]) & (angle[1:-1] > angle[2:])):
                q = rows[top]
                below = np.flatnonzero(angle < angle[top] - depth)
                before, after = below[below < top], below[below > top]
                if not (before.size and after.size):
                    continue
                edges = []
                for inside in (p[before[-1]], p[after[0]]):
                    outside = p[top]
                    for _ in range(60):
                        middle = 0.5 * (inside + outside)
                        is_past = interval.at(middle, seed=q)[joint] > q[joint] - depth
                        inside, outside = (inside, middle) if is_past else (middle, outside)
                    edges.append(interval.at(inside, seed=q))
                upper = max(edge[joint] for edge in edges)
                robot = jacokin.load_robot(name, limits={robot.joint_names[joint]: (upper - 7.0, upper)})
                return robot, target, np.array(edges)


@pytest.mark.one_quick
@pytest.mark.parametrize("depth", [1e-5, *(pytest.param(depth, marks=pytest.mark.slow) for depth in (1e-7, 1e-3))])
@pytest.mark.parametrize(("name", "joint"), [("j2n6s300", 3), ("j2n6s300", 5), ("j2s7s300", 4), ("j2s7s300", 6)])
def test_members_next_to_where_a_joint_passes_its_limit_are_found(
    name: str, joint: int, depth: float, rng: np.random.Generator
) -> None:
    for _ in range(3):
        robot, target, edges = passing_its_limit(name, joint, depth, rng)
        family = IKSolver(robot, collision="ignore").solve_all(target)
        for q in edges:
            nearest = family.nearest(q)
            assert nearest is not None
            assert robot.within_limits(nearest)
            np.testing.assert_allclose(nearest, q, rtol=0.0, atol=1e-6)
