"""`SimulatedArm` and `Faults`: limits are kept whatever is asked; faults are read, checked, and drawn from a seed."""

from __future__ import annotations

import math
import time

import numpy as np
import pytest

import jacokin.tasks
from jacokin.errors import InvalidInputError, UnknownNameError
from jacokin.twin import Faults, SimulatedArm
from jacokin.twin.faults import Line
from jacokin.twin.nodes import Ticker


@pytest.mark.parametrize("robot", ["j2n6s300", "j2s7s300", "m1n6s200"])
def test_it_stands_where_it_is(robot: str) -> None:
    """Without velocities gravity does not move it."""
    arm = SimulatedArm(robot)
    for _ in range(100):
        arm.tick(np.zeros(arm.robot.dof))
    assert np.abs(arm.state.q - arm.robot.home).max() < 1e-6
    torques = arm.robot.gravity(arm.state.q)
    np.testing.assert_allclose(arm.state.torques, torques, atol=0.3 + 0.1 * np.abs(torques).max())


@pytest.mark.one_quick
@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("joint", range(6))
def test_limits_are_never_broken(joint: int, sign: float) -> None:
    """At ten times the speed into a limit, or round and round."""
    arm = SimulatedArm()
    is_unlimited = arm.robot.unlimited[joint]
    with arm.physics.disable("contact"):
        for _ in range(150 if is_unlimited else 900):
            arm.tick(sign * 10.0 * np.eye(6)[joint])
    assert arm.margin >= 0.0
    assert arm.speed <= 1.01
    assert is_unlimited or arm.margin < 0.01


def test_it_stops_within_a_fifth_of_a_second_from_any_speed() -> None:
    for joint in (0, 2, 5):
        arm = SimulatedArm()
        for _ in range(60):
            arm.tick(np.eye(6)[joint] * arm.robot.velocity_limit)
        stopped = arm.state.time
        for _ in range(50):
            arm.tick(np.zeros(6))
        assert arm.moved - stopped < (0.2 if joint < 3 else 0.25)  # [s] from 0.8 rad/s motors of 6.8 N m take 0.21
        assert np.abs(arm.state.v).max() < 5e-3


def test_an_obstacle_holds_it_and_it_does_not_jump_afterwards() -> None:
    """The reference waits for the joints."""
    arm = SimulatedArm()
    for _ in range(400):
        arm.tick(np.array([0.0, 0.3, 0.0, 0.0, 0.0, 0.0]))
    assert np.abs(arm.state.command - arm.state.q).max() <= 0.1 + 1e-2


def test_where_it_begins() -> None:
    home = SimulatedArm().robot.home
    assert (SimulatedArm(q=home + 0.1).state.q == home + 0.1).all()
    with pytest.raises(InvalidInputError, match="outside the limits"):
        SimulatedArm(q=np.zeros(6))
    with pytest.raises(UnknownNameError, match="j2n6s300"):
        SimulatedArm("gen3")
    with pytest.raises(InvalidInputError, match="robot is j2s7s300, and the task has a j2n6s300"):
        SimulatedArm("j2s7s300", task=jacokin.tasks.load("reach_site").task)


def test_faults_are_read() -> None:
    assert Faults.parse("lag=0.02,loss=0.01,stall") == Faults(lag=0.02, loss=0.01, stall=0.3)
    assert Faults.parse("") == Faults()
    assert Faults.parse(" stall=1 ") == Faults(stall=1.0)
    for text, why in (
        ("lag", "lag=0.02"),
        ("loss=2", "loss must be at most 1"),
        ("lag=-1", "lag"),
        ("lag=nan", "lag"),
        ("stall=100", "stall must be at most 10"),
        ("lag=0.1,lag=0.2", "lag is given twice"),
    ):
        with pytest.raises(InvalidInputError, match=why):
            Faults.parse(text)
    with pytest.raises(UnknownNameError, match="lag, loss, stall"):
        Faults.parse("late=1")


def test_a_line_is_late_and_lossy() -> None:
    line: Line[int, int] = Line(Faults(lag=0.03, loss=0.25), seed=1)
    arrived: list[tuple[int, int]] = []
    for now in range(1000):
        line.tick(now)
        line.send(now)
        arrived += [(command, now) for command in line.arrived()]
    assert all(now - command == 3 for command, now in arrived)
    assert line.lost == pytest.approx(250, abs=60)
    assert len(arrived) == pytest.approx(1000 - line.lost, abs=3)
    assert line.measured == 999 - 3


def test_a_stalled_line_passes_nothing_now_and_then() -> None:
    line: Line[int, int] = Line(Faults(stall=0.3), seed=1)
    told = []
    for now in range(10000):
        line.tick(now)
        line.send(now)
        told.append(line.tell() is not None)
    assert line.stalls == pytest.approx(10000 * 0.01 / 5.3, abs=8)
    assert line.lost == 30 * line.stalls
    assert told.count(False) == line.lost


def test_ticks_and_jobs() -> None:
    ticks, jobs = [], []
    Ticker(math.inf).run(lambda: ticks.append(1), [(0.05, lambda: jobs.append(len(ticks)))], lambda: len(ticks) < 20)
    assert jobs == [5, 10, 15, 20]


def test_late_ticks_are_counted_also_where_it_is_interrupted() -> None:
    ticker, ticks = Ticker(), []

    def tick() -> None:
        ticks.append(1)
        if len(ticks) == 3:
            raise KeyboardInterrupt
        time.sleep(0.15)

    with pytest.raises(KeyboardInterrupt):
        ticker.run(tick, [], lambda: True)
    assert ticker.late == 2
