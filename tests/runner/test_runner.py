"""`Runner` on simulated arms, without ROS: where the arm ends, and what stops it."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.model import Robot
from jacokin.motion import Trajectory, move_joints
from jacokin.runner import Measured, PlannedMotion, Runner, RunnerOptions, RunnerStatus, TwinLink, run
from jacokin.twin import Faults, KinovaDriver, SimulatedArm, TrajectoryController
from jacokin.twin.arm import MOVING

CLOSE = 0.5  # [deg]
STANDS = 0.2  # [s]
TICK = 0.01


@pytest.fixture(scope="module")
def motion(robot: Robot) -> Trajectory:
    return move_joints(robot, robot.home, robot.home + np.array([0.4, 0.1, -0.2, 0.5, 0.1, 0.6]), dt=0.02)


class NoisyLink(TwinLink):
    """A link to an arm that measures its angles with noise."""

    def __init__(self, driver: KinovaDriver | TrajectoryController, noise: float, seed: int, period: float) -> None:
        self.noise, self.rng = math.radians(noise), np.random.default_rng(seed)
        super().__init__(driver, period=period)

    def _tell(self) -> Measured | None:
        told = super()._tell()
        if told is None:
            return None
        return Measured(told.q + self.rng.normal(0.0, self.noise, told.q.shape), told.v, told.torques)


class Arm:
    """A runner at a simulated arm, whose angles are measured with so much noise [deg], a standard deviation."""

    def __init__(
        self,
        robot: Robot,
        motion: Trajectory,
        faults: str = "",
        *,
        ros: int = 1,
        turns: float = 0.0,
        options: RunnerOptions | None = None,
        seed: int = 0,
        noise: float = 0.0,
    ) -> None:
        self.motion = motion
        self.simulated = SimulatedArm(q=motion.q[0] + turns)
        found = Faults.parse(faults)
        self.driver: KinovaDriver | TrajectoryController
        if ros == 1:
            self.driver = KinovaDriver(self.simulated, faults=found, seed=seed)
        else:
            self.driver = TrajectoryController(self.simulated, robot.joint_names, faults=found, seed=seed)
        self.link: TwinLink = NoisyLink(self.driver, noise, seed, 0.1 if ros == 1 else 0.01)
        self.runner = Runner(robot, PlannedMotion.of(motion, robot), options)

    def run(self, at: float = math.inf, do: Callable[[], None] = lambda: None) -> RunnerStatus:
        """Run, and do something from a time on [s]."""
        run(self.runner, self.link, watch=lambda: do() if self.link.now() > at else None)
        return self.runner.status

    @property
    def away(self) -> float:
        """[deg]"""
        q = self.simulated.state.q - self.motion.q[-1]
        return float(np.degrees(np.abs(np.remainder(q + np.pi, 2.0 * np.pi) - np.pi).max()))


@pytest.mark.one_quick("faults")
@pytest.mark.parametrize("ros", [1, 2])
@pytest.mark.parametrize("faults", ["", "lag=0.05", "lag=0.02,loss=0.1", "loss=0.01,stall=0.1"])
def test_the_arm_ends_where_the_motion_does(robot: Robot, motion: Trajectory, ros: int, faults: str) -> None:
    arm = Arm(robot, motion, faults, ros=ros)
    assert arm.run() is RunnerStatus.ARRIVED, arm.runner.message
    assert arm.away < CLOSE
    assert np.degrees(arm.runner.away) == pytest.approx(arm.away, abs=0.02)
    assert arm.simulated.margin > 0.0
    assert arm.simulated.speed < 1.02
    assert np.abs(arm.simulated.state.v).max() < 1e-3


@pytest.mark.parametrize("ros", [1, 2])
@pytest.mark.parametrize("lag", [0.03, 0.1, 0.2])
def test_a_late_driver_is_measured_and_its_arm_does_not_overshoot(
    robot: Robot, motion: Trajectory, ros: int, lag: float
) -> None:
    """Velocities and measurements are each so late; given that, the arm ends at the same place."""
    away = []
    for options in (None, RunnerOptions(latency=2.0 * lag)):
        arm = Arm(robot, motion, f"lag={lag}", ros=ros, options=options)
        farthest = [0.0]
        ahead = np.sign(motion.q[-1] - motion.q[0])

        def look(arm: Arm = arm, farthest: list[float] = farthest, ahead: Array = ahead) -> None:
            farthest.append(float(((arm.simulated.state.q - arm.motion.q[-1]) * ahead).max()))

        assert arm.run(0.0, look) is RunnerStatus.ARRIVED, arm.runner.message
        assert arm.runner.measured_latency == pytest.approx(2.0 * lag, abs=0.01)
        assert arm.runner.latency == pytest.approx(2.0 * lag, abs=0.01)
        assert np.degrees(max(farthest)) < 0.2
        away.append(arm.away)
    assert max(away) < 0.2


@pytest.mark.one_quick("lag")
@pytest.mark.parametrize("ros", [1, 2])
@pytest.mark.parametrize("lag", [0.4, 0.3, 0.2])
def test_an_arm_that_is_late_for_a_short_motion_does_not_overshoot(robot: Robot, ros: int, lag: float) -> None:
    """What is not seen to move is not far behind: it may be as late as the motion is long."""
    change = np.array([0.12, 0.03, -0.06, 0.15, 0.03, 0.18])
    motion = move_joints(robot, robot.home, robot.home + change, dt=0.02)
    assert motion.duration < 0.9
    arm = Arm(robot, motion, f"lag={lag}", ros=ros)
    farthest = [0.0]
    assert (
        arm.run(0.0, lambda: farthest.append(((arm.simulated.state.q - motion.q[-1]) * np.sign(change)).max()))
        is RunnerStatus.ARRIVED
    ), arm.runner.message
    assert np.degrees(max(farthest)) < 0.1
    assert arm.away < 0.1


@pytest.mark.one_quick("noise")
@pytest.mark.parametrize("ros", [1, 2])
@pytest.mark.parametrize("noise", [0.1, 0.05, 0.3])
@pytest.mark.parametrize("faults", ["lag=0.03", "lag=0.1,loss=0.05"])
def test_noise_does_not_hide_that_the_arm_stands_where_the_motion_ends(
    robot: Robot, motion: Trajectory, ros: int, faults: str, noise: float
) -> None:
    for seed in range(3):
        arm = Arm(robot, motion, faults, ros=ros, noise=noise, seed=seed)
        assert arm.run() is RunnerStatus.ARRIVED, arm.runner.message
        assert arm.away < CLOSE
        assert arm.runner.stands
        assert np.abs(arm.simulated.state.v).max() < MOVING


@pytest.mark.parametrize("faults", ["lag=0.1,loss=0.1", "lag=0.1,loss=0.2,stall=0.1"])
def test_the_latency_of_a_driver_that_loses_velocities_is_measured(
    robot: Robot, motion: Trajectory, faults: str
) -> None:
    for seed in range(3):
        arm = Arm(robot, motion, faults, ros=2, seed=seed)
        assert arm.run() is RunnerStatus.ARRIVED, arm.runner.message
        assert arm.runner.measured_latency == pytest.approx(0.2, abs=0.02)


@pytest.mark.parametrize("lag", [0.02, 0.1])
def test_the_latency_is_measured_where_a_third_is_lost_of_ten_messages_a_second(robot: Robot, lag: float) -> None:
    motion = move_joints(robot, robot.home, robot.home + np.array([0.2, 0.1, -0.1, 0.25, 0.1, 0.3]), dt=0.02)
    for seed in range(4):
        arm = Arm(robot, motion, f"lag={lag},loss=0.3", seed=seed)
        # Five messages in a row get lost now and then, which is silence.
        assert arm.run() in (RunnerStatus.ARRIVED, RunnerStatus.SILENT), arm.runner.message
        assert arm.runner.measured_latency == pytest.approx(2.0 * lag, abs=0.06)


def test_a_latency_that_is_given_is_taken_and_measured_all_the_same(robot: Robot, motion: Trajectory) -> None:
    arm = Arm(robot, motion, "lag=0.1", options=RunnerOptions(latency=0.05))
    arm.run()
    assert arm.runner.latency == 0.05
    assert arm.runner.measured_latency == pytest.approx(0.2, abs=0.01)


def test_the_latency_of_an_arm_that_is_held_or_leaves_is_not_known(robot: Robot, motion: Trajectory) -> None:
    """It is stopped near to where it stood, as no latency explains that it does not move."""
    arm = Arm(robot, motion, ros=2)
    arm.link.send = lambda v: None  # type: ignore[method-assign]
    assert arm.run() is RunnerStatus.BEHIND
    assert arm.runner.measured_latency is None
    assert arm.runner.worst < np.radians(4.0)
    assert "and stays there" in arm.runner.message
    planned = PlannedMotion.of(motion, robot)
    runner, rng = Runner(robot, planned), np.random.default_rng(0)
    for tick in range(200):
        runner.step(TICK * tick, Measured(motion.q[0] + (rng.uniform(-0.02, 0.02, 6) if tick else 0.0)))
    assert runner.measured_latency is None


def test_an_open_loop_ends_farther_away(robot: Robot, motion: Trajectory) -> None:
    """Without a gain nothing makes up for what was lost, and the runner says so."""
    arm = Arm(robot, motion, "loss=0.1", options=RunnerOptions(gain=0.0, patience=1.0), seed=4)
    assert arm.run() is RunnerStatus.MISSED
    assert arm.away > CLOSE
    assert "off the motion 1 s after its end" in arm.runner.message


def test_joints_without_limits_may_stand_turns_away_and_do_not_turn_back(robot: Robot, motion: Trajectory) -> None:
    turns = 2.0 * np.pi * np.array([0.0, 0.0, 0.0, 1.0, -1.0, 2.0])
    arm = Arm(robot, motion, turns=turns)  # type: ignore[arg-type]
    assert arm.run() is RunnerStatus.ARRIVED
    np.testing.assert_allclose(arm.simulated.state.q, motion.q[-1] + turns, atol=np.radians(CLOSE))


@pytest.mark.parametrize(("joint", "angle"), [(2, 0.04), (5, 0.5)])
def test_an_arm_elsewhere_is_not_moved(robot: Robot, motion: Trajectory, joint: int, angle: float) -> None:
    arm = Arm(robot, motion, turns=angle * np.eye(6)[joint])
    before = arm.simulated.state.q
    assert arm.run() is RunnerStatus.NOT_THERE
    assert arm.runner.away == math.inf
    assert f"joint_{joint + 1} is {math.degrees(angle):.1f} deg from where the motion begins" in arm.runner.message
    np.testing.assert_allclose(arm.simulated.state.q, before, atol=1e-3)


@pytest.mark.parametrize("ros", [1, 2])
def test_an_arm_that_is_held_is_stopped(robot: Robot, motion: Trajectory, ros: int) -> None:
    """Something lost every velocity from 0.5 s on; the driver goes on to say where the arm is."""
    arm = Arm(robot, motion, ros=ros)
    sent = arm.link.send
    arm.link.send = lambda v: sent(v) if arm.link.now() < 0.5 else None  # type: ignore[method-assign]
    assert arm.run() is RunnerStatus.BEHIND
    assert "off the motion" in arm.runner.message
    assert arm.runner.worst < np.radians(7.0)


def test_an_arm_that_moves_by_itself_is_stopped(robot: Robot, motion: Trajectory) -> None:
    arm = Arm(robot, motion, ros=2, options=RunnerOptions(correction=0.01))
    sent = arm.link.send
    arm.link.send = lambda v: sent(v + 0.2 * np.eye(6)[2])  # type: ignore[method-assign]
    assert arm.run() is RunnerStatus.BEHIND
    assert arm.runner.message.startswith("joint_3 is 5.")


@pytest.mark.parametrize("ros", [1, 2])
def test_silence_stops_the_arm(robot: Robot, motion: Trajectory, ros: int) -> None:
    arm = Arm(robot, motion, ros=ros)
    heard = arm.link.hear
    arm.link.hear = lambda: heard() if arm.link.now() < 0.7 else None  # type: ignore[method-assign]
    assert arm.run() is RunnerStatus.SILENT
    assert arm.simulated.moved < 0.7 + 0.5 + STANDS
    assert "nothing has said where the arm is for 0.5" in arm.runner.message


@pytest.mark.parametrize("ros", [1, 2])
def test_interrupted_it_stands_at_once(robot: Robot, motion: Trajectory, ros: int) -> None:
    arm = Arm(robot, motion, ros=ros)

    def interrupt() -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        arm.run(0.8, interrupt)
    assert arm.runner.status is RunnerStatus.INTERRUPTED
    assert arm.simulated.moved < 0.8 + STANDS + 2.0 * TICK
    assert arm.runner.stands


@pytest.mark.one_quick
@pytest.mark.parametrize("period", [0.1, 0.01])
def test_contact_stops_the_arm_and_motion_alone_does_not(robot: Robot, motion: Trajectory, period: float) -> None:
    arm = Arm(robot, motion, options=RunnerOptions(contact=2.0))
    arm.link = TwinLink(arm.driver, period=period)
    assert arm.run() is RunnerStatus.ARRIVED
    arm = Arm(robot, motion, options=RunnerOptions(contact=2.0))
    arm.link = TwinLink(arm.driver, period=period)

    times = []

    def push() -> None:
        times.append(arm.link.now())
        data = arm.simulated.physics.data
        data.xfrc_applied[-1, :3] = [0.0, 0.0, 15.0]  # [N] up, at the last finger

    assert arm.run(0.6, push) is RunnerStatus.CONTACT
    assert " feels " in arm.runner.message
    assert times[-1] < 0.6 + 0.3


def test_velocities_keep_their_limits_whatever_is_measured(robot: Robot, motion: Trajectory) -> None:
    """An arm that says anything within its tolerance, and a gain that makes much of it."""
    rng = np.random.default_rng(1)
    planned = PlannedMotion.of(motion, robot)
    runner = Runner(robot, planned, RunnerOptions(gain=50.0, correction=1.0))
    fastest = np.zeros(6)
    for tick in range(80):
        told = planned.step(0.0).q + rng.uniform(-0.02, 0.02, 6) if tick else motion.q[0]
        step = runner.step(TICK * tick, Measured(told))
        fastest = np.maximum(fastest, np.abs(step.v))
    assert step.status is RunnerStatus.MOVING, step.message
    assert (fastest <= robot.velocity_limit).all()
    assert (fastest > 0.99 * robot.velocity_limit).any()


def test_a_correction_does_not_lead_past_a_joint_limit(robot: Robot) -> None:
    """An arm that stands on its limit, and does not say what it was told since."""
    q = robot.home.copy()
    q[1] = robot.lower[1]
    runner = Runner(robot, PlannedMotion(robot, [0.0, 1.0], [q, q]), RunnerOptions(gain=50.0, correction=1.0))
    runner.step(0.0, Measured(q))
    lowest = q[1]
    at = q.copy()
    for tick in range(1, 60):
        told = q + 0.03 * np.eye(6)[1] if tick == 10 else at  # once it seems to be above
        at = at + TICK * runner.step(TICK * tick, Measured(told)).v
        lowest = min(lowest, at[1])
    assert runner.status in (RunnerStatus.MOVING, RunnerStatus.SETTLING)
    assert lowest > robot.lower[1] - 0.01


def test_nothing_moves_after_the_end(robot: Robot, motion: Trajectory) -> None:
    runner = Runner(robot, PlannedMotion.of(motion, robot))
    assert not runner.step(0.0).v.any()
    assert runner.status is RunnerStatus.WAITING
    for k in range(20):
        assert runner.step(0.01 * k, Measured(motion.q[0])).status is RunnerStatus.MOVING
    assert runner.step(0.2).v.any()
    runner.stop("enough")
    step = runner.step(0.3, Measured(motion.q[0]))
    assert (step.status, step.message) == (RunnerStatus.INTERRUPTED, "enough")
    assert not step.v.any()
    runner.stop("again")
    assert runner.message == "enough"


def test_what_is_refused(robot: Robot, motion: Trajectory) -> None:
    runner = Runner(robot, PlannedMotion.of(motion, robot))
    runner.step(1.0, Measured(motion.q[0]))
    with pytest.raises(InvalidInputError, match="time ran backwards by 0.5 s"):
        runner.step(0.5)
    with pytest.raises(InvalidInputError, match="q must"):
        runner.step(1.01, Measured(motion.q[0][:5]))
    with pytest.raises(InvalidInputError, match="fingers must be at most 1, got 6800"):
        run(runner, Told(motion.q[0], lambda _, now: now), fingers=6800.0)
    with pytest.raises(InvalidInputError, match="measured must be Measured"):
        runner.step(1.01, motion.q[0])
    with pytest.raises(InvalidInputError, match="torques must be 6 numbers"):
        runner.step(1.01, Measured(motion.q[0], motion.v[0], "none"))  # type: ignore[arg-type]  # wrong on purpose
    with pytest.raises(InvalidInputError, match="time"):
        runner.step(math.nan)
    assert runner.step(1.01, Measured(motion.q[0])).status is RunnerStatus.MOVING
    for wrong in ({"gain": -1.0}, {"correction": 1.5}, {"silence": 0.0}, {"lag": math.inf}, {"contact": -1.0}):
        with pytest.raises(InvalidInputError, match=next(iter(wrong))):
            RunnerOptions(**wrong)


class Told:
    """A link to an arm that does what it is sent, and says where it is as a function has it."""

    listens = True

    def __init__(self, q: Array, say: Callable[[float, Measured], Measured]) -> None:
        self.time, self.q, self.v, self.say = 0.0, q, np.zeros_like(q), say
        self.sent: list[Array] = []

    def now(self) -> float:
        return self.time

    def wait(self, until: float) -> None:
        self.q = self.q + self.v * (until - self.time)
        self.time = until

    def hear(self) -> Measured:
        return self.say(self.time, Measured(self.q, self.v, np.zeros_like(self.q)))

    def send(self, v: Array) -> None:
        self.v = v
        self.sent.append(v)

    def move_fingers(self, share: float) -> None:
        raise AssertionError(share)

    def close(self) -> None:
        pass


UNKNOWN = np.full(6, math.nan)


@pytest.mark.parametrize(
    ("wrong", "status"),
    [
        (lambda time, now: Measured(UNKNOWN) if 0.5 < time < 0.7 else now, RunnerStatus.ARRIVED),
        (lambda time, now: Measured(UNKNOWN) if time > 0.5 else now, RunnerStatus.SILENT),
        (lambda time, now: Measured(now.q, UNKNOWN, now.torques), RunnerStatus.ARRIVED),
        (lambda time, now: Measured(now.q, now.v, UNKNOWN), RunnerStatus.ARRIVED),
    ],
    ids=["angles for a while", "angles from then on", "velocities", "torques"],
)
def test_what_is_not_a_number_is_not_told(
    robot: Robot, motion: Trajectory, wrong: Callable[[float, Measured], Measured], status: RunnerStatus
) -> None:
    runner = Runner(robot, PlannedMotion.of(motion, robot), RunnerOptions(contact=5.0))
    link = Told(motion.q[0], wrong)
    run(runner, link)
    assert runner.status is status
    assert not link.sent[-1].any()


@pytest.mark.parametrize(
    ("say", "misses"),
    [
        (lambda time, now: now, False),
        (lambda time, now: Measured(now.q, now.v, UNKNOWN), True),
        (lambda time, now: Measured(now.q, None, now.torques), True),
        (lambda time, now: Measured(now.q, now.v, UNKNOWN if 0.3 < time < 0.7 else now.torques), False),
        (lambda time, now: Measured(now.q, now.v, UNKNOWN if time > 0.7 else now.torques), True),
    ],
    ids=["told", "no torques", "no velocities", "not for a while", "not from then on"],
)
def test_contact_that_cannot_be_felt_is_known(
    robot: Robot, motion: Trajectory, say: Callable[[float, Measured], Measured], misses: bool
) -> None:
    for contact in (1e3, None):
        runner = Runner(robot, PlannedMotion.of(motion, robot), RunnerOptions(contact=contact))
        link, missed = Told(motion.q[0], say), list[float]()
        assert not runner.misses_contact
        run(runner, link, watch=lambda: missed.extend([link.time] if runner.misses_contact else []))  # noqa: B023 - at once
        assert runner.status is RunnerStatus.ARRIVED
        assert bool(missed) is (misses and contact is not None)
        assert min(missed, default=1.0) > 0.5


def test_an_arm_that_says_something_malformed_is_sent_zeros(robot: Robot, motion: Trajectory) -> None:
    runner = Runner(robot, PlannedMotion.of(motion, robot))
    link = Told(motion.q[0], lambda time, now: Measured(now.q[:5]) if time > 0.5 else now)
    with pytest.raises(InvalidInputError, match="q must have shape"):
        run(runner, link)
    assert np.array(link.sent).any()
    assert not np.array(link.sent[-5:]).any()
