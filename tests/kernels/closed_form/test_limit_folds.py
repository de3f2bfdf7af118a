"""Folds, where two branches merge, with a joint exactly on its limit: the branch touches the limit and is within it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest

import jacokin
from benchmarks import targets
from jacokin import Robot
from jacokin.arrays import Array
from jacokin.ik import Status
from jacokin.ik import closed_form as closed_form_module
from jacokin.ik.closed_form import ClosedForm
from jacokin.kernels import branches as kernels_branches
from jacokin.kernels.closed_form import pose as kernels_pose
from jacokin.kernels.closed_form import roots as kernels_roots
from jacokin.kernels.closed_form import wrist as kernels_wrist
from tests.kernels.closed_form.tools import circular, closed_form, fold_between, sizes, target
from tests.kernels.plain import PlainCall

TOOLS = [
    None,
    pin.SE3(pin.exp3(np.array([0.3, -0.8, 1.1])), np.array([0.5, -0.3, 1.5])),
    pin.SE3(pin.exp3(np.array([1.0, 0.2, 0.4])), np.array([0.0, 0.0, 5.0])),
]  # m


def on_a_limit(robot: Robot, rng: np.random.Generator, joints: list[int]) -> tuple[Array, int]:
    q, joint = robot.sample(rng), int(rng.choice(joints))
    q[joint] = (robot.lower, robot.upper)[rng.integers(2)][joint]
    return q, joint


def stretched(robot: Robot, rng: np.random.Generator, number: int) -> Array:
    """The arm straight to 1e-9 .. 1e-3 rad, joint 2 or 5 on a limit."""
    rows = np.array([on_a_limit(robot, rng, [1, 4])[0] for _ in range(number)])
    rows[:, 2] = np.pi + rng.choice([-1.0, 1.0], number) * 10.0 ** rng.uniform(-9.0, -3.0, number)
    return rows


def folds_on_limits(robot: Robot, rng: np.random.Generator, number: int) -> Array:
    """det J = 0 or nearly, joint 2 or 3 on a limit: between configurations that share that joint."""
    rows: list[Array] = []
    while len(rows) < number:
        a, joint = on_a_limit(robot, rng, [1, 2])
        b = robot.sample(rng)
        b[joint] = a[joint]
        fold = fold_between(robot, a, b)
        if fold is None:
            continue
        step = rng.normal(size=6) * 10.0 ** rng.uniform(-12.0, -3.0) * (rng.random() < 0.7)
        step[joint] = 0.0
        if robot.within_limits(fold + step):
            rows.append(fold + step)
    return np.array(rows)


def unsolved(robot: Robot, rows: Array, tool: pin.SE3 | None) -> Array:
    form = closed_form(robot, tool=tool)
    poses = [robot.forward_kinematics(q) * (pin.SE3.Identity() if tool is None else tool) for q in rows]
    best = form.solve_batch(np.array([pose.homogeneous for pose in poses]), np.ascontiguousarray(rows))
    solved = best.within_limits & (best.position_error < 1e-6) & (best.orientation_error < 1e-6)
    within = [robot.within_limits(q) for q in best.q[solved]]
    assert all(within)
    return rows[~solved]


@pytest.mark.one_quick
@pytest.mark.parametrize("tool", TOOLS)
@pytest.mark.parametrize("name", ["j2s6s300", "j2s6s200"])
@pytest.mark.parametrize("number", sizes(500, 3000))
def test_a_stretched_spherical_arm_with_a_joint_on_its_limit(
    number: int, name: str, tool: pin.SE3 | None, bundled: Callable[[str], Robot], rng: np.random.Generator
) -> None:
    robot = bundled(name)
    assert not len(unsolved(robot, stretched(robot, rng, number), tool))


@pytest.mark.one_quick
@pytest.mark.parametrize("tool", TOOLS)
@pytest.mark.parametrize("name", ["j2n6s300", "m1n6s300"])
@pytest.mark.parametrize("number", sizes(60, 300))
def test_a_fold_with_a_joint_on_its_limit(
    number: int, name: str, tool: pin.SE3 | None, bundled: Callable[[str], Robot], rng: np.random.Generator
) -> None:
    robot = bundled(name)
    assert not len(unsolved(robot, folds_on_limits(robot, rng, number), tool))


def test_both_branches_of_a_narrow_fold_are_returned(bundled: Callable[[str], Robot], rng: np.random.Generator) -> None:
    robot = bundled("j2s6s300")
    form = closed_form(robot)
    for bend in (1e-5, 1e-4, 1e-3):
        for q in robot.sample(rng, 50):
            q[2] = np.pi + bend
            rows = form.solve_all(target(robot, q), q)
            assert circular(rows.q, q).min() < 1e-10 / bend
            assert np.sort(circular(rows.q, q))[1] == pytest.approx(2.0 * bend, rel=40.0)


def test_a_target_of_the_stretched_arm_is_solved(bundled: Callable[[str], Robot]) -> None:
    q = [-2.081797040163341, 3.847852514343641, 3.141602653589793, -0.2780405711743872, 0.5235987755982988]
    robot = bundled("j2s6s300")
    joints = np.array([*q, 2.3358480004305706])
    result = jacokin.IKSolver(robot).solve(robot.forward_kinematics(joints))
    assert result.status is Status.OK
    assert robot.within_limits(result.q)


def test_a_regular_branch_past_its_limit_stays_outside(robot: Robot, rng: np.random.Generator) -> None:
    form = closed_form(robot)
    checked = 0
    for q in robot.sample(rng, 400):
        q[1] = robot.upper[1] + 10.0 ** rng.uniform(-8.0, -4.0)
        if robot.singular_values(q)[-1] < 1e-2:
            continue
        rows = form.solve_all(target(robot, q), q)
        index = int(np.argmin(circular(rows.q, q)))
        assert not rows.within_limits[index]
        assert rows.margin[index, 1] == pytest.approx(robot.upper[1] - q[1], abs=1e-11)
        checked += 1
    assert checked > 200


@pytest.mark.one_quick
@pytest.mark.parametrize("table", ["MAX_BRANCHES", "MAX_STARTS", "MAX_ROOTS"])
def test_a_full_table_is_not_complete(table: str, rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch) -> None:
    """At a pose that needs all of them: with the shoulder on axis 5, a root has several starts."""
    monkeypatch.setattr(closed_form_module, "Call", PlainCall)
    robot = jacokin.load_robot()  # whose closed form no other solver has prepared
    solver = jacokin.IKSolver(robot)
    pose = targets.structured(robot, rng, 2).poses[1]
    assert solver.solve_all(pose).complete
    for module in (kernels_branches, kernels_pose, kernels_roots, kernels_wrist):
        if hasattr(module, table):
            monkeypatch.setattr(module, table, 1)
    assert not solver.solve_all(pose).complete


def test_the_copy_is_the_nearest_any_number_of_turns_away(robot: Robot, rng: np.random.Generator) -> None:
    lower, upper = np.full(6, -np.inf), np.full(6, np.inf)
    lower[:], upper[:] = -40.0, 50.0
    form = ClosedForm(robot.pin_model, robot.frame_id(), None, lower, upper)
    solver = jacokin.IKSolver(jacokin.load_robot(limits={"joint_4": (-10.0, 10.0)}))
    for q, seed in zip(robot.sample(rng, 100), rng.uniform(-100.0, 100.0, (100, 6)), strict=True):
        rows = form.solve_all(target(robot, q), seed)
        for turn in (-2.0 * np.pi, 2.0 * np.pi):
            other = rows.q + turn
            fits = (other >= lower) & (other <= upper)
            assert np.all(np.abs(other - seed)[fits] >= np.abs(rows.q - seed)[fits])
        branches = solver.solve_all(target(robot, q), seed).q[:, 3]
        outside = np.sign(branches - seed[3])
        assert np.all((np.abs(branches + 2.0 * np.pi * np.sign(seed[3])) > 10.0) | (np.abs(seed[3]) < 10.0))
        assert np.all((outside == -np.sign(seed[3])) | (np.abs(seed[3]) < 10.0))
