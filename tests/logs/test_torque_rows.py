"""Rows for the identification of an arm, from a recording of its torques."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from jacokin import Robot
from jacokin.errors import InvalidInputError
from jacokin.logs import Log
from jacokin.model import identify_arm
from tests.logs.recordings import Array, Said, joint_state, names_of, write

SPEED = np.array([1.1, 1.7, 2.3, 2.9, 1.3, 1.9])  # [rad/s]
SIZE = 0.4  # [rad]


def motion(robot: Robot, t: Array) -> tuple[Array, Array, Array]:
    """Angles, velocities and accelerations (n, 6) at times (n,)."""
    phase = np.outer(t, SPEED) + np.arange(6)
    return robot.home + SIZE * np.sin(phase), SIZE * SPEED * np.cos(phase), -SIZE * SPEED**2 * np.sin(phase)


def recorded(real: Robot, t: Array, noise: float = 0.0) -> list[Said]:
    """What a driver reports of an arm: late by a random time, stamped with when it was measured."""
    rng = np.random.default_rng(0)
    rows = zip(*motion(real, t), strict=True)
    torques = np.array([real.inverse_dynamics(*row) for row in rows]) + rng.normal(0.0, 0.1, (len(t), 6))
    q, v, _ = motion(real, t)
    q = q + rng.normal(0.0, noise, q.shape)
    names = names_of(real).arm
    return [
        joint_state("/joint_states", float(at), names, *row)
        for at, row in zip(t, zip(q, v, torques, strict=True), strict=True)
    ]


@pytest.mark.slow
def test_a_heavier_arm_is_found_from_a_recording(robot: Robot, tmp_path: Path) -> None:
    bodies = np.array([body.toDynamicParameters() for body in list(robot.pin_model.inertias)[1:]])
    real = robot.with_bodies(1.2 * bodies)
    t = np.arange(0.0, 20.0, 0.01)
    rows = Log(write(tmp_path, ".mcap", recorded(real, t, 1e-5)), robot).torque_rows()
    found = identify_arm(robot, rows.q, rows.v, rows.a, rows.torque)
    q = robot.sample(np.random.default_rng(1), 50)
    off = np.array([found.robot.gravity(row) - real.gravity(row) for row in q])
    before = np.array([robot.gravity(row) - real.gravity(row) for row in q])
    assert np.sqrt((off**2).mean()) < 0.1 * np.sqrt((before**2).mean())


def test_derivatives_are_those_of_the_motion(robot: Robot, tmp_path: Path) -> None:
    t = np.arange(0.0, 4.0, 0.01)
    log = Log(write(tmp_path, ".db3", recorded(robot, t)), robot)
    rows = log.torque_rows(window=0.1)
    assert rows.step == pytest.approx(0.01)
    q, v, a = motion(robot, rows.t)
    np.testing.assert_allclose(rows.q, q, atol=1e-4)
    np.testing.assert_allclose(rows.v, v, atol=1e-2)
    np.testing.assert_allclose(rows.a, a, atol=2e-2)
    wide = log.torque_rows(window=0.5)
    exact = np.array([robot.inverse_dynamics(*row) for row in zip(*motion(robot, wide.t), strict=True)])
    assert (wide.torque - exact).std() < 0.5 * 0.1  # noise is averaged


def test_rows_beside_a_hole_are_left_out(robot: Robot, tmp_path: Path) -> None:
    t = np.arange(0.0, 4.0, 0.01)
    t = t[(t < 1.0) | (t > 1.5)]
    rows = Log(write(tmp_path, ".mcap", recorded(robot, t)), robot).torque_rows()
    assert not ((rows.t > 0.91) & (rows.t < 1.59)).any()
    assert (rows.t < 0.91).any()
    assert (rows.t > 1.59).any()


def test_why_there_are_no_rows_is_said(robot: Robot, tmp_path: Path) -> None:
    slow = Log(write(tmp_path / "slow", ".mcap", recorded(robot, np.arange(0.0, 4.0, 0.1))), robot)
    with pytest.raises(InvalidInputError, match="3 messages in a window of 0.2 s, and 7 are needed"):
        slow.torque_rows()
    assert len(slow.torque_rows(window=0.7).t) > 10
    with pytest.raises(InvalidInputError, match="window must be a positive number"):
        slow.torque_rows(window=0.0)
    bare = [joint_state("/joint_states", at, names_of(robot).arm, robot.home) for at in (0.0, 0.1, 0.2)]
    with pytest.raises(InvalidInputError, match="have no effort for every joint"):
        Log(write(tmp_path / "bare", ".mcap", bare), robot).torque_rows()
    one = [joint_state("/joint_states", 0.0, names_of(robot).arm, robot.home, (), robot.home)]
    with pytest.raises(InvalidInputError, match="one message only"):
        Log(write(tmp_path / "one", ".mcap", one), robot).torque_rows()
    short = recorded(robot, np.arange(0.0, 0.1, 0.01))
    with pytest.raises(InvalidInputError, match="nowhere are there 0.2 s of messages"):
        Log(write(tmp_path / "short", ".mcap", short), robot).torque_rows()
