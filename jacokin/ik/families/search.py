"""`FamilySearch`: from a target to its `Family`, and to the member that is wanted, or why there is none."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.ik import diagnosis
from jacokin.ik.closed_form import ClosedForm
from jacokin.ik.closest import ClosestSearch
from jacokin.ik.diagnosis import LimitExcess, Outcome
from jacokin.ik.families.beside_seed import find_beside_seed
from jacokin.ik.families.curves import (
    FOLD,
    FREE_AXIS,
    JOINT_3,
    LOST,
    RANGE,
    SEAM,
    CurveArm,
    CurveProblem,
    FoundCurves,
    Piece,
    whole_piece,
)
from jacokin.ik.families.edge import EXACT_POINT, ON_EDGE, SAME_POINT, Edge
from jacokin.ik.families.family import Family, Interval, IntervalEnd
from jacokin.ik.families.least import least, minima
from jacokin.ik.families.meeting import follow_curves
from jacokin.ik.families.members import MEMBER_CLOSURE, LostMemberError, Members
from jacokin.ik.families.straight_wrist import (
    ALMOST_STRAIGHT,
    SpunWristTrack,
    StraightWrist,
    WristTrack,
    with_others,
)
from jacokin.ik.families.tracks import CircleTrack, CurveTrack, Track
from jacokin.ik.geometry import measure_seven
from jacokin.ik.near_misses import NearMisses
from jacokin.ik.preferences import Cost, copies_to_try, with_ties
from jacokin.ik.results import IKResult
from jacokin.ik.targets import Request, TargetPose, combined_error
from jacokin.ik.verification import Candidate, Verifier
from jacokin.kernels.self_motion.slices import SLICES
from jacokin.model import angles
from jacokin.model.angles import TURN
from jacokin.model.poses import FreeAxis
from jacokin.model.robot import Robot

#: Sine and [m]: a free axis this near to the axis of the last joint is that axis. Members close to 1e-9 all the same.
SAME_AXIS = 1e-10
#: [rad] curves along which no angle changes by more are looked at as points; the second one where some were lost.
SMALL, SMALL_LOST = 1e-5, 1e-3
#: [rad] a joint this far past its limit at a fold may be on it: the root of rounding, and more.
NEAR_LIMIT = 1e-5
#: Slope along a curve at which the parameter stands still: of an end of the range it is known to rounding where it is,
#: and of the other joints to rounding by the slope. It is measured on so much of the curve [rad]: folds are shorter.
STILL, STILL_LENGTH = 1e-9, 1e-3
#: [rad] how far from single points curves are looked for that would lead on from them.
ASIDE = 0.05
#: Joints and the free axis.
DIMENSIONS = 7
#: [rad] between members that are looked at where the best one is in contact.
TRIED = 0.03
#: Of an interval along which the parameter stands still, how many are; and so many are looked at together.
TRIED_STANDING, AT_ONCE = 16, 64
#: Times that a search for the closest configuration turns the target to where it has come.
AIMS = 4
#: [rad] a target turned by less than this is the same.
SAME_AIM = 1e-3
#: A member farther from the seed than this [rad], and than so many times what the seed misses the target by [m, rad],
#: may not be the nearest: there may be a singular one beside the seed.
FAR_FROM_SEED, FAR_FOR_MISS = 1e-5, 100.0
#: Moves of near misses, in tolerances, and ways: curves must be long enough to be found between two slices.
MOVE, WAYS = 1000.0, 2
#: Configurations of each branch next to the target that are within the limits, and outside, to start from at most.
SPREAD = 6


class FamilyFindings(NamedTuple):
    """The family of a target, and what its members have in common."""

    family: Family
    members: Members
    least_excess: Callable[[], LimitExcess | None]  # where branches come nearest to the limits; None without any
    tracks: Callable[[], Sequence[Track]]  # all branches, within the limits or not

    def candidates(self, cost: Cost | None, *, several: bool) -> Iterator[Candidate]:
        """Members, the best one first; that one alone, or after it those that are clear, about 0.03 rad apart."""
        members, seed = self.members, self.members.seed
        wish = with_ties(cost, seed)
        best = self.family.choose(wish, seed)
        if best is not None:
            yield members.candidate(*best)
        elif (least := self.least_excess()) is not None and not least.excess.any():
            yield members.candidate(members.copies(least.q, seed), least.parameter)
        if best is None or not several:
            return
        found: list[tuple[Array, Array, Array]] = []
        for number, interval in enumerate(self.family):
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
                value, interval = float(parameters[index]), self.family.intervals[numbers[index]]
                exact = rows[index] if interval.start == interval.stop else interval.at(value)  # `walk` is not exact
                yield members.candidate(angles.nearest_copy(exact, rows[index]), value)


class Scattered(NamedTuple):
    """Configurations of a family for a first look."""

    q: Array
    """(k, dof) within the limits [rad]."""
    parameters: Array
    """(k,) [rad]."""
    guessed: NDArray[np.bool_]
    """(k,) which are near members, about where intervals end; others are members."""
    reached: bool
    """Whether anything was found, within the limits or not."""


class FamilySearch:
    """Families of one arm: the curves on which a target is reached, and what of them is within the limits."""

    __slots__ = ("_arm", "_closest", "_edge", "_near_misses", "_sees_loops", "_verifier", "_wrist")

    def __init__(self, verifier: Verifier, arm: CurveArm) -> None:
        """Take the constants of an arm."""
        self._verifier, self._arm = verifier, arm
        self._edge, self._closest = Edge(verifier), ClosestSearch(verifier)
        self._wrist, self._near_misses = StraightWrist(self._edge), NearMisses(verifier, MOVE, WAYS)
        self._sees_loops = True  # whether small closed curves, and branches that meet in one, are found for certain

    def solve(self, request: Request) -> IKResult:
        """The member of the least cost, or why there is none."""
        verifier = self._verifier
        beyond = self._closest.reach.exceeded(request.target)
        if beyond is not None:
            return self._closest_to(request, Members(verifier, request.target, request.seed), None, beyond)
        if request.cost is None:  # the kernels find the nearest member at once
            member = self.nearest(request.target, request.seed)
            if member is not None:
                members = Members(verifier, request.target, request.seed)
                candidates = iter([members.candidate(*member)])
                if not self._sees_loops or self._skips_seed(request, member[0]):
                    candidates = self._with_beside_seed(candidates, members)
                result = verifier.select(candidates, request, "")
                if result is not None and not (result.touching and verifier.avoids_contact):
                    return result
        found = self.find(request.target, request.seed)
        candidates = found.candidates(request.cost, several=verifier.avoids_contact)
        if request.cost is None:
            candidates = self._with_beside_seed(candidates, found.members)
        in_contact = "every member that was tried is in contact; the best one"
        result = verifier.select(candidates, request, in_contact)
        if result is None:
            dof, parameter = verifier.robot.dof, self._arm.parameter
            rows = self._near_misses.find(request, self._almost_reaching(request, found))
            near = (found.members.candidate(x[:dof], float(x[parameter])) for x in rows)
            result = verifier.select(near, request, in_contact)
        if result is not None:
            return result
        least, names = found.least_excess(), verifier.robot.joint_names
        outcome = diagnosis.explain_family(found.family.complete, found.family.branches, least, names)
        return self._closest_to(request, found.members, least, outcome)

    def find(self, target: TargetPose, seed: Array) -> FamilyFindings:
        """Everything that reaches a target; unlimited joints in the copies nearest to a seed (dof,)."""
        members, problem = Members(self._verifier, target, seed), self._arm.problem(target)
        edge, robot, parameter = self._edge, self._verifier.robot, self._arm.parameter
        found, circles, alone = follow_curves(problem, edge, self._wrist)
        found = _reaching(found, members, parameter)
        small = _is_small(found.arcs, SMALL if found.complete else SMALL_LOST)
        if small or not found.complete:
            stuck = edge.holds(found.arcs, problem)
            kept = [piece for piece in found.pieces if _closes(piece, members, parameter)]
            found = found._replace(pieces=kept, complete=found.complete and len(kept) == len(found.pieces))
            if not kept or (small and stuck):
                sight = edge.look(problem)
                if sight.parameters:
                    found, circles, alone = follow_curves(problem, edge, self._wrist, sight.parameters)
                    found = _reaching(found, members, parameter)
                known_best = np.vstack([alone, *(arc[[0, -1], :7] for arc in found.arcs if small)])
                beside = edge.fitted(known_best, problem, SMALL) if len(known_best) else []
                seen = [*beside, *(point for point in sight.points if not _is_among(point, beside))]
                seen.sort(key=lambda point: float(point.excess.max()))
                rows = np.array([[*point.q, point.parameter][:DIMENSIONS] for point in seen]).reshape(-1, DIMENSIONS)
                circles = with_others(circles, self._wrist.circles(rows, problem))
                beside = [point for point in seen if not any(circle.passes(point.q) for circle in circles)]
                beside += _at_corners(circles, edge, problem, robot)
                rows = np.array([[*point.q, point.parameter][:DIMENSIONS] for point in beside]).reshape(-1, DIMENSIONS)
                surface = edge.nearly_stuck_twice(np.vstack([rows, *(arc[:, :7] for arc in found.arcs)]), problem)
                complete = stuck and self._sees_loops and _is_small(found.arcs, SMALL) and not surface
                complete = complete and not sight.parameters and not len(edge.beside(rows, problem, ASIDE))
                complete = complete and _are_single(beside, members) and not self._wrist.hides_any(rows, problem)
                points = _on_edge(beside, circles, members, seen[0] if seen else None, complete=complete)
                if not (sight.parameters and found.arcs) and (len(points.family) or (points.family.branches and stuck)):
                    return points
        intervals = []
        known: dict[int, IntervalEnd] = {}  # by their codes
        for piece in found.pieces:
            for code in piece.codes:
                if code not in known:
                    known[code] = _end(code, robot)
            ends = known[piece.codes[0]], known[piece.codes[1]]
            intervals.append(Interval(members, CurveTrack(problem, piece), piece.branch, ends))
        intervals += _at_range_ends(found, problem, members, edge)
        intervals.sort(key=lambda interval: (interval.branch, interval.start))
        beside = [
            *(edge.fitted(alone, problem, SMALL) if len(alone) else []),
            *_at_corners(circles, edge, problem, robot),
        ]
        branches = len(found.arcs)
        intervals += [*_on_circles(circles, members, branches), *_at_points(beside, members, branches + len(circles))]
        branches += len(circles) + len(beside)
        complete = found.complete and self._sees_loops and _are_single(beside, members)
        complete = complete and not _stands_still_at_range_end(found, parameter)
        family = Family(tuple(intervals), members, branches=branches, complete=complete)

        def tracks() -> Sequence[Track]:
            return [*circles, *_whole_arcs(problem, found.arcs), *map(_at, beside)]

        exact = found.complete
        return FamilyFindings(family, members, lambda: _find_least_excess(tracks(), robot, exact=exact), tracks)

    def scatter(self, target: TargetPose, step: float) -> Scattered | None:
        """Members at whole multiples of a step [rad] and at the ends of the range, and guesses where intervals end.

        What lies between two of them wholly is not seen. None where there are too many.
        """
        free, robot = target.free_axis, self._verifier.robot
        low, high = (-math.pi, math.pi) if free is None or free.full_turn else free.range
        if high - low > (SLICES - 2) * step:
            return None
        parameters = step * np.arange(math.ceil(low / step), math.ceil(high / step), dtype=np.float64)
        if free is not None and not free.full_turn:
            parameters = np.unique(np.append(parameters, [low, high]))
        x, guessed, reached = self._arm.problem(target).scatter(parameters)
        q = angles.into_limits(x[:, : robot.dof], robot.lower, robot.upper)
        return Scattered(q, x[:, self._arm.parameter], guessed, reached)

    def nearest(self, target: TargetPose, seed: Array) -> tuple[Array, float] | None:
        """The member (dof,) nearest to a seed and its parameter [rad]; None where only `find` can tell."""
        x, robot = self._arm.problem(target).nearest(seed), self._verifier.robot
        if x is None or not Members(self._verifier, target, seed).are_copies(x[: len(seed)]):
            return None
        return np.clip(x[: len(seed)], robot.lower, robot.upper), float(x[self._arm.parameter])

    def _almost_reaching(self, request: Request, found: FamilyFindings) -> Array:
        """Rows (k, dof), with the parameter of a free axis after them, where branches come nearest to the limits [rad].

        Branches of the target itself and of those next to it. Where nothing reaches it, within the limits or not, the
        latter were looked at.
        """
        target, robot = request.target, self._verifier.robot
        tracks = list(found.tracks())
        if found.family.branches or self._near_misses.tolerance > ON_EDGE:
            for T in self._near_misses.moved(target.matrix):
                tracks += self._tracks(target, T)
        starts = [np.empty((0, robot.dof + (target.free_axis is not None)))]
        for track in tracks:
            parameters, rows = track.polyline()
            outside = np.abs(angles.wrap_to_pi(rows - angles.into_limits(rows, robot.lower, robot.upper))).max(axis=1)
            chosen = minima(outside)
            within = np.sort(chosen[outside[chosen] == 0.0])
            within = within[np.linspace(0, len(within) - 1, min(len(within), SPREAD)).astype(np.intp)]
            beyond = chosen[(outside[chosen] > 0.0) & (outside[chosen] <= self._near_misses.near)]
            chosen = np.concatenate([within, beyond[:SPREAD]])
            some = rows[chosen]
            starts.append(some if target.free_axis is None else np.column_stack([some, parameters[chosen]]))
        return np.vstack(starts)

    def _tracks(self, target: TargetPose, T: Array) -> Sequence[Track]:
        """The branches of a target that is moved to a pose (4, 4)."""
        problem = self._arm.problem(target)._replace(T=T)
        return _whole_arcs(problem, problem.find().arcs)

    def _skips_seed(self, request: Request, q: Array) -> bool:
        """Whether a member (dof,) is much farther from the seed than the seed from the target: one may be beside it."""
        away, target = float(np.linalg.norm(q - request.seed)), request.target
        if away <= FAR_FROM_SEED:
            return False
        p = target.nearest_angle(Members(self._verifier, target, request.seed).parameter(request.seed))
        return away > FAR_FOR_MISS * max(self._verifier.measure(request.seed, target.at(p)))

    def _with_beside_seed(self, candidates: Iterator[Candidate], members: Members) -> Iterator[Candidate]:
        """The member beside a seed that nearly is one before the candidates, if it is nearer."""
        best = next(candidates, None)
        beside = self._beside_seed(members, math.inf if best is None else float(np.linalg.norm(best.q - members.seed)))
        if beside is not None:
            yield beside
        if best is not None:
            yield best
            yield from candidates

    def _beside_seed(self, members: Members, nearest: float) -> Candidate | None:
        """The member beside a seed that nearly is one, if no member known is as near [rad]."""
        target, seed, parameter = members.target, members.seed, self._arm.parameter
        robot, free = members.robot, target.free_axis
        p = target.nearest_angle(members.parameter(seed))
        ends = (-math.inf, math.inf) if free is None or free.full_turn else free.range
        limits = np.array([np.append(robot.lower, ends[0]), np.append(robot.upper, ends[1])])[:, :DIMENSIONS]
        x = find_beside_seed(self._arm.problem(target), np.append(seed, p)[:DIMENSIONS], limits, nearest)
        if x is None:
            return None
        try:
            return members.candidate(members.verified(x[: len(seed)], float(x[parameter])), float(x[parameter]))
        except LostMemberError:
            return None

    def _closest_to(self, request: Request, members: Members, least: LimitExcess | None, outcome: Outcome) -> IKResult:
        """Why there is no member, with the closest configuration; the angle of a free axis follows where that comes."""
        target = request.target
        p = target.nearest_angle(0.0 if least is None else least.parameter)
        nearby = [] if least is None else [least.q]
        results: list[IKResult] = []
        for _ in range(AIMS if target.free_axis is not None and request.closest else 1):
            result = self._closest.solve(request._replace(target=target.at(p)), outcome, nearby)
            parameter = p if target.free_axis is not None or not request.closest else float(result.q[JOINT_3])
            results.append(replace(result, parameter=parameter))
            last, p, nearby = p, target.nearest_angle(members.parameter(result.q)), [result.q]
            if result.success or abs(p - last) < SAME_AIM:
                break
        return min(results, key=lambda each: (not each.success, _error(each)))


class SixJointFamilies(FamilySearch):
    """Families of a six-joint arm whose tool may turn about an axis."""

    __slots__ = ("_form", "_tool_in_joint_6")

    def __init__(self, form: ClosedForm, verifier: Verifier) -> None:
        """Take the closed form of the arm."""
        chain, constants, _ = form.constants
        super().__init__(verifier, CurveArm(FREE_AXIS, chain, constants, verifier.robot.lower, verifier.robot.upper))
        self._form, self._tool_in_joint_6 = form, chain[6]
        self._sees_loops = form.other is None

    def find(self, target: TargetPose, seed: Array) -> FamilyFindings:
        """See `FamilySearch`."""
        axis, sign = self._last_axis(target)
        return super().find(target, seed) if sign == 0.0 else self._about_last_axis(target, axis, seed, sign)

    def straight_wrists(self, target: TargetPose, seed: Array, q: Array) -> FamilyFindings:
        """What reaches a pose beside branches (k, 6) that stand for the turns of a straight wrist."""
        members, circles = Members(self._verifier, target, seed), list[WristTrack]()
        for row in q:
            turn = self._wrist.turn(row)
            circles = circles if turn is None else with_others(circles, [WristTrack(row, turn, 0.0, 0.0, TURN)])
        intervals = tuple(_on_circles(circles, members, 0))
        family = Family(intervals, members, branches=len(circles), complete=self._sees_loops)
        return FamilyFindings(family, members, lambda: None, lambda: circles)

    def turned(self, q: Array, past: float) -> Array:
        """Branches (k, 6) whose wrists may be straight, turned until a joint is on a limit; (m, 6) [rad].

        The tool stays within the tolerance of orientation, and no joint is farther past its limit than so [rad].
        """
        robot, tolerance = self._verifier.robot, self._verifier.options.orientation_tolerance
        turns = ((row, self._wrist.turn(row, max(tolerance, ALMOST_STRAIGHT))) for row in q)
        circles = [WristTrack(row, turn, 0.0, 0.0, TURN) for row, turn in turns if turn is not None]
        rows = [circle.corners(robot.lower, robot.upper, past)[:, : robot.dof] for circle in circles]
        return np.vstack(rows) if rows else np.empty((0, robot.dof))

    def nearest(self, target: TargetPose, seed: Array) -> tuple[Array, float] | None:
        """See `FamilySearch`."""
        axis, sign = self._last_axis(target)
        return super().nearest(target, seed) if sign == 0.0 else self._nearest_about_last_axis(axis, seed, sign)

    def _nearest_about_last_axis(self, target: FreeAxis, seed: Array, sign: float) -> tuple[Array, float] | None:
        """As `nearest`: joint 6 goes to the seed's, or as near to it as the range and the limits let it."""
        robot = self._verifier.robot
        branches = self._form.solve_all(target.matrix, seed)
        if not branches.complete:
            return None
        rows, parameters = [], []
        lower, upper = float(robot.lower[5]), float(robot.upper[5])
        for q in branches.q[(branches.margin[:, :5] >= 0.0).all(axis=1)].tolist():
            wanted = sign * (float(seed[5]) - q[5])
            for start, stop, _ in _turns_of_joint_6(q[5], sign, target, lower, upper):
                p = wanted + TURN * round((0.5 * (start + stop) - wanted) / TURN)
                for each in (p,) if start <= p <= stop else (start, stop):
                    parameters.append(each)
                    rows.append([*q[:5], q[5] + sign * each])
        if not rows:
            return None
        copies = angles.into_limits(angles.nearest_copy(np.array(rows), seed), robot.lower, robot.upper)
        best = int(np.argmin(((copies - seed) ** 2).sum(axis=1)))
        return copies[best], parameters[best]

    def _last_axis(self, target: TargetPose) -> tuple[FreeAxis, float]:
        """The free axis, and 1 or -1 where it is the axis of the last joint, one way or the other; else 0."""
        free = target.free_axis
        assert free is not None  # what a six-joint arm is asked for here
        x, y, z = free.axis.tolist()
        (*_, dx), (*_, dy), (u, v, w, _) = self._tool_in_joint_6.tolist()  # u, v, w: z of joint 6 in the tool frame
        if math.hypot(dx, dy) > SAME_AXIS or math.hypot(y * w - z * v, z * u - x * w, x * v - y * u) > SAME_AXIS:
            return free, 0.0
        return free, math.copysign(1.0, x * u + y * v + z * w)

    def _about_last_axis(self, target: TargetPose, free: FreeAxis, seed: Array, sign: float) -> FamilyFindings:
        """Joint 6 takes up every turn, the others stay: the branches of one pose, and a range of joint 6 for each."""
        robot, members = self._verifier.robot, Members(self._verifier, target, seed)
        branches = self._form.solve_all(target.matrix, seed)
        rows = np.column_stack([branches.q, np.zeros(len(branches.q))])
        many = _are_crowded(branches.q) or self._edge.nearly_stuck_twice(rows, self._arm.problem(target))
        complete = not branches.dropped and self._sees_loops and not many
        intervals, tracks = [], []
        for number, (q, margin) in enumerate(zip(branches.q, branches.margin, strict=True)):
            tracks.append(CircleTrack(q, sign, *free.range))
            if (margin[:5] < 0.0).any():
                continue
            if (turn := self._wrist.turn(q)) is not None and math.isinf(robot.upper[3] - robot.lower[3]):
                end = IntervalEnd("circle" if free.full_turn else "range")
                limits = float(robot.lower[5]), float(robot.upper[5])
                spun = SpunWristTrack(q, turn, sign, limits, *free.range)
                intervals.append(Interval(members, spun, number, (end, end)))
                continue
            complete = complete and self._wrist.turn(q, ALMOST_STRAIGHT) is None
            for start, stop, ends in _turns_of_joint_6(q[5], sign, free, robot.lower[5], robot.upper[5]):
                reasons = (_end(ends[0], robot), _end(ends[1], robot))
                intervals.append(Interval(members, CircleTrack(q, sign, start, stop), number, reasons))
        family = Family(tuple(intervals), members, branches=len(branches), complete=complete)
        return FamilyFindings(family, members, lambda: _find_least_excess(tracks, robot, exact=True), lambda: tracks)

    def _tracks(self, target: TargetPose, T: Array) -> Sequence[Track]:
        """See `FamilySearch`."""
        free, sign = self._last_axis(target)
        if sign == 0.0:
            return super()._tracks(target, T)
        return [CircleTrack(q, sign, *free.range) for q in self._form.solve_all(T, self._verifier.robot.home).q]


