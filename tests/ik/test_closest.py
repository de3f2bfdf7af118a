"""The closest configuration: derivatives against differences, minima against another search."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import jacokin
from jacokin import IKSolver, Robot, Status
from jacokin.arrays import Array
from jacokin.ik import targets
from jacokin.ik.closest import ClosestSearch
from jacokin.ik.options import SolverOptions
from jacokin.ik.verification import Verifier
from jacokin.kernels import closest as kernel

sys.path.append(str(Path(__file__).resolve().parents[2]))  # last: the installed package is what gets tested

from benchmarks import closest as other
from tests.robot_files import CRANE


@pytest.fixture(scope="module")
def crane(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    path = tmp_path_factory.mktemp("crane") / "crane.urdf"
    path.write_text(CRANE)
    return jacokin.load_robot(path)


def a_target(rng: np.random.Generator) -> targets.TargetPose:
    return targets.checked_target(jacokin.pose(rng.uniform(-0.6, 0.6, 3), rpy=rng.uniform(-3.0, 3.0, 3)))


def make_work(robot: Robot, target: targets.TargetPose) -> kernel.ClosestWork:
    """What the kernel works on, for one configuration."""
    return ClosestSearch(Verifier(robot, robot.default_frame, None, SolverOptions())).work(target, 1)


def measured(work: kernel.ClosestWork, q: Array, smoothing: float) -> tuple[float, Array, Array, Array]:
    """By plain Python: the measure of a configuration (dof,), its gradient, Hessian, and the unit vectors (8,)."""
    work.here.q[:] = q
    kernel.measure(work, work.here, smoothing)
    m, state = work.here.measured, np.zeros(kernel.STATE_COLUMNS)
    state[kernel.U : kernel.U + 3] = m[kernel.TOWARDS : kernel.TOWARDS + 3]
    state[kernel.V : kernel.V + 3] = m[kernel.TURNING : kernel.TURNING + 3]
    kernel.fill_hessian(work, work.here, state, False)
    return float(m[kernel.VALUE]), work.here.gradient.copy(), work.here.hessian.reshape(len(q), -1).copy(), state


@pytest.mark.parametrize("position_only", [False, True])
@pytest.mark.parametrize("name", ["j2n6s300", "crane"])
def test_derivatives_are_those_of_the_measure(
    bundled: Callable[[str], Robot], crane: Robot, rng: np.random.Generator, name: str, position_only: bool
) -> None:
    robot = crane if name == "crane" else bundled(name)
    target = targets.checked_target([0.2, 0.1, 0.3]) if position_only else a_target(rng)
    work, h = make_work(robot, target), 1e-6
    for q in robot.sample(rng, 4):
        _, gradient, hessian, _ = measured(work, q, 1e-2)
        for joint in range(robot.dof):
            step = h * np.eye(robot.dof)[joint]
            ahead, behind = measured(work, q + step, 1e-2), measured(work, q - step, 1e-2)
            assert gradient[joint] == pytest.approx((ahead[0] - behind[0]) / (2 * h), abs=1e-8)
            np.testing.assert_allclose(hessian[joint], (ahead[1] - behind[1]) / (2 * h), atol=1e-7)
        T = robot.forward_kinematics(q)
        own = np.linalg.norm(T.translation - target.position)
        if not position_only:
            own += targets.RADIAN_IN_METRES * np.linalg.norm(pin.log3(T.rotation @ target.rotation.T))
        assert measured(work, q, 1e-12)[0] == pytest.approx(own, rel=1e-10)


def test_the_unit_vectors_follow_a_small_step(robot: Robot, rng: np.random.Generator) -> None:
    work = make_work(robot, a_target(rng))
    for q in robot.sample(rng, 4):
        step = 1e-5 * rng.standard_normal(q.shape)
        ahead = measured(work, q + step, 1e-2)[3]
        moved = measured(work, q, 1e-2)[3]
        kernel.move_duals(work.here, step, moved)
        np.testing.assert_allclose(moved, ahead, atol=1e-7)


def test_negative_eigenvalues_become_positive(robot: Robot, rng: np.random.Generator) -> None:
    work = make_work(robot, a_target(rng))
    for _ in range(5):
        root = rng.standard_normal((6, 6))
        work.here.hessian[:] = (root + root.T).ravel()
        kernel.fill_curvature(work, False)
        values, vectors = np.linalg.eigh(root + root.T)
        np.testing.assert_allclose(work.curvature.reshape(6, 6), vectors * np.abs(values) @ vectors.T, atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["j2n6s300", "j2s6s200"])
def test_no_other_search_comes_closer(name: str, bundled: Callable[[str], Robot], rng: np.random.Generator) -> None:
    robot = bundled(name)
    figures = other.compare(robot, other.targets_not_reached(robot, rng, 6), 8, rng)
    assert figures.worst < 1e-6


def test_a_slide_goes_to_its_end(crane: Robot) -> None:
    # The crane's reach is the end of its slide, whose direction is that of its axis in the base.
    far = IKSolver(crane).solve([50.0, 0.0, 0.0])
    assert far.q[1] == 1.5
    assert crane.within_limits(far.q)


def test_positions_are_met_exactly_where_only_the_orientation_cannot_be(robot: Robot) -> None:
    # A tool that points up from below: the position is within reach, and the minimum lies on the kink of the measure.
    result = IKSolver(robot).solve(jacokin.pose([0.15, -0.05, 0.1], down=True))
    assert result.status is Status.OUTSIDE_LIMITS
    assert robot.within_limits(result.q)
    assert min(result.position_error, result.orientation_error) < 1e-5
    assert max(result.position_error, result.orientation_error) > 1e-3


def test_the_search_repeats_and_takes_the_callers_randomness(robot: Robot, rng: np.random.Generator) -> None:
    search = ClosestSearch(Verifier(robot, "end_effector", None, SolverOptions()))
    target = targets.checked_target(jacokin.pose([0.5, 0.5, 0.9], down=True))
    first, second = (search.find(target, [robot.home], np.random.default_rng(3)) for _ in range(2))
    np.testing.assert_array_equal(first[0], second[0])
    assert first[1] == second[1]
    values = []
    for _ in range(3):
        T = robot.forward_kinematics(search.find(target, [robot.home], rng)[0])
        turn = np.linalg.norm(pin.log3(T.rotation @ target.rotation.T))
        values.append(np.linalg.norm(T.translation - target.position) + targets.RADIAN_IN_METRES * turn)
    assert max(values) - min(values) < 1e-6


def test_a_pose_that_the_search_reaches_is_a_success(robot: Robot, rng: np.random.Generator) -> None:
    solver = IKSolver(robot, method="qp", max_restarts=0)
    for q in robot.sample(rng, 8):
        target = robot.forward_kinematics(q)
        result = solver.solve(target)
        assert result.success, str(result)
        assert robot.within_limits(result.q)
        reached = robot.forward_kinematics(result.q)
        assert np.linalg.norm(reached.translation - target.translation) <= 1e-6
        assert np.linalg.norm(pin.log3(reached.rotation.T @ target.rotation)) <= 1e-6
