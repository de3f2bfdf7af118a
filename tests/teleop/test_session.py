"""`lead`: what a device did to the arm, against the same ticks made by hand."""

from __future__ import annotations

import pickle
import re
import threading
import time

import numpy as np
import pytest

from jacokin import Robot, Tracker
from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.teleop import Keyboard, Player, Stream, Teleop, TeleopStep, lead, make_stream

ACCELERATION = 4.0  # [rad/s^2]


def made(robot: Robot) -> Teleop:
    return Teleop(Tracker(robot, dt=0.02, acceleration_limit=ACCELERATION), clutch=True)


def moved(robot: Robot, way: Array) -> Stream:
    """A hand that is at home and then somewhere else."""
    home = robot.forward_kinematics(robot.home).translation
    hand = np.tile([*home, 1.0, 0.0, 0.0, 0.0], (2, 1))
    hand[1, :3] += way
    return Stream(np.array([0.0, 0.1]), hand)


def test_a_session_says_what_was_commanded(robot: Robot) -> None:
    stream = make_stream(robot, "smooth", np.random.default_rng(1))
    session = lead(made(robot), Player(stream), seconds=3.0, paced=False)
    again, player = made(robot), Player(stream)
    followed = [again.step(player.read(0.02 * tick)) for tick in range(150)]
    np.testing.assert_array_equal(session.motion.q[1:151], [step.q for step in followed])
    np.testing.assert_array_equal(session.motion.q[0], robot.home)
    errors = []
    for step in followed:
        assert step.target is not None
        errors.append(np.linalg.norm(robot.forward_kinematics(step.q).translation - step.target.translation))
    np.testing.assert_allclose(session.position_error, errors, atol=1e-12)
    assert session.statuses["FOLLOWING"] == sum(session.tracking.values()) == 150
    assert session.within_limits
    assert session.late == 0
    kept = pickle.loads(pickle.dumps(session))
    assert kept.statuses == session.statuses
    with pytest.raises(TypeError, match="does not support item assignment"):
        kept.statuses["FOLLOWING"] = 0


def test_a_session_that_is_cut_short_ends_at_rest_within_the_acceleration_limit(robot: Robot) -> None:
    session = lead(made(robot), Player(moved(robot, np.array([0.1, 0.0, 0.0]))), seconds=0.5, paced=False)
    v = np.diff(session.motion.q, axis=0) / 0.02
    assert np.abs(v[24]).max() > 0.1
    assert np.abs(v[-1]).max() < 1e-4
    assert np.abs(np.diff(v, axis=0)).max() <= ACCELERATION * 0.02 + 1e-9
    assert session.statuses["HOLDING"] == len(v) - 25


def test_the_last_pose_of_a_recording_holds_until_the_tool_is_there(robot: Robot) -> None:
    way = np.array([0.05, 0.02, 0.05])
    session = lead(made(robot), Player(moved(robot, way)), paced=False)
    ended = robot.forward_kinematics(session.motion.q[-1]).translation
    np.testing.assert_allclose(ended, robot.forward_kinematics(robot.home).translation + way, atol=1e-6)
    assert session.position_error[-1] < 1e-6
    assert session.motion.duration > 0.3
    away = lead(made(robot), Player(moved(robot, np.array([3.0, 0.0, 0.0]))), paced=False)
    assert away.motion.duration < 7.0
    assert away.position_error[-1] > 1.0


@pytest.mark.parametrize("smoothing", ["auto", 0.2])
def test_a_recording_that_ends_in_motion_is_followed_to_its_last_pose(robot: Robot, smoothing: str | float) -> None:
    time = np.arange(0.0, 1.0, 0.05)
    hand = np.tile([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0], (len(time), 1))
    hand[:, 2] = 0.04 * time
    teleop = Teleop(Tracker(robot, dt=0.02, acceleration_limit=ACCELERATION), clutch=True, filter=smoothing)
    session = lead(teleop, Player(Stream(time, hand)), paced=False)
    rise = teleop.tool.translation - robot.forward_kinematics(robot.home).translation
    assert rise == pytest.approx([0.0, 0.0, hand[-1, 2]], abs=1e-4)
    assert session.motion.duration < 4.0


def test_time_paces_and_an_action_ends_a_session(robot: Robot) -> None:
    heard = list[TeleopStep]()

    def act(step: TeleopStep) -> bool:
        heard.append(step)
        return len(heard) < 10

    began = time.monotonic()
    session = lead(made(robot), Keyboard(), act=act)
    assert time.monotonic() - began >= 9 * 0.02
    assert len(heard) == len(session.motion) - 1 == 10


def test_a_session_that_is_stopped_brakes(robot: Robot) -> None:
    stop, steps = threading.Event(), list[TeleopStep]()

    def act(step: TeleopStep) -> bool:
        steps.append(step)
        if len(steps) == 40:
            assert np.abs(step.v).max() > 0.05
            stop.set()
        return True

    twist = Unplugged(np.array([0.0, 0.0, 0.1, 0.0, 0.0, 0.0]))
    session = lead(made(robot), twist, paced=False, act=act, stop=stop)
    assert session.statuses["FOLLOWING"] == 40
    assert np.abs(steps[-1].v).max() < 1e-4
    assert np.abs(np.diff(np.diff(session.motion.q, axis=0), axis=0)).max() <= ACCELERATION * 0.02**2 + 1e-9


