"""When each place of a planned path is passed, from rest to rest, in rows as controllers take them.

`keep_speed` passes lines at the speed asked for, `pass_slowly` within the limits of the joints. What is timed there is
a place p, the length of the joints' own way, each in parts of its velocity limit [s]: where the tool slows down to
nothing while the joints go on (at the end of reach, say), and where waypoints are the same or nearly, it goes on
steadily.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from jacokin.arrays import Array
from jacokin.ik.seeds import ON_LIMIT
from jacokin.motion.joint_motion import ACCELERATION
from jacokin.motion.planning.manifold import Curve, Pace
from jacokin.motion.rows import ATTEMPTS, HELD, WHOLE_TICK, Limits, Rows, past_limits, sample, spline_rows
from jacokin.motion.timing import check_ticks, fit_course, sample_lines, slopes, with_ramps

GRID = 0.01  # [s] at full speed between places whose limits are looked at
LEAST_INTERVALS = 2  # between waypoints
MOST_PLACES = 20_000
SAME = 1e-7  # [s] at full speed: waypoints nearer than this are one
SHORT = 1e-4  # [s] at full speed: on a piece that is shorter joints move in proportion
IN_A_TICK = 3.0**0.5  # the spline through ticks accelerates so much harder than a velocity that changes in one of them
EASINGS = 6  # times that places are passed more slowly where limits do not hold; then the whole is
EASED = 0.98
EASED_AT_LIMIT = 2.0  # times as slow at most where a joint would swing over its limit between two rows
SLOWER = 0.01  # from attempt to attempt, and each time by so much more: ticks fall elsewhere on corners each time
USED = 0.96  # of the acceleration; the spline through the ticks swings over the rest
AROUND = 2  # ticks
STOPS = 0.2  # of the speed without the corner: where less is left, the arm stands still


@dataclass(frozen=True, slots=True)
class _Course:
    """Places to be timed, in pieces between waypoints.

    Attributes:
        p: (n + 1,) the places [s].
        u: (n, 2) places of the path at both ends of the intervals; it jumps where waypoints are the same.
        slope: (2, n, dof) dq/dp at both ends of the intervals [rad/s].
        cuts: numbers of the places that are waypoints, both ends among them.
    """

    p: Array
    u: Array
    slope: Array
    cuts: tuple[int, ...]

    def path_places(self, p: Array) -> Array:
        """Places (m,) of the path."""
        found = np.empty_like(p)
        piece = np.clip(np.searchsorted(self.p[list(self.cuts)], p, side="right") - 1, 0, len(self.cuts) - 2)
        for number in np.unique(piece).tolist():
            rows, (first, last) = piece == number, self.cuts[number : number + 2]
            u = np.append(self.u[first:last, 0], self.u[last - 1, 1])
            found[rows] = np.clip(CubicSpline(self.p[first : last + 1], u)(p[rows]), u[0], u[-1])
        return np.maximum.accumulate(found)


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
    top, slope = _asked_speeds(course, pace), course.slope
    stops = np.array([0, len(top) - 1])
    if acceleration is None:  # only how the place itself speeds up and slows down counts
        usable, held = np.full(dof, ACCELERATION), np.full(dof, np.inf)
        slope = np.repeat(0.5 * (slope[:1] + slope[1:]), 2, axis=0)
    else:
        usable, held = USED * acceleration, acceleration
        top, stops = _at_corners(course, top, acceleration, dt)
    limits = Limits(pace.velocity, held)
    asked = np.append(0.0, np.cumsum(pace.times))
    slower = 1.0
    for attempt in range(ATTEMPTS):
        parts = [slice(first, last + 1) for first, last in itertools.pairwise(stops.tolist())]
        found = [
            fit_course(course.p[part], slope[:, part.start : part.stop - 1], pace.velocity, usable, top[part])
            for part in parts
        ]
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
            worst = np.maximum(worst, np.minimum(np.sqrt(past / ON_LIMIT), EASED_AT_LIMIT))
            speed = np.concatenate([[0.0], *(each.speed[1:] for each in found)])
            top = np.minimum(top, _eased(course.p, speed, p, worst))
        else:
            slower *= max(float(worst.max()), 1.0 + SLOWER * (attempt - EASINGS + 1))
    return u, x, rows


def _along_joints(curve: Curve, pace: Pace) -> _Course:
    """Places that count how far the joints go."""
    dof, scale = curve.manifold.dof, pace.scale
    far = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(curve.q, axis=0) / scale, axis=1)))
    step = max(GRID, far[-1] / MOST_PLACES)
    p, u, slope, cuts = [np.zeros(1)], list[Array](), list[Array](), [0]
    for low, high in _pieces(curve.u, far):
        start, end = np.interp([low, high], curve.u, far)
        inside = (curve.u > low) & (curve.u < high) & (far > start) & (far < end)
        count = max(LEAST_INTERVALS, int(np.ceil((end - start) / step)))
        knots, gone = np.array([low, *curve.u[inside], high]), np.array([start, *far[inside], end])
        here = np.interp(np.linspace(start, end, count + 1), gone, knots)
        here[[0, -1]] = low, high
        q = curve.at(here)[0][:, :dof]
        gone = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(q, axis=0) / scale, axis=1)))
        straight = np.tile((q[-1] - q[0]) / gone[-1], (2, count, 1))
        slope.append(slopes(gone, q) if gone[-1] > SHORT else straight)
        p.append(p[-1][-1] + gone[1:])
        u.append(np.column_stack([here[:-1], here[1:]]))
        cuts.append(cuts[-1] + count)
    return _Course(np.concatenate(p), np.vstack(u), np.concatenate(slope, axis=1), tuple(cuts))


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
        if here - before > SAME:
            found.append((low, place))
            before = here
        low = place  # the last of those that are the same
    return found or [(float(u[0]), float(u[-1]))]


def _asked_speeds(course: _Course, pace: Pace) -> Array:
    """(n + 1,) at which the tool is as fast as it is asked to be, at most."""
    line = np.clip(course.u[:, 0].astype(np.intp), 0, len(pace.times) - 1)
    with np.errstate(divide="ignore"):
        asked = np.diff(course.p) / ((course.u[:, 1] - course.u[:, 0]) * pace.times[line])
    return np.asarray(np.minimum(np.append(asked, asked[-1]), np.append(asked[0], asked)))


def _at_corners(course: _Course, top: Array, acceleration: Array, dt: float) -> tuple[Array, NDArray[np.intp]]:
    """Largest speeds (n + 1,) with those at waypoints, and the numbers of the places where the arm is to stand still.

    At a waypoint the joints' velocities change within a tick, or, where waypoints are nearer to each other than that,
    on the way to the next one. Where that would take all but a part of the speed, the arm stands still.
    """
    top, inner = top.copy(), np.array(course.cuts[1:-1], dtype=np.intp)
    turn = np.abs(course.slope[0, inner] - course.slope[1, inner - 1])
    lengths = np.diff(course.p[list(course.cuts)])
    near = 0.5 * (lengths[:-1] + lengths[1:])
    with np.errstate(divide="ignore"):
        share = (acceleration / turn).min(axis=1)
    sudden = share * dt / IN_A_TICK
    alone = sudden * dt <= near
    stops = inner[alone & (sudden < STOPS * np.minimum(top[inner], 1.0))]
    top[inner] = np.minimum(top[inner], np.where(alone, sudden, np.sqrt(share * near)))
    top[stops] = 0.0
    return top, np.array([0, *stops, len(top) - 1])


def _eased(places: Array, speed: Array, p: Array, worst: Array) -> Array:
    """Speeds (n,) of places, lower than they are around steps (m,) between rows at places p that strain too much."""
    top = np.full(len(places), np.inf)
    for row in np.flatnonzero(worst > HELD).tolist():
        low, high = p[max(row - AROUND, 0)], p[min(row + 1 + AROUND, len(p) - 1)]
        first, last = np.searchsorted(places, [low, high]).tolist()
        near = slice(max(first - 1, 0), last + 1)
        top[near] = np.minimum(top[near], EASED * speed[near].max() / worst[row])
    return top
