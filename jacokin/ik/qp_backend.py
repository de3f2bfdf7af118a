"""`Backend`: QP solvers: which exist, how tightly they must solve, and what happens when one fails.

Its two users build their problems differently. `ik.qp` leaves that to mink on MuJoCo: most of a step is the solver
and the kinematics, so that nothing would be gained by writing it again. The tracker builds its own on Pinocchio: a tick
is one step, which so costs less than mink's, with accelerations and distances that mink's limits do not have.
``docs/performance.md`` has the figures.
"""

from __future__ import annotations

import importlib.util
import math
import sys
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

# qpsolvers imports JAX for one of its solvers, for a second, before it finds that the solver itself is not installed.
if importlib.util.find_spec("jaxopt") is None:
    sys.modules.setdefault("qpsolvers.solvers.jaxopt_osqp_", None)  # type: ignore[arg-type]  # of what cannot be imported

import daqp
import numpy as np
import osqp
import qpsolvers
import scipy.sparse

from jacokin.arrays import Array
from jacokin.errors import MissingExtraError
from jacokin.model import checks

if TYPE_CHECKING:
    import mink


Inequalities = tuple[Array, Array] | tuple[None, None]  # G (m, n) and h (m,) of G x <= h, or none

FALLBACKS = ("daqp", "quadprog", "osqp")  # tried in this order, those that are installed
EXTRAS = {"proxqp": ("proxsuite", "proxqp"), "quadprog": ("quadprog", "quadprog")}  # package, extra of jacokin

# Active-set solvers are exact; first-order ones stop early unless told otherwise, and then step past limits.
OPTIONS: dict[str, dict[str, Any]] = {  # keyword arguments of each solver
    # A solve that converges takes 2,000 iterations at most; one that does not would hold up a control loop.
    "osqp": {"eps_abs": 1e-9, "eps_rel": 1e-9, "max_iter": 4_000, "raise_error": True},
    "proxqp": {"eps_abs": 1e-10},
}

TIKHONOV = 1e-12  # keeps the QP strictly convex at singular poses


class QPFailed(Exception):  # noqa: N818 - internal signal, never seen by users
    """No solver solved the QP."""


def checked_solver(name: str) -> str:
    """`name` when that solver is installed.

    Raises:
        UnknownNameError: there is no such solver; lists those that are installed.
        MissingExtraError: an extra of jacokin brings it.
    """
    if isinstance(name, str) and name in EXTRAS and name not in qpsolvers.available_solvers:
        raise MissingExtraError(f"qp_solver={name!r}: {EXTRAS[name][0]}", EXTRAS[name][1])
    return checks.choice("qp_solver", name, qpsolvers.available_solvers)


class Backend:
    """Solves QPs with one solver, and with another one when that fails.

    Attributes:
        name: the solver asked for.
        used: what ran since `reset`; names the fallback when one was needed.
    """

    def __init__(self, name: str) -> None:
        """Choose a solver.

        Raises:
            UnknownNameError: it is not installed.
        """
        self.name = checked_solver(name)
        self.used = name
        others = [fallback for fallback in FALLBACKS if fallback in qpsolvers.available_solvers and fallback != name]
        self._order = (name, *others)

    def reset(self) -> None:
        """Forget the fallbacks of earlier solves."""
        self.used = self.name

    def step(
        self, configuration: mink.Configuration, tasks: Sequence[mink.Task], limits: Sequence[mink.Limit]
    ) -> Array:
        """Displacement of the joints (nv,) [rad] that minimises mink's tasks within its limits.

        Raises:
            QPFailed: neither the solver nor a fallback gave finite numbers.
        """
        import mink

        try:
            problem = mink.build_ik(configuration, tasks, 1.0, damping=TIKHONOV, limits=limits)
        except (mink.MinkError, ValueError) as error:
            raise QPFailed from error
        return self._first_solution(lambda solver: _solve(problem, solver))

    def minimize(self, hessian: Array, gradient: Array, inequalities: Inequalities, low: Array, high: Array) -> Array:
        """The x (n,) that minimises x H x / 2 + g x with G x <= h and low <= x <= high; the bounds are met exactly.

        Raises:
            QPFailed: neither the solver nor a fallback gave finite numbers.
        """

        def run(solver: str) -> Array | None:
            if solver == "daqp":
                return _run_daqp(hessian, gradient, inequalities, low, high)
            rows, ends = inequalities
            return _solve(qpsolvers.Problem(hessian, gradient, rows, ends, lb=low, ub=high), solver)

        return np.minimum(np.maximum(self._first_solution(run), low), high)

    def _first_solution(self, run: Callable[[str], Array | None]) -> Array:
        for solver in self._order:
            try:
                found = run(solver)
            except (qpsolvers.QPError, osqp.OSQPException, ValueError):
                continue
            # An active-set solver given NaN reports success.
            if found is not None and math.isfinite(sum(found.tolist())):  # of six numbers faster than NumPy
                if solver != self.name:
                    self.used = f"{self.name}, then {solver}"
                return found
        raise QPFailed


def _solve(problem: qpsolvers.Problem, solver: str) -> Array | None:
    """The solution by a solver of qpsolvers; None when it finds none."""
    if solver == "osqp":  # wants sparse matrices
        rows = None if problem.G is None else scipy.sparse.csc_matrix(problem.G)
        problem = qpsolvers.Problem(
            scipy.sparse.csc_matrix(problem.P), problem.q, rows, problem.h, lb=problem.lb, ub=problem.ub
        )
    solution = qpsolvers.solve_problem(problem, solver=solver, **OPTIONS.get(solver, {}))
    return solution.x if solution.found else None


def _run_daqp(hessian: Array, gradient: Array, inequalities: Inequalities, low: Array, high: Array) -> Array | None:
    """DAQP called directly: the way through qpsolvers costs more than the solve itself.

    Its first bounds are those of the variables, the others belong to the rows.
    """
    rows, ends = inequalities
    if rows is None or ends is None:
        rows, above, below = hessian[:0], high, low
    else:
        above, below = np.concatenate([high, ends]), np.concatenate([low, np.full(ends.size, -1e30)])
    found, _, flag, _ = daqp.solve(hessian, gradient, rows, above, below, np.zeros(above.size, dtype=np.int32))
    return np.array(found) if flag in (1, 2) else None  # optimal, with or without softened constraints
