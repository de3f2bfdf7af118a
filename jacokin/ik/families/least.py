"""The least of a cost along tracks: guesses tell where it may be, and those places are looked at exactly.

A joint with more than a turn of room may be within its limits in several copies: a guess counts in those nearest to the
seed, and places where other copies come into the limits, or these leave them, between two guesses, are looked for.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.ik.families.members import LostMemberError, Members
from jacokin.ik.families.tracks import GUESS_SPACING, Track
from jacokin.ik.preferences import Cost, copies_to_try
from jacokin.model import angles
from jacokin.model.angles import TURN

#: Local minima among the guesses that are looked at exactly.
MINIMA = 3
#: Steps towards a minimum at most.
STEPS = 60
#: Share of a chord at which a minimum is found: rounding allows no more.
ACCURACY = 1e-9
#: [rad] or share of a chord at which a cost ceases to be finite.
EDGE = 1e-12
GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)
#: [rad] what guesses may be wrong by.
ROUGH = 1e-3
#: [rad] joints that nearly pass their limits at once are looked at.
AT_ONCE = 0.01


def least_member(members: Members, tracks: Sequence[Track], cost: Cost, seed: Array) -> tuple[Array, float]:
    """The member (dof,) of the least cost on one or more tracks, and its parameter [rad].

    Guesses all along tell where minima may be; a minimum is looked at unless the change from guess to guess leaves no
    doubt that it is worse than the best one found.
    """
    looks: list[_Look] = []
    for track in tracks:
        coordinates, rows = track.guesses()
        for copies in copies_to_try(cost.copies, rows, seed, members.robot):
            looks += _places_to_look(track, coordinates, rows, copies, cost)
        looks += _glances(members, track, coordinates, rows, seed)
        looks += _corners(members, track, coordinates, rows, seed)

    def look(place: _Look) -> tuple[float, float]:
        def exact(coordinate: float) -> Array:
            return members.on_limits(place.track.joints(coordinate) + TURN * place.turns)

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


class _Look(NamedTuple):
    """A place where a minimum may be."""

    bound: float
    """What leaves no doubt to be less than the cost near by."""
    track: Track
    guess: int
    """Which one is the least near by."""
    coordinates: Array
    """(m,) of all guesses along the track."""
    turns: Array
    """(dof,) by which the angles differ from those of the track."""


def _places_to_look(track: Track, coordinates: Array, rows: Array, copies: Array, cost: Cost) -> list[_Look]:
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
        _Look(float(bound), track, int(index), coordinates, turns[index])
        for bound, index in zip(bounds, chosen, strict=True)
    ]


def _glances(members: Members, track: Track, coordinates: Array, rows: Array, seed: Array) -> Iterator[_Look]:
    """Where a joint with more than a turn of room passes its limit and comes back, between two guesses only.

    It comes in from another copy, or it leaves, and both places where it is on the limit are looked at.
    """
    snap = members.verifier.options.limit_snap
    for (joint, limit, side), leaves in itertools.product(_wide_limits(members), (False, True)):
        way = -side if leaves else side

        def beyond(q: Array, joint: int = joint, limit: float = limit, way: float = way) -> Array:
            return np.asarray(angles.wrap_to_pi(way * (q[:, joint] - limit)))

        here = beyond(rows)
        padded = np.concatenate([here[1:2], here, here[-2:-1]])
        left, right = padded[:-2], padded[2:]
        local = (here > -ROUGH) & (here <= left) & (here <= right) & (here <= np.maximum(left, right) - here + ROUGH)
        for index in np.flatnonzero(local).tolist():
            excess, coordinate = refine(beyond, coordinates, index, track.joints)
            if excess > (-snap if leaves else snap):
                continue
            around = coordinates[[max(index - 1, 0), 0, min(index + 1, len(rows) - 1)]]
            around[1] = coordinate
            q = track.joints(coordinate)
            copies = _turns(members, q, seed, snap)
            copies[joint] = np.round((limit - q[joint]) / TURN)
            if leaves:
                yield _Look(-math.inf, track, 0, around[:2], copies)
                yield _Look(-math.inf, track, 1, around[1:], copies)
            else:
                yield _Look(-math.inf, track, 1, around, copies)


def _corners(members: Members, track: Track, coordinates: Array, rows: Array, seed: Array) -> Iterator[_Look]:
    """Where a joint with more than a turn of room comes in, and another leaves, between two guesses only."""
    wide, snap, limits = np.flatnonzero(members.wide), members.verifier.options.limit_snap, _wide_limits(members)
    if len(wide) < 2:
        return
    lower, upper = members.robot.lower[wide], members.robot.upper[wide]

    def is_seen(chord: int, turns: Array) -> bool:
        q = (rows[chord : chord + 2] + TURN * turns)[:, wide]
        return bool(((lower <= q) & (q <= upper)).all(axis=1).any())

    def on_limits(q: Array, slack: float) -> set[int]:
        return {joint for joint, limit, _ in limits if abs(angles.wrap_to_pi(q[joint] - limit)) <= slack}

    for joint, limit, _ in limits:
        excess = np.asarray(angles.wrap_to_pi(rows[:, joint] - limit))
        passed = (excess[1:] * excess[:-1] <= 0.0) & (np.abs(np.diff(excess)) < math.pi)
        for chord in np.flatnonzero(passed).tolist():
            first, last = excess[chord : chord + 2].tolist()
            q = rows[chord] + (first / (first - last) if first != last else 0.0) * (rows[chord + 1] - rows[chord])
            alone = on_limits(q, AT_ONCE) <= {joint}
            if alone and all(is_seen(chord, _turns(members, q, seed, slack)) for slack in (AT_ONCE, GUESS_SPACING)):
                continue
            around = coordinates[[max(chord - 1, 0), chord, min(chord + 2, len(rows) - 1)]]

            def beyond(coordinate: float, joint: int = joint, limit: float = limit) -> float:
                return float(angles.wrap_to_pi(track.joints(coordinate)[joint] - limit))

            start = beyond(float(around[0]))

            def not_passed(coordinate: float, start: float = start) -> float:
                return 0.0 if beyond(coordinate) * start >= 0.0 else math.inf

            around[1] = last_finite(not_passed, (0.0, float(around[0])), float(around[2]))[1]
            q = track.joints(float(around[1]))
            turns = _turns(members, q, seed, snap)
            if not on_limits(q, snap) <= {joint} or not is_seen(chord, turns):
                yield _Look(-math.inf, track, 1, around, turns)


def _wide_limits(members: Members) -> list[tuple[int, float, float]]:
    """Joints with more than a turn of room: each with its limits [rad], the lower one with -1, the upper one with 1."""
    robot = members.robot
    return [
        (joint, float(limits[joint]), side)
        for joint in np.flatnonzero(members.wide).tolist()
        for limits, side in ((robot.lower, -1.0), (robot.upper, 1.0))
    ]


def _turns(members: Members, q: Array, seed: Array, slack: float) -> Array:
    """Turns (dof,) to add to q (dof,) for the copies nearest to a seed: within the limits, but for a slack [rad].

    Only joints with more than a turn of room are given that slack.
    """
    turns = np.round((members.copies(q, seed) - q) / TURN)
    for joint, limit, _ in _wide_limits(members):
        at_limit = np.round((limit - q[joint]) / TURN)
        if abs(q[joint] + TURN * at_limit - limit) <= slack:
            choices = (at_limit, turns[joint])
            turns[joint] = min(choices, key=lambda turn: abs(q[joint] + TURN * turn - seed[joint]))
    return np.asarray(turns)


def _cost_or_inf(cost: Cost, rows: Array) -> Array:
    """Costs (m,) of rows (m, dof); infinite where rows are NaN."""
    values, there = np.full(len(rows), np.inf), ~np.isnan(rows).any(axis=1)
    if there.any():
        values[there] = cost(rows[there])
    return values


def least(cost: Callable[[Array], Array], coordinates: Array, rows: Array, exact: Callable[[float], Array]) -> float:
    """The coordinate of the least cost along a track.

    Args:
        cost: of rows.
        coordinates: (m,) in order.
        rows: (m, dof) configurations there, roughly.
        exact: the configuration (dof,) at a coordinate.
    """
    ends = [refine(cost, coordinates, end, exact) for end in minima(cost(rows))[:MINIMA]]
    return min(ends, key=lambda end: end[0])[1]


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
