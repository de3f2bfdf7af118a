"""Progress on stderr, where that is a terminal."""

from __future__ import annotations

import contextlib
import sys
import time
from collections.abc import Callable, Iterator

PERIOD = 0.1  # [s] between two lines
CLEAR = "\r\x1b[K"  # back to the start of the line, and erase it


@contextlib.contextmanager
def progress_bar(title: str) -> Iterator[Callable[[int, int], None]]:
    """A function that takes what is done and how much there is in all."""
    if not sys.stderr.isatty():
        yield lambda done, total: None
        return
    shown = 0.0
    first: tuple[float, int] | None = None  # when, and what had been done

    def show(done: int, total: int) -> None:
        nonlocal shown, first
        now = time.monotonic()
        first = first or (now, done)
        if now - shown > PERIOD:
            shown = now
            rate = (done - first[1]) / max(now - first[0], PERIOD)
            left = f", {rate:.0f}/s, {_duration((total - done) / rate)} left" if rate > 0.0 else ""
            sys.stderr.write(f"{CLEAR}{title} {done} of {total} ({100.0 * done / max(total, 1):.0f} %){left}")
            sys.stderr.flush()

    try:
        yield show
    finally:
        sys.stderr.write(CLEAR)
        sys.stderr.flush()


def _duration(seconds: float) -> str:
    if seconds < 100.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 6000.0 else f"{seconds / 3600.0:.1f} h"
