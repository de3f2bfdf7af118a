"""Planned paths with parameters to choose: free axes, the elbow of seven joints, and both; measured by MuJoCo."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray

import jacokin
from jacokin import FreeAxis, IKSolver, Robot, plan_path
from jacokin.errors import InvalidInputError
from jacokin.ik import Scene, Sphere
from jacokin.motion import AxisTarget, PositionTarget, Trajectory, track_path
from tests.ik.test_few_joints import CHAINS, urdf_of
from tests.motion.by_mujoco import at, random_line, tool_poses
from tests.motion.planning.test_plan import check_lead_in
from tests.seven_joint_arms import load_arm

SEVEN = "j2s7s300"


@pytest.fixture
def seven(bundled: Callable[[str], Robot]) -> Robot:
    return bundled(SEVEN)


def check_limits(robot: Robot, result: Trajectory) -> None:
    """Positions exactly, velocities to rounding, at every tick."""
    assert (result.q >= robot.lower).all()
    assert (result.q <= robot.upper).all()
    assert (np.abs(np.diff(result.q, axis=0)) <= robot.velocity_limit * np.diff(result.t)[:, None] + 1e-9).all()


def check_line(robot: Robot, result: Trajectory, corners: list[pin.SE3]) -> None:
    """On the straight line between two full poses at every tick, from end to end."""
    start, end = corners
    way, turn = end.translation - start.translation, pin.log3(start.rotation.T @ end.rotation)
    positions, rotations = tool_poses(robot, result.q)
    part = (positions - start.translation) @ way / (way @ way)
    assert part[0] == pytest.approx(0.0, abs=1e-7)
    assert part[-1] == pytest.approx(1.0, abs=1e-7)
    assert np.abs(positions - start.translation - part[:, None] * way).max() < 1e-8
    wanted = [start.rotation @ pin.exp3(p * turn) for p in part]
    np.testing.assert_allclose(rotations, wanted, atol=1e-7)


@pytest.mark.parametrize(("lines", "least"), [(2, 0), pytest.param(5, 1, marks=pytest.mark.slow)])
def test_seven_joints_follow_lines_within_their_limits(seven: Robot, lines: int, least: int) -> None:
    rng = np.random.default_rng(0)
    solver = IKSolver(seven)
    planned = tracked = 0
    for _ in range(lines):
        corners = random_line(seven, rng)
        result = plan_path(solver, corners, dt=0.02, speed=0.1, timing="slow")
        followed = track_path(seven, corners, dt=0.02, speed=0.1).success
        assert result.success or not followed
        if result.success:
            check_limits(seven, result)
            check_line(seven, result, corners)
            np.testing.assert_allclose(result.parameter, result.q[[0, -1], 2], atol=1e-9)
        else:
            assert "of line 0" in result.message or "at the first pose" in result.message
        planned += result.success
        tracked += followed
    assert planned >= tracked >= least


def test_seven_joints_start_where_the_arm_is(seven: Robot) -> None:
    corners = [seven.forward_kinematics(seven.home)]
    corners.append(pin.SE3(corners[0].rotation, corners[0].translation + np.array([0.0, 0.05, 0.05])))
    solver = IKSolver(seven)
    for start in (None, seven.home):
        result = plan_path(solver, corners, start=start)
        check_limits(seven, result)
        check_line(seven, result, corners)
        np.testing.assert_allclose(result.q[0], seven.home, atol=1e-6 if start is not None else 0.3)
    check_lead_in(solver, corners, seven.home + 0.1)


@pytest.mark.parametrize(("end", "axis"), [(-0.1, None), (-0.2, np.array([0.0, 0.0, 1.0]))])
def test_seven_joints_go_around_an_obstacle(seven: Robot, end: float, axis: NDArray[np.float64] | None) -> None:
    """A ball where the elbow would be: another elbow, clear at every tick and between."""
    corners = [at(0.4, -0.3, 0.4), at(0.4, end, 0.4)]
    targets = corners if axis is None else [FreeAxis(pose, axis=axis, range=(-0.5, 0.5)) for pose in corners]
    plain = plan_path(IKSolver(seven), targets, dt=0.05, timing="slow")
    assert plain.success
    elbow = seven.forward_kinematics(plain.q[len(plain) // 2], "link_4").translation
    scene = Scene([Sphere("ball", 0.05, elbow)])
    assert np.min(seven.clearance(plain.q, scene)) < 0.0
    solver = IKSolver(seven, scene=scene, collision="reject", clearance=0.01)
    result = plan_path(solver, targets, dt=0.05, timing="slow")
    assert result.success
    check_limits(seven, result)
    if axis is None:
        check_line(seven, result, corners)
    else:
        check_axis(seven, result, corners, axis)
    between = 0.5 * (result.q[1:] + result.q[:-1])
    assert np.min(seven.clearance(np.vstack([result.q, between]), scene)) > 0.01 - 1e-3


def check_axis(robot: Robot, result: Trajectory, corners: list[pin.SE3], axis: NDArray[np.float64]) -> None:
    """On the straight line between poses that differ by their place, the axis as it is there, at every tick."""
    start, end = (corner.translation for corner in corners)
    positions, rotations = tool_poses(robot, result.q)
    part = (positions - start) @ (end - start) / ((end - start) @ (end - start))
    assert part[0] == pytest.approx(0.0, abs=1e-7)
    assert part[-1] == pytest.approx(1.0, abs=1e-7)
    assert (np.diff(part) >= -1e-9).all()
    assert np.abs(positions - start - part[:, None] * (end - start)).max() < 1e-8
    np.testing.assert_allclose(rotations @ axis, np.tile(corners[0].rotation @ axis, (len(result), 1)), atol=1e-7)


@pytest.mark.parametrize("timing", ["slow", pytest.param("keep", marks=pytest.mark.slow)])
def test_seven_joints_choose_the_angle_about_an_axis_with_the_elbow(seven: Robot, timing: str) -> None:
    """On the line, steady, and with less motion than at the angles where it begins or ends, or the corners' own."""
    corners, axis = [at(0.4, -0.4, 0.3), at(0.4, -0.25, 0.3)], np.array([1.0, 0.0, 0.0])
    solver = IKSolver(seven)
    targets = [FreeAxis(pose, axis=axis) for pose in corners]
    result = plan_path(solver, targets, dt=0.02, speed=0.1, timing=timing, seed=seven.home)
    assert result.success
    check_limits(seven, result)
    check_axis(seven, result, corners, axis)
    _, rotations = tool_poses(seven, result.q[[0, -1]])
    for target, parameter, rotation in zip(targets, result.parameter, rotations, strict=True):
        np.testing.assert_allclose(target.at(float(parameter)).rotation, rotation, atol=1e-7)
    assert np.abs(np.diff(result.v[1:-1], axis=0)).max() < 0.03
    for angle in (0.0, *result.parameter.tolist()):
        fixed = plan_path(solver, [target.at(angle) for target in targets], dt=0.02, speed=0.1, timing=timing)
        assert motion_of(result) < 1.001 * motion_of(fixed)


