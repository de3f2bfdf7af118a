"""Branches as the kernels fill them in: one row a branch, with a name for each group of columns."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import compress, count

import numpy as np
from numpy.typing import NDArray

from jacokin.ik.closed_form.kernels.batch import BRANCHES, BRANCHES_WITHIN_LIMITS, LARGEST_MARGIN
from jacokin.ik.closed_form.kernels.pose import DISTANCE, FAMILY, ORIENTATION_ERROR, POSITION_ERROR, WITHIN_LIMITS


class BranchTable:
    """The branches of one target, one row each, as the kernels computed them.

    Attributes:
        rows: (k, 17) or (k, 20), the columns that ``kernels.pose`` and ``kernels.batch`` name; read-only.
        dropped: whether a table of the kernels was full, so that branches may be missing.
    """

    __slots__ = ("dropped", "rows")

    def __init__(self, rows: NDArray[np.float64], dropped: bool = False) -> None:
        """Take over an array and make it read-only."""
        rows.flags.writeable = False
        self.rows = rows
        self.dropped = dropped

    def __reduce__(self) -> tuple[object, tuple[object, ...]]:
        """Rebuild from the array, which stays read-only."""
        return type(self), (self.rows, self.dropped)

    def __len__(self) -> int:
        """How many rows."""
        return len(self.rows)

    @property
    def q(self) -> NDArray[np.float64]:
        """(k, 6) joint angles [rad]: unlimited joints nearest to the seed, others within their limits if possible."""
        return self.rows[:, :6]

    def configuration(self, index: int) -> NDArray[np.float64]:
        """(6,) `q` of one row, read-only."""
        return self.rows[index, :6]

    @property
    def margin(self) -> NDArray[np.float64]:
        """(k, 6) distance to the nearer limit [rad]: negative outside, inf for an unlimited joint."""
        return self.rows[:, 6:12]

    @property
    def position_error(self) -> NDArray[np.float64]:
        """(k,) [m], measured on the model's own joint placements."""
        return self.rows[:, POSITION_ERROR]

    @property
    def orientation_error(self) -> NDArray[np.float64]:
        """(k,) [rad], measured on the model's own joint placements."""
        return self.rows[:, ORIENTATION_ERROR]

    @property
    def distance(self) -> NDArray[np.float64]:
        """(k,) Euclidean distance to the seed [rad]."""
        return self.rows[:, DISTANCE]

    @property
    def within_limits(self) -> NDArray[np.bool_]:
        """(k,) whether every joint is within its limits, exactly."""
        return np.equal(self.rows[:, WITHIN_LIMITS], 1.0)

    def each_within_limits(self) -> Iterator[int]:
        """The indices of the rows with every joint within its limits, in order."""
        return compress(count(), self.rows[:, WITHIN_LIMITS].tolist())

    @property
    def family(self) -> NDArray[np.bool_]:
        """(k,) whether the branch is a member of a one-parameter family (axes 4 and 6 of a spherical wrist aligned)."""
        return np.equal(self.rows[:, FAMILY], 1.0)


class BestBranches(BranchTable):
    """The best branch of each of n targets: within the limits and nearest to the seed, or else closest to the limits.

    A target without any branch has a row of NaN.
    """

    __slots__ = ()

    @property
    def branches(self) -> NDArray[np.int64]:
        """(n,) how many branches the target has."""
        return self.rows[:, BRANCHES].astype(np.int64)

    @property
    def branches_within_limits(self) -> NDArray[np.int64]:
        """(n,) how many of them are within the limits."""
        return self.rows[:, BRANCHES_WITHIN_LIMITS].astype(np.int64)

    @property
    def largest_margin(self) -> NDArray[np.float64]:
        """(n,) distance to the nearest limit [rad] of the branch that keeps farthest from them; negative outside."""
        return self.rows[:, LARGEST_MARGIN]
