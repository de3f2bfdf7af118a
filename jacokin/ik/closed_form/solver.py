"""Every inverse-kinematics branch of a six-joint Jaco, in closed form.

The arm has no spherical wrist, yet its joint axes are so placed that the whole problem is one trigonometric polynomial
of degree 8 in joint 6. ``docs/closed_form.md`` derives it; the modules to read are, in this order:

    geometry            what is measured on the model, and when it is refused
    kernels/resultant   F(q6), the polynomial
    kernels/roots       all its real roots
    kernels/wrist       from a root to candidates (q1, q5, q6), refined on three smooth equations, then q2, q3, q4
    kernels/spherical   the same for the spherical variants
    kernels/pose        verification on the model itself, polishing, limits, duplicates
    compilation         numba, its cache, and the plain form
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from jacokin.ik.closed_form import compilation
from jacokin.ik.closed_form.compilation import warmup as warmup
from jacokin.ik.closed_form.geometry import measure
from jacokin.ik.closed_form.kernels.batch import BATCH_COLUMNS, BRANCHES, BRANCHES_WITHIN_LIMITS
from jacokin.ik.closed_form.kernels.pose import (
    COLUMNS,
    DISTANCE,
    FAMILY,
    MAX_BRANCHES,
    ORIENTATION_ERROR,
    POSITION_ERROR,
    WITHIN_LIMITS,
)

#: [m]; no arm reaches so far, and squares of numbers well above it overflow.
MAX_DISTANCE = 1e6

_NO_BATCH = np.empty((0, BATCH_COLUMNS))


class Rows:
    """Branches of one target, or the chosen branch of each of many; one row each.

    Attributes:
        rows: the table that the kernels filled; read-only.
    """

    __slots__ = ("rows",)

    def __init__(self, rows: NDArray[np.float64]) -> None:
        """Take over a table and make it read-only."""
        rows.flags.writeable = False
        self.rows = rows

    def __reduce__(self) -> tuple[object, tuple[object, ...]]:
        """Rebuild from the table, which stays read-only."""
        return type(self), (self.rows,)

    def __len__(self) -> int:
        """How many rows."""
        return len(self.rows)

    @property
    def q(self) -> NDArray[np.float64]:
        """(k, 6) joint angles [rad]: unlimited joints nearest to the seed, others within their limits if possible."""
        return self.rows[:, :6]

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

    @property
    def family(self) -> NDArray[np.bool_]:
        """(k,) whether the branch is a member of a one-parameter family (axes 4 and 6 of a spherical wrist aligned)."""
        return np.equal(self.rows[:, FAMILY], 1.0)


class BatchRows(Rows):
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


class ClosedForm:
    """The closed form of one arm and one frame; immutable.

    Attributes:
        spherical: whether axes 4, 5 and 6 meet in one point.
        misfit: largest deviation of the model from the structure [m or rad]; what it leaves is polished away.
    """

    __slots__ = ("_arm", "_chain", "_limits", "misfit", "spherical")

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
        """Measure the structure and keep its constants.

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

    def solve_all(self, T: NDArray[np.float64], seed: NDArray[np.float64]) -> Rows:
        """Every branch, nearest to the seed first.

        Args:
            T: (4, 4) target T_base_tool: a rigid transformation, C-contiguous.
            seed: (6,) [rad].
        """
        if max(map(abs, T[:3, 3].tolist())) > MAX_DISTANCE:
            return Rows(np.empty((0, COLUMNS)))
        rows = np.empty((MAX_BRANCHES, COLUMNS))
        solve = compilation.solver()
        count = solve(self._chain, self._arm, self._limits, T[np.newaxis], seed[np.newaxis], rows, _NO_BATCH)
        return Rows(rows[:count])

    def solve_batch(self, T: NDArray[np.float64], seed: NDArray[np.float64], threads: int = 1) -> BatchRows:
        """The best branch of each of n targets.

        Args:
            T: (n, 4, 4) targets, C-contiguous.
            seed: (n, 6) seeds [rad], C-contiguous.
            threads: how many threads share the work; the kernels release the GIL.
        """
        best = np.empty((len(T), BATCH_COLUMNS))
        if len(T) == 0:
            return BatchRows(best)
        T = _clipped_positions(T)
        solve = compilation.solver(len(T))

        def run(start: int, stop: int) -> None:
            rows = np.empty((MAX_BRANCHES, COLUMNS))
            solve(self._chain, self._arm, self._limits, T[start:stop], seed[start:stop], rows, best[start:stop])

        if threads == 1:
            run(0, len(T))
        else:
            edges = np.linspace(0, len(T), min(threads, len(T)) + 1).astype(int)
            with ThreadPoolExecutor(threads) as pool:
                list(pool.map(run, edges[:-1], edges[1:]))
        return BatchRows(best)


def _clipped_positions(T: NDArray[np.float64]) -> NDArray[np.float64]:
    """Targets (n, 4, 4) with positions clipped to ``MAX_DISTANCE``: still out of reach, and no square overflows."""
    if not np.abs(T[:, :3, 3]).max() > MAX_DISTANCE:
        return T
    T = T.copy()
    T[:, :3, 3] = np.clip(T[:, :3, 3], -MAX_DISTANCE, MAX_DISTANCE)
    return T
