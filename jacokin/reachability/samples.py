"""`Grid` and `Samples`: which poses a map is made of, and which of them stands for a given one.

A sample is a position and an orientation. Where joint 1 turns freely, positions are (r, 0, z), and a pose anywhere is
first turned about the z axis of the base into the half plane y = 0, x >= 0. Where the last joint rolls the tool freely,
an orientation stands for all that turn the axis of the tool into the same direction.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.model import checks
from jacokin.model.robot import Robot
from jacokin.reachability.orientations import Orientations, Symmetries

MOST_CELLS = 10**9  # one number for each is 8 GB
NOWHERE = -1  # the cell of a position outside the grid
_AT_ONCE = 4096  # poses whose nearest orientation is looked for in one product
_ROUNDING = 1e-9  # of a cell, by which an edge may miss the box


class Grid:
    """Cubes of one size that fill a box in the base frame of the robot; immutable.

    Attributes:
        lower: (3,) lower corner [m].
        upper: (3,) upper corner [m]; the last cubes may stand out.
        spacing: length of an edge [m].
        shape: number of cubes along x, y and z.
    """

    __slots__ = ("lower", "shape", "spacing", "upper")

    def __init__(self, lower: ArrayLike, upper: ArrayLike, spacing: float) -> None:
        """Check the box.

        Raises:
            InvalidInputError: malformed corners, an empty box, a spacing that is not positive, or more than 1e9 cells.
        """
        self.lower = checks.read_only(checks.vector("lower", lower, 3, "m"))
        self.upper = checks.read_only(checks.vector("upper", upper, 3, "m"))
        self.spacing = checks.positive("spacing", spacing, "m")
        if not (self.upper > self.lower).all():
            raise InvalidInputError(
                f"upper must be above lower [m], got {self.upper.tolist()} and {self.lower.tolist()}"
            )
        with np.errstate(over="ignore"):  # infinitely many cells are too many
            edges = np.ceil((self.upper - self.lower) / self.spacing - _ROUNDING)
        numbers = np.maximum(edges, 1.0).tolist()
        if math.prod(numbers) > MOST_CELLS:
            raise InvalidInputError(
                f"the grid has {math.prod(numbers):.3g} cells ({' x '.join(f'{n:.0f}' for n in numbers)}), "
                f"more than {MOST_CELLS:.0e}: use a larger spacing or a smaller box"
            )
        self.shape = (int(numbers[0]), int(numbers[1]), int(numbers[2]))

    @classmethod
    def around(cls, robot: Robot, spacing: float) -> Grid:
        """The box that the robot can reach into at most: a cube about its first joint, as far as its links are long.

        Raises:
            InvalidInputError: not a robot, or a spacing as for a grid.
        """
        checks.instance("robot", robot, Robot, "a Robot")
        spacing = checks.positive("spacing", spacing, "m")
        placements = list(robot.pin_model.jointPlacements)[1:]
        frame = robot.pin_model.frames[robot.frame_id()].placement
        reach = sum(float(np.linalg.norm(placement.translation)) for placement in [*placements[1:], frame])
        steps = float(np.ceil(reach / spacing))
        edge = steps * spacing if math.isfinite(steps) else reach  # which then has too many cells
        return cls(placements[0].translation - edge, placements[0].translation + edge, spacing)

    def __repr__(self) -> str:
        """Corners, spacing and number of cells."""
        return f"Grid({self.lower.tolist()}, {self.upper.tolist()}, {self.spacing}): {' x '.join(map(str, self.shape))}"

    @property
    def cells(self) -> int:
        """Number of cells."""
        return math.prod(self.shape)

    def axis(self, index: int) -> Array:
        """Centres of the cells along x (0), y (1) or z (2) [m].

        Raises:
            InvalidInputError: another index.
        """
        index = checks.whole_number("index", index, 0, 2)
        return np.asarray(self.lower[index] + (np.arange(self.shape[index]) + 0.5) * self.spacing)

    def centres(self) -> Array:
        """(nx, ny, nz, 3) centres of the cells [m]."""
        return np.stack(np.meshgrid(*(self.axis(index) for index in range(3)), indexing="ij"), axis=-1)


@dataclass(frozen=True, eq=False)
class Samples:
    """The poses of a map.

    Attributes:
        grid: the box in space that the map covers.
        orientations: of the tool at each position.
        symmetries: what of a pose does not matter.
    """

    grid: Grid
    orientations: Orientations
    symmetries: Symmetries

    @cached_property
    def shape(self) -> tuple[int, ...]:
        """Number of positions: along x, y and z, or along r and z."""
        if not self.symmetries.turns:
            return self.grid.shape
        farthest = np.abs([self.grid.lower[:2], self.grid.upper[:2]]).max(axis=0)
        return math.ceil(float(np.linalg.norm(farthest)) / self.grid.spacing), self.grid.shape[2]

    @property
    def positions(self) -> int:
        """Number of positions."""
        return math.prod(self.shape)

    def position(self, cells: NDArray[np.int_]) -> Array:
        """(k, 3) position of each cell [m], in the half plane y = 0 where joint 1 turns freely."""
        if not self.symmetries.turns:
            places = np.stack(np.unravel_index(cells, self.shape), axis=1)
            return np.asarray(self.grid.lower + (places + 0.5) * self.grid.spacing)
        r, z = np.unravel_index(cells, self.shape)
        spacing = self.grid.spacing
        return np.stack([(r + 0.5) * spacing, np.zeros(len(cells)), self.grid.lower[2] + (z + 0.5) * spacing], axis=1)

    def targets(self, cells: NDArray[np.int_]) -> Array:
        """(k, m, 4, 4) every orientation at each of these cells."""
        targets = np.zeros((len(cells), len(self.orientations), 4, 4))
        targets[..., 3, 3] = 1.0
        targets[..., :3, :3] = self.orientations.rotations
        targets[..., :3, 3] = self.position(cells)[:, None]
        return targets

    def cell_of(self, positions: Array) -> NDArray[np.int_]:
        """(n,) the cell that each position (n, 3) lies in; `NOWHERE` outside the grid."""
        spacing = self.grid.spacing
        with np.errstate(invalid="ignore"):
            places = np.floor((positions - self.grid.lower) / spacing)
            inside = ((places >= 0) & (places < self.grid.shape)).all(axis=1)
        if self.symmetries.turns:
            radius = np.floor(np.hypot(positions[:, 0], positions[:, 1]) / spacing)
            places = np.stack([radius, places[:, 2]], axis=1)
            inside &= radius < self.shape[0]
        inside = np.asarray(inside)
        indices = np.where(inside[:, None], places, 0.0).astype(np.int_)
        return np.where(inside, np.ravel_multi_index(tuple(indices.T), self.shape), NOWHERE)

    def orientation_of(self, rotations: Array, positions: Array) -> NDArray[np.int_]:
        """(n,) the nearest orientation for poses with these rotations (n, 3, 3) and positions (n, 3)."""
        if self.symmetries.turns:
            rotations = turn_about_base(rotations, -np.arctan2(positions[:, 1], positions[:, 0]))
        return self.nearest(rotations)

    def nearest(self, rotations: Array) -> NDArray[np.int_]:
        """(n,) the nearest orientation of each rotation (n, 3, 3), which is not turned before."""
        found = np.empty(len(rotations), dtype=np.int_)
        for first in range(0, len(rotations), _AT_ONCE):
            some = slice(first, first + _AT_ONCE)
            found[some] = self.cosines(rotations[some]).argmax(axis=1)
        return found

    def cosines(self, rotations: Array) -> Array:
        """(n, m) cosine of the angle from each rotation to each orientation, turns left out where they are free."""
        axis = self.symmetries.tool_axis
        if axis is not None:
            return np.asarray((rotations @ axis) @ (self.orientations.rotations @ axis).T)
        # trace(A^T B) = 1 + 2 cos(angle)
        flat = rotations.reshape(-1, 9)
        traces = flat @ self.orientations.rotations.reshape(-1, 9).T
        axes, ranges = self.orientations.axes, self.orientations.ranges
        if axes is not None and ranges is not None:
            # Turned by p about a, the trace is a^T L a + cos p (trace L - a^T L a) + sin p a.skew(L), with L = A^T B.
            turns = np.cross(axes[:, None], np.eye(3)).transpose(0, 2, 1)
            across = flat @ (self.orientations.rotations @ turns).reshape(-1, 9).T
            along = flat @ (self.orientations.rotations @ (axes[:, :, None] * axes[:, None])).reshape(-1, 9).T
            best, middle = np.arctan2(across, traces - along), ranges.mean(axis=1)
            p = np.clip(best + 2.0 * np.pi * np.round((middle - best) / (2.0 * np.pi)), *ranges.T)
            traces = along + np.cos(p) * (traces - along) + np.sin(p) * across
        return np.asarray((traces - 1.0) / 2.0)


def turn_about_base(rotations: Array, angles: Array) -> Array:
    """Turn rotations (n, 3, 3) by angles (n,) [rad] about the z axis of the base."""
    c, s = np.cos(angles), np.sin(angles)
    turn = np.zeros((len(angles), 3, 3))
    turn[:, 0, 0], turn[:, 0, 1], turn[:, 1, 0], turn[:, 1, 1], turn[:, 2, 2] = c, -s, s, c, 1.0
    return np.asarray(turn @ rotations)


def turn_about_z(angle: float) -> Array:
    """The rotation (3, 3) by an angle [rad] about the z axis."""
    return np.asarray(turn_about_base(np.eye(3)[None], np.array([angle]))[0])
