"""The best way up the ladder that also passes a closer look: between its steps, for gaps, contact and speed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.model import angles
from jacokin.motion.planning.ladder import TOO_FAST, Pace, Rung
from jacokin.motion.planning.manifold import Curve, Manifold
from jacokin.motion.planning.search import Search, Way
from jacokin.motion.planning.smoothing import Smoothing

if TYPE_CHECKING:
    from jacokin.ik.solver import IKSolver

RESOLUTION = 0.02  # [rad] no joint moves farther between two places at which contact is looked for
AT_START = 1e-3  # [rad] a solution this near to `start` is the one the arm is on
FROM_SEED = 0.1  # cost of a first solution's squared distance to the seed, beside that of the motion
SMOOTHINGS = 4  # times a way is smoothed, with what got worse by it left alone
MOST_ROUNDS = 100  # times the way is changed because a closer look found a gap or an obstacle
MOST_FASTER = 12  # times another way is tried because joints would be too fast on the best one
SPEED_ROUNDING = 1e-9  # relative to a velocity limit


class Begin:
    """Cost of beginning at a solution.

    Attributes:
        near: (dof,) where the path should begin [rad].
        exactly: whether it must begin there.
    """

    def __init__(self, manifold: Manifold, near: Array, pace: Pace, *, exactly: bool) -> None:
        """Take where the path should begin."""
        self.near, self.exactly = near, exactly
        self._manifold, self._scale = manifold, pace.scale

    def __call__(self, rung: Rung) -> Array:
        """(k,) for the solutions of the first rung; infinite where the arm cannot be."""
        q = rung.x[:, : self._manifold.dof]
        away = q - angles.nearest_copy(self.near, q, self._manifold.circular[: self._manifold.dof])
        if self.exactly:  # the nearest one of those that are near enough
            farthest = np.abs(away).max(axis=1, initial=0.0)
            return np.where(farthest <= min(AT_START, farthest.min(initial=np.inf)), 0.0, np.inf)
        return np.asarray(FROM_SEED * ((away / self._scale) ** 2).sum(axis=1))


@dataclass(frozen=True, slots=True)
class Found:
    """A way that passed every closer look.

    Attributes:
        curve: the way, finely.
        reached: the place where it ends.
        blocked: shapes that stood in the way of a better one.
    """

    curve: Curve
    reached: float
    blocked: str


class _Look(NamedTuple):
    """What a closer look at a way found."""

    wrong: list[int]
    """Numbers of the intervals with gaps or contact, the last first."""
    touched: dict[int, str]
    """Those with contact, and the names of what touches."""
    curve: Curve
    """The way, finely."""


class Climb:
    """Changes the way until it passes."""

    def __init__(self, search: Search, solver: IKSolver, begin: Begin, dt: float, *, keep: bool) -> None:
        """Prepare.

        Args:
            search: finds the best way.
            solver: knows what touches.
            begin: where the way begins.
            dt: control step [s].
            keep: True when the speed of the path is kept.
        """
        self._search, self._verifier, self._begin, self._keep = search, solver.verifier, begin, keep
        self._manifold, self._pace = search.ladder.manifold, search.ladder.pace
        self._ticks = self._manifold.path.ticks(self._pace.times, dt)
        self._step = np.minimum(self._pace.velocity * dt, RESOLUTION)
        self._fastest = self._pace.velocity * dt * (1.0 + SPEED_ROUNDING)
        self._dt = dt

    def found(self) -> Found | None:
        """The best way; None when it does not even begin."""
        search, blocked = self._search, ""
        best: tuple[float, Found] | None = None
        faster = 0
        for rounds in range(MOST_ROUNDS):
            way = search.best()
            if not way.chosen:
                return None
            curve = self._curve(way.chosen)
            if len(way.chosen) == 1:
                return Found(curve, 0.0, blocked)
            look = self._looked_at(curve)
            blocked = next(iter(look.touched.values()), blocked)
            if not look.wrong:
                done = Found(self._smoothed(curve) or look.curve, float(curve.u[-1]), blocked)
                late, dearer = self._too_fast(done.curve, way, curve) if self._keep else (0.0, False)
                if best is None or (done.reached, -late) > (best[1].reached, -best[0]):
                    best = late, done
                faster += 1
                if not dearer or faster > MOST_FASTER:
                    return best[1]
            elif rounds == MOST_ROUNDS - 1 and best is None:
                last = look.wrong[-1]
                return Found(self._curve(way.chosen[: last + 1]), float(curve.u[last]), blocked)
            for interval in look.wrong:  # from the end: numbers of the others stay as they are
                if interval not in look.touched and search.can_halve(interval + 1):
                    search.halve(interval + 1)
                else:
                    search.cut(interval + 1, way.chosen[interval], way.chosen[interval + 1])
        return None if best is None else best[1]

    def _too_fast(self, found: Curve, way: Way, curve: Curve) -> tuple[float, bool]:
        """How long joints would be too fast [s], weighted by how much; and whether the search now knows more of that.

        The steps of the way in which they are become dearer in it.
        """
        ticks = self._ticks[(self._ticks >= found.u[0]) & (self._ticks <= found.u[-1])]
        q = found.q[np.searchsorted(found.u, ticks)]
        ratio = (np.abs(np.diff(q, axis=0)) / self._fastest).max(axis=1)
        late = np.flatnonzero(ratio > 1.0)
        interval = np.clip(np.searchsorted(curve.u, ticks[late + 1], side="left") - 1, 0, len(curve.u) - 2)
        dearer = False
        for number in np.unique(interval).tolist():
            cost = TOO_FAST * self._dt * float(ratio[late[interval == number]].sum())
            dearer |= self._search.charge(number + 1, way.chosen[number], way.chosen[number + 1], cost)
        return float(ratio[late].sum()) * self._dt, dearer

    def _looked_at(self, curve: Curve) -> _Look:
        inside = self._ticks[(self._ticks > curve.u[0]) & (self._ticks < curve.u[-1])]
        u, x, bad = curve.refined(np.unique(np.concatenate([curve.u, inside])), self._step)
        touched = self._touched(curve, u, x[:, : self._manifold.dof], bad)
        return _Look(sorted({*bad.tolist(), *touched}, reverse=True), touched, Curve(self._manifold, u, x))

    def _smoothed(self, curve: Curve) -> Curve | None:
        """The way, finely, after its knots moved to where joints move less; None when nothing better is free."""
        if not self._manifold.has_families:
            return None
        begin = self._begin
        smoothing = Smoothing(self._manifold, self._pace, curve.u, None if begin.exactly else (begin.near, FROM_SEED))
        pinned = np.zeros(len(curve.u), dtype=np.bool_)
        for _ in range(SMOOTHINGS):
            look = self._looked_at(Curve(self._manifold, curve.u, smoothing.improved(curve.x, pinned)))
            if not look.wrong:
                return look.curve
            for interval in look.wrong:
                pinned[max(interval - 2, 0) : interval + 4] = True
        return None

    def _curve(self, chosen: list[int]) -> Curve:
        """The knots of a way, turns of circular coordinates counted from where the path should begin."""
        rungs, manifold = self._search.rungs[: len(chosen)], self._manifold
        x = np.array([rung.x[node] for rung, node in zip(rungs, chosen, strict=True)])
        first, joints = x[0].copy(), slice(manifold.dof)
        first[joints] = angles.nearest_copy(first[joints], self._begin.near, manifold.circular[joints])
        unrolled = np.vstack([first, first + np.cumsum(manifold.difference(x[:-1], x[1:]), axis=0)])
        x = np.where(manifold.circular, unrolled, x)
        return Curve(manifold, np.array([rung.u for rung in rungs]), x)

    def _touched(self, curve: Curve, u: Array, q: Array, bad: NDArray[np.intp]) -> dict[int, str]:
        """Numbers of intervals of the curve in which shapes touch, with their names, where contact is rejected."""
        if not self._verifier.rejects_contact:
            return {}
        found: dict[int, str] = {}
        interval = np.clip(np.searchsorted(curve.u, u, side="left") - 1, 0, len(curve.u) - 2)
        for row, index in enumerate(interval.tolist()):
            if index in found or index in bad:
                continue
            pairs = self._verifier.touching(q[row])
            if pairs:
                found[index] = ", ".join(f"{a} and {b}" for a, b in pairs[:2])
        return found
