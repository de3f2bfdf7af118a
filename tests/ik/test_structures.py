"""Arms that are not built like a Jaco: a UR5 from its file, measured Jacos, arms with fewer freedoms."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import pytest

import jacokin
from fuzz.six_joints import random_arm
from jacokin import Robot
from jacokin.errors import StructureError
from jacokin.ik import IKSolver, Status, solve_file, structure
from jacokin.ik.structures import measure_general
from jacokin.model import urdf_folder
from tests.kernels.six_joints.arms import chain_of_arm, distance
from tests.robot_files import load_text, ur5_text


@pytest.fixture(scope="module")
def ur5(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    path = tmp_path_factory.mktemp("ur5") / "ur5.urdf"
    path.write_text(ur5_text())
    return jacokin.load_robot(path)


def moved_jaco(folder: Path, metres: str) -> Robot:
    """A Jaco whose axes 3 and 4 are so far apart."""
    text = (urdf_folder() / "j2n6s300.urdf").read_text()
    moved = text.replace('xyz="0.0 0.2073 -0.0114"', f'xyz="{metres} 0.2073 -0.0114"')
    assert moved != text
    return load_text(folder / "moved.urdf", moved)


def test_a_ur5_has_all_its_branches(ur5: Robot, rng: np.random.Generator) -> None:
    solver = IKSolver(ur5)
    assert solver.dimension() == 0
    for q in ur5.sample(rng, 20):
        target = ur5.forward_kinematics(q)
        branches = solver.solve_all(target, q)
        assert distance(branches.q[0], q) < 1e-6
        assert len(branches) in (2, 4, 6, 8)
        for row in branches.q:
            np.testing.assert_allclose(ur5.forward_kinematics(row).homogeneous, target.homogeneous, atol=1e-11)
        result = solver.solve(target, q).raise_for_status()
        assert result.method == "closed_form"
        np.testing.assert_allclose(result.q, q, atol=1e-6)
        assert solver.solve(target, prefer="margin").success


def test_batches_files_and_pickles_answer_as_one_solve_does(
    ur5: Robot, rng: np.random.Generator, tmp_path: Path
) -> None:
    solver = IKSolver(ur5)
    q = ur5.sample(rng, 12)
    targets = np.array([ur5.forward_kinematics(row).homogeneous for row in q])
    batch = solver.solve_batch(targets, q)
    assert batch.success.all()
    np.testing.assert_array_equal(batch.q, [solver.solve(T, row).q for T, row in zip(targets, q, strict=True)])
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(solver)).solve_batch(targets, q).q, batch.q)
    np.savez(tmp_path / "in.npz", targets=targets, seeds=q)
    summary = solve_file(solver, tmp_path / "in.npz", tmp_path / "out.npz")
    assert summary.solved == 12


def test_what_a_ur5_does_not_reach_is_said_as_of_a_jaco(ur5: Robot) -> None:
    solver = IKSolver(ur5)
    assert solver.solve(jacokin.pose([0.0, 0.0, 3.0])).status is Status.UNREACHABLE
    assert len(solver.solve_all(jacokin.pose([0.0, 0.0, 3.0]))) == 0
    limits = {"q1": (-0.1, 0.1), "q2": (-0.1, 0.1)}
    narrow = jacokin.load_robot(ur5.source.path, limits=limits)
    q = np.array([0.3, 1.0, -1.2, 0.4, 0.5, 0.6])
    result = IKSolver(narrow).solve(ur5.forward_kinematics(q))
    assert result.status is Status.OUTSIDE_LIMITS


def test_a_tool_that_may_turn(ur5: Robot) -> None:
    q = np.array([0.3, -1.0, 1.2, 0.4, 0.5, 0.6])
    target = jacokin.FreeAxis(ur5.forward_kinematics(q), axis=(1, 0, 0))
    solver = IKSolver(ur5)
    found = solver.solve_all(target, q)
    assert len(found)
    assert found.complete
    result = solver.solve(target, q).raise_for_status()
    assert result.parameter is not None
    reached = ur5.forward_kinematics(result.q)
    np.testing.assert_allclose(reached.homogeneous, target.at(result.parameter).homogeneous, atol=1e-6)


@pytest.mark.parametrize("metres", ["1e-7", "1e-4", "0.02"])
def test_a_measured_jaco_is_not_taken_for_the_nominal_one(
    metres: str, robot: Robot, tmp_path: Path, rng: np.random.Generator
) -> None:
    moved = moved_jaco(tmp_path, metres)
    solver = IKSolver(moved)
    for q in moved.sample(rng, 20):
        target = moved.forward_kinematics(q)
        branches = solver.solve_all(target, q)
        assert distance(branches.q[0], q) < 1e-6
        for row in branches.q:
            np.testing.assert_allclose(moved.forward_kinematics(row).homogeneous, target.homogeneous, atol=1e-11)
    assert structure(moved).residuals[0].position == pytest.approx(float(metres), rel=1e-3)


def test_structures_have_names(robot: Robot, ur5: Robot, tmp_path: Path) -> None:
    assert structure(robot).name == "jaco"
    assert structure(jacokin.load_robot("j2s7s300")).name == "jaco with seven joints"
    found = structure(ur5)
    assert found.name == "three parallel axes"
    assert found.method == "every branch, in closed form: axes 2, 3 and 4 are parallel"
    jaco, wrist, parallel = found.residuals
    assert jaco.position + jaco.angle > 1e-3
    assert wrist.position > 0.04  # [m] a UR5's wrist is offset by 0.09465
    assert parallel.angle < 1e-12
    assert "3 parallel" not in str(parallel)
    assert str(wrist).startswith("axes 4, 5 and 6 meet: 0.0")
    moved = structure(moved_jaco(tmp_path, "0.02"))
    assert (moved.name, moved.method) == ("general", "every branch, from a determinant of the closed loop")
    nearly = structure(moved_jaco(tmp_path, "1e-7"))
    assert (nearly.name, nearly.method) == ("jaco", moved.method)
    inner = structure(robot, "link_4")
    assert inner.name == "none"
    assert "link_4" in inner.method


def test_an_arm_without_six_freedoms_is_refused_with_their_number() -> None:
    """All six axes parallel: a plane, three freedoms. All through one point: turning alone."""
    flat, point = chain_of_arm("generic"), chain_of_arm("generic")
    flat[:, :, :3] = np.eye(3)
    point[:, :, 3] = 0.0
    for chain in (flat, point):
        with pytest.raises(StructureError, match="in 3 independent ways only"):
            measure_general(chain)
    doubled = chain_of_arm("generic")
    doubled[3, :, :3], doubled[3, :, 3] = np.eye(3), 0.0  # joints 3 and 4 turn about one axis
    nearly = doubled.copy()
    nearly[3, 0, 3] = 1e-7  # apart by less than the tolerances of an answer
    for chain in (doubled, nearly):
        with pytest.raises(StructureError, match="in 5 independent ways only"):
            measure_general(chain)


@pytest.mark.parametrize("metres", [10.0, 1e9, 1e200])
def test_targets_far_away_have_no_branches(metres: float, ur5: Robot) -> None:
    T = np.eye(4)
    T[0, 3] = metres
    assert len(IKSolver(ur5).closed_form().solve_all(T, np.zeros(6))) == 0


@pytest.mark.parametrize(
    ("number", "q"),
    [
        (26, (0.0, 0.0, 0.5 * np.pi, 0.5 * np.pi, -5.946242, -0.5 * np.pi)),
        (43, (-0.5 * np.pi, -0.5 * np.pi, -0.5 * np.pi, 0.0, -np.pi, -np.pi)),
        (112, (-0.5 * np.pi, 0.0, -0.5 * np.pi, 1.5 * np.pi, 0.0, 0.0)),
    ],
)
def test_two_branches_that_meet_in_one_are_found(number: int, q: tuple[float, ...], tmp_path: Path) -> None:
    """F touches zero there, but for rounding, and neighbours of the arm may not reach the pose."""
    path = tmp_path / "arm.urdf"
    path.write_text(random_arm(np.random.default_rng([77, number])))
    solver = IKSolver(jacokin.load_robot(path), collision="ignore")
    branches = solver.solve_all(solver.verifier.tool_pose(np.array(q)))  # not told where to look
    assert min(distance(row, np.array(q)) for row in branches.q) < 1e-6
