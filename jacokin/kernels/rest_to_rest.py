"""From rest to rest in the least whole number of ticks, within limits of velocity, acceleration and jerk.

A step of position, averaged over n1, then n2, then n3 ticks, is a motion of n1 + n2 + n3 ticks: a constant velocity for
n1 ticks, whose average over n2 rises and falls steadily, and whose average over n3 has no jumps of acceleration. With
n1 >= n2 >= n3 its velocity is at most d / n1, its acceleration d / (n1 n2), and its jerk d / (n1 n2 n3), twice that
where n1 < n2 + n3: the ramps then meet. The jerk is constant from tick to tick, so cubics from tick to tick are this
very motion. Without whole ticks the least such sum is the least time there is (Biagiotti and Melchiorri: FIR filters
for online trajectory planning, 2012); in ticks it is at most two more, rounded up.
"""

from __future__ import annotations

import math
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array

NEVER = 2**60  # ticks of a motion that takes more than LONGEST
LONGEST = 1e15  # ticks
LEAST = 1e-100  # instead of zero, below a fraction line
ROUNDED = 1.0 - 1e-10  # of a demand, which may be missed by rounding
BELOW, ABOVE = 3, 3  # whole ticks around the least time among which the best are looked for
#: Where the counts are: joints, and 1 where they are to move on a straight line, 0 where they need not.
RestInteger = IntEnum("RestInteger", "JOINTS STRAIGHT", start=0)


class RestWork(NamedTuple):
    """What a call reads and writes; arrays may have more room."""

    counts: NDArray[np.int64]  # (2,)
    dt: Array  # (1,) [s]
    start: Array  # (dof,) [rad]
    end: Array  # (dof,)
    limits: Array  # (3 dof,) of velocity, acceleration and jerk of each joint in turn; infinite for none
    shares: Array  # (3,) filled in: the limits of how much of a straight line is behind
    ticks: Array  # (3 dof,) n1, n2 and n3 of each joint, whole
    q: Array  # (rows dof,) written if there is room for all of them [rad]
    v: Array  # (rows dof,) [rad/s]
    a: Array  # (rows dof,) [rad/s^2]


def make_rest_work(dof: int = 0, rows: int = 0) -> RestWork:
    """Fresh work arrays for so many joints and rows."""
    start, end, limits, shares, ticks = (np.zeros(size) for size in (dof, dof, 3 * dof, 3, 3 * dof))
    rows_of_joints = (np.zeros(rows * dof) for _ in range(3))
    return RestWork(np.array([dof, 0]), np.zeros(1), start, end, limits, shares, ticks, *rows_of_joints)


def fit_rest_to_rest(work: RestWork) -> int:
    """Fill in the rows, one more than ticks, which are returned; `NEVER` where that are too many to count.

    The joints that need less time take as much as the slowest: by the same ramps where these hold their limits, so that
    the motion is a straight line where it can be, or else more slowly between ramps of their own.
    """
    if work.counts[RestInteger.STRAIGHT]:
        return fit_line(work)
    joints, dt, longest, leader = work.counts[RestInteger.JOINTS], work.dt[0], 0.0, -1
    for j in range(joints):
        distance = abs(work.end[j] - work.start[j])
        n1, n2, n3 = 1.0, 1.0, 1.0
        if distance > 0.0:
            n1, n2, n3 = least_ticks(*demands(distance, work.limits, j, dt))
            if n1 + n2 + n3 > longest:
                longest, leader = n1 + n2 + n3, j
        work.ticks[3 * j], work.ticks[3 * j + 1], work.ticks[3 * j + 2] = n1, n2, n3
    if longest > LONGEST:
        return NEVER
    if leader >= 0:
        keep_step(work, leader, longest)
    ticks = int(longest)
    if (ticks + 1) * joints <= len(work.q):
        write_rows(work, ticks)
    return ticks


def fit_line(work: RestWork) -> int:
    """Fill in the rows of a straight line, all joints by the same ramps; returns ticks, or `NEVER`."""
    joints, shares = work.counts[RestInteger.JOINTS], work.shares
    for k in range(3):
        shares[k] = math.inf
        for j in range(joints):
            distance = abs(work.end[j] - work.start[j])
            if distance > 0.0:
                shares[k] = min(shares[k], work.limits[3 * j + k] / distance)
    n1, n2, n3 = least_ticks(*demands(1.0, shares, 0, work.dt[0]))
    if n1 + n2 + n3 > LONGEST:
        return NEVER
    ticks = int(n1 + n2 + n3)
    if (ticks + 1) * joints <= len(work.q):
        write_line(work, ticks, n1, n2, n3)
    return ticks


def demands(distance: float, limits: Array, joint: int, dt: float) -> tuple[float, float, float]:
    """The least n1, n1 n2 and n1 n2 n3 for a distance."""
    first = distance / limits[3 * joint] / dt
    second = distance / limits[3 * joint + 1] / dt / dt
    return max(first, LEAST), max(second, LEAST), distance / limits[3 * joint + 2] / dt / dt / dt


def keep_step(work: RestWork, leader: int, longest: float) -> None:
    """Give each joint averages that take as long as the leader's."""
    n1, n2, n3 = work.ticks[3 * leader], work.ticks[3 * leader + 1], work.ticks[3 * leader + 2]
    for j in range(work.counts[RestInteger.JOINTS]):
        at = 3 * j
        distance = abs(work.end[j] - work.start[j])
        if distance == 0.0 or meets(*demands(distance, work.limits, j, work.dt[0]), n1, n2, n3):
            work.ticks[at], work.ticks[at + 1], work.ticks[at + 2] = n1, n2, n3
        else:
            work.ticks[at] += longest - (work.ticks[at] + work.ticks[at + 1] + work.ticks[at + 2])


