"""Arms that move by themselves: a trajectory that is played back, and a tracker that follows the gizmo."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Protocol

import numpy as np
import pinocchio as pin

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.ik.tracking.result import TrackerStep
from jacokin.ik.tracking.tracker import Tracker
from jacokin.model import checks

if TYPE_CHECKING:
    from jacokin.ik.solver import IKSolver
    from jacokin.model.robot import Robot

SPEEDS = (0.1, 4.0)  # least and largest, of the recorded one
TICK = 0.01  # [s] of the tracker: 100 Hz, as the real arm takes joint angles
LONGEST_LAG = 0.1  # [s] of ticks that are made up for; after a longer pause the tracker goes on from where it is


class Trajectory(Protocol):
    """What is played: a `PathResult`, a `JointMotion`, or anything with these."""

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints."""

    @property
    def t(self) -> Array:
        """(n,) time [s]."""

    @property
    def q(self) -> Array:
        """(n, dof) joint angles [rad]."""


def load(path: str | Path) -> Trajectory:
    """Read a trajectory that `PathResult.save` or `JointMotion.save` wrote.

    Raises:
        InvalidInputError: no such file, or neither of the two.
    """
    from jacokin.ik.paths.joint_motion import JointMotion
    from jacokin.ik.paths.result import PathResult

    try:
        return PathResult.load(path)
    except InvalidInputError as error:
        try:
            return JointMotion.load(path)
        except InvalidInputError:
            raise error from None


class Playback:
    """Where a trajectory is: it plays, pauses, is scrubbed and changes its speed."""

    def __init__(self, trajectory: Trajectory, robot: Robot) -> None:
        """Check the trajectory against the robot.

        Raises:
            InvalidInputError: other joints, less than one row, or times that do not increase.
        """
        names, t = tuple(trajectory.joint_names), np.array(trajectory.t, dtype=np.float64)
        if names != robot.joint_names:
            raise InvalidInputError(f"trajectory has the joints {', '.join(names)}; {robot.name} has others")
        q = checks.matrix("trajectory", trajectory.q, robot.dof, "rad")
        if not len(t) or len(q) != len(t) or not np.isfinite(t).all() or (np.diff(t) <= 0.0).any():
            raise InvalidInputError("trajectory must have rows at finite times that increase")
        self.t, self.q = t - t[0], q
        self.time = 0.0
        self.speed = 1.0
        self.playing = False

    @property
    def duration(self) -> float:
        """Of the whole trajectory at its own speed [s]."""
        return float(self.t[-1])

    def scrub(self, time: float) -> None:
        """Go to a time [s]; one that is not in the trajectory is brought to its nearer end."""
        self.time = min(max(checks.number("time", time, "s"), 0.0), self.duration)

    def set_speed(self, speed: float) -> None:
        """Set the speed, as a multiple of the recorded one, brought within `SPEEDS`."""
        self.speed = min(max(checks.number("speed", speed), SPEEDS[0]), SPEEDS[1])

    def play(self) -> None:
        """Play on, from the beginning when it is over."""
        if self.time >= self.duration:
            self.time = 0.0
        self.playing = True

    def advance(self, elapsed: float) -> Array:
        """Go on for a time on the clock [s], pausing at the end; (dof,) where the arm is then [rad]."""
        if self.playing:
            self.time = min(self.time + self.speed * elapsed, self.duration)
            self.playing = self.time < self.duration
        return self.at(self.time)

    def at(self, time: float) -> Array:
        """(dof,) joint angles at a time [s], on straight lines between rows [rad]."""
        return np.array([np.interp(time, self.t, column) for column in self.q.T])


class Following:
    """A tracker that follows the gizmo at 100 Hz of the clock, within the velocity limits."""

    def __init__(self, solver: IKSolver, q: Array) -> None:
        """Start at rest at `q` (dof,) [rad].

        Raises:
            InvalidInputError: the robot's file has no velocity limits.
        """
        self._tracker = Tracker(solver.robot, solver.frame, dt=TICK, q=q, tool=solver.tool)
        self._owed = 0.0  # [s] on the clock that no tick has covered

    def advance(self, target: pin.SE3, elapsed: float) -> TrackerStep | None:
        """Make up for a time on the clock [s] with whole ticks; the last one, or None when there was none."""
        self._owed += elapsed
        if self._owed > LONGEST_LAG:
            self._owed = TICK
        step = None
        while self._owed >= TICK:
            step = self._tracker.step(target)
            self._owed -= TICK
        return step