def seven_joint_families(verifier: Verifier) -> FamilySearch:
    """Families of a seven-joint arm at full poses; the parameter is joint 3.

    Raises:
        StructureError: axes 1 and 2, or 5, 6 and 7, do not meet.
    """
    robot = verifier.robot
    geometry = measure_seven(robot.pin_model, verifier.frame_id, verifier.tool)
    return FamilySearch(verifier, CurveArm(JOINT_3, geometry.chain, geometry.arm, robot.lower, robot.upper))


def _error(result: IKResult) -> float:
    return combined_error(result.position_error, result.orientation_error)


def _turns_of_joint_6(
    q6: float, sign: float, target: FreeAxis, lower: float, upper: float
) -> list[tuple[float, float, tuple[int, int]]]:
    """Ranges of the parameter in which joint 6 has a copy within its limits, with the codes of their ends."""
    low, high = target.range
    if target.full_turn:
        low, high = -math.pi, math.pi
    free = SEAM if target.full_turn else RANGE
    if upper - lower >= TURN:
        return [(low, high, (free, free))]
    edges = sorted((sign * (lower - q6), sign * (upper - q6)))
    codes = (10, 11) if sign > 0.0 else (11, 10)  # of joint 6, see `limit_cuts`
    found = []
    for turn in range(math.floor((low - edges[1]) / TURN), math.ceil((high - edges[0]) / TURN) + 1):
        a, b = edges[0] + TURN * turn, edges[1] + TURN * turn
        if target.full_turn:
            if low <= a < high:  # an interval may pass pi
                found.append((a, b, codes))
        elif max(a, low) <= min(b, high):
            found.append((max(a, low), min(b, high), (codes[0] if a >= low else free, codes[1] if b <= high else free)))
    return found


