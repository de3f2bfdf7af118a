"""The judge of teleoperation: it sees what is wrong with a motion, and nothing where nothing is."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from jacokin import Robot
from jacokin.arrays import Array
from jacokin.teleop import make_stream

sys.path.append(str(Path(__file__).resolve().parents[2]))  # last: the installed package is what gets tested

from benchmarks.teleop import ACCELERATION, Played, judge, smoothed, ticks_of
from benchmarks.tracker import DT


def still(robot: Robot, way: float = 0.0, ticks: int = 400) -> Played:
    """The arm at home, asked to be some metres higher."""
    target = robot.forward_kinematics(robot.home)
    target = pin.SE3(target.rotation, target.translation + np.array([0.0, 0.0, way]))
    return Played(np.tile(robot.home, (ticks, 1)), [target] * ticks, np.full(ticks, 1e-4), np.zeros(ticks))


def changed(played: Played, tick: int, q: Array) -> Played:
    moved = played.q.copy()
    moved[tick] = q
    return played._replace(q=moved)


def test_an_arm_that_stands_where_it_is_asked_to_is_faultless(robot: Robot) -> None:
    found = judge(robot, still(robot), ACCELERATION)
    assert (found["stopped"], found["broken"], found["touched"]) == (False, False, False)
    assert found["slow_worst"] == pytest.approx(0.0, abs=1e-9)
    off = judge(robot, still(robot, 5e-3), ACCELERATION)
    assert off["stopped"]
    assert off["slow_worst"] == pytest.approx(5e-3, rel=1e-6)


def test_what_breaks_a_limit_or_touches_is_seen(robot: Robot) -> None:
    start, step = still(robot), np.zeros(6)
    step[4] = 1.01 * robot.velocity_limit[4] * DT
    assert judge(robot, changed(start, 200, robot.home + step), None)["broken"]
    step[4] = 1.01 * ACCELERATION * DT**2
    assert judge(robot, changed(start, 200, robot.home + step), ACCELERATION)["broken"]
    assert not judge(robot, changed(start, 200, robot.home + step), None)["broken"]
    outside = robot.home.copy()
    outside[1] = robot.upper[1] + 1e-12
    assert judge(robot, start._replace(q=np.tile(outside, (400, 1))), None)["broken"]
    samples = robot.sample(np.random.default_rng(0), 500)
    low = min(samples, key=lambda q: float(robot.forward_kinematics(q).translation[2]))
    assert judge(robot, changed(start, 200, low), None)["touched"]  # below the floor


def test_a_hand_is_heard_at_its_own_rate_and_its_last_pose_to_the_end(robot: Robot) -> None:
    stream = make_stream(robot, "smooth", np.random.default_rng(0), rate=20.0)
    heard = ticks_of(stream)
    spoken = [hand for hand in heard if hand is not None]
    assert sum(hand is None for hand in heard) > len(stream)  # four ticks of five
    assert len(spoken) > len(stream)
    assert np.array_equal(spoken[-1], stream.hand[-1])
    played = smoothed(robot, heard[:60], 20.0)
    assert played.q.shape == (60, 6)
    assert not judge(robot, played, ACCELERATION)["broken"]
