"""Rows of a motion, one for each tick: taken from a timed course, averaged, and what happens between two of them.

See `motion.free_motion.timed_course` for what a timed course is, and `motion.rows` for why rows are averaged.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array

ROUNDED = 1.0 + 1e-9  # times a limit; what is beyond is no rounding


class SampleWork(NamedTuple):
    """What is read and written to take configurations from a course; arrays may have more room."""

    counts: NDArray[np.int64]  # (3,) joints, rows, and places of the course
    span: Array  # (1,) they are taken in equal steps from time 0 to this one [s]
    t: Array  # (places,) when each place of the course is passed [s]
    s: Array  # (places,)
    speed: Array  # (places,) ds/dt there
    piece: NDArray[np.int64]  # (places,) the number of the line or parabola that begins there, or goes on
    begins: Array  # (pieces + 1,) where each begins
    at: Array  # (pieces dof,) configuration there [rad]
    slope: Array  # (pieces dof,) dq/ds there
    bend: Array  # (pieces dof,) d2q/ds2
    lower: Array  # (dof,) of what the course passes [rad]
    upper: Array  # (dof,)
    q: Array  # (rows dof,) filled in [rad]


def make_sample_work(dof: int = 0, rows: int = 0, places: int = 0) -> SampleWork:
    """Fresh work arrays; a course has fewer lines and parabolas than places."""
    (t, s, speed, begins), (at, slope, bend) = np.zeros((4, places)), np.zeros((3, places * dof))
    piece, (lower, upper), q = np.zeros(places, np.int64), np.zeros((2, dof)), np.zeros(rows * dof)
    return SampleWork(np.zeros(3, np.int64), np.zeros(1), t, s, speed, piece, begins, at, slope, bend, lower, upper, q)


def sample_course(work: SampleWork) -> int:
    """Fill in the configurations; returns how many there are."""
    dof, count = work.counts[0], work.counts[1]
    i, last = 0, work.counts[2] - 2
    for row in range(count):
        time = row * (work.span[0] / (count - 1)) if row < count - 1 else work.span[0]
        while i < last and work.t[i + 1] <= time:
            i += 1
        gone = time - work.t[i]
        pull = (work.speed[i + 1] - work.speed[i]) / (work.t[i + 1] - work.t[i])
        place = work.s[i] + gone * (work.speed[i] + 0.5 * gone * pull)
        on = min(max(place, work.s[i]), work.s[i + 1]) - work.begins[work.piece[i]]
        for j in range(dof):
            k = work.piece[i] * dof + j
            q = work.at[k] + on * (work.slope[k] + 0.5 * on * work.bend[k])
            work.q[row * dof + j] = min(max(q, work.lower[j]), work.upper[j])
    return int(count)


class AverageWork(NamedTuple):
    """What is read and written to average rows; arrays may have more room."""

    counts: NDArray[np.int64]  # (3,) joints, configurations, and over how many ticks, see `ticks_averaged`
    dt: Array  # (1,) [s]
    taken: Array  # (n dof,) configurations `dt` apart [rad]
    q: Array  # (m dof,) filled in for the m = n + ticks + 1 rows [rad]
    v: Array  # (m dof,) [rad/s]
    a: Array  # (m dof,) [rad/s^2]


def make_average_work(dof: int = 0, rows: int = 0) -> AverageWork:
    """Fresh work arrays."""
    return AverageWork(np.zeros(3, np.int64), np.zeros(1), *(np.zeros(rows * dof) for _ in range(4)))


def average_rows(work: AverageWork) -> int:
    """Fill in the rows of the cubic B-spline whose control points are averages; returns how many there are.

    The motion stands still before and after, and passes no angle that no configuration passes.
    """
    dof, last, ticks, taken = work.counts[0], work.counts[1] - 1, work.counts[2], work.taken
    count = last + ticks + 2
    share, half, square = 1.0 / ticks, 0.5 / work.dt[0], 1.0 / (work.dt[0] * work.dt[0])
    for j in range(dof):
        low, high = taken[j], taken[j]
        for row in range(1, last + 1):
            low, high = min(low, taken[row * dof + j]), max(high, taken[row * dof + j])
        point, step = taken[j], 0.0
        for row in range(count):
            # From this average to the next one.
            after, before = min(row, last), min(max(row - ticks, 0), last)
            ahead = (taken[after * dof + j] - taken[before * dof + j]) * share
            change, k = ahead - step, row * dof + j
            work.q[k] = min(max(point + change * (1.0 / 6.0), low), high)
            work.v[k], work.a[k] = (step + ahead) * half, change * square
            point, step = point + ahead, ahead
        work.q[j], work.q[(count - 1) * dof + j] = taken[j], taken[last * dof + j]
    return int(count)


def ticks_averaged(taken: Array, dof: int, count: int, limits: Array, dt: float) -> int:
    """Over how many ticks to average configurations (count dof,) `dt` apart: 1 if no jerk is limited.

    The jerk is the difference of two accelerations so many ticks apart, divided by their time; twice the acceleration
    over its limit is always enough of it. Limits are those of velocity, acceleration and jerk of each joint in turn.
    """
    most = 0.0
    for j in range(dof):
        jerk = limits[3 * j + 2] * dt * dt * dt
        if jerk < math.inf:
            for k in range(count):
                most = max(most, abs(second_difference(taken, dof, count, k, j)) / jerk)
    low, high = max(math.ceil(most), 1), max(math.ceil(2.0 * most), 1)
    while low < high:  # the larger one always holds
        middle = (low + high) // 2
        if holds_jerk(taken, dof, count, limits, dt, middle):
            high = middle
        else:
            low = middle + 1
    return low


def holds_jerk(taken: Array, dof: int, count: int, limits: Array, dt: float, ticks: int) -> bool:
    """Whether accelerations so many ticks apart differ little enough."""
    for j in range(dof):
        most = ticks * ROUNDED * limits[3 * j + 2] * dt * dt * dt
        for k in range(count + ticks if most < math.inf else 0):
            ahead = second_difference(taken, dof, count, k, j) if k < count else 0.0
            behind = second_difference(taken, dof, count, k - ticks, j) if k >= ticks else 0.0
            if abs(ahead - behind) > most:
                return False
    return True


def second_difference(taken: Array, dof: int, count: int, k: int, j: int) -> float:
    """How a joint's step changes at one of some configurations, before and after which it stands still."""
    before, after = taken[max(k - 1, 0) * dof + j], taken[min(k + 1, count - 1) * dof + j]
    return float(after - taken[k * dof + j] - (taken[k * dof + j] - before))


