"""`convex_parts`: a mesh as convex parts that together hold all of it.

It is cut by planes across its axes. Each part is in a cell, a box, and is the convex hull of what is in it. Extreme
points of a solid in a box are on its surface, or are corners of the box inside of it: so the hull is that of the
triangles, cut at the walls of the cell, and of those corners. Nothing of the surface is lost, whatever the planes;
which ones are taken decides how little is added.
"""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np

from jacokin.arrays import Array
from jacokin.model.descriptions.meshes import TriangleMesh, convex_hull, hull_of

MOST_PARTS = 20  # of a mesh


class Cut(NamedTuple):
    """A plane across an axis of the mesh."""

    gain: float
    """How much smaller the two hulls together are than that of the whole, about [m^3]."""
    axis: int
    height: float
    """[m]"""


class ConvexPart(NamedTuple):
    """What of a mesh is in a cell."""

    corners: Array
    """(n, 3, 3) triangles [m]."""
    cell: Array
    """(2, 3) lowest and highest coordinates [m]."""
    cut: Cut
    """The best one."""


NO_CUT = Cut(0.0, 0, 0.0)


def convex_parts(mesh: TriangleMesh) -> list[Array]:
    """The corners (n, 3) [m] of convex parts whose union holds a mesh and what it encloses; one if it is convex.

    Raises:
        ValueError: as `hull_of`.
    """
    whole = hull_of(mesh.vertices)
    if whole is None:
        return []
    least = 0.005 * _volume(whole.vertices)  # [m^3] that a cut must take away from the hulls
    if not least > 0.0:
        return [whole.vertices]
    solid, box = _VoxelSolid(mesh), np.array([mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)])
    parts = [solid.part(mesh.vertices[mesh.faces], box, least)]
    while len(parts) < MOST_PARTS:
        number = max(range(len(parts)), key=lambda index: parts[index].cut.gain)
        corners, cell, cut = parts[number]
        if cut.gain <= 0.0:
            break
        halves = zip(_divided(corners, cut.axis, cut.height), _halves(cell, cut.axis, cut.height), strict=True)
        parts[number : number + 1] = [solid.part(*half, least) for half in halves]
    points = (solid.points(corners, cell) for corners, cell, _ in parts)
    hulls = (hull_of(_outermost(each)) for each in points if len(each))
    return [hull.vertices for hull in hulls if hull is not None]


class _VoxelSolid:
    """What is inside of a mesh, on a grid; nothing where it has openings wider than a voxel."""

    def __init__(self, mesh: TriangleMesh) -> None:
        """Mark the voxels of the surface, and fill what they enclose."""
        from scipy.ndimage import binary_fill_holes  # only meshes need it

        low, extent = mesh.vertices.min(axis=0), np.ptp(mesh.vertices, axis=0)
        self._pitch = float(extent.max()) / 64
        self._low = low - 1.5 * self._pitch
        surface = np.zeros((np.ceil(extent / self._pitch) + 4).astype(int), dtype=np.bool_)
        small = _small(mesh.vertices[mesh.faces], 0.5 * self._pitch)
        surface[tuple(((small.reshape(-1, 3) - self._low) / self._pitch).astype(int).T)] = True
        self._inside = binary_fill_holes(surface) & ~surface
        self._filled = self._inside + 0.5 * surface

    def part(self, corners: Array, cell: Array, least: float) -> ConvexPart:
        """Triangles (n, 3, 3) in a cell, with the cut that gains most; none where it is less than a volume [m^3].

        A ring is no smaller in halves, but in quarters: where one cut gains too little, two are tried.
        """
        some = _fewer(corners)
        if _volume(self.points(some, cell)) - self._held(cell) < least:  # as good as convex
            return ConvexPart(corners, cell, NO_CUT)
        best = max(self._cuts(some, cell), default=NO_CUT)
        if best.gain < least:
            for axis in range(3):
                height = float(cell[:, axis].mean())
                halves = zip(_divided(some, axis, height), _halves(cell, axis, height), strict=True)
                gain = sum(max(self._cuts(*half), default=NO_CUT).gain for half in halves)
                best = max(best, Cut(0.5 * gain, axis, height))
        return ConvexPart(corners, cell, best if best.gain >= least else NO_CUT)

    def points(self, corners: Array, cell: Array) -> Array:
        """(n, 3) points whose hull holds what is in a cell: of its triangles, and its corners inside."""
        ends = np.array(list(itertools.product(*cell.T)))
        places = ((ends - self._low) / self._pitch).astype(int)
        return np.concatenate([corners.reshape(-1, 3), ends[self._inside[tuple(places.T)]]])

    def _held(self, cell: Array) -> float:
        """Volume of what is in a cell, about [m^3]: half of the voxels that the surface goes through."""
        (a, b, c), (d, e, f) = np.round((cell - self._low) / self._pitch).astype(int).tolist()
        return float(self._filled[a:d, b:e, c:f].sum()) * self._pitch**3

    def _cuts(self, corners: Array, cell: Array) -> list[Cut]:
        """Cuts across the axes, and what they gain."""
        volume, found = _volume(self.points(corners, cell)), []
        for axis in range(3):
            low, high = cell[:, axis].tolist()
            for height in np.linspace(low, high, 9)[1:-1].tolist():
                halves = zip(_divided(corners, axis, height), _halves(cell, axis, height), strict=True)
                left = sum(_volume(self.points(*half)) for half in halves)
                found.append(Cut(volume - left, axis, height))
        return found


