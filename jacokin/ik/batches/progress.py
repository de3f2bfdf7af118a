"""How far a long run has come."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Progress:
    """How far a long run has come."""

    done: int
    """Rows or cells that are finished."""
    total: int
    """How many there are."""
    rate: float
    """How many are finished in a second of this run."""
    seconds_left: float
    """How long the rest takes at this rate [s]; infinite before the first chunk."""


def reporter(progress: Callable[[Progress], None] | None, total: int, done: int) -> Callable[[int], None]:
    """A function that is told how many more are finished, and reports them; `done` were before this run."""
    began, before = time.perf_counter(), done

    def advance(more: int) -> None:
        nonlocal done
        done += more
        if progress is not None:
            rate = (done - before) / max(time.perf_counter() - began, 1e-9)
            progress(Progress(done, total, rate, (total - done) / rate if rate > 0.0 else float("inf")))

    return advance
