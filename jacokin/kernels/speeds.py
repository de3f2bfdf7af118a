"""The least time along a path: how fast each place of it is passed, within limits that are linear in speed squared.

With x = speed^2 at the beginning of an interval and u the acceleration on it, every limit reads |u + tilt x| <= high.
Reachability analysis (Pham and Pham: A new approach to time-optimal path parameterization based on reachability
analysis, 2018): a pass backward finds the largest speeds from which the path can be followed, one forward takes them.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array

STILL = 1e-12  # tilts that differ by less are the same


class SpeedWork(NamedTuple):
    """What a call reads and writes; arrays may have more room."""

    counts: NDArray[np.int64]  # (2,) n intervals, and limits of each
    lengths: Array  # (n,) of the intervals
    high: Array  # (n limits,) infinite where there is no limit
    tilt: Array  # (n limits,)
    top: Array  # (n + 1,) the largest x at each place
    reach: Array  # (n + 1,) the largest x from which the path can be followed to its end
    x: Array  # (n + 1,) the largest x that can be reached, too


def fit_speeds(work: SpeedWork) -> int:
    """Fill reach and x; they begin with the x at the first place that `top` allows, and x is 0 there."""
    n, limits = work.counts[0], work.counts[1]
    work.reach[n] = work.top[n]
    for i in range(n - 1, -1, -1):
        high, tilt = work.high[i * limits : (i + 1) * limits], work.tilt[i * limits : (i + 1) * limits]
        work.reach[i] = min(work.top[i], controllable(high, tilt, 0.5 / work.lengths[i], work.reach[i + 1]))
    work.x[0] = 0.0
    for i in range(n):
        u = math.inf
        for k in range(i * limits, (i + 1) * limits):
            u = min(u, work.high[k] - work.tilt[k] * work.x[i])
        work.x[i + 1] = max(min(work.reach[i + 1], work.x[i] + 2.0 * work.lengths[i] * u), 0.0)
    return 0


def controllable(high: Array, tilt: Array, half: float, ahead: float) -> float:
    """The largest x from which some u leads to an x of at most `ahead`, and of no less than zero.

    Every lower bound of u must stay below every upper one; both are linear in x.
    """
    most, least_tilt, most_tilt = math.inf, math.inf, -math.inf
    for i in range(len(high)):
        least_tilt, most_tilt = min(least_tilt, tilt[i]), max(most_tilt, tilt[i])
    crossing = most_tilt - least_tilt > STILL  # on straight lines none do
    for i in range(len(high)):
        if high[i] == math.inf:
            continue
        if tilt[i] - half > STILL:
            most = min(most, high[i] / (tilt[i] - half))
        if half - tilt[i] > STILL:
            most = min(most, (half * ahead + high[i]) / (half - tilt[i]))
        for k in range(len(high) if crossing else 0):
            if tilt[i] - tilt[k] > STILL:
                most = min(most, (high[i] + high[k]) / (tilt[i] - tilt[k]))
    return most


def make_speed_work(limits: int = 0, intervals: int = 0) -> SpeedWork:
    """Fresh work arrays for so many intervals with so many limits."""
    n, counts = intervals, np.array([intervals, limits])
    rows = np.zeros((3, n + 1 if limits else 0))
    return SpeedWork(counts, np.zeros(n), np.zeros(n * limits), np.zeros(n * limits), *rows)