def meets(first: float, second: float, third: float, n1: float, n2: float, n3: float) -> bool:
    """Whether averages over so many ticks meet demands of n1, n1 n2 and n1 n2 n3."""
    sharp = third if n1 >= n2 + n3 else 2.0 * third
    return n1 >= ROUNDED * first and n1 * n2 >= ROUNDED * second and n1 * n2 * n3 >= ROUNDED * sharp


def least_ticks(first: float, second: float, third: float) -> tuple[float, float, float]:
    """Whole n1 >= n2 >= n3 >= 1 of the least sum that meet demands, near those that need not be whole.

    Of equal sums the one with the largest n3 is taken, whose jerk is least.
    """
    x1, x2, x3 = least_times(first, second, third)
    if not x1 + x2 + x3 <= LONGEST:
        return 2.0 * LONGEST, 1.0, 1.0
    best1, best2, best3 = math.inf, 0.0, 0.0
    for k in range(-BELOW, ABOVE + 1):
        n3 = math.floor(x3) + k
        if n3 < 1.0:
            continue
        for m in range(-BELOW, ABOVE + 1):
            n2 = max(math.floor(x2) + m, n3)
            least = max(n2, math.ceil(ROUNDED * first), math.ceil(ROUNDED * second / n2))
            sharp = ROUNDED * third / (n2 * n3)
            n1 = min(max(least, n2 + n3, math.ceil(sharp)), max(least, math.ceil(2.0 * sharp)))
            if n1 + n2 + n3 <= best1 + best2 + best3:
                best1, best2, best3 = float(n1), float(n2), float(n3)
    return best1, best2, best3


def least_times(first: float, second: float, third: float) -> tuple[float, float, float]:
    """Numbers x1 >= x2 + x3, x2 >= x3 of the least sum with x1 >= first, x1 x2 >= second, x1 x2 x3 >= third."""
    x1, x2, x3 = first, second / first, third / second
    if x2 < x3:  # the largest acceleration is not reached
        x2 = x3 = math.sqrt(third / first)
    if x1 >= x2 + x3:
        return x1, x2, x3
    x3 = third / second
    x2 = 2.0 * second / (math.sqrt(x3 * x3 + 4.0 * second) + x3)  # the largest velocity is not reached
    if x2 < x3:
        x2 = x3 = (0.5 * third) ** (1.0 / 3.0)
    return x2 + x3, x2, x3


def write_rows(work: RestWork, ticks: int) -> None:
    """Fill in positions, velocities and accelerations at all ticks; the last ones are those of the first, reversed."""
    joints, dt = work.counts[RestInteger.JOINTS], work.dt[0]
    for j in range(joints):
        n1, n2, n3 = work.ticks[3 * j], work.ticks[3 * j + 1], work.ticks[3 * j + 2]
        start, end = work.start[j], work.end[j]
        moved = end - start
        for row in range(ticks // 2 + 1):
            share, speed, pull = ramp(row, n2, n3)
            away, slower, softer = ramp(row - n1, n2, n3)
            gone, v, a = moved * (share - away) / n1, moved * (speed - slower) / n1 / dt, moved * (pull - softer) / n1
            early, late = row * joints + j, (ticks - row) * joints + j
            work.q[late], work.v[late], work.a[late] = end - gone, v, -a / dt / dt
            work.q[early], work.v[early], work.a[early] = start + gone, v, a / dt / dt


def write_line(work: RestWork, ticks: int, n1: float, n2: float, n3: float) -> None:
    """`write_rows` on a straight line: no joint is beyond its ends by rounding."""
    joints, dt = work.counts[RestInteger.JOINTS], work.dt[0]
    for row in range(ticks // 2 + 1):
        share, speed, pull = ramp(row, n2, n3)
        away, slower, softer = ramp(row - n1, n2, n3)
        gone, v, a = (share - away) / n1, (speed - slower) / n1 / dt, (pull - softer) / n1
        for j in range(joints):
            start, end, early, late = work.start[j], work.end[j], row * joints + j, (ticks - row) * joints + j
            step, low, high = end - start, min(start, end), max(start, end)
            work.q[late] = min(max(start + (1.0 - gone) * step, low), high) if row else end
            work.v[late], work.a[late] = v * step, -a / dt / dt * step
            work.q[early] = min(max(start + gone * step, low), high)
            work.v[early], work.a[early] = v * step, a / dt / dt * step


def ramp(tick: float, n2: float, n3: float) -> tuple[float, float, float]:
    """A speed that rises from 0 to 1 in n2 + n3 ticks: its integral, itself, and its derivative; n2 >= n3."""
    left = n2 + n3 - tick
    if left <= 0.0:
        return tick - 0.5 * (n2 + n3), 1.0, 0.0
    if tick <= 0.0:
        return 0.0, 0.0, 0.0
    if tick < n3:
        return tick**3 / (6.0 * n2 * n3), 0.5 * tick * tick / (n2 * n3), tick / (n2 * n3)
    if left < n3:
        falls = left / (n2 * n3)
        return tick - 0.5 * (n2 + n3) + left * left * falls / 6.0, 1.0 - 0.5 * left * falls, falls
    middle = tick - 0.5 * n3
    return (0.5 * middle * middle + n3 * n3 / 24.0) / n2, middle / n2, 1.0 / n2
