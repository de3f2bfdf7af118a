"""One line of the report of `jacokin doctor`, and the states it may have."""

from __future__ import annotations

from dataclasses import dataclass

OK = "ok"
MISSING = "missing"  # optional, and not there
WARNING = "warning"
FAILED = "FAILED"  # needed, and does not work


@dataclass(frozen=True, slots=True)
class Finding:
    """One line of the report.

    Attributes:
        area: heading.
        name: what was looked at.
        state: one of the constants above.
        detail: version and place, or what is wrong and what to do.
    """

    area: str
    name: str
    state: str
    detail: str