def _is_small(arcs: Sequence[Array], size: float) -> bool:
    """Whether along every curve (m, 14) no angle changes by more than a size [rad]."""
    return all(float(np.ptp(nodes[:, :7], axis=0).max()) < size for nodes in arcs)


def _reaching(found: FoundCurves, members: Members, parameter: int) -> FoundCurves:
    """The same without points, cut out of curves by limits, that miss the target or are no members."""
    reaching = [each for each in found.pieces if _is_long(each, parameter) or _closes(each, members, parameter)]
    kept = [each for each in reaching if _is_long(each, parameter) or _is_member(each, members, parameter)]
    return found._replace(pieces=kept, complete=found.complete and len(reaching) == len(found.pieces))


def _is_long(piece: Piece, parameter: int) -> bool:
    """Whether a piece is more than a point that limits cut out of a curve."""
    return abs(piece.ends.item(1, parameter) - piece.ends.item(0, parameter)) >= SMALL


def _closes(piece: Piece, members: Members, parameter: int) -> bool:
    """Whether both ends of a piece reach the target."""
    dof = members.robot.dof
    errors = [members.verifier.measure(x[:dof], members.target.at(float(x[parameter]))) for x in piece.ends]
    return max(map(max, errors)) <= MEMBER_CLOSURE


