"""`Playback`: a trajectory that is played back, from this package, a file of another program, or a recording of ROS."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.logs import Log, Recording
from jacokin.logs.bag import ENDINGS as LOGS
from jacokin.logs.motion_files import read_motion
from jacokin.model import checks
from jacokin.model.robot import Robot
from jacokin.motion.trajectory import Trajectory

SPEEDS = (0.1, 4.0)  # least and largest, of the recorded one


class Playback:
    """A trajectory and the time it is at: it plays, pauses, can be scrubbed and changes its speed.

    Attributes:
        commanded_t: (m,) times of what was commanded [s]; none where that is not known.
        commanded_q: (m, dof) commanded joint angles [rad].
    """

    def __init__(self, trajectory: Trajectory | Recording | str | Path, robot: Robot) -> None:
        """Read the trajectory, and check it against the robot.

        Args:
            trajectory: a `Trajectory`, or a file: .csv and .npz of theirs, .json of ROS, .kinova.csv; or a `Recording`
                of a log, or the file of one: .bag, .mcap or .db3, of which what was measured is played.
            robot: whose joints it moves. The columns of .kinova.csv have no names; those of .json come in any order,
                and may have one prefix before all names, such as j2n6s300_.

        Raises:
            InvalidInputError: not a trajectory or no such file; other joints, or a prefix that is the name of another
                bundled robot; no rows, or times that do not increase; as `Log.recording`.
            MissingExtraError: a log without rosbags.
        """
        if isinstance(trajectory, str | Path) and Path(trajectory).suffix in LOGS:
            trajectory = Log(trajectory, robot).recording()
        name = "trajectory"
        if isinstance(trajectory, str | Path):
            name = f"{trajectory}: {name}"
            t, q, _ = read_motion(trajectory, robot)
        else:
            t, q = _columns(trajectory, robot)
        q = checks.matrix(name, q, robot.dof, "rad")
        if t.ndim != 1 or not len(t) or len(q) != len(t) or not np.isfinite(t).all() or (np.diff(t) <= 0.0).any():
            raise InvalidInputError(f"{name} must have rows at finite times that increase")
        self.t, self.q = t - t[0], q
        self.commanded_t: Array = np.zeros(0)
        self.commanded_q: Array = np.zeros((0, robot.dof))
        if isinstance(trajectory, Recording):
            self.commanded_t, self.commanded_q = trajectory.commanded_t, trajectory.commanded_q
        self.time = 0.0
        self.speed = 1.0
        self.playing = False

    @property
    def duration(self) -> float:
        """Length of the trajectory at its own speed [s]."""
        return float(self.t[-1])

    @property
    def said(self) -> str:
        """How far it is, in words."""
        return f"{self.time:.2f} of {self.duration:.2f} s"

    def rows(self, most: int) -> NDArray[np.intp]:
        """Numbers of at most so many rows, evenly from the first to the last."""
        return np.unique(np.linspace(0, len(self.t) - 1, min(len(self.t), most)).astype(np.intp))

    def scrub(self, time: float) -> None:
        """Go to a time [s]; one that is not in the trajectory is brought to its nearer end."""
        self.time = min(max(checks.number("time", time, "s"), 0.0), self.duration)

    def set_speed(self, speed: float) -> None:
        """Set the speed, as a multiple of the recorded one, brought within `SPEEDS`."""
        self.speed = min(max(checks.number("speed", speed), SPEEDS[0]), SPEEDS[1])

    def toggle(self) -> None:
        """Pause; or play on, from the beginning when it is over."""
        if not self.playing and self.time >= self.duration:
            self.time = 0.0
        self.playing = not self.playing

    def advance(self, elapsed: float) -> Array:
        """Let time pass on the clock [s], up to the end; (dof,) where the arm is then [rad]."""
        if self.playing:
            self.time = min(self.time + self.speed * elapsed, self.duration)
            self.playing = self.time < self.duration
        return self.at(self.time)

    def at(self, time: float) -> Array:
        """(dof,) joint angles at a time [s], on straight lines between rows [rad]."""
        return np.array([np.interp(time, self.t, column) for column in self.q.T])

    def commanded_at(self, time: float) -> Array | None:
        """(dof,) what was commanded at a time [s], as `at`; None before the first command, and where none is known."""
        if not len(self.commanded_t) or time < self.commanded_t[0]:
            return None
        return np.array([np.interp(time, self.commanded_t, column) for column in self.commanded_q.T])


def _columns(trajectory: Trajectory | Recording, robot: Robot) -> tuple[Array, Array]:
    """Times and angles of a trajectory of this package, or of anything that has them."""
    try:
        names, t, q = tuple(trajectory.joint_names), np.array(trajectory.t, dtype=np.float64), trajectory.q
    except (AttributeError, TypeError, ValueError) as error:
        raise InvalidInputError(f"trajectory must be a Trajectory or a file, got {checks.shown(trajectory)}") from error
    if names != robot.joint_names:
        raise InvalidInputError(f"trajectory has the joints {', '.join(names)}; {robot.name} has others")
    return t, q
