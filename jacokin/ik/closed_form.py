"""`ClosedForm`: every branch of a six-joint arm at a pose.

A Jaco has no spherical wrist, yet its joint axes are so placed that the whole problem is one trigonometric polynomial
of degree 8 in joint 6; other arms have one of the same degree in another joint, which takes longer to write.
``docs/closed_form.md`` derives both; what computes is, in the order to read it:

    ik.geometry                     what is measured on the model, and how far it is from a Jaco
    kernels.closed_form.resultant   F(q6), the polynomial
    kernels.closed_form.roots       all its real roots
    kernels.closed_form.wrist       from a root to (q1, q5, q6), refined on three smooth equations, then q2, q3, q4
    kernels.closed_form.pose        the branches of a Jaco
    kernels.branches                verification on the model itself, polishing, limits, duplicates
    kernels.six_joints.pose         the branches of any other arm
    ik.structures                   what is measured on it
    kernels.library                 the kernels as machine code
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from jacokin.errors import StructureError
from jacokin.ik.geometry import chain_of, measure
from jacokin.ik.solutions.points import BranchTable, Knows, Points
from jacokin.ik.structures import measure_general
from jacokin.kernels.branches import COLUMNS, ORIENTATION_ERROR, POSITION_ERROR, WITHIN_LIMITS
from jacokin.kernels.clear_targets import ClearWork, solve_clear_targets
from jacokin.kernels.closed_form.batch import NOT_RIGID, BatchColumn, TargetWork, make_target_work, solve_targets
from jacokin.kernels.contact.run import ContactWork
from jacokin.kernels.library import Call, share
from jacokin.kernels.tolerances import EXACT_MISFIT, LIMIT_SNAP
from jacokin.model import checks
from jacokin.model.poses import checked_matrix


class BestBranches(BranchTable):
    """The best branch of each of n targets: within the limits and nearest to the seed, or else closest to the limits.

    A target without any branch has a row of NaN.
    """

    __slots__ = ()

    @property
    def branches(self) -> NDArray[np.int64]:
        """(n,) how many branches the target has."""
        return self.rows[:, BatchColumn.BRANCHES].astype(np.int64)

    @property
    def branches_within_limits(self) -> NDArray[np.int64]:
        """(n,) how many of them are within the limits."""
        return self.rows[:, BatchColumn.BRANCHES_WITHIN_LIMITS].astype(np.int64)

    @property
    def largest_margin(self) -> NDArray[np.float64]:
        """(n,) distance to the nearest limit [rad] of the branch that keeps farthest from them; negative outside."""
        return self.rows[:, BatchColumn.LARGEST_MARGIN]


class ClosedForm:
    """The closed form of one arm and one frame; immutable.

    Attributes:
        spherical: whether axes 4, 5 and 6 meet in one point.
        misfit: largest deviation of the model from a Jaco's structure [m or rad]. With more than rounding, the arm is
            solved as one of any structure.
        other: by what the arm is not built like a Jaco; None if it is, within the tolerance of the structure.
    """

    __slots__ = ("_arm", "_calls", "_chain", "_family_arm", "_few", "_limits", "misfit", "other", "spherical")

    def __init__(
        self,
        model: pin.Model,
        frame_id: int,
        tool: pin.SE3 | None,
        lower: NDArray[np.float64],
        upper: NDArray[np.float64],
        *,
        limit_snap: float = LIMIT_SNAP,
    ) -> None:
        """Measure the structure, keep its constants, and load the compiled kernels.

        Args:
            model: Pinocchio model with nq == nv == 6.
            frame_id: index of the frame to solve for; it must be fixed to the last link.
            tool: T_frame_tool, a constant pose after the frame, or None.
            lower: (6,) lower limits [rad], -inf where unlimited.
            upper: (6,) upper limits [rad], inf where unlimited.
            limit_snap: a joint past its limit by at most this is put on the limit [rad].

        Raises:
            StructureError: The model is no chain of six turning joints that moves the frame in six ways.
            JacokinError: the compiled kernels do not load.
        """
        self.other: StructureError | None = None
        try:
            geometry = measure(model, frame_id, tool)
        except StructureError as error:
            geometry = measure_general(chain_of(model, frame_id, tool, 6))
            self.other = error.with_traceback(None)
        self._chain, self._family_arm, self.misfit, self.spherical = geometry
        self._arm = self._family_arm
        if self.misfit > EXACT_MISFIT or self.spherical:  # as an arm with a spherical wrist, it is solved as quickly
            self._arm = measure_general(self._chain).arm
        self._limits = checks.sealed(np.ascontiguousarray([lower, upper, np.full(6, limit_snap)], dtype=np.float64))
        self._make_calls()

    @property
    def constants(self) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """What the kernels of curves know about the arm: chain (7, 3, 4), arm (46,), limits (3, 6); read-only."""
        return self._chain, self._family_arm, self._limits

    @property
    def arm(self) -> NDArray[np.float64]:
        """(46,) what the kernels solve poses with, read-only: other than that of `constants` for nearly a Jaco."""
        return self._arm

    @property
    def chain(self) -> NDArray[np.float64]:
        """(7, 3, 4) placements, read-only: pose = C0 Rz(q1) C1 Rz(q2) ... Rz(q6) C6."""
        return self._chain

    def solve_all(self, T: NDArray[np.float64], seed: NDArray[np.float64], verifier: Knows | None = None) -> Points:
        """Every branch, nearest to the seed first.

        Args:
            T: (4, 4) target T_base_tool.
            seed: (6,) [rad].
            verifier: knows the arm and what touches, for what may be asked of the points; None for neither.

        Raises:
            InvalidInputError: the target is not finite, or not rigid.
        """
        found = self.solve_rigid(T, seed, verifier)
        if found is None:
            found = self.solve_rigid(checked_matrix("target", np.array(T)), seed, verifier)
            assert found is not None  # what is checked is rigid
        return found

    def solve_rigid(
        self, T: NDArray[np.float64], seed: NDArray[np.float64], verifier: Knows | None = None
    ) -> Points | None:
        """Every branch of a target (4, 4), nearest to the seed first; None unless it is finite and rigid to rounding.

        The kernel checks that in a twentieth of the time.
        """
        try:
            call = self._calls.pop()
        except IndexError:
            call = self._one_target()
        run, target, start, rows = call
        target[...] = T
        start[...] = seed
        count = run()
        found = None
        if count != NOT_RIGID:
            # A copy: the call's own rows are overwritten by its next run.
            found = Points(rows[: count if count >= 0 else ~count].copy(), count < 0, seed, verifier)
        self._calls.append(call)
        return found

    def solve_few(self, T: NDArray[np.float64], seed: NDArray[np.float64]) -> BestBranches:
        """The best branch of each of a few targets (n, 4, 4) with one seed (6,); n is the same in every call."""
        try:
            call = self._few.pop()
        except IndexError:
            call = self._call(np.empty(T.shape), np.empty((len(T), 6)), np.empty((len(T), BatchColumn.COUNT)))
        call.work.T[:], call.work.seed[:] = T, seed
        call()
        found = BestBranches(call.work.best.copy())
        self._few.append(call)
        return found

    def nearest_branch(self) -> NearestBranch:
        """What gives the first of `solve_all`'s branches that is within the limits."""
        return NearestBranch(self._call(np.eye(4)[np.newaxis], np.zeros((1, 6)), nearest=np.empty((1, COLUMNS))))

    def _make_calls(self) -> None:
        """One call of the kernels; each thread takes an idle one, or makes one, and puts it back."""
        self._calls = [self._one_target()]
        self._few: list[Call[TargetWork]] = []  # of a few targets

    def _one_target(self) -> tuple[Call[TargetWork], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """A call of the kernels for one target; its target (4, 4), seed (6,) and rows (24, 17)."""
        call = self._call(np.empty((1, 4, 4)), np.empty((1, 6)))
        return call, call.work.T[0], call.work.seed[0], call.work.pose.branches.rows

    def _call(
        self,
        T: NDArray[np.float64],
        seed: NDArray[np.float64],
        best: NDArray[np.float64] | None = None,
        nearest: NDArray[np.float64] | None = None,
    ) -> Call[TargetWork]:
        """A call of the kernels for n targets (n, 4, 4) and seeds (n, 6).

        Args:
            T: targets.
            seed: seeds [rad].
            best: (n, 20) filled with the best branches; None for all of one target.
            nearest: (n, 17) filled with no more than these.
        """
        work = self._work(T, seed)
        if best is not None:
            work = work._replace(best=best)
        return Call(solve_targets, work if nearest is None else work._replace(nearest=nearest))

    def _work(self, T: NDArray[np.float64], seed: NDArray[np.float64]) -> TargetWork:
        """Work arrays for n targets and seeds."""
        if len(T) != len(seed):
            raise ValueError(f"the kernels need a seed for each target, not {len(seed)} for {len(T)}")
        return make_target_work()._replace(chain=self._chain, arm=self._arm, limits=self._limits, T=T, seed=seed)

    def __getstate__(self) -> tuple[object, ...]:
        """Pickle the constants; calls are made anew."""
        return self._chain, self._arm, self._family_arm, self._limits, self.spherical, self.misfit, self.other

    def __setstate__(self, state: Any) -> None:
        """Take the constants again, read-only."""
        self._chain, self._arm, self._family_arm, self._limits, self.spherical, self.misfit, self.other = state
        for array in (self._arm, *self.constants):
            checks.sealed(array)
        self._make_calls()

    def solve_batch(self, T: NDArray[np.float64], seed: NDArray[np.float64], threads: int = 1) -> BestBranches:
        """The best branch of each of n targets.

        Args:
            T: (n, 4, 4) targets, C-contiguous.
            seed: (n, 6) seeds [rad], C-contiguous.
            threads: how many threads share the work; the kernels release the GIL.
        """
        best = np.empty((len(T), BatchColumn.COUNT))

        def run(start: int, stop: int) -> None:
            self._call(T[start:stop], seed[start:stop], best[start:stop])()

        share(run, len(T), threads)
        return BestBranches(best)

    def solve_nearest(self, T: NDArray[np.float64], seed: NDArray[np.float64], threads: int = 1) -> BranchTable:
        """The branch of each target (n, 4, 4) nearest to its seed; quicker than `solve_batch`, which counts all."""
        nearest = np.empty((len(T), COLUMNS))

        def run(start: int, stop: int) -> None:
            self._call(T[start:stop], seed[start:stop], nearest=nearest[start:stop])()

        share(run, len(T), threads)
        return BranchTable(nearest)

    def solve_clear_batch(
        self,
        T: NDArray[np.float64],
        seed: NDArray[np.float64],
        look: Callable[[], ContactWork],
        tolerances: tuple[float, float],
        *,
        avoids: bool,
        threads: int = 1,
    ) -> tuple[BranchTable, NDArray[np.bool_]]:
        """The best branch of each of n targets, as `solve_nearest`, and whether it is in contact.

        Args:
            T: as `solve_batch`.
            seed: as `solve_batch`.
            look: makes the arrays for contact, for each thread its own.
            tolerances: in position [m] and orientation [rad], of branches that reach their target.
            avoids: True for the nearest branch that is clear, where there is one.
            threads: as `solve_batch`.
        """
        nearest, touching = np.empty((len(T), COLUMNS)), np.zeros(len(T), dtype=np.int64)

        def run(start: int, stop: int) -> None:
            targets = self._work(T[start:stop], seed[start:stop])._replace(nearest=nearest[start:stop])
            flag = np.array([avoids], dtype=np.int64)
            Call(solve_clear_targets, ClearWork(targets, look(), np.array(tolerances), flag, touching[start:stop]))()

        share(run, len(T), threads)
        return BranchTable(nearest), touching > 0


class NearestBranch:
    """The nearest branch within the limits, for callers who ask again and again; for one thread at a time.

    Attributes:
        T: (4, 4) target T_base_tool, to be filled in: a rigid transformation.
        seed: (6,) [rad], to be filled in.
    """

    __slots__ = ("T", "_call", "_row", "seed")

    def __init__(self, call: Call[TargetWork]) -> None:
        """Take a call of the kernels for one target, with a row for its best branch."""
        self._call = call
        self.T, self.seed, self._row = call.work.T[0], call.work.seed[0], call.work.nearest[0]

    def __call__(self) -> NDArray[np.float64] | None:
        """The branch, (6,) [rad], an array of the caller's own; None without one."""
        self._call()
        return self._row[:6].copy() if self._row[WITHIN_LIMITS] == 1.0 else None

    @property
    def errors(self) -> tuple[float, float]:
        """Position [m] and orientation error [rad] of the last branch, measured on the model's own joint placements."""
        return self._row[POSITION_ERROR], self._row[ORIENTATION_ERROR]
