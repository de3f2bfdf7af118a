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
from jacokin.ik.families.curves import CurveProblem, FoundCurves
from jacokin.ik.families.edge import Edge
from jacokin.ik.families.straight_wrist import NEARLY_STRAIGHT, TOUCHING, StraightWrist, WristTrack
from jacokin.model import angles
from jacokin.model.angles import TURN

#: [rad] how far from where curves meet they are solved for at both sides: nearer where they are steep, farther where
#: they meet at a small angle.
ROOM = (1e-3, 3e-5, 2e-2)
#: [rad] places nearer to each other are one.
SAME_PLACE = 3.0 * max(ROOM)
#: [rad] how far from where a curve was lost it is looked for at more values of the parameter.
AROUND_LOST = (-0.06, -0.03, -0.01, 0.01, 0.03, 0.06)
#: [rad] a point nearer to a node of a curve is on it.
ON_CURVE = 0.05


class Followed(NamedTuple):
    """The curves of a target, and what is beside them."""

    found: FoundCurves
    circles: list[WristTrack]
    """Of straight wrists."""
    points: Array
    """(k, 7) singular configurations that no curve passes."""


def follow_curves(problem: CurveProblem, edge: Edge, wrist: StraightWrist, also: Sequence[float] = ()) -> Followed:
    """The curves of a target, also where they meet; `also` are parameters to solve at too [rad]."""
    none = np.empty((0, 7))
    parameter = problem.arm.parameter
    found = problem.find(also)
    if found.complete:
        if not wrist.is_near(found.arcs):
            return Followed(found, [], none)
        singular = none
        circles = wrist.circles(wrist.starts(found.arcs, TOUCHING), problem)
        if not circles:
            return Followed(found, [], none)
    else:
        singular = np.vstack([found.singular, edge.singular(found.at_quarters, problem)])
        circles = wrist.circles(np.vstack([wrist.starts(found.arcs, NEARLY_STRAIGHT), singular]), problem)
        if not circles and not len(singular):
            found = problem.find(also, quarters=False)  # one of them may be a fold, where slices see two points or none
            if found.complete:
                return Followed(found, [], none)
            found = problem.find([p + away for p in found.lost_ends[:, parameter] for away in AROUND_LOST])
            rows = np.vstack([wrist.starts(found.arcs, NEARLY_STRAIGHT), found.singular])
            circles = wrist.circles(rows, problem)
    places = [*(circle.start for circle in circles), *singular[:, parameter].tolist()]
    for room in ROOM:
        if places:
            found = problem.find(crossings=_distinct(places), room=room)
        ended = found if found.complete else found.ended_at(np.vstack([singular, found.singular]), parameter)
        if ended.complete:
            found = ended
            break
        met = edge.meeting_points(np.vstack([found.lost_ends, found.singular]), problem)
        places = [*places, *met[:, parameter].tolist()]
    alone = [x for x in singular if not _is_passed(x, found.arcs, circles, edge.chain.dof)]
    return Followed(found, circles, np.array(alone).reshape(-1, 7))


def _is_passed(x: Array, arcs: Sequence[Array], circles: Sequence[WristTrack], dof: int) -> bool:
    """Whether a point (7,) is on a curve or on a circle."""
    if any(circle.passes(x[:dof]) for circle in circles):
        return True
    return any(np.abs(angles.wrap_to_pi(nodes[:, :7] - x)).max(axis=1).min() <= ON_CURVE for nodes in arcs)


def _distinct(places: Sequence[float]) -> list[float]:
    """Values of the parameter without those that are nearly the same [rad]."""
    kept: list[float] = []
    for p in places:
        if all(abs(math.remainder(p - other, TURN)) > SAME_PLACE for other in kept):
            kept.append(p)
    return kept
