"""The path of the tool: straight lines between poses, which may be free to turn about an axis of the tool."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.model import checks, poses
from jacokin.model.angles import TURN
from jacokin.model.pose_targets import FreeAxis

SAME_AXIS = 1e-9  # of unit vectors
MOST_PLACES = 50_000  # steps of a path: half a kilometre, or that many waypoints
WHOLE_TICK = 1e-9  # a duration this near to whole ticks is whole; division rounds


class CartesianPath:
    """Poses along straight lines; place u runs from 0 to the number of lines, whole at the waypoints.

    Attributes:
        poses: the waypoints T_base_tool, at a free angle of zero.
        lengths: (lines, 2) distance [m] and angle [rad] of each line.
        axis: (3,) the free axis in the tool frame; None when every waypoint is a full pose.
    """

    def __init__(self, targets: Sequence[pin.SE3 | FreeAxis] | ArrayLike) -> None:
        """Check the waypoints.

        Raises:
            InvalidInputError: fewer than two, one is malformed (its number is named), all are the same, or their free
                axes differ.
        """
        rows = _listed(targets)
        free = [row for row in rows if isinstance(row, FreeAxis)]
        self.axis: Array | None = free[0].axis if free else None
        for index, row in enumerate(rows):
            if isinstance(row, FreeAxis) and np.abs(row.axis - free[0].axis).max() > SAME_AXIS:
                raise InvalidInputError(f"targets[{index}] has another free axis: all must be {free[0].axis.tolist()}")
        self.poses = [
            row.pose if isinstance(row, FreeAxis) else poses.checked_pose(row, f"targets[{index}]")
            for index, row in enumerate(rows)
        ]
        self._ranges = np.array([row.range if isinstance(row, FreeAxis) else (0.0, 0.0) for row in rows])
        self._full = np.array([isinstance(row, FreeAxis) and row.full_turn for row in rows])
        self._rotations = np.array([pose.rotation for pose in self.poses])
        self._positions = np.array([pose.translation for pose in self.poses])
        between = np.swapaxes(self._rotations[:-1], 1, 2) @ self._rotations[1:]
        self._turns = Rotation.from_matrix(between).as_rotvec()
        steps = np.diff(self._positions, axis=0)
        self.lengths = np.column_stack([np.linalg.norm(steps, axis=1), np.linalg.norm(self._turns, axis=1)])
        if not self.lengths.any():
            raise InvalidInputError("all waypoints are the same pose")

    @property
    def lines(self) -> int:
        """Number of lines."""
        return len(self.lengths)

    def parameters(self, u: float, step: float) -> Array:
        """Values of the free angle to be tried at a place [rad], at most `step` apart; zero for a full pose."""
        line = min(int(u), self.lines - 1)
        part = u - line
        if self._full[line] and self._full[line + 1]:
            low = self._ranges[line, 0]
            return np.asarray(low + TURN * np.arange(np.ceil(TURN / step)) / np.ceil(TURN / step))
        if part == 0.0 or part == 1.0:
            row = line + int(part)
            low, high = self._ranges[row]
        else:
            low, high = (1.0 - part) * self._ranges[line] + part * self._ranges[line + 1]
        return np.linspace(low, high, 1 + int(np.ceil((high - low) / step - 1e-9))) if high > low else np.array([low])

    def turns(self, line: int) -> bool:
        """Whether the free angle may go round and round along a line."""
        return bool(self._full[line] and self._full[line + 1])

    def at(self, u: Array, parameter: Array | None = None) -> Array:
        """Poses (n, 4, 4) at places (n,), turned about the free axis by (n,) [rad]."""
        line = np.clip(u.astype(np.intp), 0, self.lines - 1)
        part = u - line
        found = np.zeros((len(u), 4, 4))
        found[:, 3, 3] = 1.0
        found[:, :3, 3] = self._positions[line] + part[:, None] * (self._positions[line + 1] - self._positions[line])
        whole = part == 1.0  # the waypoint itself, not what is left of it after rounding
        found[whole, :3, 3] = self._positions[line[whole] + 1]
        turned = Rotation.from_rotvec(part[:, None] * self._turns[line]).as_matrix()
        found[:, :3, :3] = self._rotations[line] @ turned
        found[whole, :3, :3] = self._rotations[line[whole] + 1]
        if parameter is not None and self.axis is not None:
            found[:, :3, :3] @= Rotation.from_rotvec(parameter[:, None] * self.axis).as_matrix()
        return found

    def ticks(self, times: Array, dt: float) -> Array:
        """Places at every tick of `dt` [s], lines taking (lines,) times [s], each rounded up to whole ticks."""
        counts = np.ceil(times / dt - WHOLE_TICK).astype(np.intp)
        parts = [line + np.arange(1, count + 1) / count for line, count in enumerate(counts.tolist()) if count]
        return np.concatenate([np.zeros(1), *parts])

    def places(self, spacing: float, angle: float) -> Array:
        """Places from start to end, every waypoint among them, at most so far apart [m] and [rad].

        Raises:
            InvalidInputError: a path longer than a search can take.
        """
        counts = np.maximum(np.ceil(np.maximum(self.lengths[:, 0] / spacing, self.lengths[:, 1] / angle)), 1.0)
        if not counts.sum() <= MOST_PLACES:
            raise InvalidInputError(
                f"the path is {self.lengths[:, 0].sum():.6g} m long: more than {MOST_PLACES} steps of {spacing:g} m"
            )
        parts = [line + np.arange(count) / count for line, count in enumerate(counts)]
        return np.append(np.concatenate(parts), float(self.lines))


def _listed(targets: Sequence[pin.SE3 | FreeAxis] | ArrayLike) -> list[object]:
    try:
        rows = list(targets)  # type: ignore[arg-type]  # whatever cannot be listed is refused below
    except TypeError as error:
        raise InvalidInputError(f"targets must be a sequence of poses, got {checks.shown(targets)}") from error
    if len(rows) < 2:
        raise InvalidInputError(f"a path needs at least two targets, got {len(rows)}")
    return rows
