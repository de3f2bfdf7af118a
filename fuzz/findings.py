"""What a fuzzed case may reveal."""

from __future__ import annotations

from typing import NamedTuple


class Finding(NamedTuple):
    """One broken promise."""

    kind: str
    """"wrong" (an untrue answer), "lost" (a solution not found), "raw" (an exception that is not jacokin's), "crash"
    (the process died) or "slow" (longer than a case may take)."""
    where: str
    """What was called."""
    what: str
    """Enough to see it again."""
