"""Errors of tasks, their Jacobians and how these turn, as plain Python: against Pinocchio and finite differences."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest

from jacokin import Robot
from jacokin.arrays import Array
from jacokin.kernels.tracking.tasks import (
    JointFrames,
    TaskRows,
    add_bend,
    fill_errors,
    fill_jacobian,
    is_rigid,
    measure_task,
    place_joints,
)
from jacokin.kernels.tracking.tick import make_joint_frames
from jacokin.motion import AxisTarget, JointTarget, OrientationTarget, PoseTarget, PositionTarget, RegionTarget
from jacokin.motion.tracking.targets import Kinematics, TaskFactory, TrackingTarget

TOOL = pin.SE3(pin.exp3(np.array([0.3, -0.8, 1.1])), np.array([0.03, -0.02, 0.15]))
STEP = 1e-6  # [rad]
OUTSIDE_BUT_Y = np.array([[0.1, -0.1, -1.0], [0.2, 0.1, -0.9]])  # [m] corners, from the frame


def arm_of(kinematics: Kinematics) -> JointFrames:
    """The joints as the kernels take them."""
    arm = make_joint_frames(kinematics.robot.dof)
    arm.placements[:], arm.kinds[:] = kinematics.joints()
    return arm


def error_at(arm: JointFrames, rows: TaskRows, q: Array) -> Array:
    """Of the one task."""
    error = np.zeros(max(6, len(q)))
    place_joints(arm, q)
    fill_errors(arm.frames, rows, 0, 1, q, error)
    return error


@pytest.mark.parametrize("kind", ["pose", "position", "orientation", "axis", "region", "joints"])
@pytest.mark.parametrize("name", ["j2n6s300", "j2s7s300"])
def test_jacobians_are_derivatives_of_the_errors_and_bends_of_the_jacobians(
    name: str, kind: str, bundled: Callable[[str], Robot], rng: np.random.Generator
) -> None:
    robot = bundled(name)
    kinematics = Kinematics(robot, robot.default_frame, TOOL)
    arm, dof = arm_of(kinematics), robot.dof
    columns, jacobian = np.zeros((dof, 6)), np.zeros(dof * max(6, dof))
    for q in robot.sample(rng, 5):
        T = robot.forward_kinematics(q) * TOOL
        # Near the frame: there the rotation vector's derivative is the angular velocity.
        near = T * pin.exp6(1e-7 * rng.normal(size=6))
        targets: dict[str, TrackingTarget] = {
            "pose": PoseTarget(near),
            "position": PositionTarget(T.translation + 0.1),
            "orientation": OrientationTarget(near.rotation),
            "axis": AxisTarget(near.rotation[:, 2]),
            "region": RegionTarget(T.translation + OUTSIDE_BUT_Y[0], T.translation + OUTSIDE_BUT_Y[1]),
            "joints": JointTarget(q + 0.1),
        }
        rows = TaskFactory(kinematics).tasks(targets[kind]).rows
        size = {"pose": 6, "joints": dof}.get(kind, 3)

        def jacobian_at(x: Array, rows: TaskRows = rows, size: int = size) -> Array:
            place_joints(arm, x)
            fill_jacobian(arm, rows, 1, columns, jacobian)
            return jacobian[: size * dof].reshape(size, dof).copy()

        steps = STEP * np.eye(dof)
        numeric = [(error_at(arm, rows, q + x) - error_at(arm, rows, q - x))[:size] / (2.0 * STEP) for x in steps]
        np.testing.assert_allclose(jacobian_at(q), -np.transpose(numeric), atol=1e-6)

        left, hessian = rng.normal(size=size), np.zeros(dof * dof)
        if kind == "region":
            left[1] = 0.0  # nothing is missing along y
        place_joints(arm, q)
        add_bend(arm, rows, 1, columns, left, hessian)
        bend = hessian.reshape(dof, dof)
        np.testing.assert_array_equal(bend, bend.T)
        if kind in ("position", "region"):  # of a rotation only the symmetric part of the change of the Jacobian counts
            turning = [left @ (jacobian_at(q + x) - jacobian_at(q - x)) / (2.0 * STEP) for x in steps]
            np.testing.assert_allclose(bend, -np.array(turning), atol=1e-6)


def test_distance_and_angle_are_those_of_pinocchio(robot: Robot, rng: np.random.Generator) -> None:
    kinematics = Kinematics(robot, robot.default_frame, TOOL)
    arm = arm_of(kinematics)
    for q in robot.sample(rng, 20):
        T, goal = robot.forward_kinematics(q) * TOOL, pin.SE3.Random()
        place_joints(arm, q)
        distance, angle = measure_task(arm.frames, TaskFactory(kinematics).tasks(PoseTarget(goal)).rows, 0, q)
        turn = pin.log3(goal.rotation @ T.rotation.T)
        assert distance == pytest.approx(np.linalg.norm(goal.translation - T.translation), abs=1e-12)
        assert angle == pytest.approx(np.linalg.norm(turn), abs=1e-7)
        error = error_at(arm, TaskFactory(kinematics).tasks(PoseTarget(goal)).rows, q)
        np.testing.assert_allclose(error[:3], goal.translation - T.translation, atol=1e-12)
        np.testing.assert_allclose(error[3:6], 0.1 * turn, atol=1e-7)  # one radian counts as 0.1 m


@pytest.mark.parametrize("angle", [np.pi, np.pi - 1e-9, np.pi - 1e-4, 2.2, 1e-9])
def test_rotations_of_any_size_lead_to_the_target(robot: Robot, angle: float, rng: np.random.Generator) -> None:
    kinematics = Kinematics(robot, robot.default_frame, None)
    arm, q = arm_of(kinematics), robot.home
    T = robot.forward_kinematics(q)
    for axis in [*np.eye(3), *rng.normal(size=(5, 3))]:
        unit = axis / np.linalg.norm(axis)
        goal = pin.SE3(pin.exp3(angle * unit) @ T.rotation, T.translation)
        turn = error_at(arm, TaskFactory(kinematics).tasks(PoseTarget(goal)).rows, q)[3:6] / 0.1
        np.testing.assert_allclose(pin.exp3(turn) @ T.rotation, goal.rotation, atol=1e-7)
        assert np.linalg.norm(turn) == pytest.approx(angle, abs=1e-9)


def test_poses_are_rigid_to_a_billionth(rng: np.random.Generator) -> None:
    for _ in range(50):
        pose = pin.SE3(pin.exp3(rng.normal(size=3)), rng.normal(size=3)).homogeneous
        assert is_rigid(pose)
        row, column = rng.integers(0, 3, 2)
        for error, good in ((1e-11, True), (1e-7, False), (np.nan, False), (np.inf, False)):
            other = pose.copy()
            other[row, column] += error
            assert is_rigid(other) is good, (row, column, error)
        for place, value in (((row, 3), np.nan), ((row, 3), -np.inf), ((3, column), 1e-300), ((3, 3), 1.0 + 1e-15)):
            other = pose.copy()
            other[place] = value
            assert not is_rigid(other)
        assert not is_rigid(pose @ np.diag([1.0, 1.0, -1.0, 1.0]))
