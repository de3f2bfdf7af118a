"""The ladder graph of a path, and the best way up that also passes a closer look: for gaps, contact and speed.

`Ladder` makes rungs of all solutions at places of the path, and tells which of neighbouring rungs follow each other.
Two solutions do when the straight motion between them stays near the line of the tool: half way, the tool misses the
line by no more than `MISSED` and `TILTED`, and by a little more where the parameter of a curve changes. What is on
the line exactly is found later (`manifold.Curve`).

`PathSearch` finds the cheapest way by dynamic programming, and makes steps smaller where no way leads on. `Climb` looks
at that way closely and cuts what does not hold, until a way passes.
"""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.ik.solutions.curve_set import CurveSet
from jacokin.ik.solver import IKSolver
from jacokin.kernels.library import Call
from jacokin.kernels.rung_links import LinkNumber, link_rungs, make_link_work
from jacokin.model import angles
from jacokin.model.poses import FreeAxis
from jacokin.model.robot import copies_counted
from jacokin.motion.clearance import RESOLUTION
from jacokin.motion.planning.manifold import TOO_FAST, Curve, Manifold, Pace
from jacokin.motion.planning.smoothing import Smoothing
from jacokin.motion.timing import sample_lines

PLACES_TOGETHER = 256  # places whose members are corrected in one go
MISSED = 2e-3  # [m] of the tool from its line half way between two steps, the joints moving straight
TILTED = 2e-2  # [rad] the same of its orientation
NEAR = 1.0  # [rad] no joint moves farther between two steps

FINEST = 2e-5  # [m] no step of the path is made smaller
FROM_SEED = 0.1  # cost of a first solution's squared distance to the seed, beside that of the motion
MOST_ROUNDS = 100  # times the way is changed because a closer look found a gap or an obstacle


@dataclass(slots=True)
class Rung:
    """The solutions at one place of the path.

    Attributes:
        u: the place.
        x: (k, width) points within the limits and free of contact, if the solver rejects contact [rad].
        solutions: how many there are in all, whatever the limits.
        alike: (k,) rising numbers, the same for those points that differ by whole turns.
        touching: pairs of shapes that kept solutions out.
    """

    u: float
    x: Array
    solutions: int
    alike: NDArray[np.intp]
    touching: tuple[tuple[str, str], ...] = ()

    @property
    def firsts(self) -> NDArray[np.intp]:
        """Numbers (m,) of the first points of those that are alike."""
        return np.flatnonzero(np.diff(self.alike, prepend=-1))

    def turns(self, joints: NDArray[np.intp]) -> NDArray[np.intp]:
        """Whole turns (k, n) of some joints (n,) from the first of the points that are alike."""
        q = self.x[:, joints]
        return np.rint((q - q[self.firsts][self.alike]) / angles.TURN).astype(np.intp)


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


class _Members(NamedTuple):
    """Points of the set of one place, to about 1e-3 rad."""

    x: Array
    """(k, width)."""
    solutions: int
    """How many branches there are, whatever the limits."""


