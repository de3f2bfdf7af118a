"""From a target to its `Family`: which kind of free parameter it has, and what its intervals are."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from jacokin.arrays import Array
from jacokin.ik.closed_form import ClosedForm
from jacokin.ik.diagnosis import Mildest
from jacokin.ik.families.curves import (
    FOLD,
    FREE_AXIS,
    JOINT_3,
    LOST,
    RANGE,
    SEAM,
    Curves,
    Piece,
    Problem,
    arm_of,
    whole_piece,
)
from jacokin.ik.families.edge import Edge, Point
from jacokin.ik.families.family import MEMBER_CLOSURE, Family, Interval, IntervalEnd, Members
from jacokin.ik.families.tracks import CircleTrack, CurveTrack, PointTrack, Track
from jacokin.ik.geometry import measure_seven
from jacokin.ik.preferences import least
from jacokin.ik.targets import TargetPose
from jacokin.ik.verification import Verifier
from jacokin.model import angles
from jacokin.model.angles import TURN
from jacokin.model.poses import FreeAxis
from jacokin.model.robot import Robot

#: Sine and [m]: a free axis this near to the axis of the last joint is that axis. Members close to 1e-9 all the same.
SAME_AXIS = 1e-10
#: [rad] of the parameter: curves that are all shorter are looked at as points; the second one where some were lost.
SMALL, SMALL_LOST = 1e-5, 1e-3


class Findings(NamedTuple):
    """The family of a target, and what its members have in common."""

    family: Family
    members: Members
    mildest: Callable[[], Mildest | None]  # of branches that break limits; None when nothing reaches the target


class SixJointFamilies:
    """Families of a six-joint arm whose tool may turn about an axis."""

    __slots__ = ("_curves", "_edge", "_form", "_tool_in_joint_6", "_verifier")

    def __init__(self, form: ClosedForm, verifier: Verifier) -> None:
        """Take the closed form of the arm."""
        chain, constants, _ = form.constants
        robot = verifier.robot
        self._form, self._verifier, self._edge = form, verifier, Edge(verifier)
        self._tool_in_joint_6 = chain[6]
        self._curves = Curves(arm_of(FREE_AXIS, chain, constants, robot.lower, robot.upper))

    def find(self, target: FreeAxis, seed: Array) -> Findings:
        """Everything that reaches a target; unlimited joints in the copies nearest to a seed (6,)."""
        members = Members(self._verifier, target, seed)
        sign = self._sign_of_last_axis(target.axis)
        if sign != 0.0:
            return self._about_last_axis(target, members, sign)
        return on_curves(self._curves, self._curves.problem(target.matrix, target.axis), members, self._edge)

    def nearest(self, target: FreeAxis, seed: Array) -> tuple[Array, float] | None:
        """The member (6,) nearest to a seed and its parameter [rad]; None where only `find` can tell."""
        sign = self._sign_of_last_axis(target.axis)
        if sign != 0.0:
            return self._nearest_about_last_axis(target, seed, sign)
        x = self._curves.nearest(self._curves.problem(target.matrix, target.axis), target, seed)
        return None if x is None else (x[:6], float(x[6]))

    def _nearest_about_last_axis(self, target: FreeAxis, seed: Array, sign: float) -> tuple[Array, float] | None:
        """As `nearest`: joint 6 goes to the seed's, or as near to it as the range and the limits let it."""
        robot = self._verifier.robot
        table = self._form.solve_all(target.matrix, seed)
        if table.dropped or table.singular.any():
            return None
        rows, parameters = [], []
        lower, upper = float(robot.lower[5]), float(robot.upper[5])
        for q in table.q[(table.margin[:, :5] >= 0.0).all(axis=1)].tolist():
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

    def _sign_of_last_axis(self, axis: Array) -> float:
        """1 or -1 where the axis (3,) in the tool frame is that of the last joint, else 0."""
        x, y, z = axis.tolist()
        (*_, dx), (*_, dy), (u, v, w, _) = self._tool_in_joint_6.tolist()  # u, v, w: z of joint 6 in the tool frame
        if math.hypot(dx, dy) > SAME_AXIS or math.hypot(y * w - z * v, z * u - x * w, x * v - y * u) > SAME_AXIS:
            return 0.0
        return math.copysign(1.0, x * u + y * v + z * w)

    def _about_last_axis(self, target: FreeAxis, members: Members, sign: float) -> Findings:
        """Joint 6 takes up every turn, the others stay: the branches of one pose, and a range of joint 6 for each."""
        robot = self._verifier.robot
        table = self._form.solve_all(target.matrix, members.seed)
        intervals, tracks = [], []
        low, high = target.range
        for branch, (q, margin) in enumerate(zip(table.q, table.margin, strict=True)):
            tracks.append(CircleTrack(q, sign, low, high))
            if (margin[:5] < 0.0).any():
                continue
            for start, stop, ends in _turns_of_joint_6(q[5], sign, target, robot.lower[5], robot.upper[5]):
                reasons = (_end(ends[0], robot), _end(ends[1], robot))
                intervals.append(Interval(members, CircleTrack(q, sign, start, stop), branch, reasons))
        complete = not (table.dropped or table.singular.any())
        family = Family(tuple(intervals), members, branches=len(table), complete=complete)
        return Findings(family, members, lambda: _mildest(tracks, robot, exact=True))


