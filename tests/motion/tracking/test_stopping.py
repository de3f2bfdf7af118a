"""The way out: an arm with acceleration limits can always stop; budgets of time; what the counts say."""

from __future__ import annotations

import pickle
import time

import numpy as np
import pinocchio as pin
import pytest

from jacokin import Robot, Tracker
from jacokin.errors import InvalidInputError
from jacokin.ik import Box, Obstacle, Scene, Sphere
from jacokin.kernels.tracking.reach import braked, make_reach_work
from jacokin.motion import TrackerStatus, TrackerStep
from jacokin.motion.tracking.steps import StepTally
from tests.motion.tracking.test_avoidance import DISTANCE, Referee, obstacle

DT = 0.01  # [s]
ACCELERATION = 2.0  # [rad/s^2]


def test_braking_is_what_ticks_of_braking_do(rng: np.random.Generator) -> None:
    unit = ACCELERATION * DT
    for _ in range(20):
        v = rng.uniform(-0.8, 0.8, 6)
        work = make_reach_work()._replace(speed=np.abs(v) / unit, unit=np.copysign(unit * DT, v))
        way, ticks = np.zeros(6), 0
        while np.abs(v).max() > 0.0:
            v = np.sign(v) * np.maximum(np.abs(v) - unit, 0.0)
            way, ticks = way + v * DT, ticks + 1
            assert np.allclose([braked(work, joint, ticks) for joint in range(6)], way, atol=1e-12)
        assert np.allclose([braked(work, joint, 1000) for joint in range(6)], way, atol=1e-12)


@pytest.mark.parametrize("number", [0, *(pytest.param(n, marks=pytest.mark.slow) for n in range(1, 6))])
def test_limits_hold_and_nothing_is_touched_while_targets_jump_behind_obstacles(robot: Robot, number: int) -> None:
    """Position, velocity and acceleration at once, clear of everything; then a stop from anywhere."""
    rng = np.random.default_rng(number)
    hand = robot.forward_kinematics(robot.home).translation
    shapes: list[Obstacle] = [Box("table", [1.0, 1.0, 0.05], [0.5, -0.5, 0.1])]
    shapes += [Sphere(f"ball_{n}", 0.06, hand + 0.25 * pin.exp3(rng.normal(size=3))[:, 0]) for n in range(3)]
    shapes = [shape for shape in shapes if robot.clearance(robot.home, Scene([shape])) > 0.03]
    referee = Referee(robot, Scene(shapes), self_collision=True)
    tracker = Tracker(robot, dt=DT, scene=Scene(shapes), clearance=DISTANCE, acceleration_limit=ACCELERATION)
    before, fast = tracker.v, 0

    def check(step: TrackerStep) -> None:
        nonlocal before
        assert robot.within_limits(step.q)
        assert (np.abs(step.v) <= robot.velocity_limit + 1e-9).all()
        assert (np.abs(step.v - before) <= ACCELERATION * DT + 1e-9).all()
        before = step.v

    for tick in range(600):
        if tick % 60 == 0:
            target = robot.forward_kinematics(robot.sample(rng))
        step = tracker.step(target)
        check(step)
        fast += bool(np.abs(step.v).max() > 0.5)
        if tick % 5 == 0:
            assert referee.least(step.q) > DISTANCE - 2e-3
    while np.abs(before).max() > 0.0:
        step = tracker.brake()
        check(step)
        assert referee.least(step.q) > DISTANCE - 2e-3
    assert step.status is TrackerStatus.OK
    assert fast > 30


def test_the_arm_comes_near_an_obstacle_without_overshooting(robot: Robot) -> None:
    """Straight at a wall at full speed: it stops at the distance, not before and not past it."""
    start = robot.forward_kinematics(robot.home).translation
    wall = Box("wall", [0.02, 1.5, 1.5], np.add(start, [0.25, 0.0, 0.0]))
    referee = Referee(robot, Scene([wall]), self_collision=False)
    tracker = Tracker(robot, dt=DT, scene=Scene([wall]), self_collision=False, acceleration_limit=ACCELERATION)
    for _ in range(400):
        step = tracker.step(np.add(start, [0.5, 0.0, 0.0]))
        assert referee.least(step.q) >= DISTANCE - 1e-6
    assert referee.least(step.q) < DISTANCE + 2e-3
    assert step.status is not TrackerStatus.OK