class Ladder:
    """Makes the rungs of one path, and the links between neighbours.

    Attributes:
        manifold: the configurations on the path.
        pace: what motion costs.
        keep: whether motions that need more than the time of their line are the last resort.
    """

    def __init__(
        self, solver: IKSolver, manifold: Manifold, pace: Pace, step: float, near: Array, *, keep: bool
    ) -> None:
        """Prepare.

        Args:
            solver: what solves; it has a closed form.
            manifold: the configurations on the path.
            pace: what motion costs.
            step: between members of a curve, in the parameter [rad].
            near: (dof,) where the path should begin [rad].
            keep: True when motions that need more than the time of their line are the last resort.
        """
        self.manifold, self.pace = manifold, pace
        self._solver, self.keep = solver, keep
        # Where two parameters are free members are farther apart: a quarter of them.
        self._step = 2.0 * step if manifold.has_surfaces else step
        self._robot, self.verifier = solver.robot, solver.verifier
        # Limited joints with more than a turn of room stand for several configurations.
        self._near, self._copies = near, copies_counted(self._robot)

    def make_rungs(self, places: Array, near: Array | None = None) -> list[Rung]:
        """The solutions at places (n,); of whole curves, with the members nearest to a configuration (dof,)."""
        manifold = self.manifold
        if not manifold.has_curves:
            poses = manifold.path.at(places)
            return [self._branches(u, T, near) for u, T in zip(places.tolist(), poses, strict=True)]
        parts = [places[start : start + PLACES_TOGETHER] for start in range(0, len(places), PLACES_TOGETHER)]
        return [rung for part in parts for rung in self._curve_rungs(part, near)]

    def _curve_rungs(self, places: Array, near: Array | None) -> list[Rung]:
        """Members of curves, guesses corrected all together."""
        manifold = self.manifold
        found = [self._members(u, manifold.path.target(u), near) for u in places.tolist()]
        counts = [len(members.x) for members in found]
        x, good = manifold.project(np.repeat(places, counts), np.concatenate([members.x for members in found]))
        ends = np.cumsum([0, *counts]).tolist()
        return [
            self._rung(u, x[start:end][good[start:end]], members.solutions)
            for u, (start, end), members in zip(places.tolist(), itertools.pairwise(ends), found, strict=True)
        ]

    def _branches(self, u: float, T: Array, near: Array | None) -> Rung:
        """The branches of a pose (4, 4); on fewer than six joints, of the target there."""
        if self.manifold.dof < 6:
            target = self.manifold.path.target(u)
            found = self._solver.solve_all(target, self._robot.home if near is None else near)
            return self._rung(u, self.manifold.points(found.q_within_limits, target), len(found))
        rows = self._solver.closed_form().solve_all(T, self._robot.home)
        return self._rung(u, rows.q[self.verifier.reached_rows(rows)], len(rows))

    def _members(self, u: float, target: pin.SE3 | FreeAxis, near: Array | None) -> _Members:
        """Points of curves."""
        manifold = self.manifold
        angle = float(manifold.path.window(np.array([u]))[0][0]) if manifold.path.free else 0.0  # of a full pose
        if manifold.has_surfaces:
            return self._surface(u, target, angle, near)
        if not isinstance(target, FreeAxis) and manifold.path.free:  # six joints, at one value of the free angle
            branches = self._solver.closed_form().solve_all(target.homogeneous, self._robot.home)
            rows = branches.q[self.verifier.reached_rows(branches)]
            return _Members(manifold.points(rows, target, angle), len(branches))
        curves = self._solver.solve_all(target)
        assert isinstance(curves, CurveSet)
        parameters, rows = curves.spread(self._step)
        rows = angles.into_limits(rows, self._robot.lower, self._robot.upper)
        found = [np.column_stack([rows, parameters]) if manifold.path.free else rows]
        if near is not None:  # the member nearest to it, and the configuration itself, which may be a member
            nearest = curves.nearest(near)
            found.append(manifold.points(np.array([near] if nearest is None else [nearest, near]), target))
        return _Members(np.concatenate(found), curves.branches)

    def _surface(self, u: float, target: pin.SE3 | FreeAxis, angle: float, near: Array | None) -> _Members:
        """Points of surfaces: curves at steps of the angle about the axis; a full pose is at one angle."""
        turned = [(angle, target)]
        if isinstance(target, FreeAxis):
            low, high = target.range
            count = math.ceil((high - low) / self._step) + (not target.full_turn)
            values = np.linspace(low, high, count, endpoint=not target.full_turn)
            turned = [(value, target.at(value)) for value in values.tolist()]
        found, branches = [], 0
        for value, pose in turned:
            curves = self._solver.solve_all(pose)
            assert isinstance(curves, CurveSet)
            rows = angles.into_limits(curves.spread(self._step)[1], self._robot.lower, self._robot.upper)
            found.append(self.manifold.points(rows, pose, value))
            branches += curves.branches
        if near is not None:
            beside = self._solver.solve(target, seed=near, closest=False)
            found.append(self.manifold.points(np.array([beside.q, near] if beside.success else [near]), target, angle))
        return _Members(np.concatenate(found), branches)

    def _rung(self, u: float, x: Array, solutions: int) -> Rung:
        """The rung of points (k, width): without those in contact, and with their copies."""
        touching: tuple[tuple[str, str], ...] = ()
        if self.verifier.avoids_contact:
            clear = np.ones(len(x), dtype=np.bool_)
            for row, point in enumerate(x):
                pairs = self.verifier.touching(point[: self.manifold.dof])
                if pairs:
                    clear[row], touching = False, tuple(pairs)
            x = x[clear]
        numbered = np.column_stack([x, np.arange(len(x))])
        x = angles.copies_within(numbered, self._near, self._robot.lower, self._robot.upper, self._copies)
        return Rung(u, x[:, :-1].copy(), solutions, x[:, -1].astype(np.intp), touching)

    def link(self, rungs: Sequence[Rung]) -> list[Links]:
        """Which solutions of each rung, the second to the last, follow which of the rung before, and at what cost.

        The kernel links solutions whatever their turns, and each link then holds for those copies that it leads to.
        """
        manifold, u = self.manifold, np.array([rung.u for rung in rungs])
        firsts = [rung.firsts for rung in rungs]
        sizes = [len(rows) for rows in firsts]
        room = sum(a * b for a, b in itertools.pairwise(sizes))
        work = make_link_work(manifold.dof, manifold.width, len(manifold.parameters), len(rungs), sum(sizes), room)
        work = work._replace(arm=manifold.chain.arm)
        work.parameters[:] = manifold.parameters
        work.numbers[LinkNumber.FARTHEST] = NEAR
        work.numbers[LinkNumber.FARTHEST_PARAMETER] = 2.5 * self._step  # from step to step of the path
        # What may be missed grows by 0.15 times the squared change of the parameter [m] and [rad].
        missed, tilted = manifold.tolerances if manifold.width < 6 else (0.0, 0.0)
        work.numbers[[LinkNumber.DEVIATION, LinkNumber.TILT, LinkNumber.BEND]] = MISSED + missed, TILTED + tilted, 0.15
        work.numbers[LinkNumber.HASTE] = TOO_FAST if self.keep else 0.0
        work.circular[:], work.scale[:] = manifold.circular, self.pace.scale
        work.circular[: manifold.dof][self._copies > 1] = 1
        x = np.concatenate([rung.x[rows] for rung, rows in zip(rungs, firsts, strict=True)])
        work.sizes[:], work.x[:] = sizes, x.ravel()
        goal = manifold.goal(manifold.path.middle(u[:-1], u[1:]))
        work.T[:], work.times[:] = goal.T, self.pace.between(u)
        if goal.axis is not None:
            work.axis[:] = goal.axis
        Call(link_rungs, work)()
        ends = np.cumsum([0, *work.made])
        found = [
            Links(work.first[start:end].copy(), work.second[start:end].copy(), work.cost[start:end].copy())
            for start, end in itertools.pairwise(ends.tolist())
        ]
        wide = np.flatnonzero(self._copies > 1)
        if not wide.size:
            return found
        return [
            _of_copies(links, before, after, wide)
            for links, (before, after) in zip(found, itertools.pairwise(rungs), strict=True)
        ]


