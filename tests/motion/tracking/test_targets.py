"""Parts of poses, regions, several frames, and what the arm does with the freedom they leave."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import jacokin
from jacokin import Robot, Tracker
from jacokin.errors import InvalidInputError, UnknownNameError
from jacokin.motion import (
    AxisTarget,
    JointTarget,
    LimitDistance,
    Manipulability,
    OrientationTarget,
    PoseTarget,
    PositionTarget,
    Posture,
    RegionTarget,
    TrackerStatus,
)
from jacokin.motion.tracking.targets import TrackingTarget


def settle(tracker: Tracker, target: Any, ticks: int = 500) -> Any:
    for _ in range(ticks):
        step = tracker.step(target)
        assert tracker.robot.within_limits(step.q)
    return step


def test_position_only(robot: Robot) -> None:
    step = settle(Tracker(robot), np.array([0.3, 0.3, 0.5]))
    assert step.status is TrackerStatus.OK
    assert np.allclose(robot.forward_kinematics(step.q).translation, [0.3, 0.3, 0.5], atol=1e-6)
    assert step.orientation_error == 0.0


@pytest.mark.one_quick
@pytest.mark.parametrize("distance", [1e4, 1e9, 1e300])
def test_the_arm_stretches_towards_targets_however_far(robot: Robot, distance: float) -> None:
    home = robot.forward_kinematics(robot.home)
    for target in ([distance, 0.0, 0.3], pin.SE3(home.rotation, np.array([distance, 0.0, 0.3]))):
        tracker = Tracker(robot, acceleration_limit=np.inf)
        step = tracker.step(target)
        assert np.abs(step.v).max() > 0.1
        assert step.position_error == pytest.approx(distance, abs=1.0)
        step = settle(tracker, target)
        assert step.status is not TrackerStatus.OK
        assert robot.forward_kinematics(step.q).translation[0] > 0.75


def test_orientation_only(robot: Robot) -> None:
    step = settle(Tracker(robot), OrientationTarget(np.eye(3)))
    assert step.status is TrackerStatus.OK
    assert np.allclose(robot.forward_kinematics(step.q).rotation, np.eye(3), atol=1e-6)
    assert step.position_error == 0.0


@pytest.mark.parametrize("axis", [(0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 3.0, 4.0)])
def test_axis_only(robot: Robot, axis: tuple[float, float, float]) -> None:
    step = settle(Tracker(robot), AxisTarget((0.0, 1.0, -1.0), axis))
    assert step.status is TrackerStatus.OK
    points = robot.forward_kinematics(step.q).rotation @ (np.array(axis) / np.linalg.norm(axis))
    assert np.allclose(points, [0.0, np.sqrt(0.5), -np.sqrt(0.5)], atol=1e-5)


def test_an_opposite_axis_is_no_trap(robot: Robot) -> None:
    now = robot.forward_kinematics(robot.home).rotation[:, 2]
    step = settle(Tracker(robot), AxisTarget(-now))
    assert step.orientation_error < 1e-3


def test_position_and_axis_together(robot: Robot) -> None:
    start = robot.forward_kinematics(robot.home)
    there = start.translation + np.array([0.05, -0.05, 0.1])
    direction = pin.exp3(np.array([0.3, -0.2, 0.0])) @ start.rotation[:, 2]
    step = settle(Tracker(robot), [PositionTarget(there), AxisTarget(direction)])
    reached = robot.forward_kinematics(step.q)
    assert step.status is TrackerStatus.OK
    assert np.allclose(reached.translation, there, atol=1e-6)
    assert np.allclose(reached.rotation[:, 2], direction, atol=1e-5)


@pytest.mark.slow
def test_a_region_is_entered_and_not_left(robot: Robot) -> None:
    lower, upper = np.array([0.2, 0.2, 0.3]), np.array([0.4, 0.4, 0.6])
    tracker = Tracker(robot, posture=robot.home)
    region = RegionTarget(lower, upper)
    step = settle(tracker, region, 400)
    assert step.status is TrackerStatus.OK
    for _ in range(400):
        step = tracker.step(region)
        place = robot.forward_kinematics(step.q).translation
        assert (place >= lower - 1e-4).all()
        assert (place <= upper + 1e-4).all()
    # Home is outside, so the posture pulls the tool against the faces.
    assert min(np.abs(place - lower).min(), np.abs(upper - place).min()) < 1e-3


def test_an_open_region_bounds_one_axis(robot: Robot) -> None:
    target = RegionTarget([-np.inf, -np.inf, 0.6], [np.inf] * 3)
    step = settle(Tracker(robot), target, 300)
    assert step.status is TrackerStatus.OK
    assert robot.forward_kinematics(step.q).translation[2] >= 0.6 - 1e-4


def test_weights_decide_between_frames_that_want_different_things(robot: Robot) -> None:
    tool = robot.forward_kinematics(robot.home).translation + np.array([0.0, 0.0, 0.1])
    elbow = robot.forward_kinematics(robot.home, "link_4").translation - np.array([0.0, 0.0, 0.1])
    errors = {}
    for weight in (0.05, 1.0, 20.0):
        targets = [PositionTarget(tool), PositionTarget(elbow, frame="link_4", weight=weight)]
        step = settle(Tracker(robot), targets)
        errors[weight] = np.linalg.norm(robot.forward_kinematics(step.q, "link_4").translation - elbow)
    assert errors[0.05] > errors[1.0] > errors[20.0]


def test_two_frames_of_one_configuration_are_both_reached(robot: Robot) -> None:
    goal = robot.home + np.array([0.2, -0.1, 0.1, 0.2, -0.2, 0.1])
    targets = [
        PoseTarget(robot.forward_kinematics(goal)),
        PositionTarget(robot.forward_kinematics(goal, "link_4").translation, frame="link_4"),
    ]
    step = settle(Tracker(robot), targets)
    assert step.status is TrackerStatus.OK
    assert np.abs(step.q - goal).max() < 1e-4


@pytest.mark.slow
def test_objectives_use_the_freedom_without_costing_accuracy(robot: Robot) -> None:
    place = robot.forward_kinematics(robot.home).translation
    other = robot.home + np.array([0.0, 0.2, 0.2, 0.5, 0.5, 0.5])

    def after(objective: Any) -> Any:
        tracker = Tracker(robot, objectives=[objective], acceleration_limit=np.inf)
        for _ in range(500):
            step = tracker.step(place)
            assert step.position_error < 1e-5
        return step.q

    assert robot.manipulability(after(Manipulability())) > 1.5 * robot.manipulability(robot.home)
    middle = 0.5 * (robot.lower[1:3] + robot.upper[1:3])
    away = np.linalg.norm(after(LimitDistance())[1:3] - middle)
    assert away < 0.9 * np.linalg.norm(robot.home[1:3] - middle)
    assert np.linalg.norm(after(Posture(other)) - other) < 0.8 * np.linalg.norm(robot.home - other)


def test_a_full_pose_leaves_the_posture_no_say(robot: Robot) -> None:
    pose = robot.forward_kinematics(robot.home)
    step = settle(Tracker(robot, posture=robot.home + 0.3), pose, 200)
    assert np.abs(step.q - robot.home).max() < 1e-6


def test_a_posture_takes_the_short_way_on_free_joints(robot: Robot) -> None:
    posture = robot.home.copy()
    posture[5] += 2 * np.pi - 0.2
    tracker = Tracker(robot, posture=posture)
    region = RegionTarget([-5.0] * 3, [5.0] * 3)
    step = settle(tracker, region, 400)
    assert step.q[5] == pytest.approx(robot.home[5] - 0.2, abs=1e-3)


@pytest.mark.parametrize(
    ("make", "match"),
    [
        (lambda: PositionTarget([0.0, np.nan, 0.0]), "position must be finite"),
        (lambda: PositionTarget([0.0, 0.0]), "position"),
        (lambda: AxisTarget([0.0, 0.0, 0.0]), "direction must have a direction"),
        (lambda: OrientationTarget(np.zeros((3, 3))), "rotation"),
        (lambda: PoseTarget([1.0, 2.0, 3.0]), "pose"),
        (lambda: RegionTarget([0.0] * 3, [1.0, -1.0, 1.0]), "must not exceed"),
        (lambda: RegionTarget([0.0] * 3, [1.0, np.nan, 1.0]), "upper"),
        (lambda: RegionTarget("abc", [1.0] * 3), "lower"),
        (lambda: PositionTarget([0.0] * 3, weight=0.0), "weight must be a positive"),
        (lambda: PositionTarget([0.0] * 3, weight=np.inf), "weight must be a positive"),
        (lambda: PositionTarget([0.0] * 3, weight="1"), "weight must be a positive"),  # type: ignore[arg-type]  # wrong on purpose
        (lambda: Posture([0.0] * 6, rate=-1.0), "rate must be a positive"),
        (lambda: Manipulability(0.0), "rate must be a positive"),
        (lambda: LimitDistance(np.nan), "rate must be a positive"),
    ],
)
def test_wrong_targets_are_refused(make: Any, match: str) -> None:
    with pytest.raises(InvalidInputError, match=match):
        make()


def test_targets_on_wrong_frames_are_refused(robot: Robot) -> None:
    tracker = Tracker(robot)
    with pytest.raises(UnknownNameError, match="wristsite"):
        tracker.step(PositionTarget([0.0] * 3, frame="wrist"))
    with pytest.raises(InvalidInputError, match="fixed to the base"):
        tracker.step(PositionTarget([0.0] * 3, frame="link_base"))
    with pytest.raises(InvalidInputError, match="several targets"):
        tracker.step([PositionTarget([0.0] * 3), np.zeros(3)])
    with pytest.raises(InvalidInputError, match="unknown kind"):
        tracker.step(TrackingTarget())


@pytest.mark.parametrize("answer", [np.zeros(5), np.zeros((6, 1)), np.full(6, np.nan), "fast", None, 0.1])
def test_an_objective_that_answers_wrongly_is_named_and_moves_nothing(robot: Robot, answer: Any) -> None:
    class Sway:
        def velocity(self, robot: Robot, frame: str, q: Any) -> Any:
            return answer

    tracker = Tracker(robot, objectives=[Sway()])
    with pytest.raises(InvalidInputError, match=r"Sway\.velocity\(\) must"):
        tracker.step(np.array([0.3, -0.2, 0.5]))
    assert np.array_equal(tracker.q, robot.home)


def test_limits_that_coincide_have_no_middle_to_go_to() -> None:
    robot = jacokin.load_robot(limits={"joint_2": (2.9, 2.9)})
    q = robot.forward_kinematics(robot.home).translation
    step = settle(Tracker(robot, objectives=[LimitDistance()]), q, 20)
    assert step.q[1] == 2.9
    assert LimitDistance().velocity(robot, "end_effector", robot.home)[1] == 0.0


@pytest.mark.slow
def test_later_priorities_use_what_is_left_and_cost_the_first_nothing(robot: Robot) -> None:
    goal = robot.forward_kinematics(robot.home + np.array([0.2, -0.1, 0.1, 0.8, 0.5, 0.1]))
    tool, there = goal.translation, goal.rotation[:, 0]
    elbow = robot.forward_kinematics(robot.home, "link_4").translation - np.array([0.0, 0.0, 0.1])

    def after(*targets: TrackingTarget) -> Any:
        step = settle(Tracker(robot), list(targets), 1500)
        assert step.status is TrackerStatus.OK
        assert np.linalg.norm(robot.forward_kinematics(step.q).translation - tool) < 1e-5
        return step.q

    def tilt(q: Any) -> float:
        return float(np.arccos(min(1.0, robot.forward_kinematics(q).rotation[:, 0] @ there)))

    def away(q: Any) -> float:
        return float(np.linalg.norm(robot.forward_kinematics(q, "link_4").translation - elbow))

    first, second, third = (
        PositionTarget(tool),
        AxisTarget(there, (1.0, 0.0, 0.0), priority=1),
        PositionTarget(elbow, frame="link_4", priority=2),
    )
    both, all_three = after(first, second), after(first, second, third)
    assert tilt(after(first)) > 0.1
    assert tilt(both) < 1e-3
    assert tilt(all_three) < 1e-3
    assert away(all_three) < away(both) - 1e-3
    # The other way round, the elbow comes second and the axis gets what that leaves.
    swapped = after(
        first, AxisTarget(there, (1.0, 0.0, 0.0), priority=2), PositionTarget(elbow, frame="link_4", priority=1)
    )
    assert away(swapped) < away(all_three) - 1e-3
    assert tilt(swapped) > 0.01


def test_priorities_keep_limits_and_clearance(robot: Robot, rng: np.random.Generator) -> None:
    tracker = Tracker(robot, collision="reject", clearance=0.005)
    for tick in range(300):
        if tick % 30 == 0:
            poses = [robot.forward_kinematics(robot.sample(rng)) for _ in range(2)]
        targets = [PositionTarget(poses[0].translation), OrientationTarget(poses[1].rotation, priority=1)]
        step = tracker.step(targets)
        assert robot.within_limits(step.q)
        assert (np.abs(step.v) <= robot.velocity_limit + 1e-9).all()
        assert step.clearance is not None
        assert step.clearance >= 0.005 - 1e-6


@pytest.mark.parametrize("priority", [-1, 0.5, True, "first"])
def test_wrong_priorities_are_refused(priority: Any) -> None:
    with pytest.raises(InvalidInputError, match="priority must be"):
        PositionTarget([0.0] * 3, priority=priority)


def test_joint_angles_are_followed_turns_and_all(robot: Robot) -> None:
    goal = robot.home + np.array([0.3, -0.2, 0.2, 7.0, -0.3, 0.2])
    tracker = Tracker(robot, acceleration_limit=4.0)
    step = settle(tracker, JointTarget(goal), 1_200)
    assert step.status is TrackerStatus.OK
    assert step.position_error == 0.0
    assert step.orientation_error < 1e-3
    assert np.abs(step.q - goal).max() < 1e-6
    outside = goal.copy()
    outside[1] = robot.upper[1] + 1.0
    for _ in range(600):
        step = tracker.step(JointTarget(outside))
        assert robot.within_limits(step.q)
    assert step.q[1] == robot.upper[1]
    assert step.status is TrackerStatus.HELD
    for wrong, match in (([0.0] * 5, "JointTarget"), ([np.nan] * 6, "must be finite"), ("home", "q must be")):
        with pytest.raises(InvalidInputError, match=match):
            Tracker(robot).step(JointTarget(wrong))
    with pytest.raises(InvalidInputError, match="takes no frame"):
        JointTarget(goal, frame="link_4")