def test_braking_without_acceleration_limits_is_at_once(robot: Robot) -> None:
    tracker = Tracker(robot, dt=DT)
    tracker.step(twist=[0.1, 0.0, 0.0, 0.0, 0.0, 0.0])
    before = tracker.q
    step = tracker.brake()
    assert np.array_equal(step.q, before)
    assert step.status is TrackerStatus.OK
    assert not step.v.any()


@pytest.mark.parametrize("acceleration", [None, ACCELERATION])
def test_a_tick_without_time_brakes_and_says_so(robot: Robot, acceleration: float | None) -> None:
    rng = np.random.default_rng(0)
    hand = robot.forward_kinematics(robot.home).translation
    scene = Scene([obstacle(1, np.add(hand, [0.0, 0.0, 0.3]), rng)])
    referee = Referee(robot, scene)
    tracker = Tracker(robot, dt=DT, scene=scene, acceleration_limit=acceleration)
    target = np.add(hand, [0.0, 0.0, 0.4])
    for _ in range(30):
        tracker.step(target)
    before = tracker.v
    assert np.abs(before).max() > 0.1
    late = 0
    for tick in range(60):
        step = tracker.step(target, budget=1e-6 if tick % 4 == 0 else None)
        if tick % 4 == 0:
            late += 1
            assert step.status is TrackerStatus.LATE
            assert step.limiting[0] == "time budget"
            assert "budget" in step.message
            assert (np.abs(step.v) <= np.abs(before) + 1e-12).all()
        if acceleration is not None:
            assert (np.abs(step.v - before) <= acceleration * DT + 1e-9).all()
        least = referee.least(step.q)
        assert least >= DISTANCE - 1e-4
        assert step.clearance is not None
        assert step.clearance <= least + 1e-6
        before = step.v
    summary = tracker.summary
    assert summary.statuses["LATE"] == late
    assert summary.limiting["time budget"] == late
    assert summary.overruns == late  # nothing is done in a microsecond
    again = pickle.loads(pickle.dumps(summary))
    assert again == summary
    assert hash(again) == hash(summary)
    for counts in (again.statuses, again.limiting):
        with pytest.raises(TypeError, match="does not support item assignment"):
            counts["LATE"] = 0


def test_enough_time_changes_nothing(robot: Robot) -> None:
    target = np.add(robot.forward_kinematics(robot.home).translation, [0.05, 0.0, 0.05])
    plain, timed = Tracker(robot), Tracker(robot)
    for _ in range(20):
        assert np.array_equal(plain.step(target).q, timed.step(target, budget=10.0).q)
    with pytest.raises(InvalidInputError, match="budget must be a positive number"):
        timed.step(target, budget=0.0)


def test_the_summary_counts_ticks_and_what_held_the_arm_back(robot: Robot) -> None:
    tracker = Tracker(robot, dt=DT)
    assert tracker.summary.ticks == 0
    names: dict[str, int] = {}
    statuses: dict[str, int] = {}
    began = time.perf_counter()
    for _ in range(100):
        step = tracker.step(np.array([2.0, 0.3, 0.5]))
        statuses[step.status.name] = statuses.get(step.status.name, 0) + 1
        for name in step.limiting:
            names[name] = names.get(name, 0) + 1
    assert tracker.summary.ticks == 100
    assert tracker.summary.statuses == statuses
    assert tracker.summary.limiting == names
    assert 0.0 < tracker.summary.longest < time.perf_counter() - began
    assert "100 ticks" in str(tracker.summary)
    tracker.reset()
    assert tracker.summary.ticks == 0
    assert StepTally().summary().longest == 0.0


def test_a_stretched_arm_says_that_its_pose_is_singular(robot: Robot) -> None:
    tracker = Tracker(robot, dt=DT)
    start = robot.forward_kinematics(robot.home)
    assert "singular pose" not in tracker.step(start).limiting
    for _ in range(900):
        step = tracker.step(np.array([2.0, 0.3, 0.5]))
    assert step.status is TrackerStatus.HELD
    assert "singular pose" in step.limiting
    assert robot.jacobian(step.q).shape == (6, 6)
    _, singular, _ = np.linalg.svd(robot.jacobian(step.q)[:3])
    assert singular[-1] < 0.01
