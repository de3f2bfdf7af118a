"""An arm that nobody knows, and an instrument that looks at it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

import jacokin
from jacokin import Robot
from jacokin.model import MeasuredArm
from tests.model.measured_arms import drawn_joint, measured_arm

Array = NDArray[np.float64]
NOISE = 3e-4  # [m]


def hidden_arm(robot: Robot, seed: int, offset: float = 0.005) -> Robot:
    """An arm a few millimetres from its description."""
    rng = np.random.default_rng(seed)
    joints = measured_arm(robot, [drawn_joint(rng, offset=offset) for _ in robot.joint_names])
    return jacokin.load_robot(robot.source.bundled or robot.source.path, calibration=joints)


def positions_of(arm: Robot, q: Array, frame: str | None = None) -> Array:
    return np.array([arm.forward_kinematics(row, frame).translation for row in q])


def poses_of(arm: Robot, q: Array, frame: str | None = None) -> Array:
    return np.array([arm.forward_kinematics(row, frame).homogeneous for row in q])


def mean_error(first: Robot, second: Robot, count: int = 200) -> float:
    """Mean distance of the tips at random configurations [m]."""
    q = first.sample(np.random.default_rng(99), count)
    return float(np.linalg.norm(positions_of(first, q) - positions_of(second, q), axis=1).mean())


def brute_jacobian(robot: Robot, q: Array, frame: str | None = None) -> Array:
    """Derivatives (n, 6, 36) of positions and orientations by x, y, z, axis, offset of each joint, by differences.

    Independent of the estimator: robots loaded with one number changed.
    """
    step = 1e-5
    found = np.zeros((len(q), 6, 6 * robot.dof))
    for column in range(6 * robot.dof):
        sides = []
        for sign in (step, -step):
            numbers = np.zeros((robot.dof, 6))
            numbers[column // 6, column % 6] = sign
            joints = [_joint(row) for row in numbers]
            moved = jacokin.load_robot(robot.source.bundled or "", calibration=measured_arm(robot, joints))
            sides.append(poses_of(moved, q, frame))
        found[:, :3, column] = (sides[0] - sides[1])[:, :3, 3] / (2 * step)
        turned = sides[0][:, :3, :3] @ np.swapaxes(sides[1][:, :3, :3], 1, 2)
        skew = 0.5 * (turned - np.swapaxes(turned, 1, 2))
        found[:, 3:, column] = np.column_stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]]) / (2 * step)
    return found


def _joint(row: Array) -> jacokin.model.MeasuredJoint:
    x, y = float(row[3]), float(row[4])
    position = (float(row[0]), float(row[1]), float(row[2]))
    return jacokin.model.MeasuredJoint(position, (x, y, float(np.sqrt(1.0 - x * x - y * y))), float(row[5]))


PRIOR = np.tile([1e-3, 1e-3, 1e-3, 3e-3, 3e-3, np.radians(1.0)], 6)


def bound(robot: Robot, q: Array, noise: float = NOISE, prior: Array = PRIOR) -> float:
    """Mean error [m] at unseen poses that no estimate from these positions beats (Cramer-Rao, with the prior)."""
    jacobian = brute_jacobian(robot, q)[:, :3].reshape(-1, len(prior)) * prior
    covariance = np.linalg.inv(jacobian.T @ jacobian / noise**2 + np.eye(len(prior)))
    rng = np.random.default_rng(5)
    unseen = brute_jacobian(robot, robot.sample(rng, 100))[:, :3] * prior
    draws = np.linalg.cholesky(covariance) @ rng.normal(size=(len(prior), 200))
    return float(np.linalg.norm(unseen @ draws, axis=1).mean())


def arm_of(calibration: MeasuredArm) -> Array:
    """(dof, 6) x, y, z, axis x and y, offset."""
    return np.array([[*joint.position, *joint.axis[:2], joint.offset] for _, joint in calibration.joints])
