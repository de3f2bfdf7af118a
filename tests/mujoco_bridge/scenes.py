"""The scenes that the tests of the bridge share: the arm with its hand in an arena, alone or with more."""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from jacokin.model.descriptions.bundled import DEFAULT_ROBOT
from jacokin.mujoco_bridge import Arena, JacoArm, JacoHand, ModelWrapperEntity, Physics, observations, robots

HOME = (4.8046852, 2.92482, 1.002, 4.2031852, 1.4458, 1.3233)  # [rad] Kinova's "Home" of the j2n6s300


class Parts(NamedTuple):
    """A tree of entities that is not compiled yet."""

    arena: Arena
    arm: JacoArm
    hand: JacoHand


class Scene(NamedTuple):
    """A simulation and its entities."""

    physics: Physics
    arena: Arena
    arm: JacoArm
    hand: JacoHand


def jaco_parts(
    settings: observations.ObservationSettings = observations.PERFECT_FEATURES,
    *,
    robot: str = DEFAULT_ROBOT,
    arena: Arena | None = None,
    position: ArrayLike = robots.ARM_OFFSET,
    quaternion: ArrayLike | None = None,
) -> Parts:
    """The arm with its hand, attached to an arena (a new one unless given)."""
    arm, hand = robots.make_arm(settings, robot), robots.make_hand(settings, robot)
    arm.attach(hand)
    arena = Arena() if arena is None else arena
    arena.attach(arm, position=position, quaternion=quaternion)
    return Parts(arena, arm, hand)


def jaco_scene(
    settings: observations.ObservationSettings = observations.PERFECT_FEATURES,
    *,
    robot: str = DEFAULT_ROBOT,
    arena: Arena | None = None,
    position: ArrayLike = robots.ARM_OFFSET,
    quaternion: ArrayLike | None = None,
) -> Scene:
    """The same compiled, with the arm at home."""
    arena, arm, hand = jaco_parts(settings, robot=robot, arena=arena, position=position, quaternion=quaternion)
    physics = Physics.from_entity(arena)
    arm.set_home(physics)
    return Scene(physics, arena, arm, hand)


def attach_sideways(arena: Arena, ball: ModelWrapperEntity) -> None:
    """Attach a ball that may slide along x and y."""
    held = arena.attach(ball)
    for name, axis in (("x", (1.0, 0.0, 0.0)), ("y", (0.0, 1.0, 0.0))):
        held.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis)


def close_until_still(physics: Physics, hand: JacoHand) -> None:
    """Close the fingers at full speed until they stand still."""
    fingers = physics.bind(hand.joints)
    physics.bind(hand.actuators).ctrl = 5.0
    physics.step()
    while np.abs(fingers.qvel).max() > 1e-3:
        physics.step()
        assert physics.time < 5.0


def check_torque_balances_the_joint(arm: JacoArm, states: int) -> None:
    """The sensor measures what is left of the joint's own torques: armature, friction, damping and actuator."""
    arena = Arena()
    arena.attach(arm)
    physics = Physics.from_entity(arena)
    rng = np.random.default_rng(0)
    joints = physics.bind(arm.joints)
    checked = 0
    while checked < states:
        arm.randomize_arm_joints(physics, rng)
        joints.qvel = rng.uniform(-0.5, 0.5, len(arm.joints))
        physics.bind(arm.actuators).ctrl = rng.uniform(-0.5, 0.5, len(arm.joints))
        physics.forward()
        if physics.data.ncon:
            continue
        checked += 1
        own = joints.armature * joints.qacc - joints.qfrc_constraint - joints.qfrc_passive - joints.qfrc_actuator
        assert np.abs(own).max() > 0.1
        np.testing.assert_allclose(arm.observables.joints_torque(physics), -own, rtol=0.0, atol=1e-9)
