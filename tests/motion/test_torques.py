"""Limits of torque: held at every instant, no slower than needed, and refused where no slowness helps."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from jacokin import IKSolver, Robot
from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.motion import Trajectory, move_joints, plan_motion


def torques(robot: Robot, motion: Trajectory) -> Array:
    """By Pinocchio, of every row (n, dof) [N m]."""
    model = robot.pin_model
    data = model.createData()
    rows = zip(motion.q, motion.v, motion.a, strict=True)
    return np.array([pin.rnea(model, data, q, v, a) for q, v, a in rows])


def test_torques_stay_within_their_limits_and_one_reaches_its_own(robot: Robot) -> None:
    goal = robot.home + np.array([1.5, 0.3, 0.4, -1.0, 0.5, 0.0])
    fast: dict[str, Any] = {"velocity_limit": 6.0, "acceleration_limit": 60.0}
    loaded = robot.with_payload(1.0, [0.0, 0.0, 0.05])
    for arm in (robot, loaded):
        solver = IKSolver(arm)
        free = plan_motion(solver, robot.home, goal, **fast)
        limit = 0.7 * np.abs(torques(arm, free)).max(axis=0) + 0.3
        gravity = np.array([arm.inverse_dynamics(q, np.zeros(6), np.zeros(6)) for q in free.q])
        limit = np.maximum(limit, 1.2 * np.abs(gravity).max(axis=0) + 0.1)
        motion = plan_motion(solver, robot.home, goal, **fast, torque_limit=limit, dt=1e-3)
        assert motion.success
        assert "slower for the torques" in motion.message
        assert motion.duration > free.duration
        used = (np.abs(torques(arm, motion)) / limit).max()
        assert 0.95 < used <= 1.0
    np.testing.assert_allclose(motion.q[-1], free.q[-1])


def test_motions_of_joints_keep_limits_of_torque(robot: Robot) -> None:
    goal = robot.home + np.array([1.5, 0.3, 0.4, -1.0, 0.5, 0.0])
    fast: dict[str, Any] = {"velocity_limit": 6.0, "acceleration_limit": 60.0, "dt": 1e-3}
    free = move_joints(robot, robot.home, goal, **fast)
    gravity = np.array([robot.inverse_dynamics(q, np.zeros(6), np.zeros(6)) for q in free.q])
    limit = 0.5 * np.abs(torques(robot, free)).max(axis=0) + np.abs(gravity).max(axis=0)
    motion = move_joints(robot, robot.home, goal, **fast, torque_limit=limit)
    used = (np.abs(torques(robot, motion)) / limit).max()
    assert motion.success
    assert motion.duration > free.duration
    assert 0.95 < used <= 1.0
    np.testing.assert_allclose(np.diff(motion.q, axis=0) / np.diff(motion.t)[:, None], motion.v[1:], atol=0.1)
    np.testing.assert_array_equal(motion.q[[0, -1]], [robot.home, goal])
    np.testing.assert_array_equal(move_joints(robot, robot.home, goal, **fast, torque_limit=1e3).q, free.q)
    heavy = move_joints(robot.with_payload(30.0, [0.0, 0.0, 0.0]), robot.home, goal, torque_limit=True)
    assert heavy.outcome == "TOO_HEAVY"
    np.testing.assert_array_equal(heavy.q, [robot.home])


def test_what_the_limits_allow_is_not_slowed_down(robot: Robot) -> None:
    goal = robot.home + 0.3
    solver = IKSolver(robot)
    np.testing.assert_array_equal(
        plan_motion(solver, robot.home, goal, torque_limit=True).q, plan_motion(solver, robot.home, goal).q
    )


def test_too_heavy_says_which_joint(robot: Robot) -> None:
    solver = IKSolver(robot.with_payload(30.0, [0.0, 0.0, 0.0]))
    motion = plan_motion(solver, robot.home, robot.home + 0.5, torque_limit=True)
    assert motion.outcome == "TOO_HEAVY"
    assert "joint_" in motion.message
    with pytest.raises(InvalidInputError, match="torque_limit"):
        plan_motion(solver, robot.home, robot.home + 0.5, torque_limit=-1.0)
