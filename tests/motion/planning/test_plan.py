"""Planned paths: on the path at every tick by MuJoCo's kinematics, within limits, and the reason when there is none."""

from __future__ import annotations

import itertools
import time
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import jacokin
from jacokin import IKSolver, Robot, plan_path
from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, StructureError, UnknownNameError
from jacokin.ik import Box, FreeAxis, Scene, Sphere
from jacokin.motion import Trajectory, track_path
from tests.gripper_arms import load
from tests.motion.by_mujoco import DOWN, at, random_line, tool_poses
from tests.motion.controllers import check_as_controllers_go
from tests.robot_files import ur5_text


def off_the_lines(positions: Array, corners: list[pin.SE3]) -> Array:
    """Distance of each position to the nearest of the lines [m]."""
    distances = []
    for a, b in itertools.pairwise(corners):
        way = b.translation - a.translation
        part = np.clip((positions - a.translation) @ way / (way @ way), 0.0, 1.0)
        distances.append(np.linalg.norm(positions - a.translation - part[:, None] * way, axis=1))
    return np.asarray(np.min(distances, axis=0))


def check(robot: Robot, result: Trajectory, corners: list[pin.SE3], frame: str = "end_effector") -> None:
    """What holds for every success."""
    assert result.success
    assert (result.q >= robot.lower).all()
    assert (result.q <= robot.upper).all()
    assert (np.abs(result.v) <= result.velocity_limit + 1e-9).all()
    np.testing.assert_allclose(np.diff(result.t), result.t[1], rtol=1e-9)
    check_as_controllers_go(result)
    positions, _ = tool_poses(robot, result.q, frame)
    assert off_the_lines(positions, corners).max() < 1e-8
    assert np.linalg.norm(positions[0] - corners[0].translation) < 1e-8
    assert np.linalg.norm(positions[-1] - corners[-1].translation) < 1e-8
    assert result.position_error.max() < 1e-8
    assert result.orientation_error.max() < 1e-8


def test_a_path_with_corners_is_planned_tick_by_tick(robot: Robot) -> None:
    corners = [at(0.4, -0.4, 0.3), at(0.4, -0.2, 0.3), at(0.3, -0.2, 0.4), at(0.3, -0.3, 0.4)]
    result = plan_path(IKSolver(robot), corners, dt=0.01, speed=0.1)
    check(robot, result, corners)
    assert 2.0 + np.sqrt(2.0) + 1.0 < result.t[-1] < 2.0 + np.sqrt(2.0) + 1.0 + 0.6  # and the ramps at both ends
    speed = np.linalg.norm(np.diff(tool_poses(robot, result.q)[0], axis=0), axis=1) / 0.01
    assert np.median(speed) == pytest.approx(0.1, rel=0.01)
    assert speed.max() < 0.1 + 1e-9
    assert set(result.segment.tolist()) == {0, 1, 2}
    _, rotations = tool_poses(robot, result.q)
    np.testing.assert_allclose(rotations, np.broadcast_to(DOWN, rotations.shape), atol=1e-8)


@pytest.mark.slow
@pytest.mark.parametrize(("lines", "least", "more"), [(5, 1, 0), pytest.param(14, 3, 1, marks=pytest.mark.slow)])
def test_what_the_tracker_follows_is_planned_and_more(robot: Robot, lines: int, least: int, more: int) -> None:
    rng = np.random.default_rng(3)
    solver = IKSolver(robot)
    tracked = planned = 0
    for _ in range(lines):
        corners = random_line(robot, rng)
        result = plan_path(solver, corners, dt=0.02, speed=0.1, timing="slow")
        followed = track_path(robot, corners, dt=0.02, speed=0.1, acceleration_limit=np.inf).success
        assert result.success or not followed
        if result.success:
            check(robot, result, corners)
        tracked += followed
        planned += result.success
    assert tracked >= least
    assert planned - tracked >= more


