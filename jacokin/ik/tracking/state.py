"""What changes from tick to tick, as values: a tick makes a new state and leaves the old one alone."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from jacokin.arrays import Array
from jacokin.ik.tracking.distances import Distances
from jacokin.model import checks


class JointState(NamedTuple):
    """A configuration (dof,) [rad] and the distances of the shapes there."""

    q: Array
    distances: Distances | None


class TrackerState(NamedTuple):
    """Everything a tick starts from."""

    arm: JointState
    """Where the arm is."""
    v: Array
    """(dof,) its velocity over the last tick [rad/s]; read-only."""
    reference: JointState
    """What the QP moves and the arm follows; the arm itself without acceleration limits."""
    damping: float
    """Of the next QP, relative to the squared error."""
    error: float
    """Of the last tick [m], position and orientation in one."""
    growing: int
    """Ticks in a row in which the error grew."""
    twist_pose: pin.SE3 | None
    """T_base_tool that the last twist asked for, while the arm keeps up with twists."""

    @classmethod
    def at_rest(cls, arm: JointState, damping: float) -> TrackerState:
        """Standing still."""
        return cls(arm, checks.read_only(np.zeros(len(arm.q))), arm, damping, np.inf, 0, None)

    def moved(self, arm: JointState, reference: JointState, dt: float, damping: float) -> TrackerState:
        """After a tick of `dt` [s]."""
        v = (arm.q - self.arm.q) / dt
        for array in (arm.q, v):
            array.setflags(write=False)
        return TrackerState(arm, v, reference, damping, self.error, self.growing, None)

    def measured(self, error: float, growing: int) -> TrackerState:
        """With the error [m] of its tick, and for how many ticks it has grown."""
        return self._replace(error=error, growing=growing)
