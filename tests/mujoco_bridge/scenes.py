"""The scenes that the tests of the bridge share: the arm with its hand in an arena, alone or with more."""

from __future__ import annotations

from typing import NamedTuple

from numpy.typing import ArrayLike

from jacokin.mujoco_bridge import Arena, JacoArm, JacoHand, Physics, observations, robots

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
    arena: Arena | None = None,
    position: ArrayLike = robots.ARM_OFFSET,
    quaternion: ArrayLike | None = None,
) -> Parts:
    """The arm with its hand, attached to an arena (a new one unless given)."""
    arm, hand = robots.make_arm(settings), robots.make_hand(settings)
    arm.attach(hand)
    arena = Arena() if arena is None else arena
    arena.attach(arm, position=position, quaternion=quaternion)
    return Parts(arena, arm, hand)


def jaco_scene(
    settings: observations.ObservationSettings = observations.PERFECT_FEATURES,
    *,
    arena: Arena | None = None,
    position: ArrayLike = robots.ARM_OFFSET,
    quaternion: ArrayLike | None = None,
) -> Scene:
    """The same compiled, with the arm at home."""
    arena, arm, hand = jaco_parts(settings, arena=arena, position=position, quaternion=quaternion)
    physics = Physics.from_entity(arena)
    arm.set_home(physics)
    return Scene(physics, arena, arm, hand)
