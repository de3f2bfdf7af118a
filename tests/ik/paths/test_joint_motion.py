"""Timed motions between configurations."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
import pytest

from jacokin import Robot
from jacokin.errors import InvalidInputError, MissingExtraError
from jacokin.ik.paths.joint_motion import move_joints

ROUNDING = 1e-9  # [rad/s, rad/s^2] in Ruckig's polynomials


def test_limits_hold_and_the_ends_are_met(robot: Robot, rng: np.random.Generator) -> None:
    pytest.importorskip("ruckig")
    for jerk in (None, 10.0):
        for _ in range(20):
            start, end = robot.sample(rng), robot.sample(rng)
            motion = move_joints(robot, start, end, acceleration_limit=1.5, jerk_limit=jerk)
            assert np.array_equal(motion.q[0], start)
            away = motion.q[-1] - end
            assert np.allclose(away[~robot.unlimited], 0.0, atol=0.0)
            assert np.allclose(
                away[robot.unlimited] / (2 * np.pi), np.round(away[robot.unlimited] / (2 * np.pi)), atol=1e-15
            )
            assert (np.abs(motion.q[-1] - start)[robot.unlimited] <= np.pi + 1e-12).all()
            assert all(robot.within_limits(q) for q in motion.q)
            assert (np.abs(motion.v) <= robot.velocity_limit + ROUNDING).all()
            assert (np.abs(motion.a) <= 1.5 + ROUNDING).all()
            assert np.allclose(motion.v[[0, -1]], 0.0, atol=ROUNDING)
            # v is the derivative of q
            steps = np.diff(motion.t)[:, None]
            assert np.allclose(np.diff(motion.q, axis=0) / steps, 0.5 * (motion.v[1:] + motion.v[:-1]), atol=0.02)


def test_the_time_is_the_least_possible(robot: Robot) -> None:
    """One joint alone: up to speed, along, and down again."""
    pytest.importorskip("ruckig")
    end = robot.home.copy()
    end[1] -= 1.0
    motion = move_joints(robot, robot.home, end, acceleration_limit=1.0)
    speed = robot.velocity_limit[1]
    assert motion.duration == pytest.approx(1.0 / speed + speed / 1.0, rel=1e-9)
    assert len(motion) == int(np.ceil(motion.duration / 0.01)) + 1


def test_free_joints_take_the_short_way(robot: Robot) -> None:
    pytest.importorskip("ruckig")
    start, end = robot.home.copy(), robot.home.copy()
    start[0], end[0] = 3.0, -3.0
    motion = move_joints(robot, start, end)
    assert motion.q[-1, 0] == pytest.approx(2 * np.pi - 3.0)
    assert np.ptp(motion.q[:, 0]) < 0.3


def test_going_nowhere_takes_no_time(robot: Robot) -> None:
    pytest.importorskip("ruckig")
    motion = move_joints(robot, robot.home, robot.home)
    assert motion.duration == 0.0
    assert np.array_equal(motion.q, robot.home[None])


@pytest.mark.parametrize(
    ("arguments", "match"),
    [
        ({"q_to": [0.0] * 6}, "q_to puts joint_2"),
        ({"q_from": [0.0] * 6}, "q_from puts joint_2"),
        ({"q_to": [0.0] * 5}, "q_to must have shape"),
        ({"q_to": [np.nan] * 6}, "q_to must be finite"),
        ({"dt": 0.0}, "dt must be"),
        ({"velocity_limit": [1.0] * 5}, "velocity_limit"),
        ({"velocity_limit": -1.0}, "velocity_limit must be positive"),
        ({"acceleration_limit": 0.0}, "acceleration_limit must be positive"),
        ({"jerk_limit": np.inf}, "jerk_limit must be finite"),
    ],
)
def test_wrong_arguments_are_refused(robot: Robot, arguments: dict[str, Any], match: str) -> None:
    given: dict[str, Any] = {"q_from": robot.home, "q_to": robot.home, **arguments}
    with pytest.raises(InvalidInputError, match=match):
        move_joints(robot, **given)


def test_a_name_is_no_robot(robot: Robot) -> None:
    with pytest.raises(InvalidInputError, match="robot must be"):
        move_joints("j2n6s300", robot.home, robot.home)  # type: ignore[arg-type]  # wrong on purpose


def test_without_ruckig_the_extra_is_named(robot: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ruckig", None)
    with pytest.raises(MissingExtraError, match=r"jacokin\[motion\]"):
        move_joints(robot, robot.home, robot.home)
