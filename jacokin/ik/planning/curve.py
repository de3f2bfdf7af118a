"""Configurations anywhere along the chosen way, exactly on the path of the tool."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from jacokin.arrays import Array
from jacokin.ik.planning.manifold import Manifold

STRAY = 0.25  # [rad] from the straight joint motion between two knots; farther away is another branch
MOST_KNOTS = 400_000
SHORTEST = 1e-9  # of a line: two knots this near that are still far apart in a joint are a jump


class Curve:
    """A motion through knots; between them, the points of the manifold next to the motion from knot to knot."""

    def __init__(self, manifold: Manifold, u: Array, x: Array) -> None:
        """Take the knots.

        Args:
            manifold: the configurations on the path.
            u: (n,) places, rising.
            x: (n, width) points, circular coordinates counting their turns [rad].
        """
        self.manifold, self.u, self.x = manifold, u, x
        self._smooth = PchipInterpolator(u, x, axis=0) if manifold.has_families and len(u) > 1 else None

    @property
    def q(self) -> Array:
        """(n, dof) joint angles of the knots [rad]."""
        return self.x[:, : self.manifold.dof]

    def at(self, u: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Points (n, width) at places (n,), and where (n,) there is one on the same branch within the limits."""
        if self._smooth is not None:
            guess = np.asarray(self._smooth(u))
        else:
            guess = np.column_stack([np.interp(u, self.u, column) for column in self.x.T])
        x, good = self.manifold.inside(u, guess)
        good &= np.abs(x - guess).max(axis=1) <= STRAY
        lower, upper = self.manifold.window(u)
        dof = self.manifold.dof
        guess[:, :dof] = np.clip(guess[:, :dof], lower[:, :dof], upper[:, :dof])
        return np.where(good[:, None], x, guess), good

    def refined(self, u: Array, step: Array) -> tuple[Array, Array, NDArray[np.intp]]:
        """Knots between which no joint moves more than a step.

        Args:
            u: (n,) places that are to be knots, the old knots among them.
            step: (dof,) [rad].

        Returns:
            Places (m,), points (m, width), and numbers of the old intervals (0 ends at the second knot) in which
            there is no such way: joint angles jump, or leave the limits.
        """
        x, good = self.at(u)
        bad = set(self._intervals(u[~good]))
        while True:
            ratio = (np.abs(np.diff(x[:, : self.manifold.dof], axis=0)) / step).max(axis=1)
            wide = np.flatnonzero(ratio > 1.0)
            wide = wide[~np.isin(self._intervals(0.5 * (u[wide] + u[wide + 1])), list(bad))]
            jumps = wide[np.diff(u)[wide] < SHORTEST]
            bad.update(self._intervals(0.5 * (u[jumps] + u[jumps + 1])))
            wide = wide[np.diff(u)[wide] >= SHORTEST]
            if not wide.size:
                break
            if len(u) > MOST_KNOTS:
                bad.update(self._intervals(0.5 * (u[wide] + u[wide + 1])))
                break
            counts = np.minimum(np.ceil(ratio[wide]), 8.0).astype(int)
            new = np.concatenate(
                [
                    u[i] + (u[i + 1] - u[i]) * np.arange(1, count + 1) / (count + 1)
                    for i, count in zip(wide.tolist(), counts.tolist(), strict=True)
                ]
            )
            found, good = self.at(new)
            bad.update(self._intervals(new[~good]))
            order = np.argsort(np.concatenate([u, new]), kind="stable")
            u, x = np.concatenate([u, new])[order], np.concatenate([x, found])[order]
        return u, x, np.array(sorted(bad), dtype=np.intp)

    def _intervals(self, u: Array) -> list[int]:
        """Number of the old interval that each place lies in."""
        found = np.clip(np.searchsorted(self.u, u, side="left") - 1, 0, len(self.u) - 2)
        return [int(number) for number in found]
