"""Positions with the orientation free, on arms with a closed form: descents without MuJoCo."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

import jacokin
from jacokin import IKSolver, Robot
from jacokin.ik import local_search
from jacokin.ik.local_search import PositionDescents
from tests.programs import python

NAMES = ("j2n6s300", "j2s6s200", "j2s7s300")


@pytest.mark.one_quick
@pytest.mark.parametrize("name", NAMES)
def test_positions_are_reached_and_as_near_as_by_the_qp(
    bundled: Callable[[str], Robot], rng: np.random.Generator, name: str
) -> None:
    robot = bundled(name)
    tool = jacokin.pose([0.02, -0.03, 0.1], rpy=[0.3, 0.2, 0.1])
    solver, by_qp = IKSolver(robot, tool=tool), IKSolver(robot, tool=tool, method="qp")
    away, away_by_qp = 0.0, 0.0
    for q, seed in zip(robot.sample(rng, 30), robot.sample(rng, 30), strict=True):
        target = (robot.forward_kinematics(q) * tool).translation
        result = solver.solve(target, seed).raise_for_status()
        assert (result.method, result.qp_solver) == ("qp", "daqp")
        assert robot.within_limits(result.q)
        reached = (robot.forward_kinematics(result.q) * tool).translation
        np.testing.assert_allclose(reached, target, atol=1e-6)
        away += float(np.linalg.norm(result.q - seed))
        away_by_qp += float(np.linalg.norm(by_qp.solve(target, seed).q - seed))
    assert away < away_by_qp  # no step goes farther than it must


def test_a_seed_at_the_position_is_the_answer(robot: Robot, rng: np.random.Generator) -> None:
    for q in robot.sample(rng, 10):
        result = IKSolver(robot, collision="ignore").solve(robot.forward_kinematics(q).translation, q)
        np.testing.assert_allclose(result.q, q, atol=1e-12)


def test_positions_on_limits_and_with_narrow_ones(rng: np.random.Generator) -> None:
    robot = jacokin.load_robot(limits={"joint_1": (0.5, 0.9), "joint_4": (2.0, 2.6), "joint_6": (1.0, 1.1)})
    solver = IKSolver(robot)
    for q in robot.sample(rng, 15):
        q[[1, 2]] = np.where(rng.random(2) < 0.5, robot.lower[[1, 2]], robot.upper[[1, 2]])
        result = solver.solve(robot.forward_kinematics(q).translation).raise_for_status()
        assert robot.within_limits(result.q)


def test_positions_out_of_reach_come_with_the_closest_configuration(robot: Robot) -> None:
    result = IKSolver(robot).solve([1.5, 0.0, 0.5])
    assert result.status is jacokin.Status.UNREACHABLE
    assert result.position_error == pytest.approx(IKSolver(robot, method="qp").solve([1.5, 0.0, 0.5]).position_error)


@pytest.mark.slow
def test_a_position_waits_for_no_import() -> None:
    program = (
        "import sys, jacokin; solver = jacokin.IKSolver(jacokin.load_robot()); before = set(sys.modules);"
        "print(solver.solve([0.3, -0.2, 0.4]).success, solver.solve([1.3, -0.2, 0.4]).success);"
        "print(set(sys.modules) - before, {'mink', 'mujoco', 'qpsolvers'} & set(sys.modules))"
    )
    done = python("-c", program)
    assert done.stdout == "True False\nset() set()\n"


@pytest.mark.parametrize("name", ["j2n6s300", "j2s7s300"])
def test_members_reach_the_position(bundled: Callable[[str], Robot], rng: np.random.Generator, name: str) -> None:
    robot = bundled(name)
    for q in robot.sample(rng, 10):
        position = robot.forward_kinematics(q).translation
        rows = local_search.members(
            IKSolver(robot)._nearest_at, position, robot.forward_kinematics(robot.home).rotation, robot.home
        )
        assert 1 <= len(rows) <= local_search.ENOUGH
        for row in rows:
            np.testing.assert_allclose(robot.forward_kinematics(row).translation, position, atol=1e-9)
            assert robot.within_limits(row)
        apart = [float(np.linalg.norm(row - robot.home)) for row in rows]
        assert apart == sorted(apart)


@pytest.mark.parametrize("name", ["j2n6s300", "j2s7s300"])
def test_a_position_is_solved_from_a_member(
    bundled: Callable[[str], Robot], rng: np.random.Generator, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where descents go nowhere, the first start that is a member is the answer."""
    robot, stuck = bundled(name), lambda _self, _target, start: local_search.Descent(start, 0, False)
    monkeypatch.setattr(PositionDescents, "descend", stuck)
    for q in robot.sample(rng, 5):
        target = robot.forward_kinematics(q).translation
        result = IKSolver(robot).solve(target).raise_for_status()
        np.testing.assert_allclose(robot.forward_kinematics(result.q).translation, target, atol=1e-9)
        assert result.message.startswith("start ")
