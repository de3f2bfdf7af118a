"""Parts of a file of targets: rows that can be read without what comes before them."""

from __future__ import annotations

from typing import NamedTuple


class Part(NamedTuple):
    """Some consecutive rows of a file; can be sent to other machines that see it."""

    first: int
    """The first row, counted from 0; of a CSV file its line, where the header is line 1."""
    rows: int
    """How many rows."""
    offset: int | None = 0
    """Bytes before it in a CSV file; None where the rows can only be reached through all that come before."""

    @property
    def can_be_read(self) -> bool:
        """Whether it can be read alone."""
        return self.offset is not None


def equal_parts(total: int, size: int, *, alone: bool = True) -> list[Part]:
    """Parts of `size` rows, the last one of what is left."""
    offset = 0 if alone else None
    return [Part(first, min(size, total - first), offset) for first in range(0, total, size)]
