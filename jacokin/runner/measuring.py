"""What measured angles say of an arm: `LatencyMeasurement`, how late it is seen to move; `Standing`, whether it stands.

An arm is late by the latency at which what is measured fits best to where it was led to at every tick, away from it by
as much as the arm stood away at first; it is known once the fit is sharp. That takes a motion that changes its speed,
as one that begins does. Where it leaves much unexplained, only a share of what was sent has arrived, and the arm has
moved by so much less. Afterwards it is left alone: an arm that is held would seem to be late, too.

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

MOST = 1.0  # [s] a driver is not later
STEP = 0.02  # [s] between latencies that are tried
WINDOW = 4.0  # [s] that is looked at
COUNT = 67  # measurements that are, at most
APART = 0.03  # [s] between measurements that are looked at, at least
MOVED = np.radians(0.5)  # by which a joint was led before anything is said
NOISE = np.radians(0.03)  # of angles, at least: a count of an encoder, and ticks
LOST = 0.05  # of the squared angles that are measured: if all that was sent arrives, less is unexplained
SHARP = 0.01  # [s] standard deviation, and by which fits differ that agree
STAYS = 0.1  # [s] for which fits agree: after a moment in which all was lost, they do not


class LatencyMeasurement:
    """Measures it once, while an arm is led.

    Attributes:
        found: the latency [s]; None until it is known.
        loses: whether a share of what was sent seems to have got lost.
    """

    def __init__(self, robot: Robot) -> None:
        """Begin with nothing known."""
        self._robot, self.found, self.loses = robot, None, False
        self._led: deque[tuple[float, Array]] = deque()
        self._heard: deque[tuple[float, Array]] = deque(maxlen=COUNT)
        self._fits = list[tuple[float, float]]()  # since when they agree, and on what

    found: float | None

    def lead(self, time: float, q: Array) -> None:
        """The arm has been led to (dof,) angles [rad] by a time [s], if it follows at once."""
        if self.found is None:
            self._led.append((time, q))
            while self._led[0][0] < time - WINDOW - MOST:
                self._led.popleft()

    def hear(self, time: float, q: Array) -> None:
        """It was measured at (dof,) angles [rad]."""
        if self.found is not None or (self._heard and time < self._heard[-1][0] + APART - 1e-9):
            return
        self._heard.append((time, q))
        while self._heard[0][0] < time - WINDOW:
            self._heard.popleft()
        fit = self._fit()
        if fit is None or not self._fits or abs(fit - self._fits[0][1]) > SHARP:
            self._fits = [] if fit is None else [(time, fit)]
        elif time - self._fits[0][0] >= STAYS:
            self.found = fit

    def _fit(self) -> float | None:
        """The latency at which what is measured fits best, if nothing else fits nearly as well [s]."""
        if len(self._heard) < 3:
            return None
        at, led = np.array([time for time, _ in self._led]), np.array([q for _, q in self._led])
        if np.ptp(led, axis=0).max() < MOVED:
            return None
        times, q = np.array([time for time, _ in self._heard]), np.array([q for _, q in self._heard])
        # The short way round, from where the arm was led to when it was first heard.
        measured = led[0] - apart(self._robot, q, np.broadcast_to(led[0], q.shape))
        tried = np.arange(0.0, MOST + 0.5 * STEP, STEP)
        places = times - tried[:, None]
        wanted = np.stack([np.interp(places, at, column) for column in led.T], axis=2)  # (tried, n, dof)
        wanted -= wanted.mean(axis=1, keepdims=True)
        measured -= measured.mean(axis=0)
        led_far, both, moved = (wanted**2).sum(axis=(1, 2)), (wanted * measured).sum(axis=(1, 2)), (measured**2).sum()
        misfit = moved - 2.0 * both + led_far
        self.loses = bool(misfit.min() > LOST * moved)
        if self.loses:
            share = np.clip(both / np.maximum(led_far, 1e-12), 0.0, 1.0)
            misfit = moved - 2.0 * share * both + share**2 * led_far
        best = int(np.argmin(misfit))
        if misfit[best] > 0.2 * moved:  # an arm that does something else is not late
            return None
        if not 0 < best < len(tried) - 1:
            return 0.0 if best == 0 and self._is_sharp(misfit[0], misfit[1], q.size) else None
        before, here, after = misfit[best - 1 : best + 2].tolist()
        bend = before - 2.0 * here + after
        if not self._is_sharp(here, here + 0.5 * bend, q.size):
            return None
        return float(tried[best] + 0.5 * STEP * (before - after) / bend)

    def _is_sharp(self, least: float, beside: float, count: int) -> bool:
        """Whether a misfit (of so many numbers) that is so much larger a step beside the least is worth a latency."""
        variance = max(NOISE**2, least / count)
        return bool(beside - least > variance * (STEP / SHARP) ** 2)


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
