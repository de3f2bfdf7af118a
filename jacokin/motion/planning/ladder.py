"""The ladder graph of a path: rungs of all solutions at its places, and which of neighbouring rungs follow each other.

Two solutions follow each other when the straight motion between them stays near the line of the tool: half way, the
tool misses the line by no more than `DEVIATION` and `TILT`, and by a little more where the parameter of a family
changes. What is on the line exactly is found later (`manifold.Curve`).
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.ik.solver import IKSolver
from jacokin.model import angles
from jacokin.model.angles import TURN
from jacokin.model.poses import FreeAxis
from jacokin.motion.planning.manifold import Manifold

TOGETHER = 256  # places whose members are corrected in one go
DEVIATION = 2e-3  # [m] of the tool from its line half way between two steps, the joints moving straight
TILT = 2e-2  # [rad] the same of its orientation
BEND = 0.15  # [m] and [rad], times the squared change of the parameter: how much more that may be
NEAR = 1.0  # [rad] no joint moves farther between two steps
MANY = 256  # pairs of solutions that are worth a look at single joints first
FREE_STEPS = 2.5  # steps of the parameter from one step of the path to the next, at most
TOO_FAST = 1e3  # cost of a second beyond a velocity limit: avoided wherever another way leads on


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


@dataclass(slots=True)
class Links:
    """Which solutions of a rung follow which of the rung before.

    Attributes:
        first: (m,) numbers on the rung before.
        second: (m,) numbers on this rung.
        cost: (m,) of each; infinite where a closer look found that they do not follow each other.
    """

    first: NDArray[np.intp]
    second: NDArray[np.intp]
    cost: Array


class Ladder:
    """Makes the rungs of one path, and the links between neighbours."""

    def __init__(self, solver: IKSolver, manifold: Manifold, pace: Pace, step: float, *, keep: bool) -> None:
        """Prepare.

        Args:
            solver: what solves; it has a closed form.
            manifold: the configurations on the path.
            pace: what motion costs.
            step: between members of a family, in the parameter [rad].
            keep: True when motions that need more than the time of their line are the last resort.
        """
        self.manifold, self.pace = manifold, pace
        self._solver, self._step, self.keep = solver, step, keep
        self._robot, self.verifier = solver.robot, solver.verifier
        # Limited joints with more than a turn of room stand for several configurations.
        self._wide = np.flatnonzero(~self._robot.unlimited & (self._robot.upper - self._robot.lower > TURN))

    def make_rungs(self, places: Array, near: Array | None = None) -> list[Rung]:
        """The solutions at places (n,); of families also the members nearest to a configuration (dof,)."""
        manifold = self.manifold
        if not manifold.has_families:
            poses = manifold.path.at(places)
            return [self._branches(u, T) for u, T in zip(places.tolist(), poses, strict=True)]
        parts = [places[start : start + TOGETHER] for start in range(0, len(places), TOGETHER)]
        return [rung for part in parts for rung in self._family_rungs(part, near)]

    def _family_rungs(self, places: Array, near: Array | None) -> list[Rung]:
        """Members of families, all corrected together."""
        manifold = self.manifold
        found = [self._members(u, manifold.path.target(u), near) for u in places.tolist()]
        counts = [len(rows) for rows, _ in found]
        x, good = manifold.project(np.repeat(places, counts), np.concatenate([rows for rows, _ in found]))
        ends = np.cumsum([0, *counts]).tolist()
        return [
            self._rung(u, x[start:end][good[start:end]], solutions)
            for u, (start, end), (_, solutions) in zip(places.tolist(), itertools.pairwise(ends), found, strict=True)
        ]

    def _branches(self, u: float, T: Array) -> Rung:
        """The branches of a pose (4, 4)."""
        rows = self._solver.closed_form().solve_all(T, self._robot.home)
        return self._rung(u, rows.q[self.verifier.reached_rows(rows)], len(rows))

    def _members(self, u: float, target: pin.SE3 | FreeAxis, near: Array | None) -> tuple[Array, int]:
        """Points (k, width) of a family, to about 1e-4 rad, and how many branches it has in all."""
        if not isinstance(target, FreeAxis) and self.manifold.path.free:  # six joints, at one value of the free angle
            branches = self._solver.closed_form().solve_all(target.homogeneous, self._robot.home)
            angle = float(self.manifold.path.window(np.array([u]))[0][0])
            rows = branches.q[self.verifier.reached_rows(branches)]
            return self.manifold.points(rows, target, angle), len(branches)
        family = self._solver.family(target)
        found = [np.empty((0, self.manifold.width))]
        for interval in family:
            parameters, rows = interval.spread(self._step)
            rows = angles.into_limits(rows, self._robot.lower, self._robot.upper)
            found.append(np.column_stack([rows, parameters]) if self.manifold.path.free else rows)
        if near is not None:  # the member nearest to it, and the configuration itself, which may be a member
            nearest = family.nearest(near)
            found.append(self.manifold.points(np.array([near] if nearest is None else [nearest, near]), target))
        return np.concatenate(found), family.branches

    def _rung(self, u: float, x: Array, solutions: int) -> Rung:
        """The rung of points (k, width): without those in contact, and with their copies."""
        touching: tuple[tuple[str, str], ...] = ()
        if self.verifier.rejects_contact:
            clear = np.ones(len(x), dtype=np.bool_)
            for row, point in enumerate(x):
                pairs = self.verifier.touching(point[: self.manifold.dof])
                if pairs:
                    clear[row], touching = False, tuple(pairs)
            x = x[clear]
        for joint in self._wide.tolist():
            x = self._add_turns(x, joint)
        return Rung(u, x, solutions, touching)

    def _add_turns(self, x: Array, joint: int) -> Array:
        """Points, and the same with turns of a joint that has room for it."""
        lower, upper = self._robot.lower[joint], self._robot.upper[joint]
        most = int((upper - lower) // TURN) + 1
        turn = TURN * (np.arange(x.shape[1]) == joint)
        copies = np.concatenate([x + turns * turn for turns in range(-most, most + 1)])
        return np.asarray(copies[(copies[:, joint] >= lower) & (copies[:, joint] <= upper)])

    def link(self, rungs: Sequence[Rung]) -> list[Links]:
        """Which solutions of each rung, the second to the last, follow which of the rung before, and at what cost."""
        manifold = self.manifold
        pairs = [np.nonzero(self._plausible(a, b)) for a, b in itertools.pairwise(rungs)]
        counts = [len(first) for first, _ in pairs]
        start = np.concatenate([a.x[first] for a, (first, _) in zip(rungs, pairs, strict=False)])
        away = manifold.difference(
            start, np.concatenate([b.x[second] for b, (_, second) in zip(rungs[1:], pairs, strict=True)])
        )
        middles = np.repeat([0.5 * (a.u + b.u) for a, b in itertools.pairwise(rungs)], counts)
        good = np.abs(away[:, : manifold.dof]).max(axis=1, initial=0.0) <= NEAR
        position, tilt = manifold.chain.errors(start[good] + 0.5 * away[good], manifold.goal(middles[good]))
        more = np.zeros(len(position)) if manifold.column is None else BEND * away[good, manifold.column] ** 2
        good[good] = (position <= DEVIATION + more) & (tilt <= TILT + more)
        found = []
        ends = np.cumsum([0, *counts]).tolist()
        rows = zip(itertools.pairwise(rungs), pairs, itertools.pairwise(ends), strict=True)
        for (a, b), (first, second), (start_row, end_row) in rows:
            keep = good[start_row:end_row]
            cost = self.pace.cost(away[start_row:end_row][keep, : manifold.dof], a.u, b.u, self.keep)
            found.append(Links(first[keep], second[keep], cost))
        return found

    def _plausible(self, a: Rung, b: Rung) -> NDArray[np.bool_]:
        """(k, l) False where single coordinates already show that two solutions do not follow each other."""
        good = np.ones((len(a.x), len(b.x)), dtype=np.bool_)
        manifold = self.manifold
        most = np.full(manifold.width, NEAR)
        if manifold.column is not None:
            most[manifold.column] = FREE_STEPS * self._step
        many = len(a.x) * len(b.x) > MANY
        for column in range(manifold.width) if many else [] if manifold.column is None else [manifold.column]:
            away = b.x[None, :, column] - a.x[:, None, column]
            if manifold.circular[column]:
                away -= TURN * np.round(away / TURN)
            good &= np.abs(away) <= most[column]
        return good


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
        line = np.clip(u[:-1].astype(np.intp), 0, len(self.times) - 1)
        return np.asarray(np.maximum(np.diff(u) * self.times[line], 1e-9))

    def cost(self, away: Array, start: float, end: float, keep: bool) -> Array:
        """Of motions (m, dof) [rad] between two places: squared joint speeds as parts of their limits, times the time.

        More where the time does not suffice, if the speed is to be kept.
        """
        time = float(self.between(np.array([start, end]))[0])
        speed = np.abs(away) / self.scale / time
        cost = time * (speed**2).sum(axis=1)
        if keep:
            fastest = speed.max(axis=1, initial=0.0)
            cost += np.where(fastest > 1.0, TOO_FAST * time * fastest, 0.0)
        return np.asarray(cost)
