"""QP back ends behind mink: which exist, how tightly they must solve, and what happens when one fails."""

from __future__ import annotations

from typing import Any

import mink
import numpy as np
import qpsolvers
import scipy.sparse
from numpy.typing import NDArray

from jacokin.errors import UnknownNameError

DEFAULT = "daqp"
FALLBACKS = ("daqp", "quadprog")

# Active-set solvers are exact; first-order ones stop early unless told otherwise, and then step past limits.
OPTIONS: dict[str, dict[str, Any]] = {
    "osqp": {"eps_abs": 1e-9, "eps_rel": 1e-9, "max_iter": 100_000, "raise_error": False},
    "proxqp": {"eps_abs": 1e-10},
}

TIKHONOV = 1e-12  # keeps the QP strictly convex at singular poses


class QPFailed(Exception):  # noqa: N818 - internal signal, never seen by users
    """No back end solved the QP."""


def checked(name: str) -> str:
    """`name` when that solver is installed.

    Raises:
        UnknownNameError: it is not; lists those that are.
    """
    if name not in qpsolvers.available_solvers:
        raise UnknownNameError("qp_solver", name, qpsolvers.available_solvers)
    return name


class Backend:
    """Solves mink's QP with one solver, and with another one when that fails.

    Attributes:
        name: the solver asked for.
        used: the solver of the last step, for the record; names the fallback when one was needed.
    """

    def __init__(self, name: str) -> None:
        """Choose a solver.

        Raises:
            UnknownNameError: it is not installed.
        """
        self.name = checked(name)
        self.used = name

    def step(
        self, configuration: mink.Configuration, tasks: list[mink.Task], limits: list[mink.Limit]
    ) -> NDArray[np.float64]:
        """Displacement of the joints (nv,) [rad] that mink's QP asks for.

        Raises:
            QPFailed: neither the solver nor a fallback gave finite numbers.
        """
        for solver in (self.name, *FALLBACKS):
            try:
                step = self._solve(configuration, tasks, limits, solver)
            except (mink.MinkError, qpsolvers.QPError, ValueError):
                continue
            # An active-set solver fed with NaN reports success.
            if np.isfinite(step).all():
                if solver != self.name:
                    self.used = f"{self.name}, then {solver}"
                return step
        raise QPFailed

    def _solve(
        self, configuration: mink.Configuration, tasks: list[mink.Task], limits: list[mink.Limit], solver: str
    ) -> NDArray[np.float64]:
        if solver != "osqp":
            return np.asarray(
                mink.solve_ik(
                    configuration, tasks, 1.0, solver, damping=TIKHONOV, limits=limits, **OPTIONS.get(solver, {})
                )
            )
        # OSQP wants sparse matrices, which mink does not build.
        problem = mink.build_ik(configuration, tasks, 1.0, damping=TIKHONOV, limits=limits)
        problem.P = scipy.sparse.csc_matrix(problem.P)
        if problem.G is not None:
            problem.G = scipy.sparse.csc_matrix(problem.G)
        solution = qpsolvers.solve_problem(problem, solver=solver, **OPTIONS[solver])
        if not solution.found or solution.x is None:
            raise mink.NoSolutionFound(solver)
        return np.asarray(solution.x)