def test_across_the_base_axis_it_slows_down(robot: Robot) -> None:
    """The wrist crosses the axis of joint 1 at 10 cm/s: joint 1 turns round, for which the tracker has no time."""
    rotation = robot.forward_kinematics(robot.home, "link_6").rotation
    corners = [at(side, 0.002, 0.75, rotation) for side in (0.12, -0.12)]
    solver = IKSolver(robot, "link_6")
    assert not track_path(robot, corners, speed=0.1, frame="link_6", acceleration_limit=np.inf).success
    kept = plan_path(solver, corners, speed=0.1)
    assert not kept.success
    assert "LIMITED" in kept.status
    assert "cannot follow at this speed" in kept.message
    assert any("velocity" in words for words in kept.limiting)
    slow = plan_path(solver, corners, speed=0.1, timing="slow")
    check(robot, slow, corners, "link_6")
    assert kept.t[-1] < slow.t[-1] < 10.0


def test_the_speed_is_kept_on_another_branch_if_need_be(robot: Robot) -> None:
    """On the cheapest branch joint 3 is too fast for some ticks, which the mean of a step does not show."""
    rng = np.random.default_rng(0)
    for _ in range(125):
        corners = random_line(robot, rng)
    solver = IKSolver(robot)
    result = plan_path(solver, corners, dt=0.02, speed=0.1)
    check(robot, result, corners)
    nearer = [q for q in solver.solve_all(corners[0]).q_within_limits if np.abs(q - result.q[0]).max() > 0.1]
    others = [plan_path(solver, corners, dt=0.02, speed=0.1, start=q) for q in nearer]
    assert any("joint_3 cannot follow at this speed" in other.message for other in others)


def test_accelerations_are_held_from_rest_to_rest(robot: Robot) -> None:
    corners = [at(0.4, -0.4, 0.3), at(0.4, -0.2, 0.3), at(0.3, -0.2, 0.4)]
    result = plan_path(IKSolver(robot), corners, speed=0.1, timing="slow", acceleration_limit=1.5)
    check(robot, result, corners)
    assert np.abs(result.a).max() <= 1.5
    assert np.abs(result.v[[1, -1]]).max() <= 1.5 * 0.01
    free = plan_path(IKSolver(robot), corners, speed=0.1, timing="slow")
    assert result.t[-1] < 2.0 * free.t[-1]


def moved(pose: pin.SE3, *way: float) -> pin.SE3:
    return pin.SE3(pose.rotation, pose.translation + np.array(way))


STRAIGHT = np.array([0.0, 0.2, 0.0])  # [m]


def in_points(count: int, seed: int | None = None) -> list[pin.SE3]:
    """20 cm straight, in equal or in random parts."""
    parts = np.linspace(0.0, 1.0, count)
    if seed is not None:
        parts[1:-1] = np.sort(np.random.default_rng(seed).uniform(size=count - 2))
    return [moved(at(0.4, -0.4, 0.3), *(part * STRAIGHT)) for part in parts]


@pytest.mark.one_quick
@pytest.mark.parametrize("speed", [0.05, 0.2])
def test_the_same_path_takes_the_same_time_in_any_number_of_points(robot: Robot, speed: float) -> None:
    solver, times = IKSolver(robot), []
    for points in (in_points(2), in_points(3), in_points(21), in_points(201), in_points(101, seed=1)):
        result = plan_path(solver, points, speed=speed, timing="slow", acceleration_limit=1.0)
        check(robot, result, [points[0], points[-1]])
        check_as_controllers_go(result, 1.0)
        times.append(result.duration)
    assert max(times) <= 1.02 * min(times)
    assert min(times) >= 0.2 / speed


@pytest.mark.one_quick
@pytest.mark.parametrize("acceleration", [None, 1.0, 10.0])
def test_near_equal_and_repeated_waypoints_are_one(robot: Robot, acceleration: float | None) -> None:
    solver, first, second = IKSolver(robot), at(0.4, -0.4, 0.3), at(0.5, -0.4, 0.3)
    third = moved(second, 0.0, 0.1, 0.0)
    times = []
    for points in (
        [first, second, third],
        [first, first, second, second, second, third],
        [first, second, moved(second, 1e-9, 0.0, 0.0), third, moved(third, 0.0, 0.0, 1e-9)],
        [first, moved(second, -1e-9, 0.0, 0.0), moved(second, 0.0, 1e-10, 0.0), third, third],
    ):
        result = plan_path(solver, points, speed=0.1, timing="slow", acceleration_limit=acceleration)
        check(robot, result, [first, second, third])
        check_as_controllers_go(result, acceleration)
        times.append(result.duration)
    assert max(times) <= 1.02 * min(times)


