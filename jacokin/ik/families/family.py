"""`Family`: all configurations that reach a target with one free parameter, as intervals of the parameter.

The parameter p [rad] is the angle about the free axis of a `FreeAxis`, or joint 3 of a seven-joint arm. On a branch,
the configuration is a smooth function of p, from one fold to another (where two branches meet) or all the way round.
What is within the limits of a branch is some intervals of p.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from jacokin.arrays import Array
from jacokin.ik.answers.choosing import Cost, by_margin
from jacokin.ik.families.interval import Interval, choose
from jacokin.model import checks

if TYPE_CHECKING:
    from jacokin.ik.families.members import Members


class Family:
    """All configurations within the limits that reach a target with one free parameter. Immutable.

    Attributes:
        intervals: intervals of the parameter, by branch and start; none when nothing within the limits reaches it.
        complete: False when a curve was lost or a table of the kernels was full, so that intervals may be missing.
        branches: how many branches reach the target, within the limits or not; each from fold to fold.
    """

    __slots__ = ("_members", "branches", "complete", "intervals")

    def __init__(
        self,
        intervals: tuple[Interval, ...],
        members: Members,
        *,
        branches: int,
        complete: bool,
    ) -> None:
        """Take intervals of a target."""
        self.intervals, self._members = intervals, members
        self.branches, self.complete = branches, complete

    def __len__(self) -> int:
        """Number of intervals."""
        return len(self.intervals)

    def __iter__(self) -> Iterator[Interval]:
        """The intervals."""
        return iter(self.intervals)

    def __repr__(self) -> str:
        """How many intervals on how many branches."""
        return f"Family({len(self)} intervals within the limits, {self.branches} branches)"

    def nearest(self, seed: ArrayLike | None = None) -> Array | None:
        """The member (dof,) [rad] nearest to a seed, None for the seed of the family; None when there is no member.

        Raises:
            InvalidInputError: a malformed seed.
        """
        start = self._members.seed if seed is None else self._members.robot.configuration(seed, "seed")
        members = [interval.nearest(start) for interval in self.intervals]
        return min(members, key=lambda q: float(np.linalg.norm(q - start)), default=None)

    def widest(self) -> Array | None:
        """The member (dof,) [rad] with the largest limit margin; None when there is no member."""
        best = self.choose(by_margin(self._members.robot), self._members.seed)
        return None if best is None else best[0]

    def choose(self, cost: Cost, seed: Array) -> tuple[Array, float] | None:
        """The member (dof,) of the least cost and its parameter [rad]; of equal ones the first in order.

        Args:
            cost: of rows (m, dof), see `choosing`.
            seed: (dof,) unlimited joints take the copies nearest to it.
        """
        return choose(self.intervals, cost, seed) if self.intervals else None

    def sample(self, n: int) -> Array:
        """Members (k, dof) [rad] spread over all intervals in proportion to their lengths.

        Args:
            n: how many; k is n, or the number of intervals if that is more (each has one at least); 0 without members.

        Raises:
            InvalidInputError: n is not a positive whole number.
        """
        n = checks.whole_number("n", n, lowest=1)
        rows = [interval.sample(count)[1] for interval, count in zip(self.intervals, self._shares(n), strict=True)]
        return np.concatenate(rows) if rows else np.empty((0, self._members.robot.dof))

    def parameter(self, q: ArrayLike) -> float:
        """The parameter [rad] of a member (dof,): in [-pi, pi] about a free axis; the angle of joint 3 itself.

        Raises:
            InvalidInputError: a malformed q.
        """
        return self._members.parameter(self._members.robot.configuration(q))

    def _shares(self, n: int) -> list[int]:
        """How many samples each interval gets: one each, the rest by length."""
        counts = [1] * len(self.intervals)
        lengths = [interval.length for interval in self.intervals]
        for _ in range(n - len(counts) if counts else 0):
            index = max(range(len(counts)), key=lambda i: lengths[i] / counts[i])
            counts[index] += 1
        return counts
