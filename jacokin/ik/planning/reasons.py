"""Why a path cannot be followed to its end: out of reach, a limit, an obstacle, or a gap between branches."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from jacokin.ik import diagnosis
from jacokin.ik.planning.cartesian import CartesianPath
from jacokin.ik.planning.ladder import Rung
from jacokin.ik.planning.search import Search

if TYPE_CHECKING:
    from jacokin.ik.solver import IKSolver


def of_first(rung: Rung, solver: IKSolver, path: CartesianPath, from_start: bool) -> str:
    """When the path does not begin."""
    if from_start and len(rung.q):
        return "the given start is not at the first pose"
    return f"no configuration at the first pose: {of_rung(rung, solver, path)}"


def of_rung(rung: Rung, solver: IKSolver, path: CartesianPath) -> str:
    """When a place has no configuration."""
    if not rung.solutions:
        return "out of reach"
    if rung.touching:
        return "contact of " + ", ".join(f"{a} and {b}" for a, b in rung.touching[:2])
    where = np.array([rung.u])
    parameters = path.parameters(rung.u, 0.1)
    tried = [solver.closed_form().solve_all(path.at(where, np.array([p]))[0], solver.robot.home) for p in parameters]
    best = max((rows for rows in tried if len(rows)), key=lambda rows: rows.margin.min(axis=1).max(), default=None)
    if best is None:
        return "out of reach"
    return diagnosis.of_branches(best, solver.robot.joint_names).message


def of_end(search: Search, reached: int, blocked: str, solver: IKSolver) -> str:
    """When the best way ends at a rung."""
    path = search.ladder.path
    here, ahead = search.rungs[reached], search.rungs[reached + 1]
    line = min(int(here.u), path.lines - 1)
    where = f"the best way ends at {100.0 * (here.u - line):.4g} % of line {line}"
    if not len(ahead.q):
        return f"{where}: {of_rung(ahead, solver, path)}"
    if blocked:
        return f"{where}: contact of {blocked}"
    away = search.ladder.difference(np.repeat(here.q, len(ahead.q), axis=0), np.tile(ahead.q, (len(here.q), 1)))
    nearest = away[np.argmin(np.abs(away).max(axis=1))]
    joint = int(np.argmax(np.abs(nearest)))
    name = solver.robot.joint_names[joint]
    margin = np.minimum(here.q - solver.robot.lower, solver.robot.upper - here.q)
    tight = np.unravel_index(np.argmin(margin), margin.shape)
    if margin[tight] < 0.05:
        name_of_limit = solver.robot.joint_names[int(tight[1])]
        return f"{where}: {name_of_limit} runs into its limit, and no branch within the limits follows"
    return f"{where}: a gap between branches, {abs(float(nearest[joint])):.3g} rad in {name}"