def motion_of(result: Trajectory) -> float:
    """Squared joint speeds over time, which a plan makes small [rad^2/s]."""
    return float((np.diff(result.q, axis=0) ** 2).sum() / result.t[1])


@pytest.mark.parametrize("name", ["panda", pytest.param("gen3", marks=pytest.mark.slow)])
def test_seven_joints_of_other_makers_turn_about_an_axis(name: str, tmp_path: Path) -> None:
    """In a range of its own, with a full pose between: the parameter is nan there."""
    arm = load_arm(name, tmp_path)
    q = np.array([0.2, 0.4, -0.3, -1.6, 0.2, 1.5, 0.4])
    start = arm.forward_kinematics(q)
    places = [pin.SE3(start.rotation, start.translation + np.array(step)) for step in ([0, 0, 0], [0, 0.06, 0.02])]
    targets = [
        FreeAxis(places[0], axis=[0.0, 1.0, 1.0], range=(0.1, 0.5)),
        places[1],
        FreeAxis(places[0], axis=[0.0, 1.0, 1.0], range=(-0.4, -0.2)),
    ]
    result = plan_path(IKSolver(arm), targets, dt=0.02, speed=0.02, start=q)  # waypoints are rows
    assert result.success
    check_limits(arm, result)
    assert np.isnan(result.parameter).tolist() == [False, True, False]
    assert max(result.largest_errors) < 1e-6
    rows = [result.status.count("LEAD_IN"), *(int(np.flatnonzero(result.segment == line)[-1]) for line in (0, 1))]
    for row, angle, target in zip(rows, result.parameter.tolist(), targets, strict=True):
        if isinstance(target, FreeAxis):
            assert target.range[0] <= angle <= target.range[1]
            target = target.at(angle)
        reached = arm.forward_kinematics(result.q[row])
        np.testing.assert_allclose(reached.homogeneous, target.homogeneous, atol=1e-6)


