"""Straight wrists are found from their own equations: those that targets were made with, and hardly any other."""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin
import pytest
from jacokin.kernels.self_motion.slices import make_seven_joints, make_six_joints
from jacokin.kernels.self_motion.straight_wrist import find_straight_seven, find_straight_six, make_straight

import jacokin
from jacokin.arrays import Array
from jacokin.ik.geometry import measure, measure_seven
from jacokin.model.angles import wrap_to_pi

COUNT = 40
TOOLS = [None, pin.SE3(pin.exp3(np.array([0.3, -0.2, 0.5])), np.array([0.4, 0.1, -0.05]))]


def straight_of(robot: jacokin.Robot, tool: pin.SE3 | None, q: Array, axis: Array) -> Array:
    """Rows (k, 7) that the kernels give for the pose of a configuration (dof,), or for an axis through it."""
    model, frame = robot.pin_model, robot.pin_model.getFrameId("end_effector")
    T, straight = robot.forward_kinematics(q), make_straight()
    T = (T if tool is None else T * tool).homogeneous
    if robot.dof == 7:
        seven, geometry = make_seven_joints(), measure_seven(model, frame, tool)
        seven.arm[:] = geometry.arm
        return straight.rows[: find_straight_seven(geometry.chain, T, seven, straight)]
    six, geometry = make_six_joints(), measure(model, frame, tool)
    six.chain[:], six.arm[:], six.axis[:] = geometry.chain, geometry.arm, axis
    return straight.rows[: find_straight_six(T, six, straight)]


@pytest.mark.parametrize("tool", TOOLS)
@pytest.mark.parametrize("name", ["j2s7s200", "j2s7s300", "j2s6s200", "j2s6s300"])
def test_the_own_configuration_is_found(name: str, tool: pin.SE3 | None, rng: np.random.Generator) -> None:
    robot = jacokin.load_robot(name)
    middle, missed = robot.dof - 2, 0.0
    for _ in range(COUNT):
        q = robot.sample(rng)
        q[middle] = math.pi
        axis = rng.normal(size=3)
        rows = straight_of(robot, tool, q, axis / np.linalg.norm(axis))
        away = np.abs(wrap_to_pi(rows - np.append(q, 0.0)[:7]))
        away[:, [middle - 1, middle + 1]] = 0.0  # they turn against each other
        missed = max(missed, float(away.max(axis=1).min()))
    assert missed < (1e-3 if robot.dof == 7 else 1e-6)


@pytest.mark.parametrize("name", ["j2s7s300", "j2s6s300", "j2n6s300"])
def test_other_targets_have_none(name: str, rng: np.random.Generator) -> None:
    robot = jacokin.load_robot(name)
    found = sum(len(straight_of(robot, None, robot.sample(rng), np.eye(3)[0])) > 0 for _ in range(COUNT))
    assert found <= (1 if robot.dof == 7 else 0)


@pytest.mark.parametrize("forearm", [0.0, math.pi])
def test_axis_4_may_be_along_axis_1(forearm: float) -> None:
    """Both axes leave the plane of the arm open then; the offset of the shoulder gives it."""
    robot = jacokin.load_robot("j2s6s300")
    q = np.array([0.7, 2.3, 2.3 + forearm, -1.1, math.pi, 0.4])  # the forearm stands or hangs
    assert np.abs(robot.jacobian(q)[3:5, 3]).max() < 1e-12
    away = np.abs(wrap_to_pi(straight_of(robot, None, q, np.eye(3)[0]) - np.append(q, 0.0)))
    away[:, [3, 5]] = 0.0
    assert away.max(axis=1).min() < 1e-6