class Unplugged:
    """A device that is unplugged for a while, or says nonsense."""

    def __init__(self, wrong: Array | Exception) -> None:
        self.wrong = wrong

    def read(self, time: float) -> Array | None:
        if 0.9 < time < 1.7:
            if isinstance(self.wrong, Exception):
                raise self.wrong
            return self.wrong
        return np.array([0.0, 0.0, 0.1, 0.0, 0.0, 0.0])


@pytest.mark.parametrize(
    ("wrong", "status", "reason"),
    [
        (OSError("no such device"), "NO_INPUT", "OSError: no such device"),
        (np.full(6, np.nan), "BAD_INPUT", "hand must be finite"),
        (np.zeros(7), "BAD_INPUT", "quat_wxyz must have norm 1"),
    ],
)
def test_a_device_that_fails_brakes_the_arm_says_why_and_goes_on(
    robot: Robot, wrong: Array | Exception, status: str, reason: str
) -> None:
    steps = list[TeleopStep]()

    def act(step: TeleopStep) -> bool:
        steps.append(step)
        return True

    session = lead(made(robot), Unplugged(wrong), seconds=2.5, paced=False, act=act)
    v = np.diff(session.motion.q, axis=0) / 0.02
    assert np.abs(v[40]).max() > 0.05
    assert np.abs(v[80]).max() < 1e-4  # stands, 0.7 s later
    assert np.abs(v[120]).max() > 0.05  # and goes on
    assert np.abs(np.diff(v, axis=0)).max() <= ACCELERATION * 0.02 + 1e-9
    assert steps[80].status.name == status
    assert session.statuses[status] > 20
    ((said, count),) = session.faults.items()
    assert reason in said
    assert 38 <= count <= 40


def test_a_session_on_one_line(robot: Robot) -> None:
    session = lead(made(robot), Player(moved(robot, np.array([0.02, 0.0, 0.0]))), seconds=1.0, paced=False)
    assert re.match(r"\d\.\d\d s: .*FOLLOWING \d+.*; at most \S+ m off its target; limits kept$", str(session))


def test_what_cannot_lead_is_refused(robot: Robot) -> None:
    with pytest.raises(InvalidInputError, match="teleop must be a Teleop"):
        lead(robot, Keyboard(), seconds=1.0)  # type: ignore[arg-type]  # wrong on purpose
    with pytest.raises(InvalidInputError, match="act must be callable with a step, or None"):
        lead(made(robot), Keyboard(), seconds=1.0, act=3)  # type: ignore[arg-type]  # wrong on purpose
    with pytest.raises(InvalidInputError, match=r"device must be something with read\(time\)"):
        lead(made(robot), None, seconds=1.0)  # type: ignore[arg-type]  # wrong on purpose
    with pytest.raises(InvalidInputError, match=r"stop must be something with is_set\(\)"):
        lead(made(robot), Keyboard(), seconds=1.0, stop=3)  # type: ignore[arg-type]  # wrong on purpose


def test_a_wrong_time_is_refused(robot: Robot) -> None:
    for seconds in (0.0, float("nan"), -1.0):
        with pytest.raises(InvalidInputError, match="seconds"):
            lead(made(robot), Keyboard(), seconds=seconds)


class Loose(Unplugged):
    """A device whose button fails for a while."""

    def toggled(self) -> bool:
        self.asked = getattr(self, "asked", 0) + 1
        if 45 < self.asked < 85:
            raise OSError("no such button")
        return False


def test_a_button_that_fails_brakes_the_arm_too(robot: Robot) -> None:
    session = lead(made(robot), Loose(np.zeros(6)), seconds=0.02 * 120, paced=False)
    assert dict(session.faults) == {"OSError: no such button": 39}
    assert session.statuses["NO_INPUT"] > 20


class Stuck(Unplugged):
    """A device whose button is never let go."""

    def toggled(self) -> bool:
        return True


def test_a_button_that_is_stuck_changes_the_clutch_once_a_tick(robot: Robot) -> None:
    session = lead(made(robot), Stuck(np.zeros(6)), seconds=0.02 * 20, paced=False)
    assert session.statuses["HOLDING"] >= 10
    assert len(session.motion) >= 20


class Gone(Unplugged):
    """A device that is unplugged for good, and answers nothing any more."""

    def read(self, time: float) -> Array | None:
        self.is_gone = time > 0.5
        return None if self.is_gone else np.array([0.0, 0.0, 0.1, 0.0, 0.0, 0.0])

    @property
    def trouble(self) -> str:
        raise OSError("no such device")

    @property
    def ended(self) -> bool:
        if self.is_gone:
            raise OSError("no such device")
        return False


def test_whatever_fails_of_a_device_the_arm_brakes(robot: Robot) -> None:
    teleop = made(robot)
    session = lead(teleop, Gone(np.zeros(6)), seconds=0.02 * 100, paced=False)
    assert list(session.faults) == ["OSError: no such device"]
    assert session.statuses["NO_INPUT"] > 20
    assert not teleop.tracker.v.any()
