"""`InTime`: two arms that move at once, and when they touch.

Of both motions a while is looked at together: each is near the straight line from where it is first to where it is
last, and by how much it may be away from it is known from its rows and its accelerations. If the two lines keep farther
apart than that, so do the arms, all the while; if not, the two halves of the while are looked at.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jacokin.arrays import Array
from jacokin.model.contact import ContactBetween, Pair
from jacokin.motion.rows import Rows

LONGEST = 0.25  # [s] a while that is looked at first
SHORTEST = 1e-3  # [s] one that is not halved: joints have moved by a milliradian


class TimedMotion:
    """A motion over time; before its first row, and after its last, the arm stands there.

    Attributes:
        duration: from its first row, at time 0, to its last [s].
    """

    def __init__(self, rows: Rows, begin: float = 0.0) -> None:
        """Take the rows (n,), which need not be equally far apart, and when on their clock time 0 is [s]."""
        self._t, self._q, self._v = rows.t - rows.t[0] - begin, rows.q, rows.v
        self.duration = max(float(self._t[-1]), 0.0)
        steps = np.diff(self._t)[:, None]
        pace = np.diff(self._q, axis=0) / steps if len(steps) else np.zeros((0, self._q.shape[1]))
        pulls = [(6.0 * pace - 4.0 * self._v[:-1] - 2.0 * self._v[1:]), (2.0 * self._v[:-1] + 4.0 * self._v[1:])]
        cubic = np.maximum(np.abs(pulls[0]), np.abs(pulls[1] - 6.0 * pace)) / steps
        pull, none = np.maximum(cubic, np.maximum(np.abs(rows.a[:-1]), np.abs(rows.a[1:]))), np.zeros_like(rows.q[:1])
        self._pull = np.vstack([none, pull, none])  # (n + 1, dof) largest accelerations up to each row, and after all

    def at(self, time: float) -> Array:
        """Where the joints are (dof,) at a time [s], between rows by the cubic that meets their velocities [rad]."""
        t = self._t
        if time <= t[0] or len(t) == 1:
            return np.asarray(self._q[0])
        if time >= t[-1]:
            return np.asarray(self._q[-1])
        row = int(np.searchsorted(t, time, side="right")) - 1
        step = float(t[row + 1] - t[row])
        x, q, v = (time - float(t[row])) / step, self._q[row], step * self._v[row]
        moved, last = self._q[row + 1] - q, step * self._v[row + 1]
        return np.asarray(q + x * (v + x * (3.0 * moved - 2.0 * v - last + x * (v + last - 2.0 * moved))))

    def line(self, begin: float, end: float) -> tuple[tuple[Array, Array], Array]:
        """Where the joints are at two times [s], and how far (dof,) from the line between they are meanwhile [rad]."""
        t, first, last = self._t, self.at(begin), self.at(end)
        low, high = int(np.searchsorted(t, begin, side="right")), int(np.searchsorted(t, end, side="left"))
        high = max(low, high)
        there = first + (t[low:high, None] - begin) / (end - begin) * (last - first)
        away = np.abs(self._q[low:high] - there).max(axis=0, initial=0.0)
        parts = np.diff(t[low:high], prepend=begin, append=end)[:, None]
        return (first, last), away + 0.125 * (parts**2 * self._pull[low : high + 1]).max(axis=0)


class Touch(NamedTuple):
    """A contact of an arm with another robot that may happen."""

    pair: Pair
    """The shapes, that of the other robot first."""
    begin: float
    """[s]."""
    end: float
    """[s]."""


def find_touch(
    contact: ContactBetween, arm: TimedMotion, other: TimedMotion, begin: float, end: float, delay: float = 0.0
) -> Touch | None:
    """The first while in which an arm and another robot may touch; None for none: certified, not sampled.

    Args:
        contact: of both.
        arm: the motion of the arm.
        other: that of the other robot.
        begin: when on the clock of the arm looking begins [s].
        end: when it ends [s].
        delay: so much later is it on the clock of the other robot [s].
    """
    count = max(int(np.ceil((end - begin) / LONGEST)), 1)
    edges = np.linspace(begin, end, count + 1)
    waiting = list(zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True))[::-1]
    while waiting:
        low, high = waiting.pop()
        own, away = arm.line(low, high)
        theirs, theirs_away = other.line(low + delay, high + delay)
        extra = float(away @ contact.levers + theirs_away @ contact.other_levers)
        pair = contact.in_the_way(own, theirs, extra)
        if pair is None:
            continue
        if high - low <= SHORTEST:
            return Touch(pair, low, high)
        middle = 0.5 * (low + high)
        waiting += [(middle, high), (low, middle)]
    return None
