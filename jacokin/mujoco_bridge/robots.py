"""The arm and the hand with the observables that manipulation tasks use."""

from __future__ import annotations

from jacokin.model.descriptions import table
from jacokin.mujoco_bridge import observations
from jacokin.mujoco_bridge.base import DOWN_QUATERNION
from jacokin.mujoco_bridge.jaco_arm import JacoArm
from jacokin.mujoco_bridge.jaco_hand import JacoHand

ARM_OFFSET: tuple[float, float, float] = tuple(table.load()["arena"]["arm_offset"]["xyz"])
"""Position of the arm's base in the arena [m]."""

__all__ = ["ARM_OFFSET", "DOWN_QUATERNION", "make_arm", "make_hand"]


def make_arm(obs_settings: observations.ObservationSettings) -> JacoArm:
    """Make an arm with its observables configured.

    Args:
        obs_settings: the options of each category of observables, such as `observations.PERFECT_FEATURES`.
    """
    options = observations.make_options(obs_settings, observations.JACO_ARM_OBSERVABLES)
    return JacoArm(observable_options=options)


def make_hand(obs_settings: observations.ObservationSettings) -> JacoHand:
    """Make a hand with its observables configured, whose tool centre point is the pinch site.

    Args:
        obs_settings: the options of each category of observables, such as `observations.PERFECT_FEATURES`.
    """
    options = observations.make_options(obs_settings, observations.JACO_HAND_OBSERVABLES)
    return JacoHand(use_pinch_site_as_tcp=True, observable_options=options)
