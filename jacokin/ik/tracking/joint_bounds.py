"""How far each joint may go in one tick: velocity and position limits as one box.

Both are bounds on the displacement of a joint, so their intersection is a box, and from a legal configuration the box
contains zero: the QP inside it always has an answer.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

AT_BOUND = 1e-6  # of the velocity limit's step: a displacement this near to a bound lies on it


class JointBox:
    """Bounds on the displacement of the joints in one tick.

    Attributes:
        lower: (dof,) lower limits [rad].
        upper: (dof,) upper limits [rad].
        step: (dof,) largest displacement in a tick by the velocity limits [rad].
    """

    def __init__(self, names: tuple[str, ...], lower: Array, upper: Array, velocity: Array, dt: float) -> None:
        """Keep the limits.

        Args:
            names: joint names.
            lower: (dof,) [rad].
            upper: (dof,) [rad].
            velocity: (dof,) velocity limits [rad/s].
            dt: control step [s].
        """
        self._names = names
        self.lower, self.upper = lower, upper
        self.step = velocity * dt

    def bounds(self, q: Array) -> tuple[Array, Array]:
        """Least and largest displacement (dof,) [rad] from a legal `q` [rad]."""
        return np.maximum(-self.step, self.lower - q), np.minimum(self.step, self.upper - q)

    def moved(self, q: Array, displacement: Array) -> Array:
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