def test_a_start_whose_angle_is_out_of_range_is_led_to_the_path(robot: Robot) -> None:
    start = robot.forward_kinematics(robot.home)
    places = [start, pin.SE3(start.rotation, start.translation + np.array([0.0, 0.06, 0.02]))]
    solver = IKSolver(robot)
    for low, high in ((0.1, 0.5), (-0.1, 0.5)):
        targets = [FreeAxis(place, axis=[0.0, 1.0, 1.0], range=(low, high)) for place in places]
        result = plan_path(solver, targets, dt=0.02, speed=0.05, timing="slow", start=robot.home)
        assert result.success
        assert ("LEAD_IN" in result.status) is (low > 0.0)
        np.testing.assert_allclose(result.q[0], robot.home, atol=1e-9)
        assert low - 1e-6 <= result.parameter[0] <= high + 1e-6


@pytest.mark.parametrize(("begin", "end"), [(-0.43, -0.55), pytest.param(-0.3, -0.6, marks=pytest.mark.slow)])
def test_seven_joints_say_which_line_leads_out_of_reach_about_an_axis(seven: Robot, begin: float, end: float) -> None:
    away = [FreeAxis(at(0.4, y, 0.4), axis=[0.0, 0.0, 1.0], range=(-0.5, 0.5)) for y in (begin, end)]
    far = plan_path(IKSolver(seven), away, dt=0.05, speed=0.5)
    assert "of line 0" in far.message
    assert np.isnan(far.parameter).tolist() == [False, True]


def test_targets_of_the_tracker_are_waypoints(robot: Robot) -> None:
    """A position and an axis are a free axis; a side grasp by name is the same."""
    solver = IKSolver(robot)
    places = [[0.4, -0.4, 0.4], [0.4, -0.3, 0.4]]
    result = plan_path(solver, [[PositionTarget(place), AxisTarget([1.0, 0.0, 0.0])] for place in places], dt=0.05)
    named = plan_path(solver, [jacokin.pose(place, approach=[1.0, 0.0, 0.0]) for place in places], dt=0.05)
    for found in (result, named):
        assert found.success
        _, rotations = tool_poses(robot, found.q)
        np.testing.assert_allclose(rotations[:, :, 2], np.tile([1.0, 0.0, 0.0], (len(found), 1)), atol=1e-7)
    with pytest.raises(InvalidInputError, match=r"targets\[1\] leaves the orientation free"):
        plan_path(solver, [at(0.4, -0.4, 0.4), PositionTarget(places[1])])
    with pytest.raises(InvalidInputError, match=r"targets\[0\]: the position is free"):
        plan_path(solver, [AxisTarget([1.0, 0.0, 0.0]), at(0.4, -0.4, 0.4)])


def test_too_fine_and_too_long_is_refused(robot: Robot, seven: Robot) -> None:
    """What would take hours or all of the memory."""
    solver = IKSolver(robot)
    targets = [FreeAxis(at(0.4, y, 0.4), axis=[0, 0, 1]) for y in (-0.3, -0.1)]
    with pytest.raises(InvalidInputError, match="free_step must be at least 0.01 rad, got 1e-09"):
        plan_path(solver, targets, free_step=1e-9)
    far = [FreeAxis(at(0.4, y, 0.4), axis=[0, 0, 1]) for y in (20.0, 200.0)]
    with pytest.raises(InvalidInputError, match=r"the path is .* m long: more than 10000 steps"):
        plan_path(solver, [targets[0], far[1]], speed=10.0)
    with pytest.raises(InvalidInputError, match=r"the path is .* m long: more than 1000 steps"):
        plan_path(IKSolver(seven), [targets[0], far[0]], speed=10.0)
    with pytest.raises(InvalidInputError, match="free_step must be at least 0.1 rad, got 0.05"):
        plan_path(IKSolver(seven), targets, free_step=0.05)