def _is_member(piece: Piece, members: Members, parameter: int) -> bool:
    """Whether a piece that is a point, where joints pass their limits at once, is within them but for rounding."""
    x = piece.ends[0]
    try:
        members.verified(members.copies(x[: members.robot.dof], members.seed), float(x[parameter]))
    except LostMemberError:
        return False
    return True


def _on_circles(circles: Sequence[WristTrack], members: Members, first: int) -> list[Interval]:
    """What is within the limits of circles; their branches are numbered from the first on."""
    robot, intervals = members.robot, []
    for branch, circle in enumerate(circles, first):
        for track, codes in circle.within(robot.lower, robot.upper):
            low, high = (SEAM if code < 0 else code for code in codes)
            intervals.append(Interval(members, track, branch, (_end(low, robot), _end(high, robot))))
    return intervals


def _at_corners(circles: Sequence[WristTrack], edge: Edge, problem: CurveProblem, robot: Robot) -> list[LimitExcess]:
    """Single members, on limits, of circles that are outside by no more than circles may be off where curves meet."""
    rows = [
        circle.corners(robot.lower, robot.upper) for circle in circles if not circle.within(robot.lower, robot.upper)
    ]
    corners = np.vstack(rows) if rows else np.empty((0, DIMENSIONS))
    return [point for point in edge.fitted(corners, problem) if not point.excess.any()] if len(corners) else []


