"""Solvers and results that are shared between threads, copied and pickled, and arguments at the extremes."""

from __future__ import annotations

import copy
import pickle
import textwrap
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import jacokin
from jacokin import IKSolver, Robot, Status
from jacokin.errors import InvalidInputError
from jacokin.ik import Box, Scene
from tests.programs import python


def test_one_search_for_the_closest_configuration_serves_many_threads(robot: Robot) -> None:
    solver = IKSolver(robot)
    targets = [jacokin.pose([1.0 + 0.1 * index, 0.2, 0.3], down=True) for index in range(8)]
    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(solver.solve, targets))
    for one, other in zip(map(IKSolver(robot).solve, targets), together, strict=True):
        np.testing.assert_array_equal(one.q, other.q)


@pytest.mark.parametrize("options", [{}, {"collision": "reject"}, {"method": "qp"}])
def test_one_solver_serves_many_threads(robot: Robot, rng: np.random.Generator, options: dict[str, str]) -> None:
    solver = IKSolver(robot, **options)  # type: ignore[arg-type]  # one option at a time
    targets = [robot.forward_kinematics(q) for q in robot.sample(rng, 24)]
    alone = [solver.solve(target) for target in targets]
    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(solver.solve, targets))
    for one, other in zip(alone, together, strict=True):
        np.testing.assert_array_equal(one.q, other.q)
        assert (one.status, one.iterations, one.restarts) == (other.status, other.iterations, other.restarts)


FORKING = """
    import os, sys
    from concurrent.futures import ThreadPoolExecutor
    import numpy as np
    import jacokin

    robot = jacokin.load_robot()
    reachable = robot.forward_kinematics(robot.home)
    wanted = [(jacokin.IKSolver(robot), reachable), (jacokin.IKSolver(robot), jacokin.pose([1.5, 0.0, 0.3])),
              (jacokin.IKSolver(robot, method="qp"), reachable)]
    solve = lambda pair: pair[0].solve(pair[1], seed=robot.home + 0.3).q
    with ThreadPoolExecutor(3) as pool:
        expected = list(pool.map(solve, wanted))
    children = []
    for _ in range(2):
        child = os.fork()
        if child == 0:
            same = all(np.array_equal(solve(pair), q) for pair, q in zip(wanted, expected))
            os._exit(0 if same else 1)
        children.append(child)
    sys.exit(max(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) for child in children))
"""


@pytest.mark.slow
def test_forked_processes_solve_with_the_solvers_of_their_parent() -> None:
    python("-W", "ignore::DeprecationWarning", "-c", textwrap.dedent(FORKING), timeout=120.0)


def test_copies_of_results_stay_read_only(robot: Robot) -> None:
    solver = IKSolver(robot)
    target = robot.forward_kinematics(robot.home)
    result, branches, batch = solver.solve(target), solver.solve_all(target), solver.solve_batch([target])
    for original in (result, branches, batch):
        for other in (pickle.loads(pickle.dumps(original)), copy.deepcopy(original)):
            np.testing.assert_array_equal(other.q, original.q)
            assert not other.q.flags.writeable
    for array in (branches.within_limits, branches.margin, branches.distance, branches.q_within_limits, batch.success):
        assert not array.flags.writeable
    with pytest.raises(AttributeError):
        result.status = Status.OK  # type: ignore[misc]  # what a user might try


def test_a_solver_does_not_change(robot: Robot) -> None:
    solver = IKSolver(robot, tool=jacokin.pose([0, 0, 0.1]))
    assert solver.tool is not None
    solver.tool.translation = np.array([0.0, 0.0, 0.5])
    np.testing.assert_array_equal(solver.tool.translation, [0.0, 0.0, 0.1])
    for name in ("tool", "frame", "method", "robot"):
        with pytest.raises(AttributeError):
            setattr(solver, name, None)


def test_another_tool_is_all_that_differs(robot: Robot) -> None:
    scene = Scene([Box("box", [0.1, 0.1, 0.1], [0.5, 0.0, 0.1])])
    solver = IKSolver(robot, scene=scene, clearance=0.01, orientation_tolerance=1e-5)
    tool = jacokin.pose([0.02, 0.0, 0.1], rpy=[0.3, 0.0, 0.5])
    other = solver.with_tool(tool)
    assert other.verifier.options == solver.verifier.options
    assert (other.robot, other.frame) == (solver.robot, solver.frame)
    assert other.tool is not None
    np.testing.assert_array_equal(other.tool.homogeneous, tool.homogeneous)
    target = jacokin.pose([0.3, -0.3, 0.3], down=True)
    result = other.solve(target)
    assert result.success, result.message
    reached = robot.forward_kinematics(result.q) * tool
    np.testing.assert_allclose(reached.homogeneous, target.homogeneous, atol=1e-6)
    assert solver.tool is None
    assert other.with_tool(None).tool is None
    with pytest.raises(InvalidInputError, match="tool must be"):
        solver.with_tool([0.0, 0.0, 0.1])


