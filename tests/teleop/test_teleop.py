"""The clutch, the hand's frame, walls, the watchdog, wrong input, other branches, and whole streams."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray

from jacokin import IKSolver, Robot, Tracker, load_robot
from jacokin.errors import InvalidInputError
from jacokin.ik import Box, Floor, Scene
from jacokin.model.descriptions.bundled import NAMES
from jacokin.model.poses import quat_wxyz
from jacokin.motion import LimitDistance, Manipulability, TrackerStatus
from jacokin.teleop import HandOptions, Player, Stream, Teleop, TeleopStatus, TeleopStep, make_stream
from jacokin.teleop.streams import KINDS
from tests.robot_files import UR5_JOINTS, ur5_text

Array = NDArray[np.float64]
DT = 0.01  # [s]
ACCELERATION = 4.0  # [rad/s^2]


def hand(x: float = 0.0, y: float = 0.0, z: float = 0.0, turn: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> pin.SE3:
    """Somewhere in a device's own frame."""
    return pin.SE3(pin.exp3(np.array([0.3, -0.2, 0.9]) + np.array(turn)), np.array([5.0 + x, -3.0 + y, 1.0 + z]))


class Watch:
    """Steps a teleoperation, and checks limits and speeds from outside."""

    def __init__(self, teleop: Teleop) -> None:
        self.teleop, self.robot = teleop, teleop.tracker.robot
        self.q, self.v = teleop.tracker.q, teleop.tracker.v

    def __call__(self, *arguments: Any, **options: Any) -> TeleopStep:
        step = self.teleop.step(*arguments, **options)
        v = (step.q - self.q) / DT
        assert self.robot.within_limits(step.q)
        assert np.allclose(v, step.v, atol=1e-9)
        assert (np.abs(v) <= self.robot.velocity_limit + 1e-9).all()
        if self.teleop.tracker.acceleration_limit is not None:
            assert (np.abs(v - self.v) <= self.teleop.tracker.acceleration_limit * DT + 1e-9).all()
        self.q, self.v = step.q, v
        return step

    @property
    def tool(self) -> pin.SE3:
        return self.robot.forward_kinematics(self.q)


def make(robot: Robot, **options: Any) -> Watch:
    return Watch(Teleop(Tracker(robot, dt=DT, acceleration_limit=ACCELERATION), **options))


def test_the_tool_follows_the_hand_with_scale_and_axes(robot: Robot) -> None:
    turned = pin.exp3(np.array([0.0, 0.0, np.pi / 2]))  # the hand's x is the base's y
    step = make(robot, scale=0.5, clutch=True, hand=HandOptions(rotation_scale=0.5, axes=turned))
    start = step.tool
    for tick in range(150):
        part = min(tick / 100, 1.0)
        moved = hand(0.1 * part, 0.0, 0.04 * part)
        spun = pin.SE3(pin.exp3(np.array([0.0, 0.0, 0.4 * part])) @ moved.rotation, moved.translation)
        last = step(spun)
    assert last.status is TeleopStatus.FOLLOWING
    assert last.tracking.status is TrackerStatus.OK
    assert np.allclose(step.tool.translation - start.translation, [0.0, 0.05, 0.02], atol=1e-5)
    assert np.allclose(step.tool.rotation, pin.exp3(np.array([0.0, 0.0, 0.2])) @ start.rotation, atol=1e-5)


def test_closing_the_clutch_moves_nothing_and_opening_it_holds(robot: Robot) -> None:
    step = make(robot)
    start = step.tool
    assert step(hand(0.7)).status is TeleopStatus.HOLDING
    step.teleop.clutch(True)
    assert step().status is TeleopStatus.WAITING
    assert np.allclose(step(hand(-0.4)).q, robot.home, rtol=0.0, atol=1e-12)
    for tick in range(100):
        step(hand(-0.4 + 1e-3 * tick))
    step.teleop.clutch(False)
    while np.abs(step(hand()).v).max() > 0.0:  # brakes within the limits, whatever the hand does
        pass
    there = step.tool
    assert there.translation[0] - start.translation[0] == pytest.approx(0.1, abs=0.02)
    assert np.array_equal(step(hand(2.0)).q, step.q)
    step.teleop.clutch(True)  # from another place of the hand: no jump
    for _ in range(20):
        last = step(hand(2.0))
        assert np.abs(last.v).max() < 1e-6
    for tick in range(101):
        last = step(hand(2.0 - 1e-3 * tick))
    for _ in range(60):
        last = step(hand(1.9))
    assert step.tool.translation[0] == pytest.approx(there.translation[0] - 0.1, abs=1e-3)