def test_the_speed_is_kept_through_repeated_waypoints(robot: Robot) -> None:
    first, second = at(0.4, -0.4, 0.3), at(0.5, -0.4, 0.3)
    corners = [first, first, moved(second, -1e-7, 0.0, 0.0), second, second]
    result = plan_path(IKSolver(robot), corners, speed=0.05)
    check(robot, result, [first, second])
    check_as_controllers_go(result, 1.3)  # the path bends, too
    speed = np.linalg.norm(np.diff(tool_poses(robot, result.q)[0], axis=0), axis=1) / 0.01
    assert speed.max() < 0.05 * 1.001
    assert np.median(speed) == pytest.approx(0.05, rel=0.01)


def test_short_lines_after_long_ones_take_no_ages(robot: Robot) -> None:
    """Ten centimetres along x, then a millimetre along y; steps of a millimetre; a helix in many points."""
    solver, start = IKSolver(robot), at(0.4, -0.4, 0.3)
    end = moved(start, 0.1, 0.0, 0.0)
    result = plan_path(solver, [start, end, moved(end, 0.0, 0.001, 0.0)], timing="slow", acceleration_limit=1.0)
    check(robot, result, [start, end, moved(end, 0.0, 0.001, 0.0)])
    check_as_controllers_go(result, 1.0)
    assert 2.0 < result.duration < 3.0
    steps = [moved(start, 0.0, 0.001 * k, 0.0) for k in range(151)]
    result = plan_path(solver, steps, timing="slow", acceleration_limit=1.0)
    assert result.success
    assert 3.0 < result.duration < 3.5
    angles = np.linspace(0.0, 6.0 * np.pi, 384)
    helix = [moved(start, 0.05 * np.cos(a) - 0.05, 0.05 * np.sin(a), 0.01 * a / np.pi) for a in angles]
    result = plan_path(solver, helix, timing="slow", acceleration_limit=2.0)
    assert result.success
    assert 18.0 < result.duration < 23.0
    assert np.abs(result.a).max() <= 2.0 * (1 + 1e-6)


@pytest.mark.parametrize("lines", [3, pytest.param(8, marks=pytest.mark.slow)])
def test_the_end_of_reach_is_approached_in_time(robot: Robot, lines: int) -> None:
    """At a straight elbow joints go on as the root of the way that is left: 4e7 s by the way of the tool."""
    rng, solver, found = np.random.default_rng(1), IKSolver(robot), 0
    for _ in range(40 * lines):
        q = robot.sample(rng)
        q[2] = np.pi + (0.0, 1e-4)[found % 2]
        end = robot.forward_kinematics(q)
        way = rng.normal(size=3)
        way *= -0.1 * np.sign(way @ end.translation) / np.linalg.norm(way)
        start = moved(end, *way)
        for acceleration in (None, 1.0):
            result = plan_path(solver, [start, end], speed=0.1, timing="slow", acceleration_limit=acceleration)
            if result.success:
                check(robot, result, [start, end])
                check_as_controllers_go(result, acceleration)
                assert result.duration < 10.0
        found += result.success
        if found == lines:
            break
    assert found == lines


@pytest.mark.slow
def test_corners_are_passed_or_stopped_at_within_the_acceleration(robot: Robot) -> None:
    solver, start = IKSolver(robot), at(0.4, -0.4, 0.3)
    for turn in (0.01, 0.1, 0.5, 1.5, 3.1):  # [rad]
        middle = moved(start, 0.0, 0.1, 0.0)
        corners = [start, middle, moved(middle, 0.1 * np.sin(turn), 0.1 * np.cos(turn), 0.0)]
        for dt in (0.005, 0.02, 0.1):
            result = plan_path(solver, corners, dt, speed=0.1, timing="slow", acceleration_limit=1.0)
            check(robot, result, corners)
            check_as_controllers_go(result, 1.0)
            assert result.duration < 5.0


