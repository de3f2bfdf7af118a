"""Smoothing: a way through curves is moved along their self-motions until the joints move as little as they can.

The search chooses among members some degrees apart. Each knot may move along its curve, by s along a unit tangent n, or
on its surface, along two; what the motion costs is, to first order, a sum of squares of neighbouring s, whose minimum
is a banded system.
Where joints are still too fast, their motion is made to cost more, and the knots are moved again.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solveh_banded

from jacokin.arrays import Array
from jacokin.motion.planning.manifold import Manifold, Pace

LONGEST = 0.2  # [rad] along a curve in one round
KEPT_AWAY = 1e-3  # [rad] from limits
SPEED_USED = 0.95  # part of the velocity limits that is not too fast between two knots


class Smoothing:
    """Moves knots along their curves or surfaces."""

    def __init__(self, manifold: Manifold, pace: Pace, u: Array, pull: tuple[Array, float] | None) -> None:
        """Take the places (n,) of the knots.

        Args:
            manifold: the configurations on the path.
            pace: what motion costs.
            u: (n,) places.
            pull: where (dof,) the first knot should be and what its squared distance costs; None to leave it.
        """
        self._manifold, self._u, self._pull = manifold, u, pull
        self._scale = pace.scale
        self._times = pace.between(u)
        self._weights = np.tile(1.0 / self._times[:, None], (1, manifold.dof))
        self._limited = np.isfinite(pace.velocity)

    def improve(self, x: Array, pinned: NDArray[np.bool_]) -> Array:
        """Knots (n, width) on the same curves that take less time, and cost less; pinned ones (n,) stay."""
        weights = self._weights
        best = x = self.smooth(x, pinned)
        least = self._lateness(x)
        for _ in range(12):  # times it is made dearer
            if least == 0.0:
                break
            # What is too fast costs more, by the fourth power of its speed.
            self._weights = self._weights * np.maximum(self._speed(x) / SPEED_USED, 1.0) ** 4
            x = self.smooth(x, pinned)
            late = self._lateness(x)
            if late < least:
                best, least = x, late
        self._weights = weights
        return best

    def cost(self, x: Array) -> float:
        """Of knots (n, width)."""
        q = x[:, : self._manifold.dof] / self._scale
        cost = float((self._weights * np.diff(q, axis=0) ** 2).sum())
        if self._pull is not None:
            cost += self._pull[1] * float(((q[0] - self._pull[0] / self._scale) ** 2).sum())
        return cost

    def smooth(self, x: Array, pinned: NDArray[np.bool_]) -> Array:
        """Knots (n, width) of less cost on the same curves; pinned ones (n,) stay."""
        best = self.cost(x)
        for _ in range(20):
            moves = self._moves(x, pinned)
            for _ in range(4):
                there, good = self._manifold.project(self._u, x + moves)
                there[~good] = x[~good]
                cost = self.cost(there)
                if cost < best:
                    break
                moves = 0.5 * moves
            if not cost < best * (1.0 - 1e-3):  # less is not worth another round
                return there if cost < best else x
            x, best = there, cost
        return x

    def _moves(self, x: Array, pinned: NDArray[np.bool_]) -> Array:
        """How each knot (n, width) is to move along its tangents."""
        tangents = self._manifold.tangents(self._u, x)
        tangents[pinned] = 0.0
        if self._pull is None:
            tangents[0] = 0.0
        lower, upper = self._manifold.window_near(self._u, x)
        room = np.maximum(x - lower - KEPT_AWAY, 0.0), np.maximum(upper - x - KEPT_AWAY, 0.0)
        begun = np.zeros_like(x)
        moves = begun
        for _ in range(4):  # knots whose move is cut short go on along what stops them, and the others are moved anew
            moves = (self._least(x + begun, tangents)[:, :, None] * tangents).sum(axis=1)
            part, stopping = _part_within(moves, room[0] + begun, room[1] - begun)
            moves = begun + part[:, None] * moves
            cut = np.flatnonzero(part < 1.0)
            if not cut.size:
                break
            begun[cut] = moves[cut]
            tangents[cut] = _without(tangents[cut], stopping[cut])
        return moves

    def _least(self, x: Array, tangents: Array) -> Array:
        """The s (n, k) along tangents (n, k, width) of least cost; 0 along those that are zero."""
        dof, w = self._manifold.dof, self._weights
        n = tangents[:, :, :dof] / self._scale
        step = np.diff(x[:, :dof] / self._scale, axis=0)
        first, second = w[:, None] * n[:-1], w[:, None] * n[1:]
        before, after = first @ n[:-1].swapaxes(1, 2), second @ n[1:].swapaxes(1, 2)
        damping = 1e-9 * max(before.max(), after.max()) + np.finfo(np.float64).tiny  # where nothing holds a knot
        blocks = np.tile(damping * np.eye(n.shape[1]), (len(x), 1, 1))
        blocks[:-1] += before
        blocks[1:] += after
        beside = -(first @ n[1:].swapaxes(1, 2))  # from each knot to the next
        right = np.zeros(n.shape[:2])
        right[:-1] += (first @ step[:, :, None])[:, :, 0]
        right[1:] -= (second @ step[:, :, None])[:, :, 0]
        if self._pull is not None:
            away = self._pull[0] / self._scale - x[0, :dof] / self._scale
            blocks[0] += self._pull[1] * n[0] @ n[0].T
            right[0] += self._pull[1] * n[0] @ away
        return np.asarray(solveh_banded(_banded(blocks, beside), right.ravel())).reshape(right.shape)

    def _speed(self, x: Array) -> Array:
        """Of joints from knot to knot (n - 1, dof), as parts of their limits."""
        q = x[:, : self._manifold.dof] / self._scale
        return np.asarray(np.abs(np.diff(q, axis=0)) / self._times[:, None] * self._limited)

    def _lateness(self, x: Array) -> float:
        """How much longer the motion takes than it should [s]."""
        return float(self._times @ np.maximum(self._speed(x).max(axis=1) / SPEED_USED - 1.0, 0.0))


def _part_within(moves: Array, back: Array, ahead: Array) -> tuple[Array, NDArray[np.intp]]:
    """The part (n,) of moves (n, width) that has room (n, width) on both sides, and the coordinates (n,) that stop it.

    Where a move is too long, that is no coordinate: -1.
    """
    size = np.abs(moves)
    with np.errstate(divide="ignore", invalid="ignore"):
        parts = np.where(size > 1e-12, np.where(moves > 0.0, ahead, back) / size, np.inf)  # [rad] rounding
    stopping = np.argmin(parts, axis=1)
    least = parts[np.arange(len(parts)), stopping]
    longest = LONGEST / np.maximum(np.linalg.norm(moves, axis=1), 1e-12)
    return np.minimum(np.minimum(least, longest), 1.0), np.where(longest < least, -1, stopping)


def _without(tangents: Array, stopping: NDArray[np.intp]) -> Array:
    """What is left of tangents (n, k, width) along which coordinates (n,) do not move; nothing for -1."""
    along = np.take_along_axis(tangents, np.maximum(stopping, 0)[:, None, None], axis=2)  # (n, k, 1)
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), np.finfo(np.float64).tiny)
    left = tangents - along @ (along.swapaxes(1, 2) @ tangents)
    left[stopping < 0] = 0.0
    return left if left.shape[1] > 1 else np.zeros_like(left)


def _banded(blocks: Array, beside: Array) -> Array:
    """The upper bands of a symmetric matrix, as `solveh_banded` takes them.

    Args:
        blocks: (n, k, k) on its diagonal.
        beside: (n - 1, k, k) on their right.
    """
    count, size = blocks.shape[:2]
    bands = np.zeros((2 * size, count * size))
    for row in range(size):
        for column in range(size):
            if row <= column:
                bands[2 * size - 1 + row - column, column::size] = blocks[:, row, column]
            bands[size - 1 + row - column, size + column :: size] = beside[:, row, column]
    return bands
