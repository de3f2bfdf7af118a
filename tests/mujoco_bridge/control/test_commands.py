"""Commands for the velocity actuators."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from jacokin.errors import InvalidInputError, UnknownNameError
from jacokin.mujoco_bridge import Arena, JacoArm, Physics
from jacokin.mujoco_bridge.control.commands import command_joint_positions, command_site_velocity
from tests.mujoco_bridge.scenes import jaco_scene

CONTROL_STEPS = 20  # physics steps of 2 ms
NEAR = 2e-3  # [rad] dry friction of 2 N m against a gain of 500 N m s/rad leaves 0.8 mrad at a gain of 5 / s


def test_joint_positions_are_reached_against_gravity_the_short_way_round() -> None:
    physics, _, arm, _ = jaco_scene()
    start = physics.bind(arm.joints).qpos.copy()
    goal = start + np.array((0.3, -0.4, 0.2, 2.0 * np.pi - 0.5, 0.4, -6.0))
    short = start + np.array((0.3, -0.4, 0.2, -0.5, 0.4, 2.0 * np.pi - 6.0))
    fastest = np.zeros(6)
    for _ in range(100):
        left = command_joint_positions(physics, arm, goal)
        physics.step(CONTROL_STEPS)
        fastest = np.maximum(fastest, np.abs(physics.bind(arm.joints).qvel))
    np.testing.assert_allclose(physics.bind(arm.joints).qpos, short, rtol=0.0, atol=NEAR)
    assert np.abs(left).max() < NEAR
    assert (fastest <= physics.bind(arm.actuators).ctrlrange[:, 1] + 0.01).all()


def test_a_site_follows_a_commanded_velocity() -> None:
    physics, _, arm, hand = jaco_scene()
    site = physics.bind(hand.pinch_site)
    for _ in range(10):  # gather speed
        command_site_velocity(physics, arm, hand.pinch_site, (0.0, 0.0, 0.05, 0.0, 0.0, 0.0))
        physics.step(CONTROL_STEPS)
    before, axes = site.xpos.copy(), site.xmat.copy()
    for _ in range(25):
        velocities = command_site_velocity(physics, arm, hand.pinch_site.name, (0.0, 0.0, 0.05, 0.0, 0.0, 0.0))
        assert velocities.shape == (6,)
        physics.step(CONTROL_STEPS)
    # One second at 5 cm/s; dry friction holds each joint back by up to 4 mrad/s.
    np.testing.assert_allclose(site.xpos - before, (0.0, 0.0, 0.05), rtol=0.0, atol=5e-3)
    np.testing.assert_allclose(site.xmat, axes, rtol=0.0, atol=0.02)


def test_commands_in_world_axes_whatever_the_base() -> None:
    arm, arena = JacoArm(), Arena()
    arena.attach(arm, quaternion=(np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0))
    physics = Physics.from_entity(arena)
    arm.set_home(physics)
    site = physics.bind(arm.wrist_site)
    twist = np.array((0.02, -0.03, 0.04, 0.1, 0.0, -0.1))
    velocities = command_site_velocity(physics, arm, arm.wrist_site, twist)
    step = 1e-6  # [s]
    before = site.xpos.copy()
    physics.bind(arm.joints).qpos += step * velocities
    np.testing.assert_allclose((site.xpos - before) / step, twist[:3], rtol=0.0, atol=1e-3)


def test_too_fast_is_slowed_down_in_the_same_direction() -> None:
    physics, _, arm, hand = jaco_scene()
    slow = command_site_velocity(physics, arm, hand.grip_site, (0.0, 0.01, 0.0, 0.0, 0.0, 0.0))
    fast = command_site_velocity(physics, arm, hand.grip_site, (0.0, 9.0, 0.0, 0.0, 0.0, 0.0))
    limit = physics.bind(arm.actuators).ctrlrange[:, 1]
    assert np.max(np.abs(fast) / limit) == pytest.approx(1.0)
    np.testing.assert_allclose(fast / np.linalg.norm(fast), slow / np.linalg.norm(slow), rtol=0.0, atol=1e-9)
    assert (np.abs(physics.bind(arm.actuators).ctrl) <= limit).all()


def test_bad_commands_change_nothing() -> None:
    physics, _, arm, hand = jaco_scene()
    before = physics.get_state().tobytes()
    calls: list[Any] = [
        lambda: command_joint_positions(physics, arm, (0.0,) * 5),
        lambda: command_joint_positions(physics, arm, (np.nan,) * 6),
        lambda: command_joint_positions(physics, arm, (0.0,) * 6, gain=0.0),
        lambda: command_joint_positions(physics, arm, (0.0,) * 6, gain=np.inf),
        lambda: command_joint_positions(physics, arm, (0.0,) * 6, gain=True),
        lambda: command_joint_positions(physics, arm, (True,) * 6),
        lambda: command_site_velocity(physics, arm, hand.pinch_site, (True,) * 6),
        lambda: command_site_velocity(physics, arm, hand.pinch_site, (0.0,) * 3),
        lambda: command_site_velocity(physics, arm, 5, (0.0,) * 6),
    ]
    for call in calls:
        with pytest.raises(InvalidInputError):
            call()
    with pytest.raises(UnknownNameError):
        command_site_velocity(physics, arm, "hand", (0.0,) * 6)
    assert physics.get_state().tobytes() == before
