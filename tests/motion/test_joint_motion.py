"""Timed motions between configurations."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline

from jacokin import Robot
from jacokin.errors import InvalidInputError
from jacokin.motion import move_joints
from tests.motion.controllers import check_as_controllers_go

ROUNDING = 1e-9  # [rad/s, rad/s^2]


def test_limits_hold_and_the_ends_are_met(robot: Robot, rng: np.random.Generator) -> None:
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
    end = robot.home.copy()
    end[1] -= 1.0
    motion = move_joints(robot, robot.home, end, acceleration_limit=1.0)
    speed = robot.velocity_limit[1]
    least = 1.0 / speed + speed / 1.0
    assert least <= motion.duration <= least + 0.03  # two ticks, and one to be whole
    assert len(motion) == round(motion.duration / 0.01) + 1


def test_jerk_is_limited_at_every_instant(robot: Robot, rng: np.random.Generator) -> None:
    """Cubics from row to row, sampled at 10 kHz, as fine differences of their positions have it."""
    for dt in (0.002, 0.01, 0.05):
        start, end = robot.sample(rng), robot.sample(rng)
        velocity, acceleration, jerk = rng.uniform([[0.3], [0.5], [2.0]], [[0.8], [2.0], [20.0]], (3, robot.dof))
        limits: dict[str, Any] = {"velocity_limit": velocity, "acceleration_limit": acceleration}
        motion = move_joints(robot, start, end, dt=dt, jerk_limit=jerk, **limits)
        least = move_joints(robot, start, end, dt=dt, **limits)
        assert motion.duration >= least.duration
        t = np.arange(0.0, motion.duration + 2e-4, 1e-4)
        q = CubicHermiteSpline(motion.t, motion.q, motion.v)(np.minimum(t, motion.duration))
        v = np.diff(q, axis=0) / 1e-4
        a = np.diff(v, axis=0) / 1e-4
        assert (np.abs(v) <= velocity * (1 + 1e-6)).all()
        assert (np.abs(a) <= acceleration * (1 + 1e-4)).all()
        assert (np.abs(np.diff(a, axis=0)) / 1e-4 <= 1.01 * jerk).all()  # rounding of differences
        assert (np.diff(q, axis=0) * (motion.q[-1] - start) >= -1e-15).all()
        change = np.diff(motion.a, axis=0) / np.diff(motion.t)[:, None]
        assert (np.abs(change) <= jerk * (1 + 1e-6)).all()


def test_unlimited_joints_take_the_short_way(robot: Robot) -> None:
    start, end = robot.home.copy(), robot.home.copy()
    start[0], end[0] = 3.0, -3.0
    motion = move_joints(robot, start, end)
    assert motion.q[-1, 0] == pytest.approx(2 * np.pi - 3.0)
    assert np.ptp(motion.q[:, 0]) < 0.3


def test_going_nowhere_takes_no_time(robot: Robot) -> None:
    motion = move_joints(robot, robot.home, robot.home)
    assert (motion.duration, motion.message) == (0.0, "already there")
    assert np.array_equal(motion.q, robot.home[None])


@pytest.mark.parametrize(
    ("arguments", "match"),
    [
        ({"q_to": [0.0] * 6}, "q_to puts joint_2"),
        ({"q_to": [0.0] * 5}, "q_to must have shape"),
        ({"q_to": [np.nan] * 6}, "q_to must be finite"),
        ({"dt": 0.0}, "dt must be"),
        ({"velocity_limit": [1.0] * 5}, "velocity_limit"),
        ({"velocity_limit": -1.0}, "velocity_limit must be positive"),
        ({"acceleration_limit": 0.0}, "acceleration_limit must be positive"),
        ({"jerk_limit": np.inf}, "jerk_limit must be finite"),
        ({"q_from": [1e17, 2.9, 1.0, 4.2, 1.4, 1.3]}, r"q_from: joint_1 = 1e\+17 rad is too far from zero"),
        ({"q_to": [4.8, 2.9, 1.0, 4.2, 1.4, -1e7]}, r"q_to: joint_6 = -1e\+07 rad is too far from zero"),
        ({"velocity_limit": "0.5"}, "velocity_limit must be one number or 6"),
        ({"acceleration_limit": True}, "acceleration_limit must be one number or 6"),
        ({"jerk_limit": np.datetime64("2026-01-01")}, "jerk_limit must be one number or 6"),
        ({"q_to": np.ma.masked_array([4.8, 2.9, 1.0, 4.2, 1.4, 1.3], mask=[True] + 5 * [False])}, "q_to must be 6"),
    ],
)
def test_wrong_arguments_are_refused(robot: Robot, arguments: dict[str, Any], match: str) -> None:
    given: dict[str, Any] = {"q_from": robot.home, "q_to": robot.home, **arguments}
    with pytest.raises(InvalidInputError, match=match):
        move_joints(robot, **given)


def test_a_name_is_not_a_robot(robot: Robot) -> None:
    with pytest.raises(InvalidInputError, match="robot must be"):
        move_joints("j2n6s300", robot.home, robot.home)  # type: ignore[arg-type]  # wrong on purpose


BOUNDS = {"velocity_limit": 1e4, "acceleration_limit": 1e6, "jerk_limit": 1e9}


@pytest.mark.parametrize("name", BOUNDS)
@pytest.mark.parametrize("size", [10.0**k for k in (-300, -100, -20, -12, -9, -6, -4, 4, 6, 9, 12, 100, 300, 308)])
def test_limits_of_extreme_size_hold_or_are_refused(robot: Robot, name: str, size: float) -> None:
    goal = robot.home.copy()
    goal[[0, 1, 5]] += [2.0, 0.4, -1.0]
    limits: dict[str, float] = {"velocity_limit": 0.6, "acceleration_limit": 1.0, name: size}
    if size < {"velocity_limit": 1e-3, "acceleration_limit": 1e-5, "jerk_limit": 1e-8}[name]:
        with pytest.raises(InvalidInputError, match=r"no motion found within these limits|more than 10000000 steps"):
            move_joints(robot, robot.home, goal, dt=1e-4, **limits)
        return
    if size > BOUNDS[name]:
        with pytest.raises(InvalidInputError, match=f"{name} must be at most"):
            move_joints(robot, robot.home, goal, **limits)
        return
    motion = move_joints(robot, robot.home, goal, **limits)
    assert len(motion) > 10
    assert np.array_equal(motion.q[-1], goal)
    assert (np.abs(motion.v) <= limits["velocity_limit"] * (1 + 1e-9)).all()
    assert (np.abs(motion.a) <= limits["acceleration_limit"] * (1 + 1e-8)).all()


@pytest.mark.parametrize("acceleration", [1e3, 1e5, 1e6])
@pytest.mark.parametrize("velocity", [0.6, 100.0, 1e4])
@pytest.mark.parametrize("dt", [0.01, 1e-4])
def test_accelerations_are_held_up_to_the_bounds(robot: Robot, velocity: float, acceleration: float, dt: float) -> None:
    goal = robot.home.copy()
    goal[[0, 1, 5]] += [2.0, 0.4, -1.0]
    motion = move_joints(robot, robot.home, goal, dt=dt, velocity_limit=velocity, acceleration_limit=acceleration)
    assert motion.success
    assert (np.abs(motion.a) <= acceleration * (1 + 1e-8)).all()
    assert (np.abs(np.diff(motion.q, axis=0)) <= velocity * dt * (1 + 1e-9)).all()
    assert np.array_equal(motion.q[-1], goal)


@pytest.mark.parametrize("dt", [0.001, 0.01, 0.1, 0.5, 5.0])
@pytest.mark.parametrize("acceleration", [0.3, 1.0, 10.0])
def test_limits_hold_as_controllers_go_from_row_to_row(robot: Robot, dt: float, acceleration: float) -> None:
    goal = robot.home.copy()
    goal[[0, 1, 5]] += [2.0, 0.4, -1.0]
    goal = goal if dt > 0.001 else robot.home + 0.02
    motion = move_joints(robot, robot.home, goal, dt=dt, acceleration_limit=acceleration)
    check_as_controllers_go(motion, acceleration)
    assert np.allclose(np.diff(motion.t), dt, rtol=1e-9)


def test_far_turns_are_kept(robot: Robot) -> None:
    """An unlimited joint that has turned many times moves by the short way from where it is."""
    start = robot.home.copy()
    start[0] += 1000 * 2 * np.pi
    motion = move_joints(robot, start, robot.home)
    assert np.abs(motion.q - start).max() < 1e-9


@pytest.mark.parametrize("far", [1e-7, 1e-3, 0.3])
def test_a_joint_outside_its_limits_comes_straight_back(robot: Robot, tmp_path: Path, far: float) -> None:
    start = robot.home.copy()
    start[1] = robot.lower[1] - far
    motion = move_joints(robot, start, robot.home)
    assert motion.success
    past = np.maximum(robot.lower - motion.q, 0.0).max(axis=1)
    assert past[0] == pytest.approx(0.0 if far <= 1e-6 else far)
    assert (np.diff(past) <= 0.0).all()
    for name in ("motion.json", "motion.kinova.csv"):
        motion.save(tmp_path / name)
