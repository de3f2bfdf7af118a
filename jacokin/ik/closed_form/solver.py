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
    compilation         numba, its cache, and the plain form
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from jacokin.ik.closed_form import compilation
from jacokin.ik.closed_form.branch_table import BestBranches, BranchTable
from jacokin.ik.closed_form.geometry import measure
from jacokin.ik.closed_form.kernels.batch import BATCH_COLUMNS
from jacokin.ik.closed_form.kernels.pose import COLUMNS, MAX_BRANCHES

#: [m]; no arm reaches so far, and squares of numbers well above it overflow.
MAX_DISTANCE = 1e6

_NO_BATCH = np.empty((0, BATCH_COLUMNS))


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

    def solve_all(self, T: NDArray[np.float64], seed: NDArray[np.float64]) -> BranchTable:
        """Every branch, nearest to the seed first.

        Args:
            T: (4, 4) target T_base_tool: a rigid transformation, C-contiguous.
            seed: (6,) [rad].
        """
        if max(map(abs, T[:3, 3].tolist())) > MAX_DISTANCE:
            return BranchTable(np.empty((0, COLUMNS)))
        rows = np.empty((MAX_BRANCHES, COLUMNS))
        solve = compilation.solver()
        count = solve(self._chain, self._arm, self._limits, T[np.newaxis], seed[np.newaxis], rows, _NO_BATCH)
        return BranchTable(rows[:count])

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
        return BestBranches(best)


def _clipped_positions(T: NDArray[np.float64]) -> NDArray[np.float64]:
    """Targets (n, 4, 4) with positions clipped to ``MAX_DISTANCE``: still out of reach, and no square overflows."""
    if not np.abs(T[:, :3, 3]).max() > MAX_DISTANCE:
        return T
    T = T.copy()
    T[:, :3, 3] = np.clip(T[:, :3, 3], -MAX_DISTANCE, MAX_DISTANCE)
    return T
