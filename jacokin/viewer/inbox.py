"""What pages did and what is not answered yet: of each kind only the latest, so that nothing piles up."""

from __future__ import annotations

import threading


class Inbox:
    """A set of names in the order in which they came, filled by any thread and emptied by one."""

    def __init__(self) -> None:
        """Start empty and open."""
        self._changed = threading.Condition()
        self._counts: dict[str, int] = {}
        self._closed = False

    def post(self, name: str) -> None:
        """Add a name; one that waits already is counted."""
        with self._changed:
            self._counts[name] = self._counts.get(name, 0) + 1
            self._changed.notify()

    def take(self, wait: float | None) -> dict[str, int] | None:
        """Every name that waits, with how often it was posted.

        Args:
            wait: at most so long for a name [s]; None for without end.

        Returns:
            Empty after waiting in vain; None once closed.
        """
        with self._changed:
            self._changed.wait_for(lambda: self._counts or self._closed, wait)
            if self._closed:
                return None
            taken, self._counts = self._counts, {}
            return taken

    def waits(self, name: str) -> bool:
        """Whether a name waits to be taken."""
        with self._changed:
            return name in self._counts

    def close(self) -> None:
        """Let the taker finish."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()
