"""Horizontal slices of a reachability map: a square for each cell that is reached, coloured by how well."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.viewer.drawing import Triangles

if TYPE_CHECKING:
    from jacokin.reachability import ReachabilityMap

COLOURS = np.array([[68, 1, 84], [59, 82, 139], [33, 145, 140], [94, 201, 98], [253, 231, 37]])  # 0 to 1, evenly
FILLED = 0.92  # of a cell's edge: the gaps show where cells end


class Cells(NamedTuple):
    """The cells of a slice that are reached."""

    positions: NDArray[np.float32]
    """(n, 3) their centres [m]."""
    colours: NDArray[np.uint8]
    """(n, 3) red, green, blue."""
    fractions: Array
    """(n,) fraction of the orientations that are reached, above 0."""


class MapSlices:
    """The slices of a map.

    Attributes:
        heights: (nz,) of the middle of each layer of cells [m].
        caption: what the colours mean, in words.
    """

    def __init__(self, reach: ReachabilityMap) -> None:
        """Read the fractions and the grid of a map."""
        grid = reach.grid
        self._fraction = reach.fraction
        self._spacing = grid.spacing
        self._x, self._y = np.meshgrid(grid.axis(0), grid.axis(1), indexing="ij")
        self.heights: Array = np.asarray(grid.axis(2))
        tool = "" if reach.recipe["tool"] is None else " with a tool"
        self.caption = (
            f"fraction of {reach.orientations.name} that {reach.recipe['frame']}{tool} reaches "
            f"in cells of {1e3 * grid.spacing:g} mm"
        )

    def square(self) -> Triangles:
        """A cell around the origin, visible from above and from below."""
        half = 0.5 * FILLED * self._spacing
        corners = np.array([[-half, -half, 0.0], [half, -half, 0.0], [half, half, 0.0], [-half, half, 0.0]])
        return Triangles(corners.astype(np.float32), np.array([[0, 1, 2], [0, 2, 3]], dtype=np.uint32))

    def layer(self, height: float) -> int:
        """The number of the layer whose middle is nearest to a height [m]."""
        return int(np.argmin(np.abs(self.heights - height)))

    def cells(self, layer: int) -> Cells:
        """The cells of a layer."""
        fraction = self._fraction[:, :, layer]
        reached = fraction > 0.0
        count = int(reached.sum())
        positions = np.column_stack((self._x[reached], self._y[reached], np.full(count, self.heights[layer])))
        return Cells(positions.astype(np.float32), colour_fractions(fraction[reached]), fraction[reached])


def colour_fractions(fraction: Array) -> NDArray[np.uint8]:
    """(n, 3) the colours of fractions (n,) from 0 to 1."""
    stops = np.linspace(0.0, 1.0, len(COLOURS))
    return np.column_stack([np.interp(fraction, stops, channel) for channel in COLOURS.T]).round().astype(np.uint8)
