"""`Ticker`: ticks as time passes, and what is done every so many of them."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from jacokin.twin.faults import TICK

BEHIND = 0.1  # [s] what is later than this is not made up for
#: [s] after which a thread gives way to a tick; the 5 ms of Python, several times a tick, are more than a tick.
GIVES_WAY = 2e-4


@dataclass(slots=True)
class Ticker:
    """How simulated time passes."""

    speed: float = 1.0
    """Simulated seconds in a second; inf for as many as there can be."""
    late: int = 0
    """How many ticks were more than 0.1 s late."""

    def run(
        self, tick: Callable[[], None], every: Iterable[tuple[float, Callable[[], None]]], goes_on: Callable[[], bool]
    ) -> None:
        """Tick until it is enough.

        Args:
            tick: lets 10 ms of simulated time pass.
            every: what else is done, and in which simulated time [s].
            goes_on: whether to go on.
        """
        jobs = [(max(1, round(period / TICK)), job) for period, job in every]
        due, count = time.monotonic(), 0
        before = sys.getswitchinterval()
        sys.setswitchinterval(GIVES_WAY)
        try:
            while goes_on():
                tick()
                count += 1
                for ticks, job in jobs:
                    if count % ticks == 0:
                        job()
                if math.isinf(self.speed):
                    continue
                due += TICK / self.speed
                ahead = due - time.monotonic()
                if ahead > 0.0:
                    time.sleep(ahead)
                elif ahead < -BEHIND:
                    self.late, due = self.late + 1, time.monotonic()
        finally:
            sys.setswitchinterval(before)
