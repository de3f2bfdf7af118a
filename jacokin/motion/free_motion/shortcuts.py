"""`shorten`: a way with less detours, by straight motions between any two places of it (Geraerts and Overmars 2007)."""

from __future__ import annotations

import time

import numpy as np

from jacokin.arrays import Array
from jacokin.model.contact import Contact
from jacokin.motion.free_motion.trees import Space

MOST_MISSES = 40  # one after another, after which no more shortcuts are looked for
MOST_TRIES = 400
WORTH = 1e-3  # part of its time that a shortcut must save


def shorten(way: Array, space: Space, contact: Contact, rng: np.random.Generator, deadline: float) -> Array:
    """A way (m, dof) from the same start to the same goal that takes less time at full speed; all motions are clear.

    Args:
        way: (n, dof) configurations with clear straight motions between them [rad].
        space: what motions cost.
        contact: certifies shortcuts.
        rng: where shortcuts are tried.
        deadline: on the clock of `time.monotonic` [s].
    """
    way = _skip(way, space, contact, deadline)
    misses = 0
    for _ in range(MOST_TRIES):
        if misses >= MOST_MISSES or len(way) < 3 or time.monotonic() >= deadline:
            break
        ends = np.append(0.0, np.cumsum(space.time(np.diff(way, axis=0))))
        first, second = np.sort(rng.uniform(0.0, ends[-1], 2)).tolist()
        shorter = _cut(way, ends, first, second, space, contact)
        misses = misses + 1 if shorter is None else 0
        way = way if shorter is None else shorter
    return _skip(way, space, contact, deadline)


def _skip(way: Array, space: Space, contact: Contact, deadline: float) -> Array:
    """Leave out corners where the motion past them is clear and takes less time, the largest detours first."""
    corner = 1
    while corner < len(way) - 1 and time.monotonic() < deadline:
        last = len(way) - 1
        while last > corner:
            joined = _join(way[:corner], way[last:], space)
            saved = _time(way, space) - _time(joined, space)
            if saved >= -1e-12 and contact.in_the_way(joined[corner - 1], joined[corner]) is None:
                way = joined
                break
            last -= 1
        corner += 1
    return way


def _cut(way: Array, ends: Array, first: float, second: float, space: Space, contact: Contact) -> Array | None:
    """The way with a straight motion between two times on it; None if that is not clear, or saves nothing."""
    lines = np.clip(np.searchsorted(ends, (first, second), side="right") - 1, 0, len(way) - 2)
    i, j = int(lines[0]), int(lines[1])
    if i == j:
        return None
    a, b = (
        way[k] + (at - ends[k]) / (ends[k + 1] - ends[k]) * (way[k + 1] - way[k]) for k, at in ((i, first), (j, second))
    )
    a, b = space.into_limits(a), space.into_limits(b)
    shorter = _join(np.vstack([way[: i + 1], a]), np.vstack([b, way[j + 1 :]]), space)
    if _time(shorter, space) > (1.0 - WORTH) * _time(way, space):
        return None
    return None if contact.in_the_way(shorter[i + 1], shorter[i + 2]) is not None else shorter


def _join(head: Array, tail: Array, space: Space) -> Array:
    """Two parts of a way, the second in the copy that is the short way from the first."""
    step = tail[0] - head[-1]
    return np.vstack([head, tail - np.where(space.robot.unlimited, step - space.difference(head[-1], tail[0]), 0.0)])


def _time(way: Array, space: Space) -> float:
    return float(space.time(np.diff(way, axis=0)).sum())