@pytest.mark.one_quick
@pytest.mark.parametrize("rate", [10, 25, 60, 200])
def test_any_rate_of_the_hand_leads_to_the_same_place(robot: Robot, rate: int) -> None:
    step = make(robot, clutch=True, filter=0.05, hand=HandOptions(watchdog=0.25))
    start, told = step.tool, -1
    for tick in range(400):
        count = int(tick * DT * rate)
        moved = hand(0.0, 0.0, 0.1 * min(count / rate / 2.0, 1.0))
        step(moved if count > told else None)
        told = count
    assert np.allclose(step.tool.translation - start.translation, [0.0, 0.0, 0.1], atol=1e-4)


def test_a_filter_lags_by_its_time_constant(robot: Robot) -> None:
    speed, constant = 0.04, 0.1
    step = make(robot, clutch=True, filter=constant)
    start = step.tool.translation[2]
    for tick in range(200):
        last = step(hand(0.0, 0.0, speed * tick * DT))
    assert last.target is not None
    lag = start + speed * 199 * DT - last.target.translation[2]
    assert lag / speed == pytest.approx(constant, abs=DT)
    assert last.tracking.status is TrackerStatus.OK


@pytest.mark.parametrize(("rate", "watchdog", "latency"), [(10, 0.15, 0.19), (20, 0.1, 0.09), (50, 0.1, 0.03)])
def test_steps_of_a_slow_hand_are_smoothed_with_a_lag_that_is_stated(
    robot: Robot, rate: int, watchdog: float, latency: float
) -> None:
    step, speed, period = make(robot, clutch=True, hand=HandOptions(watchdog=watchdog)), 0.04, round(1.0 / rate / DT)
    start, top = step.tool.translation[2], 0.0
    for tick in range(200):
        last = step(hand(0.0, 0.0, speed * tick * DT) if tick % period == 0 else None)
        top = speed * tick * DT if tick % period == 0 else top
        if tick > 100:  # steadily behind the moving hand, between its poses too
            assert last.latency == pytest.approx(latency)
            assert step.tool.translation[2] - start == pytest.approx(speed * (tick * DT - last.latency), abs=1e-4)
            assert last.tracking.status is TrackerStatus.OK
    for _ in range(100):  # it falls silent: the tool does not go past where it was last
        last = step()
        assert step.tool.translation[2] - start < top + 1e-3
    assert last.status is TeleopStatus.NO_INPUT
    assert last.latency == 0.0


