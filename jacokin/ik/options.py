"""The options of a solver, and every tolerance of the inverse kinematics with its reason."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from jacokin.errors import InvalidInputError
from jacokin.kernels.tolerances import LIMIT_SNAP
from jacokin.model import checks

if TYPE_CHECKING:
    from jacokin.model.scene import Scene

COLLISION = ("prefer", "ignore", "report", "reject")
DEFAULT_QP_SOLVER = "daqp"  # always installed; checking others means importing qpsolvers

# Kinova publishes no repeatability of the Jaco, so no tolerance is derived from one.

#: [m] A success differs from its target by rounding and by nothing an arm could show: the closed form stays a thousand
#: times below this, and a descent that converges passes it within one quadratic step.
POSITION_TOLERANCE = 1e-6
#: [rad] The same for the orientation; it moves a fingertip 0.2 m away by a fifth of the position tolerance.
ORIENTATION_TOLERANCE = 1e-6
#: [m] The tracker is on its target this near: well below what is visible, well above what one tick of rounding adds.
TRACKING_POSITION_TOLERANCE = 1e-4
#: [rad] The same for the orientation, by the weight of a radian (`targets.RADIAN_IN_METRES`).
TRACKING_ORIENTATION_TOLERANCE = 1e-3
#: Random starts of the QP. About one descent in four ends in a local minimum, so a hundred do not fail together.
MAX_RESTARTS = 100


def default_collision(scene: object, clearance: float) -> str:
    """What is done about contact where nothing is said: an obstacle or a distance that somebody names is to be kept.

    Raises:
        InvalidInputError: a clearance that is not a number [m], or negative.
    """
    return "prefer" if scene is None and checks.non_negative("clearance", clearance, "m") == 0.0 else "reject"


@dataclass(frozen=True, slots=True)
class SolverOptions:
    """The options of a solver, checked; see `IKSolver`.

    Raises:
        UnknownNameError: unknown method or collision mode.
        InvalidInputError: a tolerance that is not positive, a negative number of restarts, a scene that is not one, or
            a scene or clearance with collision="ignore".
    """

    method: str = "auto"
    qp_solver: str = DEFAULT_QP_SOLVER
    collision: str = "prefer"
    position_tolerance: float = POSITION_TOLERANCE
    orientation_tolerance: float = ORIENTATION_TOLERANCE
    limit_snap: float = LIMIT_SNAP
    max_restarts: int = MAX_RESTARTS
    scene: Scene | None = None
    clearance: float = 0.0

    def __post_init__(self) -> None:
        """Check every option once."""
        checks.choice("method", self.method, ("auto", "closed_form", "qp"))
        checks.choice("collision", self.collision, COLLISION)
        checks.positive("position_tolerance", self.position_tolerance, "m")
        checks.positive("orientation_tolerance", self.orientation_tolerance, "rad")
        checks.non_negative("limit_snap", self.limit_snap, "rad")
        checks.whole_number("max_restarts", self.max_restarts)
        checks.non_negative("clearance", self.clearance, "m")
        if self.scene is not None:
            from jacokin.model.scene import checked_scene  # loads MuJoCo

            checked_scene("scene", self.scene)
        if self.collision == "ignore" and (self.scene is not None or self.clearance):
            name = "scene" if self.scene is not None else "clearance"
            raise InvalidInputError(f"{name} has no effect with collision='ignore'; use 'prefer', 'report' or 'reject'")
