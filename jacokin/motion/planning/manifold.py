"""The configurations that keep the tool on its path, as points of coordinates x, and motions through them.

Coordinates are the joint angles; where the path has a free angle, it comes after them. A full pose on six joints leaves
points at each place of the path; a free angle or a seventh joint, one degree of redundancy, leaves curves: the
self-motions of the arm; both together leave surfaces.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from jacokin.arrays import Array
from jacokin.kernels.tolerances import CLOSURE
from jacokin.model.angles import TURN
from jacokin.model.many_configurations import Chain, TargetRows
from jacokin.model.poses import FreeAxis
from jacokin.model.robot import Robot
from jacokin.motion.path import CartesianPath

TOO_FAST = 1e3  # cost of a second beyond a velocity limit: avoided wherever another way leads on
SHORTEST = 1e-9  # of a line: two knots this near that are still far apart in a joint are a jump
LEAST_WEIGHT = 1e-4  # of the looser tolerance in least squares: what is tight is then met a hundred times as well


class Manifold:
    """One arm on one path.

    Attributes:
        path: the path of the tool.
        chain: the kinematics of the arm.
        dof: number of joints.
        width: number of coordinates.
        parameters: the coordinates that are free at each place: none of points, one of curves, two of surfaces.
        circular: (width,) coordinates that are the same after a turn.
        lower: (dof,) limits of the joints [rad].
        upper: (dof,) [rad].
        tolerances: position [m] and orientation [rad] errors that are none on fewer coordinates than six.
    """

    def __init__(
        self,
        robot: Robot,
        chain: Chain,
        path: CartesianPath,
        limit_snap: float,
        parameter: str | None = None,
        *,
        tolerances: tuple[float, float] = (CLOSURE, CLOSURE),
    ) -> None:
        """Prepare.

        Args:
            robot: the arm.
            chain: its kinematics up to the tool.
            path: the path of the tool.
            limit_snap: a joint past its limit by at most this is put on the limit [rad].
            parameter: the joint that is the parameter of the curves of a pose; None where poses have none.
            tolerances: position [m] and orientation [rad] errors that are none on fewer coordinates than six: these
                reach their targets only as nearly as angles are written in their file.
        """
        self.path, self.chain, self.dof = path, chain, robot.dof
        self.width = self.dof + path.free
        self.parameters = [] if parameter is None else [robot.joint_index(parameter)]
        if path.free and self.dof >= 6:  # fewer joints about a free axis have points
            self.parameters.append(self.dof)
        self.circular = np.array([*robot.unlimited, *[True] * path.free])
        self.lower, self.upper, self._snap = robot.lower, robot.upper, limit_snap
        self.tolerances = tolerances
        first, second = (max(min(tolerances) / each, LEAST_WEIGHT) for each in tolerances)
        self._weight = (first, second) if self.width < 6 else (1.0, 1.0)

    @property
    def has_curves(self) -> bool:
        """Whether there are curves of configurations at each place, or surfaces."""
        return bool(self.parameters)

    @property
    def has_surfaces(self) -> bool:
        """Whether there are surfaces of configurations at each place."""
        return len(self.parameters) > 1

    def points(self, q: Array, target: pin.SE3 | FreeAxis, parameter: float = 0.0) -> Array:
        """Coordinates (n, width) of configurations (n, dof) at a target; `parameter` where a pose leaves none."""
        if not self.path.free:
            return q
        angles = np.full(len(q), parameter)
        if isinstance(target, FreeAxis):
            angles = np.array([target.parameter_of(rotation) for rotation in self.chain.placements(q)[0][:, :3, :3]])
        return np.column_stack([q, angles])

    def goal(self, u: Array) -> TargetRows:
        """What the tool is to reach at places (n,)."""
        return TargetRows(self.path.at(u), self.path.axes(u) if self.path.free else None)

    def difference(self, first: Array, second: Array) -> Array:
        """From points (m, width) to others [rad], the short way round."""
        away = second - first
        away[:, self.circular] -= TURN * np.round(away[:, self.circular] / TURN)
        return away

    def window(self, u: Array) -> tuple[Array, Array]:
        """Least and largest value (n, width) of each coordinate at places (n,)."""
        lower, upper = np.tile(self.lower, (len(u), 1)), np.tile(self.upper, (len(u), 1))
        if self.path.free:
            low, high, full = self.path.window(u)
            lower = np.column_stack([lower, np.where(full, -np.inf, low)])
            upper = np.column_stack([upper, np.where(full, np.inf, high)])
        return lower, upper

    def project(self, u: Array, x: Array) -> tuple[Array, NDArray[np.bool_]]:
        """The points (n, width) on the path within the limits that are nearest to given ones, and where there are any.

        Coordinates that would pass a limit stay on it.
        """
        goal = self.goal(u)
        found, worst = self.chain.close(x, goal, weight=self._weight)
        lower, upper = self.window_near(u, found)
        within = np.clip(found, lower, upper)
        beyond = np.abs(within - found)
        held = np.zeros(x.shape, dtype=np.bool_)
        for _ in self.parameters:  # on surfaces, one that is held may lead another one past its limit
            rows = np.flatnonzero(((beyond > self._snap).any(axis=1)) & (beyond.max(axis=1) < 0.1))
            if rows.size:
                held[rows] |= beyond[rows] > 0.0
                found[rows], worst[rows] = self.chain.close(within[rows], goal.some(rows), held[rows], self._weight)
                within[rows] = np.clip(found[rows], lower[rows], upper[rows])
                beyond = np.abs(within - found)
        if self.width < 6:
            position, orientation = self.chain.errors(within, goal)
            near = (position <= self.tolerances[0]) & (orientation <= self.tolerances[1])
            return within, near & (beyond.max(axis=1) <= self._snap)
        good = (worst <= CLOSURE) & (beyond.max(axis=1) <= self._snap)
        snapped = np.flatnonzero(good & (beyond.max(axis=1) > 0.0))
        if snapped.size:
            errors = self.chain.errors(within[snapped], goal.some(snapped))
            good[snapped] = np.maximum(*errors) <= 100.0 * CLOSURE
        return within, good

    def tangents(self, u: Array, x: Array) -> Array:
        """Unit vectors (n, k, width) along the curves or surfaces of configurations at points, at right angles."""
        _, jacobian = self.chain.linearise(x, self.goal(u))
        return np.asarray(np.linalg.svd(jacobian)[2][:, 6:])

    def window_near(self, u: Array, x: Array) -> tuple[Array, Array]:
        """`window`, the range of the free angle in the copies nearest to points."""
        lower, upper = self.window(u)
        if self.path.free:
            bounded = np.isfinite(lower[:, -1])
            middle = 0.5 * (lower[bounded, -1] + upper[bounded, -1])
            turns = TURN * np.round((x[bounded, -1] - middle) / TURN)
            lower[bounded, -1] += turns
            upper[bounded, -1] += turns
        return lower, upper


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
        self._gone = manifold.path.gone(u)
        rising = np.append(True, np.diff(self._gone) > 1e-11)  # [m] nearer ones are one
        several = manifold.has_curves and rising.sum() > 1
        self._smooth = PchipInterpolator(self._gone[rising], x[rising], axis=0) if several else None

    @property
    def q(self) -> Array:
        """(n, dof) joint angles of the knots [rad]."""
        return self.x[:, : self.manifold.dof]

    def at(self, u: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Points (n, width) at places (n,), and where (n,) there is one on the same branch within the limits."""
        gone = self.manifold.path.gone(u)
        if self._smooth is not None:
            guess = np.asarray(self._smooth(gone))
        else:
            guess = np.column_stack([np.interp(gone, self._gone, column) for column in self.x.T])
        x, good = self.manifold.project(u, guess)
        good &= np.abs(x - guess).max(axis=1) <= 0.25  # [rad] farther away is another branch
        lower, upper = self.manifold.window(u)
        dof = self.manifold.dof
        guess[:, :dof] = np.clip(guess[:, :dof], lower[:, :dof], upper[:, :dof])
        return np.where(good[:, None], x, guess), good

    def refine(self, u: Array, step: Array) -> tuple[Array, Array, NDArray[np.intp]]:
        """Knots between which no joint moves more than a step.

        Args:
            u: (n,) places that are to be knots, the old knots among them.
            step: (dof,) [rad].

        Returns:
            Places (m,), points (m, width), and numbers of the old intervals (0 ends at the second knot) in which
            there is no such way: joint angles jump, or leave the limits.
        """
        x, good = self.at(u)
        bad = set(self.intervals(u[~good]).tolist())
        while True:
            ratio = (np.abs(np.diff(x[:, : self.manifold.dof], axis=0)) / step).max(axis=1)
            wide = np.flatnonzero(ratio > 1.0)
            wide = wide[~np.isin(self.intervals(0.5 * (u[wide] + u[wide + 1])), list(bad))]
            jumps = wide[np.diff(u)[wide] < SHORTEST]
            bad.update(self.intervals(0.5 * (u[jumps] + u[jumps + 1])).tolist())
            wide = wide[np.diff(u)[wide] >= SHORTEST]
            if not wide.size:
                break
            if len(u) > 400_000:
                bad.update(self.intervals(0.5 * (u[wide] + u[wide + 1])).tolist())
                break
            counts = np.minimum(np.ceil(ratio[wide]), 8.0).astype(int)
            new = np.concatenate(
                [
                    u[i] + (u[i + 1] - u[i]) * np.arange(1, count + 1) / (count + 1)
                    for i, count in zip(wide.tolist(), counts.tolist(), strict=True)
                ]
            )
            found, good = self.at(new)
            bad.update(self.intervals(new[~good]).tolist())
            order = np.argsort(np.concatenate([u, new]), kind="stable")
            u, x = np.concatenate([u, new])[order], np.concatenate([x, found])[order]
        return u, x, np.array(sorted(bad), dtype=np.intp)

    def intervals(self, u: Array) -> NDArray[np.intp]:
        """Number (n,) of the interval between knots that each place (n,) lies in; 0 ends at the second knot."""
        return np.asarray(np.clip(np.searchsorted(self.u, u, side="left") - 1, 0, len(self.u) - 2))


@dataclass(frozen=True, slots=True)
class Pace:
    """What motion costs.

    Attributes:
        times: (lines,) how long each line takes [s].
        velocity: (dof,) limits [rad/s].
    """

    times: Array
    velocity: Array

    @property
    def scale(self) -> Array:
        """(dof,) the velocity limits, 1 where there is none [rad/s]."""
        return np.where(np.isfinite(self.velocity), self.velocity, 1.0)

    def between(self, u: Array) -> Array:
        """Times (n - 1,) from each of the places (n,) to the next [s]."""
        ends = np.append(0.0, np.cumsum(self.times))
        return np.asarray(np.maximum(np.diff(np.interp(u, np.arange(len(ends)), ends)), 1e-9))
