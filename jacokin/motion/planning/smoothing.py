"""Smoothing: a way through curves is moved along their self-motions until the joints move as little as they can.

The search chooses among members some degrees apart. Each knot may move along its curve, by s along a unit tangent n;
what the motion costs is, to first order, a sum of squares of neighbouring s, whose minimum is a tridiagonal system.
Where joints are still too fast, their motion is made to cost more, and the knots are moved again.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solveh_banded

from jacokin.arrays import Array
from jacokin.motion.planning.manifold import Manifold, Pace

ROUNDS = 20
LONGEST = 0.2  # [rad] along a curve in one round
KEPT_AWAY = 1e-3  # [rad] from limits
SPEED_USED = 0.95  # part of the velocity limits that is not too fast between two knots


class Smoothing:
    """Moves knots along their curves."""

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
        for _ in range(ROUNDS):
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
        """How each knot (n, width) is to move along its tangent."""
        tangents = self._manifold.tangents(self._u, x)
        low, high = self._room(x, tangents)
        fixed = pinned.copy()
        if self._pull is None:
            fixed[0] = True
        s = np.zeros(len(x))
        for _ in range(4):  # knots whose move is cut short stay there, and the others are moved anew
            wanted = self._least(x, tangents, s, fixed)
            s = np.clip(wanted, low, high)
            cut = (s != wanted) & ~fixed
            if not cut.any():
                break
            fixed |= cut
        return np.asarray(s[:, None] * tangents)

    def _least(self, x: Array, tangents: Array, s: Array, fixed: NDArray[np.bool_]) -> Array:
        """The s (n,) of least cost, those that are fixed as they are."""
        dof, w = self._manifold.dof, self._weights
        n = tangents[:, :dof] / self._scale
        step = np.diff(x[:, :dof] / self._scale, axis=0)
        before, after = (w * n[:-1] ** 2).sum(axis=1), (w * n[1:] ** 2).sum(axis=1)
        diagonal = np.full(len(x), 1e-9 * max(before.max(), after.max()))  # damps what nothing holds
        diagonal[:-1] += before
        diagonal[1:] += after
        beside = -(w * n[:-1] * n[1:]).sum(axis=1)
        right = np.zeros(len(x))
        right[:-1] += (w * n[:-1] * step).sum(axis=1)
        right[1:] -= (w * n[1:] * step).sum(axis=1)
        if self._pull is not None:
            away = self._pull[0] / self._scale - x[0, :dof] / self._scale
            diagonal[0] += self._pull[1] * float(n[0] @ n[0])
            right[0] += self._pull[1] * float(n[0] @ away)
        still = np.where(fixed, s, 0.0)
        right[:-1] -= beside * still[1:]
        right[1:] -= beside * still[:-1]
        beside = np.where(fixed[:-1] | fixed[1:], 0.0, beside)
        diagonal = np.where(fixed, 1.0, diagonal)
        right = np.where(fixed, s, right)
        return np.asarray(solveh_banded(np.vstack([np.append(0.0, beside), diagonal]), right))

    def _speed(self, x: Array) -> Array:
        """Of joints from knot to knot (n - 1, dof), as parts of their limits."""
        q = x[:, : self._manifold.dof] / self._scale
        return np.asarray(np.abs(np.diff(q, axis=0)) / self._times[:, None] * self._limited)

    def _lateness(self, x: Array) -> float:
        """How much longer the motion takes than it should [s]."""
        return float(self._times @ np.maximum(self._speed(x).max(axis=1) / SPEED_USED - 1.0, 0.0))

    def _room(self, x: Array, tangents: Array) -> tuple[Array, Array]:
        """How far each knot (n,) can move back and on along its tangent."""
        lower, upper = self._manifold.window_near(self._u, x)
        back = np.maximum(x - lower - KEPT_AWAY, 0.0)
        ahead = np.maximum(upper - x - KEPT_AWAY, 0.0)
        size = np.maximum(np.abs(tangents), 1e-12)
        on = (np.where(tangents > 0.0, ahead, back) / size).min(axis=1)
        off = (np.where(tangents > 0.0, back, ahead) / size).min(axis=1)
        return -np.minimum(off, LONGEST), np.minimum(on, LONGEST)