def _fewer(corners: Array) -> Array:
    """Some of many triangles, those with the farthest corners among them; cuts are compared at these."""
    step = len(corners) * 3 // 600 + 1
    if step == 1:
        return corners
    points = corners.reshape(-1, 3)
    ends = np.unique(np.concatenate([points.argmin(axis=0), points.argmax(axis=0)])) // 3
    return np.concatenate([corners[::step], corners[ends]])


def _halves(cell: Array, axis: int, height: float) -> tuple[Array, Array]:
    """The cells (2, 3) below and above a plane."""
    below, above = cell.copy(), cell.copy()
    below[1, axis] = above[0, axis] = height
    return below, above


def _small(corners: Array, longest: float) -> Array:
    """Triangles (n, 3, 3) halved along their longest edges until none is longer [m]."""
    done, waiting = [], corners
    while len(waiting):
        edges = np.linalg.norm(waiting - np.roll(waiting, -1, axis=1), axis=2)
        long = edges.max(axis=1) > longest
        done.append(waiting[~long])
        cut, first = waiting[long], edges[long].argmax(axis=1)
        rows = np.arange(len(cut))
        a, b, c = (cut[rows, (first + k) % 3] for k in range(3))  # the longest edge is from a to b
        middle = 0.5 * (a + b)
        waiting = np.concatenate([np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)])
    return np.concatenate(done)


def _divided(corners: Array, axis: int, height: float) -> tuple[Array, Array]:
    """Triangles (n, 3, 3) below and above a plane; those across it are cut."""
    above = corners[:, :, axis] > height
    count = above.sum(axis=1)
    across = (count == 1) | (count == 2)
    cut, sides = corners[across], above[across]
    alone = np.where(count[across] == 1, sides.argmax(axis=1), sides.argmin(axis=1))
    rows = np.arange(len(cut))
    a, b, c = (cut[rows, (alone + k) % 3] for k in range(3))
    ab, ac = (_on_plane(a, other, axis, height) for other in (b, c))
    tips = np.stack([a, ab, ac], axis=1)
    rests = np.concatenate([np.stack([ab, b, c], axis=1), np.stack([ab, c, ac], axis=1)])
    tip_above = sides[rows, alone]
    rest_above = np.tile(~tip_above, 2)
    return (
        np.concatenate([corners[count == 0], tips[~tip_above], rests[~rest_above]]),
        np.concatenate([corners[count == 3], tips[tip_above], rests[rest_above]]),
    )


def _on_plane(a: Array, b: Array, axis: int, height: float) -> Array:
    """Where lines from points (n, 3) to others meet a plane."""
    share = (height - a[:, axis]) / (b[:, axis] - a[:, axis])
    found = a + share[:, np.newaxis] * (b - a)
    found[:, axis] = height
    return found


def _outermost(points: Array) -> Array:
    """Those points (n, 3) that make their hull, so that none is left out of it as one of too many."""
    hull = convex_hull(points)
    return np.unique(points, axis=0) if hull is None else np.asarray(points[hull.vertices])


def _volume(points: Array) -> float:
    """Of the hull of points (n, 3) [m^3]; 0 where they are flat."""
    hull = convex_hull(points)
    return 0.0 if hull is None else float(hull.volume)
