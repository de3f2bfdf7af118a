"""How far each joint may go in one tick: velocity, acceleration and position limits as one box.

All three are bounds on the displacement of a joint, so their intersection is a box. From a legal configuration the box
is never empty: without acceleration limits it contains zero, with them it contains the hardest braking.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

AT_BOUND = 1e-9  # of the velocity limit's step: a QP solution this near to a bound lies on it


def braking_speed(distance: Array, deceleration: Array, dt: float) -> Array:
    """Largest speed over the coming tick from which a joint can still stop within a distance.

    A joint that moves at u a dt this tick and then brakes by a dt every tick travels
    a dt^2 (u (n + 1) - n (n + 1) / 2) in all, n = floor(u). This is the inverse, exact in discrete time: the usual
    sqrt(2 a d) overshoots by up to half a tick.

    Args:
        distance: (dof,) free travel [rad], >= 0.
        deceleration: (dof,) [rad/s^2].
        dt: control step [s].

    Returns:
        (dof,) speeds [rad/s].
    """
    x = distance / (deceleration * dt * dt)
    # Infinite travel (free joints) stays infinite.
    n = np.floor(0.5 * (np.sqrt(1.0 + 8.0 * np.minimum(x, 1e15)) - 1.0))
    speed: Array = np.where(np.isinf(x), np.inf, (x + 0.5 * n * (n + 1.0)) / (n + 1.0) * deceleration * dt)
    return speed


class JointBox:
    """Bounds on the displacement of the joints in one tick.

    Attributes:
        velocity: (dof,) [rad/s].
        acceleration: (dof,) [rad/s^2], or None.
    """

    def __init__(
        self,
        names: tuple[str, ...],
        lower: Array,
        upper: Array,
        velocity: Array,
        acceleration: Array | None,
        dt: float,
    ) -> None:
        """Keep the limits; all arrays (dof,)."""
        self._names = names
        self._lower, self._upper = lower, upper
        self.velocity = velocity
        self.acceleration = acceleration
        self._dt = dt
        self._step = velocity * dt

    def bounds(self, q: Array, v: Array) -> tuple[Array, Array]:
        """Least and largest displacement (dof,) [rad] from a legal `q` [rad] reached at speed `v` [rad/s]."""
        to_lower, to_upper = self._lower - q, self._upper - q
        low, high = np.maximum(-self._step, to_lower), np.minimum(self._step, to_upper)
        if self.acceleration is not None:
            change = self.acceleration * self._dt
            low = np.maximum(low, -braking_speed(-to_lower, self.acceleration, self._dt) * self._dt)
            high = np.minimum(high, braking_speed(to_upper, self.acceleration, self._dt) * self._dt)
            # Braking comes first where rounding leaves nothing between the bounds.
            low = np.minimum(np.maximum(low, (v - change) * self._dt), (v + change) * self._dt)
            high = np.maximum(np.minimum(high, (v + change) * self._dt), (v - change) * self._dt)
            low, high = np.maximum(low, to_lower), np.minimum(high, to_upper)
            high = np.maximum(low, high)
        return low, high

    def approach(self, low: Array, high: Array, ahead: Array, goal_velocity: Array) -> tuple[Array, Array]:
        """Narrow the box so that joints can stop, with the goal, when they get there.

        Args:
            low: (dof,) least displacement [rad].
            high: (dof,) largest displacement [rad].
            ahead: (dof,) displacement to the goal [rad].
            goal_velocity: (dof,) velocity of the goal itself [rad/s].

        Returns:
            The narrowed bounds; the acceleration limits win where the joint is already too fast.
        """
        assert self.acceleration is not None
        along = goal_velocity * self._dt
        gap = ahead - along
        reach = along + np.sign(gap) * braking_speed(np.abs(gap), self.acceleration, self._dt) * self._dt
        high_new = np.where(gap >= 0.0, np.clip(reach, low, high), high)
        low_new = np.where(gap < 0.0, np.clip(reach, low, high), low)
        return low_new, high_new

    def braking(self, low: Array, high: Array) -> Array:
        """The displacement nearest to standing still (dof,) [rad]."""
        return np.clip(0.0, low, high)

    def limiting(self, step: Array, q: Array, v: Array) -> list[str]:
        """Which limits a displacement has run into."""
        found = []
        slack = AT_BOUND * self._step
        at_upper, at_lower = step >= self._upper - q - slack, step <= self._lower - q + slack
        fast = np.abs(step) >= self._step - slack
        for joint, name in enumerate(self._names):
            if at_upper[joint]:
                found.append(f"{name} upper limit")
            elif at_lower[joint]:
                found.append(f"{name} lower limit")
            elif fast[joint]:
                found.append(f"{name} velocity")
            elif self.acceleration is not None:
                change = self.acceleration[joint] * self._dt
                if abs(step[joint] / self._dt - v[joint]) >= change * (1.0 - AT_BOUND):
                    found.append(f"{name} acceleration")
        return found
