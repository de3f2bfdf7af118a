"""`take_census`: whether the curves found have all configurations of a target, and pieces all within the limits.

The closed form is solved at values of the parameter that curves were not drawn through: in the middle between ends of
curves and pieces, where each of them has one configuration, and next to singular configurations.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from jacokin.arrays import Array
from jacokin.ik.families.curves import FREE_AXIS, QUARTER_TURNS, CurveProblem, FoundCurves
from jacokin.ik.families.recut import excess_of
from jacokin.ik.families.tracks import CurveTrack
from jacokin.kernels.self_motion.slices import SAME_PARAMETER
from jacokin.model.angles import TURN, wrap_to_pi

#: [rad] how far from singular configurations it is taken, at both sides.
ASIDE = (1e-1, 2e-2, 2e-3, 1e-4)
#: [rad] of the parameter: no nearer to an end, where two configurations may count as one.
NEXT_TO_END = 1e-6
#: [rad] a joint this near to a limit may be taken for outside.
ON_LIMIT = 1e-6
#: [rad] points nearer to each other are one; of a singular target they are known no better.
SAME_POINT = 1e-4
#: [rad] one nearer to a piece is on it.
ON_CURVE = 1e-3


class Missing(NamedTuple):
    """Where something is missing."""

    curves: list[float]
    """Values of the parameter at which there are more configurations than curves [rad]."""
    branches: list[int]
    """Curves that have fewer pieces somewhere than there are configurations within the limits, perhaps."""


def take_census(found: FoundCurves, problem: CurveProblem, singular: Iterable[float]) -> Missing:
    """Count configurations and curves.

    Args:
        found: the curves.
        problem: their target.
        singular: values of the parameter with singular configurations [rad].
    """
    parameter = problem.arm.parameter
    arcs = _spans(found, parameter)
    pieces = np.array([piece.ends[:, parameter] for piece in found.pieces]).reshape(-1, 2)
    at = _places(np.concatenate([arcs.ravel(), pieces.ravel()]), list(singular), problem)
    points, numbers = problem.points_at(at)
    there = np.bincount(numbers, minlength=len(at))
    inside = excess_of(points, problem.arm.limits).max(axis=1) < -ON_LIMIT
    within = np.bincount(numbers[inside], minlength=len(at))
    lines = _covering(arcs, at)
    fewer = within > _covering(pieces, at).sum(axis=0)
    branches = np.flatnonzero((lines[:, fewer] > 0).any(axis=1))
    return Missing(at[there > lines.sum(axis=0)].tolist(), branches.tolist())


def lacks_any(found: FoundCurves, problem: CurveProblem, singular: Iterable[float]) -> bool:
    """Whether a configuration within the limits, where a census is taken, is on no piece, though as many are there.

    Next to a circle of straight wrists, a curve may have been taken for another one.
    """
    parameter = problem.arm.parameter
    tracks = [CurveTrack(problem, piece) for piece in found.pieces]
    pieces = np.array([piece.ends[:, parameter] for piece in found.pieces]).reshape(-1, 2)
    at = _places(np.concatenate([_spans(found, parameter).ravel(), pieces.ravel()]), list(singular), problem)
    points, numbers = problem.points_at(at)
    inside = excess_of(points, problem.arm.limits).max(axis=1) < -ON_LIMIT
    points, numbers = points[inside], numbers[inside]
    for i, p in enumerate(at.tolist()):
        turned = [(track, p + TURN * math.ceil((track.start - p) / TURN)) for track in tracks]
        members = [track.at(moved) for track, moved in turned if moved <= track.stop]
        for x in points[numbers == i]:
            row = x if parameter != FREE_AXIS else x[:FREE_AXIS]
            if not any(np.abs(wrap_to_pi(q - row)).max() <= ON_CURVE for q in members) and not any(
                (near := track.nearest(row)) is not None and np.abs(wrap_to_pi(near[1] - row)).max() <= ON_CURVE
                for track in tracks
            ):
                return True
    return False


def are_counted(x: Array, found: FoundCurves, problem: CurveProblem) -> bool:
    """Whether points (k, 7) are among those in closed form, and as many curves pass their parameters as these are."""
    parameter = problem.arm.parameter
    points, numbers = problem.points_at(x[:, parameter])
    lines = _covering(_spans(found, parameter), x[:, parameter]).sum(axis=0)
    for i, row in enumerate(x):
        rows = points[numbers == i]
        if len(rows) > lines[i] or not (np.abs(wrap_to_pi(rows - row)).max(axis=1) <= SAME_POINT).any():
            return False
    return True


def _spans(found: FoundCurves, parameter: int) -> Array:
    """From where to where curves go (m, 2), along the parameter [rad]."""
    return np.array([nodes[[0, -1], parameter] for nodes in found.arcs]).reshape(-1, 2)


def _places(ends: Array, singular: Sequence[float], problem: CurveProblem) -> Array:
    """Values of the parameter to count at [rad]."""
    free = problem.free_axis
    low, high = (-math.pi, math.pi) if free is None or free.full_turn else free.range
    known = np.concatenate([ends, singular, QUARTER_TURNS])
    known = np.unique(known - TURN * np.floor((known - low) / TURN))
    known = np.append(known, known[0] + TURN) if problem.closed else np.array([low, *known[known < high], high])
    middles = 0.5 * (known[1:] + known[:-1])[np.diff(known) > 2.0 * NEXT_TO_END]
    aside = np.array([p + sign * way for p in singular for way in ASIDE for sign in (1.0, -1.0)])
    if len(aside):
        away = np.abs(aside[:, np.newaxis] - known)
        aside = aside[np.minimum(away, np.abs(away - TURN)).min(axis=1) > NEXT_TO_END]
    places = np.concatenate([middles, aside])
    if not problem.closed:
        places = places[(places > low + SAME_PARAMETER) & (places < high - SAME_PARAMETER)]
    return places


def _covering(spans: Array, at: Array) -> Array:
    """How often spans (m, 2) of the parameter pass values (k,), whole turns apart: (m, k)."""
    before = np.ceil((spans[:, 1:] - at) / TURN)
    return np.asarray(before - np.floor((spans[:, :1] - at) / TURN) - 1.0)