def _is_among(point: LimitExcess, points: Sequence[LimitExcess]) -> bool:
    return any(np.abs(angles.wrap_to_pi(point.q - other.q)).max() <= SAME_POINT for other in points)


def _are_crowded(q: Array) -> bool:
    """Whether three branches (k, dof) are about the same: of nearly a continuum, which the closed form has some of."""
    apart = np.abs(angles.wrap_to_pi(q[:, np.newaxis] - q)).max(axis=2)
    return bool((np.sum(apart <= SAME_POINT, axis=1) > 2).any())


def _are_single(points: Sequence[LimitExcess], members: Members) -> bool:
    """Whether single points reach the target to rounding, and none is near another: else they are amid small curves.

    Such a curve is as wide as the root of what a point misses: 1e-4 rad and more for 2e-13.
    """
    misses = [max(members.verifier.measure(point.q, members.target.at(point.parameter))) for point in points]
    return all(miss <= EXACT_POINT or miss > MEMBER_CLOSURE for miss in misses) and not any(
        _is_among(point, points[:i]) for i, point in enumerate(points)
    )


def _at_points(points: Sequence[LimitExcess], members: Members, first: int) -> list[Interval]:
    """What is within the limits of single points; their branches are numbered from the first on."""
    intervals = []
    for branch, point in enumerate(points, first):
        closure = max(members.verifier.measure(point.q, members.target.at(point.parameter)))
        if closure <= MEMBER_CLOSURE and not point.excess.any():
            intervals.append(Interval(members, _at(point), branch, (IntervalEnd("fold"), IntervalEnd("fold"))))
    return intervals