def test_a_path_around_the_base_counts_turns(robot: Robot) -> None:
    circle = [at(0.4 * np.cos(a), 0.4 * np.sin(a), 0.4) for a in np.linspace(0.0, 4.0 * np.pi, 60)]
    result = plan_path(IKSolver(robot), circle, dt=0.05, speed=0.2, timing="slow")
    check(robot, result, circle)
    assert abs(result.q[-1, 0] - result.q[0, 0]) == pytest.approx(4.0 * np.pi, abs=1e-6)


@pytest.mark.slow
def test_the_limits_of_a_cable_hold() -> None:
    """One and a half turns fit between -4 and 7 rad only from one end to the other; two do not."""
    robot = jacokin.load_robot(limits={"joint_1": (-4.0, 7.0)})
    solver = IKSolver(robot)
    circle = [at(0.4 * np.cos(a), 0.4 * np.sin(a), 0.4) for a in np.linspace(0.0, 4.0 * np.pi, 61)]
    result = plan_path(solver, circle[:46], dt=0.05, speed=0.2, timing="slow")
    check(robot, result, circle[:46])
    assert abs(result.q[-1, 0] - result.q[0, 0]) == pytest.approx(3.0 * np.pi, abs=1e-6)
    result = plan_path(solver, circle, dt=0.05, speed=0.2, timing="slow")
    assert not result.success
    assert "joint_1 runs into its limit" in result.message
    assert (result.q >= robot.lower).all()
    assert (result.q <= robot.upper).all()


@pytest.mark.slow
@pytest.mark.parametrize("lines", [2, pytest.param(6, marks=pytest.mark.slow)])
def test_a_free_axis_goes_where_poses_do_not(robot: Robot, lines: int) -> None:
    """About its roll axis the tool may turn at will: a line that one roll cannot follow is followed."""
    solver = IKSolver(robot)
    rng = np.random.default_rng(8)
    more = 0
    for _ in range(lines):
        start = robot.forward_kinematics(robot.sample(rng))
        way = rng.normal(size=3)
        way *= 0.3 / np.linalg.norm(way)
        corners = [start, pin.SE3(start.rotation, start.translation + way)]
        axis = np.array([0.0, 1.0, 0.0])
        fixed = plan_path(solver, corners, dt=0.05, timing="slow")
        free = plan_path(solver, [FreeAxis(pose, axis=axis) for pose in corners], dt=0.05, timing="slow")
        assert free.success or not fixed.success
        if free.success:
            positions, rotations = tool_poses(robot, free.q)
            assert off_the_lines(positions, corners).max() < 1e-8
            np.testing.assert_allclose(rotations @ axis, np.tile(start.rotation @ axis, (len(rotations), 1)), atol=1e-8)
            assert (np.abs(free.v) <= robot.velocity_limit + 1e-9).all()
            more += not fixed.success
    assert more > 0


def test_a_range_of_the_free_axis_is_kept(robot: Robot) -> None:
    pose = at(0.4, -0.4, 0.3)
    corners = [pose, at(0.4, -0.2, 0.3)]
    targets = [FreeAxis(corner, axis=[0.0, 0.0, 1.0], range=(0.3, 0.8)) for corner in corners]
    result = plan_path(IKSolver(robot), targets, dt=0.05)
    assert result.success
    _, rotations = tool_poses(robot, result.q)
    for rotation in rotations:
        turned = pin.log3(DOWN.T @ rotation)
        assert np.abs(turned[:2]).max() < 1e-7
        assert 0.3 - 1e-7 <= turned[2] <= 0.8 + 1e-7


