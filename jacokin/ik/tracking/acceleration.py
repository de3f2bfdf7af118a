"""Acceleration limits: a joint that cannot change its speed at once follows one that can.

The QP moves a reference that obeys velocity and position limits. Each joint of the arm chases its reference as fast as
its acceleration allows, and never faster than it could brake again: within the way to the reference, relative to the
reference's own speed, and within the way to its limit. With one joint at a time nothing couples, so nothing oscillates.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from jacokin.ik.tracking.joint_bounds import AT_BOUND, JointBox

Array = NDArray[np.float64]


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
    """Chases a reference within acceleration limits."""

    def __init__(self, names: tuple[str, ...], box: JointBox, acceleration: Array, dt: float) -> None:
        """Keep the limits; `acceleration` (dof,) [rad/s^2], `dt` the control step [s]."""
        self._names = names
        self._box = box
        self._acceleration = acceleration
        self._dt = dt

    def displacement(self, q: Array, v: Array, reference: Array, reference_velocity: Array) -> Array:
        """Where the joints go in the coming tick.

        Args:
            q: (dof,) joint angles [rad], legal.
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
