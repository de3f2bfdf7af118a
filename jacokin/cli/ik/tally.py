"""What a batch came to, counted block by block."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from jacokin.arrays import Array
    from jacokin.ik.files.targets_csv import TargetFile
    from jacokin.ik.results import BatchResult, Status

SHOWN_FAILURES = 20  # rows listed for people; the output file has them all


@dataclass(slots=True)
class Tally:
    """Counts of a batch, and the first rows that failed.

    Attributes:
        solved: rows that reach their target.
        statuses: rows of each status.
        worst_position_error: the largest among the solved rows [m]; None before the first.
        worst_orientation_error: as that [rad].
        failures: line in the file, status and message of the first rows that are not solved.
        results: every row as a dictionary, where they are kept.
    """

    solved: int = 0
    statuses: Counter[Status] = field(default_factory=Counter)
    worst_position_error: float | None = None
    worst_orientation_error: float | None = None
    failures: list[tuple[int, Status, str]] = field(default_factory=list)
    results: list[dict[str, object]] = field(default_factory=list)

    @property
    def count(self) -> int:
        """Rows in all."""
        return sum(self.statuses.values())

    def add(self, targets: TargetFile, batch: BatchResult, *, keep: bool) -> None:
        """Count a block; keep its rows if wanted."""
        self.solved += int(batch.success.sum())
        self.statuses.update(batch.status)
        self.worst_position_error = _worst(self.worst_position_error, batch.position_error[batch.success])
        self.worst_orientation_error = _worst(self.worst_orientation_error, batch.orientation_error[batch.success])
        for row in np.flatnonzero(~batch.success)[: SHOWN_FAILURES - len(self.failures)]:
            self.failures.append((int(targets.lines[row]), batch.status[row], batch.message[row]))
        if keep:
            self.results += _documents(targets, batch)


def _worst(before: float | None, errors: Array) -> float | None:
    if not len(errors):
        return before
    return max(float(errors.max()), before or 0.0)


def _documents(targets: TargetFile, batch: BatchResult) -> Iterator[dict[str, object]]:
    for row in range(len(targets)):
        yield {
            "line": int(targets.lines[row]),
            "status": batch.status[row],
            "q": batch.q[row],
            "position_error": batch.position_error[row],
            "orientation_error": batch.orientation_error[row],
            "method": batch.method[row],
            "message": batch.message[row],
        }
