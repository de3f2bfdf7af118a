"""`Points`: the configurations that reach a target with no free parameter, and `BranchTable`, the rows they are in."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import compress, count
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.ik import preferences
from jacokin.ik.preferences import Cost, Prefer
from jacokin.ik.seeds import seed_within_limits
from jacokin.ik.solutions import picture
from jacokin.ik.solutions.solution_set import Interval, SolutionSet, Touching
from jacokin.kernels.branches import DISTANCE, FAMILY, ORIENTATION_ERROR, POSITION_ERROR, WITHIN_LIMITS
from jacokin.model import angles, checks
from jacokin.model.robot import Robot


class Knows(Protocol):
    """What points ask of the arm: an `ik.verification.Verifier`."""

    robot: Robot
    frame: str

    @property
    def looks_for_contact(self) -> bool:
        """Whether contact is looked for."""

    def touching(self, q: Array) -> list[tuple[str, str]]:
        """Pairs of shapes that touch at a configuration (dof,)."""


class BranchTable:
    """Branches, one row each, as the kernels computed them. Arrays are read-only.

    Attributes:
        rows: (k, 17) or (k, 20), the columns that ``kernels.closed_form.pose`` and ``batch`` name.
    """

    __slots__ = ("rows",)

    def __init__(self, rows: NDArray[np.float64]) -> None:
        """Make an array of one's own read-only."""
        self.rows = checks.sealed(rows)

    def __len__(self) -> int:
        """How many rows."""
        return len(self.rows)

    @property
    def q(self) -> NDArray[np.float64]:
        """(k, 6) joint angles [rad]: unlimited joints nearest to the seed, others within their limits if possible."""
        return self.rows[:, :6]

    @property
    def within_limits(self) -> NDArray[np.bool_]:
        """(k,) True where every joint is within its limits, exactly."""
        return checks.sealed(np.equal(self.rows[:, WITHIN_LIMITS], 1.0))

    @property
    def margin(self) -> NDArray[np.float64]:
        """(k, 6) distance to the nearer limit [rad]: negative outside, inf for an unlimited joint."""
        return self.rows[:, 6:12]

    @property
    def distance(self) -> NDArray[np.float64]:
        """(k,) distance to the seed [rad], Euclidean, circular on unlimited joints."""
        return self.rows[:, DISTANCE]

    @property
    def position_error(self) -> NDArray[np.float64]:
        """(k,) [m], measured on the model's own joint placements."""
        return self.rows[:, POSITION_ERROR]

    @property
    def orientation_error(self) -> NDArray[np.float64]:
        """(k,) [rad], measured on the model's own joint placements."""
        return self.rows[:, ORIENTATION_ERROR]


