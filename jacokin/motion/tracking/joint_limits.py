"""How far each joint may go in one tick: position, velocity and acceleration limits.

Position and velocity limits are bounds on the displacement of a joint, so together they are a box, and from a
configuration within the limits the box contains zero: the QP inside it always has an answer.

Acceleration limits are kept outside the QP. The QP moves a reference that obeys the box, and each joint of the arm
follows its reference as fast as its acceleration allows, never faster than it can brake again: within the way to the
reference, relative to the reference's own speed, and within the way to its limit. The joints do not couple, so nothing
oscillates.
"""

from __future__ import annotations

import numpy as np

from jacokin.arrays import Array
from jacokin.model.robot import Robot

AT_BOUND = 1e-6  # of the velocity limit's step: a displacement this near to a bound lies on it


class JointBox:
    """Bounds on the displacement of the joints in one tick.

    Attributes:
        lower: (dof,) lower limits [rad].
        upper: (dof,) upper limits [rad].
        step: (dof,) largest displacement in a tick by the velocity limits [rad].
    """

    def __init__(self, robot: Robot, velocity: Array, dt: float) -> None:
        """Keep the limits: `velocity` (dof,) [rad/s], `dt` the control step [s]."""
        self._names = robot.joint_names
        self.lower, self.upper = robot.lower, robot.upper
        self.step = velocity * dt

    def bounds(self, q: Array) -> tuple[Array, Array]:
        """Least and largest displacement (dof,) [rad] from a `q` within the limits [rad]."""
        return np.maximum(-self.step, self.lower - q), np.minimum(self.step, self.upper - q)

    def move(self, q: Array, displacement: Array) -> Array:
        """The configuration after a displacement; adding may round past a limit."""
        return np.minimum(np.maximum(q + displacement, self.lower), self.upper)

    def limiting(self, displacement: Array, q: Array) -> list[str]:
        """Which limits a displacement from `q` has run into."""
        slack = AT_BOUND * self.step
        at_upper = displacement >= self.upper - q - slack
        at_lower = displacement <= self.lower - q + slack
        fast = np.abs(displacement) >= self.step - slack
        found = []
        for joint, name in enumerate(self._names):
            if at_upper[joint]:
                found.append(f"{name} upper limit")
            elif at_lower[joint]:
                found.append(f"{name} lower limit")
            elif fast[joint]:
                found.append(f"{name} velocity")
        return found


def braking_speed(distance: Array, deceleration: Array, dt: float) -> Array:
    """Largest speed over the coming tick from which a joint can still stop within a distance.

    A joint that moves at u a dt this tick and brakes by a dt every tick after travels
    a dt^2 (u (n + 1) - n (n + 1) / 2) in all, n = floor(u). This is the inverse, exact in discrete time; the usual
    sqrt(2 a d) overshoots by up to half a tick.

    Args:
        distance: (dof,) free travel [rad], >= 0; inf for no end.
        deceleration: (dof,) [rad/s^2].
        dt: control step [s].

    Returns:
        (dof,) speeds [rad/s].
    """
    x = distance / (deceleration * dt * dt)
    n = np.floor(0.5 * (np.sqrt(1.0 + 8.0 * np.minimum(x, 1e15)) - 1.0))
    speed: Array = (x + 0.5 * n * (n + 1.0)) / (n + 1.0) * deceleration * dt
    return speed


class Follower:
    """Follows a reference within acceleration limits."""

    def __init__(self, robot: Robot, box: JointBox, acceleration: Array, dt: float) -> None:
        """Keep the limits: `acceleration` (dof,) [rad/s^2], `dt` the control step [s]."""
        self._names = robot.joint_names
        self._box = box
        self._acceleration = acceleration
        self._dt = dt

    def displacement(self, q: Array, v: Array, reference: Array, reference_velocity: Array) -> Array:
        """Where the joints go in the coming tick.

        Args:
            q: (dof,) joint angles [rad], within the limits.
            v: (dof,) velocities over the last tick [rad/s].
            reference: (dof,) where the joints should be at the end of the tick [rad].
            reference_velocity: (dof,) velocity of the reference [rad/s].

        Returns:
            (dof,) displacement [rad].
        """
        dt, a = self._dt, self._acceleration
        low, high = self._box.bounds(q)
        low = np.maximum(low, -braking_speed(q - self._box.lower, a, dt) * dt)
        high = np.minimum(high, braking_speed(self._box.upper - q, a, dt) * dt)
        along = reference_velocity * dt
        gap = reference - q - along
        wanted = along + np.sign(gap) * braking_speed(np.abs(gap), a, dt) * dt
        wanted = np.clip(wanted, low, high)
        # Braking as hard as allowed always satisfies the bounds above, but for rounding.
        return np.asarray(np.clip(wanted, (v - a * dt) * dt, (v + a * dt) * dt))

    def limiting(self, v: Array, v_before: Array) -> list[str]:
        """Joints whose speed changed as fast as allowed."""
        most = self._acceleration * self._dt * (1.0 - AT_BOUND)
        return [
            f"{name} acceleration"
            for name, change, limit in zip(self._names, np.abs(v - v_before), most, strict=True)
            if change >= limit
        ]
