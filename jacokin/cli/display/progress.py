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

    def show(done: int, total: int) -> None:
        nonlocal shown
        if time.monotonic() - shown > PERIOD:
            shown = time.monotonic()
            sys.stderr.write(f"{CLEAR}{title} {done} of {total} ({100.0 * done / max(total, 1):.0f} %)")
            sys.stderr.flush()

    try:
        yield show
    finally:
        sys.stderr.write(CLEAR)
        sys.stderr.flush()
