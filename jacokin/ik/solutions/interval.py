"""`Interval`: configurations along one curve, as values of its parameter from start to stop."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

from numpy.typing import ArrayLike

from jacokin.arrays import Array
from jacokin.ik.preferences import Prefer
from jacokin.model import checks
from jacokin.model.angles import TURN

#: [rad] a value of the parameter this far outside an interval is at its end.
PARAMETER_SLACK = 1e-9


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
        """Values of the parameter (n,) and members (n, dof) [rad], spread over the interval; the middle for n = 1."""

    @abstractmethod
    def spread(self, step: float) -> tuple[Array, Array]:
        """Values of the parameter (n,) and configurations (n, dof) [rad], for callers that refine them.

        The ends exactly, unless nothing ends there; between them, whole multiples of a step, to about 1e-3 rad; at
        least one. Angles are in any 2 pi copy, and not looked at.
        """

    @abstractmethod
    def walk(self, step: float) -> tuple[Array, Array]:
        """Values of the parameter (n,) and configurations (n, dof), neighbours at most a step apart [rad].

        Where curves turn back, the parameter hardly changes and joints do.
        """

    @property
    def _is_round(self) -> bool:
        """Whether the end is the start again."""
        return self.ends[1].kind == "circle"

    def _moved_inside(self, p: float) -> float | None:
        moved = p + TURN * round((0.5 * (self.start + self.stop) - p) / TURN)
        if self.start <= p <= self.stop:
            return p
        if not self.start - PARAMETER_SLACK <= moved <= self.stop + PARAMETER_SLACK:
            return None
        return min(max(moved, self.start), self.stop)
