"""When each place of a planned path is passed, from rest to rest, in rows as controllers take them.

`keep_speed` passes lines at the speed asked for, `pass_slowly` within the limits of the joints. What is timed there is
a place p, the length of the joints' own way, each in parts of its velocity limit [s]: where the tool slows down to
nothing while the joints go on (at the end of reach, say), and where waypoints are the same or nearly, it goes on
steadily.

Rows are a spline through ticks, which makes of a corner at a waypoint more than there is: joints swing over the larger
of both speeds, and accelerate in some ticks around it. Both are in proportion to how fast the corner is passed, and are
counted when the speeds of places are found (`_kinks`); where rows fall badly on corners, these are passed more slowly.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_banded

from jacokin.arrays import Array
from jacokin.ik.seeds import ON_LIMIT
from jacokin.motion.joint_motion import ACCELERATION
from jacokin.motion.planning.manifold import Curve, Pace
from jacokin.motion.rows import ATTEMPTS, HELD, WHOLE_TICK, Limits, Rows, past_limits, sample, spline_rows
from jacokin.motion.timing import Schedule, check_ticks, fit_course, sample_lines, with_ramps

IN_A_TICK = (
    1.4  # so much harder does the spline accelerate than a velocity that changes in one; 0.6 to 2 by where rows fall
)
EASINGS = 8  # times that places are passed more slowly where limits do not hold; then the whole is
AROUND = 2  # ticks


@dataclass(frozen=True, slots=True)
class _Course:
    """Places to be timed, in pieces between waypoints.

    Attributes:
        p: (n + 1,) the places [s].
        u: (n, 2) places of the path at both ends of the intervals; it jumps where waypoints are the same.
        slope: (2, n, dof) dq/dp at both ends of the intervals [rad/s].
        rate: (2, n) du/dp there, of the cubic spline through the places of each piece.
        cuts: (pieces + 1,) numbers of the places that are waypoints, both ends among them.
    """

    p: Array
    u: Array
    slope: Array
    rate: Array
    cuts: NDArray[np.intp]

    def path_places(self, p: Array) -> Array:
        """Places (m,) of the path."""
        i = np.clip(np.searchsorted(self.p, p, side="right") - 1, 0, len(self.u) - 1)
        h, (low, high), (before, after) = self.p[i + 1] - self.p[i], self.u[i].T, self.rate[:, i]
        x = (p - self.p[i]) / h
        steep = high - low
        found = low + x * (h * before + x * (3.0 * steep - h * (2.0 * before + after)))
        found += x**3 * (h * (before + after) - 2.0 * steep)
        piece = np.searchsorted(self.cuts, i, side="right") - 1
        first, last = self.u[self.cuts[:-1], 0], self.u[self.cuts[1:] - 1, 1]
        return np.maximum.accumulate(np.clip(found, first[piece], last[piece]))


def keep_speed(curve: Curve, pace: Pace, dt: float) -> tuple[Array, Array, Rows]:
    """Places (n,) of the path, points (n, width) and rows of a curve that moves, at the speed that was asked for.

    Waypoints are rows, and lines take whole ticks; corners are passed in one. Before the first and after the last line
    the arm is at rest: it speeds up and slows down by `ACCELERATION` at most, as far as joints move as they do there.
    """
    places, ends = np.arange(len(pace.times) + 1), np.append(0.0, np.cumsum(pace.times))
    ticks = sample_lines(pace.times, dt)
    end = float(np.interp(curve.u[-1], places, ends))
    asked = np.interp(ticks, places, ends)  # [s]; places jump where waypoints are the same
    inside = asked < end - WHOLE_TICK * dt
    ticks, asked = np.append(ticks[inside], curve.u[-1]), np.append(asked[inside], end)
    whole = len(ticks) - 1
    speed = np.abs(np.diff(curve.at(ticks)[0][:, : curve.manifold.dof], axis=0)) / dt
    speed = np.minimum(speed, pace.velocity).max(axis=1)
    fastest = np.maximum.accumulate(np.maximum(speed, speed[::-1]))  # so many ticks from either end
    halves = np.arange(1, whole // 2 + 1)  # of ramps
    enough = 2.0 * halves * ACCELERATION * dt >= fastest[halves - 1]
    ramp = 2 * int(halves[int(np.argmax(enough))] if enough.any() else whole // 2)

    u = np.interp(with_ramps(asked, ramp), ends, places)
    u[[0, -1]] = ticks[[0, -1]]
    x = curve.at(u)[0]
    return u, x, spline_rows(x[:, : curve.manifold.dof], dt)


def pass_slowly(curve: Curve, pace: Pace, dt: float, acceleration: Array | None) -> tuple[Array, Array, Rows]:
    """Places (n,) of the path, points (n, width) and rows of a curve that moves, no faster than the joints can.

    Within the velocity limits, and with acceleration limits (dof,) [rad/s^2] within those, corners included. Without,
    the arm speeds up and slows down along the curve by `ACCELERATION` at most, and corners are passed in a tick.

    Raises:
        InvalidInputError: more than ten million ticks, or none.
    """
    dof = curve.manifold.dof
    course = _along_joints(curve, pace)
    slope, steepest = course.slope, np.abs(course.slope).max(axis=0)
    free = np.minimum(_asked_speeds(course, pace), _at_places(pace.velocity, steepest))
    top, stops = free, np.array([0, len(free) - 1])
    if acceleration is None:  # only how the place itself speeds up and slows down counts
        usable, held = np.full(dof, ACCELERATION), np.full(dof, np.inf)
        slope = np.repeat(0.5 * (slope[:1] + slope[1:]), 2, axis=0)
    else:
        usable, held = 0.96 * acceleration, acceleration  # the spline through the ticks swings over the rest
        stops = _stops(course, top, acceleration, dt)
        top = top.copy()
        top[stops] = 0.0

    def fitted(top: Array, sudden: Array) -> list[Schedule]:
        """Schedules from stop to stop, for largest speeds (n + 1,) and what corners add (n, dof)."""
        return [
            fit_course(
                course.p[first : last + 1],
                slope[:, first:last],
                pace.velocity,
                usable,
                top[first : last + 1],
                sudden=sudden[first:last],
            )
            for first, last in itertools.pairwise(stops.tolist())
        ]

    speed = _speeds(fitted(top, np.zeros_like(steepest)))  # corners are passed no faster than without what they take
    kinks = _kinks(course, speed, dt)
    sudden = np.zeros_like(kinks) if acceleration is None else kinks * (IN_A_TICK / dt)
    # The spline passes the larger of both velocities by a fifth of their difference at most.
    swinging = _at_places(pace.velocity, steepest + 0.2 * kinks)
    top = np.minimum(np.minimum(top, swinging), _least_around(course.p, free, dt * speed))
    limits = Limits(pace.velocity, held)
    asked = np.append(0.0, np.cumsum(pace.times))
    slower = 1.0
    for attempt in range(ATTEMPTS):
        found = fitted(top, sudden)
        check_ticks(np.array([slower * each.duration for each in found]), dt)
        samples = [sample(each.at, each.duration, dt, slower) for each in found]
        p = np.concatenate([samples[0], *(each[1:] for each in samples[1:])])
        u = course.path_places(p)
        x = curve.at(u)[0]
        rows = spline_rows(x[:, :dof], dt)
        worst = np.maximum(limits.strain(rows), np.diff(np.interp(u, np.arange(len(asked)), asked)) / dt)
        past = past_limits(rows, curve.manifold.lower, curve.manifold.upper).max(axis=1)
        if worst.max() <= HELD and (past.max() <= ON_LIMIT or attempt >= EASINGS):
            break
        if attempt < EASINGS:
            # A joint that would swing over its limit between two rows passes at half the speed, at least.
            worst = np.maximum(worst, np.minimum(np.sqrt(past / ON_LIMIT), 2.0))
            top = np.minimum(top, _eased(course.p, _speeds(found), p, worst))
        else:
            # Each time by more: ticks fall elsewhere on corners.
            slower *= max(float(worst.max()), 1.0 + 0.01 * (attempt - EASINGS + 1))
    return u, x, rows


def _speeds(schedules: list[Schedule]) -> Array:
    """(n + 1,) of all places, from stop to stop."""
    return np.concatenate([[0.0], *(each.speed[1:] for each in schedules)])


def _along_joints(curve: Curve, pace: Pace) -> _Course:
    """Places that count how far the joints go."""
    dof, scale = curve.manifold.dof, pace.scale
    far = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(curve.q, axis=0) / scale, axis=1)))
    low, high = np.array(_pieces(curve.u, far)).T
    start, end = np.interp(low, curve.u, far), np.interp(high, curve.u, far)
    # Limits are looked at every 10 ms at full speed, at no more than 20,000 places, three times between waypoints at
    # least.
    counts = np.maximum(np.ceil((end - start) / max(0.01, far[-1] / 20_000)).astype(np.intp), 3)
    cuts = np.append(0, np.cumsum(counts))

    # The ends of intervals, piece by piece: a waypoint is the last of one piece and the first of the next.
    piece = np.repeat(np.arange(len(counts)), counts + 1)
    first, last = cuts[:-1] + np.arange(len(counts)), cuts[1:] + np.arange(len(counts))
    part = (np.arange(len(piece)) - first[piece]) / counts[piece]
    u = np.interp(start[piece] + part * (end - start)[piece], far, curve.u)
    u[first], u[last] = low, high
    q = curve.at(u)[0][:, :dof]
    gone = np.linalg.norm(np.diff(q, axis=0) / scale, axis=1)
    gone[last[:-1]] = 0.0
    p = np.append(0.0, np.cumsum(gone))
    rates = _rates(p, np.column_stack([q, u]), first, last)
    length = p[last] - p[first]
    straight = (q[last] - q[first]) / length[:, None]
    # On a shorter piece joints move in proportion.
    rates[:, :dof] = np.where(length[piece, None] > 1e-4, rates[:, :dof], straight[piece])
    before = np.delete(np.arange(len(piece)), last)
    slope = np.stack([rates[before], rates[before + 1]])
    return _Course(
        np.append(p[before], p[-1]),
        np.column_stack([u[before], u[before + 1]]),
        np.ascontiguousarray(slope[:, :, :dof]),
        slope[:, :, dof],
        cuts,
    )


def _rates(p: Array, values: Array, first: NDArray[np.intp], last: NDArray[np.intp]) -> Array:
    """How values (n, k) change with places (n,), there: slopes of the cubic splines through those of each piece.

    Args:
        p: (n,) places, rising in each piece.
        values: (n, k).
        first: (pieces,) numbers of the places at which pieces of four places at least begin.
        last: (pieces,) and end.
    """
    h = np.diff(p)
    steep = np.diff(values, axis=0) / np.where(h > 0.0, h, 1.0)[:, None]
    upper, middle, lower = bands = np.zeros((3, len(p)))  # of a tridiagonal matrix, as `solve_banded` takes them
    right = np.zeros_like(values)
    upper[2:], middle[1:-1], lower[:-2] = h[:-1], 2.0 * (h[:-1] + h[1:]), h[1:]
    right[1:-1] = 3.0 * (h[1:, None] * steep[:-1] + h[:-1, None] * steep[1:])
    for ends, near, far, inward in ((first, first, first + 1, upper), (last, last - 1, last - 2, lower)):
        a, b = h[near], h[far]  # the cubic of the first interval goes on in the second
        middle[ends] = b
        inward[ends + (1 if inward is upper else -1)] = a + b
        weights = np.stack([(3.0 * a + 2.0 * b) * b, a * a]) / (a + b)
        right[ends] = weights[0, :, None] * steep[near] + weights[1, :, None] * steep[far]
    upper[first[1:]] = lower[last[:-1]] = 0.0
    return np.asarray(solve_banded((1, 1), bands, right, overwrite_ab=True, overwrite_b=True, check_finite=False))


def _pieces(u: Array, far: Array) -> list[tuple[float, float]]:
    """From waypoint to waypoint along knots (n,), those that are the same taken together.

    Args:
        u: (n,) places of the path.
        far: (n,) how far the joints have gone there [s].
    """
    inner = np.arange(np.floor(u[0]) + 1.0, np.ceil(u[-1]))
    places, gone = [*inner.tolist(), float(u[-1])], [*np.interp(inner, u, far).tolist(), float(far[-1])]
    found, low, before = list[tuple[float, float]](), float(u[0]), float(far[0])
    for place, here in zip(places, gone, strict=True):
        if here - before > 1e-7:  # [s] nearer ones are one
            found.append((low, place))
            before = here
        low = place  # the last of those that are the same
    return found or [(float(u[0]), float(u[-1]))]


def _asked_speeds(course: _Course, pace: Pace) -> Array:
    """(n + 1,) at which the tool is as fast as it is asked to be, at most."""
    line = np.clip(course.u[:, 0].astype(np.intp), 0, len(pace.times) - 1)
    rate = np.maximum(course.rate.max(axis=0), np.diff(course.u, axis=1)[:, 0] / np.diff(course.p))
    return _at_places(np.ones(1), (rate * pace.times[line])[:, None])


def _at_places(limit: Array, rate: Array) -> Array:
    """Largest speeds (n + 1,) of places at which rates (n, k) on the intervals between them stay within limits (k,)."""
    with np.errstate(divide="ignore"):
        own = (limit / rate).min(axis=1)
    return np.asarray(np.minimum(np.append(own, own[-1]), np.append(own[0], own)))


def _least_around(p: Array, values: Array, reach: Array) -> Array:
    """The least (n,) of values (n,) of places (n,) no farther away than a reach (n,): rows are means over ticks."""
    ends = np.column_stack([np.searchsorted(p, p - reach), np.searchsorted(p, p + reach, side="right")])
    return np.asarray(np.minimum.reduceat(np.append(values, np.inf), ends.ravel())[::2])


def _stops(course: _Course, top: Array, acceleration: Array, dt: float) -> NDArray[np.intp]:
    """The numbers of the places where the arm stands still: both ends, and corners that would take most of its speed.

    At a waypoint the joints' velocities change within a tick; where waypoints are nearer to each other than that, they
    are passed.
    """
    inner = course.cuts[1:-1]
    turn = np.abs(course.slope[0, inner] - course.slope[1, inner - 1])
    lengths = np.diff(course.p[course.cuts])
    with np.errstate(divide="ignore"):
        most = (acceleration / turn).min(axis=1) * dt / IN_A_TICK
    alone = most * dt <= 0.5 * (lengths[:-1] + lengths[1:])
    # Where less than a quarter of the speed is left, the arm stands still.
    stops = inner[alone & (most < 0.25 * np.minimum(top[inner], 1.0))]
    return np.array([0, *stops, len(top) - 1])


def _kinks(course: _Course, speed: Array, dt: float) -> Array:
    """By how much slopes change (n, dof) within a tick at waypoints, at most, on intervals or a tick beside them.

    Args:
        course: the places.
        speed: (n + 1,) of places; waypoints that are passed at none do not count.
        dt: control step [s].
    """
    inner = course.cuts[1:-1]
    turns = np.where(speed[inner, None] > 0.0, course.slope[0, inner] - course.slope[1, inner - 1], 0.0)
    total = np.vstack([np.zeros(turns.shape[1]), np.cumsum(turns, axis=0)])
    waypoints, half = course.p[inner], 0.5 * dt * speed
    before = [total[np.searchsorted(waypoints, course.p + k * half)] for k in range(-3, 4)]
    found = np.max([np.abs(end - start) for start, end in zip(before[:-2], before[2:], strict=True)], axis=0)
    return np.asarray(np.maximum(found[:-1], found[1:]))


def _eased(places: Array, speed: Array, p: Array, worst: Array) -> Array:
    """Speeds (n,) of places, lower than they are around steps (m,) between rows at places p that strain too much."""
    top = np.full(len(places), np.inf)
    for row in np.flatnonzero(worst > HELD).tolist():
        low, high = p[max(row - AROUND, 0)], p[min(row + 1 + AROUND, len(p) - 1)]
        first, last = np.searchsorted(places, [low, high]).tolist()
        near = slice(max(first - 1, 0), last + 1)
        top[near] = np.minimum(top[near], 0.98 * speed[near].max() / worst[row])
    return top
