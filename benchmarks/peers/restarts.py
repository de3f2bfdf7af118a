"""Random starts for the peers that have none of their own: home first, then uniform inside the limits."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

STARTS = 21  # home and 20 random ones
ITERATIONS = 50  # a start: a good one needs 5 to 20
TOLERANCE = 1e-6  # [m] and [rad], as jacokin's default


class Starts:
    """Start configurations of a loop, repeatable."""

    def __init__(self, setup: dict[str, Any]) -> None:
        """Read home and limits from what `benchmarks.run` sends; free joints are drawn from one turn."""
        self.home = np.array(setup["home"])
        limits = np.array(setup["limits"], dtype=np.float64)  # JSON null, a free joint, becomes NaN
        self.lower = np.where(np.isnan(limits[:, 0]), -np.pi, limits[:, 0])
        self.upper = np.where(np.isnan(limits[:, 1]), np.pi, limits[:, 1])
        self.rng = np.random.default_rng(0)

    def __iter__(self) -> Iterator[NDArray[np.float64]]:
        """Home, then random configurations."""
        yield self.home
        for _ in range(STARTS - 1):
            yield self.rng.uniform(self.lower, self.upper)


def multi_start(
    starts: Starts,
    descend: Callable[[NDArray[np.float64]], NDArray[np.float64] | None],
) -> NDArray[np.float64] | None:
    """First answer of a local search over the starts."""
    for start in starts:
        found = descend(start)
        if found is not None:
            return found
    return None
