"""Every inverse-kinematics branch of a six-joint Jaco, in closed form.

The arm has no spherical wrist, yet its joint axes are so placed that the whole problem is one trigonometric polynomial
of degree 8 in joint 6. ``docs/closed_form.md`` derives it; the modules to read are, in this order:

    geometry            what is measured on the model, and when it is refused
    kernels/resultant   F(q6), the polynomial
    kernels/roots       all its real roots
    kernels/wrist       from a root to candidates (q1, q5, q6), refined on three smooth equations, then q2, q3, q4
    kernels/spherical   the same for the spherical variants
    kernels/pose        verification on the model itself, polishing, limits, duplicates
    branch_table        the branches, as columns of the array that the kernels fill
    compilation         the kernels as machine code, and when it is made
"""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from itertools import compress, count

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from jacokin.ik.geometry import measure
from jacokin.kernels.closed_form.batch import (
    BATCH_COLUMNS,
    BRANCHES,
    BRANCHES_WITHIN_LIMITS,
    LARGEST_MARGIN,
    solve_targets,
)
from jacokin.kernels.closed_form.pose import (
    COLUMNS,
    DISTANCE,
    FAMILY,
    MAX_BRANCHES,
    ORIENTATION_ERROR,
    POSITION_ERROR,
    WITHIN_LIMITS,
    make_work,
)
from jacokin.kernels.compiled.library import NO_BATCH, KernelCall
from jacokin.kernels.compiled.loading import KERNELS


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


class ClosedForm:
    """The closed form of one arm and one frame; immutable.

    Attributes:
        spherical: whether axes 4, 5 and 6 meet in one point.
        misfit: largest deviation of the model from the structure [m or rad]; what it leaves is polished away.
    """

    __slots__ = ("_arm", "_calls", "_chain", "_limits", "misfit", "spherical")

    def __init__(
        self,
        model: pin.Model,
        frame_id: int,
        tool: pin.SE3 | None,
        lower: NDArray[np.float64],
        upper: NDArray[np.float64],
        *,
        limit_snap: float = 1e-9,
    ) -> None:
        """Measure the structure, keep its constants, and load compiled kernels if there are any.

        Args:
            model: Pinocchio model with nq == nv == 6.
            frame_id: index of the frame to solve for; it must be fixed to the last link.
            tool: T_frame_tool, a constant pose after the frame, or None.
            lower: (6,) lower limits [rad], -inf where unlimited.
            upper: (6,) upper limits [rad], inf where unlimited.
            limit_snap: a joint past its limit by at most this is put on the limit [rad].

        Raises:
            StructureError: The axes of the model are not placed as the closed form needs them.
        """
        geometry = measure(model, frame_id, tool)
        self._chain = geometry.chain
        self._arm = geometry.arm
        self.spherical = geometry.spherical
        self.misfit = geometry.misfit
        self._limits = np.ascontiguousarray([lower, upper, np.full(6, limit_snap)], dtype=np.float64)
        self._limits.flags.writeable = False
        self._calls: list[KernelCall] = []  # idle ones; each thread takes one, or makes one, and puts it back
        KERNELS.prepare()

    @property
    def constants(self) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """What the kernels know about the arm: chain (7, 3, 4), arm (39,), limits (3, 6); read-only."""
        return self._chain, self._arm, self._limits

    @property
    def chain(self) -> NDArray[np.float64]:
        """(7, 3, 4) placements, read-only: pose = C0 Rz(q1) C1 Rz(q2) ... Rz(q6) C6."""
        return self._chain

    def solve_all(self, T: NDArray[np.float64], seed: NDArray[np.float64]) -> BranchTable:
        """Every branch, nearest to the seed first.

        Args:
            T: (4, 4) target T_base_tool: a rigid transformation, C-contiguous.
            seed: (6,) [rad].
        """
        call, rows, count = self._solved(T, seed)
        # A copy: the call's own rows are overwritten by its next run.
        table = BranchTable(rows[:count].copy()) if count >= 0 else BranchTable(rows[:~count].copy(), dropped=True)
        if call is not None:
            self._calls.append(call)
        return table

    def nearest_branch(self) -> NearestBranch:
        """What gives the first of `solve_all`'s branches that is within the limits."""
        return NearestBranch(*self.constants)

    def _solved(
        self, T: NDArray[np.float64], seed: NDArray[np.float64]
    ) -> tuple[KernelCall | None, NDArray[np.float64], int]:
        """The rows of every branch, and what the kernels return; and the call, to be put back once they are read."""
        try:
            call = self._calls.pop()
        except IndexError:
            library = KERNELS.for_poses(1)
            if library is None:
                rows = np.empty((MAX_BRANCHES, COLUMNS))
                some = self._chain, self._arm, self._limits, T[np.newaxis], seed[np.newaxis]
                return None, rows, run_python(*some, rows, NO_BATCH)
            call = KernelCall(library, self._chain, self._arm, self._limits, np.empty((1, 4, 4)), np.empty((1, 6)))
        call.T[0] = T
        call.seed[0] = seed
        return call, call.rows, call()

    def __reduce__(self) -> tuple[object, tuple[object, ...]]:
        """Pickle the constants; calls are made anew."""
        return _rebuild, (self._chain, self._arm, self._limits, self.spherical, self.misfit)

    def solve_batch(self, T: NDArray[np.float64], seed: NDArray[np.float64], threads: int = 1) -> BestBranches:
        """The best branch of each of n targets.

        Args:
            T: (n, 4, 4) targets, C-contiguous.
            seed: (n, 6) seeds [rad], C-contiguous.
            threads: how many threads share the work; the kernels release the GIL.
        """
        best = np.empty((len(T), BATCH_COLUMNS))
        if len(T) == 0:
            return BestBranches(best)
        library = KERNELS.for_poses(len(T))

        def run(start: int, stop: int) -> None:
            some = self._chain, self._arm, self._limits, T[start:stop], seed[start:stop]
            if library is None:
                run_python(*some, np.empty((MAX_BRANCHES, COLUMNS)), best[start:stop])
            else:
                KernelCall(library, *some, best[start:stop])()

        if threads == 1:
            run(0, len(T))
        else:
            edges = np.linspace(0, len(T), min(threads, len(T)) + 1).astype(int)
            with ThreadPoolExecutor(threads) as pool:
                list(pool.map(run, edges[:-1], edges[1:]))
        return BestBranches(best)


