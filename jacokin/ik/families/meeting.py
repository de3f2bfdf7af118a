"""`follow_curves`: the curves of a target where some of them meet, or are single points: singular configurations.

No tangent tells there how a curve goes on. Where slices lose a curve, the place is found exactly, the curve is solved
for closely at both sides of it and joined across, or ends there.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from jacokin.arrays import Array
from jacokin.ik.families.census import are_counted, lacks_any, take_census
from jacokin.ik.families.curves import CurveProblem, FoundCurves, whole_piece
from jacokin.ik.families.edge import STUCK, Edge
from jacokin.ik.families.recut import SLACK, cut_again, cut_whole, excess_of
from jacokin.ik.families.straight_wrist import NEARLY_STRAIGHT, TOUCHING, StraightWrist, WristTrack, nearly_meet
from jacokin.ik.families.stretched import walk_to_folds
from jacokin.ik.families.tracks import CurveTrack
from jacokin.kernels.self_motion.intervals import SAME_SLICE
from jacokin.kernels.self_motion.slices import SAME_PARAMETER
from jacokin.model import angles
from jacokin.model.angles import TURN

#: [rad] how far from where curves meet they are solved for at both sides: nearer where they are steep, farther where
#: they meet at a small angle.
ROOM = (1e-3, 3e-5, 2e-2)
#: [rad] places nearer to each other are one.
SAME_PLACE = 3.0 * max(ROOM)
#: [rad] how far from where a curve was lost it is looked for at more values of the parameter.
AROUND_LOST = (-0.06, -0.03, -0.01, 0.01, 0.03, 0.06)
#: [rad] of the parameter: shorter curves may lie between two slices.
SHORT = 0.1
#: [rad] curves along which no angle changes by more are lost where they are solved for at both sides of their middle.
TINY = 1e-3
#: Where to look for others beside one that is: from its start, in its lengths.
BESIDE_SHORT = (-1.0, -0.5, -0.1, 1.1, 1.5, 2.0)
#: [rad] a point nearer to a node of a curve is on it.
ON_CURVE = 0.05
#: [rad] one this near is on it, none so far from all nodes is, and a joint so far past its limit is outside.
SAME_POINT, NEARBY, NEAR_LIMIT = 1e-7, 0.8, 1e-7


class Followed(NamedTuple):
    """The curves of a target, and what is beside them."""

    found: FoundCurves
    circles: list[WristTrack]
    """Of straight wrists."""
    points: Array
    """(k, 7) singular configurations that no curve passes."""


def follow_curves(problem: CurveProblem, edge: Edge, wrist: StraightWrist, also: Sequence[float] = ()) -> Followed:
    """The curves of a target, also where they meet; `also` are parameters to solve at too [rad]."""
    found = _with_neighbours(problem.find(also), problem, also)
    doubtful = edge.doubtful(found.at_quarters, found.motion_at_quarters, found.arcs, problem)
    regular = not len(doubtful) or bool((edge.mobility(doubtful, problem) > STUCK).all())  # on a limit, no more
    none = doubtful[:0]
    if found.complete and found.cut and regular:
        near = found.straight if problem.arm.sees_straight_wrists else wrist.starts(found.arcs, TOUCHING)
        circles = wrist.circles(near, problem)
        if not circles and not len(doubtful):
            return Followed(found._replace(complete=not wrist.hides_any(near, problem)), [], none)
        followed = _joined(found, circles, none, problem, edge) if circles else Followed(found, [], none)
    else:
        followed = _follow_singular(found, doubtful, problem, edge, wrist, also)
    if not followed.found.complete and problem.free_axis is None:
        followed = followed._replace(found=walk_to_folds(followed.found, problem))
    followed = _counted(_cut_again(followed, problem, edge), doubtful, problem, edge, also)
    at_nodes = [_is_at_node(x, followed.found.arcs) for x in found.at_quarters]
    doubtful = np.vstack([doubtful, found.at_quarters[np.logical_not(at_nodes)]])
    lost = [x for x in np.vstack([followed.points, doubtful]) if not _is_passed(x, followed, problem, edge)]
    points = np.array(lost).reshape(-1, 7)
    beside = edge.beside(points, problem)
    if (
        edge.nearly_stuck_twice(np.vstack([doubtful, followed.points, followed.found.singular]), problem)
        or nearly_meet(followed.circles)
        or wrist.hides_any(np.vstack([found.straight, doubtful]), problem)
        or _is_any_missed(points, followed.found.arcs, problem, edge)
        or not are_counted(beside, followed.found, problem)
    ):
        followed = followed._replace(found=followed.found._replace(complete=False))
    return followed._replace(points=points)


def _with_neighbours(found: FoundCurves, problem: CurveProblem, also: Sequence[float]) -> FoundCurves:
    """The same with what is beside its short curves: near two singularities there may be others as short."""
    parameter = problem.arm.parameter
    spans = [(float(nodes[0, parameter]), _length(nodes, parameter)) for nodes in found.arcs]
    short = [(start, length) for start, length in spans if SAME_PARAMETER < length < SHORT]
    if not short:
        return found
    places = [start + away * length for away in BESIDE_SHORT for start, length in short]
    more = problem.find([*also, *_distinct(places, SAME_SLICE)])
    return more if len(more.arcs) > len(found.arcs) else found


def _cut_again(followed: Followed, problem: CurveProblem, edge: Edge) -> Followed:
    """The same, cut by the limits also where curves meet."""
    pieces = [part for piece in followed.found.pieces for part in cut_again(piece, problem, edge)]
    return followed._replace(found=followed.found._replace(pieces=pieces))


def _counted(followed: Followed, doubtful: Array, problem: CurveProblem, edge: Edge, also: Sequence[float]) -> Followed:
    """The same with what a census finds missing, as far as it can be had; else not complete."""
    parameter = problem.arm.parameter
    singular = np.vstack([followed.found.singular, followed.points, doubtful])[:, parameter].tolist()
    singular = _distinct([*(circle.start for circle in followed.circles), *singular], SAME_PARAMETER)
    census = take_census(followed.found, problem, singular)
    if census.curves:
        found = problem.find([*also, *census.curves], quarters=False)
        again = _cut_again(followed._replace(found=found), problem, edge)
        other = take_census(again.found, problem, singular)
        if found.complete and not other.curves:
            followed, census = again, other
    if census.branches:
        found = followed.found
        kept = [piece for piece in found.pieces if piece.branch not in census.branches]
        more = [piece for branch in census.branches for piece in cut_whole(found, branch, problem, edge)]
        followed = followed._replace(found=found._replace(pieces=[*kept, *more]))
        census = take_census(followed.found, problem, singular)
    if census.curves or census.branches or (followed.found.complete and lacks_any(followed.found, problem, singular)):
        followed = followed._replace(found=followed.found._replace(complete=False))
    return followed


def _follow_singular(
    found: FoundCurves,
    doubtful: Array,
    problem: CurveProblem,
    edge: Edge,
    wrist: StraightWrist,
    also: Sequence[float],
) -> Followed:
    """The curves of a target that has singular configurations; their `points` may be on curves."""
    parameter = problem.arm.parameter
    singular = np.vstack([found.singular, edge.meeting_points(doubtful, problem)])
    rows = [found.straight, wrist.starts(found.arcs, NEARLY_STRAIGHT), singular, doubtful]
    circles = wrist.circles(np.vstack(rows), problem)
    if not circles and not len(singular):
        # A quarter turn may be a fold, where slices see two points or none; short curves are not to be missed then.
        middles = [nodes[len(nodes) // 2, parameter] for nodes in found.arcs if _length(nodes, parameter) < SHORT]
        beside = edge.beside(doubtful, problem)[:, parameter].tolist()
        found = problem.find([*also, *middles, *beside], quarters=False)
        if found.complete:
            return Followed(found, [], singular)
        found = problem.find([p + away for p in found.lost_ends[:, parameter] for away in AROUND_LOST])
        rows = [found.straight, wrist.starts(found.arcs, NEARLY_STRAIGHT), found.singular]
        circles = wrist.circles(np.vstack(rows), problem)
    return _joined(found, circles, singular, problem, edge)


def _joined(
    found: FoundCurves, circles: list[WristTrack], singular: Array, problem: CurveProblem, edge: Edge
) -> Followed:
    """The curves, joined across circles and singular configurations (k, 7), or ended there."""
    parameter = problem.arm.parameter
    places = [*(circle.start for circle in circles), *singular[:, parameter].tolist()]
    first, middles = found, [nodes[len(nodes) // 2, :7] for nodes in found.arcs]
    tiny = [x for x, nodes in zip(middles, found.arcs, strict=True) if np.ptp(nodes[:, :7], axis=0).max() < TINY]
    for room in ROOM:
        if places:
            found = problem.find(crossings=_distinct(places), room=room)
        ended = found if found.complete else _ended(found, np.vstack([singular, found.singular]), problem, edge)
        if not all(any(_distance(nodes, x) <= NEARBY for nodes in found.arcs) for x in middles) or not all(
            _is_passed_by(x, found.arcs, problem, edge) for x in tiny
        ):
            found = _ended(first, np.vstack([singular, first.singular]), problem, edge)._replace(complete=False)
            break  # curves so short that they lie between both sides
        if ended.complete:
            found = ended
            break
        met = edge.meeting_points(np.vstack([found.lost_ends, found.singular]), problem)
        places = [*places, *met[:, parameter].tolist()]
    return Followed(found, circles, singular)


def _ended(found: FoundCurves, points: Array, problem: CurveProblem, edge: Edge) -> FoundCurves:
    """The curves that were lost near points (k, 7) end there, cut anew where that brings one within the limits."""
    ended = found.ended_at(points, problem.arm.parameter)
    pieces = ended.pieces
    for branch, (short, nodes) in enumerate(zip(found.arcs, ended.arcs, strict=True)):
        sides = [side for side in (0, 1) if found.ends[branch][side] != ended.ends[branch][side]]
        inside = excess_of(nodes[[0, -1], :7], problem.arm.limits).max(axis=1) <= SLACK
        if len(nodes) > len(short) and any(
            inside[side] and not any(piece.is_lost(branch, side) for piece in found.pieces) for side in sides
        ):
            others = [piece for piece in pieces if piece.branch != branch]
            pieces = [*others, *cut_whole(ended, branch, problem, edge)]
    return ended._replace(pieces=pieces)


def _is_passed(x: Array, followed: Followed, problem: CurveProblem, edge: Edge) -> bool:
    """Whether a point (7,) is on a curve or on a circle."""
    dof = edge.chain.dof
    if any(circle.passes(x[:dof]) for circle in followed.circles):
        return True
    inside = edge.inside(x[np.newaxis])[0]
    if np.abs(angles.wrap_to_pi(inside - x)).max() > NEAR_LIMIT:
        return any(_distance(nodes, x) <= ON_CURVE for nodes in followed.found.arcs)
    for piece in followed.found.pieces:
        if _distance(piece.nodes, x) <= NEARBY:
            nearest = CurveTrack(problem, piece).nearest(inside[:dof])
            if nearest is not None and np.abs(angles.wrap_to_pi(nearest[1] - x[:dof])).max() <= SAME_POINT:
                return True
    return False


def _is_passed_by(x: Array, arcs: Sequence[Array], problem: CurveProblem, edge: Edge) -> bool:
    """Whether a point (7,) is on any of some curves, exactly; one outside the limits always counts as such."""
    row = x[: edge.chain.dof]
    if excess_of(x[np.newaxis], problem.arm.limits).max() > SLACK:
        return True
    for nodes in arcs:
        if _distance(nodes, x) <= NEARBY:
            nearest = CurveTrack(problem, whole_piece(nodes, 0)).nearest(row)
            if nearest is None or np.abs(angles.wrap_to_pi(nearest[1] - row)).max() <= SAME_POINT:
                return True
    return False


def _is_any_missed(points: Array, arcs: Sequence[Array], problem: CurveProblem, edge: Edge) -> bool:
    """Whether any of the points (k, 7) is regular, and so on a curve, and not on those that were found."""
    regular = points[edge.mobility(points, problem) > STUCK] if len(points) else points
    if not len(regular):
        return False
    rows = [CurveTrack(problem, whole_piece(nodes, 0)).guesses()[1] for nodes in arcs]
    found, dof = np.vstack([np.empty((0, edge.chain.dof)), *rows]), edge.chain.dof
    return any(not (np.abs(angles.wrap_to_pi(found - x[:dof])).max(axis=1) <= ON_CURVE).any() for x in regular)


def _length(nodes: Array, parameter: int) -> float:
    """Of a curve (m, 14), along the parameter [rad]."""
    return float(nodes[-1, parameter] - nodes[0, parameter])


def _is_at_node(x: Array, arcs: Sequence[Array]) -> bool:
    return any(_distance(nodes, x) <= SAME_POINT for nodes in arcs)


def _distance(nodes: Array, x: Array) -> float:
    """From a point (7,) to the nearest of nodes (m, 14), in the joint that is farthest [rad]."""
    return float(np.abs(angles.wrap_to_pi(nodes[:, :7] - x)).max(axis=1).min())


def _distinct(places: Sequence[float], apart: float = SAME_PLACE) -> list[float]:
    """Values of the parameter without those that are nearly the same [rad]."""
    kept: list[float] = []
    for p in places:
        if all(abs(math.remainder(p - other, TURN)) > apart for other in kept):
            kept.append(p)
    return kept
