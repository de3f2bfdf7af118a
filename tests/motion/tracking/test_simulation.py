"""The tracker drives velocity actuators in MuJoCo: the commanded path against the simulated one."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from jacokin import Robot, Tracker
from tests.mujoco_bridge.scenes import jaco_scene

CONTROL_STEP = 0.01  # [s]
GAIN = 10.0  # [1/s] of the joint error: a velocity actuator alone sags under gravity


@pytest.mark.parametrize("gain", [0.0, GAIN])
def test_the_simulated_arm_follows_the_line(robot: Robot, gain: float) -> None:
    physics, _, arm, _ = jaco_scene()
    joints, actuators = physics.bind(arm.joints), physics.bind(arm.actuators)
    substeps = round(CONTROL_STEP / physics.model.opt.timestep)

    tracker = Tracker(robot, dt=CONTROL_STEP, q=joints.qpos, acceleration_limit=np.inf)
    start = robot.forward_kinematics(joints.qpos)
    deviations = []
    for tick in range(1, 251):
        target = pin.SE3(start.rotation, start.translation + np.array([0.0, 0.0, 0.05 * min(tick, 200) * CONTROL_STEP]))
        error = tracker.q - np.array(joints.qpos)
        step = tracker.step(target)
        actuators.ctrl = step.v + gain * error
        physics.step(substeps)
        simulated = robot.forward_kinematics(np.array(joints.qpos)).translation
        deviations.append(float(np.linalg.norm(simulated - target.translation)))
    if gain:
        assert max(deviations) < 1e-3
        assert deviations[-1] < 5e-4
    else:
        assert deviations[-1] > 5e-3  # why the joint error has to be fed back