class NearestBranch:
    """The nearest branch within the limits, for callers who ask again and again; for one thread at a time.

    Attributes:
        T: (4, 4) target T_base_tool, to be filled in: a rigid transformation.
        seed: (6,) [rad], to be filled in.
    """

    __slots__ = ("T", "_arrays", "_best", "_call", "seed")

    def __init__(self, chain: NDArray[np.float64], arm: NDArray[np.float64], limits: NDArray[np.float64]) -> None:
        """Take the constants of a closed form."""
        T, seed, best = np.eye(4)[np.newaxis], np.zeros((1, 6)), np.empty((1, BATCH_COLUMNS))
        self.T, self.seed, self._best = T[0], seed[0], best[0]
        self._arrays = chain, arm, limits, T, seed, best
        self._call: KernelCall | None = None

    def __call__(self) -> NDArray[np.float64] | None:
        """The branch, (6,) [rad], an array of the caller's own; None without one."""
        if self._call is None:
            self._first_calls()
        else:
            self._call()
        return self._best[:6].copy() if self._best[WITHIN_LIMITS] == 1.0 else None

    def _first_calls(self) -> None:
        """Run the plain form until there is machine code."""
        library = KERNELS.for_poses(1)
        *given, best = self._arrays
        if library is None:
            run_python(*given, np.empty((MAX_BRANCHES, COLUMNS)), best)
        else:
            self._call = KernelCall(library, *self._arrays)
            self._call()


def run_python(*arguments: NDArray[np.float64]) -> int:
    """The kernels without machine code, and as silent: squares of large distances are infinite."""
    chain, arm, limits, T, seed, rows, best = arguments
    with np.errstate(all="ignore"):
        return solve_targets(chain, arm, limits, T, seed, make_work(rows), best)


def _rebuild(
    chain: NDArray[np.float64], arm: NDArray[np.float64], limits: NDArray[np.float64], spherical: bool, misfit: float
) -> ClosedForm:
    form = ClosedForm.__new__(ClosedForm)
    for array in (chain, arm, limits):
        array.flags.writeable = False
    form._chain, form._arm, form._limits = chain, arm, limits
    form.spherical, form.misfit, form._calls = spherical, misfit, []
    KERNELS.prepare()
    return form
