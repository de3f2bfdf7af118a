"""All solutions at places of the path: the branches of a pose, or members spread over the intervals of a family."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from jacokin.arrays import Array
from jacokin.ik.planning.manifold import Manifold
from jacokin.model import angles
from jacokin.model.angles import TURN
from jacokin.model.pose_targets import FreeAxis

if TYPE_CHECKING:
    import pinocchio as pin

    from jacokin.ik.solver import IKSolver

TOGETHER = 256  # places whose members are corrected in one go


@dataclass(slots=True)
class Rung:
    """The solutions at one place of the path.

    Attributes:
        u: the place.
        x: (k, width) points within the limits and free of contact, if the solver rejects contact [rad].
        solutions: how many there are in all, whatever the limits.
        touching: pairs of shapes that kept solutions out.
    """

    u: float
    x: Array
    solutions: int
    touching: tuple[tuple[str, str], ...] = ()


class Rungs:
    """Makes rungs."""

    def __init__(self, solver: IKSolver, manifold: Manifold, step: float) -> None:
        """Prepare.

        Args:
            solver: what solves; it has a closed form.
            manifold: the configurations on the path.
            step: between members of a family, in the parameter [rad].
        """
        self._solver, self._manifold, self._step = solver, manifold, step
        self._robot, self._verifier = solver.robot, solver.verifier
        # Limited joints with more than a turn of room stand for several configurations.
        self._wide = np.flatnonzero(~self._robot.unlimited & (self._robot.upper - self._robot.lower > TURN))

    def make(self, places: Array, near: Array | None = None) -> list[Rung]:
        """The solutions at places (n,); of families also the members nearest to a configuration (dof,)."""
        manifold = self._manifold
        if not manifold.has_families:
            poses = manifold.path.at(places)
            return [self._branches(u, T) for u, T in zip(places.tolist(), poses, strict=True)]
        parts = [places[start : start + TOGETHER] for start in range(0, len(places), TOGETHER)]
        return [rung for part in parts for rung in self._of_families(part, near)]

    def _of_families(self, places: Array, near: Array | None) -> list[Rung]:
        """Members of families, all corrected together."""
        manifold = self._manifold
        found = [self._members(u, manifold.path.target(u), near) for u in places.tolist()]
        counts = [len(rows) for rows, _ in found]
        x, good = manifold.inside(np.repeat(places, counts), np.concatenate([rows for rows, _ in found]))
        ends = np.cumsum([0, *counts]).tolist()
        return [
            self._rung(u, x[start:end][good[start:end]], solutions)
            for u, (start, end), (_, solutions) in zip(places.tolist(), itertools.pairwise(ends), found, strict=True)
        ]

    def _branches(self, u: float, T: Array) -> Rung:
        """The branches of a pose (4, 4)."""
        rows = self._solver.closed_form().solve_all(T, self._robot.home)
        return self._rung(u, rows.q[self._verifier.reached_rows(rows)], len(rows))

    def _members(self, u: float, target: pin.SE3 | FreeAxis, near: Array | None) -> tuple[Array, int]:
        """Points (k, width) of a family, to about 1e-4 rad, and how many branches it has in all."""
        if not isinstance(target, FreeAxis) and self._manifold.path.free:  # six joints, at one value of the free angle
            branches = self._solver.closed_form().solve_all(target.homogeneous, self._robot.home)
            angle = float(self._manifold.path.window(np.array([u]))[0][0])
            rows = branches.q[self._verifier.reached_rows(branches)]
            return self._manifold.points(rows, target, angle), len(branches)
        family = self._solver.family(target)
        found = [np.empty((0, self._manifold.width))]
        for interval in family:
            parameters, rows = interval.spread(self._step)
            rows = angles.into_limits(rows, self._robot.lower, self._robot.upper)
            found.append(np.column_stack([rows, parameters]) if self._manifold.path.free else rows)
        if near is not None:  # the member nearest to it, and the configuration itself, which may be a member
            nearest = family.nearest(near)
            found.append(self._manifold.points(np.array([near] if nearest is None else [nearest, near]), target))
        return np.concatenate(found), family.branches

    def _rung(self, u: float, x: Array, solutions: int) -> Rung:
        """The rung of points (k, width): without those in contact, and with their copies."""
        touching: tuple[tuple[str, str], ...] = ()
        if self._verifier.rejects_contact:
            clear = np.ones(len(x), dtype=np.bool_)
            for row, point in enumerate(x):
                pairs = self._verifier.touching(point[: self._manifold.dof])
                if pairs:
                    clear[row], touching = False, tuple(pairs)
            x = x[clear]
        for joint in self._wide.tolist():
            x = self._copied(x, joint)
        return Rung(u, x, solutions, touching)

    def _copied(self, x: Array, joint: int) -> Array:
        """Points, and the same with turns of a joint that has room for it."""
        lower, upper = self._robot.lower[joint], self._robot.upper[joint]
        most = int((upper - lower) // TURN) + 1
        turn = TURN * (np.arange(x.shape[1]) == joint)
        copies = np.concatenate([x + turns * turn for turns in range(-most, most + 1)])
        return np.asarray(copies[(copies[:, joint] >= lower) & (copies[:, joint] <= upper)])
