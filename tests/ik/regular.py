"""Poses where derivatives exist."""

from __future__ import annotations

import numpy as np

from jacokin import IKSolver
from jacokin.arrays import Array


def regular(solver: IKSolver, rng: np.random.Generator, size: int) -> tuple[Array, Array]:
    """Configurations (size, dof) that are not singular, and the poses (size, 4, 4) there."""
    rows = list[Array]()
    while len(rows) < size:
        q = solver.robot.sample(rng)
        if solver.robot.singular_values(q).min() > 0.05:
            rows.append(q)
    return np.array(rows), np.array([solver.verifier.tool_pose(q).homogeneous for q in rows])
