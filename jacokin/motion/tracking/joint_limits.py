"""How far each joint may go in one tick: position, velocity and acceleration limits.

Position and velocity limits are bounds on the displacement of a joint, so together they are a box, and from a
configuration within the limits the box contains zero: the QP inside it always has an answer.

Acceleration limits are kept outside the QP. The QP moves a reference that obeys the box, and each joint of the arm
follows its reference as fast as its acceleration allows, never faster than it can brake again: within the way to the
reference, relative to the reference's own speed, and within the way to its limit. The joints do not couple, so nothing
oscillates. From wherever the arm is and however fast, it can come to rest so (`Braking`), within all limits: a tracker
that keeps shapes apart takes no step from which that way is not clear.
"""

from __future__ import annotations

from typing import NamedTuple

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
        distance: (..., dof) free travel [rad], >= 0; inf for no end.
        deceleration: (dof,) [rad/s^2].
        dt: control step [s].

    Returns:
        (..., dof) speeds [rad/s].
    """
    x = distance / (deceleration * dt * dt)
    n = np.floor(0.5 * (np.sqrt(1.0 + 8.0 * np.minimum(x, 1e15)) - 1.0))
    speed: Array = (x + 0.5 * n * (n + 1.0)) / (n + 1.0) * deceleration * dt
    return speed


class Braking(NamedTuple):
    """Every joint brakes as hard as its acceleration limit allows, until it rests.

    A joint that was at u a dt moves by (u - 1) a dt^2 in the first tick, by (u - 2) a dt^2 in the next, and so on.
    """

    q: Array
    """(dof,) where it begins [rad]."""
    speed: Array
    """(dof,) u, the speed that the joint had, in what a tick of braking takes away."""
    unit: Array
    """(dof,) a dt^2 with the sign of the velocity [rad]."""

    @property
    def ticks(self) -> int:
        """How many until all joints rest."""
        return int(np.ceil(self.speed.max(initial=0.0)))

    @property
    def way(self) -> Array:
        """(dof,) displacement until rest [rad]."""
        return self.at(self.ticks) - self.q

    def at(self, tick: int) -> Array:
        """(dof,) where the joints are after some ticks [rad]."""
        n = np.minimum(np.floor(self.speed), tick)
        return np.asarray(self.q + self.unit * (self.speed * n - 0.5 * n * (n + 1.0)))


class Follower:
    """Follows a reference within acceleration limits."""

    def __init__(self, robot: Robot, box: JointBox, acceleration: Array, dt: float) -> None:
        """Keep the limits: `acceleration` (dof,) [rad/s^2], `dt` the control step [s]."""
        self._names = robot.joint_names
        self._box = box
        self._acceleration = acceleration
        self._dt = dt

    def braking(self, q: Array, v: Array) -> Braking:
        """The way to rest from `q` (dof,) [rad], which `v` (dof,) [rad/s] led to."""
        unit = self._acceleration * self._dt
        return Braking(q, np.abs(v) / unit, np.copysign(unit * self._dt, v))

    def _ways(self, *distances: Array) -> Array:
        """(k, dof) largest ways [rad] in the coming tick after which the joints can still stop within distances."""
        return braking_speed(np.array(distances), self._acceleration, self._dt) * self._dt

    def _stoppable(self, q: Array, below: Array, above: Array) -> tuple[Array, Array]:
        """Least and largest displacement (dof,) [rad], by ways towards the limits after which the joints can stop."""
        low, high = self._box.bounds(q)
        return np.maximum(low, -below), np.minimum(high, above)

    def bounds(self, q: Array, v: Array) -> tuple[Array, Array]:
        """Least and largest displacement (dof,) [rad] by all limits, at `q` [rad] after velocities `v` [rad/s]."""
        least, most = self.window(v)
        below, above = self._ways(q - self._box.lower, self._box.upper - q)
        low, high = (np.minimum(np.maximum(bound, least), most) for bound in self._stoppable(q, below, above))
        return low, high

    def window(self, v: Array) -> tuple[Array, Array]:
        """Least and largest displacement (dof,) [rad] in a tick after velocities `v` (dof,) [rad/s]."""
        change = self._acceleration * self._dt
        return (v - change) * self._dt, (v + change) * self._dt

    def brake(self, v: Array) -> Array:
        """Displacement (dof,) [rad] of a tick of braking."""
        less = np.maximum(np.abs(v) - self._acceleration * self._dt, 0.0)
        return np.asarray(np.copysign(less, v) * self._dt)

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
        along = reference_velocity * self._dt
        gap = reference - q - along
        way, below, above = self._ways(np.abs(gap), q - self._box.lower, self._box.upper - q)
        low, high = self._stoppable(q, below, above)
        wanted = np.minimum(np.maximum(along + np.copysign(way, gap), low), high)
        # Braking as hard as allowed always satisfies the bounds above, but for rounding.
        least, most = self.window(v)
        return np.asarray(np.minimum(np.maximum(wanted, least), most))

    def limiting(self, v: Array, v_before: Array) -> list[str]:
        """Joints whose speed changed as fast as allowed."""
        most = self._acceleration * self._dt * (1.0 - AT_BOUND)
        return [
            f"{name} acceleration"
            for name, change, limit in zip(self._names, np.abs(v - v_before), most, strict=True)
            if change >= limit
        ]
