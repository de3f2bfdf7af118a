"""Acceleration limits: held exactly, no overshoot past limits, no oscillation about the target."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from jacokin import Robot, Tracker
from jacokin.kernels.tracking.limits import braking_speed
from jacokin.motion import TrackerStatus

DT = 0.01  # [s]
ROUNDING = 1e-9  # [rad/s]: positions are subtracted and divided by dt


@pytest.mark.parametrize("acceleration", [0.5, 2.0, 10.0])
def test_braking_is_exact(acceleration: float) -> None:
    """A joint that starts at the braking speed and brakes every tick stops at the end of its way, not past it."""
    for distance in (1e-6, 1e-3, 0.0123, 0.5):
        speed = braking_speed(distance, acceleration, DT)
        travelled = 0.0
        while speed > 0.0:
            travelled += speed * DT
            speed -= acceleration * DT
        assert travelled == pytest.approx(distance, rel=1e-9)
    assert braking_speed(np.inf, acceleration, DT) == np.inf
    assert braking_speed(0.0, acceleration, DT) == 0.0


@pytest.mark.parametrize("ticks", [800, pytest.param(3_000, marks=pytest.mark.slow)])
def test_limits_hold_while_targets_jump(robot: Robot, rng: np.random.Generator, ticks: int) -> None:
    limit = np.array([1.0, 1.5, 2.0, 3.0, 3.0, 4.0])
    tracker = Tracker(robot, dt=DT, acceleration_limit=limit)
    before = tracker.v
    for tick in range(ticks):
        if tick % 40 == 0:
            target = robot.forward_kinematics(robot.sample(rng))
        step = tracker.step(target)
        assert robot.within_limits(step.q)
        assert (np.abs(step.v) <= robot.velocity_limit + ROUNDING).all()
        assert (np.abs(step.v - before) <= limit * DT + ROUNDING).all()
        before = step.v


def test_a_jump_is_reached_without_oscillation(robot: Robot) -> None:
    start = robot.forward_kinematics(robot.home)
    target = pin.SE3(start.rotation @ pin.exp3(np.array([0.3, 0.2, 0.0])), start.translation + 0.1)
    tracker = Tracker(robot, dt=DT, acceleration_limit=2.0)
    steps = [tracker.step(target) for _ in range(500)]
    reached = next(index for index, step in enumerate(steps) if step.status is TrackerStatus.OK)
    assert all(step.status is TrackerStatus.OK for step in steps[reached:])
    assert np.abs(steps[-1].v).max() < ROUNDING
    assert any("acceleration" in name for name in steps[0].limiting)


def test_a_line_is_followed_once_up_to_speed(robot: Robot) -> None:
    start = robot.forward_kinematics(robot.home)
    tracker = Tracker(robot, dt=DT, acceleration_limit=5.0)
    for tick in range(1, 150):
        step = tracker.step(pin.SE3(start.rotation, start.translation + np.array([0.0, 0.0, 0.05 * tick * DT])))
        if tick > 30:
            assert step.status is TrackerStatus.OK
            assert step.position_error < 1e-5


def test_towards_a_limit_the_arm_brakes_in_time(robot: Robot) -> None:
    """Joint 3 is asked through its upper limit at full speed."""
    q = robot.home.copy()
    q[2] = robot.upper[2] - 0.6
    tracker = Tracker(robot, dt=DT, q=q, acceleration_limit=1.0)
    beyond = robot.pin_model.createData()
    asked = q.copy()
    asked[2] = robot.upper[2] + 0.3
    pin.forwardKinematics(robot.pin_model, beyond, asked)
    target = pin.updateFramePlacement(robot.pin_model, beyond, robot.frame_id())
    before = tracker.v
    for _ in range(400):
        step = tracker.step(target)
        assert robot.within_limits(step.q)
        assert (np.abs(step.v - before) <= DT + ROUNDING).all()
        before = step.v
