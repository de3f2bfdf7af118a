"""`Standing`: whether an arm stands, and where, from angles that are measured with noise.

An arm that stands is measured about one place. How fast it seems to move, and how far that can be wrong, a line through
its last angles says: the more they scatter, the more of them it takes.
"""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from jacokin.arrays import Array
from jacokin.model.robot import Robot
from jacokin.runner.motions import apart

REST = 0.3  # [s] that are looked at where nothing scatters
WINDOWS = tuple(REST * 1.5**k for k in range(7))  # [s] the shortest that is sure counts
STILL = math.radians(0.1)  # in REST an arm that stands moves less
SURE = 2.0  # standard errors


class Standing:
    """Judges it by what was measured last."""

    def __init__(self, robot: Robot) -> None:
        """Begin with nothing measured."""
        self._robot = robot
        self._heard: deque[tuple[float, Array]] = deque()
        self._place: Array | None = None
        self._is_judged = True

    def hear(self, time: float, q: Array) -> None:
        """It was measured at (dof,) angles [rad]."""
        self._heard.append((time, q))
        self._is_judged = False
        while len(self._heard) > 1 and self._heard[1][0] <= time - WINDOWS[-1]:
            self._heard.popleft()

    @property
    def place(self) -> Array | None:
        """(dof,) where it stands [rad]; None where it moves, or that is not known."""
        if not self._is_judged:
            self._place, self._is_judged = self._judge(), True
        return self._place

    def _judge(self) -> Array | None:
        newest, q = self._heard[-1]
        ages = newest - np.array([time for time, _ in self._heard])
        rows = apart(self._robot, q, np.array([row for _, row in self._heard]))  # whole turns apart
        for window in WINDOWS:
            begins = int((ages >= window - 1e-9).sum()) - 1
            if begins < 0:
                return None
            off = _standing(ages[begins:], rows[begins:])
            if off is not None:
                return q + off
        return None


def _standing(ages: Array, q: Array) -> Array | None:
    """Where angles (n, dof) stand, measured so long ago (n,) [s], by a line through them; None where they may move."""
    if len(q) < 3:  # nothing is known of how they scatter
        return None
    times, mean = ages.mean() - ages, q.mean(axis=0)
    spread = float(times @ times)
    slope = times @ (q - mean) / spread
    variance = float(((q - mean - np.outer(times, slope)) ** 2).sum()) / ((len(q) - 2) * q.shape[1])  # of all joints
    error = SURE * math.sqrt(variance / spread)
    # An arm that trembles does not stand, by the standard deviation of its angles.
    if variance > math.radians(0.5) ** 2 or (np.abs(slope).max() + error) * REST > STILL:
        return None
    # What still creeps is at the end of its line, as far as that is more than scatter.
    creep = slope - np.divide(error**2, slope, out=slope.copy(), where=np.abs(slope) > error)
    return np.asarray(mean + creep * times[-1])
