"""`TrajectoryController`: goals and velocities as ros2_control answers them, without ROS."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from jacokin import Robot
from jacokin.errors import InvalidInputError
from jacokin.motion import Trajectory, move_joints
from jacokin.twin import Faults, GoalStatus, SimulatedArm, Tolerances, TrajectoryController, TwinGoal
from tests.twin.driving import HALF_DEGREE, away, pass_time, wait

NAMES = [f"joint_{j}" for j in range(1, 7)]


@pytest.fixture(scope="module")
def motion(robot: Robot) -> Trajectory:
    return move_joints(robot, robot.home, robot.home + np.array([0.4, 0.1, -0.2, 0.5, 0.1, 0.6]), dt=0.02)


def controller(faults: str = "", seed: int = 0) -> TrajectoryController:
    return TrajectoryController(SimulatedArm(), NAMES, faults=Faults.parse(faults), seed=seed)


def follow(controller: TrajectoryController, motion: Trajectory, tolerances: Tolerances | None = None) -> TwinGoal:
    q, v = motion.q.tolist(), motion.v.tolist()
    return controller.follow(NAMES, motion.time, q, v, tolerances=tolerances)


@pytest.mark.one_quick
@pytest.mark.parametrize("faults", ["", "lag=0.05", "lag=0.02,loss=0.05,stall"])
def test_a_goal_is_followed_by_what_is_measured(motion: Trajectory, faults: str) -> None:
    made = controller(faults, seed=2)
    goal = follow(made, motion)
    assert wait(made, goal) == pytest.approx(motion.duration, abs=0.03)
    assert (goal.status, goal.code) == (GoalStatus.SUCCEEDED, 0)
    pass_time(made, 0.5)
    assert away(made, motion.q[-1]) < HALF_DEGREE / 5.0


def test_what_a_stall_has_taken_at_the_end_is_said_again(motion: Trajectory) -> None:
    made = controller("stall=0.3")
    goal = follow(made, motion)
    pass_time(made, motion.duration - 0.2)
    made._line._dead = made._line._now + 30
    wait(made, goal)
    assert goal.status is GoalStatus.SUCCEEDED  # without tolerances nobody looks
    assert away(made, motion.q[-1]) > HALF_DEGREE
    pass_time(made, 0.6)
    assert away(made, motion.q[-1]) < HALF_DEGREE / 5.0


def test_one_point_in_another_order_of_joints(motion: Trajectory) -> None:
    made = controller()
    goal = made.follow(NAMES[::-1], [2.0], [motion.q[-1, ::-1].tolist()])
    pass_time(made, 1.0)
    np.testing.assert_allclose(made.arm.state.command, (motion.q[0] + motion.q[-1]) / 2.0, atol=1e-3)  # a line
    wait(made, goal)
    assert away(made, motion.q[-1]) < HALF_DEGREE


def test_cancelled_it_holds_its_place(motion: Trajectory) -> None:
    made = controller()
    goal = follow(made, motion)
    pass_time(made, 0.8)
    made.cancel(goal)
    assert goal.status is GoalStatus.CANCELLED
    pass_time(made, 0.5)
    assert made.record().coasted <= 0.2
    standing = made.arm.state.q
    pass_time(made, 1.0)
    assert away(made, standing) < 1e-3
    assert away(made, motion.q[-1]) > 0.1


def test_a_goal_ends_the_one_before_and_velocities_end_a_goal(motion: Trajectory) -> None:
    made = controller()
    first = follow(made, motion)
    pass_time(made, 0.3)
    second = made.follow(NAMES, [2.0], [motion.q[0].tolist()])
    assert (first.status, first.text) == (GoalStatus.ABORTED, "another goal came")
    pass_time(made, 0.3)
    made.velocity([0.0] * 6)
    assert (second.status, second.text) == (GoalStatus.ABORTED, "velocities came")


def test_velocities_go_on_until_the_watchdog_ends_them() -> None:
    made = controller()
    for _ in range(50):
        made.velocity([0.3, 0.0, 0.0, 0.0, 0.0, -0.3])
        made.tick()
    pass_time(made, 1.0)
    # 0.05 s of the watchdog, and the arm's own 0.2 s
    assert made.record().coasted <= 0.25
    moved = made.arm.state.q - made.arm.robot.home
    np.testing.assert_allclose(moved, [0.16, 0.0, 0.0, 0.0, 0.0, -0.16], atol=0.03)


def test_tolerances_of_the_path_and_of_the_goal(motion: Trajectory) -> None:
    made = controller("lag=0.1")
    goal = follow(made, motion, Tolerances(path={"joint_6": 0.01}))
    wait(made, goal)
    assert (goal.status, goal.code) == (GoalStatus.ABORTED, -4)
    assert "joint_6" in goal.text
    made = controller("stall=10", seed=1)
    made._line._dead = 10**6  # from the first tick on: nothing reaches the arm
    goal = follow(made, motion, Tolerances(goal={"joint_1": 0.01}, time=0.5))
    assert wait(made, goal) == pytest.approx(motion.duration + 0.5, abs=0.05)
    assert (goal.status, goal.code) == (GoalStatus.ABORTED, -5)


@pytest.mark.parametrize(
    ("names", "times", "positions", "velocities", "why"),
    [
        (NAMES[:5], [1.0], [[0.0] * 5], [], "joints must be"),
        (NAMES, [], [], [], "there must be points"),
        (NAMES, [1.0, 1.0], [[0.0] * 6] * 2, [], "strictly increase"),
        (NAMES, [-1.0], [[0.0] * 6], [], "strictly increase"),
        (NAMES, [float("nan")], [[0.0] * 6], [], "times must be finite"),
        ("joint_1", [1.0], [[0.0]], [], "names must be"),
        (NAMES, [1.0], [["0"] * 6], [], "positions must be"),
        (NAMES, [1.0], [[]], [], "positions must be given"),
        (NAMES, [1.0], [[0.0] * 5], [], "6 numbers at each"),
        (NAMES, [1.0], [[float("nan")] * 6], [], "finite"),
        (NAMES, [1.0], [[0.0] * 6], [[0.1] * 6], "must have no velocity"),
    ],
)
def test_goals_that_are_rejected(
    names: Sequence[str],
    times: Sequence[float],
    positions: Sequence[Sequence[float]],
    velocities: Sequence[Sequence[float]],
    why: str,
) -> None:
    made = controller()
    before = made.follow(NAMES, [1.0], [made.arm.robot.home.tolist()])
    with pytest.raises(InvalidInputError, match=why):
        made.follow(names, times, positions, velocities)
    assert made.record().goals == 1
    assert not before.has_ended
    with pytest.raises(InvalidInputError, match="6 different names"):
        TrajectoryController(made.arm, NAMES[:1] * 6)


def test_a_jump_of_a_turn_is_bounded_by_the_speeds(motion: Trajectory) -> None:
    made = controller()
    turned = motion.q[0] + 2.0 * np.pi * np.eye(6)[5]
    made.follow(NAMES, [0.01], [turned.tolist()])
    pass_time(made, 1.0)
    assert made.arm.speed < 1.02
    assert away(made, motion.q[0]) < 1.1 * made.arm.robot.velocity_limit[5]


def test_fingers_go_to_angles() -> None:
    made = controller()
    made.move_fingers([1.0, 0.5, 2.0])
    pass_time(made, 2.5)
    np.testing.assert_allclose(made.arm.state.fingers, [1.0, 0.5, 1.35], atol=0.03)
    with pytest.raises(InvalidInputError, match="fingers"):
        made.move_fingers([1.0])
