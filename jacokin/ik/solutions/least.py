"""The least of a cost along tracks: guesses tell where it may be, and those places are looked at exactly.

A joint with more than a turn of room may be within its limits in several copies: a guess counts in those nearest to the
seed. Where another copy comes into the limits between two guesses and leaves them again, it is not seen.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.ik.preferences import Cost, copies_to_try
from jacokin.ik.solutions.members import CurveTrack, LostMemberError, Members
from jacokin.model.angles import TURN

#: Steps towards a minimum at most.
STEPS = 60
#: Share of a chord at which a minimum is found: rounding allows no more.
ACCURACY = 1e-9
#: [rad] or share of a chord at which a cost ceases to be finite.
EDGE = 1e-12
GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)


def least_member(members: Members, tracks: Sequence[CurveTrack], cost: Cost, seed: Array) -> tuple[Array, float]:
    """The member (dof,) of the least cost on one or more tracks, and its parameter [rad].

    Guesses all along tell where minima may be; a minimum is looked at unless the change from guess to guess leaves no
    doubt that it is worse than the best one found.
    """
    looks: list[_Basin] = []
    for track in tracks:
        coordinates, rows = track.guesses()
        for copies in copies_to_try(cost.copies, rows, seed, members.robot):
            looks += _places_to_look(track, coordinates, rows, copies, cost)

    def look(place: _Basin) -> tuple[float, float]:
        def exact(coordinate: float) -> Array:
            return members.on_limits(place.track.configuration(coordinate) + TURN * place.turns)

        return refine(lambda rows: _cost_or_inf(cost, rows), place.coordinates, place.guess, exact)

    lowest, minimums = math.inf, []
    for place in sorted(looks, key=lambda place: place.bound):
        if place.bound >= lowest:
            break
        value, coordinate = look(place)
        minimums.append((value, coordinate, place))
        lowest = min(lowest, value)
    minimums.sort(key=lambda minimum: minimum[0])
    for _, coordinate, place in minimums:
        p, q = place.track.point(coordinate)
        try:
            return members.verified(members.on_limits(q + TURN * place.turns), p), p
        except LostMemberError:
            continue  # the next best one
    _, coordinate, place = minimums[0]  # a track has a minimum
    p, q = place.track.point(coordinate)
    return members.on_track(place.track, p, q, seed), p


class _Basin(NamedTuple):
    """A place where a minimum may be."""

    bound: float
    """What leaves no doubt to be less than the cost near by."""
    track: CurveTrack
    guess: int
    """Which one is the least near by."""
    coordinates: Array
    """(m,) of all guesses along the track."""
    turns: Array
    """(dof,) by which the angles differ from those of the track."""


def _places_to_look(track: CurveTrack, coordinates: Array, rows: Array, copies: Array, cost: Cost) -> list[_Basin]:
    """Local minima among the guesses (m, dof) of a track in some copies, NaN where those are outside the limits.

    Where joints go on in other copies, the cost may jump: such runs are looked at one by one.
    """
    turns = np.round((copies - rows) / TURN)
    values = _cost_or_inf(cost, copies)
    apart = (turns[1:] != turns[:-1]).any(axis=1)  # NaN too
    inner = np.where(apart, np.inf, values[:-1]), np.where(apart, np.inf, values[1:])
    left, right = np.concatenate([[np.inf], inner[0]]), np.concatenate([inner[1], [np.inf]])
    chosen = np.flatnonzero(np.isfinite(values) & (values <= left) & (values <= right))
    value, left, right = values[chosen], left[chosen], right[chosen]
    change = np.maximum(np.where(np.isfinite(left), left, value), np.where(np.isfinite(right), right, value)) - value
    alone = np.isinf(left) & np.isinf(right)  # nothing says how the cost changes
    bounds = np.where(alone, -np.inf, value - change)
    return [
        _Basin(float(bound), track, int(index), coordinates, turns[index])
        for bound, index in zip(bounds, chosen, strict=True)
    ]


def _cost_or_inf(cost: Cost, rows: Array) -> Array:
    """Costs (m,) of rows (m, dof); infinite where rows are NaN."""
    values, there = np.full(len(rows), np.inf), ~np.isnan(rows).any(axis=1)
    if there.any():
        values[there] = cost(rows[there])
    return values


def minima(values: Array) -> NDArray[np.int64]:
    """Indices of the local minima, best first, ends included."""
    padded = np.concatenate([[np.inf], values, [np.inf]])
    local = np.flatnonzero((values <= padded[:-2]) & (values <= padded[2:]))
    return local[np.argsort(values[local], kind="stable")]


def refine(
    cost: Callable[[Array], Array], coordinates: Array, index: int, exact: Callable[[float], Array]
) -> tuple[float, float]:
    """The least cost next to a guess, and its coordinate: between the neighbours, or on from the one where it is less.

    The cost is infinite from where a joint passes its limit on: there the least may be just this side of it.
    """

    def at(coordinate: float) -> float:
        return float(cost(exact(coordinate)[np.newaxis])[0])

    known = (at(float(coordinates[index])), float(coordinates[index]))
    while True:
        places = [max(index - 1, 0), min(index + 1, len(coordinates) - 1)]
        ends = [last_finite(at, known, end) for end in coordinates[places].tolist()]
        best, place = min(zip(ends, places, strict=True))
        if best[0] >= known[0] or best[1] != coordinates[place]:
            break
        known, index = best, place
    (_, low), (_, high) = ends
    middle = known[1]
    found = brent(at, low, middle, high, known[0]) if low < middle < high else brent(at, low, 0.5 * (low + high), high)
    return min(known, found, *ends)


def last_finite(at: Callable[[float], float], known: tuple[float, float], end: float) -> tuple[float, float]:
    """The end if the cost is finite there, else where it last is between a place that is known and the end."""
    value = at(end) if end != known[1] else known[0]
    if math.isfinite(value) or not math.isfinite(known[0]):
        return value, end
    (value, inside), outside = known, end
    while abs(outside - inside) > EDGE * (1.0 + abs(inside)):
        middle = 0.5 * (inside + outside)
        at_middle = at(middle)
        if math.isfinite(at_middle):
            value, inside = at_middle, middle
        else:
            outside = middle
    return value, inside


def brent(
    at: Callable[[float], float], low: float, x: float, high: float, fx: float | None = None
) -> tuple[float, float]:
    """The minimum of a function between low and high, and where it is.

    Parabolas through the three best points, golden section where they fail (Brent, 1973, chapter 5). SciPy has the
    method too, in `scipy.optimize`: the first solve with a preference would wait a second for that import.
    """
    w = v = x
    fx = at(x) if fx is None else fx
    fw = fv = fx
    step = before = high - low
    for _ in range(STEPS):
        middle, tolerance = 0.5 * (low + high), ACCURACY * (1.0 + abs(x))
        if abs(x - middle) <= 2.0 * tolerance - 0.5 * (high - low):
            break
        r, q = (x - w) * (fx - fv), (x - v) * (fx - fw)
        p = (x - v) * q - (x - w) * r
        q = 2.0 * (q - r)
        p, q = (-p, q) if q > 0.0 else (p, -q)
        if abs(p) < abs(0.5 * q * before) and q * (low - x) < p < q * (high - x):
            before, step = step, p / q
        else:
            before = (high if x < middle else low) - x
            step = (1.0 - GOLDEN) * before
        u = x + (step if abs(step) >= tolerance else math.copysign(tolerance, step))
        fu = at(u)
        if fu <= fx:
            low, high = (x, high) if u >= x else (low, x)
            v, fv, w, fw, x, fx = w, fw, x, fx, u, fu
        else:
            low, high = (u, high) if u < x else (low, u)
            if fu <= fw or w == x:
                v, fv, w, fw = w, fw, u, fu
            elif fu <= fv or v in (x, w):
                v, fv = u, fu
    return fx, x
