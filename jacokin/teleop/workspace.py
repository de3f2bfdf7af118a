"""`Workspace`: a box that neither the target nor the tool leaves.

The target slows down before the walls. The tool does not go straight to a target that jumps, turns or cannot be
reached, so it is asked for a place near to it on the way, and a tick after which it could not stop inside the box is
not taken.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.model import checks
from jacokin.model.robot import Robot

GUARD = 0.2  # part of the inset: this far before the walls the tool already counts as outside
SLACK = 5e-5  # [m] that it may be beyond that: turning in one place needs some room
JUMP = 0.1  # [m] in a tick, after which somebody has put the arm elsewhere
AHEAD = (
    (0.02, 0.1),
    (2e-3, 0.01),
)  # [m], [rad] that the target is ahead of the tool at most; nearer it goes straighter
STOPS = 16  # places on the way to rest that are looked at


class Workspace:
    """A box in the base, and how far outside it the tool may still be."""

    def __init__(self, lower: Array, upper: Array) -> None:
        """Take the corners (3,) [m]."""
        self._lower, self._upper = lower, upper
        # [m] a tool that turns in its place moves by less; of a box that is flat, a tenth.
        inset = np.minimum(1e-3, 0.1 * (upper - lower))
        self._walls = lower + inset, upper - inset
        self._guarded = lower + GUARD * inset, upper - GUARD * inset
        self._allowed = self._guarded
        self._last: Array | None = None  # (3,) where the tool was a tick ago [m]

    def slowed(self, position: Array, way: Array) -> Array:
        """A way (3,) [m] from a position that slows towards walls and does not cross them; outside, only inwards."""
        lower, upper = self._walls
        room = np.maximum(np.where(way > 0.0, upper - position, position - lower), 0.0)
        slowed = np.abs(way) * np.minimum(room / 0.05, 1.0)  # [m] before a wall, from which the target slows
        return np.asarray(np.sign(way) * np.minimum(slowed, room))

    def tied(self, tool: pin.SE3) -> pin.SE3:
        """The pose of a tool that is tied to the hand, inside the box or as far outside as it started."""
        self.start_from(tool.translation)
        lower, upper = self._allowed
        inside = np.clip(tool.translation, np.minimum(self._lower, lower), np.maximum(self._upper, upper))
        return pin.SE3(tool.rotation, inside)

    def start_from(self, tool: Array) -> None:
        """Let the tool (3,) [m] be where it is now; as far outside as it is, it may be from now on, and no farther."""
        lower, upper = np.minimum(self._guarded[0], tool), np.maximum(self._guarded[1], tool)
        if self._last is not None and np.abs(tool - self._last).max() < JUMP:
            lower, upper = np.maximum(lower, self._allowed[0]), np.minimum(upper, self._allowed[1])
        self._allowed, self._last = (lower, upper), tool

    def keeps(
        self, robot: Robot, frame: int, tool: pin.SE3, q: Array, v: Array, acceleration: Array | None, dt: float
    ) -> bool:
        """Whether the tool stays inside, or no farther outside than it was, at `q` and while it brakes from there.

        Args:
            robot: the arm.
            frame: number of the frame that carries the tool.
            tool: T_frame_tool.
            q: (dof,) [rad].
            v: (dof,) [rad/s].
            acceleration: (dof,) by which joints brake [rad/s^2], infinite for those that stand at once; None for all.
            dt: control step [s].
        """
        rows = q[np.newaxis]
        if acceleration is not None and v.any():
            ticks = np.floor(np.abs(v) / (acceleration * dt))
            less = np.where(ticks > 0.0, acceleration * dt, 0.0)  # in every tick
            passed = np.minimum(np.round(np.linspace(0.0, ticks.max(), STOPS))[:, np.newaxis], ticks)
            rows = q + dt * np.sign(v) * (passed * np.abs(v) - 0.5 * less * passed * (passed + 1.0))
        return all(self.contains((robot.placement(row, frame) * tool).translation) for row in rows)

    def contains(self, place: Array) -> bool:
        """Whether the tool may be at a place (3,) [m]."""
        lower, upper = self._allowed
        return bool((place >= lower - SLACK).all() and (place <= upper + SLACK).all())


def checked_workspace(workspace: tuple[ArrayLike, ArrayLike] | None) -> Workspace | None:
    """A workspace from its lower and upper corner (3,) [m].

    Raises:
        InvalidInputError: not two corners, or the lower not below the upper.
    """
    if workspace is None:
        return None
    corners = checks.listed("workspace", workspace, "two corners, lower and upper")
    if len(corners) != 2:
        raise checks.refusal("workspace", "two corners, lower and upper", workspace)
    lower, upper = (checks.vector("workspace", corner, 3, "m") for corner in corners)
    if not (lower < upper).all():
        raise InvalidInputError(f"workspace: lower {lower.tolist()} must be below upper {upper.tolist()}")
    return Workspace(lower, upper)
