"""`MotionState`: a motion at one time, from which a tracker or a plan goes on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.ik.results import Frozen
from jacokin.model.robot import Robot

ROUNDING = 1e-9  # of a velocity limit


@dataclass(frozen=True, slots=True, eq=False)
class MotionState(Frozen):
    """A motion at one time, from which another tracker or a plan may go on. Arrays are read-only."""

    q: Array
    """(dof,) joint angles [rad]."""
    v: Array
    """(dof,) joint velocities [rad/s]."""
    a: Array
    """(dof,) joint accelerations [rad/s^2], the last change of the velocities."""


def checked_velocity(robot: Robot, v: object, limit: Array) -> Array:
    """Joint velocities (dof,) [rad/s] within their limits (dof,) [rad/s].

    Raises:
        InvalidInputError: malformed, or faster.
    """
    speed = robot.configuration(v, "v")  # type: ignore[arg-type]  # checked there
    fast = int(np.argmax(np.abs(speed) - limit))
    if abs(speed[fast]) > limit[fast] * (1.0 + ROUNDING):
        raise InvalidInputError(
            f"v has {robot.joint_names[fast]} at {speed[fast]:.6g} rad/s, its limit is {limit[fast]:.6g} rad/s"
        )
    return speed
