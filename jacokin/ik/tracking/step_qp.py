"""The QP of one tick: least squares in the joint displacement, inside a box and a few half-spaces."""

from __future__ import annotations

import daqp
import numpy as np
import qpsolvers
import scipy.sparse
from numpy.typing import NDArray

from jacokin.ik.qp import backend
from jacokin.ik.qp.backend import QPFailed

Array = NDArray[np.float64]
Walls = tuple[Array, Array] | tuple[None, None]  # rows G and ends h of G x <= h, or none
DAQP_INFINITY = 1e30
DAQP_SOLVED = (1, 2)  # optimal, with or without softened constraints


class StepQP:
    """Solves with one QP solver, and with another one when that fails.

    Attributes:
        used: what ran in the last solve; names the fallback when one was needed.
    """

    def __init__(self, qp_solver: str) -> None:
        """Choose a solver.

        Raises:
            UnknownNameError: it is not installed.
        """
        self._name = backend.checked(qp_solver)
        self.used = self._name

    def solve(self, hessian: Array, gradient: Array, walls: Walls, low: Array, high: Array) -> Array:
        """Minimise x H x / 2 + g x with low <= x <= high behind the walls; the box is met exactly.

        Raises:
            QPFailed: no solver gave finite numbers.
        """
        for solver in (self._name, *backend.FALLBACKS):
            try:
                found = self._run(solver, hessian, gradient, walls, low, high)
            except (qpsolvers.QPError, ValueError):
                continue
            # An active-set solver fed with NaN reports success.
            if found is not None and np.isfinite(found).all():
                self.used = solver if solver == self._name else f"{self._name}, then {solver}"
                return np.clip(found, low, high)
        raise QPFailed

    @staticmethod
    def _run(solver: str, hessian: Array, gradient: Array, walls: Walls, low: Array, high: Array) -> Array | None:
        if solver == "daqp":
            return _run_daqp(hessian, gradient, walls, low, high)
        # OSQP wants sparse matrices.
        sparse = solver == "osqp"
        rows, ends = walls
        problem = qpsolvers.Problem(
            scipy.sparse.csc_matrix(hessian) if sparse else hessian,
            gradient,
            scipy.sparse.csc_matrix(rows) if sparse and rows is not None else rows,
            ends,
            lb=low,
            ub=high,
        )
        solution = qpsolvers.solve_problem(problem, solver=solver, **backend.OPTIONS.get(solver, {}))
        return solution.x if solution.found else None


def _run_daqp(hessian: Array, gradient: Array, walls: Walls, low: Array, high: Array) -> Array | None:
    """DAQP without the way through qpsolvers, which costs twice as much as the solve itself.

    Its first bounds are those of the variables, the others belong to the rows.
    """
    rows, ends = walls
    if rows is None or ends is None:
        rows, above, below = np.empty((0, gradient.size)), high, low
    else:
        above, below = np.concatenate([high, ends]), np.concatenate([low, np.full(ends.size, -DAQP_INFINITY)])
    found, _, flag, _ = daqp.solve(hessian, gradient, rows, above, below, np.zeros(above.size, dtype=np.int32))
    return np.array(found) if flag in DAQP_SOLVED else None