class BetweenWork(NamedTuple):
    """What is read and written to know how far rows are left between each other; arrays may have more room."""

    counts: NDArray[np.int64]  # (2,) joints and rows
    dt: Array  # (1,) [s]
    q: Array  # (n dof,) [rad]
    a: Array  # (n dof,) accelerations that change steadily from row to row [rad/s^2]
    lower: Array  # (dof,) limits [rad]
    upper: Array  # (dof,)
    levers: Array  # (dof,) how far a point can be from a joint's axis at most [m]
    reach: Array  # (n - 1,) filled in: how far any point leaves its way along the straight motion, at most [m]
    beyond: NDArray[np.int64]  # (n - 1,) filled in: numbers of the steps on which a joint could be beyond a limit


def make_between_work(dof: int = 0, rows: int = 0) -> BetweenWork:
    """Fresh work arrays."""
    (q, a), (lower, upper, levers) = np.zeros((2, rows * dof)), np.zeros((3, dof))
    reach, beyond = np.zeros(rows), np.zeros(rows, np.int64)
    return BetweenWork(np.zeros(2, np.int64), np.zeros(1), q, a, lower, upper, levers, reach, beyond)


def look_between(work: BetweenWork) -> int:
    """Fill in the reach of each step, and those that could pass a limit; returns how many of these there are."""
    dof, beyond = work.counts[0], 0
    for row in range(work.counts[1] - 1):
        reach, inside = 0.0, True
        for j in range(dof):
            k, then = row * dof + j, row * dof + dof + j
            bulge = 0.125 * work.dt[0] * work.dt[0] * max(abs(work.a[k]), abs(work.a[then]))
            reach += bulge * work.levers[j]
            least, most = min(work.q[k], work.q[then]) - bulge, max(work.q[k], work.q[then]) + bulge
            inside = inside and least >= work.lower[j] and most <= work.upper[j]
        work.reach[row] = reach
        if not inside:
            work.beyond[beyond] = row
            beyond += 1
    return int(beyond)
