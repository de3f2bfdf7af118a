"""How a file of targets came out, counted chunk by chunk."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from jacokin.arrays import Array
from jacokin.ik.files.target_rows import TargetFile
from jacokin.ik.results import BatchResult, Status

KEPT_FAILURES = 20  # rows whose message is in the summary; the file of answers has them all


@dataclass(frozen=True, slots=True)
class FileSummary:
    """The outcome of a file of targets."""

    targets: int
    """How many there are."""
    statuses: dict[Status, int]
    """How many have each status."""
    worst_position_error: float | None
    """The largest among the solved ones [m]; None if there are none."""
    worst_orientation_error: float | None
    """As that [rad]."""
    failures: tuple[tuple[int, Status, str], ...]
    """Line (of a CSV file) or row, status and message of the first ones that are not solved."""
    resumed: int
    """How many of the targets had been solved before, in a run that did not end."""
    seconds: float
    """Time that the rest took [s]."""
    output: Path | None
    """The file of answers."""

    @property
    def solved(self) -> int:
        """How many reach their target."""
        return self.statuses.get(Status.OK, 0)


@dataclass(frozen=True, slots=True)
class Tally:
    """Counts of some rows."""

    statuses: Counter[Status]
    worst: tuple[float | None, float | None]
    """Largest position [m] and orientation error [rad] among the solved rows; None without any."""
    failures: tuple[tuple[int, Status, str], ...]

    @property
    def count(self) -> int:
        """Rows in all."""
        return sum(self.statuses.values())

    def __add__(self, other: Tally) -> Tally:
        """These rows, and then the others."""
        return Tally(
            self.statuses + other.statuses,
            (_worse(self.worst[0], other.worst[0]), _worse(self.worst[1], other.worst[1])),
            (*self.failures, *other.failures)[:KEPT_FAILURES],
        )

    def document(self) -> dict[str, object]:
        """As JSON."""
        return {
            "statuses": {status.name: count for status, count in self.statuses.items()},
            "worst": self.worst,
            "failures": [(line, status.name, message) for line, status, message in self.failures],
        }

    @classmethod
    def of_document(cls, document: dict[str, Any]) -> Tally:  # Any: JSON
        """From JSON."""
        return cls(
            Counter({Status[name]: count for name, count in document["statuses"].items()}),
            (document["worst"][0], document["worst"][1]),
            tuple((line, Status[name], message) for line, name, message in document["failures"]),
        )

    @classmethod
    def of_rows(cls, targets: TargetFile, batch: BatchResult) -> Tally:
        """The counts of a block."""
        return cls(
            Counter(batch.status),
            (_largest(batch.position_error[batch.success]), _largest(batch.orientation_error[batch.success])),
            tuple(
                (int(targets.lines[row]), batch.status[row], batch.message[row])
                for row in np.flatnonzero(~batch.success)[:KEPT_FAILURES]
            ),
        )


EMPTY = Tally(Counter(), (None, None), ())


def _largest(errors: Array) -> float | None:
    return float(errors.max()) if len(errors) else None


def _worse(one: float | None, other: float | None) -> float | None:
    known = [value for value in (one, other) if value is not None]
    return max(known, default=None)
