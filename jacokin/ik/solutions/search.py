"""`SetSearch`: from a target to its `CurveSet`, and to the member that is wanted, or why there is none."""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.ik import diagnosis
from jacokin.ik.closest import ClosestSearch
from jacokin.ik.diagnosis import LimitExcess, Outcome
from jacokin.ik.near_misses import NearMisses
from jacokin.ik.preferences import Cost, copies_to_try, with_ties
from jacokin.ik.results import IKResult
from jacokin.ik.solutions.curve_arm import CIRCLE, DIMENSIONS, FOLD, CurveArm, CurveProblem, Curves
from jacokin.ik.solutions.curve_set import CurveSet, TrackInterval
from jacokin.ik.solutions.least import basins, least_costs, minima
from jacokin.ik.solutions.members import CurveTrack, LostMemberError, Members, guesses, polylines
from jacokin.ik.solutions.solution_set import IntervalEnd
from jacokin.ik.targets import Request, TargetPose
from jacokin.ik.verification import Candidate, Verifier
from jacokin.kernels.solution_set.curve import RESOLUTION
from jacokin.kernels.solution_set.starts import NEARBY
from jacokin.model import angles
from jacokin.model.angles import TURN
from jacokin.model.robot import Robot

#: [rad] between members that are looked at where the best one is in contact.
TRIED = 0.03
#: Of an interval along which the parameter stands still, how many are; and so many are looked at together.
TRIED_STANDING, AT_ONCE = 16, 64
#: Moves of near misses, in tolerances, and ways: curves must be long enough to be found between two slices.
MOVE, WAYS = 1000.0, 2
#: Configurations of each branch next to the target that are within the limits, and outside, to start from at most.
SPREAD = 6


class CurveFindings(NamedTuple):
    """The set of a target, and what its members have in common."""

    curves: CurveSet
    members: Members
    least_excess: Callable[[], LimitExcess | None]  # where branches come nearest to the limits; None without any
    tracks: Callable[[], Sequence[CurveTrack]]  # all branches, within the limits or not

    def candidates(self, cost: Cost | None, *, several: bool) -> Iterator[Candidate]:
        """Members, the best one first; that one alone, or after it those that are clear, about 0.03 rad apart."""
        members, seed = self.members, self.members.seed
        wish = with_ties(cost, seed)
        best = self.curves.choose(wish, seed)
        if best is not None:
            yield members.candidate(*best)
        elif (least := self.least_excess()) is not None and not least.excess.any():
            yield members.candidate(members.copies(least.q, seed), least.parameter)
        if best is None or not several:
            return
        found: list[tuple[Array, Array, Array]] = []
        for number, interval in enumerate(self.curves.intervals):
            standing = interval.start == interval.stop
            p, q = interval.sample(TRIED_STANDING) if standing else interval.walk(TRIED)
            for copies in copies_to_try(wish.copies, q, seed, members.robot):
                kept = ~np.isnan(copies).any(axis=1)
                found.append((copies[kept], p[kept], np.full(kept.sum(), number)))
        rows, parameters, numbers = (np.concatenate(column) for column in zip(*found, strict=True))
        order = np.argsort(wish(rows), kind="stable")
        for first in range(0, len(order), AT_ONCE):
            some = order[first : first + AT_ONCE]
            for index in some[~members.verifier.touching_rows(rows[some])].tolist():
                value, interval = float(parameters[index]), self.curves.intervals[numbers[index]]
                exact = rows[index] if interval.start == interval.stop else interval.at(value)  # `walk` is not exact
                yield members.candidate(angles.nearest_copy(exact, rows[index]), value)


