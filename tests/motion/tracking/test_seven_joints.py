"""The tracker and tracked paths on seven joints: on the path by MuJoCo's kinematics, within limits, elbow at will."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from benchmarks.smooth import jolts
from jacokin import IKSolver, Robot, Tracker
from jacokin.arrays import Array
from jacokin.ik import Floor, Scene, Sphere
from jacokin.motion import AxisTarget, PositionTarget, TrackerStatus, track_path
from tests.motion.by_mujoco import random_line, tool_poses
from tests.seven_joint_arms import load_arm

DT = 0.01  # [s]
NAME = "j2s7s300"


@pytest.fixture
def seven(bundled: Callable[[str], Robot]) -> Robot:
    return bundled(NAME)


def within_limits(robot: Robot, q: Array, dt: float) -> bool:
    """Positions exactly, velocities to rounding."""
    inside = (q >= robot.lower).all() and (q <= robot.upper).all()
    return bool(inside and (np.abs(np.diff(q, axis=0)) <= robot.velocity_limit * dt + 1e-12).all())


def test_a_line_and_a_circle_are_followed(seven: Robot) -> None:
    start = seven.forward_kinematics(seven.home)
    angles = 2.0 * np.pi * np.arange(1, 315) / 314
    circle = 0.05 * np.column_stack([np.zeros(314), np.sin(angles), 1.0 - np.cos(angles)])
    line = np.column_stack([np.zeros((200, 2)), np.arange(1, 201) * 5e-4])
    for offsets in (line, circle):
        tracker, rows = Tracker(seven, dt=DT, acceleration_limit=np.inf), [seven.home]
        for offset in offsets:
            step = tracker.step(pin.SE3(start.rotation, start.translation + offset))
            assert step.status is TrackerStatus.OK
            rows.append(step.q)
        q = np.array(rows)
        assert within_limits(seven, q, DT)
        assert np.abs(tool_poses(seven, q)[0][1:] - start.translation - offsets).max() < 2e-5


def test_limits_hold_to_the_last_bit(seven: Robot) -> None:
    """Targets that need a joint beyond its limit, and jumps that no joint can follow."""
    rng = np.random.default_rng(1)
    tracker, rows = Tracker(seven, dt=0.05), [seven.home]
    touched = False
    for _ in range(12):
        target = seven.forward_kinematics(seven.sample(rng))
        target.translation *= rng.uniform(0.5, 1.5)
        rows.extend(tracker.step(target).q for _ in range(120))
        touched |= bool((tracker.q == seven.lower).any() or (tracker.q == seven.upper).any())
    assert touched
    assert within_limits(seven, np.array(rows), 0.05)


def test_the_elbow_moves_while_the_tool_stays(seven: Robot) -> None:
    pose = seven.forward_kinematics(seven.home)
    family = IKSolver(seven).solve_all(pose)
    own = [interval for interval in family.intervals if np.abs(interval.nearest(seven.home) - seven.home).max() < 1e-6]
    elsewhere = own[0].at(seven.home[2] + 0.4, seed=seven.home)
    tracker = Tracker(seven, dt=DT, posture=elsewhere, acceleration_limit=np.inf)
    before = np.abs(seven.home - elsewhere).max()
    for _ in range(300):
        step = tracker.step(pose)
        assert step.status is TrackerStatus.OK
        assert step.position_error < 1e-4
    assert np.abs(tracker.q - elsewhere).max() < 0.3 * before


@pytest.mark.one_quick
@pytest.mark.parametrize("acceleration", [None, np.inf], ids=["default", "none"])
def test_the_elbow_moves_while_the_tool_follows_a_twist(seven: Robot, acceleration: float | None) -> None:
    """As it does while the tool follows poses on the same line."""
    start, twist = seven.forward_kinematics(seven.home), np.array([0.0, 0.0, 0.02, 0.0, 0.0, 0.0])
    posture = seven.home + np.array([0.0, 0.0, 0.6, 0.0, 0.0, 0.0, 0.0])
    free = Tracker(seven, dt=DT, acceleration_limit=acceleration)
    held, led = (Tracker(seven, dt=DT, posture=posture, acceleration_limit=acceleration) for _ in range(2))
    for tick in range(1, 301):
        free.step(twist=twist)
        step = held.step(twist=twist)
        led.step(pin.SE3(start.rotation, start.translation + tick * DT * twist[:3]))
    assert step.status is TrackerStatus.OK
    assert np.abs(led.q - free.q).max() > 0.1
    assert np.abs(held.q - led.q).max() < 0.1 * np.abs(led.q - free.q).max()
    for tracker in (free, held):
        moved = seven.forward_kinematics(tracker.q).translation - start.translation
        assert np.abs(moved[:2]).max() < 1e-4
        assert moved[2] == pytest.approx(0.06, abs=2e-3)


@pytest.mark.parametrize(
    ("name", "way", "edge"), [("xarm7", [0.0, 1.0, 0.0], 0.2908), ("panda", [0.0, 0.7, 0.7], 0.1905)]
)
def test_a_twist_into_the_edge_of_reach_ends_at_rest(name: str, way: list[float], edge: float, tmp_path: Path) -> None:
    """For the last two millimetres the elbow turned at two radians a second, and the arm jolted up to 100 times."""
    robot = load_arm(name, tmp_path)
    tracker = Tracker(robot, dt=DT, velocity_limit=3.0)
    steps = [tracker.step(twist=[*np.multiply(0.1, way), 0.0, 0.0, 0.0]) for _ in range(1000)]
    assert jolts(np.array([step.v for step in steps]), tracker.velocity_limit / 0.3, DT) <= 2
    assert steps[-1].status is TrackerStatus.HELD
    assert "singular pose" in steps[-1].limiting
    moved = robot.forward_kinematics(steps[-1].q).translation - robot.forward_kinematics(robot.home).translation
    assert edge - 0.002 < float(moved @ way) / float(np.linalg.norm(way)) < edge


@pytest.mark.parametrize(("paths", "least"), [(3, 0), pytest.param(6, 1, marks=pytest.mark.slow)])
def test_a_path_is_tracked_from_a_start_that_allows_it(seven: Robot, paths: int, least: int) -> None:
    """The nearest member of the first pose's family runs into a limit on some lines, and another one does not."""
    rng = np.random.default_rng(0)
    solved, later = 0, 0
    for _ in range(paths):
        corners = random_line(seven, rng)
        result = track_path(seven, corners, dt=0.02, speed=0.1, acceleration_limit=np.inf)
        assert within_limits(seven, result.q, 0.02)
        if result.success:
            start, end = (corner.translation for corner in corners)
            part = np.linspace(0.0, 1.0, len(result))[:, None]
            assert np.abs(tool_poses(seven, result.q)[0] - start - part * (end - start)).max() < 2e-4
        else:
            assert "starts" in result.message
        solved += result.success
        later += result.success and len(result.branches) > 1
    assert solved > least
    assert later >= least