def _of_copies(links: Links, before: Rung, after: Rung, wide: NDArray[np.intp]) -> Links:
    """The links of all points of two rungs, from those of the first points of those that are alike.

    Args:
        links: those, numbered by what is alike; joints with copies moved the short way round.
        before: the first rung.
        after: the second.
        wide: joints with copies.
    """
    starts, ends = before.firsts[links.first], after.firsts[links.second]
    passed = np.rint((after.x[ends] - before.x[starts])[:, wide] / angles.TURN).astype(np.intp)
    copies = np.bincount(before.alike)[links.first]
    link = np.repeat(np.arange(len(copies)), copies)
    first = starts[link] + np.arange(len(link)) - np.repeat(np.cumsum(copies) - copies, copies)
    turns = after.turns(wide)
    wanted = before.turns(wide)[first] - passed[link]

    # Points of the second rung are told apart by one number each: what they are alike to, and their turns.
    low, high = turns.min(axis=0, initial=0), turns.max(axis=0, initial=0)
    there = ((wanted >= low) & (wanted <= high)).all(axis=1)
    link, first, wanted = link[there], first[there], wanted[there]
    shape = (len(after.firsts), *(high - low + 1))
    point = np.full(math.prod(shape), -1)
    point[np.ravel_multi_index((after.alike, *(turns - low).T), shape)] = np.arange(len(turns))
    second = point[np.ravel_multi_index((links.second[link], *(wanted - low).T), shape)]
    rows = np.lexsort((second, first))
    rows = rows[second[rows] >= 0]
    return Links(first[rows], second[rows], links.cost[link[rows]])