class SetSearch:
    """Sets of solutions of one arm: the curves on which a target is reached, and what of them is within the limits."""

    __slots__ = ("_arm", "_closest", "_near_misses", "_verifier")

    def __init__(self, verifier: Verifier, arm: CurveArm) -> None:
        """Take the constants of an arm."""
        self._verifier, self._arm = verifier, arm
        self._closest, self._near_misses = ClosestSearch(verifier), NearMisses(verifier, MOVE, WAYS)

    @property
    def parameter(self) -> str:
        """What the parameter is called: a joint's name, or "angle"."""
        return self._arm.name

    def members(self, target: TargetPose, seed: Array) -> Members:
        """What the solutions of a target have in common; unlimited joints are near to a seed (dof,)."""
        parameter = self._arm.parameter
        return Members(self._verifier, parameter if parameter < self._arm.dof else None, target, seed)

    def solve(self, request: Request) -> IKResult:
        """The member of the least cost, or why there is none."""
        verifier, members = self._verifier, self.members(request.target, request.seed)
        beyond = self._closest.reach.exceeded(request.target)
        if beyond is not None:
            return self.closest_to(request, members, None, beyond)
        known: Curves | None = None
        if request.cost is None:  # the kernels find the nearest member at once, or the whole set
            starts = self._starts(members)
            member, known = self._nearest(members, starts)
            first = self._beside_seed(members, starts, member)
            if member is not None:
                first.append(members.candidate(*member))
            if first:
                result = verifier.select(iter(first), request, "")
                if result is not None and not (result.touching and verifier.avoids_contact):
                    return result
        problem = self._arm.problem(request.target)
        found = self._findings(problem, problem.find(self._starts(members)) if known is None else known, members)
        candidates = found.candidates(request.cost, several=verifier.avoids_contact)
        if request.cost is not None and not found.curves.complete:
            candidates = self._with_neighbour(candidates, members, request.cost)
        in_contact = "every member that was tried is in contact; the best one"
        result = verifier.select(candidates, request, in_contact)
        if result is None and not found.curves.complete:
            result = verifier.select(self._led_to(found, request.seed), request, in_contact)
        if result is None:
            dof, parameter = verifier.robot.dof, self._arm.parameter
            rows = self._near_misses.find(request, self._almost_reaching(request, found))
            near = (found.members.candidate(x[:dof], float(x[parameter])) for x in rows)
            result = verifier.select(near, request, in_contact)
        if result is not None:
            return result
        least, names = found.least_excess(), verifier.robot.joint_names
        outcome = diagnosis.explain_curves(found.curves.complete, found.curves.branches, least, names)
        return self.closest_to(request, found.members, least, outcome)

    def find(self, target: TargetPose, seed: Array) -> CurveFindings:
        """Everything that reaches a target; unlimited joints in the copies nearest to a seed (dof,)."""
        problem = self._arm.problem(target)
        members = self.members(target, seed)
        return self._findings(problem, problem.find(self._starts(members)), members)

    def straight_wrists(self, target: TargetPose, seed: Array, q: Array) -> CurveFindings:
        """What reaches a pose of six joints on the curves through branches (k, 6) that stand for whole ones."""
        problem = self._arm.turning(target.matrix)
        found = problem.find(np.column_stack([q, np.zeros(len(q))]), only_starts=True)
        turned = [angles.wrap_to_pi(piece.nodes[:, self._arm.parameter]) for piece in found.pieces]
        standing = [piece for piece, by in zip(found.pieces, turned, strict=True) if np.abs(by).max() < RESOLUTION]
        return self._findings(problem, found._replace(pieces=standing), self.members(target, seed))

    def nearly_standing(self, T: Array, q: Array) -> Array:
        """Configurations (m, 6) within the limits on curves through branches (k, 6) along which the tool hardly turns.

        Those of a wrist that is straight but for the tolerance of orientation.
        """
        if not len(q):
            return np.empty((0, self._arm.dof))
        found = self._arm.turning(T).find(np.column_stack([q, np.zeros(len(q))]), only_starts=True)
        nodes = np.vstack([np.empty((0, 2 * DIMENSIONS)), *(piece.nodes for piece in found.pieces)])
        hardly = np.abs(nodes[:, self._arm.parameter]) <= self._verifier.options.orientation_tolerance
        return nodes[hardly, : self._arm.dof]

    def _beside_seed(self, members: Members, starts: Array, nearest: tuple[Array, float] | None) -> list[Candidate]:
        """The member that least steps lead to from a seed that nearly is one, if it is nearer than the nearest.

        Next to where curves meet they may not be told apart, and a seed gets its own neighbour back all the same.
        """
        if not len(starts):
            return []
        seed = members.seed
        p = starts.item(0, self._arm.parameter)
        away = math.inf if nearest is None else float(np.linalg.norm(nearest[0] - seed))
        if away < RESOLUTION or (nearest is not None and members.is_next(nearest[0], seed, p)):
            return []
        try:
            found = members.beside(seed, p, away)
        except LostMemberError:
            return []
        return [members.candidate(*found)] if found is not None and np.linalg.norm(found[0] - seed) < away else []

    def _with_neighbour(self, candidates: Iterator[Candidate], members: Members, cost: Cost) -> Iterator[Candidate]:
        """Candidates of a set that may lack some: first the member beside the seed, if it costs less than the best."""
        wish, best = with_ties(cost, members.seed), next(candidates, None)
        for beside in self._beside_seed(members, self._starts(members), None):
            if best is None or wish(beside.q[np.newaxis])[0] < wish(best.q[np.newaxis])[0]:
                yield beside
        if best is not None:
            yield best
        yield from candidates

    def _led_to(self, found: CurveFindings, seed: Array) -> Iterator[Candidate]:
        """Members that no curve found passes: what least steps lead to from a seed, and from where it is nearest."""
        least, members = found.least_excess(), found.members
        for start in [seed] if least is None else [seed, least.q]:
            try:
                member = members.beside(start, members.target.nearest_angle(members.parameter(start)))
            except LostMemberError:
                continue
            if member is not None:
                yield members.candidate(*member)

    def _starts(self, members: Members) -> Array:
        """(k, 7) the seed, if it nearly reaches the target: a curve beside it is followed."""
        target, seed = members.target, members.seed
        p = target.nearest_angle(members.parameter(seed))
        near = max(self._verifier.measure(seed, target.at(p))) < NEARBY
        return np.append(seed, p)[np.newaxis, :DIMENSIONS] if near else np.empty((0, DIMENSIONS))

    def _findings(self, problem: CurveProblem, found: Curves, members: Members) -> CurveFindings:
        """What of curves is within the limits, as intervals."""
        robot, free, index = members.robot, members.target.free_axis, self._arm.parameter
        known = dict[int, IntervalEnd]()
        intervals, complete = [], found.complete
        least = -math.pi
        if free is not None and not free.full_turn:
            least = free.range[0]
        elif free is None and index < robot.dof and robot.upper[index] - robot.lower[index] < TURN:
            least = float(robot.lower[index])
        middles = np.array([piece.nodes[len(piece.nodes) // 2, : robot.dof] for piece in found.pieces])
        turns = TURN * np.where(robot.unlimited, np.round((members.seed - middles) / TURN), 0.0) if found.pieces else ()
        for piece, turn in zip(found.pieces, turns, strict=True):
            for code in piece.codes:
                if code not in known:
                    known[code] = _end(code, robot)
            piece.nodes[:, : robot.dof] += turn
            track = CurveTrack(problem, piece.nodes, least)
            if len(piece.nodes) == 1 and not self._reaches(piece.nodes[0], members):
                complete = False
                continue
            ends = known[piece.codes[0]], known[piece.codes[1]]
            intervals.append(TrackInterval(members, track, piece.branch, ends))
        intervals.sort(key=lambda interval: (interval.branch, interval.start))
        curves = CurveSet(
            tuple(intervals), members, parameter=self.parameter, branches=found.branches, complete=complete
        )

        @functools.cache
        def tracks() -> Sequence[CurveTrack]:
            return [
                CurveTrack(problem, nodes, least) for whole in found.whole for nodes in _between_folds(whole, index)
            ]

        return CurveFindings(curves, members, functools.cache(lambda: _find_least_excess(tracks(), robot)), tracks)

    def _reaches(self, x: Array, members: Members) -> bool:
        """Whether a single point (14,), where joints pass their limits at once, is within them but for rounding."""
        dof = members.robot.dof
        try:
            members.verified(members.copies(x[:dof], members.seed), float(x[self._arm.parameter]))
        except LostMemberError:
            return False
        return True

    def nearest(self, target: TargetPose, seed: Array) -> tuple[Array, float] | None:
        """The member (dof,) nearest to a seed and its parameter [rad]; None where only `find` can tell."""
        members = self.members(target, seed)
        return self._nearest(members, self._starts(members))[0]

    def _nearest(self, members: Members, starts: Array) -> tuple[tuple[Array, float] | None, Curves | None]:
        """The member (dof,) nearest to the seed and its parameter [rad], on curves beside points (k, 7) too.

        And where there is none, the curves of the whole set.
        """
        robot, seed = members.robot, members.seed
        found = self._arm.problem(members.target).nearest(starts, seed, members.parameter(seed))
        if found is None or isinstance(found, Curves):
            return None, found
        return (found[: robot.dof].clip(robot.lower, robot.upper), found.item(self._arm.parameter)), None

    def _almost_reaching(self, request: Request, found: CurveFindings) -> Array:
        """Rows (k, dof), with the parameter of a free axis after them, where branches come nearest to the limits [rad].

        Branches of the target itself and of those next to it. Where nothing reaches it, within the limits or not, the
        latter were looked at.
        """
        target, robot = request.target, self._verifier.robot
        tracks = list(found.tracks())
        for T in self._near_misses.moved(target.matrix):
            tracks += self._tracks(target, T)
        if not tracks:
            return np.empty((0, robot.dof + (target.free_axis is not None)))
        parameters, rows, begins = polylines(tracks)
        outside = np.abs(angles.wrap_to_pi(rows - angles.into_limits(rows, robot.lower, robot.upper))).max(axis=1)
        chosen = list[NDArray[np.intp]]()
        for first, last in itertools.pairwise(begins.tolist()):
            least = first + minima(outside[first:last])
            within = np.sort(least[outside[least] == 0.0])
            chosen.append(within[np.linspace(0, len(within) - 1, min(len(within), SPREAD)).astype(np.intp)])
            beyond = least[(outside[least] > 0.0) & (outside[least] <= self._near_misses.near)]
            chosen.append(beyond[:SPREAD])
        some = np.concatenate(chosen)
        return rows[some] if target.free_axis is None else np.column_stack([rows[some], parameters[some]])

    def _tracks(self, target: TargetPose, T: Array) -> Sequence[CurveTrack]:
        """The branches of a target that is moved to a pose (4, 4)."""
        problem = self._arm.problem(target)._replace(T=T)
        found = problem.find(np.empty((0, DIMENSIONS)), sure=False)
        return self._findings(problem, found, self.members(target, self._verifier.robot.home)).tracks()

    def closest_to(self, request: Request, members: Members, least: LimitExcess | None, outcome: Outcome) -> IKResult:
        """Why there is no member, with the closest configuration; the angle of a free axis follows where that comes."""
        p = request.target.nearest_angle(0.0 if least is None else least.parameter)
        nearby = [] if least is None else [least.q]
        if request.target.free_axis is not None:
            return self._closest.solve_about(request, outcome, nearby, p)
        result = self._closest.solve(request, outcome, nearby)
        return replace(result, parameter=float(result.q[self._arm.parameter]) if request.closest else p)


def _between_folds(nodes: Array, index: int) -> list[Array]:
    """A curve (m, 14) in runs along which the parameter rises, of which it is the angle with an index."""
    rises = np.diff(nodes[:, index]) >= 0.0
    cuts = [0, *(np.flatnonzero(rises[1:] != rises[:-1]) + 1).tolist(), len(nodes) - 1]
    runs = []
    for first, last in itertools.pairwise(cuts):
        run = nodes[first : last + 1]
        if run[-1, index] < run[0, index]:
            run = run[::-1].copy()
            run[:, DIMENSIONS:] *= -1.0
        runs.append(run)
    return runs


def _find_least_excess(tracks: Sequence[CurveTrack], robot: Robot) -> LimitExcess | None:
    """Where tracks come nearest to the limits; None without any."""
    bounded = robot.upper - robot.lower < TURN
    lower, upper = np.where(bounded, robot.lower, -np.inf), np.where(bounded, robot.upper, np.inf)
    low, high = lower[bounded], upper[bounded]
    middle, half = 0.5 * (low + high), 0.5 * (high - low)

    def worst(rows: Array) -> Array:
        beyond: Array = (np.abs(angles.wrap_to_pi(rows[:, bounded] - middle)) - half).max(axis=1, initial=0.0)
        return beyond

    if not tracks:
        return None
    coordinates, rows, begins = guesses(tracks)
    looks = basins(tracks, coordinates, begins, np.zeros_like(rows), worst(rows))
    _, coordinate, place = least_costs(looks, worst, lambda _, rows, snap: rows, floor=0.0)[0]
    parameter, q = place.track.point(coordinate)
    excess: Array = np.abs(angles.wrap_to_pi(q - angles.into_limits(q, lower, upper)))
    return LimitExcess(angles.into_limits(q, robot.lower, robot.upper), excess, parameter)


def _end(code: int, robot: Robot) -> IntervalEnd:
    """An end in words from its code, see `curve_arm.Piece`."""
    if code // 2 >= robot.dof:
        return IntervalEnd("range")
    if code >= 0:
        limit = (robot.lower, robot.upper)[code % 2][code // 2]
        return IntervalEnd("limit", robot.joint_names[code // 2], float(limit))
    return IntervalEnd({FOLD: "fold", CIRCLE: "circle"}.get(code, "lost"))
