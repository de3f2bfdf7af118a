"""What solving gives back: statuses that say what to try, and frozen results with the measured errors."""

from __future__ import annotations

from dataclasses import dataclass, fields
from enum import Enum
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array, Sealed
from jacokin.errors import SolveError
from jacokin.showing import Shown, show

FEW = 8  # numbers of an array, or items of a tuple, that `repr` shows; of more it says how many


class Frozen(Sealed):
    """A result whose arrays and mappings stay read-only when it is copied or pickled, and whose `repr` is short."""

    __slots__ = ()

    def __init_subclass__(cls) -> None:
        """Keep the short `repr`: dataclasses make another one, with every number, for a class that has none itself."""
        if "__repr__" not in cls.__dict__:
            cls.__repr__ = Frozen.__repr__  # type: ignore[method-assign]  # what dataclasses look for

    def __repr__(self) -> str:
        """Fields that have a value, long arrays and tuples by their size."""
        values = {each.name: getattr(self, each.name) for each in fields(self)}  # type: ignore[arg-type]  # every subclass is a dataclass
        return f"{type(self).__name__}({', '.join(f'{name}={in_short(value)}' for name, value in values.items())})"


def in_short(value: object) -> str:
    """The `repr` of a value; of a long array its shape, of a long tuple how many items it has."""
    if isinstance(value, np.ndarray):
        if value.size <= FEW:
            return " ".join(repr(value).split())
        return f"<{' x '.join(map(str, value.shape))} numbers>"
    if isinstance(value, tuple) and type(value) is tuple and len(value) > FEW:
        return f"<{len(value)} items>"
    return repr(value)


class Status(Enum):
    """Outcome of a solve; the value is a sentence that says what to try."""

    OK = "the pose is reached within the tolerances and every joint is inside its limits"
    UNREACHABLE = (
        "no joint angles reach this pose, with or without limits: move the target closer to the arm, "
        "or free its orientation by giving a position only"
    )
    OUTSIDE_LIMITS = (
        "the pose can only be reached by breaking a joint limit: turn or shift the target, "
        "or load the robot with wider limits if yours allows it"
    )
    IN_COLLISION = (
        "the pose is reached only with the arm touching itself or an obstacle: turn or shift the target, "
        "or use collision='report' to get the configuration anyway"
    )
    NO_CONVERGENCE = (
        "no start of the local search reached the pose, which may be reachable all the same: "
        "allow more restarts, give a seed near the answer, or loosen the tolerances"
    )
    SOLVER_ERROR = "the QP solver failed: try another qp_solver"
    INVALID_TARGET = "this row of a file is not a target and was left out: see its message"


@dataclass(frozen=True, slots=True, eq=False)
class IKResult(Frozen):
    """One answer, measured with Pinocchio after the solve. Arrays are read-only."""

    q: Array
    """(dof,) joint angles [rad]; on anything but OK the closest configuration within the limits that was found."""
    status: Status
    """What happened; `status.value` says what to try."""
    position_error: float
    """Distance between target and tool position [m]."""
    orientation_error: float
    """Angle between target and tool orientation [rad]; 0 for position-only targets."""
    method: str
    """"closed_form", or "qp" for whatever descends: what produced `q`."""
    qp_solver: str | None
    """QP solver that ran, with a fallback named; None when none ran."""
    iterations: int
    """Iterations of the descents over all starts; 0 for the closed form."""
    restarts: int
    """Starts after the first one."""
    message: str
    """What happened in this solve, with numbers."""
    touching: tuple[tuple[str, str], ...] = ()
    """Pairs of shapes that touch at `q`; filled when the solver looks for contact."""
    parameter: float | None = None
    """Value of the free parameter at `q` [rad]: the angle about a free axis, or joint 3 of a seven-joint arm."""
    free_axes: Array | None = None
    """(k, 3) axes in the tool frame about which the target lets the tool turn: one of a `FreeAxis`, three of a
    position; None for a pose."""

    @property
    def success(self) -> bool:
        """True when the status is OK."""
        return self.status is Status.OK

    def raise_for_status(self) -> Self:
        """Return self when solved.

        Raises:
            SolveError: not solved; carries this result.
        """
        if self.status is not Status.OK:
            raise SolveError(f"{self.status.name}: {self.message}. {self.status.value}", self)
        return self

    def show(self, of: object, **options: Any) -> Shown:  # Any: checked there
        """Look at the arm there in the browser: `of` is its robot, or the solver. See `jacokin.viewer.show`."""
        return show(self, of, options)

    def __str__(self) -> str:
        """The result on two lines."""
        angles = ", ".join(f"{angle:.6f}" for angle in self.q)
        return (
            f"{self.status.name} by {self.method}: q = [{angles}] rad\n"
            f"position error {self.position_error:.3g} m, orientation error {self.orientation_error:.3g} rad. "
            f"{self.message}"
        )


@dataclass(frozen=True, slots=True, eq=False)
class BatchResult(Frozen):
    """Answers to many targets as arrays; row i answers target i. Arrays are read-only."""

    q: Array
    """(n, dof) joint angles [rad]."""
    status: tuple[Status, ...]
    """(n,) outcomes."""
    success: NDArray[np.bool_]
    """(n,) True where the status is OK."""
    position_error: Array
    """(n,) [m]."""
    orientation_error: Array
    """(n,) [rad]."""
    method: tuple[str, ...]
    """(n,) "closed_form" or "qp"."""
    message: tuple[str, ...]
    """(n,) what happened, as in `IKResult`; of a pose that is reached perhaps without the number of its branch."""
    parameter: Array | None = None
    """(n,) value of the free parameter [rad]; NaN where there is none."""
    touching: NDArray[np.bool_] | None = None
    """(n,) True where shapes touch at `q`; False, too, where the solver does not look for contact."""

    def __len__(self) -> int:
        """Number of targets."""
        return len(self.q)
