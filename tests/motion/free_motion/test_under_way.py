"""Plans from a motion under way: continuous in position and velocity, within the limits, clear, or an honest status."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import jacokin
from jacokin import IKSolver, Robot, Tracker
from jacokin.errors import InvalidInputError
from jacokin.ik import Box, Scene, Sphere
from jacokin.motion import MotionState, Trajectory, plan_motion
from jacokin.motion.free_motion.under_way import brake
from tests.motion.free_motion.test_plan_motion import WALL, between, touches

ACCELERATION = 1.0  # [rad/s^2]
FREE = Scene()


def state_of(robot: Robot, v: Any, q: Any = None) -> MotionState:
    return MotionState(robot.home if q is None else np.asarray(q), np.asarray(v, dtype=float), np.zeros(robot.dof))


def check(
    robot: Robot, scene: Scene, state: MotionState, motion: Trajectory, acceleration: float = ACCELERATION
) -> None:
    """It begins with the positions and velocities of the state, keeps all limits (finite differences), and is clear."""
    np.testing.assert_array_equal(motion.q[0], state.q)
    np.testing.assert_array_equal(motion.v[0], state.v)
    assert not motion.v[-1].any()
    assert (motion.q >= robot.lower).all()
    assert (motion.q <= robot.upper).all()
    dt = np.diff(motion.t)[:, None]
    assert (np.abs(motion.a) <= acceleration + 1e-8).all()
    assert (np.abs(np.diff(motion.v, axis=0) / dt) <= acceleration + 1e-8).all()
    mean = np.diff(motion.q, axis=0) / dt
    assert (np.abs(mean) <= robot.velocity_limit + 1e-9).all()
    # Velocities of the steps, the one before the first among them, change by no more than the limit allows either.
    steps = np.vstack([state.v, mean])
    assert (np.abs(np.diff(steps, axis=0)) <= acceleration * np.vstack([0.5 * dt[:1], dt[1:]]) + 1e-9).all()
    # The columns are one motion, whose accelerations change steadily but for where it rests on the way.
    gained = np.abs(np.diff(motion.v, axis=0) - 0.5 * dt * (motion.a[1:] + motion.a[:-1])).max(axis=1)
    moved = dt * motion.v[:-1] + dt**2 / 6.0 * (2.0 * motion.a[:-1] + motion.a[1:])
    gone = np.abs(np.diff(motion.q, axis=0) - moved).max(axis=1)
    assert ((gained < 1e-9) & (gone < 1e-9)).sum() >= len(motion) - 3
    assert gained.max() <= 0.2 * acceleration * dt.max()
    assert touches(robot, scene, between(motion, 0.02)) == 0


def reversals(v: NDArray[np.float64], limit: NDArray[np.float64]) -> int:
    """How often joints (n, dof) turn back, slower motions than 1 % of the limits (dof,) aside."""
    found = 0
    for column, least in zip(v.T, 0.01 * limit, strict=True):
        signs = np.sign(column[np.abs(column) > least])
        found += int((signs[1:] != signs[:-1]).sum())
    return found


@pytest.fixture(scope="module")
def through(robot: Robot) -> tuple[Robot, IKSolver, NDArray[np.float64], Any]:
    """An arm, its solver, a configuration on one side of a wall, and a pose on the other."""
    solver = IKSolver(robot, collision="reject", scene=WALL)
    start = solver.solve(jacokin.pose([0.4, -0.35, 0.3], down=True)).q
    return robot, solver, start, jacokin.pose([0.4, 0.25, 0.3], down=True)


def test_a_goal_that_stays_is_reached_as_soon(robot: Robot) -> None:
    """Planned anew at any time, a motion takes hardly longer, turns back nowhere, and mostly goes on."""
    goal = robot.home + np.array([1.2, 0.3, -0.4, 0.5, 0.2, 0.3])
    solver = IKSolver(robot)
    first = plan_motion(solver, robot.home, goal)
    times = np.linspace(0.05, 0.97, 24) * first.duration
    more, on = [], 0
    for time in times.tolist():
        state = first.state_at(time)
        motion = plan_motion(solver, state, goal)
        check(robot, FREE, state, motion)
        assert motion.success
        np.testing.assert_array_equal(motion.q[-1], goal)
        assert reversals(motion.v, robot.velocity_limit) == 0
        more.append(time + motion.duration - first.duration)
        on += "going on" in motion.message
    assert np.median(more) < 0.02
    assert max(more) < 0.1
    assert on >= 18  # while it brakes as hard as it may, a stop just before the goal comes first


def test_goals_that_move_are_reached_around_a_wall(through: Any) -> None:
    robot, solver, start, pose = through
    rng = np.random.default_rng(5)
    first, on = plan_motion(solver, start, pose, time_limit=30.0), 0
    for time in np.linspace(0.1, 0.9, 8).tolist():
        goal = pose.copy()
        goal.translation = goal.translation + rng.uniform(-0.03, 0.03, 3)
        state = first.state_at(time * first.duration)
        motion = plan_motion(solver, state, goal, time_limit=30.0)
        check(robot, WALL, state, motion)
        assert motion.success, motion.message
        reached = robot.forward_kinematics(motion.q[-1])
        np.testing.assert_allclose(reached.translation, goal.translation, atol=1e-6)
        on += "going on" in motion.message
    assert on >= 3


@pytest.mark.slow
def test_a_loop_of_plans_ends_at_its_goal(robot: Robot) -> None:
    """A goal that wanders for a second, planned for at 20 Hz."""
    solver, goal = IKSolver(robot), robot.home + np.array([0.8, 0.2, -0.3, 0.4, 0.2, 0.3])
    motion = plan_motion(solver, robot.home, goal)
    velocities = [motion.v[0]]
    for tick in range(20):
        velocities += list(motion.v[1:6])
        state = motion.state_at(0.05)
        goal = goal + 0.005 * np.sin(0.3 * tick)
        motion = plan_motion(solver, state, goal)
        check(robot, FREE, state, motion)
    velocities += list(motion.v[1:])
    np.testing.assert_array_equal(motion.q[-1], goal)
    assert (np.abs(np.diff(velocities, axis=0)) <= ACCELERATION * 0.01 + 1e-9).all()
    assert reversals(np.array(velocities), robot.velocity_limit) == 0
    assert len(velocities) * 0.01 < 3.5  # [s]


@pytest.mark.parametrize("count", [20, pytest.param(200, marks=pytest.mark.slow)])
def test_any_motion_is_stopped_or_led_on_or_refused(through: Any, count: int) -> None:
    robot, solver, _, _ = through
    rng = np.random.default_rng(count)
    outcomes = set()
    for _ in range(count):
        state = state_of(robot, rng.uniform(-1.0, 1.0, robot.dof) * robot.velocity_limit, robot.sample(rng))
        motion = plan_motion(solver, state, robot.sample(rng), time_limit=30.0)
        outcomes.add(motion.outcome)
        if motion.outcome == "CANNOT_STOP":
            assert len(motion) == 1
            np.testing.assert_array_equal(motion.v[0], state.v)
            assert "limit" in motion.message or "touch" in motion.message
        elif touches(robot, WALL, state.q[None]) == 0:
            check(robot, WALL, state, motion)
    assert {"OK", "CANNOT_STOP", "GOAL_IN_CONTACT"} <= outcomes


def test_towards_a_limit_the_arm_stops_before_it_or_says_that_it_cannot(robot: Robot) -> None:
    joint, away = 1, robot.home.copy()
    away[2] = 3.0  # there the links are clear of each other up to the limit
    v = np.zeros(robot.dof)
    v[joint] = robot.velocity_limit[joint]
    way = v[joint] ** 2 / (2.0 * ACCELERATION)  # [rad] to rest
    for room, outcome in ((1.02 * way, "OK"), (0.98 * way, "CANNOT_STOP")):
        q = away.copy()
        q[joint] = robot.upper[joint] - room
        state = state_of(robot, v, q)
        motion = plan_motion(IKSolver(robot), state, away)
        assert motion.outcome == outcome, motion.message
        if motion.success:
            assert (motion.q <= robot.upper).all()
            assert motion.q[:, joint].max() < robot.upper[joint] - room + 1.02 * way
    assert "joint_2 would stop" in motion.message
    assert "go on with the motion under way" in str(motion)


def test_what_is_on_the_straight_stop_is_passed_by_hard_braking_or_refused(robot: Robot) -> None:
    """A fast joint stops at once where a slow one could go on for long: the tool leaves its line."""
    solver = IKSolver(robot)
    v = 0.9 * robot.velocity_limit * np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.3])
    state = state_of(robot, v)
    plain = plan_motion(solver, state, robot.home)
    check(robot, FREE, state, plain)
    ahead = robot.home + v**2 / (2.0 * ACCELERATION) * np.sign(v)
    tool = robot.forward_kinematics(ahead).translation
    blocked = IKSolver(robot, scene=Scene([Sphere("ball", 0.05, tool)]))
    motion = plan_motion(blocked, state, robot.home)
    assert motion.outcome == "CANNOT_STOP"
    assert "ball" in motion.message
    assert len(motion) == 1


def test_without_a_way_the_arm_comes_to_rest(robot: Robot) -> None:
    state = state_of(robot, 0.5 * robot.velocity_limit)
    solver = IKSolver(robot)
    motion = plan_motion(solver, state, jacokin.pose([2.0, 0.0, 0.0]))
    assert motion.outcome == "UNREACHABLE"
    check(robot, FREE, state, motion)
    assert motion.duration < 0.5 * robot.velocity_limit.max() / ACCELERATION + 0.03
    there = Scene([Box("box", [0.1, 0.1, 0.1], robot.forward_kinematics(robot.home + 0.6).translation)])
    motion = plan_motion(IKSolver(robot, scene=there), state, robot.home + 0.6)
    assert motion.outcome == "GOAL_IN_CONTACT"
    check(robot, there, state, motion)


def test_a_state_at_rest_is_a_configuration(robot: Robot) -> None:
    solver, goal = IKSolver(robot), robot.home + 0.3
    at_rest = plan_motion(solver, state_of(robot, np.zeros(robot.dof)), goal)
    np.testing.assert_array_equal(at_rest.q, plan_motion(solver, robot.home, goal).q)


def test_the_stop_itself_may_be_the_goal(robot: Robot) -> None:
    solver, state = IKSolver(robot), state_of(robot, 0.3 * robot.velocity_limit)
    failed = plan_motion(solver, state, jacokin.pose([2.0, 0.0, 0.0]))
    motion = plan_motion(solver, state, failed.q[-1])
    check(robot, FREE, state, motion)
    assert motion.success
    np.testing.assert_array_equal(motion.q[-1], failed.q[-1])


def test_the_motion_of_a_tracker_is_gone_on_with(robot: Robot) -> None:
    tracker = Tracker(robot, acceleration_limit=ACCELERATION)
    target = robot.forward_kinematics(robot.home + 0.5)
    for _ in range(40):
        tracker.step(target)
    assert np.abs(tracker.v).max() > 0.1
    motion = plan_motion(IKSolver(robot), tracker.state, robot.home)
    check(robot, FREE, tracker.state, motion)
    assert motion.success


def test_torques_and_jerk_are_limited_too(robot: Robot) -> None:
    solver, state = IKSolver(robot), state_of(robot, 0.5 * robot.velocity_limit)
    goal = robot.home + 0.4
    motion = plan_motion(solver, state, goal, jerk_limit=4.0)
    check(robot, FREE, state, motion)
    assert motion.success
    jerk = np.diff(motion.a, axis=0) / np.diff(motion.t)[:, None]
    assert np.abs(jerk).max() <= 4.0 * (1.0 + 1e-6)
    assert not motion.a[0].any()
    heavy = robot.with_payload(0.5, [0.0, 0.0, 0.05])
    torque = 1.6 * np.abs(heavy.inverse_dynamics(heavy.home, np.zeros(6), np.zeros(6))).max()
    motion = plan_motion(IKSolver(heavy), state, goal, torque_limit=torque)
    needed = [heavy.inverse_dynamics(*row) for row in zip(motion.q, motion.v, motion.a, strict=True)]
    assert motion.success
    assert np.abs(needed).max() <= torque * (1.0 + 1e-6)


@pytest.mark.parametrize("dt", [0.002, 0.01, 0.1])
@pytest.mark.parametrize("jerk", [0.3, 5.0, np.inf])
def test_braking_takes_a_velocity_of_one_to_zero_in_the_least_way(dt: float, jerk: float) -> None:
    for acceleration in (0.1, 0.7, 3.0, 1e4):
        pull = brake(acceleration, jerk, dt)
        assert 1.0 + dt * 0.5 * (pull[1:] + pull[:-1]).sum() == pytest.approx(0.0, abs=1e-9)
        assert (pull <= 0.0).all()
        assert np.abs(pull).max() <= acceleration * (1.0 + 1e-9)
        if jerk < np.inf:
            assert np.abs(np.diff(pull)).max() <= jerk * dt * (1.0 + 1e-9)
            assert pull[0] == 0.0
            continue
        speed = np.append(1.0, 1.0 + dt * np.cumsum(0.5 * (pull[1:] + pull[:-1])))
        way = dt * (speed[:-1] + dt / 6.0 * (2.0 * pull[:-1] + pull[1:])).sum()
        assert 0.5 / acceleration - 1e-12 <= way <= 0.5 / acceleration + dt


def test_the_state_between_rows_is_that_of_the_cubic(robot: Robot) -> None:
    motion = plan_motion(IKSolver(robot), robot.home, robot.home + 0.4)
    tiny = 1e-6  # [s]
    for time in (0.004, 0.5 * motion.duration, motion.duration - 0.003):
        here, ahead, behind = (motion.state_at(time + shift) for shift in (0.0, tiny, -tiny))
        np.testing.assert_allclose((ahead.q - behind.q) / (2.0 * tiny), here.v, atol=1e-8)
        np.testing.assert_allclose((ahead.v - behind.v) / (2.0 * tiny), here.a, atol=1e-6)
    for row in (0, 7, len(motion) - 1):
        at = motion.state_at(float(motion.t[row]))
        np.testing.assert_array_equal(at.q, motion.q[row])
        np.testing.assert_array_equal(at.v, motion.v[row])
    np.testing.assert_array_equal(motion.state_at(1e9).q, motion.q[-1])
    np.testing.assert_array_equal(motion.state_at(-1.0).q, motion.q[0])
    with pytest.raises(InvalidInputError, match="time must be"):
        motion.state_at("now")  # type: ignore[arg-type]  # wrong on purpose


def test_mistakes(robot: Robot) -> None:
    solver, state = IKSolver(robot), state_of(robot, 0.5 * robot.velocity_limit)
    with pytest.raises(InvalidInputError, match="v has joint_4 at"):
        plan_motion(solver, state_of(robot, 2.0 * robot.velocity_limit), robot.home)
    with pytest.raises(InvalidInputError, match=r"v has joint_4 at .* its limit is 0.1"):
        plan_motion(solver, state, robot.home, velocity_limit=0.1)
    with pytest.raises(InvalidInputError, match="v must be finite"):
        plan_motion(solver, state_of(robot, [np.nan] * 6), robot.home)
    with pytest.raises(InvalidInputError, match="v must have shape"):
        plan_motion(solver, state_of(robot, [0.1] * 5), robot.home)
    with pytest.raises(InvalidInputError, match=r"start\.q must have shape"):
        plan_motion(solver, replace(state, q=np.zeros(5)), robot.home)
    with pytest.raises(InvalidInputError, match="more than 10000000 ticks"):
        plan_motion(solver, state, robot.home, acceleration_limit=1e-7)