@pytest.mark.parametrize("lines", [3, pytest.param(8, marks=pytest.mark.slow)])
def test_the_way_leads_around_an_obstacle(robot: Robot, lines: int) -> None:
    """A ball where the cheapest way would put the elbow: another branch or another roll, clear at every tick."""
    rng = np.random.default_rng(4)
    around = 0
    for _ in range(lines):
        start = robot.forward_kinematics(robot.sample(rng))
        way = rng.normal(size=3)
        way *= 0.15 / np.linalg.norm(way)
        corners = [start, pin.SE3(start.rotation, start.translation + way)]
        targets = [FreeAxis(pose, axis=[0.0, 0.0, 1.0]) for pose in corners]
        plain = plan_path(IKSolver(robot), targets, dt=0.05, timing="slow")
        if not plain.success:
            continue
        elbow = robot.forward_kinematics(plain.q[len(plain) // 2], "link_3").translation
        scene = Scene([Sphere("ball", 0.05, elbow)])
        assert np.min(robot.clearance(plain.q, scene)) < 0.0
        solver = IKSolver(robot, scene=scene, collision="reject", clearance=0.01)
        result = plan_path(solver, targets, dt=0.05, timing="slow")
        if not result.success:
            assert "contact of" in result.message or "of line 0" in result.message
            continue
        around += 1
        assert off_the_lines(tool_poses(robot, result.q)[0], corners).max() < 1e-8
        assert result.clearance.min() > 0.01
        between = 0.5 * (result.q[1:] + result.q[:-1])
        assert np.min(robot.clearance(between, scene)) > 0.01 - 1e-3
    assert around > lines / 8


def test_thin_obstacles_between_waypoints_are_seen(robot: Robot) -> None:
    corners = [at(0.4, -0.5, 0.3), at(0.4, 0.1, 0.3)]
    wall = Scene([Box("wall", [0.4, 0.002, 0.4], [0.5, -0.1, 0.2])])
    solver = IKSolver(robot, scene=wall, collision="reject")
    result = plan_path(solver, corners, dt=0.05, speed=0.2)
    assert not result.success
    assert "contact of" in result.message
    assert "wall" in result.message
    reached = [row for row, status in enumerate(result.status) if status != "HELD"]
    assert np.min(robot.clearance(result.q[reached], wall)) > 0.0


def test_a_path_that_begins_in_an_obstacle_leaves_the_arm_where_it_is(robot: Robot) -> None:
    corners = [at(0.4, -0.4, 0.3), at(0.4, -0.3, 0.3)]
    scene = Scene([Sphere("ball", 0.1, corners[0].translation)])
    result = plan_path(IKSolver(robot, scene=scene, collision="reject"), corners, dt=0.05)
    assert not result.success
    assert "no configuration at the first pose: contact of" in result.message
    np.testing.assert_array_equal(result.q, np.tile(robot.home, (len(result), 1)))
    assert result.clearance.min() > 0.0
    assert result.time_limited == pytest.approx(result.t[-1])


def test_how_far_the_best_way_comes(robot: Robot) -> None:
    corners = [at(0.4, -0.4, 0.3), at(0.4, 1.4, 0.3)]
    result = plan_path(IKSolver(robot), corners, dt=0.05, speed=0.2, timing="slow")
    assert not result.success
    assert "of line 0" in result.message
    assert "out of reach" in result.message or "limit" in result.message
    ok = [status == "OK" for status in result.status]
    assert 0.1 < np.mean(ok) < 0.9
    assert ok.index(False) == sum(ok)
    assert result.position_error[ok].max() < 1e-8
    nowhere = plan_path(IKSolver(robot), [at(2.0, 0.0, 0.3), at(2.1, 0.0, 0.3)], dt=0.05)
    assert not nowhere.success
    assert "no configuration at the first pose: out of reach" in nowhere.message


def test_from_where_the_arm_is(robot: Robot) -> None:
    corners = [robot.forward_kinematics(robot.home)]
    corners.append(pin.SE3(corners[0].rotation, corners[0].translation + np.array([0.0, 0.0, 0.1])))
    turned = robot.home.copy()
    turned[0] += 4.0 * np.pi
    result = plan_path(IKSolver(robot), corners, start=turned)
    check(robot, result, corners)
    np.testing.assert_allclose(result.q[0], turned, atol=1e-6)
    check_lead_in(IKSolver(robot), corners, turned + 0.1)


def check_lead_in(solver: IKSolver, corners: list[pin.SE3], start: Array) -> None:
    """From elsewhere the arm first moves to where the path begins."""
    robot = solver.robot
    result = plan_path(solver, corners, start=start)
    assert result.success
    assert result.status[0] == "LEAD_IN"
    count = result.status.count("LEAD_IN")
    assert "after a motion of" in result.message
    first = robot.forward_kinematics(result.q[count])
    np.testing.assert_allclose(first.translation, corners[0].translation, atol=1e-6)
    assert (np.abs(result.v) <= robot.velocity_limit + 1e-9).all()
    assert result.failed_segments == ()
    assert max(result.largest_errors) < 1e-6


def test_the_way_to_the_first_pose_is_clear_and_saved(robot: Robot, tmp_path: Path) -> None:
    corners = [at(0.4, -0.4, 0.3), at(0.4, -0.3, 0.3)]
    scene = Scene([Box("table", [0.6, 0.6, 0.05], [0.5, -0.5, 0.1])])
    solver = IKSolver(robot, scene=scene, collision="reject")
    result = plan_path(solver, corners, start=robot.home, timing="slow", acceleration_limit=1.0)
    assert result.success, result.message
    np.testing.assert_array_equal(result.q[0], robot.home)
    assert result.clearance.min() > 0.0
    change = np.diff(np.vstack([np.zeros_like(result.v[:1]), result.v]), axis=0) / 0.01
    assert (np.abs(change) <= 1.0 + 1e-6).all()
    result.save(tmp_path / "plan.csv")
    again = Trajectory.load(tmp_path / "plan.csv")
    assert again.success
    np.testing.assert_array_equal(again.position_error, result.position_error)
    assert "largest error" in str(again)


def test_the_path_begins_where_the_motion_to_it_ends(robot: Robot) -> None:
    """Around a wall the motion may end in another turn of a joint."""
    solver = IKSolver(robot, scene=Scene([Box("wall", [0.02, 0.9, 1.2], [0.25, 0.0, 0.6])]))
    first = robot.forward_kinematics([-1.7, 1.3, 4.0, 1.3, 2.5, 0.0])
    start = np.array([-1.9, 4.8, 3.8, -2.5, -3.0, 2.4])
    for timing in ("slow", "keep"):
        result = plan_path(solver, [first, moved(first, 0.0, 0.0, 0.02)], 0.01, speed=0.1, timing=timing, start=start)
        assert result.success
        np.testing.assert_array_equal(result.q[0], start)
        check_as_controllers_go(result)


@pytest.mark.parametrize("count", [6, pytest.param(25, marks=pytest.mark.slow)])
def test_arms_with_two_turns_do_not_jump(tmp_path: Path, rng: np.random.Generator, count: int) -> None:
    (tmp_path / "ur5.urdf").write_text(ur5_text())
    arm = jacokin.load_robot(tmp_path / "ur5.urdf")
    solver, found = IKSolver(arm), 0
    for _ in range(count):
        first = arm.forward_kinematics(arm.sample(rng))
        corners, start = [first, moved(first, 0.0, 0.0, 0.02)], arm.sample(rng)
        result = plan_path(solver, corners, 0.01, speed=0.1, timing="slow", start=start, acceleration_limit=2.0)
        if result.success:
            found += 1
            np.testing.assert_array_equal(result.q[0], start)
            check_as_controllers_go(result, 2.0)
    assert found > count / 2


@pytest.mark.parametrize("limits", [(-20.0, 20.0), (-3.0, np.inf)], ids=["many turns", "one side"])
def test_joints_of_many_turns_stay_around_where_they_are(limits: tuple[float, float]) -> None:
    """All copies of all joints would be half a million solutions at each place, or as many as one likes."""
    robot = jacokin.load_robot(limits={f"joint_{number}": limits for number in range(1, 7)})
    corners = [robot.forward_kinematics(q) for q in (robot.home, robot.home + 0.02)]
    result = plan_path(IKSolver(robot), corners, start=robot.home, timing="slow")
    check(robot, result, corners)
    np.testing.assert_allclose(result.q[-1], robot.home + 0.02, atol=1e-9)


def test_rows_are_added_where_the_way_between_them_would_touch(robot: Robot) -> None:
    start, end = at(0.4, -0.4, 0.3), at(0.4, -0.1, 0.3)
    post = Scene([Box("post", [0.05, 0.02, 0.3], [0.4, -0.25, 0.12])])
    solver = IKSolver(robot, scene=post)
    fine = plan_path(solver, [start, end], dt=0.01, speed=0.5, timing="slow", velocity_limit=2.0)
    coarse = plan_path(solver, [start, end], dt=0.5, speed=0.5, timing="slow", velocity_limit=2.0)
    if fine.success:
        assert coarse.success
        assert "in rows of" in coarse.message
        assert np.diff(coarse.t).max() < 0.5


def test_no_way_to_the_first_pose_is_said(robot: Robot) -> None:
    there = robot.forward_kinematics(robot.home).translation
    solver = IKSolver(robot, scene=Scene([Sphere("ball", 0.05, there)]), collision="reject")
    result = plan_path(solver, [at(-0.4, 0.3, 0.3), at(-0.4, 0.4, 0.3)], start=robot.home, dt=0.05)
    assert not result.success
    assert "no way from the start" in result.message
    assert "ball" in result.message
    np.testing.assert_array_equal(result.q, np.tile(robot.home, (len(result), 1)))


GOOD = [at(0.4, -0.4, 0.3), at(0.4, -0.3, 0.3)]
BAD = np.array([pose.homogeneous for pose in GOOD])
BAD[1, 0, 3] = np.nan


@pytest.mark.parametrize(
    ("arguments", "match"),
    [
        ({"targets": GOOD[:1]}, "at least two targets, got 1"),
        ({"targets": BAD}, r"targets\[1\]"),
        ({"targets": 3.0}, "targets must be a sequence"),
        ({"targets": [GOOD[0], GOOD[0]]}, "all waypoints are the same"),
        ({"targets": [GOOD[0], at(1e6, 0.0, 0.0)], "speed": 1e5}, "the path is .* m long: more than 50000 steps"),
        (
            {"targets": [FreeAxis(GOOD[0], axis=[1, 0, 0]), FreeAxis(GOOD[1], axis=[-1, 0, 0])]},
            r"free axes of targets\[0\] and targets\[1\] are opposite",
        ),
        ({"solver": "j2n6s300"}, "solver must be an IKSolver"),
        ({"timing": "slowly"}, "timing 'slowly'. Did you mean 'slow'"),
        ({"acceleration_limit": 1.0}, "acceleration_limit needs timing='slow'"),
        ({"seed": [4.8, 2.9, 1.0, 4.2, 1.4, 1.3], "start": [4.8, 2.9, 1.0, 4.2, 1.4, 1.3]}, "at most one of seed and"),
        ({"dt": -1.0}, "dt must be"),
        ({"dt": 100.0}, "less than one control step"),
        ({"speed": -1.0}, "speed must be"),
        ({"angular_speed": -1.0}, "angular_speed must be"),
        ({"velocity_limit": -1.0}, "velocity_limit must be"),
        ({"free_step": -1.0}, "free_step must be"),
        ({"free_step": 1e-3}, "free_step must be at least 0.01 rad"),
    ],
)
def test_wrong_arguments_are_refused(robot: Robot, arguments: dict[str, Any], match: str) -> None:
    given = {"solver": IKSolver(robot), "targets": GOOD, **arguments}
    with pytest.raises((InvalidInputError, UnknownNameError), match=match):
        plan_path(given.pop("solver"), given.pop("targets"), **given)


def test_limits_beyond_all_bounds(robot: Robot) -> None:
    """Huge ones are held or refused; with tiny ones the path would take years, which is refused."""
    solver, corners = IKSolver(robot), [at(0.4, -0.4, 0.3), at(0.4, -0.3, 0.3)]
    for limits in (
        {"acceleration_limit": 1e6},
        {"velocity_limit": 1e4},
        {"velocity_limit": 1e4, "acceleration_limit": 1e6},
    ):
        assert plan_path(solver, corners, dt=0.05, timing="slow", **limits).success
    for name, bound in (("acceleration_limit", 1e6), ("velocity_limit", 1e4)):
        for size in (1.001 * bound, 1e12, 1e15, 1e308):
            with pytest.raises(InvalidInputError, match=f"{name} must be at most"):
                plan_path(solver, corners, dt=0.05, timing="slow", **{name: size})
    assert track_path(robot, corners, dt=0.05, acceleration_limit=1e6).success
    for acceleration in (1e-12, 1e-300):
        with pytest.raises(InvalidInputError, match="more than 10000000 ticks"):
            plan_path(solver, corners, dt=0.05, timing="slow", acceleration_limit=acceleration)
    for velocity in (1e-12, 1e-300):
        with pytest.raises(InvalidInputError, match="velocity_limit must be at least 1e-06 rad/s"):
            plan_path(solver, corners, dt=0.05, timing="slow", velocity_limit=velocity)


def test_gaps_are_not_looked_at_for_longer_than_the_time(tmp_path: Path) -> None:
    """Straight down on five joints the angle about the axis is free, so that places have points at some angles only."""
    arm = load("so101", tmp_path)
    tool = jacokin.pose([-0.018, 2e-4, -0.003], rpy=[0.0, np.pi, 0.0])
    solver = IKSolver(arm, tool=tool, orientation_tolerance=1e-5)
    ends = [FreeAxis(jacokin.pose([0.18, -0.08, z]), axis=[0.0, 0.0, 1.0]) for z in (0.065, 0.025)]
    begun = time.monotonic()
    found = plan_path(solver, ends, speed=0.1, timing="slow", time_limit=0.2)
    assert time.monotonic() - begun < 5.0
    assert not found.success
    assert "a gap between branches" in found.message
    assert "as far as there was time to look" in found.message


def test_five_joints_follow_poses_that_they_reach_within_the_tolerances(tmp_path: Path) -> None:
    """Angles in their file have five digits, so the poses on the way are missed by some 1e-8 m and rad."""
    arm = load("so101", tmp_path)
    solver = IKSolver(arm, collision="ignore", orientation_tolerance=1e-5)
    begin = arm.forward_kinematics(arm.home)
    for offset in ([0.0, 0.0, -0.03], [-0.03, 0.0, 0.0]):  # [m] in the plane in which the arm folds
        end = pin.SE3(begin.rotation, begin.translation + np.array(offset))
        path = plan_path(solver, [begin, end], speed=0.05, timing="slow")
        assert path.success, path.message
        assert path.position_error.max() <= 1e-6
        assert path.orientation_error.max() <= 1e-5
        assert path.position_error.max() > 1e-9  # to rounding there is no such path
    sideways = pin.SE3(begin.rotation, begin.translation + np.array([0.0, 0.01, 0.0]))
    assert not plan_path(solver, [begin, sideways], speed=0.05, timing="slow").success


def test_five_joints_follow_poses_that_they_reach_within_loose_tolerances(tmp_path: Path) -> None:
    """Sideways an arm of five joints turns with its base, or its tool would not go there."""
    arm = load("so101", tmp_path)
    solver = IKSolver(arm, collision="ignore", orientation_tolerance=0.2)
    begin = arm.forward_kinematics(arm.home)
    begin = pin.SE3(pin.rpy.rpyToMatrix(0.03, 0.0, 0.04) @ begin.rotation, begin.translation)
    end = pin.SE3(begin.rotation, begin.translation + np.array([-0.03, 0.03, 0.01]))
    path = plan_path(solver, [begin, end], speed=0.05, timing="slow")
    assert path.success, path.message
    assert path.position_error.max() <= 1e-6
    assert 0.02 < path.orientation_error.max() <= 0.2


def test_an_arm_without_a_closed_form_is_refused(robot: Robot) -> None:
    with pytest.raises(StructureError, match="plan_path needs a closed form"):
        plan_path(IKSolver(robot, "link_4"), [at(0.4, -0.4, 0.3), at(0.4, -0.3, 0.3)])


def test_a_start_outside_the_limits_comes_back_first(robot: Robot) -> None:
    start = robot.home.copy()
    start[1] = robot.lower[1] - 0.05
    poses = [jacokin.pose([0.4, y, 0.4], down=True) for y in (-0.3, -0.2)]
    path = plan_path(IKSolver(robot), poses, start=start, timing="slow")
    assert path.success, path.message
    np.testing.assert_array_equal(path.q[0], start)
    past = np.maximum(robot.lower - path.q, 0.0).max(axis=1)
    assert (np.diff(past) <= 1e-12).all()
    assert past[-1] == 0.0
