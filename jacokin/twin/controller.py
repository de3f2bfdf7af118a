"""`ArmController`: what the drivers of both versions of ROS have in common, their `TwinGoal` and their `Record`."""

from __future__ import annotations

import logging
import threading
from dataclasses import dataclass
from enum import Enum
from typing import Generic

from jacokin.model import checks
from jacokin.twin.arm import ArmState, SimulatedArm
from jacokin.twin.faults import Command, Faults, Line

logger = logging.getLogger(__name__)


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


class ArmController(Generic[Command]):
    """What a driver and a controller of ros2_control have in common. Several threads may call it.

    Attributes:
        arm: that it moves.
    """

    def __init__(self, arm: SimulatedArm, faults: Faults | None, seed: int) -> None:
        """Move an arm, with faults that are drawn from a seed; None for nothing.

        Raises:
            InvalidInputError: one is something else.
        """
        self.arm = checks.instance("arm", arm, SimulatedArm, "a SimulatedArm")
        going_wrong = Faults() if faults is None else checks.instance("faults", faults, Faults, "Faults, or None")
        self._line: Line[Command, ArmState] = Line(going_wrong, checks.whole_number("seed", seed))
        self._line.tick(arm.state)
        self._lock = threading.RLock()
        self._velocities, self._goals = 0, 0
        self._last = 0.0  # [s] when a command last came

    def tell(self) -> ArmState | None:
        """What is published now, None where faults take that."""
        with self._lock:
            return self._line.tell()

    def record(self) -> Record:
        """What was done until now."""
        with self._lock:
            arm = self.arm
            return Record(
                time=arm.state.time,
                velocities=self._velocities,
                lost=self._line.lost,
                stalls=self._line.stalls,
                goals=self._goals,
                waiting=0,
                margin=arm.margin,
                speed=arm.speed,
                coasted=max(0.0, arm.moved - self._last),
                angles=tuple(arm.state.q.tolist()),
                fingers=tuple(arm.state.fingers.tolist()),
            )

    def _send_velocity(self, command: Command) -> None:
        """Send a velocity to the arm."""
        if self.arm.state.time - self._last > 1.0 or not self._velocities:  # [s]
            logger.info("velocities come")
        self._velocities += 1
        self._last = self.arm.state.time
        self._line.send(command)
