"""`TwinGoal`: what a client asks of a controller, and how it ends."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING, Any, Self

if TYPE_CHECKING:
    from jacokin.twin.arm import SimulatedArm
    from jacokin.twin.faults import Line


class GoalStatus(Enum):
    """How a goal stands, in the words that ROS 1 and 2 have in common."""

    ACTIVE = "active"
    SUCCEEDED = "succeeded"
    ABORTED = "aborted"
    CANCELLED = "cancelled"


@dataclass(slots=True, eq=False)
class TwinGoal:
    """A goal that was accepted. A controller ends it, once."""

    status: GoalStatus = GoalStatus.ACTIVE
    """How it stands."""
    text: str = ""
    """Why it ended."""
    code: int = 0
    """The error code of FollowJointTrajectory; 0 for none."""

    @property
    def has_ended(self) -> bool:
        """Whether it has ended."""
        return self.status is not GoalStatus.ACTIVE

    def end(self, status: GoalStatus, text: str = "", code: int = 0) -> None:
        """End it; nothing, where it has ended before."""
        if not self.has_ended:
            self.status, self.text, self.code = status, text, code


@dataclass(frozen=True, slots=True)
class Record:
    """What a controller has done until now."""

    time: float
    """Simulated [s]."""
    velocities: int
    """Velocities that were heard."""
    lost: int
    """Velocities and positions that faults have taken."""
    stalls: int
    """How often nothing passed for a while."""
    goals: int
    """Goals that were accepted."""
    waiting: int
    """Commands that wait in the queue of the base."""
    margin: float
    """The least distance of a joint to its limit [rad]; inf without limits."""
    speed: float
    """The largest velocity of a joint, over its limit."""
    coasted: float
    """How long the arm moved on after the last velocity came, or a goal ended, until it stood, or until now [s]."""
    angles: tuple[float, ...]
    """Where the joints are [rad]."""
    fingers: tuple[float, ...]
    """Where the fingers are [rad]."""

    @classmethod
    def of(
        cls, arm: SimulatedArm, line: Line[Any, Any], *, last: float, velocities: int, goals: int, waiting: int = 0
    ) -> Self:
        """Of an arm at the end of a line, to which a command last came at a time [s]."""
        return cls(
            time=arm.state.time,
            velocities=velocities,
            lost=line.lost,
            stalls=line.stalls,
            goals=goals,
            waiting=waiting,
            margin=arm.margin,
            speed=arm.speed,
            coasted=max(0.0, arm.moved - last),
            angles=tuple(arm.state.q.tolist()),
            fingers=tuple(arm.state.fingers.tolist()),
        )
