"""What a tick of the tracker says: its status, its numbers, and the counts of many ticks."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from types import MappingProxyType

from jacokin.arrays import Array, Sealed
from jacokin.ik.results import Frozen

SINGULAR_POSE = "singular pose"
TIME_BUDGET = "time budget"


class TrackerStatus(Enum):
    """Outcome of a tick; the value is a sentence that says what to try."""

    OK = "the tool is on its target within the tolerances"
    LIMITED = (
        "the tool is behind its target and closing in, slowed by what `limiting` names: "
        "move the target more slowly, or wait"
    )
    HELD = (
        "no allowed step brings the tool nearer, so the arm stays: the target is out of reach, behind a limit "
        "or behind an obstacle (see `limiting`)"
    )
    LOST = "the error keeps growing: the target runs away faster than the limits allow; slow it down"
    LATE = "the time given for the tick ran out, so the arm brakes: give more, or fewer obstacles"


@dataclass(frozen=True, slots=True, eq=False)
class TrackerStep(Sealed):
    """One tick. Arrays are read-only."""

    q: Array
    """(dof,) joint angles to command [rad], inside the limits exactly."""
    v: Array
    """(dof,) joint velocities that led here, constant over the tick [rad/s]."""
    status: TrackerStatus
    """What happened; `status.value` says what to try."""
    position_error: float
    """Distance between tool and target after the tick [m]; the largest one of the targets that come first."""
    orientation_error: float
    """Angle between tool and target after the tick [rad]; the largest one of the targets that come first."""
    limiting: tuple[str, ...]
    """What held the arm back: "joint_2 velocity", "joint_3 upper limit", "link_3_beam~box", "singular pose", "time
    budget". Empty when OK."""
    clearance: float | None
    """Smallest distance between shapes that are kept apart, obstacles where they are at the end of the tick [m]:
    measured where it is near the one allowed, a lower bound where it is larger; negative when shapes overlap; None
    when none are kept apart."""
    qp_solver: str
    """QP solver that ran, with a fallback named."""
    message: str
    """What happened in this tick, with numbers, empty when OK; and which joints are past their limits, and which shapes
    no motion parts."""
    elapsed: float
    """How long the call took [s]."""

    def __str__(self) -> str:
        """The step on one line."""
        by = f" ({', '.join(self.limiting)})" if self.limiting else ""
        return (
            f"{self.status.name}{by}: position error {self.position_error:.3g} m, "
            f"orientation error {self.orientation_error:.3g} rad"
        )


@dataclass(frozen=True, slots=True)
class TrackerSummary(Frozen):
    """What happened in the ticks since the last `reset`."""

    ticks: int
    """How many."""
    statuses: Mapping[str, int] = field(hash=False)
    """Ticks by the name of their status."""
    limiting: Mapping[str, int] = field(hash=False)
    """Ticks in which each limit, pair of shapes, singular pose or time budget held the arm back, most often first."""
    overruns: int
    """Ticks that took longer than their budget, those that braked in time not among them."""
    longest: float
    """The longest tick [s]."""

    def __str__(self) -> str:
        """The counts on one line."""
        by = ", ".join(f"{name} {count}" for name, count in (*self.statuses.items(), *self.limiting.items()))
        return f"{self.ticks} ticks: {by}; {self.overruns} over budget, the longest {1e3 * self.longest:.2f} ms"


class StepTally:
    """Counts ticks."""

    def __init__(self) -> None:
        """Start at zero."""
        self._statuses: Counter[str] = Counter()
        self._limiting: Counter[str] = Counter()
        self._overruns, self._longest = 0, 0.0

    def add(self, step: TrackerStep, budget: float) -> None:
        """Count a tick with its budget [s]."""
        self._statuses[step.status.name] += 1
        if step.limiting:
            self._limiting.update(step.limiting)
        self._overruns += step.elapsed > budget
        if step.elapsed > self._longest:
            self._longest = step.elapsed

    def summary(self) -> TrackerSummary:
        """The counts."""
        statuses, limiting = (MappingProxyType(dict(each.most_common())) for each in (self._statuses, self._limiting))
        return TrackerSummary(self._statuses.total(), statuses, limiting, self._overruns, self._longest)
