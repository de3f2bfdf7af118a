"""What the numbers make of measurements: against Pinocchio, and derivatives against differences."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import jacokin
from jacokin import Robot
from jacokin.calibration import Measurements, Prior, calibrate, plan_measurements, predict_accuracy
from jacokin.calibration.arm_model import ArmKinematics, ArmModel
from jacokin.errors import ModelError
from tests.calibration.simulated import arm_of, hidden_arm, poses_of
from tests.robot_files import CRANE, load_text


def test_kinematics_are_those_of_the_robot(robot: Robot, rng: np.random.Generator) -> None:
    arm = hidden_arm(robot, 3)
    assert arm.calibration is not None
    q = robot.sample(rng, 20)
    numbers = np.hstack([arm_of(arm.calibration), np.zeros((robot.dof, 2))])
    for frame in ("end_effector", "link_4", "pinchsite"):
        at = ArmKinematics(robot, frame).at(q, numbers)
        T = poses_of(arm, q, frame)
        np.testing.assert_allclose(at.position, T[:, :3, 3], atol=1e-14)
        np.testing.assert_allclose(at.rotation, T[:, :3, :3], atol=1e-14)


def test_derivatives_equal_differences_for_every_kind(robot: Robot, rng: np.random.Generator) -> None:
    """With unknown base and tool, scales and sag, far from zero."""
    q = robot.sample(rng, 8)
    base, tool = jacokin.pose([1, 2, 0.3], rpy=[0.3, 0.2, 2]), jacokin.pose([0.02, 0.03, 0.1], rpy=[0.3, -0.2, 1])
    T = base.homogeneous @ poses_of(hidden_arm(robot, 1), q) @ tool.homogeneous
    unknown = {"base": "unknown", "tool": "unknown"}
    sets = [
        Measurements(q, poses=T, sigma=(1e-3, 1e-3), **unknown),
        Measurements(q, positions=T[:, :3, 3], sigma=1e-3, base="unknown", tool=tool),
        Measurements(q, distances=np.ones(8), points=[0.1, 0, 0], sigma=1e-3, **unknown),
        Measurements(q, contact="plane", sigma=1e-3),
        Measurements(q, contact="point", sigma=1e-3, frame="link_5"),
    ]
    model = ArmModel(robot, sets, ["geometry", "offset", "scale", "compliance"], Prior())
    x = rng.normal(size=len(model.parameters)) * np.minimum(model.prior, 0.05)
    for index, rows in enumerate(sets):
        missed, jacobian = model.predict(index, x)
        assert missed.shape == (8, rows.sigma.shape[1])
        for k in range(len(x)):
            step = np.zeros_like(x)
            step[k] = 1e-6
            slope = (model.predict(index, x + step)[0] - model.predict(index, x - step)[0]) / 2e-6
            np.testing.assert_allclose(jacobian[:, :, k], slope, atol=1e-7)


def test_base_and_tool_are_found_with_the_described_arm(robot: Robot, rng: np.random.Generator) -> None:
    q = robot.sample(rng, 20)
    base, tool = jacokin.pose([1, 2, 0.3], rpy=[0.3, 0.2, 2]), jacokin.pose([0.02, 0.03, 0.1], rpy=[0.3, -0.2, 1])
    T = base.homogeneous @ poses_of(robot, q) @ tool.homogeneous
    T[:4, :3, 3] += 0.3  # gross errors
    seen = Measurements(q, poses=T, sigma=(1e-3, 1e-3), base="unknown", tool="unknown")
    found = ArmModel(robot, [seen], ["offset"], Prior()).reference
    np.testing.assert_allclose(found.base.rotation, base.rotation, atol=1e-6)
    np.testing.assert_allclose(found.tools[None].rotation, tool.rotation, atol=1e-6)
    assert np.linalg.norm(found.base.translation - base.translation) < 0.05


def test_an_arm_with_a_slide_is_refused(tmp_path: Path, rng: np.random.Generator) -> None:
    """It was taken for one that turns."""
    crane = load_text(tmp_path / "crane.urdf", CRANE)
    q = crane.sample(rng, 20)
    poses = [crane.forward_kinematics(row) for row in q]
    positions = Measurements(q, positions=[pose.translation for pose in poses], sigma=1e-3)
    seen = Measurements(q, poses=poses, sigma=(1e-3, 1e-3), base="unknown", tool="unknown")
    for ask in (
        lambda: calibrate(crane, positions),
        lambda: calibrate(crane, seen, parameters=[]),
        lambda: plan_measurements(crane, 5),
        lambda: predict_accuracy(crane, q),
    ):
        with pytest.raises(ModelError, match="joint 'slide' slides: only arms whose joints all turn are calibrated"):
            ask()