class SevenJointFamilies:
    """Families of a seven-joint arm at full poses; the parameter is joint 3."""

    __slots__ = ("_curves", "_edge", "_verifier", "misfit")

    def __init__(self, verifier: Verifier) -> None:
        """Measure the structure of the arm.

        Raises:
            StructureError: axes 1 and 2, or 5, 6 and 7, do not meet.
        """
        robot = verifier.robot
        geometry = measure_seven(robot.pin_model, verifier.frame_id, verifier.tool)
        self._verifier, self._edge = verifier, Edge(verifier)
        self.misfit = geometry.misfit
        self._curves = Curves(arm_of(JOINT_3, geometry.chain, geometry.arm, robot.lower, robot.upper))

    def find(self, target: TargetPose, seed: Array) -> Findings:
        """Everything that reaches a pose; unlimited joints in the copies nearest to a seed (7,)."""
        members = Members(self._verifier, target, seed)
        return on_curves(self._curves, self._curves.problem(target.matrix), members, self._edge)

    def nearest(self, target: TargetPose, seed: Array) -> tuple[Array, float] | None:
        """The member (7,) nearest to a seed and its joint 3 [rad]; None where only `find` can tell."""
        x = self._curves.nearest(self._curves.problem(target.matrix), None, seed)
        return None if x is None else (x, float(x[JOINT_3]))


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


def on_curves(curves: Curves, problem: Problem, members: Members, edge: Edge) -> Findings:
    """Everything on the solution curves of a problem."""
    robot, target = members.robot, members.target
    axis = target if isinstance(target, FreeAxis) else None
    found = curves.find(problem, axis)
    closed = axis is None or axis.full_turn
    small = _is_small(found.arcs, problem.arm.parameter, SMALL if found.complete else SMALL_LOST)
    if small or not found.complete:
        stuck = edge.holds(found.arcs, problem, axis)
        pieces_kept = [piece for piece in found.pieces if _closes(piece, members, problem.arm.parameter)]
        found = found._replace(pieces=pieces_kept, complete=found.complete and len(pieces_kept) == len(found.pieces))
        if not pieces_kept or (small and stuck):
            sight = edge.look(curves, problem, axis)
            if sight.parameters:
                found = curves.find(problem, axis, sight.parameters)
            points = _on_edge(sight.points, members, complete=stuck)
            if len(points.family) or (points.family.branches and stuck):
                return points
    intervals = []
    for piece in sorted(found.pieces, key=lambda piece: (piece.branch, piece.ends[0, problem.arm.parameter])):
        ends = (_end(piece.codes[0], robot), _end(piece.codes[1], robot))
        intervals.append(Interval(members, CurveTrack(curves, problem, piece, closed), piece.branch, ends))
    family = Family(tuple(intervals), members, branches=len(found.arcs), complete=found.complete)

    def mildest() -> Mildest | None:
        whole_arcs = [whole_piece(arc, branch) for branch, arc in enumerate(found.arcs)]
        return _mildest(
            [CurveTrack(curves, problem, piece, closed) for piece in whole_arcs], robot, exact=found.complete
        )

    return Findings(family, members, mildest)


def _is_small(arcs: Sequence[Array], parameter: int, length: float) -> bool:
    """Whether all curves are shorter than a length [rad] of the parameter."""
    return all(abs(nodes[-1, parameter] - nodes[0, parameter]) < length for nodes in arcs)


def _closes(piece: Piece, members: Members, parameter: int) -> bool:
    """Whether both ends of a piece reach the target."""
    dof = members.robot.dof
    errors = [members.verifier.measure(x[:dof], members.pose_at(float(x[parameter]))) for x in piece.ends]
    return max(map(max, errors)) <= MEMBER_CLOSURE


def _on_edge(points: Sequence[Point], members: Members, *, complete: bool) -> Findings:
    """What reaches a target at single points."""
    intervals = []
    for branch, point in enumerate(points):
        closure = max(members.verifier.measure(point.q, members.pose_at(point.parameter)))
        if closure <= MEMBER_CLOSURE and not point.excess.any():
            track = PointTrack(point.q, point.parameter)
            intervals.append(Interval(members, track, branch, (IntervalEnd("fold"), IntervalEnd("fold"))))
    family = Family(tuple(intervals), members, branches=len(points), complete=complete)
    mildest = Mildest(points[0].q, points[0].excess, points[0].parameter) if points else None
    return Findings(family, members, lambda: mildest)


def _mildest(tracks: Sequence[Track], robot: Robot, *, exact: bool) -> Mildest | None:
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
    return Mildest(angles.into_limits(q, robot.lower, robot.upper), excess(q), parameter)


def _end(code: int, robot: Robot) -> IntervalEnd:
    """An end in words from its code, see `pieces`."""
    if code >= 0:
        limit = (robot.lower, robot.upper)[code % 2][code // 2]
        return IntervalEnd("limit", robot.joint_names[code // 2], float(limit))
    return IntervalEnd({FOLD: "fold", RANGE: "range", SEAM: "circle", LOST: "lost"}[code])
