"""The options of a solver, and every tolerance of the inverse kinematics with its reason."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from jacokin.errors import InvalidInputError, UnknownNameError

METHODS = ("auto", "closed_form", "qp")
COLLISION = ("ignore", "report", "reject")
DEFAULT_QP_SOLVER = "daqp"  # always installed; checking others means importing qpsolvers

# Kinova publishes no repeatability of the Jaco, so no tolerance is derived from one.

#: [m] A success differs from its target by rounding and by nothing an arm could show: the closed form stays a thousand
#: times below this, and a descent that converges passes it within one quadratic step.
POSITION_TOLERANCE = 1e-6
#: [rad] The same for the orientation; it moves a fingertip 0.2 m away by a fifth of the position tolerance.
ORIENTATION_TOLERANCE = 1e-6
#: [m] The tracker is on its target this near: well below what is visible, well above what one tick of rounding adds.
TRACKING_POSITION_TOLERANCE = 1e-4
#: [rad] The same for the orientation, by the weight of a radian (`pose_error`).
TRACKING_ORIENTATION_TOLERANCE = 1e-3
#: [rad] A branch on a limit comes out of rounding up to this far past it, and is put on the limit.
LIMIT_SNAP = 1e-9
#: Random starts of the QP. About one descent in four ends in a local minimum, so a hundred do not fail together.
MAX_RESTARTS = 100


@dataclass(frozen=True, slots=True)
class Options:
    """The options of a solver, checked; see `IKSolver`.

    Raises:
        UnknownNameError: unknown method or collision mode.
        InvalidInputError: a tolerance that is not positive, a negative number of restarts.
    """

    method: str = "auto"
    qp_solver: str = DEFAULT_QP_SOLVER
    collision: str = "ignore"
    position_tolerance: float = POSITION_TOLERANCE
    orientation_tolerance: float = ORIENTATION_TOLERANCE
    limit_snap: float = LIMIT_SNAP
    max_restarts: int = MAX_RESTARTS

    def __post_init__(self) -> None:
        """Check every option once."""
        for kind, given, valid in (("method", self.method, METHODS), ("collision", self.collision, COLLISION)):
            if given not in valid:
                raise UnknownNameError(kind, given, valid)
        for name, value in (
            ("position_tolerance", self.position_tolerance),
            ("orientation_tolerance", self.orientation_tolerance),
        ):
            if not (_is_number(value) and math.isfinite(value) and value > 0.0):
                raise InvalidInputError(f"{name} must be positive and finite, got {value!r}")
        if not (_is_number(self.limit_snap) and math.isfinite(self.limit_snap) and self.limit_snap >= 0.0):
            raise InvalidInputError(f"limit_snap must be finite and >= 0 [rad], got {self.limit_snap!r}")
        checked_restarts(self.max_restarts)


def _is_number(value: object) -> bool:
    return isinstance(value, int | float | np.integer | np.floating) and not isinstance(value, bool)


def checked_restarts(value: int) -> int:
    """A number of random starts.

    Raises:
        InvalidInputError: not a whole number >= 0.
    """
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < 0:
        raise InvalidInputError(f"max_restarts must be a whole number >= 0, got {value!r}")
    return int(value)
