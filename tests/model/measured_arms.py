"""Arms whose joints are not where their description has them, for tests."""

from __future__ import annotations

import numpy as np

import jacokin
from jacokin import Robot
from jacokin.model import MeasuredArm, MeasuredJoint
from jacokin.model.measured_arm import joints_fingerprint


def measured_arm(robot: Robot, joints: list[MeasuredJoint]) -> MeasuredArm:
    digest = joints_fingerprint(robot.pin_model, robot.base)
    return MeasuredArm(robot.name, digest, tuple(zip(robot.joint_names, joints, strict=True)))


def drawn_joint(
    rng: np.random.Generator, shift: float = 1e-3, tilt: float = 3e-3, offset: float = 0.017
) -> MeasuredJoint:
    """A joint that is off by normal deviations: shift [m], tilt and offset [rad]."""
    x, y = rng.normal(0.0, tilt, 2)
    position = tuple(rng.normal(0.0, shift, 3).tolist())
    return MeasuredJoint(position, (x, y, float(np.sqrt(1.0 - x * x - y * y))), rng.normal(0.0, offset))


def drawn_arm(robot: Robot, rng: np.random.Generator) -> MeasuredArm:
    return measured_arm(robot, [drawn_joint(rng) for _ in robot.joint_names])


def perturbed(robot: Robot, rng: np.random.Generator) -> Robot:
    return jacokin.load_robot(robot.source.bundled or robot.source.path, calibration=drawn_arm(robot, rng))
