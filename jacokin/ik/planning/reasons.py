"""Why a path cannot be followed to its end: out of reach, a limit, an obstacle, or a gap between branches."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from jacokin.arrays import Array
from jacokin.ik import diagnosis
from jacokin.ik.planning.manifold import Manifold
from jacokin.ik.planning.rungs import Rung
from jacokin.ik.planning.search import Search

if TYPE_CHECKING:
    from jacokin.ik.solver import IKSolver

TIGHT = 0.05  # [rad] a joint this near to its limit is why a way ends


def of_first(rung: Rung, solver: IKSolver, manifold: Manifold, from_start: bool) -> str:
    """When the path does not begin."""
    if from_start and len(rung.x):
        return "the given start is not at the first pose"
    return f"no configuration at the first pose: {of_rung(rung, solver, manifold)}"


def of_rung(rung: Rung, solver: IKSolver, manifold: Manifold) -> str:
    """When a place has no configuration."""
    if not rung.solutions:
        return "out of reach"
    if rung.touching:
        return "contact of " + ", ".join(f"{a} and {b}" for a, b in rung.touching[:2])
    if manifold.has_families:
        return solver.solve(manifold.path.target(rung.u), closest=False).message
    rows = solver.closed_form().solve_all(manifold.path.at(np.array([rung.u]))[0], solver.robot.home)
    return diagnosis.of_branches(rows, solver.robot.joint_names).message


def of_end(search: Search, reached: float, q: Array, blocked: str, solver: IKSolver) -> str:
    """When the best way ends at a place, which is that of a rung, in a configuration (dof,)."""
    manifold, robot = search.ladder.manifold, solver.robot
    index = [rung.u for rung in search.rungs].index(reached)
    here, ahead = search.rungs[index], search.rungs[index + 1]
    line = min(int(here.u), manifold.path.lines - 1)
    where = f"the best way ends at {100.0 * (here.u - line):.4g} % of line {line}"
    if not len(ahead.x):
        return f"{where}: {of_rung(ahead, solver, manifold)}"
    if blocked:
        return f"{where}: contact of {blocked}"
    away = manifold.difference(np.repeat(here.x, len(ahead.x), axis=0), np.tile(ahead.x, (len(here.x), 1)))
    away = away[:, : manifold.dof]
    nearest = away[np.argmin(np.abs(away).max(axis=1))]
    joint = int(np.argmax(np.abs(nearest)))
    margin = np.minimum(q - robot.lower, robot.upper - q)
    tight = int(np.argmin(margin))
    if margin[tight] < TIGHT:
        return f"{where}: {robot.joint_names[tight]} runs into its limit, and no branch within the limits follows"
    return f"{where}: a gap between branches, {abs(float(nearest[joint])):.3g} rad in {robot.joint_names[joint]}"
