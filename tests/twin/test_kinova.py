"""`KinovaDriver`: what clients send and what the arm then does; by the source of kinova-ros, without ROS."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from jacokin import Robot
from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.motion import Trajectory, move_joints
from jacokin.twin import Faults, GoalStatus, KinovaDriver, SimulatedArm
from jacokin.twin.faults import TICK
from tests.twin.driving import HALF_DEGREE, away, pass_time, wait


@pytest.fixture(scope="module")
def motion(robot: Robot) -> Trajectory:
    """A second and a half, points 10 ms apart, joints up to 0.66 rad/s."""
    return move_joints(robot, robot.home, robot.home + np.array([0.4, 0.1, -0.2, 0.5, 0.1, 0.6]), dt=0.01)


def driver(faults: str = "", seed: int = 0) -> KinovaDriver:
    return KinovaDriver(SimulatedArm(), faults=Faults.parse(faults), seed=seed)


def send(driver: KinovaDriver, velocities: Array) -> None:
    """A velocity a tick, as at 100 Hz."""
    for row in velocities:
        driver.joint_velocity(row)
        driver.tick()


def test_velocities_end_where_they_lead(motion: Trajectory) -> None:
    """The base makes up for the error of its joints: what is sent is what is moved."""
    made = driver()
    send(made, motion.v)
    pass_time(made, 0.5)
    assert away(made, motion.q[-1]) < HALF_DEGREE / 5.0
    assert made.record().coasted < 0.2


@pytest.mark.parametrize(("step", "share"), [(2, 0.5), (1, 1.0)])
def test_a_slower_rate_moves_the_arm_less(motion: Trajectory, step: int, share: float) -> None:
    """README: at less than 100 Hz the arm does not reach the velocity."""
    made = driver()
    for _ in range(100 // step):
        made.joint_velocity(np.array([0.2, 0.0, 0.0, 0.0, 0.0, 0.0]))
        pass_time(made, step * 0.01)
    pass_time(made, 0.5)
    assert made.arm.state.q[0] - made.arm.robot.home[0] == pytest.approx(share * 0.2, rel=0.1)


def test_a_faster_rate_fills_the_queue_and_the_arm_goes_on() -> None:
    made = driver()
    for _ in range(100):
        for _ in range(2):
            made.joint_velocity(np.array([0.2, 0.0, 0.0, 0.0, 0.0, 0.0]))
        made.tick()
    assert made.record().waiting == pytest.approx(100, abs=1)
    pass_time(made, 1.5)
    assert made.record().coasted > 0.9
    assert made.arm.state.q[0] - made.arm.robot.home[0] == pytest.approx(0.4, rel=0.05)
    for _ in range(3000):
        made.joint_velocity(np.zeros(6))
    made.tick()
    assert made.record().waiting == 1999


def test_a_trajectory_is_played_in_an_open_loop(motion: Trajectory) -> None:
    """With 10 ms it ends where it should; of points 5 ms apart each takes 10 ms, and the arm moves twice as far."""
    made = driver()
    goal = made.follow(motion.time, motion.v)
    assert wait(made, goal) == pytest.approx(motion.duration, abs=0.25)
    assert goal.status is GoalStatus.SUCCEEDED
    assert away(made, motion.q[-1]) < HALF_DEGREE / 5.0
    made = driver()
    finer = move_joints(made.arm.robot, motion.q[0], motion.q[-1], dt=0.005)
    goal = made.follow(finer.time, finer.v)
    wait(made, goal)
    assert goal.status is GoalStatus.ABORTED
    assert "wound up outside the goal constraints" in goal.text
    pass_time(made, 2.0)  # the controller plays on
    moved = made.arm.state.q[0] - motion.q[0, 0]
    assert moved == pytest.approx(2.0 * (motion.q[-1, 0] - motion.q[0, 0]), rel=0.05)


def test_a_goal_that_is_cancelled_kills_the_driver_and_the_arm_stands(motion: Trajectory) -> None:
    made = driver()
    goal = made.follow(motion.time, motion.v)
    pass_time(made, 0.8)
    made.cancel(goal)
    assert goal.status is GoalStatus.CANCELLED
    assert "issue 191" in made.died
    assert made.tell() is None
    pass_time(made, 1.0)
    assert made.record().coasted < 0.2
    assert made.go_to_angles(motion.q[0]).status is GoalStatus.ABORTED
    assert wait(made, made.follow(motion.time, motion.v)) == 0.0


@pytest.mark.parametrize("times", [[], [0.0, 1.0]])
def test_an_empty_trajectory_and_a_second_goal_kill_it_too(motion: Trajectory, times: list[float]) -> None:
    made = driver()
    if times:
        made.follow(motion.time, motion.v)
    goal = made.follow(times, np.zeros((len(times), 6)))
    assert goal.status is GoalStatus.ABORTED
    assert made.died


def test_silence_stops_the_arm(motion: Trajectory) -> None:
    for rows in (40, 80, 110):
        made = driver()
        send(made, motion.v[:rows])
        assert np.abs(made.arm.state.v).max() > 0.2
        pass_time(made, 1.0)
        assert made.record().coasted < 0.2 + 0.5 * TICK


def test_the_service_stop_empties_the_queue_until_start(motion: Trajectory) -> None:
    made = driver()
    goal = made.go_to_angles(motion.q[-1])
    pass_time(made, 0.5)
    made.stop()
    made.joint_velocity(motion.v[80])
    pass_time(made, 0.2)
    assert goal.status is GoalStatus.ABORTED
    assert made.record().velocities == 0
    standing = made.arm.state.q
    pass_time(made, 0.5)
    assert away(made, standing) < 1e-3
    assert made.go_to_angles(motion.q[-1]).status is GoalStatus.ABORTED
    made.start()
    goal = made.go_to_angles(motion.q[-1])
    wait(made, goal)
    assert goal.status is GoalStatus.SUCCEEDED


def test_joint_goals_succeed_two_degrees_away_and_go_on(motion: Trajectory) -> None:
    made = driver()
    goal = made.go_to_angles(motion.q[-1])
    way = np.abs(motion.q[-1] - motion.q[0]).max() - np.radians(2.0)
    assert wait(made, goal) > way / np.radians(20.0)  # jointSpeedLimitParameter
    assert goal.status is GoalStatus.SUCCEEDED
    assert away(made, motion.q[-1]) > HALF_DEGREE
    pass_time(made, 1.0)
    assert away(made, motion.q[-1]) < HALF_DEGREE / 5.0


def test_a_target_beyond_a_limit_is_aborted_within_it() -> None:
    made = driver()
    target = made.arm.robot.home.copy()
    target[1] = made.arm.robot.upper[1] + 0.5
    goal = made.go_to_angles(target)
    wait(made, goal)
    assert goal.status is GoalStatus.ABORTED
    assert "nothing has moved" in goal.text
    assert made.arm.margin > 0.0


def test_a_pose_goal_takes_the_tool_there() -> None:
    made = driver()
    robot = made.arm.robot
    start = robot.forward_kinematics(robot.home)
    turned = start.rotation @ pin.exp3(np.array([0.1, -0.1, 0.2]))
    target = pin.SE3(turned, start.translation + np.array([0.03, -0.04, -0.05]))
    goal = made.go_to_pose(target)
    wait(made, goal)
    assert goal.status is GoalStatus.SUCCEEDED
    pass_time(made, 0.5)
    error = target.actInv(robot.forward_kinematics(made.arm.state.q))
    assert np.linalg.norm(error.translation) < 1e-3
    assert np.linalg.norm(pin.log3(error.rotation)) < 3e-3


def test_a_cartesian_velocity_moves_the_tool_in_base_axes() -> None:
    made = driver()
    robot = made.arm.robot
    start = robot.forward_kinematics(robot.home)
    for _ in range(100):
        made.tool_velocity(np.array([0.0, 0.0, -0.05, 0.0, 0.0, 0.2]))
        made.tick()
    pass_time(made, 0.5)
    end = robot.forward_kinematics(made.arm.state.q)
    np.testing.assert_allclose(end.translation - start.translation, [0.0, 0.0, -0.05], atol=5e-3)
    np.testing.assert_allclose(pin.log3(end.rotation @ start.rotation.T), [0.0, 0.0, 0.2], atol=1e-2)


def test_a_pose_goal_waits_for_the_queue_and_poses_line_up() -> None:
    """kinova_comm.h: `setCartesianPosition` clears no queue."""
    made = driver()
    robot = made.arm.robot
    start = robot.forward_kinematics(robot.home)
    for _ in range(100):
        made.joint_velocity(np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.3]))
    made.tick()
    goal = made.go_to_pose(start)
    pass_time(made, 0.9)
    assert made.arm.state.q[5] - robot.home[5] == pytest.approx(0.3, abs=0.05)
    wait(made, goal)
    assert goal.status is GoalStatus.SUCCEEDED
    lower, aside = start.translation - [0.0, 0.0, 0.05], start.translation - [0.0, 0.05, 0.05]
    made.add_pose(pin.SE3(start.rotation, lower))
    made.add_pose(pin.SE3(start.rotation, aside))
    heights = []
    for _ in range(300):
        made.tick()
        heights.append(np.linalg.norm(robot.forward_kinematics(made.arm.state.q).translation - lower))
    assert min(heights) < 3e-3
    end = robot.forward_kinematics(made.arm.state.q)
    np.testing.assert_allclose(end.translation, aside, atol=1e-3)


def test_an_offset_moves_the_tool_that_is_told_and_led() -> None:
    made = driver()
    robot = made.arm.robot
    start = robot.forward_kinematics(robot.home)
    made.set_end_effector_offset([0.0, 0.0, 0.1])
    tool = made.tool_pose(robot.home)
    np.testing.assert_allclose(tool.translation, start.translation + 0.1 * start.rotation[:, 2], atol=1e-12)
    target = pin.SE3(tool.rotation @ pin.exp3(np.array([0.2, 0.0, 0.0])), tool.translation)
    wait(made, made.go_to_pose(target))
    pass_time(made, 0.5)
    error = target.actInv(made.tool_pose(made.arm.state.q))
    assert np.linalg.norm(error.translation) < 1e-3
    for _ in range(100):
        made.tool_velocity(np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.3]))
        made.tick()
    turned = made.tool_pose(made.arm.state.command)  # it turns about the tool
    np.testing.assert_allclose(turned.translation, target.translation, atol=2e-3)
    np.testing.assert_allclose(pin.log3(turned.rotation @ target.rotation.T), [0.0, 0.0, 0.3], atol=0.01)
    made.set_end_effector_offset(None)
    assert made.tool_pose(robot.home) == start


def test_under_torque_control_the_arm_is_held_and_torques_push_it() -> None:
    """README, torque control: gravity is compensated; what is not said for 0.25 s is zero."""
    made = driver()
    home = made.arm.robot.home
    made.set_torque_control(on=True)
    made.joint_velocity(np.array([0.3, 0.0, 0.0, 0.0, 0.0, 0.0]))
    pass_time(made, 2.0)
    assert away(made, home) < 1e-3  # friction holds it; velocities are nothing here
    for _ in range(50):
        made.joint_torque(np.array([5.0, 0.0, 0.0, 0.0, 0.0, 0.0]))
        made.tick()
    speed, q = made.arm.state.v[0], made.arm.state.q
    assert 0.1 < speed < made.arm.robot.velocity_limit[0]
    np.testing.assert_allclose(q[1:], home[1:], atol=0.01)
    pass_time(made, 1.5)
    assert abs(made.arm.state.v[0]) < 0.01  # friction alone
    assert made.arm.state.q[0] > q[0]
    made.set_torque_control(on=False)
    goal = made.go_to_angles(home)
    wait(made, goal)
    assert goal.status is GoalStatus.SUCCEEDED


def test_a_force_at_the_tool_moves_it_that_way() -> None:
    made = driver()
    made.set_torque_control(on=True)
    before = made.tool_pose(made.arm.state.q).translation
    for _ in range(60):
        made.tool_force(np.array([0.0, 0.0, -30.0, 0.0, 0.0, 0.0]))
        made.tick()
    assert (made.tool_pose(made.arm.state.q).translation - before)[2] < -0.02


@pytest.mark.one_quick
@pytest.mark.parametrize("factor", [0.3, 1.0])
def test_torques_break_no_limit(factor: float) -> None:
    """What is too fast for the safety factor, or near a limit, takes the arm back to where it holds its place."""
    made = driver()
    made.torque_control.safety_factor = factor
    made.set_torque_control(on=True)
    for _ in range(800):
        made.joint_torque(np.array([0.0, 30.0, 0.0, 0.0, 0.0, 0.0]))
        made.tick()
    assert not made.torque_control.is_on
    record = made.record()
    assert record.margin > 0.0
    assert record.speed < factor + 0.1
    assert np.abs(made.arm.state.v).max() < 0.02


def test_fingers_move_in_turns_and_stop_the_joints(motion: Trajectory) -> None:
    """Issues 67 and 224: fingers and joints do not go together by actions."""
    made = driver()
    joints = made.go_to_angles(motion.q[-1])
    pass_time(made, 0.3)
    goal = made.move_fingers(np.array([6000.0, 6000.0, 3000.0]))
    wait(made, goal)
    assert goal.status is GoalStatus.SUCCEEDED
    np.testing.assert_allclose(made.finger_turns(made.arm.state.fingers), [6000.0, 6000.0, 3000.0], atol=64.0)
    wait(made, joints)
    assert joints.status is GoalStatus.ABORTED
    np.testing.assert_allclose(made.finger_angles(np.array([0.0, 6800.0])), made.arm.finger_range)


def test_home_is_the_short_way_and_opens_the_fingers() -> None:
    made = driver()
    made.arm.move_fingers(np.full(3, 1.0))
    q = made.arm.robot.home + np.array([0.3, 0.0, 0.0, 0.0, 0.0, 0.0])
    wait(made, made.go_to_angles(q))
    goal = made.home()
    wait(made, goal)
    assert goal.status is GoalStatus.SUCCEEDED
    pass_time(made, 1.0)
    assert away(made, made.arm.robot.home) < 3e-3
    np.testing.assert_allclose(made.arm.state.fingers, made.arm.finger_range[0], atol=0.02)


@pytest.mark.slow
def test_faults_are_seeded_and_move_the_end_of_an_open_loop(motion: Trajectory) -> None:
    ends = []
    for seed in (3, 3, 4):
        made = driver("lag=0.05,loss=0.2", seed)
        send(made, motion.v)
        pass_time(made, 0.5)
        ends.append(made.arm.state.q)
        assert made.record().lost > 10
    assert (ends[0] == ends[1]).all()
    assert (ends[0] != ends[2]).any()
    assert np.abs(ends[0] - motion.q[-1]).max() > HALF_DEGREE
    late = driver("lag=0.05")
    send(late, motion.v)
    assert away(late, motion.q[-1]) > 1e-4
    np.testing.assert_array_less(1e-4, np.abs(late.state.q - late.arm.state.q).max())
    assert late.state.time == pytest.approx(late.arm.state.time - 0.05)
    pass_time(late, 0.5)
    assert away(late, motion.q[-1]) < HALF_DEGREE / 5.0


def test_what_is_malformed_is_refused(motion: Trajectory) -> None:
    made, other = driver(), driver().go_to_angles(motion.q[0])
    for call in (
        lambda: made.joint_velocity(np.zeros(5)),
        lambda: made.joint_velocity(np.full(6, np.nan)),
        lambda: made.tool_velocity(np.zeros(5)),
        lambda: made.tool_velocity(np.zeros(6), np.zeros(2)),
        lambda: made.go_to_angles(np.zeros(7)),
        lambda: made.go_to_pose(np.eye(3)),
        lambda: made.move_fingers(np.zeros(2)),
        lambda: made.follow([0.0], np.zeros((2, 6))),
        lambda: made.follow([0.0], np.full((1, 6), np.nan)),
        lambda: made.set_joint_speed(np.zeros(6)),
        lambda: made.arm.tick(np.zeros(5)),
        lambda: made.arm.move_fingers([0.0]),
        lambda: made.arm.turn_fingers([np.inf] * 3),
        lambda: made.joint_torque(np.zeros(5)),
        lambda: made.tool_force(np.full(6, np.nan)),
        lambda: made.add_pose(np.eye(3)),
        lambda: made.set_end_effector_offset([0.0]),
        lambda: made.arm.tick_torques(np.zeros(5)),
        lambda: made.follow("now", [[0.0] * 6]),
        lambda: made.cancel(other),
        lambda: made.finger_turns("open"),  # type: ignore[arg-type]  # the mistake
        lambda: made.finger_turns(np.array([1e308])),
        lambda: made.set_torque_control(on=[1, 2]),  # type: ignore[arg-type]  # the mistake
        lambda: KinovaDriver("j2n6s300"),  # type: ignore[arg-type]  # the mistake
        lambda: KinovaDriver(made.arm, faults="lag=1"),  # type: ignore[arg-type]  # the mistake
        lambda: KinovaDriver(made.arm, seed=-1),
    ):
        with pytest.raises(InvalidInputError):
            call()
    record = made.record()
    assert (record.velocities, record.goals, record.time) == (0, 0, 0.0)
    assert not other.has_ended