def test_narrow_windows_are_found(robot: Robot) -> None:
    """Limits that leave a few hundredths of a radian: values of the angle every 10 degrees miss it."""
    targets = [FreeAxis(at(0.4, y, 0.3), axis=[1, 0, 0]) for y in (-0.4, -0.2)]
    wide = plan_path(IKSolver(robot), targets, dt=0.05, timing="slow")
    assert wide.success
    low, high = wide.q.min(axis=0) - 0.005, wide.q.max(axis=0) + 0.005
    limits = {f"joint_{j + 1}": (float(low[j]), float(high[j])) for j in (0, 1, 2, 4)}
    narrow = jacokin.load_robot(limits=limits)
    solver = IKSolver(narrow)
    for target in targets:
        assert max(interval.length for interval in solver.solve_all(target).intervals) < 0.1
    result = plan_path(solver, targets, dt=0.05, timing="slow")
    assert result.success
    check_limits(narrow, result)


def test_each_waypoint_has_an_axis_and_a_range_of_its_own(robot: Robot) -> None:
    targets = [
        FreeAxis(at(0.4, -0.4, 0.3), axis=[0, 0, 1], range=(0.3, 0.8)),
        FreeAxis(at(0.4, -0.2, 0.3), axis=[1, 0, 1], range=(-0.2, 0.1)),
        at(0.4, -0.1, 0.35),
        FreeAxis(at(0.3, -0.1, 0.35), axis=[0, 1, 0]),
    ]
    result = plan_path(IKSolver(robot), targets, dt=0.02, speed=0.1)
    assert result.success
    check_limits(robot, result)
    assert np.isnan(result.parameter).tolist() == [False, False, True, False]
    rows = [0, *(int(np.flatnonzero(result.segment == line)[-1]) for line in range(3))]  # ticks at the waypoints
    _, rotations = tool_poses(robot, result.q[rows])
    for target, parameter, rotation in zip(targets, result.parameter, rotations, strict=True):
        if isinstance(target, FreeAxis):
            assert target.range[0] <= parameter <= target.range[1]
            target = target.at(float(parameter))
        np.testing.assert_allclose(rotation, target.rotation, atol=1e-7)


@pytest.mark.slow
def test_the_joints_move_steadily(robot: Robot, seven: Robot) -> None:
    """Free angles are tried in steps, and followed without: no tick is much faster than its neighbours."""
    corners = [at(0.4, -0.4, 0.3), at(0.4, 0.0, 0.3)]
    for arm, targets in ((robot, [FreeAxis(pose, axis=[1, 0, 0]) for pose in corners]), (seven, corners)):
        result = plan_path(IKSolver(arm), targets, dt=0.02, speed=0.1)
        assert result.success
        assert np.abs(np.diff(result.v[1:], axis=0)).max() < 0.02
        assert np.ptp(result.parameter) > 1e-3 or arm is seven
    solver = IKSolver(robot)
    fixed = plan_path(solver, corners, dt=0.02, speed=0.1)
    targets = [FreeAxis(pose, axis=[1, 0, 0]) for pose in corners]
    free = plan_path(solver, targets, dt=0.02, speed=0.1, start=fixed.q[0])
    assert free.success
    assert (free.v**2).sum() < 0.9 * (fixed.v**2).sum()


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["free", "seven"])
def test_out_of_reach_and_out_of_limits_are_said(robot: Robot, seven: Robot, kind: str) -> None:
    arm = robot if kind == "free" else seven
    corners: list[pin.SE3 | FreeAxis] = [at(0.4, -0.4, 0.3), at(0.4, 1.4, 0.3)]
    if kind == "free":
        corners = [FreeAxis(pose, axis=[1, 0, 0]) for pose in corners]
    result = plan_path(IKSolver(arm), corners, dt=0.05, speed=0.2, timing="slow")
    assert not result.success
    assert "of line 0" in result.message
    assert np.isfinite(result.parameter[0])
    assert np.isnan(result.parameter[1])
    check_limits(arm, result)
    nowhere = plan_path(IKSolver(arm), [at(2.0, 0.0, 0.3), at(2.1, 0.0, 0.3)], dt=0.05)
    assert "no configuration at the first pose: out of reach" in nowhere.message


