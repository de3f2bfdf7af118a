"""Candidates verified side by side, against the same one by one."""

from __future__ import annotations

import numpy as np
import pytest

from jacokin.arrays import Array
from jacokin.kernels.branches import (
    ABREAST,
    COLUMNS,
    FAMILY,
    FOUND,
    MAX_BRANCHES,
    BranchWork,
    PoseQuery,
    collect,
    fill_row,
    make_branches,
    verify,
)
from tests.kernels.six_joints.arms import chain_of_arm, perturbed

LIMITS = np.array([[-np.inf, 0.8, -1.0, -7.0, 0.3, -np.inf], [np.inf, 5.5, 1.0, 7.0, 0.3, np.inf], [1e-9] * 6])


def collected(rows: Array) -> BranchWork:
    """Work arrays with candidates (n, 6) in them."""
    work = make_branches(np.empty((MAX_BRANCHES, COLUMNS)))
    for n, q in enumerate(rows):
        work.lanes.rows[FOUND : FOUND + 6, n] = q
        collect(work, n, n, float(n % 2))
    return work


@pytest.mark.one_quick
@pytest.mark.parametrize("count", [1, ABREAST - 1, ABREAST])
@pytest.mark.parametrize("size", [0.9, 4.0, 3e6])
def test_side_by_side_is_as_one_by_one(rng: np.random.Generator, count: int, size: float) -> None:
    """To the last bit: within limits and past them, beside a limit, and at angles that the C library is left with."""
    chain = perturbed(chain_of_arm("generic"), 0.3)
    for _ in range(20):
        rows = rng.uniform(-size, size, (count, 6))
        rows[0, 4] = 0.3 - rng.choice([0.0, 5e-10, 2e-9])
        T = np.eye(4)
        T[:3] = chain[3]
        query = PoseQuery(chain, LIMITS, T, rng.uniform(-size, size, 6))
        work = collected(rows)
        assert verify(query, work) == count
        assert work.lanes.filled[0] == 0
        for n in range(count):
            work.newton.q[:], work.row[FAMILY] = rows[n], n % 2
            fill_row(query, work)
            np.testing.assert_array_equal(work.lanes.rows[:COLUMNS, n], work.row)