def _at_range_ends(found: FoundCurves, problem: CurveProblem, members: Members, edge: Edge) -> list[Interval]:
    """Where curves leave the limits at an end of the range: single members there, past limits by rounding.

    If the end is a fold, too, that is the root of rounding, and a point on the limits is looked for.
    """
    robot, snap, intervals = members.robot, members.verifier.options.limit_snap, []
    reason = IntervalEnd("range")
    if problem.closed:
        return []
    for branch, (nodes, ends) in enumerate(zip(found.arcs, found.ends, strict=True)):
        codes = [piece.codes for piece in found.pieces if piece.branch == branch]
        for side, end in enumerate(ends):
            if -1 - end != RANGE or any(code[side] == RANGE for code in codes):
                continue
            x = nodes[-side, :7]
            q = angles.into_limits(x[: robot.dof], robot.lower, robot.upper)
            p = members.target.nearest_angle(float(x[problem.arm.parameter]))
            excess = np.abs(angles.wrap_to_pi(q - x[: robot.dof]))
            if snap < excess.max() <= NEAR_LIMIT:
                points = [point for point in edge.fitted(x[np.newaxis], problem) if not point.excess.any()]
                q, p = (points[0].q, points[0].parameter) if points else (q, p)
            elif excess.max() > snap:
                continue
            if max(members.verifier.measure(q, members.target.at(p))) <= MEMBER_CLOSURE:
                intervals.append(Interval(members, CircleTrack(q, 0.0, p, p), branch, (reason, reason)))
    return intervals


