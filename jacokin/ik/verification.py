"""The last word on an answer: measured by Pinocchio, inside the limits to the last bit, free of contact if asked."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from jacokin.errors import InvalidInputError, UnknownNameError
from jacokin.ik import pose_error
from jacokin.ik.results import IKResult, Status
from jacokin.ik.targets import Target
from jacokin.model import checks
from jacokin.model.mujoco_twin.contact import SelfContact
from jacokin.model.robot import Robot

if TYPE_CHECKING:
    from jacokin.ik.qp.multistart import Attempt

Array = NDArray[np.float64]

METHODS = ("auto", "closed_form", "qp")
COLLISION = ("ignore", "report", "reject")

POSITION_TOLERANCE = 1e-6  # [m] a hundredth of what the arm repeats
ORIENTATION_TOLERANCE = 1e-6  # [rad]
LIMIT_SNAP = 1e-9  # [rad] a branch on a limit comes out of rounding up to this far past it
NAMED_PAIRS = 3  # in a message; the result's `touching` has all
MAX_RESTARTS = 100  # random starts of the QP; about one in four fails, so a hundred do not fail together


@dataclass(frozen=True, slots=True)
class Settings:
    """The options of a solver, checked.

    Raises:
        UnknownNameError: unknown method or collision mode.
        InvalidInputError: a tolerance that is not positive, a negative number of restarts.
    """

    method: str
    qp_solver: str
    collision: str
    position_tolerance: float
    orientation_tolerance: float
    limit_snap: float
    max_restarts: int

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


class Judge:
    """Measures configurations against targets and writes results.

    Attributes:
        robot: the arm.
        frame: the frame that is brought to the target.
        tool: constant pose after the frame, or None.
        settings: the solver's options.
    """

    def __init__(self, robot: Robot, frame: str, tool: pin.SE3 | None, settings: Settings) -> None:
        """Prepare measuring; the shapes for self-contact are loaded when asked for.

        Raises:
            ModelError: self-contact is asked for and the description has no shapes that MuJoCo can load.
        """
        self.robot = robot
        self.frame = frame
        self._frame_id = robot.frame_id(frame)
        self.tool = tool
        self.settings = settings
        self._lower = robot.lower.tolist()  # as plain floats: six comparisons are not worth an array
        self._upper = robot.upper.tolist()
        self._contact = None if settings.collision == "ignore" else SelfContact(robot)

    @property
    def rejects_contact(self) -> bool:
        """Whether a configuration in self-contact is no answer."""
        return self.settings.collision == "reject"

    @property
    def looks_for_contact(self) -> bool:
        """Whether self-contact is looked for at all."""
        return self._contact is not None

    def touching(self, q: Array) -> list[tuple[str, str]]:
        """Pairs of shapes that touch; none when the solver does not look."""
        return [] if self._contact is None else self._contact.touching(q)

    def measure(self, q: Array, target: Target) -> tuple[float, float]:
        """Position error [m] and orientation error [rad] at `q`, by Pinocchio."""
        pose = self.robot.placement(q, self._frame_id)
        return pose_error.errors(pose if self.tool is None else pose * self.tool, target)

    def reached(self, q: Array, errors: tuple[float, float]) -> bool:
        """The promise behind every success: inside the limits to the last bit, and within the tolerances."""
        return (
            errors[0] <= self.settings.position_tolerance
            and errors[1] <= self.settings.orientation_tolerance
            and all(low <= angle <= high for low, angle, high in zip(self._lower, q.tolist(), self._upper, strict=True))
        )

    def result(
        self,
        q: Array,
        status: Status,
        errors: tuple[float, float],
        message: str,
        *,
        attempt: Attempt | None = None,
        touching: Sequence[tuple[str, str]] = (),
    ) -> IKResult:
        """A result by the closed form, or by the QP when there is an attempt."""
        return IKResult(
            q=checks.read_only(q),
            status=status,
            position_error=errors[0],
            orientation_error=errors[1],
            method="closed_form" if attempt is None else "qp",
            qp_solver=None if attempt is None else attempt.qp_solver,
            iterations=0 if attempt is None else attempt.iterations,
            restarts=0 if attempt is None else attempt.starts - 1,
            message=message,
            touching=tuple(touching),
        )


def joined(*sentences: str) -> str:
    """The sentences that are not empty, in one."""
    return "; ".join([sentence for sentence in sentences if sentence])


def pair_names(touching: Sequence[tuple[str, str]]) -> str:
    """Pairs of shapes for a message; of many, the first ones and how many more."""
    named = ", ".join(f"{a} and {b}" for a, b in touching[:NAMED_PAIRS])
    more = len(touching) - NAMED_PAIRS
    return f"{named} and {more} more pairs" if more > 0 else named