class Points(BranchTable, SolutionSet):
    """Every configuration that reaches a target, within the limits or not, nearest to the seed first.

    Attributes:
        dropped: whether some may be missing: a table of the kernels was full, or, on an arm not built like a Jaco,
            no neighbour of the arm settled what its roots left in doubt.
        angle: on fewer than six joints, (k,) angle about the free axis of the target [rad]; else None.
    """

    __slots__ = ("_seed", "_touching", "_verifier", "dropped")
    dimension = 0
    angle: Array | None = None

    def __init__(
        self,
        rows: Array,
        dropped: bool = False,
        seed: Array | None = None,
        verifier: Knows | None = None,
        touching: Touching | None = None,
    ) -> None:
        """Make the rows of one target, an array of one's own, read-only.

        Args:
            rows: (k, 17), see `BranchTable`.
            dropped: see there.
            seed: (dof,) that they are ordered by [rad or m].
            verifier: knows the arm, and finds what touches when asked for; None for rows of the closed form alone.
            touching: what touches, if it is known.
        """
        rows.setflags(write=False)  # one per solve: without a call more
        self.rows, self.dropped = rows, dropped
        self._seed, self._verifier, self._touching = seed, verifier, touching

    def __reduce__(self) -> tuple[object, tuple[object, ...]]:
        """Rebuild from the array, which stays read-only."""
        return type(self), (self.rows, self.dropped, self._seed, self._verifier, self.touching)

    @property
    def _said(self) -> str:
        """How many there are, and how many of them are within the limits."""
        return f"{len(self)} points, {int(self.within_limits.sum())} within the limits"

    @property
    def parameter(self) -> None:
        """None: nothing is free."""
        return None

    @property
    def branches(self) -> int:
        """How many points there are."""
        return len(self)

    @property
    def intervals(self) -> tuple[Interval, ...]:
        """None, (): nothing is free."""
        return ()

    @property
    def touching(self) -> Touching | None:
        """Pairs of shapes that touch at each point; None when the solver does not look."""
        if self._touching is None and self._verifier is not None and self._verifier.looks_for_contact:
            self._touching = tuple(tuple(self._verifier.touching(q)) for q in self.q)
        return self._touching

    @property
    def singular(self) -> NDArray[np.bool_]:
        """(k,) where a point stands for a whole curve: axes 4 and 6 of a spherical wrist aligned, for one."""
        return np.greater(self.rows[:, FAMILY], 0.0)

    @property
    def complete(self) -> bool:
        """False when a point stands for a whole curve, or when points may be missing, see `dropped`."""
        return not (self.dropped or self.singular.any())

    @property
    def q_within_limits(self) -> NDArray[np.float64]:
        """(m, dof) joint values [rad or m] of the points within the limits."""
        return checks.sealed(self.q[self.within_limits])

    def each_within_limits(self) -> Iterator[int]:
        """The indices of the points within the limits, in order."""
        return compress(count(), self.rows[:, WITHIN_LIMITS].tolist())

    def first_within_limits(self) -> int | None:
        """The index of the point within the limits that is nearest to the seed; None when there is none."""
        item = self.rows.item
        for index in range(len(self.rows)):  # seldom more than two, which plain floats tell sooner than NumPy
            if item(index, WITHIN_LIMITS) == 1.0:
                return index
        return None

    def name_of(self, index: int) -> str:
        """What messages call a point."""
        return f"branch {index + 1} of {len(self.rows)}"

    def nearest(self, seed: ArrayLike | None = None) -> NDArray[np.float64] | None:
        """The point (dof,) within the limits [rad or m] nearest to a seed, None for its own; None when there is none.

        Raises:
            InvalidInputError: a malformed seed, or one more than 1e6 rad from zero.
        """
        if seed is None:
            first = self.first_within_limits()
            return None if first is None else self.q[first]
        robot = self._known().robot
        start, _ = seed_within_limits(robot, seed)
        rows = angles.into_limits(angles.nearest_copy(self.q_within_limits, start), robot.lower, robot.upper)
        return None if not len(rows) else rows[int(np.linalg.norm(rows - start, axis=1).argmin())]

    def best(self, prefer: Prefer = "nearest") -> NDArray[np.float64] | None:
        """The preferred point within the limits, (dof,) [rad or m]; see `SolutionSet.best`."""
        if isinstance(prefer, str) and prefer == "nearest":
            return self.nearest()
        verifier = self._known()
        cost = preferences.cost_of(prefer, verifier.robot, verifier.frame)
        return next((q for _, q in self.in_order(cost)), None)

    def in_order(self, cost: Cost | None) -> Iterator[tuple[int, Array]]:
        """Indices and configurations (dof,) within the limits, best first, of equal ones the nearest."""
        indices, q = self.each_within_limits(), self.q
        if cost is None:
            yield from ((index, q[index]) for index in indices)
            return
        some, verifier, seed = list(indices), self._known(), self._seed
        if not some:
            return
        assert seed is not None
        copies = np.array(list(preferences.copies_to_try(cost.copies, q[some], seed, verifier.robot)))  # (c, k, dof)
        kept = ~np.isnan(copies).any(axis=2)
        rows, index = copies[kept], np.broadcast_to(some, kept.shape)[kept]
        for each in np.lexsort((np.linalg.norm(rows - seed, axis=1), cost(rows))).tolist():
            yield int(index[each]), rows[each]

    def parameter_of(self, q: ArrayLike) -> float:
        """Points have none.

        Raises:
            InvalidInputError: always.
        """
        raise InvalidInputError("points have no parameter: no joint is free")

    def sample(self, n: int) -> NDArray[np.float64]:
        """The n nearest points within the limits, (k, dof) [rad or m]; all where there are fewer.

        Raises:
            InvalidInputError: n is not a positive whole number.
        """
        return self.q_within_limits[: checks.whole_number("n", n, lowest=1)]

    def plot(self, path: str | Path) -> None:
        """Draw the joints of each point; see `SolutionSet.plot`."""
        robot = self._known().robot
        picture.write(path, lambda: picture.draw_points(self.q, self.within_limits, robot, self._said))

    def _known(self) -> Knows:
        """What knows the arm.

        Raises:
            InvalidInputError: nothing does.
        """
        if self._verifier is None:
            raise InvalidInputError("these points come from a closed form, which knows no robot: ask its IKSolver")
        return self._verifier
