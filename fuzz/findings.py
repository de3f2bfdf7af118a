"""What a fuzzed case may reveal."""

from __future__ import annotations

from typing import NamedTuple


class Finding(NamedTuple):
    """One broken promise, or nearly one."""

    kind: str
    """"wrong" (an untrue answer), "lost" (a solution not found), "raw" (an exception that is not jacokin's), "crash"
    (the process died), "slow" (longer than a case may take), or "unsure" (a set that says it is not complete lacks a
    member, which breaks no promise)."""
    where: str
    """What was called."""
    what: str
    """Enough to see it again."""