@dataclass(frozen=True, slots=True)
class ClimbResult:
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

    def __init__(self, search: PathSearch, dt: float) -> None:
        """Take what finds the best way, and the control step [s]."""
        self._search, self._verifier = search, search.ladder.verifier
        self._manifold, self._pace = search.ladder.manifold, search.ladder.pace
        self._ticks = sample_lines(self._pace.times, dt)
        self._step = np.minimum(self._pace.velocity * dt, RESOLUTION)
        self._fastest = self._pace.velocity * dt * (1.0 + 1e-9)  # rounding
        self._dt = dt

    def find(self) -> ClimbResult | None:
        """The best way; None when it does not even begin."""
        search, blocked = self._search, ""
        best: tuple[float, ClimbResult] | None = None
        faster = rounds = 0
        while rounds < MOST_ROUNDS:
            rounds += 1
            way = search.best()
            if not way:
                return None
            curve = self._curve(way)
            if len(way) == 1:
                return ClimbResult(curve, 0.0, blocked)
            look = self._look(curve)
            blocked = next(iter(look.touched.values()), blocked)
            if not look.wrong:
                done = ClimbResult(self._smooth(curve) or look.curve, float(curve.u[-1]), blocked)
                late, dearer = self._charge_haste(done.curve, way, curve) if search.ladder.keep else (0.0, False)
                if best is None or (done.reached, -late) > (best[1].reached, -best[0]):
                    best = late, done
                faster += 1
                if not dearer or faster > 12 or search.is_late:  # so many are enough
                    return best[1]
            elif rounds == MOST_ROUNDS or search.is_late:
                if best is not None:
                    return best[1]
                last = look.wrong[-1]
                return ClimbResult(self._curve(way[: last + 1]), float(curve.u[last]), blocked)
            for interval in look.wrong:  # from the end: numbers of the others stay as they are
                if interval not in look.touched and search.can_halve(interval + 1):
                    search.halve(interval + 1)
                else:
                    search.cut(interval + 1, way[interval], way[interval + 1])
        return None if best is None else best[1]

    def _charge_haste(self, found: Curve, way: list[int], curve: Curve) -> tuple[float, bool]:
        """How long joints would be too fast [s], weighted by how much; and whether the search now knows more of that.

        The steps of the way in which they are become dearer in it.
        """
        ticks = self._ticks[(self._ticks >= found.u[0]) & (self._ticks <= found.u[-1])]
        q = found.q[np.searchsorted(found.u, ticks)]
        ratio = (np.abs(np.diff(q, axis=0)) / self._fastest).max(axis=1)
        late = np.flatnonzero(ratio > 1.0)
        interval = curve.intervals(ticks[late + 1])
        dearer = False
        for number in np.unique(interval).tolist():
            cost = TOO_FAST * self._dt * float(ratio[late[interval == number]].sum())
            dearer |= self._search.charge(number + 1, way[number], way[number + 1], cost)
        return float(ratio[late].sum()) * self._dt, dearer

    def _look(self, curve: Curve) -> _Look:
        inside = self._ticks[(self._ticks > curve.u[0]) & (self._ticks < curve.u[-1])]
        u, x, bad = curve.refine(np.unique(np.concatenate([curve.u, inside])), self._step)
        touched = self._find_contact(curve, u, x[:, : self._manifold.dof], bad)
        return _Look(sorted({*bad.tolist(), *touched}, reverse=True), touched, Curve(self._manifold, u, x))

    def _smooth(self, curve: Curve) -> Curve | None:
        """The way, finely, after its knots moved to where joints move less; None when nothing better is free."""
        if not self._manifold.has_curves:
            return None
        pull = None if self._search.exactly else (self._search.near, FROM_SEED)
        u, x = curve.u, curve.x
        finer = np.union1d(u, np.arange(np.ceil(u[0]), u[-1]))  # with waypoints that steps passed
        at, good = curve.at(finer)
        if good.all():
            u, x = finer, at
        smoothing = Smoothing(self._manifold, self._pace, u, pull)
        pinned = np.zeros(len(u), dtype=np.bool_)
        for _ in range(4):  # what got worse is left alone
            look = self._look(Curve(self._manifold, u, smoothing.improve(x, pinned)))
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
        first[joints] = angles.nearest_copy(first[joints], self._search.near, manifold.circular[joints])
        unrolled = np.vstack([first, first + np.cumsum(manifold.difference(x[:-1], x[1:]), axis=0)])
        x = np.where(manifold.circular, unrolled, x)
        return Curve(manifold, np.array([rung.u for rung in rungs]), x)

    def _find_contact(self, curve: Curve, u: Array, q: Array, bad: NDArray[np.intp]) -> dict[int, str]:
        """Numbers of intervals of the curve in which shapes touch, with their names, where contact is rejected."""
        if not self._verifier.avoids_contact:
            return {}
        found: dict[int, str] = {}
        for row, index in enumerate(curve.intervals(u).tolist()):
            if index in found or index in bad:
                continue
            pairs = self._verifier.touching(q[row])
            if not pairs and row + 1 < len(q):
                pairs = self._verifier.touching_between(q[row], q[row + 1])
            if pairs:
                found[index] = ", ".join(f"{a} and {b}" for a, b in pairs[:2])
        return found