def test_seeds_of_limited_joints_any_number_of_turns_away(robot: Robot) -> None:
    solver = IKSolver(robot)
    target = robot.forward_kinematics(robot.home)
    branch = solver.solve_all(target).q_within_limits[-1]
    for turns in (-3, -1, 2, 40, 1000):
        seed = branch + 2.0 * np.pi * turns
        result = solver.solve(target, seed).raise_for_status()
        assert "joint_2, joint_3" in result.message
        np.testing.assert_allclose(result.q, np.where(robot.unlimited, seed, branch), atol=1e-6)
        np.testing.assert_array_equal(solver.solve_batch([target], [seed]).q[0], result.q)


def test_seeds_of_any_memory_layout(robot: Robot) -> None:
    solver = IKSolver(robot)
    target = robot.forward_kinematics(robot.home)
    columns = np.tile(robot.home[:, None], (1, 3))
    for seed in (columns[:, 1], robot.home[::-1][::-1], robot.home.astype(np.float32), list(robot.home)):
        np.testing.assert_allclose(solver.solve(target, seed).q, robot.home, atol=1e-6)
    fortran = np.asfortranarray(target.homogeneous)
    np.testing.assert_allclose(solver.solve(fortran, robot.home).q, robot.home, atol=1e-6)


def test_tolerances_below_rounding_are_no_limit_violation(robot: Robot) -> None:
    result = IKSolver(robot, position_tolerance=1e-19, orientation_tolerance=1e-19).solve(
        robot.forward_kinematics(robot.home + 0.1), closest=False
    )
    assert result.status is Status.NO_CONVERGENCE
    assert "more than the tolerances allow" in result.message


@pytest.mark.parametrize("distance", [1e3, 1e100, 1e300])
def test_targets_in_the_wrong_unit(robot: Robot, distance: float) -> None:
    for target in ([distance, 0.0, 0.3], jacokin.pose([distance, 0.0, 0.3], down=True)):
        result = IKSolver(robot).solve(target)
        assert result.status is Status.UNREACHABLE
        assert IKSolver(robot).solve_batch([target], closest=False).status == (Status.UNREACHABLE,)
        assert robot.within_limits(result.q)
        # Stretched towards it.
        assert robot.forward_kinematics(result.q).translation[0] > 0.5


def test_batches_keep_the_note_about_the_seed(robot: Robot) -> None:
    target = robot.forward_kinematics(robot.home)
    bad = robot.home.copy()
    bad[1] = -1.0
    far = jacokin.pose([3.0, 0.0, 0.3])
    batch = IKSolver(robot).solve_batch([target, far], [bad, robot.home], closest=False)
    assert "joint_2" in batch.message[0]
    assert "joint_2" not in batch.message[1]


def test_sets_are_pickled(robot: Robot) -> None:
    pose = jacokin.pose([0.3, -0.2, 0.4], down=True)
    for target in (pose, jacokin.FreeAxis(pose, axis=(0.0, 0.0, 1.0))):
        found = IKSolver(robot).solve_all(target)
        copied = pickle.loads(pickle.dumps(found))
        assert repr(copied) == repr(found)
        assert (len(copied), copied.branches, copied.complete) == (len(found), found.branches, found.complete)
        for name in ("q", "margin", "within_limits", "distance"):
            np.testing.assert_array_equal(getattr(copied, name), getattr(found, name))
        np.testing.assert_array_equal(copied.sample(20), found.sample(20))
        np.testing.assert_array_equal(copied.nearest(robot.home), found.nearest(robot.home))
        np.testing.assert_array_equal(copied.best("margin"), found.best("margin"))


def test_a_set_keeps_the_seed_that_it_was_solved_with(robot: Robot) -> None:
    pose = jacokin.pose([0.3, -0.2, 0.4], down=True)
    for target in (pose, jacokin.FreeAxis(pose, axis=(1.0, 0.0, 0.0))):
        seed = robot.home + 0.1
        found = IKSolver(robot).solve_all(target, seed)
        before = found.nearest(), found.best("margin")
        seed += 1.0
        np.testing.assert_array_equal(found.nearest(), before[0])
        np.testing.assert_array_equal(found.best("margin"), before[1])
