"""All solutions at steps along the path, and which solutions of neighbouring steps follow each other.

Two solutions follow each other when the straight joint motion between them stays near the line of the tool: half way,
the tool misses the line by no more than `DEVIATION` and `TILT`. What is on the line exactly is found later (`curve`).
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.ik.planning.cartesian import CartesianPath
from jacokin.ik.planning.chain import Chain
from jacokin.model.angles import TURN

if TYPE_CHECKING:
    from jacokin.ik.solver import IKSolver

DEVIATION = 2e-3  # [m] of the tool from its line half way between two steps, the joints moving straight
TILT = 2e-2  # [rad] the same of its orientation
NEAR = 1.0  # [rad] no joint moves farther between two steps
MANY = 256  # pairs of solutions that are worth a look at single joints first
FREE_STEPS = 2.5  # steps of the free angle from one step of the path to the next, at most


@dataclass(slots=True)
class Rung:
    """The solutions at one place of the path.

    Attributes:
        u: the place.
        q: (k, dof) within the limits and free of contact, if the solver rejects contact [rad].
        parameter: (k,) free angle of each [rad].
        solutions: how many there are in all, whatever the limits.
        touching: pairs of shapes that kept solutions out.
    """

    u: float
    q: Array
    parameter: Array
    solutions: int
    touching: tuple[tuple[str, str], ...] = ()


class _Pairs(NamedTuple):
    """Numbers of solutions on two rungs."""

    first: NDArray[np.intp]
    second: NDArray[np.intp]


@dataclass(slots=True)
class Links:
    """Which solutions of a rung follow which of the rung before.

    Attributes:
        first: (m,) numbers on the rung before.
        second: (m,) numbers on this rung.
        cost: (m,) of each.
        alive: (m,) False where a closer look found that they do not follow each other.
    """

    first: NDArray[np.intp]
    second: NDArray[np.intp]
    cost: Array
    alive: NDArray[np.bool_] = field(init=False)

    def __post_init__(self) -> None:
        """All are taken for good first."""
        self.alive = np.ones(len(self.first), dtype=np.bool_)


class Ladder:
    """Makes rungs and links."""

    def __init__(
        self, solver: IKSolver, path: CartesianPath, times: Array, velocity: Array, free_step: float, *, keep: bool
    ) -> None:
        """Prepare.

        Args:
            solver: what solves; it has a closed form.
            path: the path of the tool.
            times: (lines,) how long each line takes [s].
            velocity: (dof,) limits [rad/s].
            free_step: between values of the free angle that are tried [rad].
            keep: True when motions that need more than the time of their line are the last resort.
        """
        robot = solver.robot
        self.path = path
        self.unlimited = robot.unlimited
        self.chain = Chain(solver.closed_form().chain)
        self._form = solver.closed_form()
        self._verifier = solver.verifier
        self._home = robot.home
        self.times = times
        self._velocity = velocity
        self._scale = np.where(np.isfinite(velocity), velocity, 1.0)
        self._free_step = free_step
        self._keep = keep
        # Limited joints with more than a turn of room stand for several configurations.
        self._wide = np.flatnonzero(~robot.unlimited & (robot.upper - robot.lower > TURN))
        self._lower, self._upper = robot.lower, robot.upper

    def rungs(self, places: Array) -> list[Rung]:
        """All solutions at places (n,)."""
        parameters = [self.path.parameters(u, self._free_step) for u in places.tolist()]
        counts = [len(values) for values in parameters]
        poses = self.path.at(np.repeat(places, counts), np.concatenate(parameters))
        ends = np.cumsum(counts)
        return [
            self._rung(u, poses[end - len(values) : end], values)
            for u, values, end in zip(places.tolist(), parameters, ends.tolist(), strict=True)
        ]

    def _rung(self, u: float, poses: Array, values: Array) -> Rung:
        """All solutions at one place, for poses (k, 4, 4) at values (k,) of the free angle [rad]."""
        found: list[Array] = []
        parameters: list[float] = []
        solutions = 0
        touching: tuple[tuple[str, str], ...] = ()
        for T, parameter in zip(poses, values.tolist(), strict=True):
            rows = self._form.solve_all(T, self._home)
            solutions += len(rows)
            for q in rows.q[self._verifier.reached_rows(rows)]:
                pairs = self._verifier.touching(q) if self._verifier.rejects_contact else []
                if pairs:
                    touching = tuple(pairs)
                    continue
                copies = self._copies(q)
                found.extend(copies)
                parameters.extend([parameter] * len(copies))
        q = np.array(found).reshape(-1, len(self._home))
        return Rung(u, q, np.array(parameters), solutions, touching)

    def _copies(self, q: Array) -> list[Array]:
        """The configuration, and the same with turns of joints that have room for it."""
        copies = [q]
        for joint in self._wide.tolist():
            low = int(np.ceil((self._lower[joint] - q[joint]) / TURN))
            high = int(np.floor((self._upper[joint] - q[joint]) / TURN))
            shifted = []
            for copy in copies:
                for turns in range(low, high + 1):
                    other = copy.copy()
                    other[joint] += turns * TURN
                    if self._lower[joint] <= other[joint] <= self._upper[joint]:
                        shifted.append(other)
            copies = shifted
        return copies

    def difference(self, first: Array, second: Array) -> Array:
        """From one configuration to another (m, dof) [rad], unlimited joints the short way round."""
        away = second - first
        away[:, self.unlimited] -= TURN * np.round(away[:, self.unlimited] / TURN)
        return away

    def turned(self, a: Rung, b: Rung, first: NDArray[np.intp], second: NDArray[np.intp]) -> Array:
        """Change of the free angle (m,) [rad], the short way round where it may go round and round."""
        away = b.parameter[second] - a.parameter[first]
        if self.path.turns(min(int(a.u), self.path.lines - 1)):
            away -= TURN * np.round(away / TURN)
        return np.asarray(away)

    def links(self, rungs: Sequence[Rung]) -> list[Links]:
        """Which solutions of each rung, the second to the last, follow which of the rung before, and at what cost."""
        pairs = [_Pairs(*np.nonzero(self._plausible(a, b))) for a, b in itertools.pairwise(rungs)]
        ends = np.cumsum([len(pair.first) for pair in pairs])
        away = self.difference(
            np.concatenate([a.q[pair.first] for a, pair in zip(rungs, pairs, strict=False)]),
            np.concatenate([b.q[pair.second] for b, pair in zip(rungs[1:], pairs, strict=True)]),
        )
        start = np.concatenate([a.q[pair.first] for a, pair in zip(rungs, pairs, strict=False)])
        angle = np.concatenate(
            [
                a.parameter[pair.first] + 0.5 * self.turned(a, b, pair.first, pair.second)
                for (a, b), pair in zip(itertools.pairwise(rungs), pairs, strict=True)
            ]
        )
        middles = [0.5 * (a.u + b.u) for a, b in itertools.pairwise(rungs)]
        wanted = self.path.at(np.repeat(middles, [len(pair.first) for pair in pairs]), angle)
        good = np.abs(away).max(axis=1, initial=0.0) <= NEAR
        position, tilt = self.chain.errors(start[good] + 0.5 * away[good], wanted[good])
        good[good] = (position <= DEVIATION) & (tilt <= TILT)
        found = []
        for (a, b), pair, end in zip(itertools.pairwise(rungs), pairs, ends.tolist(), strict=True):
            some = slice(end - len(pair.first), end)
            keep = good[some]
            found.append(Links(pair.first[keep], pair.second[keep], self._cost(away[some][keep], a.u, b.u)))
        return found

    def _plausible(self, a: Rung, b: Rung) -> NDArray[np.bool_]:
        """(k, l) False where single joints already show that two solutions do not follow each other."""
        good = np.ones((len(a.q), len(b.q)), dtype=np.bool_)
        if self.path.axis is not None:
            away = b.parameter[None, :] - a.parameter[:, None]
            if self.path.turns(min(int(a.u), self.path.lines - 1)):
                away -= TURN * np.round(away / TURN)
            good &= np.abs(away) <= FREE_STEPS * self._free_step
        if len(a.q) * len(b.q) > MANY:
            for joint in np.flatnonzero(~self.unlimited).tolist():
                good &= np.abs(b.q[None, :, joint] - a.q[:, None, joint]) <= NEAR
        return good

    def _cost(self, away: Array, start: float, end: float) -> Array:
        """Squared joint speeds as parts of their limits, times the time; more where the time does not suffice."""
        line = min(int(start), self.path.lines - 1)
        time = max((end - start) * float(self.times[line]), 1e-9)
        speed = np.abs(away) / self._scale / time
        cost = time * (speed**2).sum(axis=1)
        if self._keep:
            cost += np.where(
                speed.max(axis=1, initial=0.0) > 1.0, TOO_FAST * time * speed.max(axis=1, initial=0.0), 0.0
            )
        return np.asarray(cost)


TOO_FAST = 1e3  # cost of a second beyond a velocity limit: avoided wherever another way leads on
