"""A followed path as arrays, and as files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.ik.results import Frozen
from jacokin.model import checks
from jacokin.motion.files import Layout, Stored

AT_SEED = 1e-3  # [rad] a start this near to the seed is not worth a word
NAMED = 8  # segments in a sentence


@dataclass(frozen=True, slots=True, eq=False)
class BranchReport(Frozen):
    """How well the path was followed from one start configuration."""

    q_start: Array
    """(dof,) the branch [rad]."""
    failed_segments: tuple[int, ...]
    """Segments on which the error exceeded the tolerances at some tick; empty when the path is feasible."""
    position_error: float
    """Largest position error along the path [m]."""
    orientation_error: float
    """Largest orientation error along the path [rad]."""


@dataclass(frozen=True, slots=True, eq=False)
class PathResult(Stored):
    """Joint trajectory along a path, one row a tick. Arrays are read-only."""

    LAYOUT: ClassVar = Layout(
        joints=("q", "v"),
        rows=("position_error", "orientation_error", "clearance"),
        counts=("segment",),
        words=("status", "limiting"),
        numbers=("parameter",),
        texts=("qp_solver", "message"),
        values=("start_distance",),
    )

    joint_names: tuple[str, ...]
    """Names of the joints."""
    t: Array
    """(n,) time [s]; row 0 is the start."""
    q: Array
    """(n, dof) joint angles [rad]."""
    v: Array
    """(n, dof) joint velocities over the tick that ends here [rad/s]; row 0 is zero."""
    position_error: Array
    """(n,) distance to the path's pose at that time [m]."""
    orientation_error: Array
    """(n,) angle to it [rad]."""
    status: tuple[str, ...]
    """(n,) "OK", "LIMITED", "HELD" or "LOST", see `TrackerStatus`."""
    limiting: tuple[str, ...]
    """(n,) what held the arm back, joined by "; "."""
    segment: NDArray[np.intp]
    """(n,) which straight line the row belongs to."""
    clearance: Array
    """(n,) smallest distance of shapes kept apart [m], see `TrackerStep`; nan when none are."""
    lower: Array
    """(dof,) lower limits [rad]."""
    upper: Array
    """(dof,) upper limits [rad]."""
    velocity_limit: Array
    """(dof,) velocity limits that were held [rad/s]."""
    branches: tuple[BranchReport, ...] = ()
    """Start configurations that were tried, in order; not kept in files."""
    qp_solver: str = ""
    """QP solver that ran, with a fallback named."""
    message: str = ""
    """What happened, in a sentence."""
    parameter: Array = field(default_factory=lambda: checks.read_only([]))
    """(waypoints,) what `plan_path` chose where a waypoint leaves one parameter free [rad]: the angle about the axis of
    a `FreeAxis`, or joint 3 of a seven-joint arm; nan at full poses of six joints and at waypoints that are not
    reached. Empty for tracked paths."""
    start_distance: float = 0.0
    """Largest angle of a joint between the seed (home without one) and row 0 [rad]: the arm is to be brought there."""

    @property
    def success(self) -> bool:
        """True when every tick is on the path within the tolerances."""
        return all(status == "OK" for status in self.status)

    @property
    def failed_segments(self) -> tuple[int, ...]:
        """Segments with a tick that is off the path."""
        return tuple(sorted({int(s) for s, status in zip(self.segment, self.status, strict=True) if status != "OK"}))

    @property
    def limit_margin(self) -> Array:
        """(n, dof) distance to the nearer joint limit [rad]; inf on unlimited joints."""
        return np.asarray(np.minimum(self.q - self.lower, self.upper - self.q))

    @property
    def a(self) -> Array:
        """(n, dof) change of velocity at the beginning of the tick that ends here [rad/s^2]; row 0 is zero."""
        acceleration = np.zeros_like(self.v)
        acceleration[1:] = np.diff(self.v, axis=0) / np.diff(self.t)[:, None]
        return acceleration

    @property
    def time_limited(self) -> float:
        """Time spent off the path [s]."""
        if len(self.t) < 2:
            return 0.0
        return float(sum(status != "OK" for status in self.status[1:]) * (self.t[1] - self.t[0]))

    def __len__(self) -> int:
        """Number of rows."""
        return len(self.t)

    def __str__(self) -> str:
        """The result on two lines."""
        return (
            f"{len(self)} rows, {self.t[-1]:.3f} s, {'on the path throughout' if self.success else 'NOT on the path'}: "
            f"largest error {self.position_error.max():.3g} m, {self.orientation_error.max():.3g} rad; "
            f"off the path for {self.time_limited:.3f} s\n{self.message}"
        )


def in_words(segments: Sequence[int]) -> str:
    """Numbers of segments for a sentence; of many, the first ones."""
    more = len(segments) - NAMED
    return ", ".join(map(str, segments[:NAMED])) + (f" and {more} more" if more > 0 else "")