def _stands_still_at_range_end(found: FoundCurves, parameter: int) -> bool:
    """Whether the parameter of a curve hardly changes where the range ends: next to the circle of a straight wrist."""
    for nodes, ends in zip(found.arcs, found.ends, strict=True):
        for end, from_end in zip(ends, (nodes[:, :7], nodes[::-1, :7]), strict=True):
            if -1 - end == RANGE:
                way = from_end - from_end[0]
                long = np.linalg.norm(way, axis=1) > STILL_LENGTH
                first = int(np.argmax(long))
                if long[first] and abs(way[first, parameter]) < STILL * np.linalg.norm(way[first]):
                    return True
    return False


def _on_edge(
    alone: Sequence[LimitExcess],
    circles: Sequence[WristTrack],
    members: Members,
    nearest: LimitExcess | None,
    *,
    complete: bool,
) -> FamilyFindings:
    """What reaches a target at single points and on circles; `nearest` comes nearest to the limits."""
    intervals = [*_at_points(alone, members, 0), *_on_circles(circles, members, len(alone))]
    family = Family(tuple(intervals), members, branches=len(alone) + len(circles), complete=complete)
    return FamilyFindings(family, members, lambda: nearest, lambda: [*circles, *map(_at, alone)])


def _at(point: LimitExcess) -> CircleTrack:
    """A single configuration as a track."""
    return CircleTrack(point.q, 0.0, point.parameter, point.parameter)


