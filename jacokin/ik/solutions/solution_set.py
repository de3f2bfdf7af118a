"""`SolutionSet`: everything that reaches one target, whatever the arm: points, or curves as intervals of a parameter.

`Points` and `CurveSet` are its two kinds, told apart by `dimension`. Arrays have one row for each point, or for each
`Interval` of a curve, from start to stop of the parameter: of that, the member nearest to the seed.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal

from numpy.typing import ArrayLike, NDArray

from jacokin.arrays import Array
from jacokin.ik.preferences import Prefer
from jacokin.kernels.tolerances import LIMIT_SNAP
from jacokin.model import checks
from jacokin.model.angles import TURN
from jacokin.showing import Shown, show

if TYPE_CHECKING:
    import numpy as np


@dataclass(frozen=True, slots=True)
class IntervalEnd:
    """Why an interval ends."""

    kind: str
    """"limit"; "fold", where two branches meet and exist no further; "range", of the target; "circle", where nothing
    ends; "lost", where the curve could not be followed any further."""
    joint: str | None = None
    """The joint on its limit."""
    limit: float | None = None
    """That limit [rad]."""

    def __str__(self) -> str:
        """In words."""
        return self.kind if self.joint is None else f"{self.joint} at its limit {self.limit:.6g} rad"


class Interval(ABC):
    """Configurations on one branch for start <= p <= stop; each reaches the target and is within the limits.

    Attributes:
        branch: number of the branch; two intervals on one branch are parts of one curve.
        start: least value of the parameter [rad]; in [-pi, pi) when the parameter may go full circle.
        stop: largest value of the parameter [rad]; at most start + 2 pi.
        ends: why it ends at start and at stop.
    """

    __slots__ = ("branch", "ends", "start", "stop")

    def __init__(self, branch: int, start: float, stop: float, ends: tuple[IntervalEnd, IntervalEnd]) -> None:
        """Take what an interval says of itself."""
        self.branch, self.start, self.stop, self.ends = branch, start, stop, ends

    def __repr__(self) -> str:
        """Ends and their reasons."""
        return f"Interval(branch {self.branch}, {self.start:.6f} ({self.ends[0]}) to {self.stop:.6f} ({self.ends[1]}))"

    @property
    def length(self) -> float:
        """Stop - start [rad]."""
        return self.stop - self.start

    def contains(self, parameter: float) -> bool:
        """Whether a value of the parameter, or one whole turns away, is in the interval."""
        return self._moved_inside(checks.number("parameter", parameter, "rad")) is not None

    @abstractmethod
    def at(self, parameter: float, seed: ArrayLike | None = None) -> Array:
        """The member (dof,) [rad] where the parameter has a value.

        Where curves meet just as a joint comes to its limit, rounding may leave none there: the one beside it, then.

        Args:
            parameter: [rad] from start to stop, or whole turns away from there.
            seed: (dof,) unlimited joints take the copy nearest to it [rad]; None for the seed of the set.

        Raises:
            InvalidInputError: the parameter is outside the interval.
        """

    @abstractmethod
    def nearest(self, seed: ArrayLike | None = None) -> Array:
        """The member (dof,) [rad] nearest to a seed; None for the seed of the set."""

    @abstractmethod
    def best(self, prefer: Prefer = "nearest") -> Array:
        """The preferred member (dof,) [rad]; see `SolutionSet.best`."""

    @property
    @abstractmethod
    def margin(self) -> float:
        """The largest limit margin of a member [rad]; inf for an arm without limits."""

    @abstractmethod
    def sample(self, n: int) -> tuple[Array, Array]:
        """Values of the parameter (n,) and members (n, dof) [rad], spread over the interval; the middle for n = 1.

        Raises:
            InvalidInputError: n is not a positive whole number.
        """

    @abstractmethod
    def walk(self, step: float) -> tuple[Array, Array]:
        """Values of the parameter (n,) and configurations (n, dof), neighbours at most a step apart [rad].

        Where curves turn back, the parameter hardly changes and joints do.

        Raises:
            InvalidInputError: the step is not positive.
        """

    @property
    def _is_round(self) -> bool:
        """Whether the end is the start again."""
        return self.ends[1].kind == "circle"

    def _moved_inside(self, p: float) -> float | None:
        moved = p + TURN * round((0.5 * (self.start + self.stop) - p) / TURN)
        if self.start <= p <= self.stop:
            return p
        if not self.start - LIMIT_SNAP <= moved <= self.stop + LIMIT_SNAP:
            return None
        return min(max(moved, self.start), self.stop)


Touching = tuple[tuple[tuple[str, str], ...], ...]


class SolutionSet(ABC):
    """Everything that reaches one target. Immutable; arrays are read-only.

    Attributes:
        dimension: 0 for points, 1 for curves, along which one parameter is free.
    """

    __slots__ = ()
    dimension: ClassVar[Literal[0, 1]]

    def __repr__(self) -> str:
        """How much there is of it."""
        return f"SolutionSet({self._said})"

    @property
    @abstractmethod
    def _said(self) -> str:
        """How much there is of it."""

    @property
    @abstractmethod
    def complete(self) -> bool:
        """Whether nothing is missing, and no point stands for a whole curve."""

    @property
    @abstractmethod
    def parameter(self) -> str | None:
        """What is free along curves: the name of a joint, or "angle" for that about a free axis; None for points."""

    @property
    @abstractmethod
    def branches(self) -> int:
        """How many branches reach the target, within the limits or not: points, or curves from fold to fold."""

    @property
    @abstractmethod
    def intervals(self) -> tuple[Interval, ...]:
        """Intervals of the parameter within the limits, by branch and start; () for points."""

    @property
    @abstractmethod
    def q(self) -> Array:
        """(k, dof) joint values [rad or m]: points, nearest to the seed first; of each interval the nearest member."""

    @property
    @abstractmethod
    def within_limits(self) -> NDArray[np.bool_]:
        """(k,) True where every joint is within its limits, exactly: always, on curves."""

    @property
    @abstractmethod
    def q_within_limits(self) -> Array:
        """(m, dof) the rows of `q` within the limits."""

    @property
    @abstractmethod
    def margin(self) -> Array:
        """(k, dof) distance to the nearer limit [rad or m]: negative outside, inf for an unlimited joint."""

    @property
    @abstractmethod
    def distance(self) -> Array:
        """(k,) distance to the seed [rad], Euclidean, circular on unlimited joints."""

    @property
    @abstractmethod
    def position_error(self) -> Array:
        """(k,) [m], measured on the model's own joint placements."""

    @property
    @abstractmethod
    def orientation_error(self) -> Array:
        """(k,) [rad], measured on the model's own joint placements."""

    @property
    @abstractmethod
    def angle(self) -> Array | None:
        """(k,) angle about the free axis of the target [rad]; None where it has none."""

    @property
    @abstractmethod
    def singular(self) -> NDArray[np.bool_]:
        """(k,) where a point stands for a whole curve: axes 4 and 6 of a spherical wrist aligned, for one."""

    @property
    @abstractmethod
    def touching(self) -> Touching | None:
        """Pairs of shapes that touch at each row of `q`; None when the solver does not look."""

    @abstractmethod
    def __len__(self) -> int:
        """How many points, or intervals."""

    @abstractmethod
    def nearest(self, seed: ArrayLike | None = None) -> Array | None:
        """What is within the limits nearest to a seed, (dof,) [rad or m]; None when nothing is.

        Args:
            seed: (dof,) [rad or m]; None for the seed that the set was solved with.

        Raises:
            InvalidInputError: a malformed seed, or one more than 1e6 rad from zero.
        """

    @abstractmethod
    def best(self, prefer: Prefer = "nearest") -> Array | None:
        """The preferred configuration within the limits, (dof,) [rad or m]; None when there is none.

        Contact is not looked for.

        Args:
            prefer: as `IKSolver.solve` takes it: "nearest", "margin", "manipulability", or a cost of q (dof,).

        Raises:
            UnknownNameError: an unknown preference.
            InvalidInputError: neither a name nor callable.
        """

    @abstractmethod
    def parameter_of(self, q: ArrayLike) -> float:
        """The parameter [rad] of a configuration (dof,) on a curve: in [-pi, pi] about a free axis, else that joint's.

        Raises:
            InvalidInputError: a malformed q, or these are points.
        """

    @abstractmethod
    def sample(self, n: int) -> Array:
        """Configurations (k, dof) within the limits [rad or m]: of points the n nearest, or spread along all curves.

        Args:
            n: how many; k is less where there are fewer points, and more where there are more intervals, each of which
                has one at least; 0 when nothing is within the limits.

        Raises:
            InvalidInputError: n is not a positive whole number.
        """

    def show(self, of: object, **options: Any) -> Shown:  # Any: checked there
        """Look at it in the browser: `of` is its robot, or the solver. See `jacokin.viewer.show`."""
        return show(self, of, options)

    @abstractmethod
    def plot(self, path: str | Path) -> None:
        """Draw it: the other joints over the parameter, folds ringed; or the joints of points, hollow outside limits.

        What is beyond the limits is shaded.

        Args:
            path: where to, which also tells the format: .png, .svg or .pdf.

        Raises:
            MissingExtraError: matplotlib is not installed.
            InvalidInputError: another ending, or the file cannot be written.
        """
