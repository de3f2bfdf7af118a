"""What the arm does with the freedom its targets leave: objectives for the null space.

Each objective names a joint velocity it would like. The tracker takes the part of it that moves no target, so an
objective never costs accuracy; with a full pose as target a six-joint arm has no such part.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from jacokin.arrays import Array
from jacokin.model import angles, checks
from jacokin.model.robot import Robot


class Objective(Protocol):
    """Anything that names a joint velocity it would like."""

    def velocity(self, robot: Robot, frame: str, q: Array) -> Array:
        """Joint velocity (dof,) [rad/s] wanted at `q` (dof,) [rad]."""


@dataclass(frozen=True, slots=True, eq=False)
class Posture:
    """Stay near a configuration.

    Attributes:
        q: (dof,) the configuration [rad]; free joints take the short way round.
        rate: how fast the distance shrinks [1/s].
    """

    q: ArrayLike
    rate: float = 2.0

    def __post_init__(self) -> None:
        """Check the rate; the tracker checks the configuration, as it knows the robot."""
        object.__setattr__(self, "rate", checks.positive("rate", self.rate, "1/s"))

    def velocity(self, robot: Robot, frame: str, q: Array) -> Array:
        """Towards the posture."""
        away = np.asarray(self.q, dtype=np.float64) - q
        return self.rate * np.where(robot.unlimited, angles.wrap_to_pi(away), away)


@dataclass(frozen=True, slots=True)
class Manipulability:
    """Keep away from singular poses: climb Yoshikawa's measure of the tracker's frame.

    Attributes:
        rate: joint velocity for each unit of the measure's relative gradient [rad^2/s].
    """

    rate: float = 0.2

    def __post_init__(self) -> None:
        """Check the rate."""
        object.__setattr__(self, "rate", checks.positive("rate", self.rate, "1/s"))

    def velocity(self, robot: Robot, frame: str, q: Array) -> Array:
        """Gradient of log sqrt(det(J J^T)): trace(J^+ dJ/dq_k), damped where J is singular."""
        jacobian = robot.jacobian(q, frame)
        change = robot.jacobian_derivative(q, frame)
        damped = jacobian @ jacobian.T + 1e-6 * np.eye(6)  # finite at singular poses
        return np.asarray(self.rate * np.einsum("ij,ijk->k", np.linalg.solve(damped, jacobian), change))


@dataclass(frozen=True, slots=True)
class LimitDistance:
    """Keep joints away from their limits, towards the middle of the range; free joints have none.

    Attributes:
        rate: how fast the distance to the middle shrinks [1/s].
    """

    rate: float = 1.0

    def __post_init__(self) -> None:
        """Check the rate."""
        object.__setattr__(self, "rate", checks.positive("rate", self.rate, "1/s"))

    def velocity(self, robot: Robot, frame: str, q: Array) -> Array:
        """Towards the middle, growing with the cube of the relative distance from it."""
        both = np.isfinite(robot.lower) & np.isfinite(robot.upper)
        half = np.where(both, 0.5 * (robot.upper - robot.lower), 1.0)
        middle = np.where(both, robot.lower + half, q)
        return np.asarray(-self.rate * half * ((q - middle) / half) ** 3)