def test_the_first_pose_out_of_reach(seven: Robot) -> None:
    far = pin.SE3(np.eye(3), np.array([2.0, 0.0, 0.3]))
    result = track_path(seven, [far, pin.SE3(np.eye(3), np.array([2.1, 0.0, 0.3]))], dt=0.1)
    assert not result.success
    assert "no configuration within the limits reaches the first pose" in result.message


def test_obstacles_accelerations_and_axes(seven: Robot) -> None:
    start = seven.forward_kinematics(seven.home)
    scene = Scene([Floor(0.0), Sphere("ball", 0.05, start.translation + np.array([0.0, 0.0, 0.25]))])
    tracker = Tracker(seven, dt=DT, scene=scene, clearance=0.02)
    for tick in range(1, 401):
        step = tracker.step(pin.SE3(start.rotation, start.translation + np.array([0.0, 0.0, 5e-4 * tick])))
        assert step.clearance is not None
        assert step.clearance > 0.02 - 2e-3
    assert step.status is not TrackerStatus.OK
    assert any("ball" in words for words in step.limiting)

    tracker = Tracker(seven, dt=DT, acceleration_limit=1.0)
    target = [
        PositionTarget(start.translation + np.array([0.0, 0.05, 0.0])),
        AxisTarget(start.rotation[:, 2]),
    ]
    velocity = [np.zeros(7)]
    for _ in range(300):
        step = tracker.step(target)
        velocity.append(step.v)
    assert step.status is TrackerStatus.OK
    assert np.abs(np.diff(velocity, axis=0)).max() <= 1.0 * DT + 1e-9
    np.testing.assert_allclose(seven.forward_kinematics(step.q).rotation[:, 2], start.rotation[:, 2], atol=1e-3)