class PathSearch:
    """The ladder of one path, and the best way up; links are made when they are needed and can be cut."""

    def __init__(
        self, ladder: Ladder, places: Array, near: Array, *, exactly: bool, deadline: float = math.inf
    ) -> None:
        """Solve at every place.

        Args:
            ladder: makes rungs and links.
            places: (n,) along the path.
            near: (dof,) where the path should begin [rad].
            exactly: whether it must begin there.
            deadline: on the clock of `time.monotonic` [s], when steps are no longer made smaller.
        """
        self.ladder, self.near, self.exactly = ladder, near, exactly
        self._deadline = deadline
        self._places = places
        self._make_rungs()

    def _make_rungs(self) -> None:
        """Begin, or begin anew."""
        places = self._places
        self.rungs = [*self.ladder.make_rungs(places[:1], self.near), *self.ladder.make_rungs(places[1:])]
        self._links: list[Links | None] = [None] * len(self.rungs)  # from the rung before
        self._most = len(self.rungs) + 6000  # steps that are halved cost time
        self._costs: list[Array] = []
        self._back: list[NDArray[np.intp]] = []
        self._valid = 0  # rungs whose costs are still right

    @property
    def is_late(self) -> bool:
        """Whether there is no more time."""
        return time.monotonic() >= self._deadline

    def best(self) -> list[int]:
        """Solutions of the cheapest way, rung by rung: to the end, or else to the last rung that can be reached."""
        while True:
            reached = self._climb()
            if reached == len(self.rungs) - 1:
                return self._trace(reached)
            if not self._refine(reached):
                return self._trace(reached)

    def cut(self, rung: int, first: int, second: int) -> None:
        """Two solutions do not follow each other after all: `first` on the rung before, `second` on this one."""
        links = self._links[rung]
        assert links is not None
        links.cost[(links.first == first) & (links.second == second)] = np.inf
        self._valid = min(self._valid, rung)

    def charge(self, rung: int, first: int, second: int, cost: float) -> bool:
        """Make the step from `first`, on the rung before, to `second` cost so much at least; whether that is more."""
        links = self._links[rung]
        assert links is not None
        cheap = (links.first == first) & (links.second == second) & (links.cost < cost)
        links.cost[cheap] = cost
        if cheap.any():
            self._valid = min(self._valid, rung)
        return bool(cheap.any())

    def _start_cost(self) -> Array:
        """(k,) for the solutions of the first rung; infinite where the arm cannot be."""
        manifold, rung = self.ladder.manifold, self.rungs[0]
        q = rung.x[:, : manifold.dof]
        away = q - angles.nearest_copy(self.near, q, manifold.circular[: manifold.dof])
        if self.exactly:  # the nearest one of those that are near enough
            farthest = np.abs(away).max(axis=1, initial=0.0)
            return np.where(farthest <= min(1e-3, farthest.min(initial=np.inf)), 0.0, np.inf)  # [rad]
        return np.asarray(FROM_SEED * ((away / self.ladder.pace.scale) ** 2).sum(axis=1))

    def _climb(self) -> int:
        """Costs of all solutions, rung by rung; returns the last rung that can be reached, -1 for none."""
        if self._valid == 0:
            self._costs, self._back = [self._start_cost()], [np.empty(0, dtype=np.intp)]
            self._valid = 1
        del self._costs[self._valid :], self._back[self._valid :]
        if not np.isfinite(self._costs[-1]).any():
            return self._valid - 2
        for index in range(self._valid, len(self.rungs)):
            links = self._links[index]
            if links is None:
                links = self._link(index)
            size = len(self.rungs[index].x)
            total = self._costs[-1][links.first] + links.cost
            cost, back = np.full(size, np.inf), np.full(size, -1, dtype=np.intp)
            order = np.argsort(-total, kind="stable")  # the cheapest is written last
            cost[links.second[order]] = total[order]
            back[links.second[order]] = links.first[order]
            self._costs.append(cost)
            self._back.append(back)
            self._valid = index + 1
            if not np.isfinite(cost).any():
                return index - 1
        return len(self.rungs) - 1

    def _link(self, index: int) -> Links:
        """Make the links of a rung, and with it those of the next ones that have none."""
        last, pairs = index, 0
        while last < len(self.rungs) and self._links[last] is None and pairs < 300_000:  # in one go
            pairs += len(self.rungs[last - 1].firsts) * len(self.rungs[last].firsts)
            last += 1
        self._links[index:last] = self.ladder.link(self.rungs[index - 1 : last])
        links = self._links[index]
        assert links is not None
        return links

    def _trace(self, reached: int) -> list[int]:
        if reached < 0:
            return []
        node = int(np.argmin(self._costs[reached]))
        chosen = [node]
        for index in range(reached, 0, -1):
            node = int(self._back[index][node])
            chosen.append(node)
        return chosen[::-1]

    def _refine(self, reached: int) -> bool:
        """Halve the steps at which ways ended, the last ones first; False when all are as small as they get."""
        ended = []
        for index in range(min(reached + 1, len(self.rungs) - 1), 0, -1):
            if self._is_dead_end(index) and self._size(index) > FINEST:
                ended.append(index)
            if len(ended) == 24:  # at once
                break
        if not ended or len(self.rungs) + len(ended) > self._most or self.is_late:
            return False
        for index in ended:  # from the end: earlier numbers stay as they are
            self.halve(index)
        return True

    def halve(self, index: int) -> None:
        """Put a rung half way before a rung."""
        u = np.array([self.rungs[index - 1].u, self.rungs[index].u])
        self.rungs.insert(index, self.ladder.make_rungs(self.ladder.manifold.path.middle(u[:1], u[1:]))[0])
        self._links[index : index + 1] = [None, None]
        self._valid = min(self._valid, index)

    def can_halve(self, index: int) -> bool:
        """Whether the step before a rung can be made smaller."""
        return self._size(index) > FINEST and len(self.rungs) < self._most

    def _size(self, index: int) -> float:
        """Length of the step before a rung [m]."""
        u = np.array([self.rungs[index - 1].u, self.rungs[index].u])
        return float(np.diff(self.ladder.manifold.path.gone(u))[0])

    def _is_dead_end(self, index: int) -> bool:
        """Whether a way that reached the rung before ends there though this rung has solutions that nothing reaches."""
        links = self._links[index]
        if links is None or index - 1 >= len(self._costs):
            return False
        a, b = np.isfinite(self._costs[index - 1]), len(self.rungs[index].x)
        left, entered = np.zeros(len(a), dtype=np.bool_), np.zeros(b, dtype=np.bool_)
        alive = np.isfinite(links.cost)
        left[links.first[alive]] = True
        entered[links.second[alive]] = True
        return bool((a & ~left).any() and not entered.all())
