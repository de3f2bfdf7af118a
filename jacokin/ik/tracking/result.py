"""What one tick of the tracker gives back: a status that says what to try, and a frozen step."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from jacokin.arrays import Array


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


@dataclass(frozen=True, slots=True, eq=False)
class TrackerStep:
    """One tick. Arrays are read-only."""

    q: Array
    """(dof,) joint angles to command [rad], inside the limits exactly."""
    v: Array
    """(dof,) joint velocities that led here, constant over the tick [rad/s]."""
    status: TrackerStatus
    """What happened; `status.value` says what to try."""
    position_error: float
    """Distance between tool and target after the tick [m]; the largest one of several targets."""
    orientation_error: float
    """Angle between tool and target after the tick [rad]; the largest one of several targets."""
    limiting: tuple[str, ...]
    """What held the arm back: "joint_2 velocity", "joint_3 upper limit", "link_3_beam~box". Empty when OK."""
    clearance: float | None
    """Smallest distance between shapes that are kept apart [m]: measured where it is near the one allowed, a lower
    bound where it is larger; negative when shapes overlap; None when none are kept apart."""
    qp_solver: str
    """QP solver that ran, with a fallback named."""
    message: str
    """What happened in this tick, with numbers; empty when OK."""

    def __str__(self) -> str:
        """The step on one line."""
        by = f" ({', '.join(self.limiting)})" if self.limiting else ""
        return (
            f"{self.status.name}{by}: position error {self.position_error:.3g} m, "
            f"orientation error {self.orientation_error:.3g} rad"
        )