def test_a_hand_in_every_tick_and_one_that_is_not_smoothed_are_commanded_at_once(robot: Robot) -> None:
    for smoothing, every in (("auto", 1), (None, 5), (0, 5)):
        step = make(robot, clutch=True, filter=smoothing)
        start = step.tool.translation[2]
        for tick in range(60):
            last = step(hand(0.0, 0.0, 4e-4 * tick) if tick % every == 0 else None)
            assert last.target is not None
            assert last.target.translation[2] - start == pytest.approx(4e-4 * (tick // every * every), abs=1e-9)
        assert last.latency == 0.0


def test_twists_with_pauses_are_commanded_at_once(robot: Robot) -> None:
    step = make(robot, clutch=True)
    for tick in range(80):
        twist = [0.0, 0.0, 0.05 * (tick % 10 < 5), 0.0, 0.0, 0.0]
        before = step.tool.translation[2]
        last = step(twist)
        assert last.target is not None
        assert last.target.translation[2] - before == pytest.approx(DT * twist[2], abs=1e-9)
        assert last.latency == 0.0


def test_a_low_pass_is_one_of_twists_too(robot: Robot) -> None:
    step = make(robot, clutch=True, filter=0.2)
    start = step.tool.translation[2]
    for _ in range(200):
        last = step([0.0, 0.0, 0.03, 0.0, 0.0, 0.0])
    assert last.latency == 0.2
    assert step.tool.translation[2] - start == pytest.approx(0.03 * (2.0 - 0.2), abs=2e-3)


def test_from_a_twist_to_a_pose_and_back_nothing_jumps(robot: Robot) -> None:
    """Limits of acceleration are checked in every tick; the tool stays where the change finds it."""
    step = make(robot, clutch=True)
    for _ in range(60):
        step([0.0, 0.05, 0.05, 0.0, 0.0, 0.3])
    where = step.tool
    for _ in range(100):
        step(hand(4.0))
    assert np.linalg.norm(step.tool.translation - where.translation) < 5e-3
    for _ in range(60):
        step([0.0, -0.05, 0.0, 0.0, 0.0, 0.0])
    assert 0.02 < where.translation[1] - step.tool.translation[1] < 0.035


def test_a_hand_that_repeats_its_pose_between_moves_is_a_slow_hand(robot: Robot) -> None:
    """As devices do that are asked in every tick, and measure more seldom."""
    told, repeated = make(robot, clutch=True), make(robot, clutch=True)
    for tick in range(100):
        pose = hand(0.0, 0.0, 4e-4 * (tick // 5 * 5))
        told(pose if tick % 5 == 0 else None)
        repeated(pose)
        assert np.allclose(told.q, repeated.q, atol=1e-9)


def test_twists_lead_while_they_last_and_wind_nothing_up(robot: Robot) -> None:
    step = make(robot, clutch=True)
    start = step.tool
    for tick in range(100):
        step([0.0, 0.0, 0.05, 0.0, 0.0, 0.1] if tick % 5 == 0 else None)
    for _ in range(50):
        last = step(np.zeros(6))
    assert not last.v.any()  # not even a little
    assert np.allclose(step.tool.translation - start.translation, [0.0, 0.0, 0.05], atol=1e-3)
    for _ in range(1_000):  # far out of reach
        last = step([0.0, 0.0, 0.2, 0.0, 0.0, 0.0])
    assert last.target is not None
    assert last.target.translation[2] - step.tool.translation[2] < 0.01
    top = step.tool.translation[2]
    for _ in range(150):
        last = step([0.0, 0.0, -0.1, 0.0, 0.0, 0.0])
    assert step.tool.translation[2] < top - 0.03


def test_a_dead_band_swallows_a_trembling_hand_and_ends_without_a_jump(robot: Robot) -> None:
    rng = np.random.default_rng(0)
    step = make(robot, clutch=True, hand=HandOptions(deadband=(4e-3, 0.02)))
    for _ in range(50):
        step(hand(*rng.uniform(-1e-3, 1e-3, 3)))
    assert np.allclose(step.q, robot.home, rtol=0.0, atol=1e-12)
    before = step.teleop.step(hand()).target
    for tick in range(100):
        last = step(hand(0.0, 0.0, 5e-4 * tick))
        assert last.target is not None
        assert before is not None
        assert np.linalg.norm(last.target.translation - before.translation) < 6e-4
        before = last.target
    twist = make(robot, clutch=True, hand=HandOptions(deadband=(0.02, 0.1)))
    for _ in range(30):
        twist([0.01, 0.0, 0.0, 0.0, 0.05, 0.0])
    assert np.allclose(twist.q, robot.home, rtol=0.0, atol=1e-12)


def test_walls_are_approached_softly_and_never_crossed(robot: Robot) -> None:
    start = robot.forward_kinematics(robot.home).translation
    box = (start - 0.3, start + np.array([0.3, 0.3, 0.06]))
    step = make(robot, clutch=True, workspace=box)
    heights = list[float]()
    for tick in range(400):
        last = step(hand(0.0, 0.0, 5e-4 * tick))
        assert last.target is not None
        heights.append(last.target.translation[2])
        assert heights[-1] <= box[1][2] + 1e-12
    speeds = np.diff(heights)
    assert (np.diff(speeds[1:]) <= 1e-12).all()  # slower and slower
    assert heights[-1] > box[1][2] - 3e-3
    for tick in range(40):  # back at once
        last = step(hand(0.0, 0.0, 0.2 - 5e-4 * tick))
    assert last.target is not None
    assert last.target.translation[2] < box[1][2] - 0.015


def test_an_arm_outside_the_walls_may_come_in_only(robot: Robot) -> None:
    start = robot.forward_kinematics(robot.home).translation
    step = make(robot, clutch=True, workspace=(start - 1.0, start + np.array([1.0, 1.0, -0.1])))
    for tick in range(60):
        last = step(hand(0.0, 0.0, 1e-3 * tick))
    assert np.abs(last.q - robot.home).max() < 1e-9
    for tick in range(60):
        last = step(hand(0.0, 0.0, 0.06 - 1e-3 * tick))
    assert step.tool.translation[2] < start[2] - 0.05


def wild(rng: np.random.Generator, ticks: int) -> Iterator[pin.SE3]:
    """A hand that jumps, turns and runs."""
    place, turn, v, w = (np.zeros(3) for _ in range(4))
    for _ in range(ticks):
        if rng.random() < 0.02:
            v, w = rng.uniform(-0.6, 0.6, 3), rng.uniform(-2.5, 2.5, 3)
        if rng.random() < 0.01:
            place = place + rng.uniform(-0.4, 0.4, 3)
            turn = rng.uniform(-3.0, 3.0, 3)
        place, turn = place + v * DT, turn + w * DT
        yield pin.SE3(pin.exp3(turn), place)


@pytest.mark.one_quick
@pytest.mark.parametrize("name", ["j2n6s300", "j2s7s300"])
@pytest.mark.parametrize("acceleration", [ACCELERATION, pytest.param(40.0, marks=pytest.mark.slow)])
@pytest.mark.parametrize("outside", [0.0, 0.05])
def test_tool_and_target_stay_in_the_workspace_whatever_the_hand_does(
    bundled: Any, name: str, acceleration: float, outside: float
) -> None:
    """Jumps, turns and new ties lead neither outside, nor farther outside than they were at first."""
    robot = bundled(name)
    for seed in range(2):
        rng = np.random.default_rng([seed, 40])
        start = robot.forward_kinematics(robot.home).translation
        lower, upper = start - rng.uniform(0.01, 0.1, 3), start + rng.uniform(0.01, 0.1, 3)
        upper[0] = max(upper[0], lower[0] + 0.02) if not outside else upper[0]
        if outside:
            lower[0], upper[0] = start[0] + outside, start[0] + outside + 0.1
        tracker = Tracker(robot, dt=DT, acceleration_limit=acceleration)
        teleop = Teleop(tracker, clutch=True, workspace=(lower, upper), scale=float(rng.choice([0.5, 1.0, 3.0])))
        far = np.maximum(lower - start, 0.0)
        for hand in wild(rng, 400):
            if rng.random() < 0.03:
                teleop.clutch(not teleop.engaged)
            step = teleop.step(hand)
            tool = robot.forward_kinematics(step.q).translation
            assert (np.maximum(lower - tool, tool - upper) <= far + 1e-4 * (far > 0.0)).all()
            if step.target is not None:
                target = step.target.translation
                assert (np.maximum(lower - target, target - upper) <= far).all()


@pytest.mark.slow
def test_a_tool_comes_to_its_target_in_the_corner_of_a_workspace(robot: Robot) -> None:
    start = robot.forward_kinematics(robot.home).translation
    step = make(robot, clutch=True, workspace=(start - 0.1, start + 0.05))
    for tick in range(500):
        part = min(tick / 300, 1.0)
        last = step(hand(0.2 * part, 0.2 * part, 0.2 * part, (0.0, 0.0, 0.6 * part)))
    assert last.tracking.status is TrackerStatus.OK
    assert np.abs(step.tool.translation - start - 0.05).max() < 4e-3


def test_an_arm_that_the_workspace_holds_says_so(robot: Robot) -> None:
    """A target is far ahead, by its turn: the tool would leave the box on the way, or waits."""
    start = robot.forward_kinematics(robot.home).translation
    teleop = Teleop(Tracker(robot, dt=DT, acceleration_limit=4.0), clutch=True, workspace=(start - 0.02, start + 0.02))
    seen = set()
    for pose in wild(np.random.default_rng(3), 400):
        step = teleop.step(pose)
        seen |= set(step.tracking.limiting)
        assert step.target is not None
        off = teleop.tool.translation - step.target.translation
        assert step.tracking.position_error == pytest.approx(float(np.linalg.norm(off)), abs=1e-9)
    assert "workspace" in seen


@pytest.mark.one_quick
@pytest.mark.parametrize("filtered", ["auto", 0.05])
def test_single_frames_that_no_hand_can_have_made_are_left_out(robot: Robot, filtered: str | float) -> None:
    clean, wrong = (make(robot, clutch=True, filter=filtered) for _ in range(2))
    for tick in range(400):
        pose = hand(0.0, 0.0, 3e-4 * min(tick, 250))
        bad = pin.SE3(pin.exp3(np.array([0.0, np.pi / 2, 0.0])) @ pose.rotation, pose.translation + (tick % 2) * 0.3)
        a, b = clean(pose), wrong(bad if tick % 17 == 9 else pose)
        assert np.abs(a.q - b.q).max() < 1e-2
        assert np.abs(b.v).max() < 0.3
    assert np.abs(a.q - b.q).max() < 1e-3


def test_a_hand_that_has_truly_jumped_is_followed_with_its_next_pose(robot: Robot) -> None:
    step = make(robot, clutch=True)
    step(hand())
    assert np.abs(step(hand(0.3)).v).max() < 1e-9
    for _ in range(300):
        last = step(hand(0.1))
    assert last.tracking.position_error < 1e-4
    assert step.tool.translation[0] == pytest.approx(
        robot.forward_kinematics(robot.home).translation[0] + 0.1, abs=1e-4
    )
    unfiltered = make(robot, clutch=True, filter=None)
    unfiltered(hand())
    assert np.abs(unfiltered(hand(0.1)).v).max() > 1e-3


def test_without_input_the_arm_brakes_says_so_and_goes_on_where_it_is(robot: Robot) -> None:
    step = make(robot, clutch=True)
    for tick in range(100):
        last = step(hand(0.0, 0.0, 1e-3 * tick))
    moving = np.abs(last.v).max()
    assert moving > 0.05
    for tick in range(12):
        last = step()
        assert (last.status is TeleopStatus.FOLLOWING) is (tick < 10)
    assert last.status is TeleopStatus.NO_INPUT
    assert "no input for 0.1" in last.message
    for _ in range(40):
        last = step()
    assert np.abs(last.v).max() == 0.0
    rests = last.q
    for _ in range(20):  # the device is plugged in again, elsewhere
        last = step(hand(3.0))
    assert last.status is TeleopStatus.FOLLOWING
    assert np.abs(last.q - rests).max() < 1e-6


@pytest.mark.parametrize(
    ("wrong", "match"),
    [
        (np.full(7, np.nan), "hand must be finite"),
        (np.zeros(7), "quat_wxyz must have norm 1"),
        (np.array([0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0]), "quat"),
        (np.full(6, np.nan), "hand must be finite"),
        (np.array([np.inf, 0.0, 0.0, 0.0, 0.0, 0.0]), "hand must be finite"),
        (np.full((4, 4), np.nan), "hand"),
        (np.zeros((4, 4)), "hand"),
        (pin.SE3(np.diag([1.0, 1.0, -1.0]), np.zeros(3)), "hand"),
        (np.zeros(5), "hand must be a pose"),
        ("left", "hand must be"),
        (np.full(6, 1e300), "hand has a number above"),
        (np.array([1e200, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]), "hand has a number above"),
        (pin.SE3(np.eye(3), np.full(3, 1e200)), "hand has a number above"),
        (np.array([None] * 7), "hand must be"),
        ([True] * 6, "hand must be"),
    ],
)
def test_wrong_input_brakes_says_why_and_is_forgotten(robot: Robot, wrong: Any, match: str) -> None:
    step = make(robot, clutch=True)
    for tick in range(100):
        last = step(hand(0.0, 0.0, 1e-3 * tick))
    before = np.abs(last.v)
    for _ in range(3):
        last = step(wrong)
        assert last.status is TeleopStatus.BAD_INPUT
        assert match in last.message
        assert (np.abs(last.v) <= before + 1e-12).all()
        before = np.abs(last.v)
    for _ in range(60):
        last = step(hand(1.0))
    assert last.status is TeleopStatus.FOLLOWING
    assert np.abs(last.v).max() < 1e-6


def test_time_that_runs_backwards_brakes_and_then_goes_on(robot: Robot) -> None:
    step = make(robot, clutch=True)
    clock = 1e6
    for tick in range(100):
        clock += DT
        last = step(hand(0.0, 0.0, 1e-3 * tick), clock)
    last = step(hand(0.0, 0.0, 0.1), 3.0)
    assert last.status is TeleopStatus.BAD_INPUT
    assert "time ran backwards by 1e+06 s" in last.message
    clock = 3.0
    for _ in range(40):
        clock += DT
        last = step(hand(0.0, 0.0, 0.1), clock)
    assert last.status is TeleopStatus.FOLLOWING
    for wrong in (np.nan, "now", True):
        last = step(hand(), wrong)
        assert last.status is TeleopStatus.BAD_INPUT
        assert "time must be" in last.message
    last = step(None, clock + 10.0)
    assert last.status is not TeleopStatus.FOLLOWING
    last = step(hand(), clock + 10.0 + DT)
    assert last.status is TeleopStatus.FOLLOWING


def test_a_paused_loop_counts_as_silence(robot: Robot) -> None:
    step = make(robot, clutch=True)
    for tick in range(20):
        step(hand(), tick * DT)
    assert step(None, 0.25).status is TeleopStatus.FOLLOWING
    assert step(None, 0.35).status is TeleopStatus.NO_INPUT


def test_another_branch_is_reached_without_contact_and_the_tool_is_back(robot: Robot) -> None:
    scene = Scene([Floor(-0.01), Box("crate", [0.2, 0.2, 0.3], [-0.4, 0.4, 0.15])])
    tracker = Tracker(robot, dt=DT, acceleration_limit=ACCELERATION, scene=scene, clearance=0.005)
    step = Watch(Teleop(tracker, clutch=True))
    start = step.tool
    for tick in range(30):
        step(hand(0.0, 0.0, 1e-3 * tick))
    with pytest.raises(InvalidInputError, match="must stand still"):
        step.teleop.switch_branch()
    step.teleop.clutch(False)
    while np.abs(step(hand()).v).max() > 0.0:
        pass
    stood, q = step.tool, step.q
    step.teleop.clutch(True)
    for options, words in (
        ({"time_limit": "1"}, "time_limit must be"),
        ({"q": np.zeros(6)}, "q puts joint_2 at 0 rad"),
    ):
        with pytest.raises(InvalidInputError, match=words):
            step.teleop.switch_branch(**options)
    plan = step.teleop.switch_branch()
    assert plan.success
    contact = scene.contact(robot)
    ticks = 0
    while (last := step(hand(0.3))).status is TeleopStatus.SWITCHING:
        ticks += 1
        assert not contact.touches(last.q)
        assert ticks < 3_000
    assert np.abs(last.q - q).max() > 0.3
    assert np.linalg.norm(step.tool.translation - stood.translation) < 1e-3
    for tick in range(100):
        last = step(hand(0.3 + 5e-4 * tick))
    assert last.status is TeleopStatus.FOLLOWING
    assert last.tracking.position_error < 2e-3
    assert start.translation[2] < stood.translation[2]


def switched(teleop: Teleop, ticks: int = 4_000) -> TeleopStep:
    for _ in range(ticks):
        if (step := teleop.step(hand())).status is not TeleopStatus.SWITCHING:
            return step
    raise AssertionError("the other branch is not reached")


@pytest.mark.one_quick
@pytest.mark.parametrize("name", NAMES)
def test_every_bundled_arm_reaches_another_branch(bundled: Any, name: str) -> None:
    check_switch(Teleop(Tracker(bundled(name), dt=0.02, acceleration_limit=ACCELERATION)))


def check_switch(teleop: Teleop) -> None:
    """The arm goes to another branch of the pose that its tool has."""
    start, q = teleop.tool, teleop.tracker.q
    assert teleop.switch_branch().success
    switched(teleop)
    assert np.abs(teleop.tracker.q - q).max() > 0.3
    assert np.linalg.norm(teleop.tool.translation - start.translation) < 1e-3
    assert np.linalg.norm(pin.log3(teleop.tool.rotation.T @ start.rotation)) < 1e-3


def test_seven_joints_switch_to_another_curve_from_anywhere(bundled: Any) -> None:
    robot, rng, switches = bundled("j2s7s300"), np.random.default_rng(5), 0
    solver = IKSolver(robot)
    for q in robot.sample(rng, 12):
        teleop = Teleop(Tracker(robot, q=q, acceleration_limit=ACCELERATION))
        plan = teleop.switch_branch()
        switches += plan.success
        family = solver.solve_all(teleop.tool, seed=q)
        distances = {
            i: float(np.abs(each.nearest(plan.q[-1]) - plan.q[-1]).max()) for i, each in enumerate(family.intervals)
        }
        before = {i: float(np.abs(each.nearest(q) - q).max()) for i, each in enumerate(family.intervals)}
        there, here = (min(found, key=lambda i: found[i]) for found in (distances, before))
        assert distances[there] < 1e-6
        assert not plan.success or family.intervals[there].branch != family.intervals[here].branch
    assert switches >= 11


def arm(joints: int, folder: Path) -> Robot:
    """A UR5 that lacks its last joint, or has one more."""
    rows = [*UR5_JOINTS, ("0 0.05 0.1", "0.4 0 0", "1 0 0")][:joints]
    (folder / "arm.urdf").write_text(ur5_text(rows=rows, limit=3.1))
    return load_robot(folder / "arm.urdf")


@pytest.mark.one_quick
@pytest.mark.parametrize("joints", [5, 6, 7])
def test_other_arms_reach_another_branch(joints: int, tmp_path: Path) -> None:
    q = np.array([0.3, -1.2, 1.3, -0.5, 1.1, 0.4, 0.2])[:joints]
    check_switch(Teleop(Tracker(arm(joints, tmp_path), q=q, acceleration_limit=ACCELERATION)))


def test_an_arm_with_a_sliding_joint_says_that_its_branches_cannot_be_listed(tmp_path: Path) -> None:
    arm(5, tmp_path)
    path = tmp_path / "arm.urdf"
    path.write_text(path.read_text().replace("revolute", "prismatic", 1))
    q = np.array([0.3, -1.2, 1.3, -0.5, 1.1])
    teleop = Teleop(Tracker(load_robot(path), q=q, acceleration_limit=ACCELERATION))
    with pytest.raises(InvalidInputError, match="cannot be listed, so give q"):
        teleop.switch_branch()
    assert teleop.switch_branch(q + 0.1).success


def test_a_switch_keeps_the_tool_in_the_workspace_or_says_that_none_does(robot: Robot) -> None:
    start = robot.forward_kinematics(robot.home).translation
    tight = Teleop(Tracker(robot, acceleration_limit=ACCELERATION), workspace=(start - 0.01, start + 0.01))
    plan = tight.switch_branch()
    assert not plan.success
    assert "inside the workspace" in plan.message
    assert tight.step().status is TeleopStatus.HOLDING
    wide = Teleop(Tracker(robot, acceleration_limit=ACCELERATION), workspace=(start - 1.5, start + 1.5))
    assert wide.switch_branch().success


def test_opening_the_clutch_stops_a_switch(robot: Robot) -> None:
    step = make(robot, clutch=True)
    goal = robot.home + np.array([0.5, 0.0, 0.0, 0.5, 0.0, 0.0])
    assert step.teleop.switch_branch(goal).success
    for _ in range(40):
        assert step().status is TeleopStatus.SWITCHING
    step.teleop.clutch(False)
    assert step().status is TeleopStatus.HOLDING
    for _ in range(60):
        last = step()
    assert np.abs(last.v).max() == 0.0
    assert np.abs(last.q - goal).max() > 0.1


@pytest.mark.slow
def test_a_tool_held_off_recovers_by_another_branch(robot: Robot) -> None:
    """The target goes, in a line, to a pose that only other branches reach."""
    start = robot.forward_kinematics(robot.home)
    away = robot.forward_kinematics([2.71, 1.95, 1.16, -1.38, -1.01, -1.73])
    way = pin.log6(start.actInv(away))
    for recover, reaches in ((None, False), (0.3, True)):
        step = make(robot, clutch=True, recover=recover)
        for tick in range(2_500):
            last = step(start * pin.exp6(min(tick / 500, 1.0) * way))
        assert bool(np.linalg.norm(step.tool.translation - away.translation) < 1e-3) is reaches
        assert last.status is TeleopStatus.FOLLOWING


def play(robot: Robot, stream: Stream, smoothing: str | None = "auto") -> tuple[Watch, TeleopStep]:
    """A whole stream, limits checked at every tick and contact at every fifth, and a while after it."""
    scene = Scene([Floor(-0.01)])
    tracker = Tracker(
        robot,
        dt=DT,
        acceleration_limit=ACCELERATION,
        scene=scene,
        clearance=0.005,
        objectives=(LimitDistance(), Manipulability()) if robot.dof > 6 else (),
    )
    step = Watch(Teleop(tracker, clutch=True, recover=0.5, filter=smoothing))
    contact, player = scene.contact(robot), Player(stream)
    for tick in range(round(stream.time[-1] / DT) + 1_200):
        last = step(stream.hand[-1] if player.ended else player.read(tick * DT))
        if tick % 5 == 0:
            assert not contact.touches(last.q)
    return step, last


@pytest.mark.slow
def test_a_stream_ends_on_target(robot: Robot) -> None:
    """All kinds, and more arms, are below."""
    _, last = play(robot, make_stream(robot, "jerky", np.random.default_rng(7), rate=60.0))
    assert last.status is TeleopStatus.FOLLOWING
    assert last.tracking.position_error < 1e-3


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "kind", "seed"),
    [
        ("j2n6s300", "jerky", [0, 14]),
        *(pytest.param("j2s6s300", "shoulder", [1, seed], marks=pytest.mark.slow) for seed in (2, 4)),
    ],
)
def test_an_arm_that_leans_against_itself_recovers(bundled: Any, name: str, kind: str, seed: list[int]) -> None:
    """Streams whose steps end with links at their clearance, in corners from which the tracker sees no way."""
    rng, robot = np.random.default_rng(seed), bundled(name)
    _, last = play(robot, make_stream(robot, kind, rng, rate=float(rng.choice([20.0, 60.0, 90.0, 200.0]))), None)
    assert last.tracking.position_error < 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("name", ["j2n6s300", "j2s7s300"])
@pytest.mark.parametrize(("kind", "rate"), [*zip(KINDS, itertools.cycle((20.0, 90.0, 200.0)), strict=False)])
def test_more_streams_end_on_target(bundled: Any, name: str, kind: str, rate: float) -> None:
    _, last = play(bundled(name), make_stream(bundled(name), kind, np.random.default_rng(1), rate=rate))
    assert last.status is TeleopStatus.FOLLOWING
    assert last.tracking.position_error < 1e-3


def test_obstacles_and_budgets_are_handed_on(robot: Robot) -> None:
    scene = Scene([Box("crate", [0.1] * 3, [2.0, 0.0, 0.5])])
    teleop = Teleop(Tracker(robot, dt=DT, scene=scene, self_collision=False), clutch=True)
    near = robot.forward_kinematics(robot.home).translation + np.array([0.0, 0.0, 0.2])
    far, there = teleop.step(hand()), teleop.step(hand(), obstacles={"crate": near})
    assert far.tracking.clearance is not None
    assert there.tracking.clearance is not None
    assert there.tracking.clearance < 0.2 < far.tracking.clearance
    assert teleop.step(hand(), budget=1e-6).tracking.status is TrackerStatus.LATE
    with pytest.raises(InvalidInputError, match="obstacles"):
        teleop.step(hand(), obstacles={"crate": [np.nan] * 3})


@pytest.mark.parametrize(
    ("options", "match"),
    [
        ({"scale": 0.0}, "scale must be a positive number"),
        ({"filter": -1.0}, "filter must be"),
        ({"filter": "none"}, 'filter must be "auto", a time constant'),
        ({"workspace": ([0.0] * 3, [0.0] * 3)}, "lower .* must be below upper"),
        ({"workspace": [[0.0] * 3]}, "workspace must be two corners"),
        ({"recover": -1.0}, "recover must be a positive number"),
        ({"clutch": 1}, "clutch must be True or False"),
        ({"hand": {"watchdog": 1.0}}, "hand must be HandOptions"),
    ],
)
def test_wrong_arguments_are_refused(robot: Robot, options: dict[str, Any], match: str) -> None:
    with pytest.raises(InvalidInputError, match=match):
        Teleop(Tracker(robot), **options)
    with pytest.raises(InvalidInputError, match="tracker must be a Tracker"):
        Teleop(robot)  # type: ignore[arg-type]  # wrong on purpose


@pytest.mark.parametrize(
    ("options", "match"),
    [
        ({"rotation_scale": -1.0}, "rotation_scale must be"),
        ({"axes": np.zeros((3, 3))}, "axes"),
        ({"deadband": 0.1}, "deadband must be"),
        ({"deadband": (0.1,)}, "deadband must be two numbers"),
        ({"watchdog": 0.0}, "watchdog must be a positive number"),
    ],
)
def test_wrong_options_of_a_hand_are_refused(options: dict[str, Any], match: str) -> None:
    with pytest.raises(InvalidInputError, match=match):
        HandOptions(**options)


def test_quaternions_and_matrices_are_the_same_hand(robot: Robot) -> None:
    found = []
    for convert in (
        lambda pose: pose,
        lambda pose: pose.homogeneous,
        lambda pose: np.concatenate([pose.translation, quat_wxyz(pose.rotation)]),
    ):
        step = make(robot, clutch=True)
        for tick in range(30):
            last = step(convert(hand(1e-3 * tick, 0.0, 0.0, (0.0, 2e-3 * tick, 0.0))))
        found.append(last.q)
    assert np.allclose(found[0], found[1], atol=1e-9)
    assert np.allclose(found[0], found[2], atol=1e-9)
