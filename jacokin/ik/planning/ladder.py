"""Which solutions of neighbouring rungs follow each other.

Two solutions follow each other when the straight motion between them stays near the line of the tool: half way, the
tool misses the line by no more than `DEVIATION` and `TILT`, and by a little more where the parameter of a family
changes. What is on the line exactly is found later (`curve`).
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.ik.planning.manifold import Manifold
from jacokin.ik.planning.rungs import Rung, Rungs
from jacokin.model.angles import TURN

DEVIATION = 2e-3  # [m] of the tool from its line half way between two steps, the joints moving straight
TILT = 2e-2  # [rad] the same of its orientation
BEND = 0.15  # [m] and [rad], times the squared change of the parameter: how much more that may be
NEAR = 1.0  # [rad] no joint moves farther between two steps
MANY = 256  # pairs of solutions that are worth a look at single joints first
FREE_STEPS = 2.5  # steps of the parameter from one step of the path to the next, at most
TOO_FAST = 1e3  # cost of a second beyond a velocity limit: avoided wherever another way leads on


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

    def __init__(self, rungs: Rungs, manifold: Manifold, pace: Pace, step: float, *, keep: bool) -> None:
        """Prepare.

        Args:
            rungs: makes the rungs.
            manifold: the configurations on the path.
            pace: what motion costs.
            step: between members of a family, in the parameter [rad].
            keep: True when motions that need more than the time of their line are the last resort.
        """
        self.make, self.manifold, self.pace = rungs.make, manifold, pace
        self._step, self._keep = step, keep

    def links(self, rungs: Sequence[Rung]) -> list[Links]:
        """Which solutions of each rung, the second to the last, follow which of the rung before, and at what cost."""
        manifold = self.manifold
        pairs = [_Pairs(*np.nonzero(self._plausible(a, b))) for a, b in itertools.pairwise(rungs)]
        counts = [len(pair.first) for pair in pairs]
        start = np.concatenate([a.x[pair.first] for a, pair in zip(rungs, pairs, strict=False)])
        away = manifold.difference(
            start, np.concatenate([b.x[pair.second] for b, pair in zip(rungs[1:], pairs, strict=True)])
        )
        middles = np.repeat([0.5 * (a.u + b.u) for a, b in itertools.pairwise(rungs)], counts)
        good = np.abs(away[:, : manifold.dof]).max(axis=1, initial=0.0) <= NEAR
        position, tilt = manifold.chain.errors(start[good] + 0.5 * away[good], manifold.goal(middles[good]))
        more = np.zeros(len(position)) if manifold.column is None else BEND * away[good, manifold.column] ** 2
        good[good] = (position <= DEVIATION + more) & (tilt <= TILT + more)
        found = []
        ends = np.cumsum([0, *counts]).tolist()
        for (a, b), pair, (first, end) in zip(itertools.pairwise(rungs), pairs, itertools.pairwise(ends), strict=True):
            keep = good[first:end]
            cost = self.pace.cost(away[first:end][keep, : manifold.dof], a.u, b.u, self._keep)
            found.append(Links(pair.first[keep], pair.second[keep], cost))
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
