"""How far each joint may go in one tick: position, velocity and acceleration limits.

A joint is only ever as fast as it can still stop before its limit, braking as hard as its acceleration limit allows. So
there is always a displacement that keeps all three, whatever was asked for: to go on braking. The joints do not couple.
No acceleration limit is one that takes a joint from full speed to full speed backwards in a tick: then nothing here
binds but position and velocity.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from jacokin.arrays import Array
from jacokin.model.robot import Robot

AT_BOUND = 1e-6  # of the velocity limit's step: a displacement this near to a bound lies on it
EASY = 0.8  # part of the acceleration limit with which an approach brakes; the rest is for what curvature adds
ROUNDING = 1e-9  # [rad] past a limit, of a joint that has come back to it
TINY = 1e-200  # instead of dividing by zero


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
    change = deceleration * dt
    x = distance / (change * dt)
    n = np.floor(0.5 * np.sqrt(1.0 + 8.0 * np.minimum(x, 1e15)) - 0.5)
    speed: Array = (x / (n + 1.0) + 0.5 * n) * change
    return speed


def stopping_part(distance: float) -> float:
    """The part of a distance, from 0 to 1, in the coming tick, after which a joint can still stop at its end easily.

    Args:
        distance: in what a tick of braking takes from a displacement, > 0. Longer ones give smaller parts.
    """
    if distance <= 1.0:
        return 1.0
    easy = 1.0 + (distance - 1.0) / EASY  # the last tick may brake as hard as it can
    ticks = math.floor(0.5 * math.sqrt(1.0 + 8.0 * min(easy, 1e15)) - 0.5)
    return 1.0 / (ticks + 1.0) + 0.5 * ticks / easy


def largest_share(start: Array, change: Array, low: Array, high: Array) -> float:
    """The largest share from 0 to 1 of a change that keeps start + share * change within bounds, all (dof,)."""
    ends = np.where(change > 0.0, high, low) - start
    with np.errstate(divide="ignore", invalid="ignore"):
        shares = np.where(np.abs(change) > TINY, ends / change, np.inf)
    return float(np.clip(shares.min(), 0.0, 1.0))


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


class JointLimits:
    """Bounds on the displacement of the joints in one tick.

    Attributes:
        lower: (dof,) lower limits [rad].
        upper: (dof,) upper limits [rad].
        step: (dof,) largest displacement in a tick by the velocity limits [rad].
        change: (dof,) by how much that displacement may change from tick to tick [rad].
        stops_at_once: whether every joint may stop within a tick.
    """

    def __init__(self, robot: Robot, velocity: Array, acceleration: Array, dt: float) -> None:
        """Keep the limits: `velocity` (dof,) [rad/s], `acceleration` (dof,) [rad/s^2] or inf, `dt` the step [s]."""
        self._names, self._dt = robot.joint_names, dt
        self.lower, self.upper = robot.lower, robot.upper
        self.step = velocity * dt
        self._acceleration = np.minimum(acceleration, 2.0 * velocity / dt)
        self.change = self._acceleration * dt * dt
        self._limited = acceleration <= self._acceleration
        ticks = self.step / self.change + 1.0
        self._far = self.step * ticks  # (dof,) [rad] from which a limit does not bind: more than the way to rest
        self.stops_at_once = bool((self.change >= self.step).all())

    def room(self, q: Array) -> tuple[Array, Array]:
        """Least and largest displacement (dof,) [rad] to the limits; a joint that is past one may only come back."""
        return np.minimum(self.lower - q, 0.0), np.maximum(self.upper - q, 0.0)

    def stoppable(self, q: Array) -> tuple[Array, Array]:
        """Least and largest displacement (dof,) [rad] from `q` (dof,) [rad] after which joints can stop in time."""
        low, high = self.room(q)
        if (high >= self._far).all() and (low <= -self._far).all():
            return -self.step, self.step
        below, above = braking_speed(np.array([-low, high]), self._acceleration, self._dt) * self._dt
        return np.maximum(-np.minimum(below, self.step), low), np.minimum(np.minimum(above, self.step), high)

    def bounds(self, q: Array, v: Array) -> tuple[Array, Array]:
        """Least and largest displacement (dof,) [rad] by all limits, at `q` [rad] after velocities `v` [rad/s]."""
        low, high = self.stoppable(q)
        # Braking as hard as allowed always satisfies the bounds, but for rounding.
        least, most = v * self._dt - self.change, v * self._dt + self.change
        return np.minimum(np.maximum(low, least), most), np.minimum(np.maximum(high, least), most)

    def stride(self, total: Array, along: Array) -> Array:
        """The part (dof,) [rad] for the coming tick of a displacement `total` (dof,) [rad] on which the arm is to stop.

        All joints take the same part, so that the arm goes straight. It can stop at the end of `total`, or go on as
        `along` does.

        Args:
            total: what is missing to the target at the end of the tick.
            along: (dof,) by how much the target itself moves in a tick [rad].
        """
        along = along * min(1.0, float((self.step / np.maximum(np.abs(along), TINY)).min()))
        gap = total - along
        size = np.maximum(np.abs(gap), TINY)
        part = min(
            float(((self.step - np.copysign(along, along * gap)) / size).min()),
            stopping_part(float((size / self.change).max())),
        )
        return np.asarray(along + max(part, 0.0) * gap)

    def move(self, q: Array, displacement: Array) -> Array:
        """The configuration after a displacement; adding may round past a limit."""
        return np.minimum(np.maximum(q + displacement, np.minimum(q, self.lower)), np.maximum(q, self.upper))

    def braking(self, q: Array, v: Array) -> Braking:
        """The way to rest from `q` (dof,) [rad], which `v` (dof,) [rad/s] led to."""
        return Braking(q, np.abs(v) * self._dt / self.change, np.copysign(self.change, v))

    def brake(self, v: Array) -> Array:
        """Displacement (dof,) [rad] of a tick of braking after velocities `v` (dof,) [rad/s]."""
        return np.asarray(np.copysign(np.maximum(np.abs(v) * self._dt - self.change, 0.0), v))

    def limiting(self, q: Array, v: Array, v_before: Array) -> list[str]:
        """Which limits `v` (dof,) [rad/s] from `q` (dof,) [rad] runs into, after `v_before` (dof,) [rad/s]."""
        displacement, slack = v * self._dt, AT_BOUND * self.step
        at_upper = displacement >= self.upper - q - slack
        at_lower = displacement <= self.lower - q + slack
        fast = np.abs(displacement) >= self.step - slack
        hard = self._limited & (np.abs(v - v_before) * self._dt >= self.change * (1.0 - AT_BOUND))
        found = []
        for joint, name in enumerate(self._names):
            if at_upper[joint]:
                found.append(f"{name} upper limit")
            elif at_lower[joint]:
                found.append(f"{name} lower limit")
            elif fast[joint]:
                found.append(f"{name} velocity")
        return found + [f"{name} acceleration" for name, is_hard in zip(self._names, hard, strict=True) if is_hard]

    def outside(self, q: Array) -> str:
        """Which joints are past their limits at `q` (dof,) [rad], to end a sentence; "" for none, and for rounding."""
        past = np.maximum(q - self.upper, self.lower - q)
        return "".join(
            f"; {name} is {far:.3g} rad past its limit and moves only inwards"
            for name, far in zip(self._names, past.tolist(), strict=True)
            if far > ROUNDING
        )
