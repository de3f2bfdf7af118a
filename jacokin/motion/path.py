"""`CartesianPath`: straight lines between poses of the tool, which may be free to turn about an axis of its own.

Along a line the position moves straight and the orientation turns about one fixed axis by the short way, both in
proportion; the screw motion of SE(3) would bend the line.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.ik.targets import PartialTarget, Target, interpret
from jacokin.model import angles, checks, poses
from jacokin.model.poses import FreeAxis

TURNED = 0.2  # [m] turning by 1 rad counts as going so far
SHORTEST = 1e-9  # [m] added to each line, so that places rise along those of no length, too
MOST_PLACES = 50_000  # steps of a path: half a kilometre, or that many waypoints
MOST_CURVES = 10_000  # the same where each of them has curves
MOST_SURFACES = 1000  # and surfaces: ten metres


class CartesianPath:
    """Poses along straight lines; place u runs from 0 to the number of lines, whole at the waypoints.

    Where a waypoint is a `FreeAxis`, the tool may turn. Between waypoints, axis and range change steadily from one to
    the next; a full pose counts as a range from 0 to 0 about its neighbour's axis.

    Attributes:
        poses: the waypoints T_base_tool, at a free angle of zero.
        lengths: (lines, 2) distance [m] and angle [rad] of each line.
        sizes: (lines,) the longer of both [m], turning by 1 rad as so far as `TURNED`.
        free: whether there is a free angle anywhere.
    """

    def __init__(self, waypoints: Sequence[Target] | ArrayLike, frame: str, name: str = "targets") -> None:
        """Check the waypoints, for a tool on a frame; `name` is what messages call them.

        Raises:
            InvalidInputError: fewer than two, one is malformed (its number is named), all are the same, or the free
                axes of neighbours are opposite.
        """
        rows = [_checked(row, f"{name}[{index}]", frame) for index, row in enumerate(_list_rows(waypoints, name))]
        self.poses = [row.pose if isinstance(row, FreeAxis) else row for row in rows]
        axes = [row.axis if isinstance(row, FreeAxis) else None for row in rows]
        self.free = any(axis is not None for axis in axes)
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
        self.sizes = np.maximum(self.lengths[:, 0], TURNED * self.lengths[:, 1])
        self._behind = np.append(0.0, np.cumsum(self.sizes + SHORTEST))
        ways = np.hstack([steps, TURNED * (self._rotations[:-1] @ self._turns[:, :, None])[:, :, 0]])
        self._ways = ways / np.maximum(np.linalg.norm(ways, axis=1), SHORTEST)[:, None]
        # The axis at both ends of each line, and the angle between them.
        self._axes = np.array([[_first(a, b), _first(b, a)] for a, b in itertools.pairwise(axes)])
        cross = np.linalg.norm(np.cross(self._axes[:, 0], self._axes[:, 1]), axis=1)
        self._bends = np.arctan2(cross, (self._axes[:, 0] * self._axes[:, 1]).sum(axis=1))
        opposite = np.flatnonzero(self._bends > np.pi - 1e-6)  # [rad] there is no way from one to the other
        if opposite.size:
            index = int(opposite[0])
            raise InvalidInputError(
                f"the free axes of {name}[{index}] and {name}[{index + 1}] are opposite: turn one of them round, "
                "and its range with it"
            )

    @property
    def lines(self) -> int:
        """Number of lines."""
        return len(self.lengths)

    def target(self, u: float) -> pin.SE3 | FreeAxis:
        """What is to be reached at a place."""
        where = np.array([u])
        matrix = self.at(where)[0]
        low, high, full = (column[0] for column in self.window(where))
        if full:
            return FreeAxis(matrix, axis=self.axes(where)[0])
        if high - low < 1e-9:  # [rad] as good as one value
            matrix = self.at(where, np.array([low]))[0]
            return pin.SE3(matrix[:3, :3], matrix[:3, 3])
        return FreeAxis(matrix, axis=self.axes(where)[0], range=(low, high))

    def window(self, u: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
        """Least and largest free angle (n,) [rad] at places (n,), and where it is any angle."""
        line, part = self._split(u)
        low, high = (1.0 - part) * self._ranges[line].T + part * self._ranges[line + 1].T
        ends = np.where(part == 0.0, self._full[line], self._full[line + 1])
        return low, high, np.where((part == 0.0) | (part == 1.0), ends, self.turns(line))

    def free_angle(self, parameter: Array) -> Array:
        """The free angle at the first waypoints (n,) in its range or in [-pi, pi) [rad]; nan at full poses."""
        number = np.arange(len(parameter))
        middle = np.where(self._full[number], 0.0, self._ranges[number].mean(axis=1))
        found = middle + angles.wrap_to_pi(parameter - middle)
        found = np.where(self._full[number], found, np.clip(found, *self._ranges[number].T))
        return np.where(self._ranges[number, 1] > self._ranges[number, 0], found, np.nan)

    def turns(self, line: NDArray[np.intp] | int) -> NDArray[np.bool_]:
        """Whether the free angle may go round and round along lines."""
        return np.asarray(self._full[line] & self._full[np.asarray(line) + 1])

    def axes(self, u: Array) -> Array:
        """The axis (n, 3) in the tool frame at places (n,), a unit vector."""
        line, part = self._split(u)
        bend = self._bends[line]
        small = bend < 1e-8
        sine = np.where(small, 1.0, np.sin(bend))
        first = np.where(small, 1.0 - part, np.sin((1.0 - part) * bend) / sine)
        second = np.where(small, part, np.sin(part * bend) / sine)
        return np.asarray(first[:, None] * self._axes[line, 0] + second[:, None] * self._axes[line, 1])

    def at(self, u: Array, parameter: Array | None = None) -> Array:
        """Poses (n, 4, 4) at places (n,), turned about the free axis by (n,) [rad]."""
        line, part = self._split(u)
        found = np.zeros((len(u), 4, 4))
        found[:, 3, 3] = 1.0
        found[:, :3, 3] = self._positions[line] + part[:, None] * (self._positions[line + 1] - self._positions[line])
        whole = part == 1.0  # the waypoint itself, not what is left of it after rounding
        found[whole, :3, 3] = self._positions[line[whole] + 1]
        turned = Rotation.from_rotvec(part[:, None] * self._turns[line]).as_matrix()
        found[:, :3, :3] = self._rotations[line] @ turned
        found[whole, :3, :3] = self._rotations[line[whole] + 1]
        if parameter is not None and self.free:
            found[:, :3, :3] @= Rotation.from_rotvec(parameter[:, None] * self.axes(u)).as_matrix()
        return found

    def _split(self, u: Array) -> tuple[NDArray[np.intp], Array]:
        """Numbers of the lines and how much of them is behind each place."""
        line = np.clip(u.astype(np.intp), 0, self.lines - 1)
        return line, u - line

    def durations(self, speed: ArrayLike, angular_speed: ArrayLike) -> Array:
        """How long each line takes at constant speed (lines,) [s]: the longer of position and orientation.

        Args:
            speed: of the position [m/s], one for all lines or one for each.
            angular_speed: of the orientation [rad/s], as `speed`.

        Raises:
            InvalidInputError: a speed is not positive, or there is one too many or too few.
        """
        linear = checks.positive_vector("speed", speed, self.lines, "m/s")
        angular = checks.positive_vector("angular_speed", angular_speed, self.lines, "rad/s")
        with np.errstate(over="ignore"):  # an infinite duration is refused when it is counted in ticks
            return np.maximum(self.lengths[:, 0] / linear, self.lengths[:, 1] / angular)

    def segments(self, u: Array) -> NDArray[np.intp]:
        """Number of the line that ends at or leads on from each place (n,); read-only."""
        return checks.sealed(np.clip(np.ceil(u).astype(np.intp) - 1, 0, self.lines - 1))

    def gone(self, u: Array) -> Array:
        """How far the path has gone (n,) at places (n,) [m]."""
        return np.asarray(np.interp(u, np.arange(self.lines + 1), self._behind))

    def middle(self, first: Array, second: Array) -> Array:
        """The places (n,) half way from some (n,) to others."""
        half = 0.5 * (self.gone(first) + self.gone(second))
        return np.asarray(np.interp(half, self._behind, np.arange(self.lines + 1)))

    def places(self, spacing: float, most: int) -> Array:
        """Places from start to end, at most so far apart [m]; waypoints that lead straight on may be left out.

        Raises:
            InvalidInputError: a path longer than a search can take.
        """
        counts = np.maximum(np.ceil(self.sizes / spacing), 1.0)
        ends = np.ones(self.lines, dtype=np.bool_)  # whether a step ends where the line begins
        behind, passed = 0.0, self._passed()
        for line, (size, count) in enumerate(zip(self.sizes.tolist(), counts.tolist(), strict=True)):
            ends[line] = not passed[line] or behind + size > spacing
            behind = size / count if ends[line] else behind + size
        if not counts[ends].sum() <= most:
            raise InvalidInputError(
                f"the path is {self.lengths[:, 0].sum():.6g} m long: more than {most} steps of {spacing:g} m"
            )
        parts = [line + np.arange(counts[line]) / counts[line] for line in np.flatnonzero(ends).tolist()]
        return np.append(np.concatenate(parts), float(self.lines))

    def _passed(self) -> NDArray[np.bool_]:
        """Where (lines,) nothing changes at the waypoint before a line: neither the way, nor the axis or its range."""
        same = (self._bends == 0.0) & (self._full[1:] == self._full[:-1])
        same &= (self._ranges[1:] == self._ranges[:-1]).all(axis=1)
        straight = (self._ways[1:] * self._ways[:-1]).sum(axis=1) > 0.9  # cosine of the corner
        return np.append(False, straight & same[1:] & same[:-1])


def _first(axis: Array | None, other: Array | None) -> Array:
    """The axis; without one the other; without any the tool's z axis."""
    return axis if axis is not None else other if other is not None else np.array([0.0, 0.0, 1.0])


def _checked(row: Target, name: str, frame: str) -> pin.SE3 | FreeAxis:
    """One waypoint.

    Raises:
        InvalidInputError: malformed, or a position without orientation.
    """
    if isinstance(row, FreeAxis):
        return row
    parts = row if isinstance(row, list | tuple) else [row]
    if not any(isinstance(part, PartialTarget) for part in parts):
        return poses.checked_pose(row, name)
    try:
        found = interpret(row, frame)
    except InvalidInputError as error:
        raise InvalidInputError(f"{name}: {error}") from error
    if found.free_axis is not None:
        return found.free_axis
    if found.position_only:
        raise InvalidInputError(f"{name} leaves the orientation free: a path needs poses, or one free axis")
    return pin.SE3(found.rotation, found.position)


def _list_rows(waypoints: Sequence[Target] | ArrayLike, name: str) -> tuple[Any, ...]:
    rows: tuple[Any, ...] = checks.listed(name, waypoints, "a sequence of poses")  # type: ignore[arg-type]  # is checked
    if len(rows) < 2:
        raise InvalidInputError(f"a path needs at least two {name}, got {len(rows)}")
    return rows
