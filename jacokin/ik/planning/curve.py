"""Joint angles anywhere along the chosen way, exactly on the path of the tool."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from jacokin.arrays import Array
from jacokin.ik.planning.cartesian import CartesianPath
from jacokin.ik.planning.ladder import Ladder
from jacokin.model.robot import Robot

CLOSURE = 1e-9  # [m] and [rad] an exact configuration misses its pose by less
STRAY = 0.25  # [rad] from the straight joint motion between two knots; farther away is another branch
MOST_KNOTS = 400_000
SHORTEST = 1e-9  # of a line: two knots this near that are still far apart in a joint are a jump


class Curve:
    """A joint path through knots; between them, the configurations that reach the path of the tool."""

    def __init__(self, ladder: Ladder, robot: Robot, u: Array, q: Array, parameter: Array, limit_snap: float) -> None:
        """Take the knots.

        Args:
            ladder: knows the path of the tool and the kinematics.
            robot: the arm.
            u: (n,) places, rising.
            q: (n, dof) configurations, unlimited joints counting their turns [rad].
            parameter: (n,) free angle, counting its turns [rad].
            limit_snap: a joint past its limit by at most this is put on the limit [rad].
        """
        self.u, self.q = u, q
        self._ladder, self._robot, self._snap = ladder, robot, limit_snap
        turning = ladder.path.axis is not None and np.ptp(parameter) > 0.0
        self._smooth = PchipInterpolator(u, parameter) if turning else None
        self._constant = float(parameter[0])

    def parameter(self, u: Array) -> Array:
        """Free angle (n,) at places (n,) [rad]."""
        if self._smooth is None:
            return np.full(len(u), self._constant)
        return np.asarray(self._smooth(u))

    def poses(self, u: Array) -> Array:
        """Poses of the tool (n, 4, 4) at places (n,)."""
        return self.path.at(u, self.parameter(u))

    @property
    def path(self) -> CartesianPath:
        """The path of the tool."""
        return self._ladder.path

    def at(self, u: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Configurations (n, dof) at places (n,), and where (n,) there is one on the same branch within the limits."""
        guess = np.column_stack([np.interp(u, self.u, column) for column in self.q.T])
        wanted = self.poses(u)
        q, worst = self._ladder.chain.closed(guess, wanted)
        lower, upper = self._robot.lower, self._robot.upper
        inside = np.clip(q, lower, upper)
        moved = np.abs(inside - q).max(axis=1)
        good = (worst <= CLOSURE) & (np.abs(q - guess).max(axis=1) <= STRAY) & (moved <= self._snap)
        snapped = good & (moved > 0.0)
        if snapped.any():
            errors = self._ladder.chain.errors(inside[snapped], wanted[snapped])
            good[snapped] = np.maximum(*errors) <= 100.0 * CLOSURE
        return np.where(good[:, None], inside, np.clip(guess, lower, upper)), good

    def refined(self, u: Array, step: Array) -> tuple[Array, Array, NDArray[np.intp]]:
        """Knots between which no joint moves more than a step.

        Args:
            u: (n,) places that are to be knots, the old knots among them.
            step: (dof,) [rad].

        Returns:
            Places (m,), configurations (m, dof), and numbers of the old intervals (0 ends at the second knot) in which
            there is no such way: joint angles jump, or leave the limits.
        """
        q, good = self.at(u)
        bad = set(self._intervals(u[~good]))
        while True:
            ratio = (np.abs(np.diff(q, axis=0)) / step).max(axis=1)
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
            u, q = np.concatenate([u, new])[order], np.concatenate([q, found])[order]
        return u, q, np.array(sorted(bad), dtype=np.intp)

    def _intervals(self, u: Array) -> list[int]:
        """Number of the old interval that each place lies in."""
        found = np.clip(np.searchsorted(self.u, u, side="left") - 1, 0, len(self.u) - 2)
        return [int(number) for number in found]
