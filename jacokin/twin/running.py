"""`run`: ticks at a pace, and what is done every so many of them."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable, Iterable

from jacokin.twin.faults import TICK

BEHIND = 0.1  # [s] what is later than this is not made up for
#: [s] after which a thread gives way to a tick; the 5 ms of Python, several times a tick, are more than a tick.
GIVES_WAY = 2e-4


def run(
    tick: Callable[[], None],
    every: Iterable[tuple[float, Callable[[], None]]],
    goes_on: Callable[[], bool],
    *,
    pace: float = 1.0,
) -> int:
    """Tick until it is enough; returns how many ticks were more than 0.1 s late.

    Args:
        tick: lets 10 ms of simulated time pass.
        every: what else is done, and in which simulated time [s].
        goes_on: whether to go on.
        pace: simulated seconds in a second; inf for as many as there can be.
    """
    jobs = [(max(1, round(period / TICK)), job) for period, job in every]
    due, late, count = time.monotonic(), 0, 0
    before = sys.getswitchinterval()
    sys.setswitchinterval(GIVES_WAY)
    try:
        while goes_on():
            tick()
            count += 1
            for ticks, job in jobs:
                if count % ticks == 0:
                    job()
            if math.isinf(pace):
                continue
            due += TICK / pace
            ahead = due - time.monotonic()
            if ahead > 0.0:
                time.sleep(ahead)
            elif ahead < -BEHIND:
                late, due = late + 1, time.monotonic()
    finally:
        sys.setswitchinterval(before)
    return late
