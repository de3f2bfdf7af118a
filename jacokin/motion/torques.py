"""Limits of joint torques along a motion: as slow as they ask for, by the arm's inverse dynamics.

A motion that takes k times as long needs the same torque against gravity and 1 / k^2 of what its velocities and
accelerations ask for, so the least k that keeps a limit is found directly.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike

from jacokin.arrays import Array
from jacokin.model import checks
from jacokin.model.robot import Robot

BETWEEN = 0.002  # [s] between places that are looked at; in this time torques change by parts in a thousand
MOST_PLACES = 20_000
USED = 0.99  # of a limit; what remains is for what lies between the places
SLOWEST = 0.02  # of its speed, at which a motion counts as one that gravity forbids


class TimeLaw(Protocol):
    """Where the arm is at any time."""

    @property
    def duration(self) -> float:
        """From start to end [s]."""

    def at(self, t: Array) -> tuple[Array, Array, Array]:
        """Configurations (m, dof) [rad], velocities [rad/s] and accelerations [rad/s^2] at times (m,) [s]."""


class Slowed(NamedTuple):
    """A motion that takes so many times as long."""

    law: TimeLaw
    factor: float

    @property
    def duration(self) -> float:
        """From start to end [s]."""
        return self.law.duration * self.factor

    def at(self, t: Array) -> tuple[Array, Array, Array]:
        """As `TimeLaw.at`."""
        q, v, a = self.law.at(t / self.factor)
        return q, v / self.factor, a / self.factor**2


class TooHeavy(NamedTuple):
    """What gravity asks for where no slowness helps."""

    joint: int
    torque: float
    """[N m]."""

    def explain(self, robot: Robot) -> str:
        """In a sentence."""
        return f"{robot.joint_names[self.joint]} needs {self.torque:.4g} N m on the way, standing still"


def torque_limits(robot: Robot, limit: ArrayLike | bool | None) -> Array | None:
    """Checked limits (dof,) [N m]: those given, the robot's own for True, or none.

    Raises:
        InvalidInputError: neither one number nor one for each joint, or one that is not positive.
    """
    if limit is None or limit is False:
        return None
    return robot.effort_limit if limit is True else checks.positive_vector("torque_limit", limit, robot.dof, "N m")


def slow_down(robot: Robot, law: TimeLaw, limit: Array) -> TimeLaw | TooHeavy:
    """The motion itself, or slower, so that no joint needs more torque than its limit (dof,) [N m]."""
    count = int(np.clip(np.ceil(law.duration / BETWEEN), 2, MOST_PLACES))
    rows = law.at(np.linspace(0.0, law.duration, count + 1))
    still = np.zeros(robot.dof)
    gravity = np.array([robot.inverse_dynamics(q, still, still) for q in rows[0]])
    moving = np.array([robot.inverse_dynamics(*row) for row in zip(*rows, strict=True)]) - gravity
    room = USED * limit - np.where(moving > 0.0, gravity, -gravity)
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(moving == 0.0, np.inf, room / np.abs(moving))
    heavy = np.abs(gravity) - USED * limit
    if heavy.max() > 0.0:
        row, joint = np.unravel_index(int(np.argmax(heavy)), heavy.shape)
        return TooHeavy(int(joint), float(gravity[row, joint]))
    least = float(share.min())
    if least >= 1.0:
        return law
    if least < SLOWEST**2:
        row, joint = np.unravel_index(int(np.argmin(share)), share.shape)
        return TooHeavy(int(joint), float(gravity[row, joint]))
    return Slowed(law, 1.0 / float(np.sqrt(least)))
