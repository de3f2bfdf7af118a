"""A tracker that follows the gizmo."""

from __future__ import annotations

import pinocchio as pin

from jacokin.arrays import Array
from jacokin.ik.solver import IKSolver
from jacokin.ik.tracking.result import TrackerStep
from jacokin.ik.tracking.tracker import Tracker

TICK = 0.01  # [s] of the tracker: 100 Hz, as the real arm takes joint angles
LONGEST_LAG = 0.1  # [s] of ticks that are made up for; after a longer pause the tracker goes on from where it is


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
