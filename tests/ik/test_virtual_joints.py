"""Arms of three to five turning joints: own configurations, every answer checked, and none missed."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import jacokin
from benchmarks import few_joints
from jacokin import FreeAxis, IKSolver, Status
from jacokin.arrays import Array
from jacokin.ik.solutions.points import Points
from tests.robot_files import load_text

CASES = [(name, word) for name, places in few_joints.ARMS.items() for word in few_joints.kinds(len(places) - 1)]
Z = np.array([0.0, 0.0, 1.0])


@cache
def solver_of(folder: Path, name: str, limit: float = 3.1) -> IKSolver:
    robot = load_text(folder / f"{name}.urdf", few_joints.urdf_of(few_joints.ARMS[name], limit))
    return IKSolver(robot, few_joints.tip(robot), collision="ignore")


def points(solver: IKSolver, target: jacokin.ik.targets.Target, seed: Array) -> Points:
    found = solver.solve_all(target, seed)
    assert isinstance(found, Points)
    return found


@pytest.mark.one_quick
@pytest.mark.parametrize(("name", "word"), CASES)
def test_own_configurations_are_found_and_every_answer_reaches_the_target(
    folder: Path, name: str, word: str, rng: np.random.Generator
) -> None:
    solver = solver_of(folder, name)
    robot, kind = solver.robot, few_joints.kinds(solver.robot.dof)[word]
    for q in robot.sample(rng, 25):
        if not few_joints.regular(robot, q, kind):
            continue
        T = robot.forward_kinematics(q, solver.frame)
        target = few_joints.target_at(T, kind)
        found = points(solver, target, q)
        assert np.abs(found.q - q).max(axis=1).min() < 1e-6
        for each in found.q:
            there = robot.forward_kinematics(each, solver.frame)
            np.testing.assert_allclose(there.translation, T.translation, atol=1e-6)
            if kind is None:
                np.testing.assert_allclose(there.rotation, T.rotation, atol=2e-6)
            elif not isinstance(kind, str):
                np.testing.assert_allclose(there.rotation @ kind, T.rotation @ kind, atol=2e-6)
        result = solver.solve(target, q)
        assert result.success
        np.testing.assert_allclose(result.q, q, atol=1e-6)
        assert (result.parameter is None) == (kind is None or isinstance(kind, str))


@pytest.mark.slow
def test_no_configuration_about_a_free_axis_is_missed(folder: Path, rng: np.random.Generator) -> None:
    solver = solver_of(folder, "generic five")
    robot = solver.robot
    data, frame = robot.pin_model.createData(), robot.frame_id(solver.frame)
    for own in robot.sample(rng, 3):
        T = robot.forward_kinematics(own, solver.frame)
        found = points(solver, FreeAxis(T, axis=Z), own)
        for start in rng.uniform(-3, 3, (60, 5)):
            q = start
            for _ in range(40):
                at = robot.forward_kinematics(q, solver.frame)
                direction = at.rotation.T @ T.rotation @ Z
                error = np.concatenate([at.rotation.T @ (T.translation - at.translation), np.cross(Z, direction)[:2]])
                J = pin.computeFrameJacobian(robot.pin_model, data, q, frame, pin.ReferenceFrame.LOCAL)[:5]
                q = q + np.clip(np.linalg.lstsq(J, error, rcond=None)[0], -0.5, 0.5)
            if np.abs(error).max() < 1e-10 and direction[2] > 0.0:
                away = (found.q - q + np.pi) % (2 * np.pi) - np.pi
                assert np.abs(away).max(axis=1).min() < 1e-6


def test_the_range_of_a_free_axis_is_kept(folder: Path) -> None:
    solver, q = solver_of(folder, "SO-101"), np.array([0.2, -0.5, 0.6, 0.4, 0.3])
    T = solver.robot.forward_kinematics(q, solver.frame)
    assert solver.solve(FreeAxis(T, axis=Z, range=(-0.1, 0.1)), q).parameter == pytest.approx(0.0, abs=1e-9)
    found = points(solver, FreeAxis(T, axis=Z, range=(0.05, 0.1)), q)
    assert not found.within_limits[0]


def test_a_joint_on_the_free_axis_stays_at_the_seed_and_is_named(folder: Path) -> None:
    solver, q = solver_of(folder, "ViperX 300"), np.array([0.2, -0.5, 0.6, 0.4, 0.3])
    T = solver.robot.forward_kinematics(q, solver.frame)
    seed = q + np.array([0, 0, 0, 0, 0.5])
    result = solver.solve(FreeAxis(T, axis=Z), seed)
    np.testing.assert_allclose(result.q, seed, atol=1e-8)
    assert result.success
    assert "joint_5 is free" in result.message
    narrow = solver.solve(FreeAxis(T, axis=Z, range=(-0.1, 0.1)), seed)
    assert narrow.success
    assert abs(abs(narrow.q[4] - 0.3) - 0.1) < 1e-9
    assert not points(solver, FreeAxis(T, axis=Z), seed).complete


def test_a_pose_out_of_reach_is_met_in_position_and_the_message_says_the_angle(folder: Path) -> None:
    solver, q = solver_of(folder, "SO-101"), np.array([0.2, -0.5, 0.6, 0.4, 0.3])
    T = solver.robot.forward_kinematics(q, solver.frame)
    result = solver.solve(T * pin.SE3(pin.exp3(np.array([0.3, 0.2, 0.0])), np.zeros(3)))
    assert result.status is Status.UNREACHABLE
    assert result.position_error < 1e-6
    assert f"{np.degrees(result.orientation_error):.3g} deg" in result.message
    assert result.orientation_error <= 0.37


def test_limits_are_diagnosed(folder: Path) -> None:
    solver = solver_of(folder, "SO-101")
    tight = IKSolver(solver_of(folder, "SO-101", 0.1).robot, solver.frame, collision="ignore")
    T = solver.robot.forward_kinematics([0.2, -0.5, 0.6, 0.4, 0.3], solver.frame)
    assert tight.solve(FreeAxis(T, axis=Z)).status is Status.OUTSIDE_LIMITS
    assert tight.solve(T).status is Status.OUTSIDE_LIMITS


def test_paths_about_a_free_axis_are_planned(folder: Path) -> None:
    solver, q = solver_of(folder, "SO-101"), np.array([0.2, -0.5, 0.6, 0.4, 0.3])
    T = solver.robot.forward_kinematics(q, solver.frame)
    on = T * pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.03]))
    path = jacokin.plan_path(IKSolver(solver.robot, solver.frame), [FreeAxis(T, axis=Z), FreeAxis(on, axis=Z)], seed=q)
    assert path.success
    assert np.isfinite(path.parameter).all()