@pytest.mark.parametrize("kind", ["pose", "free", "seven"])
def test_saved_plans_come_back_with_what_was_chosen(robot: Robot, seven: Robot, tmp_path: Path, kind: str) -> None:
    arm = seven if kind == "seven" else robot
    targets: list[pin.SE3 | FreeAxis] = [at(0.4, -0.3, 0.3), at(0.4, -0.2, 0.3)]
    if kind == "free":
        targets[1] = FreeAxis(targets[1], axis=[1, 0, 0], range=(0.1, 0.2))
    result = plan_path(IKSolver(arm), targets, dt=0.013, speed=0.1, timing="slow")
    assert result.success
    for name in ("plan.csv", "plan.npz"):
        result.save(tmp_path / name)
        again = Trajectory.load(tmp_path / name)
        np.testing.assert_array_equal(again.q, result.q)
        np.testing.assert_array_equal(again.parameter, result.parameter)
        assert again.message == result.message
        assert not again.parameter.flags.writeable
    result.save(tmp_path / "plan.json")
    points = json.loads((tmp_path / "plan.json").read_text())["points"]
    np.testing.assert_array_equal([point["positions"] for point in points], result.q)
    result.save(tmp_path / "plan.kinova.csv")
    rows = np.loadtxt(tmp_path / "plan.kinova.csv", delimiter=",", skiprows=1)
    assert rows.shape[1] == 1 + 2 * arm.dof
    np.testing.assert_allclose(np.diff(rows[:, 0]), 0.01, atol=1e-12)
    np.testing.assert_allclose(np.diff(rows[:, 1 : 1 + arm.dof], axis=0), 0.01 * rows[:-1, 1 + arm.dof :], atol=1e-9)
    assert (np.abs(rows[:, 1 + arm.dof :]) <= np.degrees(arm.velocity_limit) + 1e-7).all()


@pytest.mark.slow
def test_accelerations_are_held_where_the_angle_runs_along_its_range(robot: Robot) -> None:
    """There the joints' motion has a kink, between waypoints: the arm slows down for it."""
    rng = np.random.default_rng(4)
    solver = IKSolver(robot)
    solved = 0
    for _ in range(8):
        targets: list[pin.SE3 | FreeAxis] = []
        pose = robot.forward_kinematics(robot.sample(rng))
        for _ in range(3):
            low = rng.uniform(-1.0, 1.0)
            targets.append(FreeAxis(pose, axis=[1, 0, 0], range=(low, low + rng.uniform(0.01, 0.5))))
            way = rng.normal(size=3)
            pose = pin.SE3(pose.rotation, pose.translation + 0.1 * way / np.linalg.norm(way))
        result = plan_path(solver, targets, dt=0.02, speed=0.2, timing="slow", acceleration_limit=1.5)
        if result.success:
            check_limits(robot, result)
            assert np.abs(result.a).max() <= 1.5 * (1.0 + 1e-6)
            solved += 1
    assert solved >= 2


@pytest.mark.slow
def test_seven_joints_count_turns_and_keep_to_a_cable() -> None:
    """Once round the base; where joint 1 has room for less, that is the reason."""
    circle = [at(0.35 * np.cos(a), 0.35 * np.sin(a), 0.4) for a in np.linspace(0.0, 2.0 * np.pi, 25)]
    free = plan_path(IKSolver(jacokin.load_robot(SEVEN)), circle, dt=0.05, speed=0.2, timing="slow")
    assert free.success
    assert np.ptp(free.q[:, 0]) > 1.7 * np.pi
    cable = jacokin.load_robot(SEVEN, limits={"joint_1": (2.0, 6.0)})
    part = plan_path(IKSolver(cable), circle[:10], dt=0.05, speed=0.2, timing="slow")
    assert part.success
    check_limits(cable, part)
    whole = plan_path(IKSolver(cable), circle, dt=0.05, speed=0.2, timing="slow")
    assert not whole.success
    assert "joint_1 runs into its limit" in whole.message
    check_limits(cable, whole)


def test_seven_joints_of_any_structure_have_curves_along_the_way(tmp_path: Path) -> None:
    (tmp_path / "seven.urdf").write_text(urdf_of(CHAINS["seven"]))
    solver = IKSolver(jacokin.load_robot(tmp_path / "seven.urdf"))
    q = np.linspace(0.3, -0.7, 7)
    assert solver.parameter == "joint_7"
    targets = [solver.robot.forward_kinematics(row) for row in (q, q + 0.05)]
    result = plan_path(solver, targets, dt=0.05, seed=q)
    assert result.success
    np.testing.assert_allclose(result.parameter, result.q[[0, -1], 6], atol=1e-6)
    assert np.linalg.norm(solver.robot.forward_kinematics(result.q[-1]).translation - targets[1].translation) < 1e-5
