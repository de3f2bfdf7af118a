"""Which poses a map is made of, and which of them stands for a given one.

A sample is a position and an orientation. Where joint 1 turns freely, positions are (r, 0, z), and a pose anywhere is
first turned about the z axis of the base into the half plane y = 0, x >= 0. Where the last joint rolls the tool freely,
an orientation stands for all that turn the axis of the tool into the same direction.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.reachability.sampling.grid import Grid
from jacokin.reachability.sampling.orientations import Orientations
from jacokin.reachability.sampling.symmetries import Symmetries

NOWHERE = -1  # the cell of a position outside the grid
_AT_ONCE = 4096  # poses whose nearest orientation is looked for in one product


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
            rotations = turned(rotations, -np.arctan2(positions[:, 1], positions[:, 0]))
        return self.nearest(rotations)

    def nearest(self, rotations: Array) -> NDArray[np.int_]:
        """(n,) the nearest orientation of each rotation (n, 3, 3), as it is."""
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


def turned(rotations: Array, angles: Array) -> Array:
    """Rotations (n, 3, 3) turned by angles (n,) [rad] about the z axis of the base."""
    c, s = np.cos(angles), np.sin(angles)
    turn = np.zeros((len(angles), 3, 3))
    turn[:, 0, 0], turn[:, 0, 1], turn[:, 1, 0], turn[:, 1, 1], turn[:, 2, 2] = c, -s, s, c, 1.0
    return np.asarray(turn @ rotations)