def _whole_arcs(problem: CurveProblem, arcs: Sequence[Array]) -> list[CurveTrack]:
    """Arcs (m, 14) as tracks, within the limits or not."""
    return [CurveTrack(problem, whole_piece(arc, branch)) for branch, arc in enumerate(arcs)]


def _find_least_excess(tracks: Sequence[Track], robot: Robot, *, exact: bool) -> LimitExcess | None:
    """Where tracks come nearest to the limits; not `exact` to about 1e-3 rad, where points of a curve may be lost."""
    bounded = robot.upper - robot.lower < TURN
    lower, upper = np.where(bounded, robot.lower, -np.inf), np.where(bounded, robot.upper, np.inf)

    def excess(rows: Array) -> Array:
        beyond: Array = np.abs(angles.wrap_to_pi(rows - angles.into_limits(rows, lower, upper)))
        return beyond

    best: tuple[float, float, Array] | None = None
    for track in tracks:
        if exact:
            at = least(lambda rows: excess(rows).max(axis=1), *track.guesses(), track.joints)
            p, q = track.point(at)
        else:
            parameters, rows = track.polyline()
            index = int(excess(rows).max(axis=1).argmin())
            p, q = float(parameters[index]), rows[index]
        worst = float(excess(q).max())
        if best is None or worst < best[0]:
            best = (worst, p, q)
    if best is None:
        return None
    _, parameter, q = best
    return LimitExcess(angles.into_limits(q, robot.lower, robot.upper), excess(q), parameter)


def _end(code: int, robot: Robot) -> IntervalEnd:
    """An end in words from its code, see `curves`."""
    if code >= 0:
        limit = (robot.lower, robot.upper)[code % 2][code // 2]
        return IntervalEnd("limit", robot.joint_names[code // 2], float(limit))
    return IntervalEnd({FOLD: "fold", RANGE: "range", SEAM: "circle", LOST: "lost"}[code])
