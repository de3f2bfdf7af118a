"""The limits of the joints as the kernels have them (`jacokin.kernels.tracking.limits`), and the way to rest.

No acceleration limit is one that takes a joint from full speed to full speed backwards in a tick: then nothing binds
but position and velocity.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from jacokin.arrays import Array
from jacokin.kernels.tolerances import LIMIT_SNAP
from jacokin.kernels.tracking import limits
from jacokin.kernels.tracking.limits import AT_ACCELERATION, AT_LOWER, AT_SPEED, AT_UPPER
from jacokin.model.robot import Robot, unit_of

WORDS = {AT_UPPER: "upper limit", AT_LOWER: "lower limit", AT_SPEED: "velocity"}


class JointLimits:
    """Bounds on the displacement of the joints in one tick.

    Attributes:
        lower: (dof,) lower limits [rad].
        upper: (dof,) upper limits [rad].
        step: (dof,) largest displacement in a tick by the velocity limits [rad].
        change: (dof,) by how much that displacement may change from tick to tick [rad].
        stops_at_once: whether every joint may stop within a tick.
        stopping_time: in which all joints stop from full speed [s]; 0 where they may within a tick.
        table: (dof, 8) as the kernels take them.
    """

    def __init__(
        self, robot: Robot, velocity: Array, acceleration: Array, dt: float, catching: Array | None = None
    ) -> None:
        """Keep the limits.

        Args:
            robot: the arm.
            velocity: (dof,) [rad/s].
            acceleration: (dof,) [rad/s^2] or inf.
            dt: control step [s].
            catching: (dof,) accelerations in catching up with a target [rad/s^2]; None for all that joints may.
        """
        self._robot, self._dt = robot, dt
        self.lower, self.upper = robot.lower, robot.upper
        self.step = velocity * dt
        self._acceleration = np.minimum(acceleration, 2.0 * velocity / dt)
        self.change = self._acceleration * dt * dt
        gentle = self._acceleration if catching is None else np.minimum(catching, self._acceleration)
        ticks = self.step / self.change + 1.0
        far = self.step * ticks  # [rad] from which a limit does not bind: more than the way to rest
        limited = acceleration <= self._acceleration
        self.table = np.column_stack(
            [self.lower, self.upper, self.step, self.change, gentle * dt * dt, self._acceleration, far, limited]
        )
        self.stops_at_once = bool((self.change >= self.step).all())
        self.stopping_time = 0.0 if self.stops_at_once else float((velocity / acceleration).max())

    def stoppable(self, q: Array) -> tuple[Array, Array]:
        """Least and largest displacement (dof,) [rad] from `q` (dof,) [rad] after which joints can stop in time."""
        still = self.table.copy()
        still[:, limits.CHANGE] = np.inf  # whatever they do now
        low, high = np.empty_like(q), np.empty_like(q)
        limits.fill_bounds(still, q, np.zeros_like(q), self._dt, low, high)
        return low, high

    def stride(self, total: Array) -> Array:
        """The part (dof,) [rad] for the coming tick of a displacement (dof,) [rad] on which the arm is to stop."""
        stride, still = np.empty_like(total), np.zeros_like(total)
        limits.take_stride(self.table, total, still, still, stride)
        return stride

    def move(self, q: Array, displacement: Array) -> Array:
        """The configuration after a displacement; adding may round past a limit."""
        return np.minimum(np.maximum(q + displacement, np.minimum(q, self.lower)), np.maximum(q, self.upper))

    def brake(self, v: Array) -> Array:
        """Displacement (dof,) [rad] of a tick of braking after velocities `v` (dof,) [rad/s]."""
        return np.asarray(np.copysign(np.maximum(np.abs(v) * self._dt - self.change, 0.0), v))

    def names(self, reached: Sequence[int]) -> tuple[str, ...]:
        """Which limits joints run into, by the kernels' numbers of them."""
        return _limit_names(self._robot.joint_names, tuple(reached))

    def outside(self, q: Array) -> str:
        """Which joints are past their limits at `q` (dof,) [rad], to end a sentence; "" for none, and for rounding."""
        past = np.maximum(q - self.upper, self.lower - q).tolist()
        return "".join(
            f"; {name} is {past[j]:.3g} {unit_of(self._robot, j)} past its limit and moves only inwards"
            for j, name in enumerate(self._robot.joint_names)
            if past[j] > LIMIT_SNAP
        )


@lru_cache(maxsize=1024)  # ticks in a row run into the same
def _limit_names(joints: tuple[str, ...], reached: tuple[int, ...]) -> tuple[str, ...]:
    """Which limits joints of these names run into."""
    each = list(zip(joints, reached, strict=True))
    found = [f"{name} {WORDS[number % AT_ACCELERATION]}" for name, number in each if number % AT_ACCELERATION]
    return (*found, *(f"{name} acceleration" for name, number in each if number >= AT_ACCELERATION))
