"""A trajectory that is played back."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.model import checks

if TYPE_CHECKING:
    from jacokin.model.robot import Robot
    from jacokin.viewer.motion.recordings import Trajectory

SPEEDS = (0.1, 4.0)  # least and largest, of the recorded one


class Playback:
    """Where a trajectory is: it plays, pauses, is scrubbed and changes its speed."""

    def __init__(self, trajectory: Trajectory, robot: Robot) -> None:
        """Check the trajectory against the robot.

        Raises:
            InvalidInputError: other joints, less than one row, or times that do not increase.
        """
        try:
            names, t = tuple(trajectory.joint_names), np.array(trajectory.t, dtype=np.float64)
            q = trajectory.q
        except (AttributeError, TypeError, ValueError) as error:
            raise InvalidInputError(
                f"trajectory must be a PathResult, a JointMotion or a file, got {checks.shown(trajectory)}"
            ) from error
        if names != robot.joint_names:
            raise InvalidInputError(f"trajectory has the joints {', '.join(names)}; {robot.name} has others")
        q = checks.matrix("trajectory", q, robot.dof, "rad")
        if t.ndim != 1 or not len(t) or len(q) != len(t) or not np.isfinite(t).all() or (np.diff(t) <= 0.0).any():
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
