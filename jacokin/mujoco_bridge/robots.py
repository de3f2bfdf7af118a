"""The arm and the hand with the observables that manipulation tasks use."""

from __future__ import annotations

from pathlib import Path

from jacokin.model.descriptions import bundled
from jacokin.model.measured_arm import MeasuredArm
from jacokin.mujoco_bridge import observations
from jacokin.mujoco_bridge.base import DOWN_QUATERNION
from jacokin.mujoco_bridge.jaco_arm import JacoArm
from jacokin.mujoco_bridge.jaco_hand import JacoHand, has_pinch_site

ARM_OFFSET: tuple[float, float, float] = tuple(bundled.robot_table()["arena"]["arm_offset"]["xyz"])
"""Position of the arm's base in the arena [m]."""

__all__ = ["ARM_OFFSET", "DOWN_QUATERNION", "make_arm", "make_hand"]


def make_arm(
    obs_settings: observations.ObservationSettings,
    robot: str = bundled.DEFAULT_ROBOT,
    *,
    calibration: str | Path | MeasuredArm | None = None,
    actuation: str = "velocity",
) -> JacoArm:
    """Make an arm with its observables configured.

    Args:
        obs_settings: the options of each category of observables, such as `observations.PERFECT_FEATURES`.
        robot: the bundled robot whose arm it is.
        calibration: how it differs from that robot, as in `jacokin.load_robot`.
        actuation: what the controls are: "velocity" [rad/s], "torque" [N m] or "position" [rad].

    Raises:
        InvalidInputError: an argument is wrong.
        ModelError: the calibration is damaged or another arm's.
    """
    options = observations.make_options(obs_settings, observations.JACO_ARM_OBSERVABLES)
    return JacoArm(robot=robot, calibration=calibration, actuation=actuation, observable_options=options)


def make_hand(obs_settings: observations.ObservationSettings, robot: str = bundled.DEFAULT_ROBOT) -> JacoHand:
    """Make a hand with its observables configured.

    Its tool centre point is the pinch site; that of a hand with two fingers, which has none, the grip site.

    Args:
        obs_settings: the options of each category of observables, such as `observations.PERFECT_FEATURES`.
        robot: the bundled robot whose hand it is.

    Raises:
        InvalidInputError: an argument is wrong.
    """
    pinches = has_pinch_site(robot)
    names = observations.JACO_HAND_OBSERVABLES if pinches else observations.TWO_FINGER_HAND_OBSERVABLES
    options = observations.make_options(obs_settings, names)
    return JacoHand(robot=robot, use_pinch_site_as_tcp=pinches, observable_options=options)
