"""Kinematics of many configurations at once: that of Pinocchio, its derivatives, and Newton's method on it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import jacokin
from jacokin import Robot
from jacokin.arrays import Array
from jacokin.model.many_configurations import Chain, TargetRows
from tests.robot_files import CRANE

TOOL = jacokin.pose([0.1, -0.2, 0.05], rpy=[0.3, 0.2, -1.0])
NAMES = ("j2n6s300", "j2s7s300", "crane")


@pytest.fixture
def robot_of(bundled: Callable[[str], Robot], tmp_path: Path) -> Callable[[str], Robot]:
    def load(name: str) -> Robot:
        if name != "crane":
            return bundled(name)
        (tmp_path / "crane.urdf").write_text(CRANE)
        return jacokin.load_robot(tmp_path / "crane.urdf")

    return load


def some_axes(rng: np.random.Generator, number: int) -> Array:
    axes = rng.normal(size=(number, 3))
    return np.asarray(axes / np.linalg.norm(axes, axis=1)[:, None])


@pytest.mark.parametrize(
    ("name", "frame"), [*((name, None) for name in NAMES), (NAMES[0], "link_4"), (NAMES[0], "pinchsite")]
)
def test_placements_are_those_of_pinocchio(
    name: str, frame: str | None, robot_of: Callable[[str], Robot], rng: np.random.Generator
) -> None:
    robot = robot_of(name)
    q = robot.sample(rng, 20)
    poses, jacobians = Chain(robot, robot.frame_id(frame), TOOL).placements(q)
    for index, row in enumerate(q):
        T, jacobian = robot.forward_kinematics(row, frame), robot.jacobian(row, frame)
        lever = T.rotation @ TOOL.translation
        np.testing.assert_allclose(poses[index], (T * TOOL).homogeneous, atol=1e-14)
        np.testing.assert_allclose(jacobians[index, 3:], jacobian[3:], atol=1e-14)
        np.testing.assert_allclose(jacobians[index, :3], jacobian[:3] - pin.skew(lever) @ jacobian[3:], atol=1e-14)


@pytest.mark.parametrize("free", [False, True])
@pytest.mark.parametrize("name", NAMES)
def test_errors_shrink_as_the_jacobian_says(
    name: str, free: bool, robot_of: Callable[[str], Robot], rng: np.random.Generator
) -> None:
    robot = robot_of(name)
    chain = Chain(robot, robot.frame_id(), TOOL)
    x, h = robot.sample(rng, 8), 1e-6
    poses = np.array([(robot.forward_kinematics(q) * TOOL).homogeneous for q in x])
    goal = TargetRows(poses, some_axes(rng, 8) if free else None)
    if free:
        x = np.column_stack([x, np.zeros(8)])
    error, jacobian = chain.linearise(x, goal)
    assert np.abs(error).max() < 1e-14
    for column in range(x.shape[1]):
        step = h * np.eye(x.shape[1])[column]
        ahead, behind = chain.linearise(x + step, goal)[0], chain.linearise(x - step, goal)[0]
        np.testing.assert_allclose(jacobian[:, :, column], (behind - ahead) / (2.0 * h), atol=1e-9)


def test_errors_against_a_turned_goal(robot: Robot, rng: np.random.Generator) -> None:
    chain = Chain(robot, robot.frame_id(), None)
    q, axes, angle = robot.sample(rng, 10), some_axes(rng, 10), rng.uniform(-3.0, 3.0, (10, 1))
    poses = [robot.forward_kinematics(row) for row in q]
    turned = [
        T * pin.SE3(pin.exp3(-float(a[0]) * axis), np.zeros(3)) for T, axis, a in zip(poses, axes, angle, strict=True)
    ]
    goal = TargetRows(np.array([T.homogeneous for T in turned]), axes)
    position, orientation = chain.errors(np.hstack([q, angle]), goal)
    assert max(position.max(), orientation.max()) < 1e-14
    position, orientation = chain.errors(np.hstack([q, angle + 1e-3]), goal)
    assert position.max() < 1e-14
    np.testing.assert_allclose(orientation, 1e-3, rtol=1e-6)
    some = goal.some(np.array([2, 5]))
    assert chain.errors(np.hstack([q, angle])[[2, 5]], some)[1].max() < 1e-14


@pytest.mark.parametrize("held", [None, 2])
@pytest.mark.parametrize("name", ["j2n6s300", "j2s7s300"])
def test_newton_comes_to_the_goal(
    name: str, held: int | None, bundled: Callable[[str], Robot], rng: np.random.Generator
) -> None:
    robot = bundled(name)
    chain = Chain(robot, robot.frame_id(), TOOL)
    regular = [q for q in robot.sample(rng, 100) if robot.singular_values(q)[-1] > 0.1]
    assert len(regular) > 20
    q = np.array(regular)
    goal = TargetRows(np.array([(robot.forward_kinematics(row) * TOOL).homogeneous for row in q]))
    start = q + 1e-2 * rng.normal(size=q.shape)
    fixed = None
    if held is not None:
        start[:, held] = q[:, held]
        fixed = np.zeros(q.shape, dtype=np.bool_)
        fixed[:, held] = True
    found, worst = chain.close(start, goal, fixed)
    assert worst.max() < 1e-11
    assert max(error.max() for error in chain.errors(found, goal)) < 1e-11
    if held is not None:
        np.testing.assert_array_equal(found[:, held], q[:, held])
    if robot.dof == 6:
        assert np.abs(found - q).max() < 1e-9


def test_a_goal_out_of_reach_is_missed(robot: Robot) -> None:
    chain = Chain(robot, robot.frame_id(), None)
    far = robot.forward_kinematics(robot.home).homogeneous
    far[:3, 3] += 5.0  # [m]
    worst = chain.close(robot.home[np.newaxis], TargetRows(far[np.newaxis]))[1]
    assert worst[0] > 1.0
