"""`TorqueControl`: the mode in which the base of an arm takes torques instead of velocities (README of kinova-ros).

The base holds the arm against gravity; torques come on top of that. Without one for 0.25 s they are zero. A joint that
becomes too fast, or could no longer stop before its limit, takes the arm back to where positions are held.
"""

from __future__ import annotations

import numpy as np

from jacokin.arrays import Array
from jacokin.twin.arm import SimulatedArm

INACTIVITY = 0.25  # [s] README, torque inactivity


class TorqueControl:
    """What the base does with torques.

    Attributes:
        is_on: whether it is in that mode.
        safety_factor: share of the velocity limits at which it leaves the mode, torque_parameters/safety_factor.
    """

    def __init__(self, arm: SimulatedArm) -> None:
        """Of an arm; off."""
        self.is_on, self.safety_factor = False, 1.0
        self._arm = arm
        self._torques = np.zeros(arm.robot.dof)
        self._heard = -np.inf

    def turn(self, *, on: bool) -> None:
        """Go into the mode, or out of it: then the arm stands as soon as it can."""
        if self.is_on and not on:
            self._arm.hold()
        self.is_on, self._heard = on, -np.inf

    def take(self, torques: Array) -> None:
        """Torques (dof,) came [N m]."""
        self._torques, self._heard = torques, self._arm.state.time

    def take_force(self, wrench: Array) -> None:
        """A wrench (6,) at the tool came, in base axes, force first [N, N m]."""
        robot = self._arm.robot
        self.take(robot.jacobian(self._arm.state.q, frame="end_effector").T @ wrench)

    def tick(self) -> None:
        """Simulate a tick of the mode."""
        arm = self._arm
        is_silent = arm.state.time - self._heard > INACTIVITY
        arm.tick_torques(np.zeros_like(self._torques) if is_silent else self._torques)
        too_fast = np.abs(arm.state.v) > self.safety_factor * arm.robot.velocity_limit
        if too_fast.any() or not arm.can_stop():
            self.turn(on=False)
