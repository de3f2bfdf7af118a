"""The least of a cost along tracks: guesses tell where it may be, and those places are looked at exactly.

A joint with more than a turn of room may be within its limits in several copies: a guess counts in those nearest to the
seed. Where another copy comes into the limits between two guesses and leaves them again, it is not seen.
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.ik.preferences import Cost, copies_to_try
from jacokin.ik.solutions.members import GUESS_SPACING, CurveTrack, LostMemberError, Members, guesses
from jacokin.model.angles import TURN

#: Steps towards a minimum at most.
STEPS = 60
#: Share of a chord at which a minimum is found: rounding allows no more.
ACCURACY = 1e-9
#: [rad] or share of a chord at which a cost ceases to be finite.
EDGE = 1e-12
GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)
#: Times as near to each other as guesses are places next to the least ones that are looked at by the same cubics, and
#: [rad] how inexact those are.
CLOSER, INEXACT = 8, 2e-4


class Basin(NamedTuple):
    """A place where a minimum may be."""

    track: CurveTrack
    coordinates: Array
    """(m,) of places along the track."""
    guess: int
    """Which one is the least near by."""
    turns: Array | float
    """(dof,) by which the angles differ from those of the track."""
    value: float
    """The cost there."""
    change: float
    """By how much it changes to the next places at most; infinite where nothing tells."""


def least_member(members: Members, tracks: Sequence[CurveTrack], cost: Cost, seed: Array) -> tuple[Array, float]:
    """The member (dof,) of the least cost on one or more tracks, and its parameter [rad]."""
    looks, (coordinates, rows, begins) = list[Basin](), guesses(tracks)
    for copies in copies_to_try(cost.copies, rows, seed, members.robot):
        turns = np.round((copies - rows) / TURN)
        looks += basins(tracks, coordinates, begins, turns, _cost_or_inf(cost, copies))

    def on_limits(place: Basin, rows: Array, snap: float | None = None) -> Array:
        return members.on_limits(rows + TURN * place.turns, snap)

    minimums = least_costs(looks, lambda rows: _cost_or_inf(cost, rows), on_limits)
    for _, coordinate, place in minimums:
        p, q = place.track.point(coordinate)
        try:
            return members.verified(on_limits(place, q), p), p
        except LostMemberError:
            continue  # the next best one
    _, coordinate, place = minimums[0]  # a track has a minimum
    p, q = place.track.point(coordinate)
    return members.on_track(place.track, p, q, seed), p


def least_costs(
    looks: Sequence[Basin],
    cost: Callable[[Array], Array],
    within: Callable[[Basin, Array, float | None], Array],
    floor: float = -math.inf,
) -> list[tuple[float, float, Basin]]:
    """The least cost, its coordinate and place, and those of others that were looked at, in order.

    A place is looked at closer, and a minimum exactly, unless the change from place to place leaves no doubt that it is
    worse than the best one.

    Args:
        looks: where minima may be.
        cost: (m,) of rows (m, dof).
        within: what a cost is asked of at rows (..., dof) of a track, known to within so much [rad], None for exactly.
        floor: no cost is less.
    """

    def bound(place: Basin) -> float:
        return max(place.value - place.change, floor)

    likely, closer = math.inf, list[Basin]()
    for place in sorted(looks, key=bound):
        if bound(place) >= likely:
            break
        some = _look_closer(place, cost, within)
        closer += some
        likely = min(likely, *(each.value + each.change for each in some))
    lowest, found = math.inf, list[tuple[float, float, Basin]]()
    for place in sorted(closer, key=bound):
        if bound(place) >= lowest:
            break
        at = functools.partial(_exact, place, cost, within)
        value, coordinate = refine(at, place.coordinates, place.guess)
        found.append((value, coordinate, place))
        lowest = min(lowest, value)
    return sorted(found, key=lambda minimum: minimum[0])


def _exact(
    place: Basin, cost: Callable[[Array], Array], within: Callable[[Basin, Array, float | None], Array], at: float
) -> float:
    """The cost exactly at a coordinate."""
    return float(cost(within(place, place.track.configuration(at), None)[np.newaxis])[0])


def _look_closer(
    place: Basin, cost: Callable[[Array], Array], within: Callable[[Basin, Array, float | None], Array]
) -> list[Basin]:
    """Where minima may be, seen from places nearer to each other around the least one."""
    n, known = place.guess, place.coordinates
    first, last = max(n - 1, 0), min(n + 1, len(known) - 1)
    sides = [np.linspace(known[a], known[b], CLOSER + 1)[:-1] for a, b in ((first, n), (n, last)) if a < b]
    closer = np.concatenate([*sides, known[[last]]])
    rows = within(place, place.track.configurations(closer), INEXACT)
    turns = np.broadcast_to(place.turns, rows.shape)
    some = basins([place.track], closer, np.array([0, len(closer)]), turns, cost(rows))
    coordinates = np.concatenate([known[:first], closer, known[last + 1 :]])
    inexact = INEXACT / GUESS_SPACING * place.change if math.isfinite(place.change) else 0.0
    return [
        each._replace(
            coordinates=coordinates,
            guess=first + each.guess,
            change=each.change + inexact if 0 < each.guess < len(closer) - 1 else max(each.change, place.change),
        )
        for each in some
    ] or [place]


def basins(
    tracks: Sequence[CurveTrack], coordinates: Array, begins: NDArray[np.intp], turns: Array, values: Array
) -> list[Basin]:
    """Local minima among costs (m,), infinite or with turns of NaN outside the limits, of places as of `guesses`.

    Where joints go on in other copies, by other turns (m, dof), the cost may jump: such runs are looked at one by one.
    """
    apart = (turns[1:] != turns[:-1]).any(axis=1)  # NaN too
    apart[begins[1:-1] - 1] = True
    inner = np.where(apart, np.inf, values[:-1]), np.where(apart, np.inf, values[1:])
    left, right = np.concatenate([[np.inf], inner[0]]), np.concatenate([inner[1], [np.inf]])
    chosen = np.flatnonzero(np.isfinite(values) & (values <= left) & (values <= right))
    value, left, right = values[chosen], left[chosen], right[chosen]
    change = np.maximum(np.where(np.isfinite(left), left, value), np.where(np.isfinite(right), right, value)) - value
    change[np.isinf(left) & np.isinf(right)] = np.inf  # nothing says how the cost changes
    along = [coordinates[first:end] for first, end in itertools.pairwise(begins.tolist())]
    number = np.searchsorted(begins, chosen, side="right") - 1
    index, columns = chosen - begins[number], (number, value, change, chosen)
    return [
        Basin(tracks[k], along[k], at, turns[row], cost, by)
        for at, k, cost, by, row in zip(index.tolist(), *(column.tolist() for column in columns), strict=True)
    ]


def _cost_or_inf(cost: Cost, rows: Array) -> Array:
    """Costs (m,) of rows (m, dof); infinite where rows are NaN."""
    missing = np.isnan(rows).any(axis=1)
    if not missing.any():
        return cost(rows)
    values, there = np.full(len(rows), np.inf), ~missing
    if there.any():
        values[there] = cost(rows[there])
    return values


def minima(values: Array) -> NDArray[np.int64]:
    """Indices of the local minima, best first, ends included."""
    padded = np.concatenate([[np.inf], values, [np.inf]])
    local = np.flatnonzero((values <= padded[:-2]) & (values <= padded[2:]))
    return local[np.argsort(values[local], kind="stable")]


def refine(at: Callable[[float], float], coordinates: Array, index: int) -> tuple[float, float]:
    """The least cost next to a place, and its coordinate: between the neighbours, or on from the one where it is less.

    The cost is infinite from where a joint passes its limit on: there the least may be just this side of it.
    """
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
